"""What an axis did: the courses of a simulated motion."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Motion:
    """Courses at the samples of the reference, each an ndarray of shape (n_samples,), read-only.

    Attributes
    ----------
    time_s, reference_m : ndarray
        Times [s] and commanded positions [m].
    table_m, table_speed_m_per_s : ndarray
        True position [m] and speed [m/s] of the table.
    motor, motor_speed : ndarray
        Position and speed of the motor, [rad] and [rad/s]; of a rigid axis [m] and [m/s].
    measured_m : ndarray
        Position that the control sees: of the scale or of the motor's encoder × R, quantised [m].
    command : ndarray
        Output of the control, limited, before its delay [actuator unit].
    actuator_force : ndarray
        Torque or force on the motor, after the delay, with ripple [N·m] or [N].
    axial_force_n : ndarray
        Force of the screw on the table [N]; of a rigid axis the actuator's force.
    friction_n : ndarray
        Dry friction of the guide, positive against the positive direction [N]; without viscous friction and offset.
    screw, screw_speed : ndarray or None
        Position [rad] and speed [rad/s] of the screw; of a rigid axis those of the motor. None: not known.
    bristle_m : ndarray or None
        Deflection of the bristles of the guide [m]. None: not known.
    """

    time_s: Vector
    reference_m: Vector
    table_m: Vector
    table_speed_m_per_s: Vector
    motor: Vector
    motor_speed: Vector
    measured_m: Vector
    command: Vector
    actuator_force: Vector
    axial_force_n: Vector
    friction_n: Vector
    screw: Vector | None = None
    screw_speed: Vector | None = None
    bristle_m: Vector | None = None

    def __post_init__(self) -> None:
        for field in fields(self):
            if getattr(self, field.name) is None:
                continue
            values = np.array(getattr(self, field.name), dtype=np.float64)
            values.setflags(write=False)
            object.__setattr__(self, field.name, values)

    @property
    def tracking_error_m(self) -> Vector:
        """Commanded minus true table position [m]."""
        return self.reference_m - self.table_m
