"""What does the model file of a feed drive say: TOML text → checked values and references, numbers to be fitted."""

import dataclasses
import math
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import Literal

import numpy as np

from selector.errors import ModelFileError
from selector.physics import model_text
from selector.physics.checks import errors_name, require_within
from selector.physics.drive import model_schema as schema
from selector.physics.drive.ball_bar.circle import Circle, TableBall
from selector.physics.drive.parts.axis import RigidMechanics
from selector.physics.drive.trajectory import Reference, move_phases, moves, recorded, sine
from selector.physics.model_fields import Fit, Number, numbers_of, refusals
from selector.physics.simulation_kind import Columns
from selector.types import Vector

PERIOD_S = 0.001  #: Distance of the samples where the file says nothing, but for circles, which follow their feed.
MOST_MOVES = 20_000
FEWEST_PERIODS = 4  #: Of the samples in a motion: with fewer there is no error to tell of.
_MM = 1e-3
_MM_PER_MIN = 1e-3 / 60.0


def moved_axes(file: schema.DriveFile) -> tuple[str, ...]:
    """Names of the axes that the motion moves; others that the file may describe are not simulated."""
    motion = file.motion
    return motion.axes if isinstance(motion, schema.CircleMotion) else (motion.axis or next(iter(file.axes)),)


def file_reference(file: schema.DriveFile, columns: Columns) -> Reference:
    """What the one axis of a sine, of moves or of a column is asked to do.

    Raises InputError: the column is no course, or the moves have no length. Raises ModelFileError: the course of the
    column has more than `MOST_SAMPLES` samples.
    """
    motion = file.motion
    if isinstance(motion, schema.CircleMotion):
        raise ValueError("a circle has references of its own, see ball_bar")
    if isinstance(motion, schema.ColumnMotion):
        time_s, position_m = _column(columns, "motion", motion, schema.MOST_POSITION_M, "m")
        count = (time_s[-1] - time_s[0]) / (file.run.period_s or PERIOD_S) if len(time_s) else 0.0
        if count > model_text.MOST_SAMPLES:
            raise ModelFileError(
                f"{count:.3g} samples",
                expected=f"at most {model_text.MOST_SAMPLES}",
                where="key run.period_s",
                advice="make it larger, or the recording of the column shorter",
            )
        with errors_name(_place("motion", motion)):
            found = recorded(time_s - time_s[0] if len(time_s) else time_s, position_m, file.run.period_s)
    else:
        found = planned_reference(file)
    force = _force(motion.force_n, found.time_s, columns)
    return found if force is None else replace(found, force_n=force)


def planned_reference(file: schema.DriveFile) -> Reference:
    """What a sine or moves ask for, without forces. InputError: the moves have no length."""
    motion, period_s = file.motion, file.run.period_s or PERIOD_S
    if isinstance(motion, schema.SineMotion):
        return sine(
            motion.amplitude_mm * _MM,
            motion.frequency_hz,
            motion.duration_s,
            period_s,
            phase_rad=math.radians(motion.phase_deg),
            offset_m=motion.centre_mm * _MM,
        )
    if isinstance(motion, schema.MovesMotion):
        return moves(
            [target * _MM for target in motion.targets_mm],
            period_s,
            **_limits(motion),
            start_m=motion.start_mm * _MM,
            dwell_s=motion.dwell_s,
            repeat=motion.repeat,
        )
    raise ValueError("only a sine and moves are planned")


def file_circles(file: schema.DriveFile) -> tuple[Circle, ...]:
    """The circles of a ball-bar test: counter-clockwise and clockwise, feed after feed.

    InputError: a value cannot be; `where` is its field.
    """
    motion = file.motion
    if not isinstance(motion, schema.CircleMotion):
        raise ValueError("only circles make a ball-bar test")
    ball, table_ball = motion.table_ball, None
    if ball is not None:
        table_ball = TableBall(ball.distance_mm * _MM, math.radians(ball.angle_deg), ball.ratio)
    centre_m = (motion.centre_mm[0] * _MM, motion.centre_mm[1] * _MM)
    angles_rad = math.radians(motion.start_angle_deg), math.radians(motion.overshoot_deg)
    directions: tuple[Literal[1, -1], ...] = (1, -1)
    return tuple(
        Circle(feed, direction, motion.radius_mm * _MM, centre_m, *angles_rad, table_ball)
        for feed in motion.feeds_mm_per_min
        for direction in directions
    )


def longest_s(file: schema.DriveFile) -> float:
    """Duration of the longest run of one axis [s]; of a column 0, which is not known before it is read."""
    motion = file.motion
    if isinstance(motion, schema.CircleMotion):
        return max(circle.duration_s for circle in file_circles(file))
    if isinstance(motion, schema.SineMotion):
        return motion.duration_s
    if not isinstance(motion, schema.MovesMotion):
        return 0.0
    once, again = (_cycle_s(motion, start) for start in (motion.start_mm, motion.targets_mm[-1]))
    return once + (motion.repeat - 1) * again


def motion_counts(file: schema.DriveFile) -> Iterator[tuple[model_text.Key, str, float, int]]:
    """(key, what is counted, how many there are, how many there may be) of whatever makes a run long."""
    motion, duration_s = file.motion, longest_s(file)
    if isinstance(motion, schema.MovesMotion):
        yield ("motion", "repeat"), "moves", motion.repeat * len(motion.targets_mm), MOST_MOVES
    if file.run.period_s is not None or not isinstance(motion, schema.CircleMotion):
        yield ("run", "period_s"), "samples", duration_s / (file.run.period_s or PERIOD_S), model_text.MOST_SAMPLES
    if file.run.step_s is not None:
        yield ("run", "step_s"), "steps", duration_s / file.run.step_s, schema.MOST_STEPS


def _limits(motion: schema.MovesMotion) -> dict[str, float]:
    return {
        "speed_m_per_s": motion.feed_mm_per_min * _MM_PER_MIN,
        "acceleration_m_per_s2": motion.acceleration_m_per_s2,
        "jerk_m_per_s3": math.inf if motion.jerk_m_per_s3 is None else motion.jerk_m_per_s3,
    }


def _cycle_s(motion: schema.MovesMotion, start_mm: float) -> float:
    """Duration of the moves to all targets [s], without making them."""
    phases = (
        move_phases((target - origin) * _MM, **_limits(motion))
        for origin, target in pairwise([start_mm, *motion.targets_mm])
    )
    return sum(one.duration_s + motion.dwell_s for one in phases)


def _place(key: str, said: model_text.Column | schema.ColumnMotion) -> str:
    return f"key {key}, column {said.column!r} of {said.file}"


def _column(
    columns: Columns, key: str, said: model_text.Column | schema.ColumnMotion, most: float, unit: str
) -> tuple[Vector, Vector]:
    """Times and values of a column of a recording beside the file, none beyond `most`."""
    time_s, values = columns[key]
    with errors_name(_place(key, said)):
        require_within(values, time_s, most, unit)
    return time_s, values


def _force(force: schema.Force, time_s: Vector, columns: Columns) -> Vector | None:
    """Force from outside at these times [N]; each value held until the next, the first also before it."""
    if isinstance(force, model_text.Column):
        at_s, values = _column(columns, "motion.force_n", force, schema.MOST_ACTING, "N")
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


def columns_needed(file: schema.DriveFile) -> dict[str, model_text.Column | schema.ColumnMotion]:
    """Key of the file → column of a recording beside it that its values are read from, in the unit of its role."""
    found: dict[str, model_text.Column | schema.ColumnMotion] = {}
    if isinstance(file.motion, schema.CircleMotion):
        return found
    if isinstance(file.motion, schema.ColumnMotion):
        found["motion"] = file.motion
    if isinstance(file.motion.force_n, model_text.Column):
        found["motion.force_n"] = file.motion.force_n
    return found


def contradictions(file: schema.DriveFile) -> Iterator[model_text.Contradiction]:
    """(key, found, expected, advice) of whatever does not fit together in a file whose values are valid one by one."""
    for name, section in file.axes.items():
        yield from schema.axis_contradictions(name, section)
    yield from _of_motion(file)
    yield from model_text.bound_contradictions(file.bounds)
    yield from _of_length(file)


def _of_motion(file: schema.DriveFile) -> Iterator[model_text.Contradiction]:
    motion, known = file.motion, list(file.axes)
    if isinstance(motion, schema.CircleMotion):
        yield from _of_circle(file, motion)
        return
    if file.ball_bar is not None:
        yield ("ball_bar",), "a ball-bar without a circle", 'motion.kind = "circle"', "leave the section out"
    if motion.axis is None and len(known) > 1:
        advice = f'add axis = "{known[0]}"'
        yield ("motion", "axis"), f"{len(known)} axes ({', '.join(known)})", "the one that moves", advice
    elif motion.axis is not None and motion.axis not in file.axes:
        yield ("motion", "axis"), *model_text.unknown_name("axis", motion.axis, known)
    elif schema.is_rotary(file.axes[moved_axes(file)[0]]):
        advice = "rotary axes take part in circles only"
        yield ("motion", "axis"), f"{moved_axes(file)[0]!r}, which turns", "an axis that slides", advice
    if isinstance(motion, schema.SineMotion) and motion.frequency_hz * (file.run.period_s or PERIOD_S) >= 0.5:
        found = f"{motion.frequency_hz:g} Hz, sampled every {file.run.period_s or PERIOD_S:g} s"
        advice = "lower the frequency, or make run.period_s smaller"
        yield ("motion", "frequency_hz"), found, "more than two samples in a period", advice
    if isinstance(motion.force_n, tuple):
        starts = [start for start, _ in motion.force_n]
        if starts[0] != 0.0 or any(b <= a for a, b in pairwise(starts)):
            advice = "begin with [0, …] and sort the steps; one value a time"
            yield ("motion", "force_n"), f"steps at {starts[:6]} s", "times that begin with 0 and increase", advice


def _of_circle(file: schema.DriveFile, motion: schema.CircleMotion) -> Iterator[model_text.Contradiction]:
    known = list(file.axes)
    for number, name in enumerate(motion.axes):
        if name not in file.axes:
            yield ("motion", "axes", number), *model_text.unknown_name("axis", name, known)
            return
    if len(set(motion.axes)) < len(motion.axes):
        yield ("motion", "axes"), f"{', '.join(motion.axes)}", "an axis once", "name two different linear axes"
    for number, name in enumerate(motion.axes):
        turns = schema.is_rotary(file.axes[name])
        if turns != (number == 2):
            found = f"{name!r}, which {'turns' if turns else 'slides'}"
            expected = "a rotary axis in the third place, linear ones before it"
            yield ("motion", "axes", number), found, expected, 'a rotary axis has mechanics.kind = "rotary"'
    if len(motion.axes) == 3 and motion.table_ball is None:
        advice = "add [motion.table_ball] with distance_mm"
        yield ("motion", "table_ball"), "a rotary axis without a ball on it", "its place", advice
    if len(motion.axes) == 2 and motion.table_ball is not None:
        yield ("motion", "table_ball"), "a ball on no rotary axis", "three axes", "name the rotary axis in motion.axes"


def _of_few_samples(file: schema.DriveFile) -> Iterator[model_text.Contradiction]:
    """A period that is as long as the motion, whose length is known before it is made."""
    motion, duration_s, period_s = file.motion, longest_s(file), file.run.period_s or PERIOD_S
    if isinstance(motion, schema.SineMotion | schema.MovesMotion) and 0.0 < duration_s < FEWEST_PERIODS * period_s:
        key = ("run", "period_s") if file.run.period_s is not None else ("motion",)
        found = f"a period of {period_s:.6g} s in a motion of {duration_s:.6g} s"
        expected = f"a motion of at least {FEWEST_PERIODS} periods"
        yield key, found, expected, "make run.period_s shorter, or the motion longer (a sine: motion.duration_s)"


def _of_length(file: schema.DriveFile) -> Iterator[model_text.Contradiction]:
    """Runs that are too long to be held or to be waited for, and motions that are none."""
    yield from _of_few_samples(file)
    for key, what, count, most in motion_counts(file):
        if count > most:
            long = "" if what == "moves" else f" in a motion of {longest_s(file):.6g} s"
            advice = "correct it, or make the motion shorter; feeds are in mm/min"
            yield key, f"{count:.3g} {what}{long}", f"at most {most}", advice
            return
    if not isinstance(file.motion, schema.ColumnMotion):
        planned = file_circles if isinstance(file.motion, schema.CircleMotion) else planned_reference
        yield from refusals(partial(planned, file), ("motion",), file.motion)


_TURNING = {"kg": "kg·m²", "N·s/m": "N·m·s/rad", "N/m": "N·m/rad", "N": "N·m", "m/s": "rad/s", "m": "rad"}

#: ``output`` of an axis in the model file → unit of what its control puts out; none where it is a mere number.
OUTPUT_UNITS = {"current": "A", "voltage": "V", "force": "N", "number": ""}
_FRICTION_M_PER_S2 = 3.0  #: No dry friction of a machine's guides is larger than 0.3 of the weight.
_DAMPING_PER_S = 10.0  #: No guide stops a table within less than a tenth of a second by viscous friction alone.
_OF_CRITICAL = 0.2
_DRY = ("coulomb_n", "coulomb_negative_n", "static_n", "static_negative_n")


def numbers(file: schema.DriveFile) -> Iterator[Number]:
    """The physics of a feed drive as named numbers, those that are switched off included: friction, backlash, delay.

    Their names and bounds: docs/reference/drive-model.md, ``[bounds]``. A key that follows another one while it is left
    out (`static_n`, `coulomb_negative_n`) has that value.
    """
    for name, section in file.axes.items():
        made = schema.file_axis(section)
        for one in _of_axis(made):
            if _has_effect(one.path, made):
                low, high = _bounds(one, made)
                yield Number(("axes", name, *one.path), one.value, low, high, _unit(one, made))


def _of_axis(made: schema.FileAxis) -> Iterator[Number]:
    """Every number, its path below the axis."""
    axis, friction = made.axis, made.axis.friction
    if made.parts is None:
        yield from numbers_of(axis.mechanics, ("mechanics",))
    else:
        yield from numbers_of(made.parts, ("parts",))
    (_, hold), (down, hold_down) = friction.directions
    whole = dataclasses.replace(friction, coulomb_negative_n=down, static_n=hold, static_negative_n=hold_down)
    yield from numbers_of(whole, ("friction",))
    yield from numbers_of(axis.transmission, ("transmission",))
    for number, ripple in enumerate(axis.ripple):
        yield from numbers_of(ripple, ("ripple", number))
    if axis.servo is not None:
        yield from numbers_of(axis.servo, ("servo",))


def _has_effect(path: model_text.Key, made: schema.FileAxis) -> bool:
    section, key = path[0], path[-1]
    if isinstance(made.axis.mechanics, RigidMechanics) and key in ("backlash_m", "screw_coulomb_nm", "nut_efficiency"):
        return False
    if section == "friction" and key in _DRY:
        return made.section.varying != "command"
    if section == "servo" and key == "delay_s":
        return made.axis.servo is not None and made.axis.servo.sample_s > 0
    from_motor = made.parts is not None and key in ("actuator_gain", "command_limit", "speed_limit")
    return not from_motor or key in made.section.servo.model_fields_set


def _bounds(one: Number, made: schema.FileAxis) -> tuple[float, float]:
    """Those of the field; of forces and damping, which may be 0 or have either sign, by the mass of the axis."""
    limit = _limit_from_mass(one.path, made)
    if limit is not None:
        signed = one.path[-1] in ("offset_n", "cogging", "viscous_negative_ns_per_m")
        low, high = (Fit(either_sign=limit) if signed else Fit(up_to=limit)).bounds(one.value)
        if one.path[-1] == "viscous_negative_ns_per_m":
            # friction drives no axis
            low = max(low, -made.axis.mechanics.guide_damping_ns_per_m)
        return low, high
    return (one.low, one.high) if one.high > one.low else (0.0, 1.0)


def _unit(one: Number, made: schema.FileAxis) -> str:
    """The unit of a number; of gains, limits and cogging by what turns and what acts.

    ``A·s/rad`` of the velocity gain of a motor that turns and is given a current; ``V·s/m`` of one mass and a voltage.
    """
    slides = isinstance(made.axis.mechanics, RigidMechanics) and not made.rotary
    output, force = OUTPUT_UNITS[made.section.output], "N" if slides else "N·m"
    per, over = ("m" if slides else "rad"), output or "1"
    by_axis = {
        "velocity_gain": f"{output}·s/{per}" if output else f"s/{per}",
        "velocity_integral_gain": f"{over}/{per}",
        "actuator_gain": "1" if output == force else f"{force}/{output}" if output else force,
        "command_limit": over,
        "speed_limit": f"{per}/s",
        "cogging": force,
    }
    return by_axis.get(str(one.path[-1])) or (_TURNING.get(one.unit, one.unit) if made.rotary else one.unit)


def _limit_from_mass(path: model_text.Key, made: schema.FileAxis) -> float | None:
    """How far a force, torque, damping or integral gain that may be 0 may go up."""
    key, mechanics = str(path[-1]), made.axis.mechanics
    mass = mechanics.mass_kg if isinstance(mechanics, RigidMechanics) else mechanics.table_mass_kg
    radius = mechanics.travel_per_motion
    lugre, servo = made.axis.friction.lugre, made.axis.servo
    if key in (*_DRY, "offset_n"):
        return _FRICTION_M_PER_S2 * mass
    if key == "cogging":
        return _FRICTION_M_PER_S2 * mass * radius
    if key in ("guide_damping_ns_per_m", "viscous_ns_per_m", "viscous_negative_ns_per_m"):
        return _DAMPING_PER_S * mass
    if path[-2:] == ("lugre", "damping_ns_per_m") and lugre is not None:
        return 2.0 * math.sqrt(lugre.stiffness_n_per_m * mass)
    if key == "velocity_integral_gain" and servo is not None:
        return 200.0 * servo.velocity_gain
    if isinstance(mechanics, RigidMechanics):
        return None
    if key in ("screw_coulomb_nm", "drag_torque_nm"):
        return _FRICTION_M_PER_S2 * mass * radius
    if key in ("screw_damping_nms_per_rad", "damping_nms_per_rad"):
        return _DAMPING_PER_S * mass * radius**2
    if key == "torsional_damping_nms_per_rad":
        return 2.0 * _OF_CRITICAL * math.sqrt(mechanics.torsional_stiffness_nm_per_rad * mechanics.screw_inertia_kg_m2)
    if key == "axial_damping_ns_per_m":
        return 2.0 * _OF_CRITICAL * math.sqrt(mechanics.axial_stiffness_n_per_m * mass)
    return None


FAMILY: model_text.ModelFamily[schema.DriveFile] = model_text.ModelFamily(
    "drive", schema.KINDS, contradictions, page="docs/reference/drive-model.md", examples="fixtures/drive",
    columns_needed=columns_needed, numbers=numbers,
    column_roles={"motion": "position_command", "motion.force_n": "force"},
)  # fmt: skip
#: The model file at a path, with this content, and with these sections as plain values, see `ModelFamily`.
read_model_file, parsed_model_file, checked_model_file = FAMILY.read, FAMILY.parsed, FAMILY.checked
