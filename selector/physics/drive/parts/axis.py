"""A feed axis as a whole: mechanics, friction, transmission, servo and sensing in SI units, and what it begins from."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Annotated, Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy import optimize

from selector.errors import InputError
from selector.physics.checks import require_finite, require_not_negative, require_positive
from selector.physics.drive.parts.mechanics import (
    AxialCompliance,
    Friction,
    Mechanics,
    RigidMechanics,
    Ripple,
    Transmission,
)
from selector.physics.model_fields import Fit, Limits, Unit, Usual
from selector.types import Vector

MOST_WAITING = 300
"""Samples of the control that a command may wait, and that a measured speed may reach over."""

KV = 1000.0 / 60.0
"""1 m/(min·mm), the workshop's unit of the Kv factor, in 1/s."""

_Limit = Annotated[float, Limits(1e-9, 1e9), Fit()]
_Waiting = Annotated[float, Unit("s"), Usual(1e-6, 0.05, {"ms": 1e-3, "µs": 1e-6})]


@dataclass(frozen=True)
class Servo:
    """Cascade control: position P, velocity PI on the motor's speed, limits, sampling, delay, feed-forward.

    ``speed* = Kp·(r − y)/R + ff_v·r'/R``; ``u = Kvp·e + Kvi·∫e dt + ff_a·I·r''/(R·Kf)`` with
    e = speed* − motor speed and I the inertia of the whole axis at the motor; torque or force = Kf·u.
    F writes K_pp = Kp/R. Sampled: ∫e dt is the sum of sample_s·e over the samples before this one. The integral stands
    while u is limited; if a continuous one would leave the limit by standing and come back by moving on, it follows the
    limit, as a sampled one does by turns.
    """

    #: Kp, the "Kv factor" of the workshop [1/s]
    position_gain_per_s: Annotated[
        float, Unit("1/s"), Limits(1e-9, 1e9), Fit(), Usual(6.0, 600.0, {"m/(min·mm)": KV, "1/min": 1.0 / 60.0})
    ]
    #: velocity_gain and velocity_integral_gain: Kvp [actuator unit per motor speed], Kvi [the same per s]: A·s/rad,
    #: A/rad; or V·s/m, V/m
    velocity_gain: Annotated[float, Limits(1e-12, 1e12), Fit()]
    velocity_integral_gain: Annotated[float, Fit()] = 0.0
    actuator_gain: _Limit = 1.0  #: Kf [N·m or N per actuator unit]
    #: command_limit and speed_limit: Largest |u| [actuator unit] and largest |speed*| [motor speed]
    command_limit: _Limit | None = None
    speed_limit: _Limit | None = None
    #: Period of both loops [s], u is held between; 0: continuous
    sample_s: Annotated[_Waiting, Limits(1e-6, 100.0)] = 0.0
    #: From the computed command to the actuator [s]
    delay_s: Annotated[_Waiting, Limits(0.0, 100.0), Fit(up_to=0.02)] = 0.0
    #: velocity_feedforward and acceleration_feedforward: Shares ff_v, ff_a, 1 = complete
    velocity_feedforward: Annotated[float, Limits(0.0, 10.0), Fit(up_to=2.0)] = 0.0
    acceleration_feedforward: Annotated[float, Limits(0.0, 10.0), Fit(up_to=2.0)] = 0.0
    #: {"table", "motor"}: Where the position is measured: scale on the table, or encoder of the motor × R
    feedback: Literal["table", "motor"] = "table"

    def __post_init__(self) -> None:
        require_positive(self, "position_gain_per_s", "velocity_gain", "actuator_gain", "command_limit", "speed_limit")
        require_not_negative(
            self, "velocity_integral_gain", "sample_s", "delay_s", "velocity_feedforward", "acceleration_feedforward"
        )


@dataclass(frozen=True)
class Sensing:
    """What the control sees of position and current; zero: exactly."""

    #: Step of the motor's encoder [rad], or [m] for a rigid axis
    motor_resolution: Annotated[float, Limits(1e-15, 1e3)] = 0.0
    #: Step of the linear scale [m]
    scale_resolution_m: Annotated[
        float, Unit("m"), Limits(1e-15, 1e3), Usual(0.0, 1e-3, {"µm": 1e-6, "mm": 1e-3, "nm": 1e-9})
    ] = 0.0
    #: Speed as the difference of two encoder readings, as controls have it; else the true speed
    speed_from_encoder: bool = False
    #: Samples between these two readings; over more than one the speed is smoother and later, by half of them
    speed_samples: Annotated[int, Limits(1, MOST_WAITING)] = 1
    #: Standard deviation of noise on the command, drawn at every sample [actuator unit]
    current_noise: Annotated[float, Limits(0.0, 1e6)] = 0.0

    def __post_init__(self) -> None:
        require_not_negative(self, "motor_resolution", "scale_resolution_m", "current_noise")
        if self.speed_samples < 1 or (self.speed_samples > 1 and not self.speed_from_encoder):
            raise InputError(
                f"{self.speed_samples}" + ("" if self.speed_samples < 1 else " without a speed from the encoder"),
                expected="1, or more with speed_from_encoder",
                where="speed_samples",
                advice="set speed_from_encoder, or leave speed_samples out",
            )


@dataclass(frozen=True)
class Axis:
    """A feed axis: `servo` None leaves it to itself (free motion, or driven by given commands).

    InputError if a part needs a structure or a servo that the axis has not.
    """

    mechanics: Mechanics
    servo: Servo | None = None
    friction: Friction = field(default_factory=Friction)
    transmission: Transmission = field(default_factory=Transmission)
    ripple: tuple[Ripple, ...] = ()
    ripple_period: float = 2.0 * math.pi
    compliance: AxialCompliance | None = None
    sensing: Sensing = field(default_factory=Sensing)

    def __post_init__(self) -> None:
        require_positive(self, "ripple_period")
        rigid = isinstance(self.mechanics, RigidMechanics)
        for is_there, what in (
            (self.transmission.backlash_m > 0, "backlash"),
            (self.compliance is not None, "an axial compliance"),
            (self.friction.screw_coulomb_nm > 0, "friction of the screw"),
        ):
            if rigid and is_there:
                raise _unfit(f"{what} in a rigid axis", "a three-mass axis", "describe motor, screw and table")
        if self._least_travel <= 0.0:
            raise InputError(
                f"a pitch error that turns the travel back (least slope {self._least_travel:.3g})",
                expected="errors that change by less than the travel",
                where="transmission",
                advice="give pitch errors in metres: 5 µm are 5e-6",
            )
        sampled = self.servo is not None and self.servo.sample_s > 0
        for is_there, what in (
            (self.servo is not None and self.servo.delay_s > 0, "a delay"),
            (self.sensing != Sensing(), "an encoder or noise"),
        ):
            if is_there and not sampled:
                raise _unfit(f"{what} without a sampled servo", "sample_s above 0", "give the servo's sample time")

    @property
    def _least_travel(self) -> float:
        """A bound of the true travel per nominal one."""
        pitch, radius = self.transmission, self.mechanics.travel_per_motion
        rate = 2.0 * math.pi / self.ripple_period if isinstance(self.mechanics, RigidMechanics) else 1.0
        falls = [
            (error - before) / (at - since)
            for (since, before), (at, error) in pairwise(zip(pitch.pitch_position_m, pitch.pitch_error_m, strict=True))
        ]
        return 1.0 + pitch.pitch_slope + min(falls, default=0.0) - pitch.pitch_amplitude_m * rate / radius


def _unfit(found: str, expected: str, advice: str) -> InputError:
    return InputError(found, expected=expected, where="feed axis", advice=advice)


def pitch_error_m(axis: Axis, screw: ArrayLike) -> tuple[Vector, Vector]:
    """Pitch error [m] at positions of the screw (of a rigid axis: of its mass), and its slope per unit of position."""
    pitch, travel = axis.transmission, axis.mechanics.travel_per_motion
    rate = 2.0 * math.pi / axis.ripple_period if isinstance(axis.mechanics, RigidMechanics) else 1.0
    nominal = travel * np.asarray(screw, dtype=np.float64)
    angle = rate * np.asarray(screw, dtype=np.float64) + pitch.pitch_phase_rad
    error = pitch.pitch_amplitude_m * np.sin(angle) + pitch.pitch_slope * nominal
    slope = pitch.pitch_amplitude_m * rate * np.cos(angle) + pitch.pitch_slope * travel
    if len(pitch.pitch_position_m) > 1:
        places, errors = np.array(pitch.pitch_position_m), np.array(pitch.pitch_error_m)
        rise = np.concatenate([[0.0], np.diff(errors) / np.diff(places), [0.0]])
        slope = slope + travel * rise[np.searchsorted(places, nominal, side="right")]
        error = error + np.interp(nominal, places, errors)
    elif len(pitch.pitch_position_m) == 1:
        error = error + pitch.pitch_error_m[0]
    return error, slope


@dataclass(frozen=True)
class AxisState:
    """Where everything is at one instant."""

    #: motor, motor_speed, screw and screw_speed: Positions and speeds [rad], [rad/s]; of a rigid axis `motor` is the
    #: mass [m], [m/s] and the screw is nothing
    motor: float = 0.0
    motor_speed: float = 0.0
    screw: float = 0.0
    screw_speed: float = 0.0
    #: table_m and table_speed_m_per_s: Position and speed of the table; of a rigid axis they follow from the motor
    table_m: float = 0.0
    table_speed_m_per_s: float = 0.0
    bristle_m: float = 0.0  #: Deflection of the bristles of the guide [m]
    integral: float = 0.0  #: Integral of the speed error of the servo [motor position]

    def __post_init__(self) -> None:
        require_finite(self, *self.__dataclass_fields__)


def unloaded_state(axis: Axis, position_m: float, speed_m_per_s: float = 0.0) -> AxisState:
    """All masses in step at a position that the control sees, no spring under load, backlash in its middle.

    `position_m` [m] is the table's, or, as its `servo.feedback` says, the motor's × R; `speed_m_per_s` the table's
    [m/s].
    """
    travel = axis.mechanics.travel_per_motion
    motor = position_m / travel
    if axis.servo is None or axis.servo.feedback == "table":
        motor = _motor_for(axis, position_m)
    error, slope = (float(one) for one in pitch_error_m(axis, motor))
    motor_speed = speed_m_per_s / (travel + slope)
    if isinstance(axis.mechanics, RigidMechanics):
        return AxisState(motor, motor_speed, table_m=motor + error, table_speed_m_per_s=speed_m_per_s)
    table = travel * motor + error
    return AxisState(motor, motor_speed, motor, motor_speed, table, speed_m_per_s)


def _motor_for(axis: Axis, position_m: float) -> float:
    travel = axis.mechanics.travel_per_motion
    largest = _largest_error_m(axis, position_m)
    if largest == 0.0:
        return position_m / travel
    ends = ((position_m - largest) / travel, (position_m + largest) / travel)
    return float(
        optimize.brentq(
            lambda q: travel * q + float(pitch_error_m(axis, q)[0]) - position_m, *ends, xtol=1e-14, rtol=1e-15
        )
    )


def _largest_error_m(axis: Axis, position_m: float) -> float:
    """A bound of the pitch error near this position."""
    pitch = axis.transmission
    table = max((abs(error) for error in pitch.pitch_error_m), default=0.0)
    constant = pitch.pitch_amplitude_m + table
    return 2.0 * (constant + abs(pitch.pitch_slope) * (abs(position_m) + constant))
