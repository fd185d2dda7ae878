"""The corners of a table of pitch errors: crossed, turned at, and stood on."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from selector.physics.drive.parts.axis import Axis, AxisState, Friction, Transmission
from selector.physics.drive.simulation import simulate_axis
from tests.physics.drive.axes import CONTINUOUS, THREE, UNDAMPED, sine, still
from tests.physics.drive.energies import stored_energy_j

# a screw between a nut that presses with 1000 N and a motor that holds against it, both far away on soft springs: what
# is left at the corner is the same torque to either side
FORCE_N, BEND = 1000.0, 1e-3
SOFT = replace(
    UNDAMPED,
    motor_inertia_kg_m2=1e9,
    table_mass_kg=1e9,
    torsional_stiffness_nm_per_rad=1e-3,
    axial_stiffness_n_per_m=1e3,
)
TRAVEL = SOFT.travel_per_motion
TORQUE = BEND * TRAVEL * FORCE_N
PRESSED = AxisState(motor=TRAVEL * FORCE_N / 1e-3, table_m=-FORCE_N / 1e3)


def bent(slope: float) -> Transmission:
    """Falls to a corner at 0 and rises from it by the same slope; negative: the other way round."""
    return Transmission(pitch_position_m=(-0.01, 0.0, 0.01), pitch_error_m=(0.01 * slope, 0.0, 0.01 * slope))


@pytest.mark.parametrize("step_s", [2e-2, 1e-3])
def test_a_screw_hops_across_the_corner_that_draws_it(step_s):
    speed = 1e-3
    axis, begin = Axis(SOFT, transmission=bent(BEND)), replace(PRESSED, screw_speed=speed)
    motion = simulate_axis(axis, still(1e-3 if step_s < 2e-2 else step_s, 0.2), step_s=step_s, start=begin)
    # flights of 2·I·ω/torque = 3.9 ms: parabolas that begin upwards and downwards by turns, five of them in 20 ms
    flight = 2.0 * speed * SOFT.screw_inertia_kg_m2 / TORQUE
    count, rest = np.divmod(motion.time_s, flight)
    expected = np.where(count % 2 == 0, 1.0, -1.0) * 0.5 * TORQUE / SOFT.screw_inertia_kg_m2 * rest * (flight - rest)
    # the springs change the torque by 1e-3/(1e-3·1000) of it a radian; 1e-6 rad × 51 hops
    assert motion.screw == pytest.approx(expected, abs=1e-3 * speed * flight)


def test_a_screw_whose_hops_are_short_for_a_step_stays_at_the_corner():
    axis = Axis(SOFT, transmission=bent(BEND))
    motion = simulate_axis(axis, still(0.1, 2.0), step_s=0.1, start=replace(PRESSED, screw_speed=1e-3))
    # hops of 3.9 ms, less than a sixteenth of a step
    assert (motion.screw[1:] == 0).all()
    assert (motion.screw_speed[1:] == 0).all()


@pytest.mark.parametrize("friction", [0.0, 0.5 * TORQUE, 2.0 * TORQUE])
def test_one_that_begins_at_a_corner_stays_there_or_leaves_it_as_the_torque_says(friction):
    resisted = Friction(screw_coulomb_nm=friction)
    reference = still(1e-3, 0.1)
    drawn = simulate_axis(Axis(SOFT, None, resisted, bent(BEND)), reference, step_s=1e-3, start=PRESSED)
    assert (drawn.screw == 0).all()
    driven = simulate_axis(Axis(SOFT, None, resisted, bent(-BEND)), reference, step_s=1e-3, start=PRESSED)
    gone = 0.5 * max(TORQUE - friction, 0.0) / SOFT.screw_inertia_kg_m2 * reference.time_s**2
    # springs as above: 2.5e-3 rad
    assert np.abs(driven.screw) == pytest.approx(gone, rel=1e-2)


def test_corners_make_no_energy():
    """An axis that nothing damps vibrates across corners 0.2 mm apart, where the pitch bends by 1 %, for 6 mm."""
    table = Transmission(
        pitch_position_m=tuple(2e-4 * np.arange(-50, 51)), pitch_error_m=tuple(1e-6 * (-1.0) ** np.arange(101))
    )
    axis, speed = Axis(UNDAMPED, transmission=table), 0.03
    turning = speed / UNDAMPED.travel_per_motion
    begin = AxisState(5e-3, turning, 0.0, turning, 2e-6, speed)
    lost = []
    for step_s in (5e-5, 2.5e-5):
        energy = stored_energy_j(axis, simulate_axis(axis, still(1e-4, 0.2), step_s=step_s, start=begin))
        # rounding of some thousand steps; 8e-6 with corners that are not located
        assert (energy - np.minimum.accumulate(energy)).max() <= 1e-12 * energy[0]
        lost.append(1.0 - energy[-1] / energy[0])
    # per unit of time the loss goes with the fifth power of the step, as without corners (test_kernel)
    assert math.log2(lost[0] / lost[1]) == pytest.approx(5.0, abs=0.2), lost


def test_a_turn_just_past_a_corner_within_one_step_is_seen():
    """Thrown against a torque that is three times as strong beyond the corner, with a little more than gets there."""
    steeper = Transmission(pitch_position_m=(-0.01, 0.0, 0.01), pitch_error_m=(-0.01 * BEND, 0.0, 0.03 * BEND))
    away, fall = 1e-6, TORQUE / SOFT.screw_inertia_kg_m2
    speed = 1.001 * math.sqrt(2.0 * fall * away)
    begin = replace(PRESSED, screw=-away, screw_speed=speed)
    motion = simulate_axis(Axis(SOFT, transmission=steeper), still(2e-2, 2e-2), step_s=2e-2, start=begin)
    there = math.sqrt(speed**2 - 2.0 * fall * away)
    after = 2e-2 - 2.0 * (speed - there) / fall - 2.0 * there / (3.0 * fall)
    expected = -away - speed * after - 0.5 * fall * after**2
    # springs as above: 1e-4 rad; without the corner it would be 1e-6 rad more
    assert motion.screw[-1] == pytest.approx(expected, abs=1e-8)


def test_a_corner_where_nothing_bends_is_none():
    """Values on one line: the same as one line, to the last bit."""
    axis = Axis(THREE, CONTINUOUS, Friction(300.0))
    one = Transmission(pitch_position_m=(-0.5, 0.5), pitch_error_m=(-(2.0**-10), 2.0**-10))
    many = Transmission(
        pitch_position_m=(-0.5, -0.25, 0.0, 0.5), pitch_error_m=(-(2.0**-10), -(2.0**-11), 0.0, 2.0**-10)
    )
    first, second = (
        simulate_axis(replace(axis, transmission=table), sine(1e-3, 0.2), step_s=1e-4).table_m for table in (one, many)
    )
    assert np.array_equal(first, second)
