from __future__ import annotations

import numpy as np
import pytest

from selector.errors import InputError, OptionError
from selector.sensors import Partition, dendrogram, lambda_axis, lambda_cut

R = np.array([[1.0, 0.9, 0.2, 0.1], [0.9, 1.0, 0.6, 0.3], [0.2, 0.6, 1.0, 0.8], [0.1, 0.3, 0.8, 1.0]])


def test_labels_are_canonical_so_equality_is_equality_of_groups():
    assert Partition((7, 7, 2, 7), 0.9) == Partition((0, 0, 1, 0), 0.5)
    assert hash(Partition((7, 7, 2, 7), 0.9)) == hash(Partition((0, 0, 1, 0), 0.5))
    assert Partition((2, 1, 0), 0.9).labels == (0, 1, 2)
    assert Partition((0, 0, 1), 0.9) != Partition((0, 1, 1), 0.9)
    assert Partition((0, 1), 0.9, ("a", "b")) != Partition((0, 1), 0.9, ("b", "a"))


def test_groups_by_name_and_by_index():
    partition = Partition((0, 1, 0), 0.9, ("T1", "T2", "T3"))
    assert partition.members == ((0, 2), (1,))
    assert partition.groups == (("T1", "T3"), ("T2",))
    assert Partition((0, 1), 0.9).names == ("x0", "x1")


@pytest.mark.parametrize(
    ("level", "labels"),
    [
        (1.0, (0, 1, 2, 3)),
        (np.nextafter(0.9, 1), (0, 1, 2, 3)),
        (0.9, (0, 0, 1, 2)),
        (0.8, (0, 0, 1, 1)),
        (0.6, (0, 0, 0, 0)),
        (-1.0, (0, 0, 0, 0)),
    ],
)
def test_a_pair_exactly_at_the_level_is_linked(level, labels):
    assert lambda_cut(R, level).labels == labels


def test_duplicates_stay_together_at_one():
    r = np.array([[1.0, 1.0, 0.3], [1.0, 1.0, 0.3], [0.3, 0.3, 1.0]])
    axis = lambda_axis(r)
    assert [step.partition.labels for step in axis] == [(0, 0, 1), (0, 0, 0)]
    assert axis[0].f.value == np.inf
    assert axis.strongest() is None


@pytest.mark.parametrize("level", [np.nan, 1.0000001, -1.1, np.inf])
def test_levels_outside_the_range(level):
    with pytest.raises(OptionError, match="λ"):
        lambda_cut(R, level)
    with pytest.raises(OptionError, match="λ"):
        lambda_axis(R).at(level)


def test_axis_reads_as_a_sequence():
    axis = lambda_axis(R, ["a", "b", "c", "d"])
    assert len(axis) == 4
    assert [(step.low, step.high) for step in axis] == [(0.9, 1.0), (0.8, 0.9), (0.6, 0.8), (-1.0, 0.6)]
    assert axis[-1].partition.groups == (("a", "b", "c", "d"),)
    assert [axis[k].high for k in (1, 2)] == [0.9, 0.8]
    assert axis.at(0.85) == axis.at(0.9) == axis[1]
    assert axis.at(-1.0) == axis[3]
    assert axis == lambda_axis(R, ["a", "b", "c", "d"])
    with pytest.raises(IndexError):
        axis[4]


def test_one_and_two_sensors():
    alone = lambda_axis([[1.0]])
    assert [(step.low, step.high, step.partition.labels, step.f) for step in alone] == [(-1.0, 1.0, (0,), None)]
    assert [step.partition.labels for step in lambda_axis([[1.0, 0.4], [0.4, 1.0]])] == [(0, 1), (0, 0)]
    assert lambda_axis([[1.0]]).strongest() is None
    for function in (lambda_axis, dendrogram, lambda r: lambda_cut(r, 0.5)):
        with pytest.raises(InputError, match=r"\(0, 0\)"):
            function(np.empty((0, 0)))


def test_strongest_finds_planted_groups():
    rng = np.random.default_rng(0)
    sources = rng.standard_normal((3, 400))
    series = np.repeat(sources, 5, axis=0) + 0.2 * rng.standard_normal((15, 400))
    step = lambda_axis(np.corrcoef(series).round(12) * (1 - np.eye(15)) + np.eye(15)).strongest()
    assert step.partition.labels == tuple(np.repeat([0, 1, 2], 5))
    assert step.f.p_value < 1e-6


def test_dendrogram_by_hand():
    tree = dendrogram(R)
    # 1 − 0.9 and so on as floats subtract them
    assert tree.linkage.tolist() == [[0, 1, 1 - 0.9, 2], [2, 3, 1 - 0.8, 2], [4, 5, 1 - 0.6, 4]]
    assert tree.levels.tolist() == [0.9, 0.8, 0.6]
    assert tree.leaf_order == (0, 1, 2, 3)
    assert not tree.linkage.flags.writeable


def test_names_of_the_wrong_number():
    for function in (lambda_axis, lambda r, names: lambda_cut(r, 0.5, names)):
        with pytest.raises(InputError, match="names"):
            function(R, ["a", "b"])
