"""Which numbers of a vibrating structure could be fitted again: named, with unit and bounds."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from selector.physics.model_entries import Entry
from selector.physics.model_parameters import Parameter, bad_bounds, put_at, require_settable
from selector.physics.model_text import Key
from selector.physics.vibration.model_file import checked_model_file, plain_values
from selector.physics.vibration.model_parts import file_shafts
from selector.physics.vibration.model_schema import JointSection, LineSection, MemberSection, VibrationFile
from selector.physics.vibration.shaft_course import ShaftCourse

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


@dataclass(frozen=True)
class _Number:
    path: Key
    value: float
    low: float
    high: float


def parameters(file: VibrationFile) -> dict[str, Parameter]:
    """The physics of a structure and its sources as named numbers, those that are switched off included.

    Names are the keys of the file, arrays counted from 1: ``members.tool.mass_kg``, ``joints.3.dissipation``,
    ``sources.IK2.lines.1.force_n``. Masses and stiffnesses may be a tenth to ten times what they are, ψ from 0 to 2.
    A force that is there may be a thousandth to ten times; one that is 0 from 0 to ten times what the unbalance of its
    line makes at the highest speed, and the other way round; phases −π to π. Always around the value, unless
    ``[bounds]`` says otherwise.

    Raises
    ------
    ModelFileError
        ``[bounds]`` names what is no parameter, excludes the value of one, or allows what its key does not.
    """
    found: dict[str, Parameter] = {}
    for number in _numbers(file):
        name = _name(number.path)
        low, high = file.bounds.get(name, _around_value(number))
        if not low <= number.value <= high:
            raise bad_bounds(name, f"[{low:g}, {high:g}]", f"limits around the value, {number.value:g}")
        least, most = _LIMITS[str(number.path[-1])]
        if low < least or high > most:
            raise bad_bounds(
                name, f"[{low:g}, {high:g}]", f"limits between {least:g} and {most:g}, as its key has them"
            )
        found[name] = Parameter(number.value, low, high, UNITS[str(number.path[-1])])
    for name in file.bounds:
        if name not in found:
            raise bad_bounds(name, "no parameter of this name", "one of " + ", ".join(list(found)[:12]) + ", …")
    return found


def with_parameters(file: VibrationFile, values: Mapping[str, float]) -> VibrationFile:
    """The model file with other values of some parameters, checked as if it were read.

    Raises
    ------
    OptionError
        There is no such parameter, or the value is outside the bounds that the file gives it.
    ModelFileError
        A value is impossible, e.g. a negative mass.
    """
    plain = copy.deepcopy(plain_values(file))
    paths = {_name(number.path): number.path for number in _numbers(file)}
    for name, value in values.items():
        require_settable(name, value, list(paths), file.bounds, file.model.name)
        put_at(plain, paths[name], float(value))
    return checked_model_file(plain, where=f"model {file.model.name!r}")


def _name(path: Key) -> str:
    return ".".join(str(part + 1) if isinstance(part, int) else part for part in path)


def _numbers(file: VibrationFile) -> Iterator[_Number]:
    for name, member in file.members.items():
        yield _around(("members", name, "mass_kg"), member.mass_kg)
    for number, joint in enumerate(file.joints):
        yield _around(("joints", number, "stiffness_n_per_m"), joint.stiffness_n_per_m)
        most = max(_MOST_DISSIPATION, _TIMES * joint.dissipation)
        yield _Number(("joints", number, "dissipation"), joint.dissipation, 0.0, most)
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


def _around_value(number: _Number) -> tuple[float, float]:
    """Bounds of a number without an entry in ``[bounds]``; never beyond what its key may have."""
    least, most = _LIMITS[str(number.path[-1])]
    return max(min(number.low, number.value), least), min(max(number.high, number.value), most)


_LIMITS = {
    "mass_kg": _limits(MemberSection, "mass_kg"),
    **{key: _limits(JointSection, key) for key in ("stiffness_n_per_m", "dissipation")},
    **{key: _limits(LineSection, key) for key in ("force_n", "unbalance_kg_m", "phase_rad")},
}


def _around(path: Key, value: float) -> _Number:
    return _Number(path, value, value / _TIMES, value * _TIMES)


def _of_line(path: Key, line: LineSection, course: ShaftCourse | None, duration_s: float) -> Iterator[_Number]:
    frequency = line.frequency_hz
    if frequency is None and course is not None:
        frequency = (line.order or 0.0) * course.range_rpm(0.0, duration_s)[1] / 60.0
    square = (2.0 * math.pi * (frequency or 0.0)) ** 2
    for key, value, instead in (
        ("force_n", line.force_n, line.unbalance_kg_m * square),
        ("unbalance_kg_m", line.unbalance_kg_m, line.force_n / square if square > 0 else 0.0),
    ):
        if value > 0:
            yield _Number((*path, key), value, _SMALLEST * value, _TIMES * value)
        elif line.order is not None or key == "force_n":
            # what keeps its frequency is no unbalance: that follows a shaft
            yield _Number((*path, key), value, 0.0, _TIMES * instead)
    yield _Number((*path, "phase_rad"), line.phase_rad, -math.pi, math.pi)
