"""What does the model file of a feed drive say: TOML text → checked values, or an error that names the key."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from itertools import pairwise

from selector.physics.drive.ball_bar.circle import PairGeometry
from selector.physics.drive.file.model_axes import axis_contradictions, is_rotary
from selector.physics.drive.file.model_motion import (
    FEWEST_PERIODS,
    PERIOD_S,
    circle_plan,
    longest_s,
    motion_counts,
    moved_axes,
    planned_reference,
    slow_feed_words,
)
from selector.physics.drive.file.model_schema import (
    KINDS,
    CircleMotion,
    ColumnMotion,
    DriveFile,
    MovesMotion,
    SineMotion,
)
from selector.physics.model_text import (
    Column,
    Contradiction,
    ModelFamily,
    bound_contradictions,
    unknown_name,
)
from selector.physics.model_values import refusals, value_of

COLUMN_ROLES = {"motion": "position_command", "motion.force_n": "force"}
"""Key of a column of `columns_needed` → role of its values, which are in the unit of that role."""


def columns_needed(file: DriveFile) -> dict[str, Column | ColumnMotion]:
    """Key of the file → column of a recording beside it that its values are read from, see `COLUMN_ROLES`."""
    found: dict[str, Column | ColumnMotion] = {}
    if isinstance(file.motion, CircleMotion):
        return found
    if isinstance(file.motion, ColumnMotion):
        found["motion"] = file.motion
    if isinstance(file.motion.force_n, Column):
        found["motion.force_n"] = file.motion.force_n
    return found


def contradictions(file: DriveFile) -> Iterator[Contradiction]:
    """(key, found, expected, advice) of whatever does not fit together in a file whose values are valid one by one."""
    for name, section in file.axes.items():
        yield from axis_contradictions(name, section)
    yield from _of_motion(file)
    yield from bound_contradictions(file.bounds)
    yield from _of_length(file)


def _of_motion(file: DriveFile) -> Iterator[Contradiction]:
    motion, known = file.motion, list(file.axes)
    if isinstance(motion, CircleMotion):
        yield from _of_circle(file, motion)
        return
    if file.ball_bar is not None:
        yield ("ball_bar",), "a ball-bar without a circle", 'motion.kind = "circle"', "leave the section out"
    if motion.axis is None and len(known) > 1:
        advice = f'add axis = "{known[0]}"'
        yield ("motion", "axis"), f"{len(known)} axes ({', '.join(known)})", "the one that moves", advice
    elif motion.axis is not None and motion.axis not in file.axes:
        yield ("motion", "axis"), *unknown_name("axis", motion.axis, known)
    elif is_rotary(file.axes[moved_axes(file)[0]]):
        advice = "rotary axes take part in circles only"
        yield ("motion", "axis"), f"{moved_axes(file)[0]!r}, which turns", "an axis that slides", advice
    if isinstance(motion, SineMotion) and motion.frequency_hz * (file.run.period_s or PERIOD_S) >= 0.5:
        found = f"{motion.frequency_hz:g} Hz, sampled every {file.run.period_s or PERIOD_S:g} s"
        advice = "lower the frequency, or make run.period_s smaller"
        yield ("motion", "frequency_hz"), found, "more than two samples in a period", advice
    if isinstance(motion.force_n, tuple):
        starts = [start for start, _ in motion.force_n]
        if starts[0] != 0.0 or any(b <= a for a, b in pairwise(starts)):
            advice = "begin with [0, …] and sort the steps; one value a time"
            yield ("motion", "force_n"), f"steps at {starts[:6]} s", "times that begin with 0 and increase", advice


def _of_circle(file: DriveFile, motion: CircleMotion) -> Iterator[Contradiction]:
    known = list(file.axes)
    for number, name in enumerate(motion.axes):
        if name not in file.axes:
            yield ("motion", "axes", number), *unknown_name("axis", name, known)
            return
    if len(set(motion.axes)) < len(motion.axes):
        yield ("motion", "axes"), f"{', '.join(motion.axes)}", "an axis once", "name two different linear axes"
    for number, name in enumerate(motion.axes):
        turns = is_rotary(file.axes[name])
        if turns != (number == 2):
            found = f"{name!r}, which {'turns' if turns else 'slides'}"
            expected = "a rotary axis in the third place, linear ones before it"
            yield ("motion", "axes", number), found, expected, 'a rotary axis has mechanics.kind = "rotary"'
    if len(motion.axes) == 3 and motion.table_ball is None:
        advice = "add [motion.table_ball] with distance_mm"
        yield ("motion", "table_ball"), "a rotary axis without a ball on it", "its place", advice
    if len(motion.axes) == 2 and motion.table_ball is not None:
        yield ("motion", "table_ball"), "a ball on no rotary axis", "three axes", "name the rotary axis in motion.axes"
    if file.ball_bar is not None:
        yield from refusals(partial(value_of, PairGeometry, file.ball_bar), ("ball_bar",), file.ball_bar)


def _of_few_samples(file: DriveFile) -> Iterator[Contradiction]:
    """A period that is as long as the motion, whose length is known before it is made."""
    motion, duration_s, period_s = file.motion, longest_s(file), file.run.period_s or PERIOD_S
    if isinstance(motion, SineMotion | MovesMotion) and 0.0 < duration_s < FEWEST_PERIODS * period_s:
        key = ("run", "period_s") if file.run.period_s is not None else ("motion",)
        found = f"a period of {period_s:.6g} s in a motion of {duration_s:.6g} s"
        expected = f"a motion of at least {FEWEST_PERIODS} periods"
        yield key, found, expected, "make run.period_s shorter, or the motion longer (a sine: motion.duration_s)"


def _of_length(file: DriveFile) -> Iterator[Contradiction]:
    """Runs that are too long to be held or to be waited for, and motions that are none."""
    yield from _of_few_samples(file)
    for key, what, count, most in motion_counts(file):
        if count > most:
            long = "" if what == "moves" else f" in a motion of {longest_s(file):.6g} s{slow_feed_words(file)}"
            yield key, f"{count:.3g} {what}{long}", f"at most {most}", "correct it, or make the motion shorter"
            return
    if not isinstance(file.motion, ColumnMotion):
        planned = circle_plan if isinstance(file.motion, CircleMotion) else planned_reference
        yield from refusals(partial(planned, file), ("motion",), file.motion)


FAMILY: ModelFamily[DriveFile] = ModelFamily(
    "drive", KINDS, contradictions, page="docs/reference/drive-model.md", examples="fixtures/drive"
)
read_model_file = FAMILY.read
"""The model file at a path, see `ModelFamily.read`."""

parsed_model_file = FAMILY.parsed
"""The model file with this content, see `ModelFamily.parsed`."""

checked_model_file = FAMILY.checked
"""The model file with these sections as plain values, see `ModelFamily.checked`."""
