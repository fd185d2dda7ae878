"""Which numbers of a feed drive could be fitted again: named, with unit and bounds."""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Any

from selector.physics.drive.mechanics import RigidMechanics
from selector.physics.drive.model_axes import FileAxis, file_axis
from selector.physics.drive.model_file import checked_model_file, plain_values
from selector.physics.drive.model_schema import DriveFile
from selector.physics.drive.parameter_bounds import parameter_bounds, unit_of_parameter
from selector.physics.model_parameters import Parameter, bad_bounds, require_settable
from selector.physics.model_text import Key

_FIXED = frozenset(
    {
        "harmonic", "lead_m", "lead_mm", "sample_s", "density_kg_per_m3", "modulus_gpa", "shear_modulus_gpa",
        "rigidity_preload_n", "origin_mm", "pitch_position_m", "pitch_error_m", "diameter_mm", "root_diameter_mm",
        "length_mm", "overhang_mm", "ball_diameter_mm", "pitch_circle_mm", "turns", "contact_angle_deg",
    }
)  # fmt: skip
"""What is known exactly, or what a fit could not tell from its neighbours."""

_DRY = ("coulomb_n", "coulomb_negative_n", "static_n", "static_negative_n")
_NEEDS_SCREW = ("backlash_m", "screw_coulomb_nm")


def parameters(file: DriveFile) -> dict[str, Parameter]:
    """The physics of a feed drive as named numbers, those that are switched off included: friction, backlash, delay.

    Names are the keys of the file, also where the file leaves them out: ``axes.X.mechanics.mass_kg``,
    ``axes.X.friction.coulomb_n``, ``axes.X.servo.delay_s``, ``axes.X.ripple.1.cogging``. A key that follows another one
    while it is left out (`static_n`, `coulomb_negative_n`) has that value. Bounds are those of `parameter_bounds`,
    unless ``[bounds]`` says otherwise.

    Raises
    ------
    ModelFileError
        ``[bounds]`` names what is no parameter, or excludes the value of one.
    """
    found: dict[str, Parameter] = {}
    for axis_name, section in file.axes.items():
        made = file_axis(section)
        for path, value in _numbers(made):
            name = _name(axis_name, path)
            low, high = file.bounds.get(name, parameter_bounds(path, value, made))
            if not low <= value <= high:
                raise bad_bounds(name, f"[{low:g}, {high:g}]", f"limits around the value, {value:g}")
            found[name] = Parameter(value, low, high, unit_of_parameter(path, made))
    for name in file.bounds:
        if name not in found:
            raise bad_bounds(name, "no parameter of this name", "one of " + ", ".join(list(found)[:12]) + ", …")
    return found


def with_parameters(file: DriveFile, values: Mapping[str, float]) -> DriveFile:
    """The model file with other values of some parameters, checked as if it were read.

    Raises
    ------
    OptionError
        There is no such parameter, or the value is outside the bounds that the file gives it.
    ModelFileError
        A value is impossible, e.g. a negative mass.
    """
    plain = copy.deepcopy(plain_values(file))
    paths = {
        _name(name, path): ("axes", name, *path)
        for name, section in file.axes.items()
        for path, _ in _numbers(file_axis(section))
    }
    for name, value in values.items():
        require_settable(name, value, list(paths), file.bounds, file.model.name)
        _put(plain, paths[name], float(value))
    return checked_model_file(plain, where=f"model {file.model.name!r}")


def _name(axis: str, path: Key) -> str:
    return ".".join(["axes", axis, *(str(part + 1) if isinstance(part, int) else part for part in path)])


def _numbers(made: FileAxis) -> Iterator[tuple[Key, float]]:
    """Path below the axis, and value, of every parameter."""
    axis, parts = made.axis, made.parts
    if parts is None:
        yield from _fields(axis.mechanics, ("mechanics",))
    else:
        for part in dataclasses.fields(parts):
            yield from _fields(getattr(parts, part.name), ("parts", part.name))
    yield from _of_friction(made)
    rigid = isinstance(axis.mechanics, RigidMechanics)
    for path, value in _fields(axis.transmission, ("transmission",)):
        if not (rigid and path[-1] in _NEEDS_SCREW):
            yield path, value
    for number, ripple in enumerate(axis.ripple):
        yield from _fields(ripple, ("ripple", number))
    if axis.servo is None:
        return
    for path, value in _fields(axis.servo, ("servo",)):
        said = path[-1] in made.section.servo.model_fields_set
        from_motor = parts is not None and path[-1] in ("actuator_gain", "command_limit", "speed_limit")
        if (said or not from_motor) and not (path[-1] == "delay_s" and axis.servo.sample_s == 0):
            yield path, value


def _of_friction(made: FileAxis) -> Iterator[tuple[Key, float]]:
    friction = made.axis.friction
    (_, hold), (down, hold_down) = friction.directions
    whole = dataclasses.replace(friction, coulomb_negative_n=down, static_n=hold, static_negative_n=hold_down)
    rigid, along = isinstance(made.axis.mechanics, RigidMechanics), made.section.varying == "command"
    for path, value in _fields(whole, ("friction",)):
        if not (rigid and path[-1] in _NEEDS_SCREW) and not (along and path[-1] in _DRY):
            yield path, value
    if friction.lugre is not None:
        yield from _fields(friction.lugre, ("friction", "lugre"))


def _fields(value: Any, path: Key) -> Iterator[tuple[Key, float]]:
    """The numbers among the fields of a dataclass that are no counts and not fixed."""
    for field in dataclasses.fields(value):
        number = getattr(value, field.name)
        if isinstance(number, float) and field.name not in _FIXED:
            yield (*path, field.name), number
        elif isinstance(number, int) and not isinstance(number, bool) and str(field.type).startswith("float"):
            yield (*path, field.name), float(number)


def _put(plain: dict[str, Any], path: Key, number: float) -> None:
    """Sets a number, and makes the sections on the way that the file leaves out."""
    here: Any = plain
    for part, following in pairwise(path):
        if isinstance(here, dict) and part not in here:
            here[part] = [] if isinstance(following, int) else {}
        if isinstance(here[part], tuple):
            here[part] = list(here[part])
        here = here[part]
    here[path[-1]] = number
