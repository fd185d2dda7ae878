"""The slow and obvious twin of the compiled kernel: an axis as x' = f(t, x, u), for SciPy's solvers and `linearise`."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy import interpolate, optimize

from selector.errors import InputError
from selector.physics.drive.closed_loop import StateSpace
from selector.physics.drive.parts.axis import (
    AxialCompliance,
    Axis,
    AxisState,
    RigidMechanics,
    Servo,
    ThreeMassMechanics,
    pitch_error_m,
)
from selector.physics.drive.trajectory import ParameterCourse, Reference
from selector.types import Matrix, Vector


@dataclass(frozen=True)
class AxisSystem:
    """An axis as x' = f(t, x, u), whatever is continuous of it: no sampling, and dry friction only while it slides.

    States: motor, motor_speed, screw, screw_speed, table, table_speed (rigid: position, speed), then bristle and
    integral where there are any. Inputs: a force on the table [N] and a command [actuator unit], both added to what
    reference and servo say.

    InputError if the servo is sampled.
    """

    #: axis, reference and course: As in `simulate_axis`
    axis: Axis
    reference: Reference
    course: ParameterCourse | None = None
    #: {-1, 0, 1}: Direction in which guide and screw slide; 0: without dry friction. Bristles need none.
    slip_direction: int = 0

    def __post_init__(self) -> None:
        if self.axis.servo is not None and self.axis.servo.sample_s > 0:
            raise InputError(
                "a sampled servo", expected="a continuous one", where="axis as a system", advice="set sample_s to 0"
            )

    @property
    def rigid(self) -> bool:
        """Whether the axis is one mass."""
        return isinstance(self.axis.mechanics, RigidMechanics)

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states."""
        turning = () if self.rigid else ("motor", "motor_speed", "screw", "screw_speed")
        table = ("position", "speed") if self.rigid else ("table", "table_speed")
        bristle = () if self.axis.friction.lugre is None else ("bristle",)
        return turning + table + bristle + (() if self.axis.servo is None else ("integral",))

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs."""
        return ("force_n", "command")

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs."""
        return ("table_m", "motor", "axial_force_n")

    def start(self, state: AxisState) -> Vector:
        """The states of this system at a state of the axis."""
        turning = [] if self.rigid else [state.motor, state.motor_speed, state.screw, state.screw_speed]
        table = [state.motor, state.motor_speed] if self.rigid else [state.table_m, state.table_speed_m_per_s]
        bristle = [] if self.axis.friction.lugre is None else [state.bristle_m]
        return np.array(turning + table + bristle + ([] if self.axis.servo is None else [state.integral]))

    def derivative(self, t_s: float, x: Vector, u: Vector) -> Vector:
        """Rate of every state, shape (n_states,)."""
        state = dict(zip(self.states, x, strict=True))
        rate = dict.fromkeys(self.states, 0.0)
        command = u[1]
        if self.axis.servo is not None:
            wanted, rate["integral"] = self._control(self.axis.servo, t_s, state)
            command = command + wanted
        drive = self._drive(command, state["position" if self.rigid else "motor"])
        mechanics = self.axis.mechanics
        if isinstance(mechanics, RigidMechanics):
            push, table, mass = drive, "position", mechanics.mass_kg
        else:
            push, table, mass = self._turn(mechanics, t_s, state, drive, rate), "table", mechanics.table_mass_kg
        speed = state["speed" if self.rigid else "table_speed"]
        damping = mechanics.guide_damping_ns_per_m
        if self.course is not None and self.course.guide_damping_ns_per_m is not None:
            damping = self._between(t_s, self.course.guide_damping_ns_per_m)
        if speed < 0.0:
            damping += self.axis.friction.viscous_negative_ns_per_m
        friction = self._friction(speed, state, rate)
        force = push + u[0] + self._force(t_s) - self.axis.friction.offset_n - damping * speed - friction
        rate[table] = speed
        rate["speed" if self.rigid else "table_speed"] = force / mass
        return np.array([rate[name] for name in self.states])

    def output(self, t_s: float, x: Vector, u: Vector) -> Vector:
        """Position of the table [m], of the motor, and axial force [N]; of a rigid axis the force of the actuator."""
        state = dict(zip(self.states, x, strict=True))
        mechanics = self.axis.mechanics
        if isinstance(mechanics, ThreeMassMechanics):
            return np.array([state["table"], state["motor"], self._nut(mechanics, t_s, state)[0]])
        motor = state["position"]
        command = u[1] if self.axis.servo is None else u[1] + self._control(self.axis.servo, t_s, state)[0]
        return np.array([motor + pitch_error_m(self.axis, motor)[0], motor, self._drive(command, motor)])

    @cached_property
    def _course(self) -> tuple[interpolate.CubicHermiteSpline, interpolate.CubicHermiteSpline]:
        """Commanded position and speed between the samples."""
        time_s, given = self.reference.time_s, self.reference
        return (
            interpolate.CubicHermiteSpline(time_s, given.position_m, given.speed_m_per_s),
            interpolate.CubicHermiteSpline(time_s, given.speed_m_per_s, given.acceleration_m_per_s2),
        )

    def _between(self, t_s: float, values: Vector) -> float:
        return float(np.interp(t_s, self.reference.time_s, values))

    def _force(self, t_s: float) -> float:
        if self.reference.force_n is None:
            return 0.0
        return float(self.reference.force_n[self._period(t_s)])

    def _period(self, t_s: float) -> int:
        return min(max(math.floor(t_s / self.reference.period_s * (1 + 1e-12)), 0), len(self.reference.position_m) - 1)

    def _control(self, servo: Servo, t_s: float, state: dict[str, float]) -> tuple[float, float]:
        """Command, and rate of the integral."""
        position, ahead = self._course
        mechanics = self.axis.mechanics
        travel = mechanics.travel_per_motion
        if isinstance(mechanics, RigidMechanics):
            inertia, motor, motor_speed = mechanics.mass_kg, state["position"], state["speed"]
            table = motor + float(pitch_error_m(self.axis, motor)[0])
        else:
            inertia = (
                mechanics.motor_inertia_kg_m2 + mechanics.screw_inertia_kg_m2 + mechanics.table_mass_kg * travel**2
            )
            motor, motor_speed, table = state["motor"], state["motor_speed"], state["table"]
        measured = table if servo.feedback == "table" else travel * motor
        wanted = servo.position_gain_per_s * (float(position(t_s)) - measured) / travel
        wanted += servo.velocity_feedforward * float(ahead(t_s)) / travel
        if servo.speed_limit is not None:
            wanted = min(max(wanted, -servo.speed_limit), servo.speed_limit)
        error = wanted - motor_speed
        command = servo.velocity_gain * error + servo.velocity_integral_gain * state["integral"]
        acceleration = self._between(t_s, self.reference.acceleration_m_per_s2)
        command += servo.acceleration_feedforward * inertia * acceleration / (travel * servo.actuator_gain)
        if servo.command_limit is not None and abs(command) > servo.command_limit:
            return math.copysign(servo.command_limit, command), 0.0
        return command, error

    def _drive(self, command: float, motor: float) -> float:
        gain = 1.0 if self.axis.servo is None else self.axis.servo.actuator_gain
        angle = 2.0 * math.pi * motor / self.axis.ripple_period
        waves = [(one, math.sin(one.harmonic * angle + one.phase_rad)) for one in self.axis.ripple]
        share = 1.0 + sum(one.share * wave for one, wave in waves)
        return gain * command * share + sum(one.cogging * wave for one, wave in waves)

    def _turn(
        self, mechanics: ThreeMassMechanics, t_s: float, state: dict[str, float], drive: float, rate: dict[str, float]
    ) -> float:
        """Rates of motor and screw; returns what pushes the table."""
        twist = mechanics.torsional_stiffness_nm_per_rad * (state["motor"] - state["screw"])
        twist += mechanics.torsional_damping_nms_per_rad * (state["motor_speed"] - state["screw_speed"])
        force, walk, gear = self._nut(mechanics, t_s, state)
        torque = twist - mechanics.screw_damping_nms_per_rad * state["screw_speed"] - gear * force
        # the nut hands on η of the power of the screw; of what the table drives back as much less
        lost = abs(gear * force) * (1.0 / self.axis.friction.nut_efficiency - 1.0)
        torque -= self.slip_direction * (self.axis.friction.screw_coulomb_nm + lost)
        rate["motor"], rate["motor_speed"] = state["motor_speed"], (drive - twist) / mechanics.motor_inertia_kg_m2
        rate["screw"], rate["screw_speed"] = state["screw_speed"], torque / mechanics.screw_inertia_kg_m2
        return force + walk

    def _nut(self, mechanics: ThreeMassMechanics, t_s: float, state: dict[str, float]) -> tuple[float, float, float]:
        """Axial force, force of the walk along the strained shaft, and travel per turn of the screw [m/rad]."""
        travel = mechanics.travel_per_motion
        error, slope = (float(one) for one in pitch_error_m(self.axis, state["screw"]))
        deflection = travel * state["screw"] + error - state["table"]
        rate = (travel + slope) * state["screw_speed"] - state["table_speed"]
        half_gap = self.axis.transmission.backlash_m / 2
        beyond = math.copysign(max(abs(deflection) - half_gap, 0.0), deflection)
        stiffness, walk = mechanics.axial_stiffness_n_per_m, 0.0
        if self.course is not None and self.course.axial_stiffness_n_per_m is not None:
            stiffness = self._between(t_s, self.course.axial_stiffness_n_per_m)
        force = stiffness * beyond
        if self.axis.compliance is not None:
            force, walk = _compliant(self.axis.compliance, beyond, state["table"])
        force += mechanics.axial_damping_ns_per_m * rate
        if half_gap > 0 and (beyond == 0 or force * beyond < 0):
            force, walk = 0.0, 0.0
        return force, walk, travel + slope

    def _friction(self, speed: float, state: dict[str, float], rate: dict[str, float]) -> float:
        friction = self.axis.friction
        direction = self.slip_direction if friction.lugre is None else (1 if speed >= 0 else -1)
        coulomb, static = friction.directions[0 if direction >= 0 else 1]
        ratio = max(direction * speed, 0.0) / friction.stribeck_speed_m_per_s
        sliding = coulomb + (static - coulomb) * math.exp(-(ratio**friction.stribeck_exponent))
        if friction.lugre is None:
            return direction * sliding
        if sliding == 0:
            return 0.0
        bristle, damping = friction.lugre.stiffness_n_per_m, friction.lugre.damping_ns_per_m
        if friction.lugre.fading_speed_m_per_s > 0:
            damping *= math.exp(-((speed / friction.lugre.fading_speed_m_per_s) ** 2))
        rate["bristle"] = speed - bristle * abs(speed) / sliding * state["bristle"]
        return bristle * state["bristle"] + damping * rate["bristle"]


def shaft_m_per_n(compliance: AxialCompliance, table_m: float) -> float:
    """Deflection of the shaft alone per force with the table there [m/N]; constant beyond the bearings."""
    free = min(max(compliance.origin_m + table_m, 0.0), compliance.length_m)
    share = free * (compliance.length_m - free) / compliance.length_m if compliance.both_ends else free
    return share / compliance.shaft_n


def _compliant(compliance: AxialCompliance, deflection: float, table_m: float) -> tuple[float, float]:
    """Force at a deflection by root finding, and the force along the travel of ½·force²·shaft(x)."""
    shaft, free = shaft_m_per_n(compliance, table_m), compliance.origin_m + table_m
    slope = (1.0 - 2.0 * free / compliance.length_m) if compliance.both_ends else 1.0
    if not 0.0 < free < compliance.length_m:
        slope = 0.0
    joints = interpolate.make_interp_spline(compliance.force_n, compliance.joint_deflection_m, k=1)

    def excess(force: float) -> float:
        return float(force * shaft + joints(force) - deflection)

    reach = 1.0 + float(np.abs(compliance.force_n).max())
    while excess(-reach) > 0 or excess(reach) < 0:
        reach *= 2.0
    force = float(optimize.brentq(excess, -reach, reach, xtol=1e-12, rtol=1e-15))
    return force, 0.5 * force**2 * slope / compliance.shaft_n


def linearise(system: Any, x: ArrayLike, u: ArrayLike, *, t_s: float = 0.0) -> StateSpace:
    """The linear system that small deviations from (`x`, `u`) obey at time `t_s` [s]; by central differences."""
    state, held = np.array(x, dtype=np.float64), np.array(u, dtype=np.float64)
    return StateSpace(
        A=_jacobian(lambda value: system.derivative(t_s, value, held), state, len(system.states)),
        B=_jacobian(lambda value: system.derivative(t_s, state, value), held, len(system.states)),
        C=_jacobian(lambda value: system.output(t_s, value, held), state, len(system.outputs)),
        D=_jacobian(lambda value: system.output(t_s, state, value), held, len(system.outputs)),
    )


def _jacobian(function: Callable[[Vector], Vector], at: Vector, rows: int) -> Matrix:
    found = np.empty((rows, len(at)))
    for column in range(len(at)):
        # cube root of the rounding: where truncation and rounding of a central difference meet
        step = 6e-6 * max(1.0, abs(at[column]))
        above, below = at.copy(), at.copy()
        above[column] += step
        below[column] -= step
        found[:, column] = (function(above) - function(below)) / (above[column] - below[column])
    return found
