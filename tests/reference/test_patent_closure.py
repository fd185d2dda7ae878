"""The printed matrices of CN1868666 (P in the source digest), and where its claims contradict them."""

from __future__ import annotations

import numpy as np
import pytest

from selector.sensors import lambda_axis, lambda_cut, representatives, screen, transitive_closure
from tests.sensors.by_definition import transitive_closure_by_squaring

NAMES = tuple(str(i) for i in range(1, 9))

R = np.array(
    [
        [1.0000, 0.9968, 0.9819, 0.9984, 0.9860, 0.9761, 0.9746, 0.9968],
        [0.9968, 1.0000, 0.9832, 0.9970, 0.9884, 0.9766, 0.9755, 0.9987],
        [0.9819, 0.9832, 1.0000, 0.9887, 0.9980, 0.9992, 0.9988, 0.9838],
        [0.9984, 0.9970, 0.9887, 1.0000, 0.9921, 0.9842, 0.9831, 0.9966],
        [0.9860, 0.9884, 0.9980, 0.9921, 1.0000, 0.9963, 0.9960, 0.9888],
        [0.9761, 0.9766, 0.9992, 0.9842, 0.9963, 1.0000, 0.9998, 0.9779],
        [0.9746, 0.9755, 0.9988, 0.9831, 0.9960, 0.9998, 1.0000, 0.9765],
        [0.9968, 0.9987, 0.9838, 0.9966, 0.9888, 0.9779, 0.9765, 1.0000],
    ]
)
T = np.array(
    [
        [1.0000, 0.9970, 0.9921, 0.9984, 0.9921, 0.9921, 0.9921, 0.9970],
        [0.9970, 1.0000, 0.9921, 0.9970, 0.9921, 0.9921, 0.9921, 0.9987],
        [0.9921, 0.9921, 1.0000, 0.9921, 0.9980, 0.9992, 0.9992, 0.9921],
        [0.9984, 0.9970, 0.9921, 1.0000, 0.9921, 0.9921, 0.9921, 0.9970],
        [0.9921, 0.9921, 0.9980, 0.9921, 1.0000, 0.9980, 0.9980, 0.9921],
        [0.9921, 0.9921, 0.9992, 0.9921, 0.9980, 1.0000, 0.9998, 0.9921],
        [0.9921, 0.9921, 0.9992, 0.9921, 0.9980, 0.9998, 1.0000, 0.9921],
        [0.9970, 0.9987, 0.9921, 0.9970, 0.9921, 0.9921, 0.9921, 1.0000],
    ]
)
CUT_ROWS = ["11010001", "11010001", "00101110", "11010001", "00101110", "00101110", "00101110", "11010001"]


def groups(*text: str) -> tuple[tuple[str, ...], ...]:
    return tuple(tuple(group) for group in text)


def test_printed_closure_is_the_closure_of_the_printed_similarity():
    # no tolerance: the closure picks entries of R, and both are printed with the same four decimals
    assert np.array_equal(transitive_closure(R), T)
    by_squaring, squarings = transitive_closure_by_squaring(R)
    assert np.array_equal(by_squaring, T)
    assert squarings == 3  # R², R⁴, and R⁸ = R⁴ which ends it


def test_printed_cut_rows():
    rows = ["".join("1" if t >= 0.995 else "0" for t in row) for row in transitive_closure(R)]
    assert rows == CUT_ROWS


def test_cut_has_two_classes_where_three_are_claimed():
    assert lambda_cut(R, 0.995, NAMES).groups == groups("1248", "3567")


def test_the_whole_axis():
    steps = [(step.low, step.high, step.partition.groups) for step in lambda_axis(R, NAMES)]
    assert steps == [
        (0.9998, 1.0000, groups(*"12345678")),
        (0.9992, 0.9998, groups("1", "2", "3", "4", "5", "67", "8")),
        (0.9987, 0.9992, groups("1", "2", "367", "4", "5", "8")),
        (0.9984, 0.9987, groups("1", "28", "367", "4", "5")),
        (0.9980, 0.9984, groups("14", "28", "367", "5")),
        (0.9970, 0.9980, groups("14", "28", "3567")),
        (0.9921, 0.9970, groups("1248", "3567")),
        (-1.0, 0.9921, groups("12345678")),
    ]


def test_no_level_gives_three_classes_with_1_3_5_apart():
    for step in lambda_axis(R, NAMES):
        one, three, five = (step.partition.labels[NAMES.index(name)] for name in "135")
        apart = len({one, three, five}) == 3
        assert apart == (step.high > 0.9980)
        if apart:
            assert len(step.partition.groups) >= 4


@pytest.mark.parametrize(
    ("level", "expected"),
    [
        (0.9980, groups("14", "28", "3567")),
        (np.nextafter(0.9980, 1), groups("14", "28", "367", "5")),
        (0.9984, groups("14", "28", "367", "5")),
        (np.nextafter(0.9984, 1), groups("1", "28", "367", "4", "5")),
    ],
)
def test_1_3_5_first_part_just_above_09980_with_four_classes(level, expected):
    assert lambda_cut(R, level, NAMES).groups == expected


def test_claimed_representatives_cannot_come_from_one_cut_at_the_printed_level():
    """Whatever the relevance, one sensor per class at 0.995 is two sensors: never 1, 3 and 5."""
    partition = lambda_cut(R, 0.995, NAMES)
    relevance = [1.0 if name in "135" else 0.5 for name in NAMES]
    assert [NAMES[i] for i in representatives(partition, relevance)] == ["1", "3"]


def test_second_round_at_the_printed_level_is_without_effect():
    first, second = screen(R, np.linspace(1, 0.9, 8), [0.995, 0.995], names=NAMES)
    assert first.representatives == second.representatives == (0, 2)
    assert [finding.id for finding in second.findings] == ["round-without-effect"]
    assert first.findings == ()


def test_printed_similarity_is_positive_definite():
    # 7.0e-5 as the digest has it, to the two digits given there
    assert np.linalg.eigvalsh(R)[0] == pytest.approx(7.0e-5, abs=0.05e-5)
