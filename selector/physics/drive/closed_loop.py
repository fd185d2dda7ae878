"""What an axis under continuous cascade control answers to its reference: transfer function and states.

Linear: sliding, without dry friction, backlash, limits and pitch errors; an axial compliance at load and position 0.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from selector.errors import InputError
from selector.physics.drive.axis import Axis
from selector.physics.drive.mechanics import Mechanics, RigidMechanics, ThreeMassMechanics
from selector.physics.drive.servo import Servo
from selector.physics.drive.transmission import AxialCompliance
from selector.physics.system import StateSpace

Vector = NDArray[np.float64]
INTEGRAL = "speed_error_integral"


@dataclass(frozen=True)
class TransferFunction:
    """Ratio of two polynomials in s.

    Attributes
    ----------
    numerator, denominator : ndarray
        Coefficients, highest power of s first.
    """

    numerator: Vector
    denominator: Vector

    def __post_init__(self) -> None:
        for name in ("numerator", "denominator"):
            values = np.trim_zeros(np.array(getattr(self, name), dtype=np.float64), "f")
            values.setflags(write=False)
            object.__setattr__(self, name, values)

    def at(self, s: ArrayLike) -> NDArray[np.complex128]:
        """Value at complex frequencies [1/s], shape of `s`."""
        points = np.asarray(s, dtype=np.complex128)
        return np.asarray(np.polyval(self.numerator, points) / np.polyval(self.denominator, points))


def small_signal_mechanics(axis: Axis) -> Mechanics:
    """Mechanics of the axis with the stiffness of its axial compliance, if it has one, unloaded at position 0."""
    if axis.compliance is None or isinstance(axis.mechanics, RigidMechanics):
        return axis.mechanics
    return replace(axis.mechanics, axial_stiffness_n_per_m=_unloaded_stiffness(axis.compliance))


def inertia_at_motor(mechanics: Mechanics) -> float:
    """Inertia of the whole axis at the motor [kg·m²]; of a rigid axis its mass [kg]."""
    if isinstance(mechanics, RigidMechanics):
        return mechanics.mass_kg
    carried = mechanics.table_mass_kg * mechanics.travel_per_motion**2
    return mechanics.motor_inertia_kg_m2 + mechanics.screw_inertia_kg_m2 + carried


def closed_loop_transfer_function(axis: Axis) -> TransferFunction:
    """Table position over reference, of order 7 for three masses and PI control; F eq. 2 corrected.

    F prints b2…b7 right and b0, b1 and the numerator wrong (docs/explanation/time-varying-drive.md); with Dθ, De,
    feed-forward, or the position measured at the motor, the polynomials extend. Without an integral gain the common
    factor s is divided out. The sampling of a servo is left out here (`sampled_loop`).

    Raises
    ------
    InputError
        If the axis has no servo.
    """
    servo, mechanics = servo_of(axis), small_signal_mechanics(axis)
    table, motor, plant = _plant_polynomials(mechanics)
    radius = mechanics.travel_per_motion
    measured = table if servo.feedback == "table" else radius * motor
    pi = servo.actuator_gain * np.array([servo.velocity_gain, servo.velocity_integral_gain])
    gain = servo.position_gain_per_s / radius
    inertia = servo.acceleration_feedforward * inertia_at_motor(mechanics) / radius
    command = np.polyadd(
        np.polymul(pi, [servo.velocity_feedforward / radius, gain]),
        [inertia, 0.0, 0.0, 0.0],
    )
    speed_and_position = np.polyadd(np.polymul([1.0, 0.0], motor), gain * measured)
    numerator = np.polymul(command, table)
    denominator = np.polyadd(np.polymul([1.0, 0.0], plant), np.polymul(pi, speed_and_position))
    if servo.velocity_integral_gain == 0.0:
        numerator, denominator = numerator[:-1], denominator[:-1]
    return TransferFunction(np.asarray(numerator, np.float64), np.asarray(denominator, np.float64))


def plant(mechanics: Mechanics) -> StateSpace:
    """The mechanics alone: actuator's torque or force, and a force on the table, to positions and speeds."""
    inputs, outputs = ("actuator_force", "force_n"), ("motor", "motor_speed", "table_m", "table_speed_m_per_s")
    if isinstance(mechanics, RigidMechanics):
        mass = mechanics.mass_kg
        return StateSpace(
            A=np.array([[0.0, 1.0], [0.0, -mechanics.guide_damping_ns_per_m / mass]]),
            B=np.array([[0.0, 0.0], [1.0 / mass, 1.0 / mass]]),
            C=np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 0.0], [0.0, 1.0]]),
            D=np.zeros((4, 2)),
            states=("table_m", "table_speed_m_per_s"),
            inputs=inputs,
            outputs=outputs,
        )
    radius = mechanics.travel_per_motion
    masses = np.array([mechanics.motor_inertia_kg_m2, mechanics.screw_inertia_kg_m2, mechanics.table_mass_kg])
    # deflections of the two springs by the positions of motor, screw, table
    springs = np.array([[1.0, -1.0, 0.0], [0.0, radius, -1.0]])
    stiffness = np.diag([mechanics.torsional_stiffness_nm_per_rad, mechanics.axial_stiffness_n_per_m])
    inner = np.diag([mechanics.torsional_damping_nms_per_rad, mechanics.axial_damping_ns_per_m])
    outer = np.diag([0.0, mechanics.screw_damping_nms_per_rad, mechanics.guide_damping_ns_per_m])
    A = np.zeros((6, 6))
    A[:3, 3:] = np.eye(3)
    A[3:, :3] = -(springs.T @ stiffness @ springs) / masses[:, None]
    A[3:, 3:] = -(springs.T @ inner @ springs + outer) / masses[:, None]
    B = np.zeros((6, 2))
    B[3, 0], B[5, 1] = 1.0 / masses[0], 1.0 / masses[2]
    C = np.zeros((4, 6))
    C[[0, 1, 2, 3], [0, 3, 2, 5]] = 1.0
    states = ("motor", "screw", "table_m", "motor_speed", "screw_speed", "table_speed_m_per_s")
    return StateSpace(A=A, B=B, C=C, D=np.zeros((4, 2)), states=states, inputs=inputs, outputs=outputs)


def closed_loop(axis: Axis) -> StateSpace:
    """Reference, its speed and acceleration, and a force on the table, to table position and command.

    Raises
    ------
    InputError
        If the axis has no servo.
    """
    inputs = ("reference_m", "reference_speed_m_per_s", "reference_acceleration_m_per_s2", "force_n")
    return _loop(axis, inputs, ("table_m", "command"), closed=True)


def opened_position_loop(axis: Axis) -> StateSpace:
    """Position error to measured position, the velocity loop closed: what Nyquist looks at.

    Raises
    ------
    InputError
        If the axis has no servo.
    """
    return _loop(axis, ("position_error_m",), ("measured_m",), closed=False)


def servo_of(axis: Axis) -> Servo:
    """The servo of an axis; InputError if it has none."""
    if axis.servo is None:
        raise InputError(
            "an axis without a servo",
            expected="a servo with its gains",
            where="feed axis",
            advice="add the section servo of the axis",
        )
    return axis.servo


def measurement(axis: Axis) -> tuple[Vector, Vector]:
    """Rows that give the measured position and the motor's speed from the states of `plant`."""
    system, servo = plant(small_signal_mechanics(axis)), servo_of(axis)
    if servo.feedback == "table":
        return system.C[2], system.C[1]
    return axis.mechanics.travel_per_motion * system.C[0], system.C[1]


def _loop(axis: Axis, inputs: tuple[str, ...], outputs: tuple[str, ...], *, closed: bool) -> StateSpace:
    servo, mechanics = servo_of(axis), small_signal_mechanics(axis)
    system, radius = plant(mechanics), mechanics.travel_per_motion
    position, speed = measurement(axis)
    order = len(system.states)
    has_integral = servo.velocity_integral_gain > 0
    gain = servo.position_gain_per_s / radius

    # error of the speed and command, by the states of the plant and the inputs
    error_by_state = -speed - (gain * position if closed else 0.0)
    error_by_input = np.zeros(len(inputs))
    error_by_input[0] = gain
    command_by_input = np.zeros(len(inputs))
    if closed:
        error_by_input[1] = servo.velocity_feedforward / radius
        inertia = inertia_at_motor(mechanics) / (radius * servo.actuator_gain)
        command_by_input[2] = servo.acceleration_feedforward * inertia
    command_by_state = servo.velocity_gain * error_by_state
    command_by_input += servo.velocity_gain * error_by_input

    torque = servo.actuator_gain * system.B[:, 0]
    size = order + has_integral
    A, B = np.zeros((size, size)), np.zeros((size, len(inputs)))
    A[:order, :order] = system.A + np.outer(torque, command_by_state)
    B[:order] = np.outer(torque, command_by_input)
    command = np.zeros(size)
    command[:order] = command_by_state
    if has_integral:
        A[:order, order] = torque * servo.velocity_integral_gain
        A[order, :order], B[order] = error_by_state, error_by_input
        command[order] = servo.velocity_integral_gain
    C, D = np.zeros((len(outputs), size)), np.zeros((len(outputs), len(inputs)))
    if closed:
        B[:order, 3] = system.B[:, 1]
        C[0, :order], C[1], D[1] = system.C[2], command, command_by_input
    else:
        C[0, :order] = position
    states = system.states + ((INTEGRAL,) if has_integral else ())
    return StateSpace(A=A, B=B, C=C, D=D, states=states, inputs=inputs, outputs=outputs)


def _plant_polynomials(mechanics: Mechanics) -> tuple[Vector, Vector, Vector]:
    """Numerators of table and motor position over the actuator's torque, and their denominator."""
    if isinstance(mechanics, RigidMechanics):
        one = np.array([1.0])
        return one, one, np.array([mechanics.mass_kg, mechanics.guide_damping_ns_per_m, 0.0])
    m: ThreeMassMechanics = mechanics
    radius = m.travel_per_motion
    torsion = np.array([m.torsional_damping_nms_per_rad, m.torsional_stiffness_nm_per_rad])
    axial = np.array([m.axial_damping_ns_per_m, m.axial_stiffness_n_per_m])
    motor = np.polyadd([m.motor_inertia_kg_m2, 0.0, 0.0], torsion)
    screw = np.polyadd([m.screw_inertia_kg_m2, m.screw_damping_nms_per_rad, 0.0], torsion + radius**2 * axial)
    table = np.polyadd([m.table_mass_kg, m.guide_damping_ns_per_m, 0.0], axial)
    behind = np.polysub(np.polymul(screw, table), radius**2 * np.polymul(axial, axial))
    coupled = np.polymul(np.polymul(torsion, torsion), table)
    whole = np.asarray(np.polyadd(np.polymul(motor, behind), -1.0 * coupled), np.float64)
    # what is left of the constant term is rounding: nothing holds the axis in place
    whole[-1] = 0.0
    return np.asarray(radius * np.polymul(torsion, axial)), np.asarray(behind, np.float64), whole


def _unloaded_stiffness(compliance: AxialCompliance) -> float:
    near = compliance.origin_m
    shaft = near * ((compliance.length_m - near) / compliance.length_m if compliance.both_ends else 1.0)
    middle = int(np.argmin(np.abs(compliance.force_n)))
    cell = slice(max(middle - 1, 0), middle + 2)
    joint = np.ptp(compliance.joint_deflection_m[cell]) / np.ptp(compliance.force_n[cell])
    return float(1.0 / (joint + shaft / compliance.shaft_n))
