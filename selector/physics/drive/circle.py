"""What the axes of a circular test are asked to do: a full circle at a feed, with a run-in and a run-out.

Two linear axes span the plane of the circle; angles count from the positive first axis towards the positive second.
With a rotary axis the ball of the workpiece stands on its table, away from its centre, and turns with it; the linear
axes follow that ball, so that the bar keeps its length while its direction goes through 360°:
workpiece ball = centre of the table + distance·(cos, sin)(ball angle + ratio·angle travelled by the bar),
spindle ball = workpiece ball + radius·(cos, sin)(angle of the bar).
The rotary axis is an axis with rad and kg·m² in the place of m and kg.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from selector.errors import InputError
from selector.physics.checks import require_finite, require_not_negative, require_positive
from selector.physics.drive.reference import Reference

Vector = NDArray[np.float64]

RAMP_S = 1.0
"""Longest time in which the feed is reached [s]."""

MOST_SAMPLES = 5_000_000
_MM_PER_MIN = 1e-3 / 60.0


@dataclass(frozen=True)
class TableBall:
    """The ball of the workpiece on a rotary table.

    Attributes
    ----------
    ball_distance_m : float
        From the centre of the table [m].
    ball_angle_rad : float
        Direction of the ball seen from the centre of the table at the start of the measured circle [rad]. A quarter
        turn from the bar (the default, with the circle's start at 0): lag of the table against the linear axes changes
        the radius; in line with the bar it does not.
    ratio : float
        Turn of the table per turn of the bar; 1: the bar stands still on the table.
    """

    ball_distance_m: float
    ball_angle_rad: float = -math.pi / 2
    ratio: float = 1.0

    def __post_init__(self) -> None:
        require_not_negative(self, "ball_distance_m")
        require_finite(self, "ball_angle_rad", "ratio")


@dataclass(frozen=True)
class Circle:
    """One run of a circular test: 360° that are measured, and an overshoot before and after them.

    The feed-in is along the circle: the axes start at rest on it, reach the feed as a raised cosine within half of the
    overshoot and at most `RAMP_S`, and stop in the same way, so that the measured arc has a steady feed.

    Attributes
    ----------
    feed_mm_per_min : float
        Speed of one ball about the other one, radius × angular speed [mm/min].
    direction : {1, -1}
        1: counter-clockwise, from the first axis to the second; −1: clockwise.
    radius_m : float
        Nominal length of the bar [m].
    centre_m : tuple of two floats
        Centre in the coordinates of the axes [m]; with a rotary axis the centre of its table.
    start_angle_rad : float
        Where the measured arc begins [rad].
    overshoot_rad : float
        Arc before and after the measured one [rad].
    table_ball : TableBall or None
        The third, rotary axis.
    """

    feed_mm_per_min: float
    direction: Literal[1, -1] = 1
    radius_m: float = 0.1
    centre_m: tuple[float, float] = (0.0, 0.0)
    start_angle_rad: float = 0.0
    overshoot_rad: float = math.pi / 4
    table_ball: TableBall | None = None

    def __post_init__(self) -> None:
        require_positive(self, "feed_mm_per_min", "radius_m", "overshoot_rad")
        require_finite(self, "start_angle_rad")
        if self.direction not in (1, -1):
            raise _wrong(f"direction {self.direction}", "1 (counter-clockwise) or -1 (clockwise)", "give 1 or -1")
        if len(self.centre_m) != 2 or not np.isfinite(self.centre_m).all():
            raise _wrong(f"centre {self.centre_m}", "two finite coordinates in m", "give the centre of the circle")

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

    Raises
    ------
    InputError
        If the names are not two (three with a rotary axis), or the run has too many samples.
    """
    names = tuple(axes)
    if len(set(names)) != len(names) or len(names) != (2 if circle.table_ball is None else 3):
        raise _wrong(
            f"{len(set(names))} axes ({', '.join(names)})",
            "two linear axes" if circle.table_ball is None else "two linear axes and a rotary one",
            "name the axes in the order first, second, rotary",
        )
    count = math.ceil(circle.duration_s / period_s - 1e-9) + 1 if period_s > 0 else 0
    if not 2 <= count <= MOST_SAMPLES:
        raise _wrong(
            f"{circle.duration_s:.6g} s sampled every {period_s:g} s",
            f"2 to {MOST_SAMPLES} samples",
            "choose another feed or period",
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


def measured_samples(circle: Circle, time_s: Vector) -> NDArray[np.bool_]:
    """Which times belong to the measured 360°; shape of `time_s` [s]."""
    angle = circle.direction * circle.travelled_rad(time_s)[0]
    inside = (angle >= -1e-12) & (angle < 2.0 * math.pi - 1e-12)
    return np.asarray(inside, dtype=np.bool_)


def _arm(length: float, angle: Vector, speed: Vector, change: Vector) -> tuple[tuple[Vector, ...], ...]:
    """Position, speed and acceleration of the two coordinates of the end of a turning arm."""
    cos, sin = length * np.cos(angle), length * np.sin(angle)
    return (
        (cos, -sin * speed, -sin * change - cos * speed**2),
        (sin, cos * speed, cos * change - sin * speed**2),
    )


def _ramped(time: Vector, ramp: float) -> Vector:
    return time / 2.0 - ramp / (2.0 * np.pi) * np.sin(np.pi * time / ramp)


def _share(time: Vector, ramp: float) -> Vector:
    return np.asarray((1.0 - np.cos(np.pi * time / ramp)) / 2.0)


def _wrong(found: str, expected: str, advice: str) -> InputError:
    return InputError(found, expected=expected, where="circular test", advice=advice)
