"""What an axis is asked to do, which stiffness and damping it has on the way (F eq. 5, 6), and what it did."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from selector.errors import InputError
from selector.physics.checks import keep_arrays
from selector.types import Vector


@dataclass(frozen=True)
class Motion:
    """Courses at the samples of the reference, each an ndarray of shape (n_samples,), read-only."""

    #: time_s and reference_m: Times [s] and commanded positions [m]
    time_s: Vector
    reference_m: Vector
    #: table_m and table_speed_m_per_s: True position [m] and speed [m/s] of the table
    table_m: Vector
    table_speed_m_per_s: Vector
    #: motor and motor_speed: Position and speed of the motor, [rad] and [rad/s]; of a rigid axis [m] and [m/s]
    motor: Vector
    motor_speed: Vector
    measured_m: Vector  #: Position that the control sees: of the scale or of the motor's encoder × R, quantised [m]
    command: Vector  #: Output of the control, limited, before its delay [actuator unit]
    actuator_force: Vector  #: Torque or force on the motor, after the delay, with ripple [N·m] or [N]
    axial_force_n: Vector  #: Force of the screw on the table [N]; of a rigid axis the actuator's force
    #: Dry friction of the guide, positive against the positive direction [N]; without viscous friction and offset
    friction_n: Vector
    #: screw and screw_speed: Position [rad] and speed [rad/s] of the screw; of a rigid axis those of the motor. None:
    #: not known.
    screw: Vector | None = None
    screw_speed: Vector | None = None
    bristle_m: Vector | None = None  #: Deflection of the bristles of the guide [m]. None: not known.

    def __post_init__(self) -> None:
        keep_arrays(self, *(field.name for field in fields(self)))

    @property
    def tracking_error_m(self) -> Vector:
        """Commanded minus true table position [m]."""
        return self.reference_m - self.table_m


@dataclass(frozen=True)
class Reference:
    """A course that an axis is to follow, on an even grid.

    InputError: fewer than two samples, different lengths, or a value that is not finite.
    """

    period_s: float  #: Distance of the samples [s]
    #: position_m, speed_m_per_s and acceleration_m_per_s2: (n_samples,): Commanded table position and its two
    #: derivatives
    position_m: Vector
    speed_m_per_s: Vector
    acceleration_m_per_s2: Vector
    force_n: Vector | None = None  #: (n_samples,): Force on the table from outside, held over a period [N]; None: none

    def __post_init__(self) -> None:
        names = ("position_m", "speed_m_per_s", "acceleration_m_per_s2", "force_n")
        keep_arrays(self, *names)
        count = len(np.atleast_1d(self.position_m))
        for name in names:
            values = getattr(self, name)
            if values is not None and (values.shape != (count,) or count < 2 or not np.isfinite(values).all()):
                raise InputError(
                    f"{name} of shape {values.shape}" + ("" if np.isfinite(values).all() else " with missing values"),
                    expected=f"{max(count, 2)} finite numbers",
                    where="reference of the axis",
                    advice="give position, speed and acceleration at the same times",
                )
        if not (np.isfinite(self.period_s) and self.period_s > 0):
            raise InputError(
                f"a period of {self.period_s:g} s",
                expected="a number above 0",
                where="reference of the axis",
                advice="give the distance of the samples in seconds",
            )

    @property
    def time_s(self) -> Vector:
        """Times of the samples [s], shape (n_samples,)."""
        return np.asarray(np.arange(len(self.position_m)) * self.period_s, dtype=np.float64)


@dataclass(frozen=True)
class ParameterCourse:
    """Parameters on the grid of the reference, straight between; they replace the constants of the mechanics.

    InputError if a stiffness is not above 0, a damping is negative, or a value is missing.
    """

    period_s: float  #: Distance of the samples [s], that of the reference
    #: (n_samples,): Ke [N/m]; None: the constant of the mechanics (a rigid axis has no other choice)
    axial_stiffness_n_per_m: Vector | None = None
    guide_damping_ns_per_m: Vector | None = None  #: (n_samples,): Ct [N·s/m]; None: the constant of the mechanics

    def __post_init__(self) -> None:
        keep_arrays(self, "axial_stiffness_n_per_m", "guide_damping_ns_per_m")
        for name, least in (("axial_stiffness_n_per_m", "above 0"), ("guide_damping_ns_per_m", "0 or more")):
            values = getattr(self, name)
            if values is None:
                continue
            fits = values.ndim == 1 and np.isfinite(values).all()
            if not fits or (values < 0).any() or (least == "above 0" and (values == 0).any()):
                raise InputError(
                    f"{name} from {np.min(values, initial=np.inf):g} to {np.max(values, initial=-np.inf):g}",
                    expected=f"one row of finite numbers {least}",
                    where="course of parameters",
                    advice="check the parts and the load that the course was made from",
                )
