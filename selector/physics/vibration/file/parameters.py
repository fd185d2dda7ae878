"""Which numbers of a vibrating structure could be fitted again: named, with unit and bounds."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from selector.physics.model_parameters import Number, Parameter, file_with, parameters_of
from selector.physics.model_text import Entry, Key
from selector.physics.vibration.file.model_file import (
    JointSection,
    LineSection,
    MemberSection,
    VibrationFile,
    checked_model_file,
    file_shafts,
)
from selector.physics.vibration.structure.source import ShaftCourse

_TIMES = 10.0
_SMALLEST = 1e-3
"""Of a force that is there: a line without any is refused."""

_MOST_DISSIPATION = 2.0
"""No joint of a machine takes more of the energy in a cycle; rubber takes as much."""

UNITS = {
    "mass_kg": "kg",
    "stiffness_n_per_m": "N/m",
    "dissipation": "1",
    "force_n": "N",
    "unbalance_kg_m": "kg·m",
    "phase_rad": "rad",
}
"""Key of a parameter → its unit."""


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
        yield _around(("members", name, "mass_kg"), member.mass_kg)
    for number, joint in enumerate(file.joints):
        yield _around(("joints", number, "stiffness_n_per_m"), joint.stiffness_n_per_m)
        most = max(_MOST_DISSIPATION, _TIMES * joint.dissipation)
        yield _number(("joints", number, "dissipation"), joint.dissipation, 0.0, most)
    courses = file_shafts(file)
    for name, source in file.sources.items():
        course = courses[source.shaft] if source.shaft is not None else None
        for number, line in enumerate(source.lines):
            yield from _of_line(("sources", name, "lines", number), line, course, file.run.duration_s)


def _limits(section: type[Entry], key: str) -> tuple[float, float]:
    """Smallest and largest value that a key may have."""
    metadata = section.model_fields[key].metadata
    least, most = (next(getattr(one, end) for one in metadata if hasattr(one, end)) for end in ("ge", "le"))
    return float(least), float(most)


_LIMITS = {
    "mass_kg": _limits(MemberSection, "mass_kg"),
    **{key: _limits(JointSection, key) for key in ("stiffness_n_per_m", "dissipation")},
    **{key: _limits(LineSection, key) for key in ("force_n", "unbalance_kg_m", "phase_rad")},
}


def _around(path: Key, value: float) -> Number:
    return _number(path, value, value / _TIMES, value * _TIMES)


def _number(path: Key, value: float, low: float, high: float) -> Number:
    key = str(path[-1])
    return Number(path, value, low, high, UNITS[key], limits=_LIMITS[key])


def _of_line(path: Key, line: LineSection, course: ShaftCourse | None, duration_s: float) -> Iterator[Number]:
    frequency = line.frequency_hz
    if frequency is None and course is not None:
        frequency = (line.order or 0.0) * course.range_rpm(0.0, duration_s)[1] / 60.0
    square = (2.0 * math.pi * (frequency or 0.0)) ** 2
    for key, value, instead in (
        ("force_n", line.force_n, line.unbalance_kg_m * square),
        ("unbalance_kg_m", line.unbalance_kg_m, line.force_n / square if square > 0 else 0.0),
    ):
        if value > 0:
            yield _number((*path, key), value, _SMALLEST * value, _TIMES * value)
        elif line.order is not None or key == "force_n":
            # what keeps its frequency is no unbalance: that follows a shaft
            yield _number((*path, key), value, 0.0, _TIMES * instead)
    yield _number((*path, "phase_rad"), line.phase_rad, -math.pi, math.pi)
