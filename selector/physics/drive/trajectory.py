"""What is an axis asked to do, how that comes about, and what it did: sines, moves within limits, recorded courses.

Stiffness and damping that it has on the way are those of F eq. 5, 6.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike
from scipy import interpolate, signal

from selector.errors import InputError, Misfit, refuse
from selector.findings import Finding
from selector.physics.channel_differences import EVEN, clock_jitter
from selector.physics.checks import keep_arrays
from selector.types import Array, Vector


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
        refuse(self._misfits(names))

    def _misfits(self, names: Iterable[str]) -> Iterator[Misfit]:
        count, where = len(np.atleast_1d(self.position_m)), "reference of the axis"
        for name in names:
            values = getattr(self, name)
            if values is not None and (values.shape != (count,) or count < 2 or not np.isfinite(values).all()):
                found = f"{name} of shape {values.shape}" + " with missing values" * (not np.isfinite(values).all())
                advice = "give position, speed and acceleration at the same times"
                yield found, f"{max(count, 2)} finite numbers", where, advice
        if not (np.isfinite(self.period_s) and self.period_s > 0):
            advice = "give the distance of the samples in seconds"
            yield f"a period of {self.period_s:g} s", "a number above 0", where, advice

    @property
    def time_s(self) -> Vector:
        """Times of the samples [s], shape (n_samples,)."""
        return np.asarray(np.arange(len(self.position_m)) * self.period_s, dtype=np.float64)


#: Parameters of the mechanics that may change along a motion.
COURSES = ("axial_stiffness_n_per_m", "guide_damping_ns_per_m")


@dataclass(frozen=True)
class ParameterCourse:
    """Parameters on the grid of the reference, straight between; they replace the constants of the mechanics.

    InputError if a stiffness is not above 0, a damping is negative, or a value is missing.
    """

    period_s: float  #: Distance of the samples [s], that of the reference
    #: (n_samples,): Ke [N/m]; None: the constant of the mechanics (a rigid axis has no other choice)
    axial_stiffness_n_per_m: Vector | None = None
    guide_damping_ns_per_m: Vector | None = None  #: (n_samples,): Ct [N·s/m]; None: the constant of the mechanics

    @property
    def varying(self) -> Vector | None:
        """(n_samples,): The stiffness if it varies, else the damping; None if neither is given."""
        values = self.axial_stiffness_n_per_m
        return self.guide_damping_ns_per_m if values is None or np.ptp(values) == 0 else values

    def __post_init__(self) -> None:
        keep_arrays(self, *COURSES)
        for name, least in zip(COURSES, ("above 0", "0 or more"), strict=True):
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


NOTHING_M = 1e-30  #: Moves below this take no time: their phases would leave the range of numbers.
WINDOW = 11  #: Samples of the local cubic from which derivatives of a recorded course are taken.


def sine(
    amplitude_m: float,
    frequency_hz: float,
    duration_s: float,
    period_s: float,
    *,
    phase_rad: float = 0.0,
    offset_m: float = 0.0,
) -> Reference:
    """The course offset + amplitude·sin(2πft + phase) with exact derivatives (F: 100 mm, 1 Hz).

    Without a phase it starts in the middle, at full speed: an axis at rest needs a moment to catch up.

    InputError: a frequency, duration or period that is not above 0.
    """
    _require(frequency_hz=frequency_hz, duration_s=duration_s, period_s=period_s)
    time_s = np.arange(math.floor(duration_s / period_s * (1.0 + 1e-12)) + 1) * period_s
    omega = 2.0 * math.pi * frequency_hz
    angle = omega * time_s + phase_rad
    wave = amplitude_m * np.sin(angle)
    return Reference(period_s, offset_m + wave, amplitude_m * omega * np.cos(angle), -(omega**2) * wave)


@dataclass(frozen=True)
class MovePhases:
    """Phases of the fastest move from rest to rest: jerk, acceleration, jerk, travel, and back in reverse."""

    #: jerk_s, acceleration_s and travel_s: Duration of each of the four jerk phases, of both phases of constant
    #: acceleration, of constant speed [s]
    jerk_s: float
    acceleration_s: float
    travel_s: float

    @property
    def duration_s(self) -> float:
        """Of the whole move [s]."""
        return 4.0 * self.jerk_s + 2.0 * self.acceleration_s + self.travel_s


def move_phases(
    distance_m: float, *, speed_m_per_s: float, acceleration_m_per_s2: float, jerk_m_per_s3: float = math.inf
) -> MovePhases:
    """The phases in which `distance_m` is covered in the shortest time within limits; an infinite jerk is a trapezoid.

    Lambrechts, Boerlage, Steinbuch (2005), Control Engineering Practice 13, 145–157: the shortest jerk phase that
    jerk, acceleration, speed or distance ask for, then the longest phase of acceleration, then the rest.

    InputError: a limit that is not above 0.
    """
    _require(speed_m_per_s=speed_m_per_s, acceleration_m_per_s2=acceleration_m_per_s2)
    if not jerk_m_per_s3 > 0:
        raise _unfit("jerk_m_per_s3", jerk_m_per_s3)
    distance = abs(distance_m)
    if not math.isfinite(distance):
        raise _unfit("distance_m", distance_m, "a finite number")
    if distance < NOTHING_M:
        return MovePhases(0.0, 0.0, 0.0)
    v, a, j = speed_m_per_s, acceleration_m_per_s2, jerk_m_per_s3
    if math.isinf(j):
        jerk_s, gained = 0.0, a
        acceleration_s = min(v / a, math.sqrt(distance / a))
    else:
        jerk_s = min(a / j, math.sqrt(v / j), math.cbrt(distance / (2.0 * j)))
        gained = j * jerk_s
        longest = math.sqrt(0.25 * jerk_s**2 + distance / gained) - 1.5 * jerk_s
        acceleration_s = max(0.0, min(v / gained - jerk_s, longest))
    rise_s = jerk_s + acceleration_s
    return MovePhases(jerk_s, acceleration_s, max(0.0, distance / (gained * rise_s) - rise_s - jerk_s))


def moves(
    targets_m: Sequence[float],
    period_s: float,
    *,
    speed_m_per_s: float,
    acceleration_m_per_s2: float,
    jerk_m_per_s3: float = math.inf,
    start_m: float = 0.0,
    dwell_s: float = 0.0,
    repeat: int = 1,
) -> Reference:
    """Moves from rest to rest, one after the other, each as fast as its limits allow; exact at every sample.

    The `targets_m` [m] are gone to in turn, `repeat` times, from `start_m` [m] on; moves may begin and end between the
    samples, every `period_s` [s], and each is followed by a rest of `dwell_s` [s]. An infinite jerk lets the
    acceleration jump.

    InputError: no target, a limit or period that is not above 0, or a dwell below 0.
    """
    _require(period_s=period_s)
    count = len(targets_m)
    if count == 0 or repeat < 1:
        raise _unfit("targets_m" if count == 0 else "repeat", count or repeat, "at least one")
    if not (math.isfinite(dwell_s) and dwell_s >= 0):
        raise _unfit("dwell_s", dwell_s, "0 or more")
    limits = {"acceleration_m_per_s2": acceleration_m_per_s2, "jerk_m_per_s3": jerk_m_per_s3}
    begin, here, begins_s = 0.0, start_m, []
    stretches = []
    for target in [*targets_m] * repeat:
        phases = move_phases(target - here, speed_m_per_s=speed_m_per_s, **limits)
        begins_s.append(begin)
        stretches.append((here, target, phases))
        begin, here = begin + phases.duration_s + dwell_s, target
    time_s = np.arange(math.ceil(begin / period_s * (1.0 - 1e-12)) + 1, dtype=np.float64) * period_s
    if len(time_s) < 2:
        raise _unfit("targets_m", 0, "a target away from the start, or a dwell")
    course = np.empty((3, len(time_s)))
    edges = np.append(np.searchsorted(time_s, begins_s), len(time_s))
    for (origin, target, phases), first, last, since in zip(stretches, edges[:-1], edges[1:], begins_s, strict=True):
        course[:, first:last] = _move(origin, target, phases, time_s[first:last] - since)
    # the last sample is at the end but for rounding, which must not leave it before
    course[:, -1] = here, 0.0, 0.0
    return Reference(period_s, *course)


def recorded(time_s: ArrayLike, position_m: ArrayLike, period_s: float | None = None) -> Reference:
    """A recorded course, on an even grid.

    Positions stay as they are where the clock is even; where it jitters, or another period is asked for, they are
    taken from the cubic spline through the samples. Derivatives are those of a cubic fitted to 11 samples around each
    (Savitzky–Golay; edges: of the first and last 11), which keeps the rounding of the positions out of them.
    `clock_findings` says how uneven the clock is.

    InputError: fewer than 11 samples, missing values, times that do not increase, or a gap: a step above 1.5 periods.
    """
    time, position = _checked(time_s, position_m)
    # the mean, not the median: times that were rounded have few different steps, none of them the period
    own_s = float((time[-1] - time[0]) / (len(time) - 1))
    step_s = own_s if period_s is None else period_s
    _require(period_s=step_s)
    if _stray(time) > EVEN or abs(step_s / own_s - 1.0) * len(time) > EVEN:
        grid = time[0] + np.arange(math.floor((time[-1] - time[0]) / step_s * (1.0 + 1e-12)) + 1) * step_s
        position = np.asarray(interpolate.CubicSpline(time, position)(np.minimum(grid, time[-1])))
    if len(position) < WINDOW:
        found = f"{len(position)} samples every {step_s:g} s in {time[-1] - time[0]:g} s"
        advice = "give a longer course, or a shorter period (run.period_s of a model file)"
        raise _no_course(found, f"at least {WINDOW} samples", advice)
    speed, acceleration = (
        np.asarray(signal.savgol_filter(position, WINDOW, 3, deriv=order, delta=step_s)) for order in (1, 2)
    )
    return Reference(step_s, position, speed, acceleration)


def clock_findings(time_s: ArrayLike) -> tuple[Finding, ...]:
    """What `recorded` did about a clock that is not even: nothing to say below a thousandth of the period."""
    time = np.array(time_s, dtype=np.float64)
    return clock_jitter(_stray(time), "positions were brought to an even grid by a cubic spline")


def _move(origin: float, target: float, phases: MovePhases, since_s: Vector) -> Array:
    """Position, speed, acceleration at times from the beginning of a move, (3, n); at rest after it."""
    distance = target - origin
    course = np.zeros((3, len(since_s)))
    course[0] = target
    total_s, rise_s = phases.duration_s, phases.jerk_s + phases.acceleration_s
    if total_s == 0.0:
        return course
    late = since_s > 0.5 * total_s
    # the second half is the first one backwards: symmetric and on target without any sum of seven phases
    t = np.maximum(np.where(late, total_s - since_s, since_s), 0.0)
    top_speed = distance / (rise_s + phases.jerk_s + phases.travel_s)
    top = top_speed / rise_s
    jerk = top / phases.jerk_s if phases.jerk_s > 0 else 0.0
    full_s = rise_s + phases.jerk_s
    u, w = t - phases.jerk_s, full_s - t
    first, second, third = t < phases.jerk_s, t < rise_s, t < full_s
    ramp = jerk * phases.jerk_s
    pick = [first, second, third]
    gone = np.select(
        pick,
        [
            jerk * t**3 / 6.0,
            ramp * (phases.jerk_s**2 / 6.0 + 0.5 * phases.jerk_s * u) + 0.5 * top * u**2,
            top_speed * (0.5 * full_s - w) + jerk * w**3 / 6.0,
        ],
        top_speed * (t - 0.5 * full_s),
    )
    speed = np.select(
        pick, [0.5 * jerk * t**2, 0.5 * ramp * phases.jerk_s + top * u, top_speed - 0.5 * jerk * w**2], top_speed
    )
    acceleration = np.select(pick, [jerk * t, np.full_like(t, top), jerk * w], 0.0)
    moving = since_s < total_s * (1.0 - 1e-12)
    course[0] = np.where(moving, np.where(late, target - gone, origin + gone), target)
    course[1] = np.where(moving, speed, 0.0)
    course[2] = np.where(moving, np.where(late, -acceleration, acceleration), 0.0)
    return course


def _stray(time: Vector) -> float:
    """Largest distance of the times from an even grid between their ends, as a share of the median step."""
    even = np.linspace(time[0], time[-1], len(time))
    return float(np.abs(time - even).max() / np.median(np.diff(time)))


def _checked(time_s: ArrayLike, position_m: ArrayLike) -> tuple[Vector, Vector]:
    time, position = np.array(time_s, dtype=np.float64), np.array(position_m, dtype=np.float64)
    if time.ndim != 1 or time.shape != position.shape or len(time) < WINDOW:
        found = f"{time.shape} times and {position.shape} positions"
        expected = f"at least {WINDOW} of both, as many of one as of the other"
        raise _no_course(found, expected, "give a longer course")
    known = np.isfinite(time) & np.isfinite(position)
    if not known.all():
        lost = f"{np.count_nonzero(~known)} missing values, the first in row {int(np.argmin(known)) + 1}"
        raise _no_course(lost, "finite numbers", "leave the rows without a value out, or interpolate them before")
    steps = np.diff(time)
    if (steps <= 0).any():
        at = int(np.argmin(steps > 0))
        found = f"the time {time[at + 1]:g} s after {time[at]:g} s"
        raise _no_course(found, "times that increase", "sort the rows and keep one a time")
    gaps = np.flatnonzero(steps > 1.5 * np.median(steps))
    if len(gaps):
        found = f"{len(gaps)} gaps, the first of {steps[gaps[0]]:g} s at {time[gaps[0]]:g} s"
        advice = "use a stretch without gaps, or fill them before"
        raise _no_course(found, f"steps near {np.median(steps):g} s", advice)
    return time, position


def _no_course(found: str, expected: str, advice: str) -> InputError:
    return InputError(found, expected=expected, where="recorded course", advice=advice)


def _require(**values: float) -> None:
    for name, value in values.items():
        if not (math.isfinite(value) and value > 0):
            raise _unfit(name, value)


def _unfit(name: str, found: float, expected: str = "a number above 0") -> InputError:
    return InputError(f"{found:g}", expected=expected, where=name, advice="correct this parameter of the trajectory")
