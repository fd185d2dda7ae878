"""Moves keep their limits, arrive, and could not be faster; sines and recorded courses are what they say."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import linprog

from selector.errors import InputError
from selector.physics.drive.trajectory import clock_findings, move_phases, moves, recorded, sine

LIMITS = {
    "speed_m_per_s": st.floats(1e-3, 5.0),
    "acceleration_m_per_s2": st.floats(1e-2, 50.0),
    "jerk_m_per_s3": st.one_of(st.floats(0.1, 1e5), st.just(math.inf)),
}
limits = st.fixed_dictionaries(LIMITS)
lengths = st.one_of(st.floats(1e-9, 1e-3), st.floats(1e-3, 10.0))
ROUNDING = 1e-9
"""Phases come out of roots and differences, which leave 1e-12 or so of a limit."""


def shortest_s(distance, v, a, j):
    """Biagiotti, Melchiorri (2008), Trajectory Planning, section 3.4: by case, which phases exist."""
    if math.isinf(j):
        return distance / v + v / a if distance * a >= v * v else 2 * math.sqrt(distance / a)
    if v * j >= a * a:
        if distance >= v * v / a + v * a / j:
            return distance / v + v / a + a / j
        if distance >= 2 * a**3 / j**2:
            return a / j + math.sqrt((a / j) ** 2 + 4 * distance / a)
    elif distance >= 2 * v * math.sqrt(v / j):
        return distance / v + 2 * math.sqrt(v / j)
    return math.cbrt(32 * distance / j)


@given(lengths, limits)
def test_duration_is_that_of_the_textbook(distance, limit):
    found = move_phases(distance, **limit).duration_s
    v, a, j = (limit[name] for name in LIMITS)
    assert found == pytest.approx(shortest_s(distance, v, a, j), rel=ROUNDING)


@pytest.mark.parametrize("distance", [0.002, 0.01, 0.05, 0.4])
def test_no_jerk_at_all_goes_further_in_the_same_time(distance):
    v, a, j, n = 0.5, 3.0, 60.0, 120
    total = move_phases(distance, speed_m_per_s=v, acceleration_m_per_s2=a, jerk_m_per_s3=j).duration_s
    # every jerk that is held over each of n intervals: the states are linear in it
    h = total / n
    to_a = np.tril(np.ones((n, n))) * h
    before = np.vstack([np.zeros(n), to_a[:-1]])
    to_v = np.cumsum(before * h + np.eye(n) * h * h / 2, axis=0)
    v_before = np.vstack([np.zeros(n), to_v[:-1]])
    to_x = np.sum(v_before * h + before * h * h / 2 + np.eye(n) * h**3 / 6, axis=0)
    best = linprog(
        -to_x,
        A_ub=np.vstack([to_a, -to_a, to_v]),
        b_ub=np.r_[np.full(2 * n, a), np.full(n, v)],
        A_eq=np.vstack([to_a[-1], to_v[-1]]),
        b_eq=[0.0, 0.0],
        bounds=(-j, j),
    )
    assert best.success
    assert -best.fun <= distance * (1 + 1e-7)  # the solver's own tolerance
    assert -best.fun > distance * 0.99  # switching on a grid of 120 costs less than that: the bound is a sharp one


@given(lengths, limits, st.sampled_from([-1.0, 1.0]), st.integers(10, 400), st.floats(-3.0, 3.0))
def test_a_move_keeps_its_limits_arrives_and_is_symmetric(distance, limit, sign, samples, start):
    target = start + sign * distance
    phases = move_phases(target - start, **limit)
    course = moves([target], phases.duration_s / samples, start_m=start, **limit)
    assert np.abs(course.speed_m_per_s).max() <= limit["speed_m_per_s"] * (1 + ROUNDING)
    assert np.abs(course.acceleration_m_per_s2).max() <= limit["acceleration_m_per_s2"] * (1 + ROUNDING)
    assert course.position_m[0] == start
    assert course.position_m[-1] == target
    assert course.speed_m_per_s[-1] == 0.0
    along = (course.position_m - start) * sign
    ulp = 4 * np.spacing(abs(start) + distance)
    assert (np.diff(along) >= -ulp).all()
    n = samples + 1
    assert along[:n] + along[:n][::-1] == pytest.approx(np.full(n, distance), rel=ROUNDING, abs=ulp)


@given(lengths, limits.filter(lambda limit: math.isfinite(limit["jerk_m_per_s3"])))
def test_acceleration_is_continuous_and_integrates_to_speed_and_position(distance, limit):
    period = move_phases(distance, **limit).duration_s / 4000
    course = moves([distance], period, **limit)
    jerk = limit["jerk_m_per_s3"]
    assert np.abs(np.diff(course.acceleration_m_per_s2)).max() <= jerk * period * (1 + 1e-6)
    # trapezoidal rule: at most jerk·period²/8 an interval where the jerk switches, in seven intervals
    speed = np.cumsum(course.acceleration_m_per_s2[1:] + course.acceleration_m_per_s2[:-1]) * period / 2
    assert np.abs(speed - course.speed_m_per_s[1:]).max() <= 7 * jerk * period**2 / 8
    # the same rule: jerk·duration/12·period² at most for a speed whose second derivative is below the jerk
    position = np.cumsum(course.speed_m_per_s[1:] + course.speed_m_per_s[:-1]) * period / 2
    assert np.abs(position - course.position_m[1:]).max() <= jerk * 4001 * period**3 / 12 + 1e-15


@given(st.lists(st.floats(-2.0, 2.0), min_size=1, max_size=5), limits, st.floats(0.0, 0.5), st.integers(1, 3))
def test_a_sequence_rests_at_every_target(targets, limit, dwell, repeat):
    here, ends, now = 0.0, [], 0.0
    for target in targets * repeat:
        now += move_phases(target - here, **limit).duration_s
        ends.append((now, target))
        now, here = now + dwell, target
    if now < 1e-3:
        return
    period = now / 997
    course = moves(targets, period, dwell_s=dwell, repeat=repeat, **limit)
    assert len(course.position_m) == 998
    for end, target in ends:
        resting = (course.time_s > end + 1e-9 * now) & (course.time_s < end + dwell - 1e-9 * now)
        assert (course.position_m[resting] == target).all()
        assert (course.speed_m_per_s[resting] == 0).all()
        assert (course.acceleration_m_per_s2[resting] == 0).all()
    assert course.position_m[-1] == targets[-1]


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("speed_m_per_s", 0.0),
        ("acceleration_m_per_s2", -1.0),
        ("jerk_m_per_s3", math.nan),
        ("dwell_s", -0.1),
        ("repeat", 0),
        ("period_s", 0.0),
        ("targets_m", []),
        ("targets_m", [0.0]),
        ("targets_m", [math.inf]),
    ],
)
def test_impossible_moves_are_refused(name, value):
    asked = {"targets_m": [0.1], "period_s": 1e-3, "speed_m_per_s": 0.1, "acceleration_m_per_s2": 1.0} | {name: value}
    with pytest.raises(InputError, match=name.replace("targets_m", "targets_m|distance_m")):
        moves(**asked)


@given(st.floats(1e-4, 1.0), st.floats(0.1, 20.0), st.floats(0.0, 6.3), st.floats(-1.0, 1.0))
def test_a_sine_has_the_derivatives_of_a_sine(amplitude, frequency, phase, offset):
    course = sine(amplitude, frequency, 0.5, 1e-3, phase_rad=phase, offset_m=offset)
    omega = 2 * math.pi * frequency
    assert len(course.position_m) == 501
    # speed² + (ω·deviation)² is the same everywhere, and the acceleration is −ω²·deviation
    deviation = course.position_m - offset
    energy = course.speed_m_per_s**2 + (omega * deviation) ** 2
    np.testing.assert_allclose(energy, (omega * amplitude) ** 2, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(course.acceleration_m_per_s2, -(omega**2) * deviation, rtol=1e-9, atol=1e-11 * omega**2)
    assert course.position_m[0] == pytest.approx(offset + amplitude * math.sin(phase), abs=1e-15)


def test_a_recorded_course_keeps_its_positions_and_rounding_stays_out_of_derivatives():
    true = moves([0.1, 0.0], 1e-3, speed_m_per_s=0.2, acceleration_m_per_s2=2.0, jerk_m_per_s3=40.0, dwell_s=0.1)
    rounded = np.round(true.position_m, 7)
    found = recorded(true.time_s, rounded)
    assert (found.position_m == rounded).all()
    assert found.period_s == pytest.approx(1e-3, rel=1e-12)
    # rounding of 0.1 µm: differences twice over would be 0.07 m/s² rms, the local cubic makes 0.001 of it;
    # what stays is that the window of 10 ms rounds the corners of the acceleration, 0.05 m/s² at 40 m/s³
    assert np.abs(found.acceleration_m_per_s2 - true.acceleration_m_per_s2).max() < 0.06
    assert np.abs(found.speed_m_per_s - true.speed_m_per_s).max() < 2e-4


def test_another_period_and_a_clock_that_jitters():
    rng = np.random.default_rng(3)
    even = np.arange(2001) * 1e-3
    jittered = even + np.r_[0.0, rng.uniform(-1e-4, 1e-4, 1999), 0.0]
    wave = lambda t: 0.05 * np.sin(2 * np.pi * 2 * t)  # noqa: E731
    assert clock_findings(even) == ()
    assert [finding.id for finding in clock_findings(jittered)] == ["recorded-clock-jitter"]
    found = recorded(jittered, wave(jittered))
    # cubic spline: (ω·step)⁴/384 of the amplitude, 4e-12 m; the grid starts at 0 and its period is a jittered median
    assert np.abs(found.position_m - wave(found.time_s)).max() < 1e-10
    fine = recorded(even, wave(even), 2.5e-4)
    assert len(fine.position_m) == 8001
    assert np.abs(fine.position_m - wave(fine.time_s)).max() < 1e-10
    assert np.abs(fine.speed_m_per_s - 0.1 * 2 * np.pi * np.cos(2 * np.pi * 2 * fine.time_s)).max() < 1e-5


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda t, x: (np.delete(t, slice(50, 60)), np.delete(x, slice(50, 60))), "1 gaps, the first of 0.011 s"),
        (lambda t, x: (t[::-1], x), "increase"),
        (lambda t, x: (t, np.where(t == 0.05, np.nan, x)), "missing values"),
        (lambda t, x: (t[:5], x[:5]), "at least 11"),
        (lambda t, x: (t, x[:-1]), "as many of one as of the other"),
    ],
)
def test_recorded_courses_with_holes_are_refused(change, says):
    time = np.arange(101) * 1e-3
    with pytest.raises(InputError, match=says):
        recorded(*change(time, np.sin(time)))


def test_rounded_times_are_an_even_clock():
    # a recorder that counts in 2⁻²⁰ s: no step is a millisecond, and the positions must stay what they are
    time = np.round(np.arange(2001) * 1e-3 * 2**20) / 2**20
    position = np.round(0.05 * np.sin(2 * np.pi * 2 * time), 7)
    found = recorded(time, position, 1e-3)
    assert (found.position_m == position).all()
    assert found.period_s == 1e-3
