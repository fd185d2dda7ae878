"""Motion in time: sums of sinusoids at constant speeds, quasi-steady while a shaft runs up."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import signal

from selector.errors import InputError
from selector.physics.vibration.final_motion import (
    HURRY,
    ChainMethod,
    final_motions,
    final_receptance,
    motion_signal,
    source_phases_rad,
)
from selector.physics.vibration.structure import GROUND, Joint, Line, Member, ShaftCourse, Source, Structure, excitation
from tests.physics.vibration.small_lathe import BRANCH, FINALS, HIGH, LOW, MOTOR, SOURCES, SPINDLE, STRUCTURE

TIME = np.arange(3000) * 5e-4 + 1.25
PHASES = {"spindle": 0.5 * math.pi, "motor": 1.1}
ROUNDING = 1e-10
"""Phases of some thousand rad, rounded."""


def summed(speed_rpm: float, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Motions and forces as sums of sines, one line after the other."""
    lines = excitation(SOURCES, {"spindle": speed_rpm})
    found = final_motions(STRUCTURE, SOURCES, lines, FINALS)
    motion, force = np.zeros((2, len(time_s))), np.zeros((2, len(time_s)))
    for row, f in enumerate(lines.frequency_hz):
        phase = list(PHASES.values())[lines.source[row]]
        force[lines.source[row]] += abs(lines.force_n[row]) * np.sin(
            2 * np.pi * f * time_s + np.angle(lines.force_n[row]) + phase
        )
        for final, x in enumerate(found.motion_m[:, row]):
            motion[final] += abs(x) * np.sin(2 * np.pi * f * time_s + np.angle(x) + phase)
    return motion, force


@pytest.mark.parametrize("even", [True, False])
def test_constant_speeds_make_sums_of_sines(even):
    time = TIME if even else np.sort(np.append(TIME, 1.3331))
    found = motion_signal(STRUCTURE, SOURCES, {"spindle": 1200.0}, FINALS, time, phase_rad=PHASES)
    motion, force = summed(1200.0, time)
    assert np.abs(found.motion_m - motion).max() < ROUNDING * np.abs(motion).max()
    assert np.abs(found.force_n - force).max() < ROUNDING * np.abs(force).max()
    assert found.finals == ("tool", "workpiece")
    assert found.sources == ("spindle", "motor")
    assert (found.shaft_rpm["spindle"] == 1200.0).all()
    assert found.findings == ()


def test_a_level_course_is_a_constant_speed_and_a_hardly_rising_one_nearly():
    level = ShaftCourse([0.0, 1.0], [1200.0, 1200.0])
    rising = ShaftCourse([0.0, 10.0], [1200.0, 1200.0 + 1e-7])
    constant, same, nearly = (
        motion_signal(STRUCTURE, SOURCES, {"spindle": speed}, FINALS, TIME, phase_rad=PHASES)
        for speed in (1200.0, level, rising)
    )
    assert (same.motion_m == constant.motion_m).all()
    # 1e-6 of the largest motion is what the response curve may be off; the speed itself is off by 1e-10
    assert np.abs(nearly.motion_m - constant.motion_m).max() < 1e-5 * np.abs(constant.motion_m).max()
    assert np.abs(nearly.force_n - constant.force_n).max() < 1e-6 * np.abs(constant.force_n).max()


def test_a_run_up_follows_the_integral_of_the_speed():
    source = Source("spindle", "workpiece", (Line(order=2.0, force_n=3.0, unbalance_kg_m=1e-4),), shaft="spindle")
    course = ShaftCourse([0.0, 2.0], [300.0, 900.0])
    time = np.arange(4000) * 5e-4
    found = motion_signal(STRUCTURE, (source,), {"spindle": course}, FINALS, time)
    turns = 5.0 * time + 2.5 * time**2
    frequency = 2.0 * (5.0 + 5.0 * time)
    amplitude = 3.0 + 1e-4 * (2 * np.pi * frequency) ** 2
    # turns of up to 20, taken from sums of that size
    assert np.abs(found.force_n[0] - amplitude * np.sin(4 * np.pi * turns)).max() < 1e-9
    response = final_receptance(STRUCTURE, source, frequency, FINALS).motion_m_per_n
    expected = (response * amplitude * np.exp(4j * np.pi * turns)).imag
    # twice the tolerance of the response curve
    assert np.abs(found.motion_m - expected).max() < 2e-6 * np.abs(expected).max()
    assert found.shaft_rpm["spindle"][[0, -1]] == pytest.approx([300.0, 899.85], abs=1e-9)


def test_phases_are_drawn_from_equal_shifts_with_a_seed():
    found = source_phases_rad(SOURCES, seed=7)
    assert found == source_phases_rad(SOURCES, seed=7)
    assert list(found) == ["spindle", "motor"]
    quarters = {
        round(phase / (0.5 * math.pi), 12)
        for seed in range(60)
        for phase in source_phases_rad(SOURCES, seed=seed).values()
    }
    assert quarters == {0.0, 1.0, 2.0, 3.0}
    assert set(source_phases_rad(SOURCES, seed=1, phases=1).values()) == {0.0}


def test_chains_in_time():
    chains = ChainMethod((LOW, HIGH, BRANCH), 100.0)
    found = motion_signal(STRUCTURE, SOURCES, {"spindle": 1200.0}, FINALS, TIME, chains=chains)
    lines = excitation(SOURCES, {"spindle": 1200.0})
    by_line = final_motions(STRUCTURE, SOURCES, lines, FINALS, chains)
    expected = (by_line.motion_m @ np.exp(2j * np.pi * np.outer(lines.frequency_hz, TIME))).imag
    assert np.abs(found.motion_m - expected).max() < ROUNDING * np.abs(expected).max()


def test_a_line_that_changes_its_chains_is_told():
    course, time = ShaftCourse([0.0, 1.0], [500.0, 700.0]), np.arange(2000) * 5e-4
    for split_hz, told in ((93.0, True), (200.0, False)):
        chains = ChainMethod((LOW, HIGH), split_hz)
        found = motion_signal(STRUCTURE, (SPINDLE,), {"spindle": course}, FINALS, time, chains=chains)
        assert ("line-changes-chains" in [finding.id for finding in found.findings]) is told


@pytest.mark.parametrize("speed", [1200.0, ShaftCourse([0.0, 1.0], [600.0, 1200.0])])
def test_lines_that_the_sampling_cannot_carry_are_refused_or_left_out(speed):
    # order 9.3 at 1200 r/min are 186 Hz, half the rate of 1/3 ms is 166.7 Hz
    time = np.arange(600) / 333.3333
    with pytest.raises(InputError) as caught:
        motion_signal(STRUCTURE, SOURCES, {"spindle": speed}, FINALS, time)
    assert caught.value.where == "sources.spindle.lines[2]"
    found = motion_signal(STRUCTURE, SOURCES, {"spindle": speed}, FINALS, time, beyond="leave-out")
    told = [finding for finding in found.findings if finding.id == "line-beyond-sampling"]
    assert len(told) == 1
    assert told[0].evidence["frequency_hz"] == pytest.approx(186.0)
    without = motion_signal(
        STRUCTURE, (replace(SPINDLE, lines=SPINDLE.lines[:1]), MOTOR), {"spindle": speed}, FINALS, time
    )
    late = time > 1.0 if isinstance(speed, ShaftCourse) else time >= 0.0
    # the tolerance of two response curves over different ranges
    assert np.abs(found.motion_m - without.motion_m)[:, late].max() < 1e-5 * np.abs(found.motion_m).max()
    if isinstance(speed, ShaftCourse):
        assert np.abs(found.motion_m - without.motion_m)[:, time < 0.7].max() > 0.1 * np.abs(found.motion_m).max()


def test_a_line_exactly_at_half_the_rate_is_not_carried():
    with pytest.raises(InputError):
        motion_signal(STRUCTURE, (MOTOR,), {"spindle": 0.0}, FINALS, np.arange(100) * 0.01)


def test_standstill_and_start_from_it():
    still = motion_signal(STRUCTURE, (SPINDLE,), {"spindle": 0.0}, FINALS, TIME)
    assert not still.motion_m.any()
    start = motion_signal(
        STRUCTURE, (SPINDLE,), {"spindle": ShaftCourse([0.5, 2.0], [0.0, 600.0])}, FINALS, np.arange(4000) * 5e-4
    )
    assert np.isfinite(start.motion_m).all()
    before = start.motion_m[:, :1000]
    # nothing turns: the motion does not change
    assert np.ptp(before, axis=1).max() < 1e-12 * np.abs(start.motion_m).max()


def slow_sweep(rate_hz_per_s: float, loss_factor: float = 0.02, natural_hz: float = 50.0):
    """Quasi-steady and true motion of one mass through its resonance, the peak, and the findings."""
    mass = 10.0
    stiffness = mass * (2 * np.pi * natural_hz) ** 2
    structure = Structure((Member("tool", mass),), (Joint(("tool", GROUND), stiffness, 2 * np.pi * loss_factor),))
    source = Source("motor", "tool", (Line(order=1.0, force_n=1.0),), shaft="motor")
    low, high = 0.93 * natural_hz, 1.07 * natural_hz
    duration = (high - low) / rate_hz_per_s
    step = 2.5e-4
    time = np.arange(int(duration / step)) * step
    course = ShaftCourse([0.0, duration], [60.0 * low, 60.0 * high])
    found = motion_signal(structure, (source,), {"motor": course}, {"tool": "tool"}, time)
    # the same resonance with viscous damping, which has a motion in time: force held straight between samples
    viscous = loss_factor * stiffness / (2 * np.pi * natural_hz)
    system = signal.cont2discrete(
        tuple(
            np.array(matrix)
            for matrix in (
                [[0.0, 1.0], [-stiffness / mass, -viscous / mass]],
                [[0.0], [1.0 / mass]],
                [[1.0, 0.0]],
                [[0.0]],
            )
        ),
        step,
        "foh",
    )
    numerator, denominator = signal.ss2tf(*system[:4])
    angle = 2 * np.pi * (low * time + 0.5 * rate_hz_per_s * time**2)
    true = signal.lfilter(numerator[0], denominator, np.sin(angle))
    near = np.abs(low + rate_hz_per_s * time - natural_hz) < 1.5 * loss_factor * natural_hz
    peak = 1.0 / (loss_factor * stiffness)
    return np.abs(found.motion_m[0] - true)[near].max() / peak, found.findings


def test_a_slow_run_up_is_quasi_steady_as_far_as_said():
    # half-power width 1 Hz: first-order error rate/(0.5π) of the peak
    for rate in (0.05, 0.1):
        off, findings = slow_sweep(rate)
        # 0.008: hysteretic and viscous damping differ by that much 1.5 widths beside the resonance
        assert off == pytest.approx(rate / (0.5 * math.pi), abs=0.008)
        assert findings == ()


def test_a_quick_run_up_is_told():
    off, (finding,) = slow_sweep(0.5)
    assert finding.id == "run-up-too-quick"
    # first order, of a half-power width of 1 Hz: 0.5/(0.5π) of the peak, less where a quarter of it has passed
    assert finding.evidence["share"] == pytest.approx(0.5 / (0.5 * math.pi), rel=0.1)
    assert off > HURRY
    assert finding.evidence["slower_than_hz_per_s"] == pytest.approx(0.05 * math.pi, rel=0.1)
    assert finding.evidence["resonance_hz"] == pytest.approx(50.0, rel=1e-3)
    assert slow_sweep(0.15)[1] == ()


def test_noise_on_a_recorded_speed_is_no_run_up():
    structure = Structure((Member("tool", 10.0),), (Joint(("tool", GROUND), 1e6, 0.3),))
    source = Source("motor", "tool", (Line(order=1.0, force_n=1.0),), shaft="motor")
    time = np.arange(20_000) * 1e-3
    noisy = 60.0 * (50.0 + 0.02 * time) + np.random.default_rng(2).normal(0.0, 3.0, len(time))
    found = motion_signal(structure, (source,), {"motor": ShaftCourse(time, noisy)}, {"tool": "tool"}, time)
    assert found.findings == ()


def test_an_undamped_resonance_within_a_run_up_is_refused():
    structure = Structure((Member("tool", 10.0),), (Joint(("tool", GROUND), 1e6, 0.0),))
    source = Source("motor", "tool", (Line(order=1.0, force_n=1.0),), shaft="motor")
    course = ShaftCourse([0.0, 1.0], [60.0 * 45.0, 60.0 * 55.0])
    with pytest.raises(InputError) as caught:
        motion_signal(structure, (source,), {"motor": course}, {"tool": "tool"}, np.arange(1000) * 1e-3)
    assert "dissipation" in str(caught.value)
