"""What a ball-bar shows of moving axes: the distance of two balls against its nominal length, over a full circle."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from selector.errors import InputError
from selector.physics.checks import require_not_negative, require_positive, told_of
from selector.physics.drive.axis import Axis
from selector.physics.drive.circle import Circle, TableBall, circle_references, measured_samples
from selector.physics.drive.course import ParameterCourse
from selector.physics.drive.mechanics import RigidMechanics
from selector.physics.drive.motion import Motion
from selector.physics.drive.reference import Reference
from selector.physics.drive.step_choice import circle_step_s

Vector = NDArray[np.float64]
Pair = tuple[float, float]
CourseOf = Callable[[Reference], ParameterCourse | None]
"""Stiffness and damping that change along a reference; None: they do not."""

FEEDS_MM_PER_MIN = (100.0, 1000.0, 3000.0, 5000.0)
LONGEST_PERIOD_S = 0.01
"""A reversal takes some hundredths of a second, however slow the feed is."""

SAMPLES_PER_TURN = 7200
_UM = 1e6


@dataclass(frozen=True)
class PairGeometry:
    """Errors of two linear axes and of the set-up that do not depend on the motion; all zero: ideal.

    Attributes
    ----------
    squareness_um_per_m : float
        How far the second axis leans towards the first: the angle between them is 90° less this [µm/m].
    scale_um_per_m : tuple of two floats
        How much further than commanded each axis goes [µm/m].
    bow_um : tuple of two floats
        Straightness: how far an axis at ± radius has moved across, in the direction of the other one, against the
        middle; with the square of the distance [µm].
    centre_offset_um : tuple of two floats
        Where the ball of the workpiece sits against the commanded centre [µm].
    length_error_um : float
        How much longer than nominal the bar is where it reads 0 [µm].
    rotary_centre_offset_um : tuple of two floats
        Where the centre of the rotary table is against its commanded place [µm].
    """

    squareness_um_per_m: float = 0.0
    scale_um_per_m: Pair = (0.0, 0.0)
    bow_um: Pair = (0.0, 0.0)
    centre_offset_um: Pair = (0.0, 0.0)
    length_error_um: float = 0.0
    rotary_centre_offset_um: Pair = (0.0, 0.0)

    def __post_init__(self) -> None:
        for name, values in vars(self).items():
            if np.size(values) != (1 if name in ("squareness_um_per_m", "length_error_um") else 2) or not np.all(
                np.isfinite(values)
            ):
                raise InputError(
                    f"{values}",
                    expected="a finite number for each of the two axes" if np.size(values) != 1 else "a finite number",
                    where=name,
                    advice="correct this error of the geometry",
                )


@dataclass(frozen=True)
class BallBarPlan:
    """Which circles are run: both directions at every feed.

    Attributes
    ----------
    radius_m, centre_m, start_angle_rad, overshoot_rad, table_ball
        As in `Circle`.
    feeds_mm_per_min : tuple of float
        Feeds [mm/min].
    period_s : float or None
        Distance of the samples [s]; None: at least `SAMPLES_PER_TURN` a turn, every `LONGEST_PERIOD_S` or oftener.
    noise_um : float
        Standard deviation of a reading of the bar [µm].
    """

    radius_m: float = 0.1
    feeds_mm_per_min: tuple[float, ...] = FEEDS_MM_PER_MIN
    centre_m: Pair = (0.0, 0.0)
    start_angle_rad: float = 0.0
    overshoot_rad: float = math.pi / 4
    table_ball: TableBall | None = None
    period_s: float | None = None
    noise_um: float = 0.0

    def __post_init__(self) -> None:
        require_positive(self, "period_s")
        require_not_negative(self, "noise_um")
        if not self.feeds_mm_per_min:
            raise InputError(
                "no feed",
                expected="one or more in mm/min",
                where="feeds_mm_per_min",
                advice="name the feeds of the test",
            )

    @property
    def circles(self) -> tuple[Circle, ...]:
        """The runs: counter-clockwise and clockwise, feed after feed."""
        directions: tuple[Literal[1, -1], ...] = (1, -1)
        return tuple(
            Circle(
                feed,
                direction,
                self.radius_m,
                self.centre_m,
                self.start_angle_rad,
                self.overshoot_rad,
                self.table_ball,
            )
            for feed in self.feeds_mm_per_min
            for direction in directions
        )


@dataclass(frozen=True, eq=False)
class BallBarTrace:
    """One full circle as the bar shows it, simulated or measured.

    Attributes
    ----------
    angle_rad : ndarray of shape (n_samples,)
        Direction of the bar, from the ball of the workpiece to that of the spindle [rad], in the order of time.
    deviation_um : ndarray of shape (n_samples,)
        Distance of the balls minus nominal length [µm].
    direction : {1, -1}
        1: counter-clockwise, from the first axis to the second.
    feed_mm_per_min, radius_m : float
        Feed [mm/min] and nominal length of the bar [m].
    axes : tuple of str
        Names: first, second, and of a third, rotary one if there was one.
    table_ball : TableBall or None
        Where the ball of the workpiece stood on the rotary axis.
    start_angle_rad : float
        Direction of the bar where the ball of the workpiece stood at its `ball_angle_rad` [rad].

    Raises
    ------
    InputError
        Less than 350° or more than 361°, gaps over 5°, angles that run against the direction, missing values.
    """

    angle_rad: Vector
    deviation_um: Vector
    direction: Literal[1, -1]
    feed_mm_per_min: float
    radius_m: float = 0.1
    axes: tuple[str, ...] = ("X", "Y")
    table_ball: TableBall | None = None
    start_angle_rad: float = 0.0

    def __post_init__(self) -> None:
        require_positive(self, "feed_mm_per_min", "radius_m")
        angle, deviation = np.array(self.angle_rad, dtype=np.float64), np.array(self.deviation_um, dtype=np.float64)
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
        for name, values in (("angle_rad", angle), ("deviation_um", deviation)):
            values.setflags(write=False)
            object.__setattr__(self, name, values)


@dataclass(frozen=True, eq=False)
class BallBarRun:
    """One simulated circle, from rest to rest.

    Attributes
    ----------
    trace : BallBarTrace
        What the bar shows of it.
    references, motions : mappings of str to Reference and to Motion
        Axis → what it was asked, and what it did.
    courses : mapping of str to ParameterCourse or None
        Axis → stiffness and damping that it had; None: constant ones.
    steps_s : mapping of str to float
        Axis → longest step of its simulation [s].
    """

    trace: BallBarTrace
    references: Mapping[str, Reference]
    motions: Mapping[str, Motion]
    courses: Mapping[str, ParameterCourse | None]
    steps_s: Mapping[str, float]


def ball_bar_test(
    axes: Mapping[str, Axis],
    geometry: PairGeometry | None = None,
    plan: BallBarPlan | None = None,
    *,
    courses: Mapping[str, CourseOf] | None = None,
    step_s: float | None = None,
    seed: int = 0,
) -> tuple[BallBarTrace, ...]:
    """The traces of a whole test: counter-clockwise and clockwise at every feed, simulated.

    Parameters
    ----------
    axes : mapping of str to Axis
        First, second and, if the plan has a `table_ball`, the rotary axis, in this order.
    geometry, plan
        None: ideal; the defaults of `BallBarPlan`.
    courses : mapping of str to callable, optional
        Axis → stiffness and damping along its reference, where they change.
    step_s : float or None
        Longest step of the simulation [s]; None: `circle_step_s` of each axis.
    seed : int
        Of the noise of currents and bar.

    Raises
    ------
    InputError
        If axes, courses and plan do not fit together, or an axis cannot be simulated.
    """
    ideal, asked = geometry or PairGeometry(), plan or BallBarPlan()
    return tuple(
        ball_bar_run(axes, circle, ideal, asked, courses=courses, step_s=step_s, seed=seed, number=number).trace
        for number, circle in enumerate(asked.circles)
    )


def ball_bar_run(
    axes: Mapping[str, Axis],
    circle: Circle,
    geometry: PairGeometry,
    plan: BallBarPlan,
    *,
    courses: Mapping[str, CourseOf] | None = None,
    step_s: float | None = None,
    seed: int = 0,
    number: int = 0,
) -> BallBarRun:
    """One circle of `ball_bar_test`; `number` parts the noise of runs."""
    from selector.physics.drive.simulation import simulate_axis

    names = tuple(axes)
    if len(names) == 3 and not isinstance(axes[names[2]].mechanics, RigidMechanics):
        raise _misfit(
            f"{names[2]} as a screw drive",
            "a rigid axis with kg·m², rad and N·m for the rotary table",
            "describe the rotary axis with its moment of inertia as mass",
        )
    if not set(courses or {}) <= set(names):
        raise _misfit(
            f"courses of {', '.join(courses or {})}", f"of {', '.join(names)} at most", "give courses of these axes"
        )
    period = plan.period_s or _period_s(circle, [axis.servo.sample_s if axis.servo else 0.0 for axis in axes.values()])
    references = circle_references(circle, names, period_s=period)
    seeds = np.random.SeedSequence([seed, number]).generate_state(len(names) + 1)
    steps = {name: step_s or circle_step_s(axis, period) for name, axis in axes.items()}
    varying = {name: of(references[name]) for name, of in (courses or {}).items()}
    along = {name: varying.get(name) for name in names}
    motions = {}
    for name, own in zip(names, seeds, strict=False):
        with told_of(f"axis {name}"):
            motions[name] = simulate_axis(
                axes[name], references[name], step_s=steps[name], course=along[name], seed=int(own)
            )
    inside = measured_samples(circle, references[names[0]].time_s)
    angle, deviation = _bar(circle, geometry, [motions[name].table_m[inside] for name in names])
    if plan.noise_um > 0:
        deviation = deviation + np.random.default_rng(seeds[-1]).normal(0.0, plan.noise_um, len(deviation))
    trace = BallBarTrace(
        angle,
        deviation,
        circle.direction,
        circle.feed_mm_per_min,
        circle.radius_m,
        names,
        circle.table_ball,
        circle.start_angle_rad,
    )
    return BallBarRun(trace, references, motions, along, steps)


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
    travelled = np.maximum.accumulate((angle - angle[0]) * direction)
    begin = max((travelled[-1] - 2.0 * math.pi) / 2.0, 0.0)
    inside = (travelled >= begin) & (travelled < begin + 2.0 * math.pi)
    spent = time[inside][-1] - time[inside][0]
    turned = travelled[inside][-1] - travelled[inside][0]
    deviation = (np.hypot(across, along) - radius_m)[inside] * _UM
    feed = turned / spent * radius_m * 60e3
    return BallBarTrace(angle[inside], deviation, direction, float(feed), radius_m, axes)


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


def _misfit(found: str, expected: str, advice: str) -> InputError:
    return InputError(found, expected=expected, where="ball-bar test", advice=advice)
