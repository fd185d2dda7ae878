"""Which numbers of a feed drive could be fitted again: named, with unit and bounds."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping

from selector.physics.drive.file.model_axes import FileAxis, file_axis
from selector.physics.drive.file.model_file import checked_model_file
from selector.physics.drive.file.model_schema import DriveFile
from selector.physics.drive.parts.mechanics import RigidMechanics
from selector.physics.model_fields import Fit, Number, Parameter, file_with, numbers_of, parameters_of
from selector.physics.model_text import Key

_TURNING = {"kg": "kg·m²", "N·s/m": "N·m·s/rad", "N/m": "N·m/rad", "N": "N·m", "m/s": "rad/s", "m": "rad"}

OUTPUT_UNITS = {"current": "A", "voltage": "V", "force": "N", "number": ""}
"""``output`` of an axis in the model file → unit of what its control puts out; none where it is a mere number."""

_FRICTION_M_PER_S2 = 3.0
"""No dry friction of a machine's guides is larger than 0.3 of the weight."""

_DAMPING_PER_S = 10.0
"""No guide stops a table within less than a tenth of a second by viscous friction alone."""

_OF_CRITICAL = 0.2
_DRY = ("coulomb_n", "coulomb_negative_n", "static_n", "static_negative_n")


def parameters(file: DriveFile) -> dict[str, Parameter]:
    """The physics of a feed drive as named numbers, those that are switched off included: friction, backlash, delay.

    Names are the keys of the file, also where the file leaves them out: ``axes.X.mechanics.mass_kg``,
    ``axes.X.friction.coulomb_n``, ``axes.X.servo.delay_s``, ``axes.X.ripple.1.cogging``. A key that follows another one
    while it is left out (`static_n`, `coulomb_negative_n`) has that value. Bounds are those of the fields, or what a
    machine of this mass could have: 0.3 of its weight of dry friction, damping that stops it in 0.1 s, a fifth of
    critical damping in its springs; unless ``[bounds]`` says otherwise. Errors as `parameters_of`.
    """
    return parameters_of(file, _numbers(file))


def with_parameters(file: DriveFile, values: Mapping[str, float]) -> DriveFile:
    """The model file with other values of some parameters, see `file_with`."""
    return file_with(file, values, _numbers(file), checked_model_file)


def _numbers(file: DriveFile) -> Iterator[Number]:
    for name, section in file.axes.items():
        made = file_axis(section)
        for one in _of_axis(made):
            if _has_effect(one.path, made):
                low, high = _bounds(one, made)
                yield Number(("axes", name, *one.path), one.value, low, high, _unit(one, made))


def _of_axis(made: FileAxis) -> Iterator[Number]:
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


def _has_effect(path: Key, made: FileAxis) -> bool:
    section, key = path[0], path[-1]
    if isinstance(made.axis.mechanics, RigidMechanics) and key in ("backlash_m", "screw_coulomb_nm"):
        return False
    if section == "friction" and key in _DRY:
        return made.section.varying != "command"
    if section == "servo" and key == "delay_s":
        return made.axis.servo is not None and made.axis.servo.sample_s > 0
    from_motor = made.parts is not None and key in ("actuator_gain", "command_limit", "speed_limit")
    return not from_motor or key in made.section.servo.model_fields_set


def _bounds(one: Number, made: FileAxis) -> tuple[float, float]:
    """Those of the field; of forces and damping, which may be 0 or have either sign, by the mass of the axis."""
    limit = _limit_from_mass(one.path, made)
    if limit is not None:
        signed = one.path[-1] in ("offset_n", "cogging")
        return (Fit(either_sign=limit) if signed else Fit(up_to=limit)).bounds(one.value)
    return (one.low, one.high) if one.high > one.low else (0.0, 1.0)


def _unit(one: Number, made: FileAxis) -> str:
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


def _limit_from_mass(path: Key, made: FileAxis) -> float | None:
    """How far a force, torque, damping or integral gain that may be 0 may go up."""
    key, mechanics = str(path[-1]), made.axis.mechanics
    mass = mechanics.mass_kg if isinstance(mechanics, RigidMechanics) else mechanics.table_mass_kg
    radius = mechanics.travel_per_motion
    lugre, servo = made.axis.friction.lugre, made.axis.servo
    if key in (*_DRY, "offset_n"):
        return _FRICTION_M_PER_S2 * mass
    if key == "cogging":
        return _FRICTION_M_PER_S2 * mass * radius
    if key in ("guide_damping_ns_per_m", "viscous_ns_per_m"):
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
