"""The only place where units are converted (pint underneath)."""

import functools
import unicodedata
from pathlib import Path
from typing import Any

import numpy as np
import pint

from selector.errors import UnitError
from selector.text_file import rows_by_kind
from selector.types import Array

#: The unit in which a recording holds each role: SI, but °C, µm, rpm and mm/min where the field thinks in them.
CANONICAL_UNITS: dict[str, str] = {
    "temperature": "degC",
    "ambient": "degC",
    "displacement": "um",
    "spindle_speed": "rpm",
    "feed_rate": "mm/min",
    "position_command": "m",
    "position": "m",
    "velocity": "m/s",
    "force": "N",
    "current": "A",
    "voltage": "V",
    "acceleration": "m/s^2",
    "flow": "m^3/s",
    "state": "1",
    "size": "um",
    "amplitude": "um",
    "frequency": "Hz",
}

ROLES: tuple[str, ...] = tuple(CANONICAL_UNITS)

#: Spelling → unit as pint calls it; nothing at all is a number without a unit.
_SPELLINGS = {"": "1"} | {
    spelled: unit
    for unit, rows in rows_by_kind(Path(__file__).with_name("unit_spellings.txt")).items()
    for spelled in " ".join(rows).split()
}
_PINT_NAMES = frozenset(_SPELLINGS.values())


@functools.cache
def _registry() -> pint.UnitRegistry[float]:
    registry: pint.UnitRegistry[float] = pint.UnitRegistry(autoconvert_offset_to_baseunit=True, cache_folder=None)
    registry.define("decimicron = 0.1 * micrometer")
    for part, of_a_degree in (("deci", 0.1), ("centi", 0.01), ("milli", 0.001)):
        registry.define(f"{part}degC = {of_a_degree} * kelvin; offset: 273.15")
    return registry


def parse_unit(text: str) -> str | None:
    """The pint name of a unit as people write it in files, or None when it is not known.

    >>> parse_unit("°C"), parse_unit("µm"), parse_unit("U/min"), parse_unit("PT01")
    ('degC', 'um', 'rpm', None)
    """
    folded = unicodedata.normalize("NFKC", text.strip().strip("[](){}")).strip()
    # NFKC turns MICRO SIGN into GREEK MU and RING ABOVE variants are common in GBK files.
    folded = folded.replace("º", "°").replace("˚", "°").replace("℃", "°C").replace("℉", "°F").replace(" ", "")
    # what was understood once is understood again, in the file that it is written to
    return _SPELLINGS.get(folded) or _SPELLINGS.get(folded.lower(), text if text in _PINT_NAMES else None)


def unit_for_role(unit: str, role: str, *, where: str) -> str:
    """The pint name of `unit`, checked to have the dimension that `role` needs.

    Raises UnitError: the unit is unknown, or cannot be converted to the canonical unit of the role.
    """
    canonical = CANONICAL_UNITS[role]
    known = parse_unit(unit)
    if known is None:
        raise UnitError(
            f"unit {unit!r} is not known", where=where,
            expected=f"a unit that can be converted to {canonical}, the unit of role {role!r}",
            advice=f'correct this unit, e.g. to "{canonical}"',
        )  # fmt: skip
    if not same_dimension(known, canonical):
        raise UnitError(
            f"unit {unit!r} does not fit role {role!r}", expected=f"a unit that can be converted to {canonical}",
            where=where, advice="correct this unit, or the role of the channel",
        )  # fmt: skip
    return known


@functools.lru_cache(maxsize=1024)
def same_dimension(unit: str, other: str) -> bool:
    """Whether one unit can be converted to the other."""
    registry = _registry()
    rotation = {"rpm", "Hz", "rad/s", "revolution/s", "krpm"}
    if unit in rotation and other in rotation:
        # pint calls rpm an angle per time and hertz a bare rate; a tachometer makes no such difference
        return unit == other or "rpm" in (unit, other) or "Hz" not in (unit, other)
    return bool(registry.Unit(unit).dimensionality == registry.Unit(other).dimensionality) and (
        (unit in rotation) == (other in rotation) or {unit, other} == {"Hz", "kHz"}
    )


def convert(values: Array, unit: str, to: str) -> Array:
    """Values in another unit [pint names], float64; temperatures are readings, not differences.

    Decimals that the calculation only nearly meets, 19.430000000000007 for 194.3 tenths of a degree, are met.

    Raises UnitError: the two units have different dimensions.
    """
    array = np.asarray(values, dtype=np.float64)
    if unit == to:
        return array
    if {unit, to} == {"Hz", "rpm"}:
        return array * 60.0 if to == "rpm" else array / 60.0
    if not same_dimension(unit, to):
        raise UnitError(
            f"{unit} cannot be converted to {to}", expected=f"a unit with the dimension of {to}",
            where="unit conversion", advice="correct the unit in the machine file",
        )  # fmt: skip
    quantity: Any = _registry().Quantity(array, unit)
    found = np.asarray(quantity.to(to).magnitude, dtype=np.float64)
    return _on_decimals(found, _THROUGH_K if to in ("degC", "degF") else 0.0)


_THROUGH_K = 300.0  #: Temperatures are converted through kelvin, whose roundings they keep.


def _on_decimals(values: Array, through: float) -> Array:
    """Values of so few decimals that chance would not meet them, without the roundings of a calculation `through`."""
    finite = values[np.isfinite(values)]
    rounding = 4.0 * np.spacing(np.maximum(np.abs(finite), through))
    for decimals in range(16):
        if not len(finite) or 10.0**-decimals < 100.0 * rounding.max():
            break
        few = slice(None, 200)
        if (np.abs(np.round(finite[few], decimals) - finite[few]) <= rounding[few]).all() and (
            np.abs(np.round(finite, decimals) - finite) <= rounding
        ).all():
            return np.round(values, decimals)
    return values


def to_canonical(values: Array, unit: str, role: str) -> Array:
    """Values [unit] as a recording holds them for this role, see `CANONICAL_UNITS`."""
    return convert(values, unit, CANONICAL_UNITS[role])
