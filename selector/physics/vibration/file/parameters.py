"""Which numbers of a vibrating structure could be fitted again: named, with unit and bounds."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace

from selector.physics.model_fields import Number, Parameter, file_with, numbers_of, parameters_of
from selector.physics.model_text import Entry, Key
from selector.physics.vibration.file.model_file import LineSection, VibrationFile, checked_model_file, file_shafts
from selector.physics.vibration.structure.source import ShaftCourse

_TIMES = 10.0
_SMALLEST = 1e-3
"""Of a force that is there: a line without any is refused."""


def parameters(file: VibrationFile) -> dict[str, Parameter]:
    """The physics of a structure and its sources as named numbers, those that are switched off included.

    Names are the keys of the file, arrays counted from 1: ``members.tool.mass_kg``, ``joints.3.dissipation``,
    ``sources.IK2.lines.1.force_n``. Masses and stiffnesses may be a tenth to ten times what they are, ψ from 0 to 2.
    A force that is there may be a thousandth to ten times; one that is 0 from 0 to ten times what the unbalance of its
    line makes at the highest speed, and the other way round; phases −π to π. Always around the value, unless
    ``[bounds]`` says otherwise. Errors as `parameters_of`.
    """
    return parameters_of(file, _numbers(file))


def with_parameters(file: VibrationFile, values: Mapping[str, float]) -> VibrationFile:
    """The model file with other values of some parameters, see `file_with`."""
    return file_with(file, values, _numbers(file), checked_model_file)


def _numbers(file: VibrationFile) -> Iterator[Number]:
    for name, member in file.members.items():
        yield from _of_section(member, ("members", name))
    for number, joint in enumerate(file.joints):
        yield from _of_section(joint, ("joints", number))
    courses = file_shafts(file)
    for name, source in file.sources.items():
        course = courses[source.shaft] if source.shaft is not None else None
        for number, line in enumerate(source.lines):
            yield from _of_line(("sources", name, "lines", number), line, course, file.run.duration_s)


def _of_section(section: Entry, path: Key) -> Iterator[Number]:
    """Its numbers, whose bounds may not pass what their keys may have."""
    for one in numbers_of(section, path):
        said = type(section).model_fields[str(one.path[-1])].metadata
        least, most = (
            float(next(getattr(limit, end) for limit in said if hasattr(limit, end))) for end in ("ge", "le")
        )
        yield replace(one, limits=(least, most))


def _of_line(path: Key, line: LineSection, course: ShaftCourse | None, duration_s: float) -> Iterator[Number]:
    frequency = line.frequency_hz
    if frequency is None and course is not None:
        frequency = (line.order or 0.0) * course.range_rpm(0.0, duration_s)[1] / 60.0
    square = (2.0 * math.pi * (frequency or 0.0)) ** 2
    instead = {
        "force_n": line.unbalance_kg_m * square,
        "unbalance_kg_m": line.force_n / square if square > 0 else 0.0,
    }
    for one in _of_section(line, path):
        key = str(one.path[-1])
        if key not in instead:
            yield one
        elif one.value > 0:
            yield replace(one, low=_SMALLEST * one.value, high=_TIMES * one.value)
        elif line.order is not None or key == "force_n":
            # what keeps its frequency is no unbalance: that follows a shaft
            yield replace(one, low=0.0, high=_TIMES * instead[key])
