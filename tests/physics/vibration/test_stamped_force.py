"""Forces with lost rows, gaps and clocks that are not even: the rest of the run is as if nothing had been."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from selector.physics.vibration.final_motion import final_receptance
from selector.physics.vibration.recorded_force import (
    autoregression,
    continued,
    gaps,
    ring_time_s,
    stamped_answer,
    stretches,
)
from selector.physics.vibration.structure import GROUND, Joint, Line, Member, Source, Structure

STEP_S = 5e-4
FINALS = {"tool": "tool"}
STRUCTURE = Structure((Member("tool", 250.0),), (Joint(("tool", GROUND), 1.5e7, 0.6),))
SOURCE = Source("motor", "tool", (Line(frequency_hz=1.0, force_n=1.0),))
RING_S = ring_time_s(STRUCTURE)
HIGH_HZ = [300.0, 900.0]  # 0.3 and 0.9 of half the sampling rate


def response(frequency_hz):
    return final_receptance(STRUCTURE, SOURCE, np.array([frequency_hz]), FINALS).motion_m_per_n[0, 0]


def steady(time_s, frequency_hz):
    """Force of 10 N and motion [m]."""
    turning = 10.0 * np.exp(2j * np.pi * frequency_hz * time_s)
    return turning.imag, (response(frequency_hz) * turning).imag


def off(stamps_s, force_n, exact_m, rows=slice(None)):
    """Largest error as a share of the largest motion."""
    motion, _ = stamped_answer(STRUCTURE, SOURCE, force_n, stretches(stamps_s, RING_S), FINALS)
    assert np.isfinite(motion).all()
    return np.abs(motion[0] - exact_m)[rows].max() / np.abs(exact_m).max()


# a response is known to 1e-6 of the largest, that at the resonance; at 900 Hz the motion is 3e-5 of that (3 %)
TOLERANCE = {40.0: 1e-3, 300.0: 5e-3, 900.0: 0.05}


@pytest.mark.parametrize("frequency_hz", [40.0, 300.0])
def test_one_lost_row_of_60_000_shifts_nothing(frequency_hz):
    time_s = np.delete(np.arange(60000) * STEP_S, 30000)
    assert off(time_s, *steady(time_s, frequency_hz)) < TOLERANCE[frequency_hz]


@pytest.mark.parametrize("frequency_hz", [40.0, *HIGH_HZ, 452.6])
def test_a_gap_does_not_touch_the_rest(frequency_hz):
    rows = np.arange(4000)
    for pause_s in (4.0, 4.0003):  # the second begins anew beside the grid
        time_s = rows * STEP_S + np.where(rows >= 2000, pause_s, 0.0)
        away = (time_s < time_s[1999] - 0.01) | (time_s > time_s[2000] + RING_S)
        # 452.6 Hz was another frequency, near the resonance, on a grid that was stretched over the gap
        assert off(time_s, *steady(time_s, frequency_hz), away) < TOLERANCE.get(frequency_hz, 0.01)


@pytest.mark.parametrize("frequency_hz", HIGH_HZ)
def test_stamps_that_stray_are_those_of_an_even_clock(frequency_hz):
    true_s = np.arange(4000) * STEP_S
    force, motion = steady(true_s, frequency_hz)
    for stamps_s in (
        true_s + np.random.default_rng(4).uniform(-0.2, 0.2, 4000) * STEP_S,
        np.round(true_s, 4),
        true_s * (1.0 + 1e-5) + 100.0,
    ):
        assert off(stamps_s, force, motion) < TOLERANCE[frequency_hz]


def test_what_a_gap_that_is_shorter_than_the_ring_down_leaves_fades():
    rows = np.arange(4000)
    time_s = rows * STEP_S + np.where(rows >= 2000, 0.1, 0.0)
    force, motion = steady(time_s, 40.0)
    later = off(time_s, force, motion, time_s > time_s[2000] + RING_S)
    # nothing is known of the force of a tenth of a second, which was as large as the rest
    assert later < 2e-3 < 0.1 < off(time_s, force, motion)


def test_an_uneven_clock_is_brought_to_even_times():
    time_s = np.cumsum(np.random.default_rng(5).uniform(0.5, 1.5, 8000)) * STEP_S
    (part,) = stretches(time_s, RING_S)
    assert not part.even
    inner = slice(50, -50)  # a spline has less to go by at its ends
    # 6.7 of the widest steps a period, which are 0.75 ms: a cubic spline is within 1 % of a sine of 199 Hz
    for frequency_hz in (40.0, 100.0, 199.0):
        force, motion = steady(time_s, frequency_hz)
        grid_s = time_s[0] + np.arange(part.count) * part.step_s
        even = 10.0 * np.sin(2.0 * np.pi * frequency_hz * grid_s)
        assert np.abs(part.on_grid(force) - even)[200:-200].max() < 0.01 * 10.0
        # what is off by 1 % holds other frequencies too, among them the resonance
        assert off(time_s, force, motion, inner) < 0.03
    assert off(time_s, *steady(time_s, 0.9 * 1000.0)) > 0.1  # and not beyond


def test_values_that_lack_are_as_lost_rows_and_the_force_that_acted_has_none():
    time_s = np.arange(8000) * STEP_S
    force, motion = steady(time_s, 40.0)
    holes = force.copy()
    holes[np.random.default_rng(6).choice(8000, 200)] = np.nan
    found, acted = stamped_answer(STRUCTURE, SOURCE, holes, stretches(time_s, RING_S), FINALS)
    assert acted == pytest.approx(force, abs=0.02 * 10.0)  # two of 50 samples a period that lack side by side
    assert np.abs(found[0] - motion).max() < 0.02 * np.abs(motion).max()
    holes = force.copy()
    holes[3000:3040] = np.nan  # nothing better than straight is known over many
    _, acted = stamped_answer(STRUCTURE, SOURCE, holes, stretches(time_s, RING_S), FINALS)
    assert acted[3000:3040] == pytest.approx(np.interp(np.arange(3000, 3040), [2999, 3040], force[[2999, 3040]]))
    nothing = np.where(time_s < 10.0, np.nan, force)
    nothing[0] = 3.0
    _, acted = stamped_answer(STRUCTURE, SOURCE, nothing, stretches(time_s, RING_S), FINALS)
    assert acted == pytest.approx(3.0)


def test_a_stretch_of_which_nothing_is_known_has_the_mean_of_the_others():
    time_s = np.concatenate((np.arange(100), 1e5 + np.arange(100))) * STEP_S
    force = np.concatenate((np.full(100, 4.0), np.full(100, np.nan)))
    found, _ = stamped_answer(STRUCTURE, SOURCE, force, stretches(time_s, RING_S), FINALS)
    assert found[0] == pytest.approx(4.0 * response(0.0).real, rel=1e-9)


def test_gaps_are_where_nothing_was_recorded_and_rounded_stamps_have_none():
    time_s = np.delete(np.arange(1000) * STEP_S, [*range(100, 110), 500])
    assert gaps(time_s) == pytest.approx(np.array([[99, 110]]) * STEP_S)
    assert len(gaps(np.round(np.arange(1000) / 600.0, 3))) == 0
    (part,) = stretches(time_s, RING_S)
    assert (part.even, part.count) == (True, 1000)


@settings(max_examples=20)
@given(st.sets(st.integers(1, 1998), max_size=600), st.floats(1e-5, 1e3), st.floats(-1e4, 1e4))
def test_rows_keep_their_places_whatever_is_lost(lost, step_s, begin_s):
    kept = np.delete(np.arange(2000), sorted(lost))
    for part in stretches(begin_s + kept * step_s, np.inf):
        assert part.even
        assert part.at.tolist() == (kept - kept[0]).tolist()
        rows = kept[part.first : part.end]
        # a cubic spline of a straight line, to rounding
        assert part.at_rows(part.on_grid(rows.astype(float))) == pytest.approx(rows, rel=1e-9)


@settings(max_examples=20)
@given(st.floats(0.02, 0.98), st.floats(0.0, 6.28))
def test_a_sine_goes_on_as_a_sine(share, phase):
    course = np.sin(np.pi * share * np.arange(4000) + phase)
    # Burg's frequencies of a sine are off by parts of 1e-6 with hundreds of terms: some parts of 1e-4 as a rule, 0.064
    # at the few frequencies where that adds up
    assert continued(course[:3000], 1000) == pytest.approx(course[3000:], abs=0.1)


def test_noise_goes_on_as_nothing_and_no_course_grows():
    noise = np.random.default_rng(7).normal(size=4000)
    assert np.sqrt(np.mean(continued(noise, 2000)[200:] ** 2)) < 0.1
    assert np.abs(np.roots(autoregression(noise, 50))).max() < 1.0
    assert not continued(np.zeros(100), 50).any()
    assert not continued(noise, 0).size
    assert np.array_equal(autoregression(np.zeros(10), 3), [1.0])
