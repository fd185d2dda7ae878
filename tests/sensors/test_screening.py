from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from selector.errors import InputError, OptionError
from selector.sensors import Partition, correlation_similarity, representatives, screen, transitive_closure

NAMES = ("T1", "T2", "T3", "T4", "T5")
# {T1, T2, T3} chained at 0.97 with T1–T3 only 0.90; {T4, T5} at 0.96; bridge 0.7
S = np.array(
    [
        [1.00, 0.97, 0.90, 0.50, 0.40],
        [0.97, 1.00, 0.98, 0.60, 0.50],
        [0.90, 0.98, 1.00, 0.70, 0.60],
        [0.50, 0.60, 0.70, 1.00, 0.96],
        [0.40, 0.50, 0.60, 0.96, 1.00],
    ]
)
PARTITION = Partition((0, 0, 0, 1, 1), 0.95, NAMES)


def test_most_relevant_of_each_group_and_ties_go_to_the_first():
    assert representatives(PARTITION, [0.1, 0.9, 0.5, 0.2, 0.3]) == (1, 4)
    assert representatives(PARTITION, [0.9, 0.9, 0.9, 0.3, 0.3]) == (0, 3)


def test_must_and_never():
    relevance = [0.1, 0.9, 0.5, 0.2, 0.3]
    assert representatives(PARTITION, relevance, must=[0]) == (0, 4)
    assert representatives(PARTITION, relevance, must=[2, 0]) == (0, 2, 4)
    assert representatives(PARTITION, relevance, never=[1]) == (2, 4)
    assert representatives(PARTITION, relevance, never=[3, 4]) == (1,)
    assert representatives(PARTITION, relevance, must=[0], never=[1, 4]) == (0, 3)


@pytest.mark.parametrize(
    ("must", "never", "message"),
    [([1], [1], "in both lists"), ([5], [], r"sensors \[5\]"), ([], [-1], r"sensors \[-1\]")],
)
def test_impossible_wishes(must, never, message):
    with pytest.raises(OptionError, match=message):
        representatives(PARTITION, np.ones(5), must, never)


@pytest.mark.parametrize("wishes", [{"must": [5]}, {"constant": [-1]}])
def test_sensors_that_are_not_there(wishes):
    with pytest.raises(OptionError, match=r"sensors \[(5|-1)\]"):
        screen(S, np.ones(5), [0.95], **wishes)


@pytest.mark.parametrize("relevance", [np.ones(4), [1, 1, np.nan, 1, 1], np.ones((5, 1)), [1, 1, np.inf, 1, 1]])
def test_unusable_relevance(relevance):
    with pytest.raises(InputError, match="finite"):
        representatives(PARTITION, relevance)
    with pytest.raises(InputError, match="finite"):
        screen(S, relevance, [0.95])


def test_a_round_with_a_reason_for_each_sensor_dropped():
    (done,) = screen(S, [0.9, 0.5, 0.4, 0.7, 0.2], [0.95], names=NAMES)
    assert done.kept == (0, 1, 2, 3, 4)
    assert done.partition == PARTITION
    assert done.groups == ((0, 1, 2), (3, 4))
    assert done.representatives == (0, 3)
    assert [(d.sensor, d.stands_in) for d in done.dropped] == [(1, 0), (2, 0), (4, 3)]
    assert done.dropped[0].reason.startswith("T1 ")
    assert done.dropped[0].reason.endswith(": r = 0.9700 ≥ λ = 0.95")
    assert done.dropped[1].reason.startswith("T1 ")
    # through links
    assert all(said in done.dropped[1].reason for said in ("r = 0.9000 < λ = 0.95", "t = 0.9700 ≥ λ = 0.95"))


def test_the_most_similar_of_several_musts_stands_in():
    (done,) = screen(S, np.ones(5), [0.95], must=[0, 2], names=NAMES)
    assert done.representatives == (0, 2, 3)
    assert [(d.sensor, d.stands_in) for d in done.dropped] == [(1, 2), (4, 3)]


def test_rounds_with_their_own_levels_regroup_the_kept():
    first, second, third = screen(S, [0.1, 0.2, 0.9, 0.8, 0.3], [0.98, 0.95, 0.7], names=NAMES)
    assert (first.representatives, second.kept) == ((0, 2, 3, 4), (0, 2, 3, 4))
    # T1 hung on T3 through T2, which is gone
    assert second.partition.groups == (("T1",), ("T3",), ("T4", "T5"))
    assert second.representatives == third.kept == (0, 2, 3)
    assert third.partition.groups == (("T1", "T3", "T4"),)
    assert third.representatives == (2,)
    assert [round_.findings for round_ in (first, second, third)] == [(), (), ()]


def test_a_round_without_effect_says_so_and_what_would_have_one():
    _, second = screen(S, np.ones(5), [0.95, 0.95], names=NAMES)
    (finding,) = second.findings
    assert second.dropped == ()
    assert finding.id == "round-without-effect"
    assert finding.evidence == {"lambda": 0.95, "sensors": 2, "next_level": 0.5}
    (alone,) = screen([[1.0]], [1.0], [0.9])
    # there is no level that would have one
    assert alone.findings[0].evidence["next_level"] is None
    assert "λ" not in alone.findings[0].suggestion


def test_suggested_level_of_a_round_without_effect_has_one():
    rng = np.random.default_rng(5)
    s = correlation_similarity(rng.standard_normal((30, 6))).matrix
    (idle,) = screen(s, np.ones(6), [0.99])
    suggested = float(idle.findings[0].suggestion.split("λ = ")[1].split()[0])
    (busy,) = screen(s, np.ones(6), [suggested])
    assert busy.dropped


def test_constant_sensors_represent_nothing():
    samples = np.column_stack([np.arange(9.0), np.arange(9.0) ** 2, np.full(9, 21.0)])
    similarity = correlation_similarity(samples)
    (done,) = screen(similarity.matrix, [0.9, 0.8, 0.0], [0.999], constant=similarity.constant)
    assert done.representatives == (0, 1)
    assert [(d.sensor, d.stands_in) for d in done.dropped] == [(2, None)]
    # nothing stands for it
    assert "λ" not in done.dropped[0].reason
    (wanted,) = screen(similarity.matrix, [0.9, 0.8, 0.0], [0.999], must=[2], constant=similarity.constant)
    assert wanted.representatives == (0, 1, 2)
    assert [finding.id for finding in wanted.findings] == ["constant-must", "round-without-effect"]


def test_everything_may_rest():
    rounds = screen(S, np.ones(5), [0.95, 0.9], constant=range(5))
    assert len(rounds) == 1
    assert rounds[0].representatives == ()


@pytest.mark.parametrize("levels", [[], [1.2], [np.nan]])
def test_unusable_levels(levels):
    with pytest.raises(OptionError, match=r"level|λ"):
        screen(S, np.ones(5), levels)


@pytest.mark.parametrize(
    ("value", "level", "text"),
    [
        (0.99496, 0.995, "r = 0.99496 < λ = 0.995"),
        (0.9950001, 0.995, "r = 0.9950 ≥ λ = 0.995"),
        (0.99841278, 0.99841278, "r = 0.998413 ≥ λ = 0.998413"),
        (0.9985001, 0.9985002, "r = 0.9985001 < λ = 0.9985002"),
    ],
)
def test_a_comparison_is_printed_with_enough_digits_to_be_true(value, level, text):
    s = np.array([[1, value, 0.9999], [value, 1, 0.9999], [0.9999, 0.9999, 1]])
    (done,) = screen(s, [1, 0.5, 0.1], [level])
    assert done.dropped[0].sensor == 1
    assert text in done.dropped[0].reason


@settings(max_examples=100)
@given(st.integers(1, 14), st.integers(0, 2**32 - 1), st.data())
def test_nothing_is_lost_and_a_second_round_at_no_lower_level_drops_nothing(n, seed, data):
    rng = np.random.default_rng(seed)
    s = correlation_similarity(rng.standard_normal((6, 3)) @ rng.standard_normal((3, n))).matrix
    level = data.draw(st.floats(-1, 1))
    again = data.draw(st.floats(level, 1))
    wishes = rng.integers(0, 4, n)
    must, resting = np.flatnonzero(wishes == 0).tolist(), np.flatnonzero(wishes == 1).tolist()
    relevance = rng.uniform(0, 1, n).round(1)
    rounds = screen(s, relevance, [level, again], must, constant=resting)
    first = rounds[0]
    assert sorted([*first.representatives, *(d.sensor for d in first.dropped)]) == list(range(n))
    assert set(must) <= set(first.representatives)
    assert not set(resting) & set(first.representatives)
    closure = transitive_closure(s)
    for drop in first.dropped:
        assert drop.reason
        if drop.stands_in is not None:
            assert closure[drop.sensor, drop.stands_in] >= level
            assert drop.stands_in in first.representatives
    for group in first.groups:
        own = [i for i in group if i in first.representatives]
        assert own or set(group) <= set(resting)
        if own and not set(own) & set(must):
            assert len(own) == 1
            assert relevance[own[0]] == max(relevance[i] for i in group if i not in resting)
    if len(rounds) == 2:
        assert rounds[1].dropped == ()
        assert [finding.id for finding in rounds[1].findings] == ["round-without-effect"]
