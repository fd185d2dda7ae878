"""The control of an axis and what it sees: cascade, limits, sampling, delay, feed-forward; encoders, noise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from selector.errors import InputError
from selector.physics.checks import require_not_negative, require_positive


@dataclass(frozen=True)
class Servo:
    """Cascade control: position P, velocity PI on the motor's speed, limits, sampling, delay, feed-forward.

    ``speed* = Kp·(r − y)/R + ff_v·r'/R``; ``u = Kvp·e + Kvi·∫e dt + ff_a·I·r''/(R·Kf)`` with
    e = speed* − motor speed and I the inertia of the whole axis at the motor; torque or force = Kf·u.
    F writes K_pp = Kp/R. Sampled: ∫e dt is the sum of sample_s·e over the samples before this one. The integral stands
    while u is limited; if a continuous one would leave the limit by standing and come back by moving on, it follows the
    limit, as a sampled one does by turns.

    Attributes
    ----------
    position_gain_per_s : float
        Kp, the "Kv factor" of the workshop [1/s].
    velocity_gain, velocity_integral_gain : float
        Kvp [actuator unit per motor speed], Kvi [the same per s]: A·s/rad, A/rad; or V·s/m, V/m.
    actuator_gain : float
        Kf [N·m or N per actuator unit].
    command_limit, speed_limit : float or None
        Largest |u| [actuator unit] and largest |speed*| [motor speed].
    sample_s : float
        Period of both loops [s], u is held between; 0: continuous.
    delay_s : float
        From the computed command to the actuator [s].
    velocity_feedforward, acceleration_feedforward : float
        Shares ff_v, ff_a, 1 = complete.
    feedback : {"table", "motor"}
        Where the position is measured: scale on the table, or encoder of the motor × R.
    """

    position_gain_per_s: float
    velocity_gain: float
    velocity_integral_gain: float = 0.0
    actuator_gain: float = 1.0
    command_limit: float | None = None
    speed_limit: float | None = None
    sample_s: float = 0.0
    delay_s: float = 0.0
    velocity_feedforward: float = 0.0
    acceleration_feedforward: float = 0.0
    feedback: Literal["table", "motor"] = "table"

    def __post_init__(self) -> None:
        require_positive(self, "position_gain_per_s", "velocity_gain", "actuator_gain", "command_limit", "speed_limit")
        require_not_negative(
            self, "velocity_integral_gain", "sample_s", "delay_s", "velocity_feedforward", "acceleration_feedforward"
        )


@dataclass(frozen=True)
class Sensing:
    """What the control sees of position and current; zero: exactly.

    Attributes
    ----------
    motor_resolution : float
        Step of the motor's encoder [rad], or [m] for a rigid axis.
    scale_resolution_m : float
        Step of the linear scale [m].
    speed_from_encoder : bool
        Speed as the difference of two encoder readings, as controls have it; else the true speed.
    speed_samples : int
        Samples between these two readings; over more than one the speed is smoother and later, by half of them.
    current_noise : float
        Standard deviation of noise on the command, drawn at every sample [actuator unit].
    """

    motor_resolution: float = 0.0
    scale_resolution_m: float = 0.0
    speed_from_encoder: bool = False
    speed_samples: int = 1
    current_noise: float = 0.0

    def __post_init__(self) -> None:
        require_not_negative(self, "motor_resolution", "scale_resolution_m", "current_noise")
        if self.speed_samples < 1 or (self.speed_samples > 1 and not self.speed_from_encoder):
            raise InputError(
                f"{self.speed_samples}" + ("" if self.speed_samples < 1 else " without a speed from the encoder"),
                expected="1, or more with speed_from_encoder",
                where="speed_samples",
                advice="set speed_from_encoder, or leave speed_samples out",
            )
