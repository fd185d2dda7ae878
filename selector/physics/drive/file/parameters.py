"""Which numbers of a feed drive could be fitted again: named, with unit and bounds."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping
from typing import Any

from selector.physics.drive.file.model_axes import FileAxis, file_axis
from selector.physics.drive.file.model_file import checked_model_file
from selector.physics.drive.file.model_schema import DriveFile
from selector.physics.drive.parts.mechanics import RigidMechanics
from selector.physics.model_parameters import Number, Parameter, file_with, parameters_of
from selector.physics.model_text import Key

_UNITS = (
    ("_nms_per_rad", "N·m·s/rad"), ("_nm_per_rad", "N·m/rad"), ("_nm_per_a", "N·m/A"), ("_ns_per_m", "N·s/m"),
    ("_n_per_um", "N/µm"), ("_n_per_m", "N/m"), ("_m_per_s2", "m/s²"), ("_m_per_s3", "m/s³"), ("_m_per_s", "m/s"),
    ("_kg_per_m3", "kg/m³"), ("_kg_m2", "kg·m²"), ("_um_per_m", "µm/m"), ("_mm_per_min", "mm/min"), ("_per_s", "1/s"),
    ("_kg", "kg"), ("_nm", "N·m"), ("_n", "N"), ("_mm", "mm"), ("_um", "µm"), ("_m", "m"), ("_rad", "rad"),
    ("_deg", "°"), ("_gpa", "GPa"), ("_rpm", "r/min"), ("_hz", "Hz"), ("_s", "s"),
)  # fmt: skip
_TURNING = {"kg": "kg·m²", "N·s/m": "N·m·s/rad", "N/m": "N·m/rad", "N": "N·m", "m/s": "rad/s", "m": "rad"}

OUTPUT_UNITS = {"current": "A", "voltage": "V", "force": "N", "number": ""}
"""``output`` of an axis in the model file → unit of what its control puts out; none where it is a mere number."""

_TIMES = 10.0
_OFF = {
    "backlash_m": 1e-3,
    "pitch_amplitude_m": 1e-4,
    "fading_speed_m_per_s": 0.1,
    "delay_s": 0.02,
    "velocity_feedforward": 2.0,
    "acceleration_feedforward": 2.0,
}
"""Keys that may be 0, which switches something off, and how far at least they may go up."""

_EITHER_SIGN = {"pitch_slope": 1e-3, "share": 0.5, "pitch_phase_rad": math.pi, "phase_rad": math.pi}
_BETWEEN = {
    "stribeck_speed_m_per_s": (1e-4, 0.5),
    "stribeck_exponent": (0.5, 4.0),
    "contact_angle_deg": (15.0, 75.0),
    "conformity": (0.505, 0.6),
    "rigidity_share": (0.1, 1.0),
}
_FRICTION_M_PER_S2 = 3.0
"""No dry friction of a machine's guides is larger than 0.3 of the weight."""

_DAMPING_PER_S = 10.0
"""No guide stops a table within less than a tenth of a second by viscous friction alone."""

_OF_CRITICAL = 0.2


def parameter_bounds(path: Key, value: float, made: FileAxis) -> tuple[float, float]:
    """Lower and upper bound of the parameter at a path below its axis.

    A tenth and ten times the value; from 0 where 0 switches something off, and then up to what a machine of this mass
    could have: 0.3 of its weight of dry friction, damping that stops it in 0.1 s, a fifth of critical damping in its
    springs, 1 mm of backlash, 0.1 mm of pitch error, 20 ms of delay. Always around the value.
    """
    key = str(path[-1])
    low, high = value / _TIMES, value * _TIMES
    off = _OFF.get(key) or _off_from_mass(path, made)
    sign = _EITHER_SIGN.get(key) or _sign_from_mass(path, made)
    if key in _BETWEEN:
        low, high = _BETWEEN[key]
    elif sign is not None:
        high = max(sign, _TIMES * abs(value))
        low = -high
    elif off is not None:
        low, high = 0.0, max(off, _TIMES * value)
    elif value <= 0.0:
        low, high = 0.0, 1.0
    return min(low, value), max(high, value)


def unit_of_parameter(path: Key, made: FileAxis) -> str:
    """The unit of the parameter at a path below its axis; gains, limits and cogging by what turns and what acts.

    ``A·s/rad`` of the velocity gain of a motor that turns and is given a current; ``V·s/m`` of one mass and a voltage.
    """
    key = str(path[-1])
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
    if key in by_axis:
        return by_axis[key]
    unit = unit_of_key(key)
    return _TURNING.get(unit, unit) if made.rotary else unit


def unit_of_key(key: str) -> str:
    """The unit that the name of a key carries; "1" if none.

    >>> unit_of_key("guide_damping_ns_per_m"), unit_of_key("velocity_gain")
    ('N·s/m', '1')
    """
    return next((unit for end, unit in _UNITS if key.endswith(end)), "1")


def _off_from_mass(path: Key, made: FileAxis) -> float | None:
    """How far a force, torque or damping that may be 0 may go up."""
    key, mechanics = str(path[-1]), made.axis.mechanics
    rigid = isinstance(mechanics, RigidMechanics)
    mass = mechanics.mass_kg if isinstance(mechanics, RigidMechanics) else mechanics.table_mass_kg
    radius = mechanics.travel_per_motion
    lugre, servo = made.axis.friction.lugre, made.axis.servo
    if key in ("coulomb_n", "coulomb_negative_n", "static_n", "static_negative_n"):
        return _FRICTION_M_PER_S2 * mass
    if key in ("guide_damping_ns_per_m", "viscous_ns_per_m"):
        return _DAMPING_PER_S * mass
    if path[-2:] == ("lugre", "damping_ns_per_m") and lugre is not None:
        return 2.0 * math.sqrt(lugre.stiffness_n_per_m * mass)
    if key == "velocity_integral_gain" and servo is not None:
        return 200.0 * servo.velocity_gain
    if rigid or isinstance(mechanics, RigidMechanics):
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


def _sign_from_mass(path: Key, made: FileAxis) -> float | None:
    mechanics = made.axis.mechanics
    if isinstance(mechanics, RigidMechanics):
        force = _FRICTION_M_PER_S2 * mechanics.mass_kg
    else:
        force = _FRICTION_M_PER_S2 * mechanics.table_mass_kg
    if path[-1] == "offset_n":
        return force
    return force * mechanics.travel_per_motion if path[-1] == "cogging" else None


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
    unless ``[bounds]`` says otherwise. Errors as `parameters_of`.
    """
    return parameters_of(file, _numbers(file))


def with_parameters(file: DriveFile, values: Mapping[str, float]) -> DriveFile:
    """The model file with other values of some parameters, see `file_with`."""
    return file_with(file, values, _numbers(file), checked_model_file)


def _numbers(file: DriveFile) -> Iterator[Number]:
    for name, section in file.axes.items():
        made = file_axis(section)
        for path, value in _values(made):
            bounds, unit = parameter_bounds(path, value, made), unit_of_parameter(path, made)
            yield Number(("axes", name, *path), value, *bounds, unit)


def _values(made: FileAxis) -> Iterator[tuple[Key, float]]:
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
