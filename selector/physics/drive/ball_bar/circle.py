"""A circular test: what the axes are asked to do, what a ball-bar shows of it, and how round that is.

How round after ISO 230-4:2005 (G, G(b), F, D) and its first edition of 1996 (H). There the circular deviation is the
smallest radial separation of two concentric circles that envelop the path, and the range of radii about the
least-squares centre is admitted for it; here both are given, the smallest one exactly.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Literal

import numpy as np
from numpy.typing import ArrayLike

from selector.errors import InputError
from selector.physics.checks import Above0, Checked, Finite, From0, errors_name, keep_arrays
from selector.physics.drive.parts.axis import Axis
from selector.physics.drive.simulation import AxisRun, circle_step_s, simulate_axis
from selector.physics.drive.trajectory import ParameterCourse, Reference
from selector.physics.model_fields import Limits, Unit
from selector.types import Mask, Vector

RAMP_S = 1.0  #: Longest time in which the feed is reached [s].
MOST_SAMPLES = 5_000_000
_MM_PER_MIN = 1e-3 / 60.0


@dataclass(frozen=True)
class TableBall(Checked):
    """The ball of the workpiece on a rotary table."""

    ball_distance_m: From0  #: From the centre of the table [m]
    #: Direction of the ball seen from the centre of the table at the start of the measured circle [rad]. A quarter turn
    #: from the bar (the default, with the circle's start at 0): lag of the table against the linear axes changes the
    #: radius; in line with the bar it does not.
    ball_angle_rad: Finite = -math.pi / 2
    #: Turn of the table per turn of the bar; 1: the bar stands still on the table
    ratio: Finite = 1.0


@dataclass(frozen=True)
class Circle(Checked):
    """One run of a circular test: 360° that are measured, and an overshoot before and after them.

    The feed-in is along the circle: the axes start at rest on it, reach the feed as a raised cosine within half of the
    overshoot and at most `RAMP_S`, and stop in the same way, so that the measured arc has a steady feed.
    """

    feed_mm_per_min: Above0  #: Speed of one ball about the other one, radius × angular speed [mm/min]
    direction: Literal[1, -1] = 1  #: {1, -1}: 1: counter-clockwise, from the first axis to the second; −1: clockwise
    radius_m: Above0 = 0.1  #: Nominal length of the bar [m]
    #: Centre in the coordinates of the axes [m]; with a rotary axis the centre of its table
    centre_m: tuple[float, float] = (0.0, 0.0)
    start_angle_rad: Finite = 0.0  #: Where the measured arc begins [rad]
    overshoot_rad: Above0 = math.pi / 4  #: Arc before and after the measured one [rad]
    table_ball: TableBall | None = None  #: The third, rotary axis

    @property
    def speed_rad_per_s(self) -> float:
        """Steady angular speed of the bar [rad/s], not negative."""
        return self.feed_mm_per_min * _MM_PER_MIN / self.radius_m

    @property
    def ramp_s(self) -> float:
        """Time in which the feed is reached [s]."""
        return min(RAMP_S, self.overshoot_rad / self.speed_rad_per_s)

    @property
    def duration_s(self) -> float:
        """From rest to rest [s]."""
        return (2.0 * math.pi + 2.0 * self.overshoot_rad) / self.speed_rad_per_s + self.ramp_s

    def travelled_rad(self, time_s: Vector) -> tuple[Vector, Vector, Vector]:
        """Angle of the bar since the start of the measured arc, counter-clockwise positive, and its two derivatives."""
        pace, ramp, end = self.speed_rad_per_s, self.ramp_s, self.duration_s
        arc = pace * (end - ramp)
        rising = np.clip(time_s, 0.0, ramp)
        falling = np.clip(end - time_s, 0.0, ramp)
        steady = np.clip(time_s - ramp, 0.0, end - 2.0 * ramp)
        travelled = _ramped(rising, ramp) + steady + ramp / 2.0 - _ramped(falling, ramp)
        share = np.minimum(_share(rising, ramp), _share(falling, ramp))
        change = (np.sin(np.pi * rising / ramp) - np.sin(np.pi * falling / ramp)) * np.pi / (2.0 * ramp)
        angle = np.clip(pace * travelled, 0.0, arc) - self.overshoot_rad
        return self.direction * angle, self.direction * pace * share, self.direction * pace * change


def circle_references(circle: Circle, axes: Sequence[str] = ("X", "Y"), *, period_s: float) -> dict[str, Reference]:
    """Axis → what it is asked to do, from rest to rest, sampled every `period_s` [s].

    `axes` are first, second and, if the circle has a `table_ball`, the rotary one.

    InputError if the run has too many samples.
    """
    names = tuple(axes)
    count = math.ceil(circle.duration_s / period_s - 1e-9) + 1 if period_s > 0 else 0
    if not 2 <= count <= MOST_SAMPLES:
        raise InputError(
            f"{circle.duration_s:.6g} s sampled every {period_s:g} s",
            expected=f"2 to {MOST_SAMPLES} samples",
            where="circular test",
            advice="choose another feed or period",
        )
    angle, speed, change = circle.travelled_rad(np.arange(count, dtype=np.float64) * period_s)
    courses = _arm(circle.radius_m, circle.start_angle_rad + angle, speed, change)
    turned: tuple[Vector, Vector, Vector] | None = None
    if circle.table_ball is not None:
        ball = circle.table_ball
        turned = (ball.ratio * angle, ball.ratio * speed, ball.ratio * change)
        arm = _arm(ball.ball_distance_m, ball.ball_angle_rad + turned[0], turned[1], turned[2])
        courses = tuple(
            tuple(a + b for a, b in zip(one, two, strict=True)) for one, two in zip(courses, arm, strict=True)
        )
    made = {
        name: Reference(period_s, middle + course[0], course[1], course[2])
        for name, middle, course in zip(names[:2], circle.centre_m, courses, strict=True)
    }
    if turned is not None:
        made[names[2]] = Reference(period_s, *turned)
    return made


def measured_samples(circle: Circle, time_s: Vector) -> Mask:
    """Which times belong to the measured 360°; shape of `time_s` [s]."""
    angle = circle.direction * circle.travelled_rad(time_s)[0]
    inside = (angle >= -1e-12) & (angle < 2.0 * math.pi - 1e-12)
    return np.asarray(inside, dtype=np.bool_)


def _arm(length: float, angle: Vector, speed: Vector, change: Vector) -> tuple[tuple[Vector, ...], ...]:
    """Position, speed and acceleration of the two coordinates of the end of a turning arm."""
    cos, sin = length * np.cos(angle), length * np.sin(angle)
    return ((cos, -sin * speed, -sin * change - cos * speed**2), (sin, cos * speed, cos * change - sin * speed**2))


def _ramped(time: Vector, ramp: float) -> Vector:
    return time / 2.0 - ramp / (2.0 * np.pi) * np.sin(np.pi * time / ramp)


def _share(time: Vector, ramp: float) -> Vector:
    return np.asarray((1.0 - np.cos(np.pi * time / ramp)) / 2.0)


Pair = tuple[float, float]
_PerMetre = Annotated[float, Unit("µm/m"), Limits(0.0, 1e4)]
_Micrometres = Annotated[float, Unit("µm")]
_MicrometresOfBoth = Annotated[Pair, Unit("µm")]
#: Stiffness and damping that change along a reference; None: they do not.
CourseOf = Callable[[Reference], ParameterCourse | None]
LONGEST_PERIOD_S = 0.01  #: A reversal takes some hundredths of a second, however slow the feed is.
SAMPLES_PER_TURN = 7200
_UM = 1e6


@dataclass(frozen=True)
class PairGeometry:
    """Errors of two linear axes and of the set-up that do not depend on the motion; all zero: ideal."""

    #: How far the second axis leans towards the first: the angle between them is 90° less this [µm/m]
    squareness_um_per_m: _PerMetre = 0.0
    scale_um_per_m: tuple[_PerMetre, _PerMetre] = (0.0, 0.0)  #: How much further than commanded each axis goes [µm/m]
    #: Straightness: how far an axis at ± radius has moved across, in the direction of the other one, against the
    #: middle; with the square of the distance [µm]
    bow_um: _MicrometresOfBoth = (0.0, 0.0)
    #: Where the ball of the workpiece sits against the commanded centre [µm]
    centre_offset_um: _MicrometresOfBoth = (0.0, 0.0)
    length_error_um: _Micrometres = 0.0  #: How much longer than nominal the bar is where it reads 0 [µm]
    #: Where the centre of the rotary table is against its commanded place [µm]
    rotary_centre_offset_um: _MicrometresOfBoth = (0.0, 0.0)


@dataclass(frozen=True, eq=False)
class BallBarTrace(Checked):
    """One full circle as the bar shows it, simulated or measured.

    InputError: less than 350° or more than 361°, gaps over 5°, angles that run against the direction, missing values.
    """

    #: (n_samples,): Direction of the bar, from the ball of the workpiece to that of the spindle [rad], in the order of
    #: time
    angle_rad: Vector
    deviation_um: Vector  #: (n_samples,): Distance of the balls minus nominal length [µm]
    direction: Literal[1, -1]  #: {1, -1}: 1: counter-clockwise, from the first axis to the second
    #: feed_mm_per_min and radius_m: Feed [mm/min] and nominal length of the bar [m]
    feed_mm_per_min: Above0
    radius_m: Above0 = 0.1
    axes: tuple[str, ...] = ("X", "Y")  #: Names: first, second, and of a third, rotary one if there was one
    table_ball: TableBall | None = None  #: Where the ball of the workpiece stood on the rotary axis
    #: Direction of the bar where the ball of the workpiece stood at its `ball_angle_rad` [rad]
    start_angle_rad: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        keep_arrays(self, "angle_rad", "deviation_um")
        angle, deviation = self.angle_rad, self.deviation_um
        if angle.ndim != 1 or angle.shape != deviation.shape or len(angle) < 100:
            raise _unusable(f"{angle.shape} angles and {deviation.shape} deviations", "as many of both, 100 or more")
        if not (np.isfinite(angle).all() and np.isfinite(deviation).all()):
            raise _unusable("missing values", "finite numbers")
        if self.direction not in (1, -1) or len(self.axes) not in (2, 3):
            raise _unusable(f"direction {self.direction}, axes {self.axes}", "direction 1 or -1, two or three axes")
        steps = np.diff(np.unwrap(angle)) * self.direction
        covered = steps.sum() + np.median(steps)
        if not (math.radians(350) <= covered <= math.radians(361) and steps.max() <= math.radians(5)):
            raise _unusable(
                f"{math.degrees(covered):.0f}° {'counter-clockwise' if self.direction > 0 else 'clockwise'}, "
                f"longest gap {math.degrees(steps.max()):.1f}°",
                "a full circle in its direction without gaps over 5°",
            )


def ball_bar_run(
    axes: Mapping[str, Axis],
    circle: Circle,
    geometry: PairGeometry,
    *,
    period_s: float | None = None,
    noise_um: float = 0.0,
    courses: Mapping[str, CourseOf] | None = None,
    step_s: float | None = None,
    seed: int = 0,
    number: int = 0,
) -> tuple[BallBarTrace, dict[str, AxisRun]]:
    """What the bar shows of one circle of a test, and what every axis did from rest to rest, simulated.

    `axes` are first, second and, if the circle has a `table_ball`, the rotary one, in this order; `courses` their
    stiffness and damping along the reference, where they change. `period_s` is the distance of the samples [s], by
    default `SAMPLES_PER_TURN` a turn, every `LONGEST_PERIOD_S` or oftener; `noise_um` the standard deviation of a
    reading of the bar [µm]. `step_s` is the longest step [s], by default `circle_step_s` of each axis; `number` parts
    the noise of the runs of a test.

    InputError if an axis cannot be simulated.
    """
    names = tuple(axes)
    period = period_s or _period_s(circle, [axis.servo.sample_s if axis.servo else 0.0 for axis in axes.values()])
    references = circle_references(circle, names, period_s=period)
    seeds = np.random.SeedSequence([seed, number]).generate_state(len(names) + 1)
    inside = np.flatnonzero(measured_samples(circle, references[names[0]].time_s))
    arc = (int(inside[0]), int(inside[-1]) + 1)
    varying = {name: of(references[name]) for name, of in (courses or {}).items()}
    runs = {}
    for name, own in zip(names, seeds, strict=False):
        axis, reference, course = axes[name], references[name], varying.get(name)
        longest_s = step_s or circle_step_s(axis, period)
        with errors_name(f"axis {name}"):
            motion = simulate_axis(axis, reference, step_s=longest_s, course=course, seed=int(own))
        runs[name] = AxisRun(axis, reference, motion, course, longest_s, arc)
    angle, deviation = _bar(circle, geometry, [run.motion.table_m[inside] for run in runs.values()])
    if noise_um > 0:
        deviation = deviation + np.random.default_rng(seeds[-1]).normal(0.0, noise_um, len(deviation))
    asked = (circle.direction, circle.feed_mm_per_min, circle.radius_m)
    return BallBarTrace(angle, deviation, *asked, names, circle.table_ball, circle.start_angle_rad), runs


def positions_trace(
    time_s: ArrayLike,
    first_m: ArrayLike,
    second_m: ArrayLike,
    *,
    radius_m: float,
    centre_m: Pair = (0.0, 0.0),
    axes: tuple[str, str] = ("X", "Y"),
) -> BallBarTrace:
    """A circle that was recorded as two positions over time, of scales or of a grid encoder [m].

    Direction and feed are those of the recording; of more than 360° the middle ones are taken.
    """
    time, first, second = (np.array(values, dtype=np.float64) for values in (time_s, first_m, second_m))
    if not (time.ndim == 1 and time.shape == first.shape == second.shape and len(time) >= 100):
        raise _unusable(
            f"{time.shape} times, {first.shape} and {second.shape} positions", "as many of all, 100 or more"
        )
    if not np.isfinite(np.concatenate([time, first, second])).all() or (np.diff(time) <= 0).any():
        raise _unusable("missing values or times that do not increase", "finite numbers at increasing times")
    across, along = first - centre_m[0], second - centre_m[1]
    angle = np.unwrap(np.arctan2(along, across))
    direction: Literal[1, -1] = 1 if angle[-1] > angle[0] else -1
    inside = middle_turn(angle, direction)
    spent = time[inside][-1] - time[inside][0]
    turned = abs(angle[inside][-1] - angle[inside][0])
    deviation = (np.hypot(across, along) - radius_m)[inside] * _UM
    feed = turned / spent * radius_m * 60e3
    return BallBarTrace(angle[inside], deviation, direction, float(feed), radius_m, axes)


def middle_turn(angle_rad: Vector, direction: Literal[1, -1]) -> Mask:
    """Which samples belong to the middle 360° of an angle that may go further [rad], unwrapped, in order of time."""
    travelled = np.maximum.accumulate((angle_rad - angle_rad[0]) * direction)
    begin = max((travelled[-1] - 2.0 * math.pi) / 2.0, 0.0)
    return np.asarray((travelled >= begin) & (travelled < begin + 2.0 * math.pi), dtype=np.bool_)


def _bar(circle: Circle, geometry: PairGeometry, tables_m: Sequence[Vector]) -> tuple[Vector, Vector]:
    """Direction of the bar [rad] and deviation of its length [µm], from the positions of the axes."""
    middle = (circle.centre_m[0], circle.centre_m[1])
    reach = circle.radius_m + (circle.table_ball.ball_distance_m if circle.table_ball is not None else 0.0)
    first, second = tables_m[0] - middle[0], tables_m[1] - middle[1]
    lean = geometry.squareness_um_per_m / _UM
    spindle = (
        first * (1.0 + geometry.scale_um_per_m[0] / _UM)
        + second * lean
        + geometry.bow_um[1] / _UM * (second / reach) ** 2,
        second * (1.0 + geometry.scale_um_per_m[1] / _UM) + geometry.bow_um[0] / _UM * (first / reach) ** 2,
    )
    ball = [np.full(len(first), offset / _UM) for offset in geometry.centre_offset_um]
    if circle.table_ball is not None:
        turned = circle.table_ball.ball_angle_rad + tables_m[2]
        arm = circle.table_ball.ball_distance_m
        # what the set-up is off is off on the table, and turns with it
        offset = geometry.centre_offset_um[0] / _UM + 1j * geometry.centre_offset_um[1] / _UM
        place = arm * np.exp(1j * turned) + offset * np.exp(1j * tables_m[2])
        ball = [
            place.real + geometry.rotary_centre_offset_um[0] / _UM,
            place.imag + geometry.rotary_centre_offset_um[1] / _UM,
        ]
    across, along = spindle[0] - ball[0], spindle[1] - ball[1]
    length = circle.radius_m + geometry.length_error_um / _UM
    return np.arctan2(along, across), (np.hypot(across, along) - length) * _UM


def _period_s(circle: Circle, sample_s: Sequence[float]) -> float:
    """Distance of the samples [s]: a whole number of samples of the slowest control."""
    wanted = min(2.0 * math.pi / circle.speed_rad_per_s / SAMPLES_PER_TURN, LONGEST_PERIOD_S)
    slowest = max(sample_s)
    return max(1, int(wanted / slowest + 1e-9)) * slowest if slowest > 0 else wanted


def _unusable(found: str, expected: str) -> InputError:
    return InputError(
        found,
        expected=expected,
        where="ball-bar trace",
        advice="give the measured circle of one run, in its order of time",
    )


_ROUNDS = 50
_ENOUGH = 1e-13
_FEASIBLE_UM = 1e-9


@dataclass(frozen=True)
class Extreme:
    """A largest or smallest value [µm] and the angle at which it stands [rad]."""

    value_um: float
    angle_rad: float


@dataclass(frozen=True)
class Roundness:
    """One path, or two paths together."""

    circular_deviation_um: float  #: G, or G(b) of two paths: width of the narrowest annulus [µm]
    #: radial_max and radial_min: F_max, F_min: farthest from the nominal radius outwards and inwards, about the least-
    #: squares centre
    radial_max: Extreme
    radial_min: Extreme
    mean_radial_um: float  #: D if of two paths: radius of the least-squares circle minus nominal radius [µm]
    centre_um: tuple[float, float]  #: Centre of the least-squares circle [µm]


@dataclass(frozen=True)
class CircleQuantities:
    """Both directions at one feed: each by itself, both together, and the hysteresis H, about their common centre."""

    feed_mm_per_min: float
    counter_clockwise: Roundness
    clockwise: Roundness
    both: Roundness
    hysteresis: Extreme


def circle_quantities(traces: Sequence[BallBarTrace]) -> tuple[CircleQuantities, ...]:
    """The quantities of every feed, slowest first.

    InputError if a feed has not exactly one trace of each direction with the same radius and axes.
    """
    found = []
    for one, other in paired(traces):
        paths = roundness(one), roundness(other), roundness(one, other)
        found.append(CircleQuantities(one.feed_mm_per_min, *paths, hysteresis(one, other)))
    return tuple(found)


def paired(traces: Sequence[BallBarTrace]) -> tuple[tuple[BallBarTrace, BallBarTrace], ...]:
    """(counter-clockwise, clockwise) of every feed, slowest first; feeds within 1 % are the same."""
    pairs: list[list[BallBarTrace]] = []
    for trace in sorted(traces, key=lambda one: one.feed_mm_per_min):
        if pairs and trace.feed_mm_per_min <= 1.01 * pairs[-1][0].feed_mm_per_min:
            pairs[-1].append(trace)
        else:
            pairs.append([trace])
    for pair in pairs:
        of_one_kind = len({(one.radius_m, one.axes) for one in pair}) == 1
        if sorted(one.direction for one in pair) != [-1, 1] or not of_one_kind:
            raise InputError(
                ", ".join("counter-clockwise" if one.direction > 0 else "clockwise" for one in pair)
                + ("" if of_one_kind else " of different radii or axes"),
                expected="one trace counter-clockwise and one clockwise, of the same circle",
                where=f"circular test at {pair[0].feed_mm_per_min:g} mm/min",
                advice="give both directions of every feed once",
            )
    if not pairs:
        raise InputError("no traces", expected="two or more", where="circular test", advice="give the measured circles")
    ordered = [sorted(pair, key=lambda one: -one.direction) for pair in pairs]
    return tuple((pair[0], pair[1]) for pair in ordered)


def roundness(*traces: BallBarTrace) -> Roundness:
    """Roundness of one path, or of several taken together [µm]."""
    angle, deviation, radius_um = _together(traces)
    centre, mean = least_squares_circle(angle, deviation, radius_um)
    centred, direction = _about(centre, angle, deviation, radius_um)
    out, inside = (_extreme(centred, direction, sign) for sign in (1, -1))
    return Roundness(minimum_zone_um(angle, deviation, radius_um), out, inside, mean, centre)


def hysteresis(forward: BallBarTrace, back: BallBarTrace) -> Extreme:
    """H: largest radial difference of two paths at the same angle, about the least-squares centre of both [µm]."""
    angle, deviation, radius_um = _together((forward, back))
    centre, _ = least_squares_circle(angle, deviation, radius_um)
    courses = []
    for one in (forward, back):
        radial, direction = _about(centre, one.angle_rad, one.deviation_um, radius_um)
        order = np.argsort(direction, kind="stable")
        courses.append((direction[order], radial[order]))
    at = np.union1d(courses[0][0], courses[1][0])
    apart = np.abs(np.subtract(*(np.interp(at, *course, period=2.0 * np.pi) for course in courses)))
    return _extreme(apart, at, 1)


def centred_traces(traces: Sequence[BallBarTrace]) -> tuple[BallBarTrace, ...]:
    """Traces about the centre of the least-squares circle of all of them: the set-up taken out, for pictures."""
    angle, deviation, radius_um = _together(traces)
    centre, _ = least_squares_circle(angle, deviation, radius_um)
    moved = [_about(centre, one.angle_rad, one.deviation_um, radius_um) for one in traces]
    return tuple(
        replace(one, angle_rad=direction, deviation_um=radial)
        for one, (radial, direction) in zip(traces, moved, strict=True)
    )


def least_squares_circle(
    angle_rad: ArrayLike, deviation_um: ArrayLike, radius_um: float
) -> tuple[tuple[float, float], float]:
    """Centre [µm] and radius minus the nominal one [µm] of the circle with the least squared radial distances.

    Orthogonal distances (Gauss–Newton); samples count as evenly spread.
    """
    angle, deviation = np.asarray(angle_rad, dtype=np.float64), np.asarray(deviation_um, dtype=np.float64)
    centre = (0.0, 0.0)
    mean = 0.0
    for _ in range(_ROUNDS):
        radial, direction = _about(centre, angle, deviation, radius_um)
        columns = np.column_stack([np.cos(direction), np.sin(direction), np.ones(len(radial))])
        change = np.linalg.lstsq(columns, radial, rcond=None)[0]
        centre, mean = (centre[0] + float(change[0]), centre[1] + float(change[1])), float(change[2])
        if np.hypot(change[0], change[1]) <= _ENOUGH * radius_um:
            break
    return centre, mean


def minimum_zone_um(angle_rad: ArrayLike, deviation_um: ArrayLike, radius_um: float) -> float:
    """Radial separation of the minimum-zone circles of a path, the narrowest annulus around it [µm].

    Linear programmes about the last centre, each with the radii as they are there, until the centre stays. A linear
    programme takes in the samples that break its bounds, round after round.
    """
    from scipy.optimize import linprog

    angle, deviation = np.asarray(angle_rad, dtype=np.float64), np.asarray(deviation_um, dtype=np.float64)
    centre, _ = least_squares_circle(angle, deviation, radius_um)
    taken = np.zeros(len(angle), dtype=np.bool_)
    taken[:: max(1, len(angle) // 64)] = True
    for _ in range(_ROUNDS):
        radial, direction = _about(centre, angle, deviation, radius_um)
        u = np.column_stack([np.cos(direction), np.sin(direction)])
        taken[[np.argmax(radial), np.argmin(radial)]] = True
        while True:
            # outer − inner is least, with inner ≤ radial − u·shift ≤ outer
            none, one = np.zeros((int(taken.sum()), 1)), np.ones((int(taken.sum()), 1))
            solved = linprog(
                [0.0, 0.0, -1.0, 1.0],
                np.block([[-u[taken], none, -one], [u[taken], one, none]]),
                np.r_[-radial[taken], radial[taken]],
                bounds=(None, None),
                options={"primal_feasibility_tolerance": _FEASIBLE_UM, "dual_feasibility_tolerance": _FEASIBLE_UM},
            )
            shift, inner, outer = np.split(np.asarray(solved.x, dtype=np.float64), [2, 3])
            left = radial - u @ shift
            outside = np.where(taken, 0.0, np.maximum(left - outer, inner - left))
            if outside.max() <= _FEASIBLE_UM:
                break
            is_peak = (outside >= np.roll(outside, 1)) & (outside >= np.roll(outside, -1))
            taken |= (outside == outside.max()) | ((outside > _FEASIBLE_UM) & is_peak)
        centre = (centre[0] + float(shift[0]), centre[1] + float(shift[1]))
        if np.hypot(shift[0], shift[1]) <= _ENOUGH * radius_um:
            break
    radial, _ = _about(centre, angle, deviation, radius_um)
    return float(radial.max()) - float(radial.min())


def _together(traces: Sequence[BallBarTrace]) -> tuple[Vector, Vector, float]:
    """Angles [rad], deviations [µm] and nominal radius [µm]."""
    angle = np.concatenate([one.angle_rad for one in traces])
    deviation = np.concatenate([one.deviation_um for one in traces])
    return angle, deviation, traces[0].radius_m * _UM


def _about(centre_um: tuple[float, float], angle: Vector, deviation: Vector, radius_um: float) -> tuple[Vector, Vector]:
    """Distances from a centre minus the nominal radius [µm], without the digits of the radius lost, and directions."""
    cos, sin = np.cos(angle), np.sin(angle)
    shift = (
        centre_um[0] ** 2
        + centre_um[1] ** 2
        - 2.0 * (radius_um + deviation) * (centre_um[0] * cos + centre_um[1] * sin)
    )
    outside = radius_um + deviation
    # √(r² + shift) − r, with r not subtracted from its like
    radial = deviation + shift / (np.sqrt(outside**2 + shift) + outside)
    direction = np.arctan2(outside * sin - centre_um[1], outside * cos - centre_um[0])
    return radial, np.asarray(direction)


def _extreme(values: Vector, angle: Vector, sign: int) -> Extreme:
    at = int(np.argmax(sign * values))
    return Extreme(float(values[at]), float(angle[at] % (2.0 * np.pi)))
