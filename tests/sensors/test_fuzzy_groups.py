"""Fuzzy groups: memberships from the similarity alone, and which sensors stand between two groups."""

import numpy as np
import pytest
from skfuzzy.cluster import cmeans

from selector.errors import OptionError
from selector.sensors import correlation_similarity
from selector.sensors.groups import between_finding, cut_beside, fuzzy_groups, lambda_axis, lambda_cut


def readings(between=0.5, n=400, seed=3):
    """Three sensors at each of two places that warm up on their own, and one that hears both."""
    rng = np.random.default_rng(seed)
    one, other = np.cumsum(rng.normal(size=(2, n)), axis=1)
    one, other = one / one.std(), other / other.std()
    near = [one + 0.1 * rng.normal(size=n) for _ in range(3)] + [other + 0.1 * rng.normal(size=n) for _ in range(3)]
    return np.array([*near, between * one + (1.0 - between) * other])


NAMES = ("a1", "a2", "a3", "b1", "b2", "b3", "c")


def similarity_of(rows):
    return correlation_similarity(rows.T).matrix


@pytest.mark.parametrize("n_groups", [2, 3])
def test_memberships_are_those_of_c_means_on_the_series_themselves(n_groups):
    rows = readings()
    fuzzy = fuzzy_groups(similarity_of(rows), n_groups, NAMES)
    centred = rows - rows.mean(axis=1, keepdims=True)
    units = centred / np.linalg.norm(centred, axis=1, keepdims=True)
    _, shares, *_, fpc = cmeans(units.T, n_groups, 2.0, 1e-9, 1000, init=np.array(fuzzy.memberships.T))
    # both stop when a step changes less than 1e-9
    assert fuzzy.memberships == pytest.approx(shares.T, abs=1e-6)
    assert fuzzy.fpc == pytest.approx(fpc, abs=1e-6)
    assert 1.0 / n_groups < fuzzy.fpc < 1.0
    assert 0.0 < fuzzy.crispness < fuzzy.fpc


def test_a_sensor_that_hears_two_places_is_told_and_one_that_hears_one_is_not():
    fuzzy = fuzzy_groups(similarity_of(readings()), 2, NAMES)
    assert [NAMES[i] for i, _, _ in fuzzy.between] == ["c"]
    (finding,) = between_finding(fuzzy)
    assert (finding.id, finding.where.channel) == ("between-groups", "c")
    clear = fuzzy_groups(similarity_of(readings(between=0.95)), 2, NAMES)
    assert clear.between == ()
    assert between_finding(clear) == ()
    assert clear.partition.groups == (("a1", "a2", "a3", "c"), ("b1", "b2", "b3"))


def test_a_group_is_called_after_the_sensor_that_belongs_to_it_most():
    order = [6, 0, 1, 2, 3, 4, 5]
    (finding,) = between_finding(fuzzy_groups(similarity_of(readings()[order]), 2, [NAMES[i] for i in order]))
    assert finding.statement.startswith("c (0.")
    # and not after the first, which stands between
    assert "with c" not in finding.statement


def test_the_order_of_the_sensors_changes_nothing():
    rows, order = readings(), [4, 6, 0, 2, 5, 1, 3]
    one, other = (fuzzy_groups(similarity_of(each), 2) for each in (rows, rows[order]))
    mine = {frozenset(group) for group in one.partition.members}
    theirs = {frozenset(order[i] for i in group) for group in other.partition.members}
    assert mine == theirs
    assert other.fpc == pytest.approx(one.fpc, abs=1e-6)


def test_copies_and_few_sensors():
    similarity = np.array([[1.0, 1.0, 0.2], [1.0, 1.0, 0.2], [0.2, 0.2, 1.0]])
    assert fuzzy_groups(similarity, 2).partition.members == ((0, 1), (2,))
    assert fuzzy_groups(similarity, 3).memberships.sum(axis=1) == pytest.approx(1.0)
    alone = fuzzy_groups(np.ones((1, 1)), 1)
    assert (alone.fpc, alone.crispness, alone.between) == (1.0, 1.0, ())
    assert fuzzy_groups(similarity, 1).between == ()
    for wrong in (0, 4):
        with pytest.raises(OptionError, match="groups of 3 sensors"):
            fuzzy_groups(similarity, wrong)


def test_the_cut_beside_has_as_many_groups_and_agreement_counts_pairs():
    similarity = similarity_of(readings())
    axis = lambda_axis(similarity, NAMES)
    level = cut_beside(axis, 3)
    cut = lambda_cut(similarity, level, NAMES)
    assert len(cut.members) == 3
    fuzzy = fuzzy_groups(similarity, 2, NAMES, level)
    together = [
        (fuzzy.partition.labels[i] == fuzzy.partition.labels[j]) == (cut.labels[i] == cut.labels[j])
        for i in range(7)
        for j in range(i)
    ]
    assert fuzzy.agreement(cut) == pytest.approx(np.mean(together))
    assert fuzzy.agreement(fuzzy.partition) == 1.0
