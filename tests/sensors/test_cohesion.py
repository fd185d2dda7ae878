from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from selector.errors import InputError
from selector.sensors import Partition, chaining_findings, correlation_similarity, lambda_axis, lambda_cut
from tests.sensors.by_definition import f_statistic


def f_of_vectors(vectors, labels):
    """F written out over explicit feature vectors, one row per sensor."""
    n, r = len(vectors), labels.max() + 1
    overall = vectors.mean(axis=0)
    between = within = 0.0
    for group in range(r):
        own = vectors[labels == group]
        between += len(own) * np.sum((own.mean(axis=0) - overall) ** 2)
        within += np.sum((own - own.mean(axis=0)) ** 2)
    return (between / (r - 1)) / (within / (n - r))


@pytest.mark.parametrize("seed", range(20))
def test_equals_f_over_explicit_feature_vectors(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(3, 15))
    samples = rng.standard_normal((30, 3)) @ rng.standard_normal((3, n)) + 0.3 * rng.standard_normal((30, n))
    similarity = correlation_similarity(samples).matrix
    centred = samples - samples.mean(axis=0)
    vectors = (centred / np.linalg.norm(centred, axis=0)).T
    for step in lambda_axis(similarity):
        labels = np.array(step.partition.labels)
        if step.f is None:
            assert labels.max() + 1 in (1, n)
            continue
        expected = f_of_vectors(vectors, labels)
        # within is a difference of sums near n, wrong by some 1e-15 n; here it is never below 1e-4
        assert f_statistic(similarity, step.partition).value == pytest.approx(expected, rel=1e-9)
        assert step.f.value == pytest.approx(expected, rel=1e-9)
        assert (step.f.between_df, step.f.within_df) == (labels.max(), n - labels.max() - 1)
        p_value = stats.f.sf(expected, step.f.between_df, step.f.within_df)
        assert step.f.p_value == pytest.approx(p_value, rel=1e-6)


def test_a_bad_partition_has_a_large_p_value():
    similarity = np.full((6, 6), 0.1)
    similarity[:3, :3] = similarity[3:, 3:] = 0.9
    np.fill_diagonal(similarity, 1.0)
    good, bad = (f_statistic(similarity, Partition(labels, 0.5)) for labels in ((0, 0, 0, 1, 1, 1), (0, 1, 0, 1, 0, 1)))
    assert good.value > 20 > 1 > bad.value
    assert good.p_value < 0.01 < 0.4 < bad.p_value


def test_absolute_similarity_without_vectors_is_not_hidden():
    """|r| need not be a correlation matrix; then even the scatter between groups can be negative."""
    s = np.array([[1, 1, 0.9, 0], [1, 1, 0, 0.9], [0.9, 0, 1, 1], [0, 0.9, 1, 1.0]])
    assert np.linalg.eigvalsh(s)[0] < 0
    f = f_statistic(s, Partition((0, 1, 1, 0), 0.5))
    # within = 2 (2 − 2/2) = 2, total = 4 − 11.6/4 = 1.1
    assert f.value == pytest.approx((1.1 - 2) / (2 / 2), abs=1e-12)
    assert f.p_value == 1.0


def arcs(*sizes, step):
    """Sensors along arcs in planes at right angles: neighbours `step` rad apart, far ends unlike."""
    n = sum(sizes)
    vectors = np.zeros((n, 2 * len(sizes)))
    row = 0
    for plane, size in enumerate(sizes):
        angle = step * np.arange(size)
        vectors[row : row + size, 2 * plane] = np.cos(angle)
        vectors[row : row + size, 2 * plane + 1] = np.sin(angle)
        row += size
    similarity = np.clip(vectors @ vectors.T, -1, 1)
    similarity = (similarity + similarity.T) / 2
    np.fill_diagonal(similarity, 1.0)
    return similarity


def test_37_sensors_in_two_groups_at_09_are_a_chain():
    similarity = arcs(25, 12, step=0.1)
    names = [f"T{i + 1}" for i in range(37)]
    partition = lambda_cut(similarity, 0.9, names)
    assert len(partition.members) == 2
    first, second = chaining_findings(similarity, partition)
    assert (first.id, first.level) == ("chaining", "warning")
    assert first.evidence["pair"] == ["T1", "T25"]
    assert first.evidence["path"] == names[:25]
    assert first.evidence["smallest_similarity"] == pytest.approx(np.cos(2.4), abs=1e-12)
    assert "25 of 37 sensors" in first.statement
    assert "T1 and T25" in first.statement
    assert "-0.7374" in first.statement
    assert second.evidence["sensors"] == 12
    # the suggestion works: just above that level the pair is apart
    above = lambda_cut(similarity, np.nextafter(first.evidence["parts_above"], 2), names)
    assert above.labels[0] != above.labels[24]
    assert lambda_cut(similarity, first.evidence["parts_above"], names).labels[24] == 0


def test_compact_groups_are_no_chain():
    assert chaining_findings(arcs(4, 3, step=0.1), lambda_cut(arcs(4, 3, step=0.1), 0.9)) == ()
    assert chaining_findings(np.eye(5), lambda_cut(np.eye(5), 0.9)) == ()
    assert chaining_findings(np.ones((5, 5)), lambda_cut(np.ones((5, 5)), 1.0)) == ()
    almost = np.full((3, 3), 1 - 2.0**-53)
    almost[0, 1] = almost[1, 0] = almost[1, 2] = almost[2, 1] = 1
    np.fill_diagonal(almost, 1)
    assert chaining_findings(almost, lambda_cut(almost, 1.0)) == ()


def test_the_limit_is_twice_the_distance_that_the_level_allows():
    # on a straight line in angle: two links of acos(0.9) stay below twice the chord, so three links are needed
    step = np.arccos(0.9) - 1e-9
    assert chaining_findings(arcs(3, step=step), lambda_cut(arcs(3, step=step), 0.9)) == ()
    four = arcs(4, step=step)
    (finding,) = chaining_findings(four, lambda_cut(four, 0.9))
    assert finding.evidence["path"] == ["x0", "x1", "x2", "x3"]


def test_path_between_branches_of_the_tree():
    # a star with three long arms: the path runs down one arm and up another
    n, arm = 13, 4
    r = np.full((n, n), 0.1)
    for a in range(3):
        previous = 0
        for k in range(arm):
            sensor = 1 + a * arm + k
            r[previous, sensor] = r[sensor, previous] = 0.95
            previous = sensor
    np.fill_diagonal(r, 1)
    r[4, 8] = r[8, 4] = 0.0
    (finding,) = chaining_findings(r, lambda_cut(r, 0.9))
    assert finding.evidence["path"] == [f"x{i}" for i in (4, 3, 2, 1, 0, 5, 6, 7, 8)]
    assert finding.evidence["parts_above"] == 0.95


def test_partition_of_other_sensors():
    with pytest.raises(InputError, match="same sensors"):
        chaining_findings(np.eye(3), Partition((0, 1), 0.5))
