"""Correction programs: the printed example, and that no curve ever drifts by more than the tolerance."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from selector.errors import InputError
from selector.physics.thermal.prediction.correction_program import (
    MOST_CORRECTIONS,
    correction_program,
    notation,
    program_blocks,
    program_table,
)

# the curve from which the printed program follows (C eq. 6): 10 µm are reached 18 and 45 min after the first zero,
# 15 and 55 min after the second; the three later operations drift by less than 10 µm
EXAMPLE_MIN = np.array([0.0, 18, 45, 60, 75, 115, 120, 180, 240, 300])
EXAMPLE_UM = np.array([0.0, 10, 20, 24, 34, 44, 45, 50, 53, 55])
PRINTED = ["3-{18,27,15}-{0,10,10}", "3-{15,40,5}-{0,10,10}", "1-{60}-{0}", "1-{60}-{0}", "1-{60}-{0}"]


def example(resolution_s=None):
    return correction_program(EXAMPLE_MIN * 60, EXAMPLE_UM, [3600] * 5, 10.0, resolution_s)


@pytest.mark.parametrize("resolution_s", [None, 60.0])
def test_printed_example(resolution_s):
    program = example(resolution_s)
    assert [notation(operation) for operation in program.operations] == PRINTED
    # exact: every number of this curve is a small integer, and so is every crossing
    expected = {"corrections_um": [0.0, 10.0, 10.0], "tolerance_um": 10.0}
    assert program.operations[0].as_dict() == expected | {"durations_min": [18.0, 27.0, 15.0]}
    assert program.operations[1].as_dict() == expected | {"durations_min": [15.0, 40.0, 5.0]}


def test_printed_example_turned_over():
    program = correction_program(EXAMPLE_MIN * 60, -EXAMPLE_UM, [3600] * 5, 10.0)
    assert program.operations[0].corrections_um.tolist() == [0.0, -10.0, -10.0]


@st.composite
def curves(draw):
    """Curves that turn back, jump within a microsecond, stand still, or start far from zero; operations; tolerance."""
    steps = draw(st.lists(st.sampled_from([1e-6, 0.5, 1.0, 7.3, 60.0, 600.0]), min_size=1, max_size=25))
    time = np.r_[0.0, np.cumsum(steps)]
    value = st.one_of(st.sampled_from([0.0, 10.0, -10.0, 20.0]), st.floats(-300, 300))
    displacement = np.array(draw(st.lists(value, min_size=len(time), max_size=len(time))))
    displacement += draw(st.sampled_from([0.0, 1e4]))
    shares = np.array(draw(st.lists(st.floats(0.05, 1.0), min_size=1, max_size=4)))
    lengths = shares / shares.sum() * time[-1] * draw(st.sampled_from([1.0, 0.6]))
    return time, displacement, lengths, draw(st.sampled_from([0.5, 3.0, 10.0]))


def rounding_um(time, displacement):
    """A time is no finer than its last bit, during which a steep curve moves on; and so is a displacement."""
    steepest = np.abs(np.diff(displacement) / np.diff(time)).max()
    return 8 * np.finfo(float).eps * (steepest * time[-1] + np.abs(displacement).max())


@settings(max_examples=60)
@given(curves())
def test_drift_never_exceeds_the_tolerance(curve):
    time, displacement, lengths, tolerance = curve
    program = correction_program(time, displacement, lengths, tolerance)
    times, left = program.drift_left_um(time, displacement)
    # the drift is linear between these times, so its largest value is at one of them; 1e-8: what counts as reached
    assert np.abs(left).max() <= tolerance * (1 + 1e-8) + rounding_um(time, displacement)
    # nothing is left out: every sample inside of the operations is among the times
    assert np.isin(time[(time > 0) & (time < lengths.sum() * (1 - 1e-12))], times).all()
    for operation, length in zip(program.operations, lengths, strict=True):
        assert operation.corrections_um[0] == 0.0
        assert (operation.durations_s >= 0).all()
        # rounding of sums of at most 29 numbers
        assert operation.durations_s.sum() == pytest.approx(length, rel=1e-12, abs=1e-12 * time[-1])
        # none is wasted: each takes off the whole tolerance, or several at once where the curve jumps
        taken = np.abs(operation.corrections_um[1:]) / tolerance
        assert taken == pytest.approx(np.round(taken))
        assert (np.round(taken) >= 1).all()


@settings(max_examples=50)
@given(curves(), st.sampled_from([0.5, 5.0, 60.0]))
def test_a_resolution_is_kept_and_never_late(curve, resolution_s):
    time, displacement, lengths, tolerance = curve
    # the curve moves most in a window that begins or ends where it bends
    bends = np.clip(np.r_[time, time + resolution_s, time - resolution_s], 0.0, time[-1])
    fine = np.union1d(np.linspace(0, time[-1], 2001), bends)
    of = np.interp(fine, time, displacement)
    try:
        program = correction_program(time, displacement, lengths, tolerance, resolution_s)
    except InputError:
        # only where the curve moves by more than the tolerance within the resolution
        ends = np.searchsorted(fine, fine + resolution_s * (1 + 1e-9), side="right")
        assert max(np.ptp(of[i : max(end, i + 1)]) for i, end in enumerate(ends)) > 0.9 * tolerance
        return
    _, left = program.drift_left_um(time, displacement)
    assert np.abs(left).max() <= tolerance * (1 + 1e-8) + rounding_um(time, displacement)
    for operation in program.operations:
        whole = (operation.times_s - operation.start_s) / resolution_s
        assert whole == pytest.approx(np.round(whole), abs=1e-6)  # rounding of start + k·resolution


def test_reached_at_the_end_needs_no_correction():
    program = correction_program(np.array([0.0, 3600.0]), np.array([0.0, 30.0]), [3600.0], 10.0)
    assert notation(program.operations[0]) == "3-{20,20,20}-{0,10,10}"


def test_reached_and_turned_back_is_corrected_and_taken_back():
    minutes = np.array([0.0, 10, 20])
    program = correction_program(minutes * 60, np.array([0.0, 10, -5]), [1200.0], 10.0)
    # +10 at 10 min; 10 µm below that is 0, which falls at 10 + 10·10/15 min
    assert program.operations[0].corrections_um.tolist() == [0.0, 10.0, -10.0]
    assert program.operations[0].times_s == pytest.approx([0, 600, 1000], rel=1e-12)


def test_what_is_left_of_another_curve_is_the_error_of_the_prediction():
    minutes = np.linspace(0, 60, 61)
    predicted, true = 0.5 * minutes, 0.6 * minutes
    program = correction_program(minutes * 60, predicted, [3600.0], 10.0)
    times, left = program.drift_left_um(minutes * 60, true)
    # corrections at 20 and 40 min (60 min is the end): before the second 24 − 10 µm, at the end 36 − 20 µm
    assert left[np.flatnonzero(times == 2400.0)] == pytest.approx([14.0, 4.0])
    assert np.abs(left).max() == pytest.approx(16.0)


@pytest.mark.parametrize(
    ("time", "displacement", "said"),
    [
        ([0.0, 60, 120], [0.0, np.nan, 1], "missing"),
        ([0.0, 60, 60], [0.0, 1, 1], "repeat"),
        ([0.0, 60, 30], [0.0, 1, 1], "go back"),
        ([0.0, 60], [0.0, 1], "covers"),
        ([5.0, 600], [0.0, 1], "covers"),
        ([0.0, 600], [0.0], "pairs"),
        ([0.0, 600], [0.0, np.inf], "infinite"),
        ([0.0, 600], [-1e308, 1e308], str(MOST_CORRECTIONS)),
    ],
)
def test_curves_that_cannot_be_used(time, displacement, said):
    with pytest.raises(InputError, match=said):
        correction_program(np.array(time), np.array(displacement), [120.0], 10.0)


def test_a_resolution_that_is_too_coarse_is_refused():
    with pytest.raises(InputError, match="finer resolution"):
        correction_program(np.array([0.0, 3600]), np.array([0.0, 30]), [3600.0], 10.0, 1800.0)


def test_table_and_blocks_say_the_same():
    programs = {"Z": example(), "=cmd|'x'!A1\n": correction_program(EXAMPLE_MIN * 60, -EXAMPLE_UM, [3600] * 5, 10.0)}
    rows = [line.split(",") for line in program_table(programs).splitlines()]
    assert len({len(row) for row in rows}) == 1
    assert rows[2] == ["Z", "1", "2", "18.0000", "27.0000", "10.000", "10.000", "0.010000", "0.010000"]
    assert rows[3][-4:] == ["10.000", "20.000", "0.010000", "0.020000"]
    assert all(row[0] == "Z" or row[0].startswith("'=") for row in rows[1:])
    blocks = program_blocks(programs)
    for expected in (PRINTED[0], "AT   0:18:00  OFFSET   +10.000 µm (+0.010000 mm)", "SUBTRACTED", "VERIFY THE SIGN"):
        assert expected in blocks
    assert "OFFSET   -20.000 µm" in blocks


def test_blocks_are_never_late():
    program = correction_program(np.array([0.0, 3600]), np.array([0.0, 10.1]), [3600.0], 10.0)
    # reached after 3564.36 s = 59 min 24.36 s
    assert "AT   0:59:24" in program_blocks({"Z": program})
    # who types it in has not read the answer
    of_two = program_blocks({"Z": program, "Y": program}, ["Y"]).splitlines()
    assert [line[:3] for line in of_two if "DO NOT USE" in line] == ["[Y]"]


@settings(max_examples=100)
@given(curves())
def test_printed_times_are_never_late_and_add_up(curve):
    time, displacement, lengths, tolerance = curve
    for operation in correction_program(time, displacement, lengths, tolerance).operations:
        durations = [float(part) for part in notation(operation).split("{")[1].split("}")[0].split(",")]
        minutes = (operation.end_s - operation.start_s) / 60
        # each is printed to 0.0001 min
        assert sum(durations) == pytest.approx(minutes, abs=1e-4 * len(durations) + 1e-9)
        late = np.cumsum(durations[:-1]) - (operation.times_s[1:] - operation.start_s) / 60
        assert (late <= 0.001 + 1e-9).all()  # 0.06 s, see `notation`
        assert (late > -0.1 - 1e-9).all()


def test_program_csv_is_rounded_down():
    program = correction_program(np.array([0.0, 3600]), np.array([0.0, 10.1]), [3600.0], 10.0)
    assert program_table({"Z": program}).splitlines()[2].split(",")[3] == "59.4059"  # 59.40594 min
