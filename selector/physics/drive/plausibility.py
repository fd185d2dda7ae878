"""Which numbers of a model file has no machine, and in which other unit would they be usual: slips of units."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from selector.findings import Finding, Where
from selector.physics.drive.drive_model import DriveModel
from selector.physics.drive.parameter_bounds import unit_of_key
from selector.physics.model_text import Key, key_text, plain_values

KV = 1000.0 / 60.0
"""1 m/(min·mm), the workshop's unit of the Kv factor, in 1/s."""


@dataclass(frozen=True)
class Usual:
    """Between which numbers machines lie, and in which units people think beside that of the key.

    Attributes
    ----------
    low, high : float
        Least and most that is usual, in the unit of the key; 0 is always allowed: it switches something off.
    units : mapping of str to float
        Another unit → how many of the unit of the key it is; the likeliest first.
    """

    low: float
    high: float
    units: Mapping[str, float]


_INERTIA = Usual(1e-7, 0.5, {"kg·cm²": 1e-4, "kg·mm²": 1e-6, "g·cm²": 1e-7})
_DIAMETER = Usual(3.0, 500.0, {"m": 1e3, "cm": 10.0})
_BALL = Usual(0.5, 50.0, {"m": 1e3, "cm": 10.0})
_ERROR = Usual(0.0, 2e-3, {"µm": 1e-6, "mm": 1e-3})
_TIME = Usual(1e-6, 0.05, {"ms": 1e-3, "µs": 1e-6})
_MASS = Usual(5.0, 1e5, {"t": 1e3, "g": 1e-3})

USUAL: Mapping[str, Usual] = {
    "servo.position_gain_per_s": Usual(6.0, 600.0, {"m/(min·mm)": KV, "1/min": 1.0 / 60.0}),
    "servo.sample_s": _TIME,
    "servo.delay_s": _TIME,
    "sensing.scale_resolution_m": Usual(0.0, 1e-3, {"µm": 1e-6, "mm": 1e-3, "nm": 1e-9}),
    "mechanics.table_mass_kg": _MASS,
    "mechanics.motor_inertia_kg_m2": _INERTIA,
    "mechanics.screw_inertia_kg_m2": _INERTIA,
    "mechanics.lead_m": Usual(5e-4, 0.2, {"mm": 1e-3}),
    "mechanics.torsional_stiffness_nm_per_rad": Usual(50.0, 1e7, {"kN·m/rad": 1e3, "N·mm/rad": 1e-3}),
    "mechanics.axial_stiffness_n_per_m": Usual(1e6, 1e10, {"N/µm": 1e6, "N/mm": 1e3}),
    "transmission.backlash_m": _ERROR,
    "transmission.pitch_amplitude_m": _ERROR,
    "table.mass_kg": _MASS,
    "motor.inertia_kg_m2": _INERTIA,
    "motor.torque_constant_nm_per_a": Usual(0.01, 50.0, {"mN·m/A": 1e-3}),
    "motor.top_speed_rpm": Usual(50.0, 6e4, {"1/s": 60.0}),
    "coupling.inertia_kg_m2": _INERTIA,
    "coupling.stiffness_nm_per_rad": Usual(50.0, 1e7, {"kN·m/rad": 1e3, "N·mm/rad": 1e-3}),
    "coupling.diameter_mm": _DIAMETER,
    "coupling.shear_modulus_gpa": Usual(10.0, 300.0, {"Pa": 1e-9, "N/mm²": 1e-3, "TPa": 1e3}),
    "screw.inertia_kg_m2": _INERTIA,
    "screw.diameter_mm": _DIAMETER,
    "screw.root_diameter_mm": _DIAMETER,
    "screw.lead_mm": Usual(0.5, 200.0, {"m": 1e3, "µm": 1e-3}),
    "screw.length_mm": Usual(20.0, 5e4, {"m": 1e3, "µm": 1e-3}),
    "screw.modulus_gpa": Usual(20.0, 700.0, {"Pa": 1e-9, "N/mm²": 1e-3, "TPa": 1e3}),
    "screw.shear_modulus_gpa": Usual(10.0, 300.0, {"Pa": 1e-9, "N/mm²": 1e-3, "TPa": 1e3}),
    "screw.density_kg_per_m3": Usual(1000.0, 2e4, {"g/cm³": 1e3}),
    "nut.preload_n": Usual(10.0, 1e6, {"kN": 1e3}),
    "nut.rigidity_n_per_um": Usual(5.0, 2e4, {"N/m": 1e-6, "N/mm": 1e-3, "kN/µm": 1e3}),
    "nut.ball_diameter_mm": _BALL,
    "nut.pitch_circle_mm": _DIAMETER,
    "bearings.preload_n": Usual(10.0, 1e6, {"kN": 1e3}),
    "bearings.rigidity_n_per_um": Usual(5.0, 2e4, {"N/m": 1e-6, "N/mm": 1e-3, "kN/µm": 1e3}),
    "bearings.ball_diameter_mm": _BALL,
    "bearings.pitch_circle_mm": _DIAMETER,
    "guide.friction_coefficient": Usual(0.0, 0.5, {"%": 0.01}),
    "motion.acceleration_m_per_s2": Usual(1e-3, 200.0, {"mm/s²": 1e-3}),
    "motion.jerk_m_per_s3": Usual(1e-3, 1e5, {"mm/s³": 1e-3}),
}
"""Section and key of the file → what is usual."""


def unlikely_values(model: DriveModel) -> tuple[Finding, ...]:
    """Warnings on numbers that the file says and that no machine has; each with the unit that was perhaps meant."""
    said = plain_values(model.file)
    found = [one for path, value in _numbers(said, ()) if (one := _unlikely(path, value)) is not None]
    for name, axis in model.file_axes.items():
        found += _odd_effects(name, axis.axis.friction.directions, [one.share for one in axis.axis.ripple])
    return tuple(found)


def _unlikely(path: Key, value: float) -> Finding | None:
    usual = USUAL.get(f"{path[-2]}.{path[-1]}") if len(path) > 1 else None
    if usual is None or value == 0 or usual.low <= abs(value) <= usual.high:
        return None
    key, unit = key_text(path), {"1": ""}.get(unit_of_key(str(path[-1])), unit_of_key(str(path[-1])))
    meant = next(
        ((name, value * times) for name, times in usual.units.items() if usual.low <= abs(value * times) <= usual.high),
        None,
    )
    said = f"{key} is {value:.6g} {unit}".rstrip() + f"; machines have {_range(usual)} {unit}".rstrip() + "."
    if meant is not None:
        said += f" {value:.6g} {meant[0]} would be {meant[1]:.6g} {unit}".rstrip() + "."
    evidence = {"key": key, "value": value, "low": usual.low, "high": usual.high, "perhaps": meant and meant[1]}
    return Finding(
        "unlikely-value",
        "warning",
        said,
        Where(channel=str(path[1]) if path[0] == "axes" else None),
        evidence,
        "correct it if it is a slip" if meant is None else f"write {key} = {meant[1]:.6g} if {meant[0]} was meant",
    )


def _range(usual: Usual) -> str:
    return f"up to {usual.high:g}" if usual.low == 0 else f"{usual.low:g} to {usual.high:g}"


def _odd_effects(
    name: str, directions: tuple[tuple[float, float], tuple[float, float]], shares: list[float]
) -> Iterator[Finding]:
    for (sliding, static), way in zip(directions, ("positive", "negative"), strict=True):
        if static < sliding:
            yield Finding(
                "breakaway-below-sliding",
                "warning",
                f"Breakaway friction of {name} in the {way} direction, {static:.6g} N, is below its sliding friction, "
                f"{sliding:.6g} N: friction rises with the speed.",
                Where(channel=name),
                {"static_n": static, "coulomb_n": sliding},
                "exchange static_n and coulomb_n, or leave static_n out",
            )
    for number, share in enumerate(shares):
        if abs(share) >= 1.0:
            yield Finding(
                "ripple-beyond-force",
                "warning",
                f"Ripple {number + 1} of {name} is {abs(share):.3g} times the force of the actuator, which it turns "
                "round at times.",
                Where(channel=name),
                {"share": share},
                "give its amplitude as a share: 0.02 for 2 %",
            )


def _numbers(value: Any, path: Key) -> Iterator[tuple[Key, float]]:
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from _numbers(inner, (*path, key))
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield path, float(value)
