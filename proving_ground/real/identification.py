"""Which parameters a recorded motion speaks of: by the inverse dynamic model."""

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike
from scipy import signal

from selector.errors import InputError
from selector.physics.checks import keep_arrays
from selector.types import Vector

#: Cut-off of the differentiating filter per bandwidth of the loop: what the loop does must pass unharmed.
CUT_OFF = 5.0
KEPT = 2.0  #: Frequencies kept for the fit per bandwidth of the loop; above them there is little but noise.
ORDER = 4
BORDER_S = 0.05  #: Left out at both ends, where a filter that runs both ways knows one side only [s].


@dataclass(frozen=True)
class IdentifiedAxis:
    """What the fit found."""

    names: tuple[str, ...]  #: Parameters: `mass_kg`, `guide_damping_ns_per_m`, `coulomb_n`, `offset_n`
    #: values and standard_errors: (n_parameters,): Estimates and their standard errors, for residuals that are
    #: independent of each other after decimation; where they are not, as with unmodelled friction, the true errors are
    #: larger
    values: Vector
    standard_errors: Vector
    relative_force_error: float  #: ‖force − modelled force‖ / ‖force‖ of the samples that were fitted
    condition: float  #: Condition number of the regressors, each scaled to length 1: how well they can be told apart
    #: cut_off_hz and decimation: Of the differentiating filter [Hz]; samples to one in the fit
    cut_off_hz: float
    decimation: int
    #: time_s, force_n and modelled_force_n: (n_fitted,): What was fitted [s, N]
    time_s: Vector
    force_n: Vector
    modelled_force_n: Vector

    def __post_init__(self) -> None:
        keep_arrays(self, "values", "standard_errors", "time_s", "force_n", "modelled_force_n")

    def __getitem__(self, name: str) -> float:
        """The estimate of a parameter."""
        return float(self.values[self.names.index(name)])


class PositionControl(Protocol):
    """A P control of position around one of speed, such as the servo of a drive model."""

    @property
    def position_gain_per_s(self) -> float:
        """Speed per error of position [1/s]."""

    @property
    def velocity_gain(self) -> float:
        """Output per error of speed [actuator unit per m/s]."""

    @property
    def actuator_gain(self) -> float:
        """Force per output [N]."""


def servo_bandwidth_hz(servo: PositionControl, mass_kg: float) -> float:
    """Natural frequency √(Kp·Kvp·Kf/M)/2π of a rigid axis under P position and P velocity control [Hz]."""
    return math.sqrt(servo.position_gain_per_s * servo.velocity_gain * servo.actuator_gain / mass_kg) / 2.0 / math.pi


def filtered_motion(period_s: float, position_m: ArrayLike, cut_off_hz: float) -> tuple[Vector, Vector, Vector]:
    """Position, speed, acceleration without delay: Butterworth of order 4 forwards and backwards, central differences.

    The central difference of a period h passes sin(ωh)/(ωh), 0.94 at a tenth of the sampling rate.

    InputError: a cut-off that is not below half the sampling rate, or a record too short for the filter.
    """
    position = np.array(position_m, dtype=np.float64)
    share = cut_off_hz * 2.0 * period_s
    if not 0.0 < share < 1.0:
        raise InputError(
            f"a cut-off of {cut_off_hz:g} Hz",
            expected=f"less than half the sampling rate, {0.5 / period_s:g} Hz",
            where="differentiation of the position",
            advice="record faster: at least ten times the bandwidth of the loop",
        )
    # transients of a Butterworth filter fade within a few periods of its cut-off
    needed = max(3 * (ORDER + 1), math.ceil(4.0 / share)) + 1
    if position.ndim != 1 or len(position) <= needed:
        raise InputError(
            f"positions of shape {position.shape}",
            expected=f"more than {needed} samples",
            where="differentiation of the position",
            advice="give a longer record",
        )
    numerator, denominator = signal.butter(ORDER, share)
    position = np.asarray(signal.filtfilt(numerator, denominator, position), dtype=np.float64)
    speed = np.gradient(position, period_s)
    return position, speed, np.gradient(speed, period_s)


def identified_rigid_axis(
    period_s: float, position_m: ArrayLike, force_n: ArrayLike, *, bandwidth_hz: float, delay_s: float = 0.0
) -> IdentifiedAxis:
    """Mass, viscous and dry friction, offset from recorded position and force.

    The position is filtered at 5·`bandwidth_hz` and differentiated; force and regressors are then decimated alike
    to frequencies below 2·`bandwidth_hz` (`scipy.signal.decimate`, no delay), so that the same filter stands on both
    sides of the equation.

    `position_m` and `force_n`, shape (n_samples,), are the measured position [m], and the force of the actuator, and
    known forces from outside, on the axis [N], every `period_s` [s]. `bandwidth_hz` is the highest frequency that the
    motion contains in earnest: that of the loop, see `servo_bandwidth_hz` [Hz].

    `delay_s` is how much later than recorded the force acts [s]: half a sample for a command that is held.

    InputError: different lengths, missing values, a record too short, or a motion that does not excite every parameter.
    """
    position, force = _checked(position_m, force_n)
    cut_off_hz = CUT_OFF * bandwidth_hz
    _, speed, acceleration = filtered_motion(period_s, position, cut_off_hz)
    columns = {
        "mass_kg": acceleration,
        "guide_damping_ns_per_m": speed,
        "coulomb_n": np.sign(speed),
        "offset_n": np.ones_like(speed),
    }
    time_s = np.arange(len(force), dtype=np.float64) * period_s
    if delay_s:
        force = np.interp(time_s - delay_s, time_s, force)
    decimation = max(1, round(0.8 * 0.5 / period_s / (KEPT * bandwidth_hz)))
    border = round(BORDER_S / period_s)
    inner = slice(border, len(force) - border)
    if len(force[inner]) // decimation < 10 * len(columns):
        raise InputError(
            f"{len(force)} samples, {max(0, len(force[inner]) // decimation)} after decimation",
            expected=f"at least {10 * len(columns)} after decimation by {decimation}",
            where="identification of the axis",
            advice="give a longer record",
        )
    X = np.column_stack([_decimated(column[inner], decimation) for column in columns.values()])
    y = _decimated(force[inner], decimation)
    scale = np.linalg.norm(X, axis=0)
    if (scale == 0.0).any():
        raise _unexcited([name for name, length in zip(columns, scale, strict=True) if length == 0.0])
    left, singular, right = np.linalg.svd(X / scale, full_matrices=False)
    if singular[-1] < 1e-6 * singular[0]:
        raise _unexcited([name for name, share in zip(columns, np.abs(right[-1]), strict=True) if share > 0.1])
    values = right.T @ (left.T @ y / singular) / scale
    modelled = X @ values
    spread = math.sqrt(float(np.sum((y - modelled) ** 2)) / (len(y) - len(values)))
    return IdentifiedAxis(
        names=tuple(columns),
        values=values,
        standard_errors=spread * np.linalg.norm(right.T / singular, axis=1) / scale,
        relative_force_error=float(np.linalg.norm(y - modelled) / np.linalg.norm(y)),
        condition=float(singular[0] / singular[-1]),
        cut_off_hz=cut_off_hz,
        decimation=decimation,
        time_s=time_s[inner][::decimation],
        force_n=y,
        modelled_force_n=modelled,
    )


def identified_axis_of_servo(
    period_s: float, position_m: ArrayLike, command: ArrayLike, servo: PositionControl, *, delay_s: float = 0.0
) -> IdentifiedAxis:
    """As `identified_rigid_axis`, from the control's output.

    The bandwidth is that of the servo with the mass found.

    `command`, shape (n_samples,), is the output of the control [actuator unit]; `servo.actuator_gain` makes it a force.

    InputError as `identified_rigid_axis`, or a mass that is not above 0.
    """
    force_n = servo.actuator_gain * np.array(command, dtype=np.float64)
    bandwidth_hz = servo.position_gain_per_s / 2.0 / math.pi
    for _ in range(10):
        found = identified_rigid_axis(period_s, position_m, force_n, bandwidth_hz=bandwidth_hz, delay_s=delay_s)
        if found["mass_kg"] <= 0.0:
            raise InputError(
                f"a mass of {found['mass_kg']:.3g} kg",
                expected="a force that accelerates the axis",
                where="identification of the axis",
                advice="turn the sign of the command or of the position",
            )
        before, bandwidth_hz = bandwidth_hz, servo_bandwidth_hz(servo, found["mass_kg"])
        if abs(bandwidth_hz / before - 1.0) < 1e-3:
            break
    return found


def _decimated(values: Vector, factor: int) -> Vector:
    return np.asarray(signal.decimate(values, factor) if factor > 1 else values, dtype=np.float64)


def _unexcited(names: list[str]) -> InputError:
    return InputError(
        f"a motion that leaves {', '.join(names)} open",
        expected="both directions, several speeds, and accelerations that stand out from the noise",
        where="identification of the axis",
        advice="record moves to and fro at two or more speeds",
    )


def _checked(position_m: ArrayLike, force_n: ArrayLike) -> tuple[Vector, Vector]:
    position, force = np.array(position_m, dtype=np.float64), np.array(force_n, dtype=np.float64)
    if position.ndim != 1 or position.shape != force.shape:
        found = f"positions of shape {position.shape} and forces of shape {force.shape}"
    elif not (np.isfinite(position).all() and np.isfinite(force).all()):
        found = "missing values"
    else:
        return position, force
    raise InputError(
        found,
        expected="as many positions as forces, all finite",
        where="identification of the axis",
        advice="use a stretch in which both were recorded",
    )
