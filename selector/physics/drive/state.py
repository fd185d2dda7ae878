"""What an axis begins from: positions and speeds of its masses."""

from __future__ import annotations

from dataclasses import dataclass

from scipy import optimize

from selector.physics.checks import require_finite
from selector.physics.drive.axis import Axis
from selector.physics.drive.mechanics import RigidMechanics
from selector.physics.drive.pitch import pitch_error_m


@dataclass(frozen=True)
class AxisState:
    """Where everything is at one instant.

    Attributes
    ----------
    motor, motor_speed, screw, screw_speed : float
        Positions and speeds [rad], [rad/s]; of a rigid axis `motor` is the mass [m], [m/s] and the screw is nothing.
    table_m, table_speed_m_per_s : float
        Position and speed of the table; of a rigid axis they follow from the motor.
    bristle_m : float
        Deflection of the bristles of the guide [m].
    integral : float
        Integral of the speed error of the servo [motor position].
    """

    motor: float = 0.0
    motor_speed: float = 0.0
    screw: float = 0.0
    screw_speed: float = 0.0
    table_m: float = 0.0
    table_speed_m_per_s: float = 0.0
    bristle_m: float = 0.0
    integral: float = 0.0

    def __post_init__(self) -> None:
        require_finite(self, *self.__dataclass_fields__)


def unloaded_state(axis: Axis, position_m: float, speed_m_per_s: float = 0.0) -> AxisState:
    """All masses in step at a position that the control sees, no spring under load, backlash in its middle.

    Parameters
    ----------
    axis
        Its `servo.feedback` says what `position_m` is: the table's (also without a servo), or the motor's × R.
    position_m, speed_m_per_s
        Position [m] and speed of the table [m/s].
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
