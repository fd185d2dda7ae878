"""The Kalman filter of touch-offs against other implementations, its gate and its limits; and what it learns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from selector.adaptation.drift import LAST_READING, Course, Drift, Touches, known_before, probed_again, tracked
from selector.adaptation.judged import learnt_drift
from tests.adaptation.machines import NOTHING, machines, walking

WIDE = 1e9  # no reading is far from what is expected


def course(time_s, error_um, modelled_um=None) -> Course:
    """Touch-offs at these samples, and nothing else."""
    time_s, error = np.asarray(time_s, dtype=float), np.asarray(error_um, dtype=float)
    m = np.zeros(len(time_s)) if modelled_um is None else np.asarray(modelled_um, dtype=float)
    return Course("r", time_s, m, m + error, np.arange(len(time_s)), m + error)


def test_an_offset_is_the_local_level_of_statsmodels():
    from statsmodels.tsa.statespace.structural import UnobservedComponents

    rng = np.random.default_rng(3)
    error = np.cumsum(rng.normal(0.0, 0.5, 40)) + rng.normal(0.0, 0.7, 40)
    one = course(np.arange(40) * 100.0, error)
    drift = Drift(0.25 / 100.0, 0.0, 3.0, 0.0, 0.49)
    other = UnobservedComponents(error, "llevel")
    # the state before the first reading is the prior of both
    other.ssm.initialize_known(np.zeros(1), np.array([[3.0]]))
    other.ssm.tolerance = 0.0  # else it takes the variance for settled after some readings
    found = other.smooth([0.49, 0.25])
    ours = tracked(drift, Touches.of([one]))
    # both calculate in float64, in another order
    assert np.allclose(ours.offset[0, 1:], found.filtered_state[0], rtol=1e-10, atol=1e-12)
    assert np.allclose(ours.offset_variance[0, 1:], found.filtered_state_cov[0, 0], rtol=1e-10)
    known = known_before(drift, one)
    assert np.allclose(known.variance_um2, found.forecasts_error_cov[0, 0], rtol=1e-10)


def slow_twin(drift: Drift, time_s, error, m):
    """The textbook: state (offset, gain), matrices, no gate."""
    x, p, before = np.zeros(2), np.diag([drift.offset_start_um2, drift.gain_start]), time_s[0]
    states = []
    for t, e, at in zip(time_s, error, m, strict=True):
        p = p + np.diag([drift.offset_um2_per_s, drift.gain_per_s]) * (t - before)
        h = np.array([1.0, at])
        s = h @ p @ h + drift.noise_um2
        k = p @ h / s
        x = x + k * (e - h @ x)
        p = (np.eye(2) - np.outer(k, h)) @ p
        states.append((*x, p[0, 0], p[0, 1], p[1, 1]))
        before = t
    return np.array(states)


def test_offset_and_gain_at_irregular_times_are_those_of_the_textbook():
    rng = np.random.default_rng(5)
    time_s = np.cumsum(rng.uniform(10.0, 9000.0, 30))
    m = rng.uniform(-5.0, 50.0, 30)
    drift = Drift(1e-4, 1e-8, 2.0, 0.01, 0.3)
    error = 1.5 + 0.05 * m + rng.normal(0.0, 0.5, 30)
    found = tracked(drift, Touches.of([course(time_s, error, m)]))
    ours = np.column_stack([table[0, 1:] for table in found[1:6]])
    assert np.allclose(ours, slow_twin(drift, time_s, error, m), rtol=1e-8, atol=1e-12)
    assert found.is_believed.all()


def test_courses_beside_each_other_are_courses_alone():
    several = [one.touched_every(every) for one, every in zip(machines(3, 1), (1800.0, 3600.0, 9000.0), strict=True)]
    drift = Drift(1e-3, 1e-7, 4.0, 0.01, 0.25)
    together = tracked(drift, Touches.of(several))
    for k, one in enumerate(several):
        alone, n = tracked(drift, Touches.of([one])), len(one.touched_at) + 1
        for a, b in zip(together, alone, strict=True):
            assert np.array_equal(a[k, :n], b[0])


def test_one_false_reading_is_not_believed_and_two_that_agree_are():
    drift = Drift(1e-6, 0.0, 1.0, 0.0, 0.1)
    times = np.arange(6) * 600.0
    one = tracked(drift, Touches.of([course(times, [0.2, 0.1, 50.0, 0.2, 0.1, 0.0])]))
    assert one.is_believed[0].tolist() == [True, True, True, False, True, True, True]
    assert abs(one.offset[0, -1]) < 0.3
    moved = tracked(drift, Touches.of([course(times, [0.2, 0.1, 20.0, 20.3, 20.1, 20.2])]))
    assert moved.is_believed[0].tolist() == [True, True, True, False, True, True, True]
    assert moved.offset[0, 4] == pytest.approx(20.3, abs=0.1)
    # beyond the limit of the offset it takes three, and the offset stays at its limit
    limited = replace(drift, offset_limit_um=10.0)
    far = tracked(limited, Touches.of([course(times, [0.2, 0.1, 20.0, 20.3, 20.1, 20.2])]))
    assert far.is_believed[0].tolist() == [True, True, True, False, False, True, False]
    assert far.offset[0, -1] == 10.0
    # two false readings that do not agree are nothing, either
    apart = tracked(drift, Touches.of([course(times, [0.2, 0.1, 50.0, -50.0, 0.1, 0.0])]))
    assert apart.is_believed[0].tolist() == [True, True, True, False, False, True, True]


def test_a_touch_off_without_a_prediction_changes_nothing():
    drift = Drift(1e-6, 0.0, 400.0, 0.0, 0.1)
    # the reading before it was refused, and lies nearer to 0 than to the offset
    one = course(np.arange(6) * 600.0, [20.0, 20.0, 20.0, 0.3, 7.0, 20.0], [0.0, 0.0, 0.0, 0.0, np.nan, 0.0])
    found = tracked(drift, Touches.of([one]))
    assert found.is_believed[0].tolist() == [True, True, True, True, False, False, True]
    for table in found[:6]:
        assert table[0, 5] == table[0, 4]


def test_offset_and_gain_stay_within_their_limits():
    drift = Drift(1.0, 1e-3, 100.0, 1.0, 0.1, offset_limit_um=3.0, gain_limit=0.1)
    far = course(np.arange(5) * 60.0, [9.0, 9.0, 12.0, 15.0, 9.0], [5.0, 9.0, 2.0, 8.0, 3.0])
    found = tracked(drift, Touches.of([far]))
    assert np.abs(found.offset).max() == 3.0
    assert np.abs(found.gain).max() <= 0.1


def test_the_sample_of_a_touch_off_counts_with_the_state_before_it():
    drift = Drift(1e-6, 0.0, 1e6, 0.0, 1e-6)
    one = course([0.0, 60.0, 120.0], [5.0, 5.0, 5.0]).touched(np.array([1]), np.array([5.0]))
    assert known_before(drift, one).added_um == pytest.approx([0.0, 0.0, 5.0])


def test_touch_offs_fall_on_known_samples_at_their_period():
    one = walking(0, np.random.default_rng(0))
    recorded = one.recorded_um.copy()
    recorded[118:123] = np.nan
    gap = Course(one.run, one.time_s, one.modelled_um, recorded, NOTHING, np.zeros(0)).touched_every(7200.0)
    assert (gap.time_s[gap.touched_at] / 60.0).tolist() == [123.0, 240.0, 360.0, 480.0]


def test_planted_noise_and_drift_are_found():
    courses = [one.touched_every(3600.0, phase) for one in machines(40, 11) for phase in (0.25, 0.5, 0.75, 1.0)]
    drift = learnt_drift(courses, with_gain=False)
    # 40 runs: a variance is known to a few tens of percent (sqrt(2/40) = 22 % for that of the starts)
    assert drift.offset_um2_per_s == pytest.approx(1e-3, rel=0.3)
    assert drift.offset_start_um2 == pytest.approx(4.0, rel=0.5)
    assert drift.noise_um2 == pytest.approx(0.25, rel=0.3)
    assert not drift.has_gain


def test_a_planted_gain_is_found():
    planted = machines(40, 12, gain_start=0.01, start=0.5, walk=1e-4)
    drift = learnt_drift([one.touched_every(1800.0) for one in planted], with_gain=True)
    assert drift.gain_start == pytest.approx(0.01, rel=0.5)
    assert drift.offset_start_um2 < 2.0


def test_one_false_reading_among_the_teaching_ones_is_not_taken_for_noise():
    courses = [one.touched_every(3600.0) for one in machines(12, 13)]
    clean = learnt_drift(courses, with_gain=False)
    first = courses[0]
    um = first.touched_um.copy()
    um[3] += 50.0
    spoilt = [replace_touches(first, um), *courses[1:]]
    assert learnt_drift(spoilt, with_gain=False).noise_um2 < 2.0 * clean.noise_um2 + 0.1


def replace_touches(one: Course, um: np.ndarray) -> Course:
    return one.touched(one.touched_at, um)


def test_a_gate_that_never_closes_is_the_plain_filter():
    drift = Drift(1e-4, 0.0, 2.0, 0.0, 0.3)
    wild = course(np.arange(8) * 600.0, [0.0, 30.0, 0.0, -30.0, 0.0, 9.0, 0.0, 1.0])
    wide = replace(drift, offset_um2_per_s=WIDE)
    assert tracked(wide, Touches.of([wild])).is_believed.all()
    assert not tracked(drift, Touches.of([wild])).is_believed.all()


def moved_once() -> tuple[Drift, Course]:
    """An error that jumps by 20 µm between two touch-offs two hours apart."""
    time_s = np.arange(0.0, 8 * 3600.0 + 1.0, 600.0)
    error = np.where(time_s >= 3 * 3600.0, 20.0, 0.0)
    one = Course("r1", time_s, np.zeros_like(time_s), error, NOTHING, np.zeros(0))
    return Drift(1e-4, 0.0, 1.0, 0.0, 0.04, offset_limit_um=50.0), one.touched_every(7200.0)


def test_a_touch_off_that_is_not_believed_is_repeated_at_once():
    drift, one = moved_once()
    again = probed_again(drift, one)
    assert len(again.touched_at) == len(one.touched_at) + 1
    extra = set(again.touched_at.tolist()) - set(one.touched_at.tolist())
    assert extra == {int(np.flatnonzero(one.time_s == 4 * 3600.0)[0]) + 1}

    def left(course):
        error = course.recorded_um - known_before(drift, course).added_um
        return float(np.abs(error[course.time_s > 4 * 3600.0 + 600.0]).max())

    assert left(again) < 0.5
    assert left(one) > 15.0
    # beyond the limit a third one is asked for
    beyond = replace(drift, offset_limit_um=10.0)
    first = int(min(extra))
    assert {first, first + 1} <= set(probed_again(beyond, one).touched_at.tolist())
    assert first + 1 not in again.touched_at


def test_after_a_wrong_touch_off_the_next_one_is_right():
    drift, one = moved_once()
    quiet = Course("r1", one.time_s, one.modelled_um, 0.0 * one.recorded_um, one.touched_at, 0.0 * one.touched_um)
    assert len(probed_again(drift, quiet).touched_at) == len(one.touched_at)
    wrong = quiet.touched(quiet.touched_at, np.r_[20.0, quiet.touched_um[1:]])
    again = probed_again(drift, wrong)
    assert len(again.touched_at) == len(wrong.touched_at) + 1
    assert np.abs(known_before(drift, again).added_um).max() < 0.5


def test_the_last_reading_is_the_offset():
    rng = np.random.default_rng(4)
    one = walking(0, rng).touched_every(7200.0)
    found = known_before(LAST_READING, one)
    at = one.judged
    for sample, added in zip(at, found.added_um, strict=True):
        before = one.touched_at[one.touched_at < sample]
        last = one.recorded_um[before[-1]] - one.modelled_um[before[-1]] if len(before) else 0.0
        assert added == pytest.approx(last, abs=1e-6)
