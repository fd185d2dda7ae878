"""Where the compiled equations find what: an axis as one row of numbers and one of switches, and their work space.

Rows of this kind keep the compiled functions to one signature, so that no axis makes them compile again.
"""

import math

import numpy as np
from numpy.typing import NDArray

from selector.physics.drive.closed_loop import inertia_at_motor
from selector.physics.drive.parts.axis import Axis, RigidMechanics, Transmission
from selector.types import Vector

Switches = NDArray[np.int64]

# states: motor, screw, table, bristles, integral of the servo; a rigid axis uses X, V for its mass
QM, WM, QL, WL, X, V, Z, INTEGRAL = range(8)

# numbers: masses and springs, friction, where the travel differs, what drives, control and sensing, the grid of time
MOTOR_INERTIA, SCREW_INERTIA, MASS, TRAVEL, TORSION, TORSION_DAMPING, AXIAL, AXIAL_DAMPING = range(8)
SCREW_DAMPING, GUIDE_DAMPING, COULOMB_UP, EXCESS_UP, COULOMB_DOWN, EXCESS_DOWN, STRIBECK_SPEED = range(8, 15)
STRIBECK_EXPONENT, OFFSET, SCREW_COULOMB, BRISTLE, BRISTLE_DAMPING, FADING, HALF_GAP = range(15, 22)
PITCH_AMPLITUDE, PITCH_RATE, PITCH_PHASE, PITCH_SLOPE, SHAFT, LENGTH, ORIGIN, RIPPLE_RATE = range(22, 30)
POSITION_GAIN, VELOCITY_GAIN, INTEGRAL_GAIN, ACTUATOR_GAIN, COMMAND_LIMIT, SPEED_LIMIT = range(30, 36)
SPEED_AHEAD, ACCELERATION_AHEAD, SAMPLE, MOTOR_RESOLUTION, SCALE_RESOLUTION = range(36, 41)
PERIOD, STEP, DELAY_PART, MORE_DAMPING_DOWN, NUT_LOSS, NUMBERS = range(41, 47)

# switches: what there is, how many, and where its table begins
RIGID, CONTROL, DRY, SCREW_DRY, LUGRE, BACKLASH, VARYING_AXIAL, VARYING_GUIDE, PITCH, PITCH_POINTS = range(10)
COMPLIANCE_POINTS, BOTH_ENDS, RIPPLES, TABLE_FEEDBACK, SPEED_FROM_ENCODER, SPEED_SAMPLES, PERIOD_STEPS = range(10, 17)
SAMPLE_STEPS, DELAY_STEPS, MOST_EVENTS, PITCH_AT, COMPLIANCE_AT, RIPPLE_AT, CORNERS, LIMITS = range(17, 25)
# modes, which change while the axis moves
GUIDE, SCREW, CONTACT, SEGMENT, AT_CORNER, SPEED_MODE, COMMAND_MODE, SWITCHES = range(25, 33)

# what drives the actuator
NOTHING, CONTINUOUS, SAMPLED, GIVEN = range(4)

# columns of the reference
POSITION, SPEED, ACCELERATION, FORCE, COURSE_AXIAL, COURSE_GUIDE, COLUMNS = range(7)

# rows of the work space: the state, stages of a step, its end, rates of all of these, and what else was found
Y, STAGE_A, STAGE_B, STAGE_C, NEW, K1, K2, K3, K4, KEND, ALSO, ROWS = range(12)
# columns of ALSO: forces that would move guide and screw, force of the screw, how far each flank is engaged, …
GUIDE_BALANCE, SCREW_BALANCE, AXIAL_FORCE, UPPER, LOWER, COMMAND, DRIVE, FRICTION = range(8)
# … speed and command before their limits, speed error, how fast the command would change if its integral stood, and
# with how much dry friction the screw is held
WANTED, ASKED, ERROR, ASKED_RATE, SCREW_HOLDS, WORK_COLUMNS = range(8, 14)


def packed_axis(axis: Axis) -> tuple[Vector, Switches]:
    """Numbers and switches of an axis; the grid of time is still to be written into them."""
    p, o = np.zeros(NUMBERS), np.zeros(SWITCHES, dtype=np.int64)
    _pack_mechanics(axis, p, o)
    _pack_friction(axis, p, o)
    _pack_servo(axis, p, o)
    tables = _pack_transmission(axis, p, o)
    return np.concatenate([p, *tables]), o


def _pack_mechanics(axis: Axis, p: Vector, o: Switches) -> None:
    mechanics = axis.mechanics
    p[TRAVEL] = mechanics.travel_per_motion
    p[GUIDE_DAMPING] = mechanics.guide_damping_ns_per_m
    if isinstance(mechanics, RigidMechanics):
        o[RIGID] = 1
        p[MASS] = mechanics.mass_kg
        return
    p[MOTOR_INERTIA] = mechanics.motor_inertia_kg_m2
    p[SCREW_INERTIA] = mechanics.screw_inertia_kg_m2
    p[MASS] = mechanics.table_mass_kg
    p[TORSION] = mechanics.torsional_stiffness_nm_per_rad
    p[TORSION_DAMPING] = mechanics.torsional_damping_nms_per_rad
    p[AXIAL] = mechanics.axial_stiffness_n_per_m
    p[AXIAL_DAMPING] = mechanics.axial_damping_ns_per_m
    p[SCREW_DAMPING] = mechanics.screw_damping_nms_per_rad


def _pack_friction(axis: Axis, p: Vector, o: Switches) -> None:
    friction = axis.friction
    (up, hold_up), (down, hold_down) = friction.directions
    p[COULOMB_UP], p[EXCESS_UP] = up, hold_up - up
    p[COULOMB_DOWN], p[EXCESS_DOWN] = down, hold_down - down
    p[STRIBECK_SPEED], p[STRIBECK_EXPONENT] = friction.stribeck_speed_m_per_s, friction.stribeck_exponent
    p[OFFSET] = friction.offset_n
    p[MORE_DAMPING_DOWN] = friction.viscous_negative_ns_per_m
    p[SCREW_COULOMB] = friction.screw_coulomb_nm
    resists = max(up, down, hold_up, hold_down) > 0
    o[DRY] = resists and friction.lugre is None
    p[NUT_LOSS] = 1.0 / friction.nut_efficiency - 1.0
    o[SCREW_DRY] = friction.screw_coulomb_nm > 0 or p[NUT_LOSS] > 0
    if resists and friction.lugre is not None:
        o[LUGRE] = 1
        p[BRISTLE] = friction.lugre.stiffness_n_per_m
        p[BRISTLE_DAMPING] = friction.lugre.damping_ns_per_m
        p[FADING] = friction.lugre.fading_speed_m_per_s


def _pack_servo(axis: Axis, p: Vector, o: Switches) -> None:
    servo, sensing = axis.servo, axis.sensing
    p[ACTUATOR_GAIN] = 1.0
    p[COMMAND_LIMIT] = p[SPEED_LIMIT] = math.inf
    o[TABLE_FEEDBACK] = servo is None or servo.feedback == "table"
    p[MOTOR_RESOLUTION], p[SCALE_RESOLUTION] = sensing.motor_resolution, sensing.scale_resolution_m
    o[SPEED_FROM_ENCODER], o[SPEED_SAMPLES] = sensing.speed_from_encoder, sensing.speed_samples
    if servo is None:
        return
    o[CONTROL] = SAMPLED if servo.sample_s > 0 else CONTINUOUS
    p[SAMPLE] = servo.sample_s
    p[POSITION_GAIN] = servo.position_gain_per_s
    p[VELOCITY_GAIN] = servo.velocity_gain
    p[INTEGRAL_GAIN] = servo.velocity_integral_gain
    p[ACTUATOR_GAIN] = servo.actuator_gain
    p[SPEED_AHEAD] = servo.velocity_feedforward
    motor_force = inertia_at_motor(axis.mechanics) / axis.mechanics.travel_per_motion
    p[ACCELERATION_AHEAD] = servo.acceleration_feedforward * motor_force / servo.actuator_gain
    if servo.command_limit is not None:
        p[COMMAND_LIMIT] = servo.command_limit
    if servo.speed_limit is not None:
        p[SPEED_LIMIT] = servo.speed_limit
    o[LIMITS] = o[CONTROL] == CONTINUOUS and min(p[COMMAND_LIMIT], p[SPEED_LIMIT]) < math.inf


def _pack_transmission(axis: Axis, p: Vector, o: Switches) -> list[Vector]:
    transmission, compliance = axis.transmission, axis.compliance
    p[HALF_GAP] = transmission.backlash_m / 2
    o[BACKLASH] = transmission.backlash_m > 0
    p[PITCH_AMPLITUDE], p[PITCH_PHASE] = transmission.pitch_amplitude_m, transmission.pitch_phase_rad
    p[PITCH_SLOPE] = transmission.pitch_slope
    p[RIPPLE_RATE] = 2.0 * math.pi / axis.ripple_period
    p[PITCH_RATE] = p[RIPPLE_RATE] if o[RIGID] else 1.0
    tables = _corners(transmission)
    o[PITCH_AT], o[PITCH_POINTS] = NUMBERS, len(tables[0])
    o[PITCH] = transmission.pitch_amplitude_m > 0 or transmission.pitch_slope != 0 or len(tables[0]) > 0
    # of a rigid axis the pitch error only displaces the table: nothing bends unless a continuous control sees it
    seen = o[CONTROL] == CONTINUOUS and o[TABLE_FEEDBACK]
    o[CORNERS] = len(tables[0]) > 1 and (not o[RIGID] or seen)
    o[COMPLIANCE_AT] = NUMBERS + sum(map(len, tables))
    if compliance is not None:
        p[SHAFT], p[LENGTH], p[ORIGIN] = compliance.shaft_n, compliance.length_m, compliance.origin_m
        o[BOTH_ENDS], o[COMPLIANCE_POINTS] = compliance.both_ends, len(compliance.force_n)
        tables += [compliance.force_n, compliance.joint_deflection_m]
    o[RIPPLE_AT] = o[COMPLIANCE_AT] + 2 * o[COMPLIANCE_POINTS]
    acting = [one for one in axis.ripple if one.cogging != 0 or one.share != 0]
    o[RIPPLES] = len(acting)
    tables += [np.array([one.harmonic, one.cogging, one.share, one.phase_rad]) for one in acting]
    return tables


def _corners(transmission: Transmission) -> list[Vector]:
    """Where the table of the pitch error bends, the errors there, and the slopes before, between and after."""
    position = np.array(transmission.pitch_position_m, dtype=np.float64)
    error = np.array(transmission.pitch_error_m, dtype=np.float64)
    if len(position) == 0:
        return [position, error, np.zeros(0)]
    slope = np.concatenate([[0.0], np.diff(error) / np.diff(position), [0.0]])
    bends = slope[1:] != slope[:-1]
    # a table of one value bends nowhere: one corner says what it is
    bends[0] |= not bends.any()
    return [position[bends], error[bends], np.concatenate([slope[:-1][bends], slope[-1:]])]
