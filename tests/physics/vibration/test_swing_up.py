"""Run-ups and jumps of the speed, judged by the modes: against the equations of motion, solved in time."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lsim

from selector.physics.vibration.motion.run_up import late_motion, motion_signal
from selector.physics.vibration.structure.source import Line, ShaftCourse, Source
from selector.physics.vibration.structure.structure import GROUND, Joint, Member, Structure, structure_modes
from tests.physics.vibration.viscous import state_space

COLUMN = Structure(
    (Member("workpiece", 400.0), Member("spindle", 40.0), Member("tool", 250.0)),
    (
        Joint(("workpiece", GROUND), 2e8, 0.5),
        Joint(("tool", GROUND), 1.35e7, 0.6),
        Joint(("spindle", "tool"), 2e8, 0.25),
    ),
)
UNBALANCE = Source("spindle", "spindle", (Line(order=1.0, unbalance_kg_m=5e-4),), shaft="spindle")
FINALS = {"tool": "tool", "workpiece": "workpiece"}
FINE_S, STEP_S = 1e-4, 2e-3


def course(slope_s: float, begin_rpm: float, end_rpm: float) -> ShaftCourse:
    return ShaftCourse([0.0, 1.0005, 1.0005 + slope_s], [begin_rpm, begin_rpm, end_rpm])


def solved(turning: ShaftCourse):
    """Analytic motion of the tool, solved in time, with dampers for the joints: right at the column's resonance."""
    time = np.arange(0.0, 2.0, FINE_S)
    system = state_space(COLUMN, float(structure_modes(COLUMN).frequency_hz[0]), inputs=["spindle"], outputs=["tool"])
    omega = 2 * np.pi * turning.rpm_at(time) / 60.0
    force = 5e-4 * omega**2 * np.exp(2j * np.pi * turning.turns_at(time))
    steady = np.linalg.solve(1j * omega[0] * np.eye(6) - system.A, system.B[:, 0] * force[0])
    parts = [
        lsim((system.A, system.B, system.C, system.D), pushed, time, X0=start)[1]
        for pushed, start in ((force.real, steady.real), (force.imag, steady.imag))
    ]
    every = round(STEP_S / FINE_S)
    return time[::every], (np.ravel(parts[0]) + 1j * np.ravel(parts[1]))[::every]


def simulated(turning: ShaftCourse, time):
    """Analytic motion of the tool: those by two phases, and what is told."""
    sine, cosine = (
        motion_signal(COLUMN, (UNBALANCE,), {"spindle": turning}, FINALS, time, phase_rad={"spindle": phase})
        for phase in (0.0, np.pi / 2)
    )
    return cosine.motion_m[0] + 1j * sine.motion_m[0], sine.findings


@pytest.mark.parametrize(
    ("slope_s", "begin_rpm", "end_rpm", "says"),
    [
        (0.0005, 600.0, 3000.0, "overshoots"),  # far above: a start far beyond the resonance
        (0.001, 1500.0, 2400.0, "overshoots"),
        (0.01, 600.0, 3000.0, "upper limit"),
        (0.1, 600.0, 3000.0, "upper limit"),
        (0.001, 1980.0, 1200.0, "the peak alone"),  # from the resonance away: it fades
        (0.5, 600.0, 3000.0, "upper limit"),
    ],
)
def test_the_true_peak_of_slopes_of_all_lengths_is_told(slope_s, begin_rpm, end_rpm, says):
    turning = course(slope_s, begin_rpm, end_rpm)
    time, true = solved(turning)
    quasi, (told,) = simulated(turning, time)
    evidence = told.evidence
    assert told.id == "run-up-too-quick"
    # 1 %: dampers that are right at one frequency instead of joints; 2 %: a slope that is shorter than a sample
    assert evidence["true_um"] == pytest.approx(1e6 * np.abs(true).max(), rel=0.03)
    assert evidence["simulated_um"] == pytest.approx(1e6 * np.abs(quasi).max(), rel=1e-9)
    assert evidence["off_um"] == pytest.approx(1e6 * np.abs(true - quasi).max(), rel=0.05)
    assert says in told.statement + told.suggestion
    assert 1.0 <= told.where.from_s < told.where.to_s <= 2.0
    assert told.where.channel == "tool"


def test_it_follows_the_equations_of_motion_sample_by_sample():
    turning = course(0.02, 900.0, 2900.0)
    time, true = solved(turning)
    late = late_motion(COLUMN, UNBALANCE, turning, FINALS, time)
    # quasi-steady with the same dampers as the solution in time
    system = state_space(COLUMN, float(structure_modes(COLUMN).frequency_hz[0]), inputs=["spindle"], outputs=["tool"])
    omega = 2 * np.pi * turning.rpm_at(time) / 60.0
    answer = np.array([(system.C @ np.linalg.solve(1j * w * np.eye(6) - system.A, system.B))[0, 0] for w in omega])
    quasi = answer * 5e-4 * omega**2 * np.exp(2j * np.pi * turning.turns_at(time))
    off = np.abs(quasi + late.motion_m[0] - true)
    # η/2, 0.048, of the peak that is passed: by so much the dampers move it that stand for the joints
    assert off.max() < 0.05 * np.abs(quasi).max()
    # and 2 % of the largest motion when the slope is over
    assert off[time > 1.03].max() < 0.02 * np.abs(true).max()
    assert np.abs(quasi - true).max() > 0.8 * np.abs(quasi).max()


def test_it_does_not_depend_on_the_sampling():
    turning = course(0.02, 900.0, 2900.0)
    coarse, fine = (
        late_motion(COLUMN, UNBALANCE, turning, FINALS, np.arange(0.0, 2.0, step)).motion_m[:, ::every]
        for step, every in ((STEP_S, 1), (STEP_S / 20.0, 20))
    )
    # some 30 samples in the period of the resonance, in each of which the frequency is taken as level
    assert np.abs(coarse - fine).max() < 1e-3 * np.abs(fine).max()


def test_what_is_quick_beside_a_much_larger_motion_is_not_told():
    slope = course(0.001, 600.0, 3000.0)
    time = np.arange(0.0, 2.0, STEP_S)
    loud = Source("pump", "tool", (Line(frequency_hz=20.0, force_n=5000.0),))
    alone = motion_signal(COLUMN, (UNBALANCE,), {"spindle": slope}, FINALS, time)
    beside = motion_signal(COLUMN, (UNBALANCE, loud), {"spindle": slope}, FINALS, time)
    assert [one.id for one in alone.findings] == ["run-up-too-quick"]
    assert beside.findings == ()


def test_the_line_that_matters_in_metres_is_told_not_the_one_that_is_off_most_of_itself():
    small = Line(order=1.0, force_n=0.01)
    large = Line(order=0.02, force_n=3000.0)
    both = Source("spindle", "spindle", (small, large), shaft="spindle")
    time = np.arange(0.0, 2.0, STEP_S)
    slope = course(0.1, 600.0, 3000.0)
    only = motion_signal(
        COLUMN, (Source("spindle", "spindle", (small,), shaft="spindle"),), {"spindle": slope}, FINALS, time
    )
    assert [one.id for one in only.findings] == ["run-up-too-quick"]
    # the large one is far below every resonance, and follows
    assert motion_signal(COLUMN, (both,), {"spindle": slope}, FINALS, time).findings == ()


def test_clocks_that_are_not_even_are_judged_alike():
    slope = course(0.1, 600.0, 3000.0)
    even = np.arange(0.0, 2.0, STEP_S)
    uneven = even + np.random.default_rng(4).uniform(-0.2, 0.2, len(even)) * STEP_S
    one, other = (
        motion_signal(COLUMN, (UNBALANCE,), {"spindle": slope}, FINALS, time).findings[0].evidence["off_um"]
        for time in (even, uneven)
    )
    # samples lie elsewhere about the peak
    assert one == pytest.approx(other, rel=0.02)


def test_modes_that_fall_together_in_shape_are_judged_too():
    loss = 0.2
    twins = Structure(
        (Member("tool", 10.0), Member("workpiece", 10.0)),
        (
            Joint(("tool", GROUND), 1e6, 2 * np.pi * loss),
            Joint(("workpiece", GROUND), 1e6, 0.0),
            Joint(("tool", "workpiece"), 1e6 * loss / 2.0, 0.0),
        ),
    )
    near = Structure(twins.members, (*twins.joints[:2], Joint(("tool", "workpiece"), 1e6 * loss / 2.0 * 1.001, 0.0)))
    assert not structure_modes(twins).complete
    source = Source("motor", "tool", (Line(order=1.0, force_n=1.0),), shaft="motor")
    time = np.arange(0.0, 2.0, STEP_S)
    slope = course(0.2, 60.0 * 40.0, 60.0 * 60.0)
    one, other = (np.abs(late_motion(case, source, slope, FINALS, time).motion_m).max() for case in (twins, near))
    # the modes of the other lie √0.001 apart, times the joint's share
    assert one == pytest.approx(other, rel=0.01)


def test_a_long_run_of_many_lines_is_judged_in_bounded_time():
    lines = tuple(Line(order=1.0 + 0.1 * number, force_n=1.0) for number in range(40))
    source = Source("spindle", "spindle", lines, shaft="spindle")
    time = np.arange(200_000) * 1e-3
    late = late_motion(COLUMN, source, ShaftCourse([0.0, 200.0], [600.0, 3000.0]), FINALS, time)
    assert late.motion_m.shape == (2, 200_000)
    assert np.isfinite(late.motion_m).all()
