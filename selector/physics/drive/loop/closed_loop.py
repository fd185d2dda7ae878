"""What an axis under continuous cascade control answers to its reference: its states.

Linear: sliding, without dry friction, backlash, limits and pitch errors; an axial compliance at load and position 0.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from selector.errors import InputError
from selector.physics.drive.parts.axis import Axis, Servo
from selector.physics.drive.parts.mechanics import AxialCompliance, Mechanics, RigidMechanics
from selector.physics.system import StateSpace
from selector.types import Vector

INTEGRAL = "speed_error_integral"


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

    InputError if the axis has no servo.
    """
    servo, mechanics = servo_of(axis), small_signal_mechanics(axis)
    system, radius = plant(mechanics), mechanics.travel_per_motion
    position, speed = measurement(axis)
    order = len(system.states)
    has_integral = servo.velocity_integral_gain > 0
    gain = servo.position_gain_per_s / radius
    inertia = inertia_at_motor(mechanics) / (radius * servo.actuator_gain)

    # error of the speed and command, by the states of the plant and the inputs
    error_by_state = -speed - gain * position
    error_by_input = np.array([gain, servo.velocity_feedforward / radius, 0.0, 0.0])
    command_by_state = servo.velocity_gain * error_by_state
    command_by_input = servo.velocity_gain * error_by_input
    command_by_input[2] += servo.acceleration_feedforward * inertia

    torque = servo.actuator_gain * system.B[:, 0]
    size = order + has_integral
    A, B = np.zeros((size, size)), np.zeros((size, 4))
    A[:order, :order] = system.A + np.outer(torque, command_by_state)
    B[:order] = np.outer(torque, command_by_input)
    B[:order, 3] = system.B[:, 1]
    C, D = np.zeros((2, size)), np.zeros((2, 4))
    C[0, :order], C[1, :order], D[1] = system.C[2], command_by_state, command_by_input
    if has_integral:
        A[:order, order] = torque * servo.velocity_integral_gain
        A[order, :order], B[order] = error_by_state, error_by_input
        C[1, order] = servo.velocity_integral_gain
    return StateSpace(
        A=A,
        B=B,
        C=C,
        D=D,
        states=system.states + ((INTEGRAL,) if has_integral else ()),
        inputs=("reference_m", "reference_speed_m_per_s", "reference_acceleration_m_per_s2", "force_n"),
        outputs=("table_m", "command"),
    )


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


def _unloaded_stiffness(compliance: AxialCompliance) -> float:
    near = compliance.origin_m
    shaft = near * ((compliance.length_m - near) / compliance.length_m if compliance.both_ends else 1.0)
    middle = int(np.argmin(np.abs(compliance.force_n)))
    cell = slice(max(middle - 1, 0), middle + 2)
    joint = np.ptp(compliance.joint_deflection_m[cell]) / np.ptp(compliance.force_n[cell])
    return float(1.0 / (joint + shaft / compliance.shaft_n))
