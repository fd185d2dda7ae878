"""When things stick, slip and touch: against closed forms."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from selector.physics.drive.parts.axis import Axis, AxisState, Friction, RigidMechanics, Transmission
from selector.physics.drive.simulation import simulate_axis
from tests.physics.drive.axes import THREE, UNDAMPED, still
from tests.physics.drive.energies import stored_energy_j

MASS = RigidMechanics(mass_kg=10.0)
# positions of a parabola are exact up to the rounding of some thousand steps
ROUNDING = 1e-12


def test_a_mass_slides_to_rest_and_stays_there():
    axis = Axis(MASS, friction=Friction(20.0))
    motion = simulate_axis(axis, still(1e-3, 1.0), step_s=1e-3, start=AxisState(motor_speed=0.9037))
    # v²/(2·F/M), at v/(F/M) = 0.45185 s, inside a step
    stop_m, stop_s = 0.9037**2 / 4, 0.9037 / 2
    moving = motion.time_s < stop_s
    expected = np.where(moving, 0.9037 * motion.time_s - motion.time_s**2, stop_m)
    assert motion.table_m == pytest.approx(expected, abs=ROUNDING)
    assert (motion.table_speed_m_per_s[~moving] == 0).all()
    assert (np.diff(motion.table_m[~moving]) == 0).all()
    assert (motion.friction_n[~moving] == 0).all()


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_it_breaks_away_when_the_force_has_reached_the_static_friction(sign):
    axis = Axis(MASS, friction=Friction(20.0, 25.0, 30.0, 40.0, offset_n=3.0))
    held = np.arange(2001) * 0.05 * sign
    motion = simulate_axis(axis, still(1e-3, 2.0, held), step_s=1e-3)
    # forces are held: the first that is beyond S ± offset sets it in motion, not one before
    first = int(np.argmax(np.abs(motion.table_speed_m_per_s) > 0)) - 1
    breakaway = 33.0 if sign > 0 else 37.0
    assert abs(held[first]) > breakaway >= abs(held[first - 1])
    before = slice(0, first)
    assert (motion.table_m[before] == 0).all()
    assert motion.friction_n[before] == pytest.approx(held[before] - 3.0, abs=1e-12)


def test_a_constant_force_below_breakaway_does_not_creep():
    axis = Axis(THREE, friction=Friction(300.0, static_n=400.0))
    motion = simulate_axis(axis, still(1e-3, 5.0, np.full(5001, 399.999)), step_s=1e-4)
    assert (motion.table_m == 0).all()
    assert (motion.friction_n == 399.999).all()


def test_reversal_passes_through_zero_where_the_drive_is_strong():
    axis = Axis(MASS, friction=Friction(20.0))
    motion = simulate_axis(axis, still(1e-3, 1.0, np.full(1001, -50.0)), step_s=1e-3, start=AxisState(motor_speed=1.0))
    # −7 m/s² while it rises, −3 m/s² on the way back
    turn, top = 1.0 / 7.0, 1.0 / 14.0
    after = motion.time_s - turn
    expected = np.where(after < 0, motion.time_s - 3.5 * motion.time_s**2, top - 1.5 * after**2)
    assert motion.table_m == pytest.approx(expected, abs=ROUNDING)


def test_a_table_crosses_the_gap_and_bounces():
    axis = Axis(replace(UNDAMPED, screw_inertia_kg_m2=1e9, motor_inertia_kg_m2=1e9), transmission=Transmission(2e-5))
    start = AxisState(table_speed_m_per_s=0.01)
    motion = simulate_axis(axis, still(1e-5, 0.03), step_s=1e-5, start=start)
    # half a gap, half a period on the spring of the flank (the screw is as good as fixed), a whole gap back, …
    half_period = math.pi * math.sqrt(300.0 / 1e8)
    contact = 1e-5 / 0.01
    depth = 0.01 * math.sqrt(300.0 / 1e8)
    course = []
    for t in motion.time_s:
        if t <= contact:
            course.append(0.01 * t)
            continue
        count, rest = divmod(t - contact, half_period + 2e-5 / 0.01)
        side = 1 if count % 2 == 0 else -1
        inside = 1e-5 + depth * math.sin(math.pi * rest / half_period)
        course.append(side * (inside if rest <= half_period else 1e-5 - 0.01 * (rest - half_period)))
    # order 4 with 577 1/s · 1e-5 s: some 1e-10 of the depth of 17 µm
    assert motion.table_m == pytest.approx(np.array(course), abs=1e-13)


def test_a_flank_never_pulls():
    axis = Axis(THREE, friction=Friction(100.0), transmission=Transmission(2e-5))
    start = AxisState(motor_speed=5.0, screw_speed=3.0, table_speed_m_per_s=-0.05)
    motion = simulate_axis(axis, still(1e-5, 0.05), step_s=1e-5, start=start)
    gap = axis.mechanics.travel_per_motion * motion.screw - motion.table_m
    touching = motion.axial_force_n != 0
    assert touching.any()
    assert (~touching).any()
    assert (np.sign(motion.axial_force_n[touching]) == np.sign(gap[touching])).all()
    assert (np.abs(gap[touching]) >= 1e-5 * (1 - 1e-9)).all()


@pytest.mark.parametrize("speed", [0.001, 0.01, 0.1])
def test_a_flank_that_closes_exactly_at_an_instant_makes_no_energy(speed):
    """Half a gap of 2^-16 m, so that deflections less the gap are zero to the last bit when they are looked for."""
    axis = Axis(
        replace(UNDAMPED, screw_inertia_kg_m2=1e9, motor_inertia_kg_m2=1e9), transmission=Transmission(2.0**-15)
    )
    turns = 0.3 / UNDAMPED.travel_per_motion
    start = AxisState(motor=turns, screw=turns, table_m=0.3, table_speed_m_per_s=speed)
    energy = stored_energy_j(axis, simulate_axis(axis, still(1e-4, 0.02), step_s=1e-4, start=start))
    # rounding of forces: 1e8 N/m · 5.6e-17 m over depths of micrometres
    assert (energy - np.minimum.accumulate(energy)).max() <= 1e-9 * energy[0]


@pytest.mark.parametrize("excess", [1e-12, 1e-9, 1e-6, -1e-12, 0.0])
def test_grazing_ends(excess):
    """A speed that just touches zero: thrown against the friction so that a push comes when it is about to stop."""
    axis = Axis(MASS, friction=Friction(20.0))
    force = np.zeros(101)
    force[50:] = 20.0 + 1e-9
    motion = simulate_axis(axis, still(1e-3, 0.1, force), step_s=1e-3, start=AxisState(motor_speed=0.1 * (1 + excess)))
    # 50 ms of braking by 2 m/s², and on with the speed that is left, if any
    left = 0.1 * max(excess, 0.0)
    assert motion.table_m[-1] == pytest.approx(0.0025 + left * 0.1, abs=2e-12)


def test_a_dip_inside_one_step_is_seen():
    """Speed positive at both ends of a step, but the course between them would be negative: it stops there first."""
    axis = Axis(replace(UNDAMPED, screw_inertia_kg_m2=1e9, motor_inertia_kg_m2=1e9), friction=Friction(1.0))
    # the table swings on the screw about the deflection that friction asks for; its lowest speed would be −1 µm/s, for
    # 0.037 rad of the swing, and a step is 0.058 rad
    travel, swing_m_per_s = UNDAMPED.travel_per_motion, 1e-5 * math.sqrt(1e8 / 300.0)
    start = AxisState(
        motor=1e-8 / travel,
        screw=1e-8 / travel,
        motor_speed=(swing_m_per_s - 1e-6) / travel,
        screw_speed=(swing_m_per_s - 1e-6) / travel,
        table_speed_m_per_s=2 * swing_m_per_s - 1e-6,
    )
    coarse, fine = (
        simulate_axis(axis, still(1e-4, 0.1), step_s=step_s, start=start).table_m for step_s in (1e-4, 1e-6)
    )
    # 1e-5 m · (0.058)⁵/120 in each of 1000 steps; a dip that is missed would be 1e-6 m/s over 577 1/s, 2e-9 m
    assert coarse == pytest.approx(fine, abs=3e-10)
