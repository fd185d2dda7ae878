"""What does the model file ask its axes to do: references on an even grid, and circles of a ball-bar test."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import pairwise

import numpy as np

from selector.errors import ModelFileError
from selector.physics.checks import require_within, told_of
from selector.physics.drive.ball_bar.circle import BallBarPlan, TableBall
from selector.physics.drive.file.model_schema import (
    MOST_ACTING,
    MOST_POSITION_M,
    MOST_STEPS,
    CircleMotion,
    ColumnMotion,
    DriveFile,
    Force,
    MovesMotion,
    SineMotion,
)
from selector.physics.drive.motion import Reference
from selector.physics.drive.trajectory import move_phases, moves, recorded, sine
from selector.physics.model_text import MOST_SAMPLES, Column, Key
from selector.types import Vector

Columns = Mapping[str, tuple[Vector, Vector]]
"""Key of `model_file.columns_needed` → (time_s, values in the unit of its role)."""

PERIOD_S = 0.001
"""Distance of the samples where the file says nothing, but for circles, which follow their feed."""

MOST_MOVES = 20_000
FEWEST_PERIODS = 4
"""Of the samples in a motion: with fewer there is no error to tell of."""

_MM = 1e-3
_MM_PER_MIN = 1e-3 / 60.0


def moved_axes(file: DriveFile) -> tuple[str, ...]:
    """Names of the axes that the motion moves; others that the file may describe are not simulated."""
    motion = file.motion
    return motion.axes if isinstance(motion, CircleMotion) else (motion.axis or next(iter(file.axes)),)


def file_reference(file: DriveFile, columns: Columns) -> Reference:
    """What the one axis of a sine, of moves or of a column is asked to do.

    Raises InputError: the column is no course, or the moves have no length. Raises ModelFileError: the course of the
    column has more than `MOST_SAMPLES` samples.
    """
    motion = file.motion
    if isinstance(motion, CircleMotion):
        raise ValueError("a circle has references of its own, see ball_bar")
    if isinstance(motion, ColumnMotion):
        time_s, position_m = _column(columns, "motion", motion, MOST_POSITION_M, "m")
        count = (time_s[-1] - time_s[0]) / (file.run.period_s or PERIOD_S) if len(time_s) else 0.0
        if count > MOST_SAMPLES:
            raise ModelFileError(
                f"{count:.3g} samples",
                expected=f"at most {MOST_SAMPLES}",
                where="key run.period_s",
                advice="make it larger, or the recording of the column shorter",
            )
        with told_of(_place("motion", motion)):
            found = recorded(time_s - time_s[0] if len(time_s) else time_s, position_m, file.run.period_s)
    else:
        found = planned_reference(file)
    force = _force(motion.force_n, found.time_s, columns)
    return found if force is None else replace(found, force_n=force)


def planned_reference(file: DriveFile) -> Reference:
    """What a sine or moves ask for, without forces.

    InputError: the moves have no length.
    """
    motion, period_s = file.motion, file.run.period_s or PERIOD_S
    if isinstance(motion, SineMotion):
        return sine(
            motion.amplitude_mm * _MM,
            motion.frequency_hz,
            motion.duration_s,
            period_s,
            phase_rad=math.radians(motion.phase_deg),
            offset_m=motion.centre_mm * _MM,
        )
    if isinstance(motion, MovesMotion):
        return moves(
            [target * _MM for target in motion.targets_mm],
            period_s,
            speed_m_per_s=motion.feed_mm_per_min * _MM_PER_MIN,
            acceleration_m_per_s2=motion.acceleration_m_per_s2,
            jerk_m_per_s3=math.inf if motion.jerk_m_per_s3 is None else motion.jerk_m_per_s3,
            start_m=motion.start_mm * _MM,
            dwell_s=motion.dwell_s,
            repeat=motion.repeat,
        )
    raise ValueError("only a sine and moves are planned")


def circle_plan(file: DriveFile) -> BallBarPlan:
    """The circles of a ball-bar test.

    InputError: a value cannot be; `where` is its field.
    """
    motion = file.motion
    if not isinstance(motion, CircleMotion):
        raise ValueError("only circles make a ball-bar test")
    ball = motion.table_ball
    return BallBarPlan(
        radius_m=motion.radius_mm * _MM,
        feeds_mm_per_min=motion.feeds_mm_per_min,
        centre_m=(motion.centre_mm[0] * _MM, motion.centre_mm[1] * _MM),
        start_angle_rad=math.radians(motion.start_angle_deg),
        overshoot_rad=math.radians(motion.overshoot_deg),
        table_ball=None
        if ball is None
        else TableBall(ball.distance_mm * _MM, math.radians(ball.angle_deg), ball.ratio),
        period_s=file.run.period_s,
        noise_um=float(getattr(file.ball_bar, "noise_um", 0.0)),
    )


def longest_s(file: DriveFile) -> float:
    """Duration of the longest run of one axis [s]; of a column 0, which is not known before it is read."""
    motion = file.motion
    if isinstance(motion, CircleMotion):
        return max(circle.duration_s for circle in circle_plan(file).circles)
    if isinstance(motion, SineMotion):
        return motion.duration_s
    return _moves_s(motion) if isinstance(motion, MovesMotion) else 0.0


def motion_counts(file: DriveFile) -> Iterator[tuple[Key, str, float, int]]:
    """(key, what is counted, how many there are, how many there may be) of whatever makes a run long."""
    motion, duration_s = file.motion, longest_s(file)
    if isinstance(motion, MovesMotion):
        yield ("motion", "repeat"), "moves", motion.repeat * len(motion.targets_mm), MOST_MOVES
    if file.run.period_s is not None or not isinstance(motion, CircleMotion):
        yield ("run", "period_s"), "samples", duration_s / (file.run.period_s or PERIOD_S), MOST_SAMPLES
    if file.run.step_s is not None:
        yield ("run", "step_s"), "steps", duration_s / file.run.step_s, MOST_STEPS


def slow_feed_words(file: DriveFile) -> str:
    """How the feed makes the motion of the file take long, to stand behind its duration; empty if it does not."""
    motion = file.motion
    if isinstance(motion, CircleMotion):
        key, feed = "motion.feeds_mm_per_min", min(motion.feeds_mm_per_min)
    elif (
        isinstance(motion, MovesMotion)
        and motion.dwell_s * motion.repeat * len(motion.targets_mm) < longest_s(file) / 2
    ):
        key, feed = "motion.feed_mm_per_min", motion.feed_mm_per_min
    else:
        return ""
    return f", which it takes at {key} = {feed:g} ({feed:g} m/min would be {1e3 * feed:g})"


def _moves_s(motion: MovesMotion) -> float:
    """Duration of all moves [s], without making them."""
    once, again = (_cycle_s(motion, start) for start in (motion.start_mm, motion.targets_mm[-1]))
    return once + (motion.repeat - 1) * again


def _cycle_s(motion: MovesMotion, start_mm: float) -> float:
    phases = (
        move_phases(
            (target - origin) * _MM,
            speed_m_per_s=motion.feed_mm_per_min * _MM_PER_MIN,
            acceleration_m_per_s2=motion.acceleration_m_per_s2,
            jerk_m_per_s3=math.inf if motion.jerk_m_per_s3 is None else motion.jerk_m_per_s3,
        )
        for origin, target in pairwise([start_mm, *motion.targets_mm])
    )
    return sum(one.duration_s + motion.dwell_s for one in phases)


def _place(key: str, said: Column | ColumnMotion) -> str:
    return f"key {key}, column {said.column!r} of {said.file}"


def _column(columns: Columns, key: str, said: Column | ColumnMotion, most: float, unit: str) -> tuple[Vector, Vector]:
    """Times and values of a column of a recording beside the file, none beyond `most`."""
    time_s, values = columns[key]
    with told_of(_place(key, said)):
        require_within(values, time_s, most, unit)
    return time_s, values


def _force(force: Force, time_s: Vector, columns: Columns) -> Vector | None:
    """Force from outside at these times [N]; each value held until the next, the first also before it."""
    if isinstance(force, Column):
        at_s, values = _column(columns, "motion.force_n", force, MOST_ACTING, "N")
        at_s = at_s - at_s[0]
    elif isinstance(force, tuple):
        at_s, values = (np.array(row, dtype=np.float64) for row in zip(*force, strict=True))
    elif force:
        return np.full(len(time_s), float(force))
    else:
        return None
    # a time of the grid that falls on a change up to rounding is after it
    held = np.searchsorted(at_s, time_s * (1.0 + 1e-12) + 1e-12, side="right") - 1
    return np.asarray(values[np.maximum(held, 0)], dtype=np.float64)
