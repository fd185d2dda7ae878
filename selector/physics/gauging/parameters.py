"""Which numbers of a gauging model could be fitted again: named, with unit and bounds."""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from selector.physics.gauging.model_file import checked_model_file, plain_values
from selector.physics.gauging.model_parts import file_parts
from selector.physics.gauging.model_schema import GaugingFile
from selector.physics.gauging.parameter_bounds import parameter_bounds, unit_of_key
from selector.physics.model_parameters import Parameter, bad_bounds, put_at, require_settable
from selector.physics.model_text import Key

_FIXED = frozenset({"exponent", "linear.allowance_um"})
"""What is known exactly, or only says where a line was taken."""


def parameters(file: GaugingFile) -> dict[str, Parameter]:
    """The physics of gauging as named numbers, those that are switched off included: lag, wear, delay, run-out.

    Names are the keys of the file, also where the file leaves them out, arrays counted from 1:
    ``grinding.stages.1.feed_um_per_s``, ``transducer.contact.stiffness``, ``noise.sd_um``, ``thresholds.volts.2``.
    Tolerances and whole numbers are none. Bounds are those of `parameter_bounds`, unless ``[bounds]`` says otherwise.

    Raises
    ------
    ModelFileError
        ``[bounds]`` names what is no parameter, or excludes the value of one.
    """
    found: dict[str, Parameter] = {}
    for path, value in _numbers(file):
        name = _name(path)
        low, high = file.bounds.get(name, parameter_bounds(path, value))
        if not low <= value <= high:
            raise bad_bounds(name, f"[{low:g}, {high:g}]", f"limits around the value, {value:g}")
        found[name] = Parameter(value, low, high, unit_of_key(str(path[-2] if isinstance(path[-1], int) else path[-1])))
    for name in file.bounds:
        if name not in found:
            raise bad_bounds(name, "no parameter of this name", "one of " + ", ".join(list(found)[:12]) + ", …")
    return found


def with_parameters(file: GaugingFile, values: Mapping[str, float]) -> GaugingFile:
    """The model file with other values of some parameters, checked as if it were read.

    Raises
    ------
    OptionError
        There is no such parameter, or the value is outside the bounds that the file gives it.
    ModelFileError
        A value is impossible, e.g. a negative mass.
    """
    plain = copy.deepcopy(plain_values(file))
    paths = {_name(path): path for path, _ in _numbers(file)}
    for name, value in values.items():
        require_settable(name, value, list(paths), file.bounds, file.model.name)
        put_at(plain, paths[name], float(value))
    return checked_model_file(plain, where=f"model {file.model.name!r}")


def _name(path: Key) -> str:
    return ".".join(str(part + 1) if isinstance(part, int) else part for part in path)


def _numbers(file: GaugingFile) -> Iterator[tuple[Key, float]]:
    """Path and value of every parameter."""
    parts = file_parts(file)
    if parts.transducer is not None:
        yield from _fields(parts.transducer, ("transducer",))
    else:
        yield from (one for one in _fields(parts.linear, ("linear",)) if _name(one[0]) not in _FIXED)
        yield from _fields(parts.relay, ("relay",))
    yield from _fields(parts.grinding, ("grinding",))
    for path, value in _fields(parts.surface, ("surface",)):
        turns, grooved = parts.surface.workpiece_rpm > 0, parts.surface.grooves > 0
        if turns and (grooved or not str(path[-1]).startswith("groove_")):
            yield path, value
    yield from _fields(parts.noise, ("noise",))
    for number, volts in enumerate(file.thresholds.volts if file.thresholds is not None else ()):
        yield ("thresholds", "volts", number), volts


def _fields(value: Any, path: Key) -> Iterator[tuple[Key, float]]:
    """The numbers in a dataclass, and in those inside it, that are no counts and not fixed."""
    for field in dataclasses.fields(value):
        inner, here = getattr(value, field.name), (*path, field.name)
        if dataclasses.is_dataclass(inner):
            yield from _fields(inner, here)
        elif isinstance(inner, Sequence) and not isinstance(inner, str):
            for number, one in enumerate(inner):
                yield from _fields(one, (*here, number))
        elif isinstance(inner, float | int) and str(field.type).startswith("float") and field.name not in _FIXED:
            yield here, float(inner)
