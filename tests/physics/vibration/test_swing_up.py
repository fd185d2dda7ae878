"""Run-ups and jumps of the speed that a resonance cannot follow: against the equations of motion, solved in time."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lsim

from selector.physics.vibration.final_motion import HURRY, motion_signal
from selector.physics.vibration.structure import (
    GROUND,
    Joint,
    Line,
    Member,
    ShaftCourse,
    Source,
    Structure,
    structure_modes,
)
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
# forty steps a turn at 3000 rpm, knots of the courses among them: with a fifth of it, shares are the same within 0.002
FINE_S, STEP_S = 5e-4, 2e-3


def course(slope_s: float, begin_rpm: float, end_rpm: float) -> ShaftCourse:
    return ShaftCourse([0.0, 1.0005, 1.0005 + slope_s], [begin_rpm, begin_rpm, end_rpm])


def true_share(turning: ShaftCourse, lasts_s: float) -> float:
    """Largest difference of true and quasi-steady motion, both with dampers for the joints, over the latter's peak."""
    time = np.arange(0.0, lasts_s, FINE_S)
    system = state_space(COLUMN, float(structure_modes(COLUMN).frequency_hz[0]), inputs=["spindle"], outputs=["tool"])
    omega = 2 * np.pi * turning.rpm_at(time) / 60.0
    force = 5e-4 * omega**2 * np.exp(2j * np.pi * turning.turns_at(time))
    start = np.linalg.solve(1j * omega[0] * np.eye(6) - system.A, system.B[:, 0] * force[0])
    parts = [
        lsim((system.A, system.B, system.C, system.D), pushed, time, X0=begin)[1]
        for pushed, begin in ((force.real, start.real), (force.imag, start.imag))
    ]
    speeds = np.linspace(omega.min(), omega.max(), 2000)
    turned = np.linalg.solve(1j * speeds[:, None, None] * np.eye(6) - system.A, system.B)
    answer = (system.C @ turned)[:, 0, 0]
    quasi = np.interp(omega, speeds, answer) * force
    return float(np.abs(np.ravel(parts[0]) + 1j * np.ravel(parts[1]) - quasi).max() / np.abs(quasi).max())


def told(turning: ShaftCourse, sources=(UNBALANCE,), lasts_s: float = 2.0, time=None):
    time = np.arange(0.0, lasts_s, STEP_S) if time is None else time
    return motion_signal(COLUMN, sources, {"spindle": turning}, FINALS, time).findings


@pytest.mark.parametrize(
    ("slope_s", "begin_rpm", "end_rpm"),
    [
        (0.001, 1980.0, 1200.0),  # from the resonance away: it fades
        (0.01, 600.0, 1500.0),  # a jump that ends below it
        (0.001, 2400.0, 4000.0),  # and one beyond it
        (0.5, 600.0, 3000.0),
        (5.0, 600.0, 3000.0),
        (20.0, 600.0, 3000.0),
    ],
)
def test_how_far_the_motion_is_off_is_told(slope_s, begin_rpm, end_rpm):
    turning = course(slope_s, begin_rpm, end_rpm)
    (finding,) = told(turning, lasts_s=slope_s + 2.0)
    assert finding.id == "run-up-too-quick"
    # of first order in the change within the time in which a mode fades, of the most important mode alone
    assert finding.evidence["share"] == pytest.approx(true_share(turning, slope_s + 2.0), rel=0.6)
    assert finding.evidence["slower_than_hz_per_s"] < finding.evidence["rate_hz_per_s"]
    assert 0.8 <= finding.where.from_s < finding.where.to_s <= slope_s + 2.0
    assert finding.where.channel == "tool"


@pytest.mark.parametrize(("slope_s", "begin_rpm", "end_rpm"), [(40.0, 600.0, 3000.0), (2.0, 600.0, 1500.0)])
def test_what_the_resonance_follows_is_not_told(slope_s, begin_rpm, end_rpm):
    turning = course(slope_s, begin_rpm, end_rpm)
    assert told(turning, lasts_s=slope_s + 2.0) == ()
    assert true_share(turning, slope_s + 2.0) < HURRY


def test_what_is_quick_beside_a_much_larger_motion_is_not_told():
    slope = course(0.001, 600.0, 3000.0)
    loud = Source("pump", "tool", (Line(frequency_hz=20.0, force_n=50_000.0),))
    assert [one.id for one in told(slope)] == ["run-up-too-quick"]
    assert told(slope, (UNBALANCE, loud)) == ()


def test_the_line_that_matters_in_metres_is_told_not_the_one_that_is_off_most_of_itself():
    small = Line(order=1.0, force_n=0.01)
    large = Line(order=0.02, force_n=3000.0)
    slope = course(0.1, 600.0, 3000.0)
    only, both = (Source("spindle", "spindle", lines, shaft="spindle") for lines in ((small,), (small, large)))
    assert [one.id for one in told(slope, (only,))] == ["run-up-too-quick"]
    # the large one is far below every resonance, and follows
    assert told(slope, (both,)) == ()


def test_clocks_that_are_not_even_are_judged_alike():
    slope = course(0.1, 600.0, 3000.0)
    even = np.arange(0.0, 2.0, STEP_S)
    uneven = even + np.random.default_rng(4).uniform(-0.2, 0.2, len(even)) * STEP_S
    one, other = (told(slope, time=time)[0].evidence["share"] for time in (even, uneven))
    # samples lie elsewhere about the peak
    assert one == pytest.approx(other, rel=0.1)
