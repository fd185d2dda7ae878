"""The only place where units are converted (pint underneath)."""

import functools
import unicodedata
from typing import Any

import numpy as np
import pint
from numpy.typing import NDArray

from selector.errors import UnitError

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

# Spellings seen in recordings, after NFKC folding, lower case and removal of blanks.
_SPELLINGS: dict[str, str] = {
    "°c": "degC", "c": "degC", "degc": "degC", "celsius": "degC", "degreec": "degC", "deg.c": "degC", "grdc": "degC",
    "gradc": "degC", "oc": "degC", "摄氏度": "degC", "度": "degC", "град.c": "degC", "°с": "degC", "с": "degC",
    "градc": "degC", "degreescelsius": "degC", "grad": "degC", "degrees_c": "degC", "deg_c": "degC",
    "mdegc": "millidegC", "m°c": "millidegC", "milli°c": "millidegC", "millidegc": "millidegC",
    "°f": "degF", "f": "degF", "degf": "degF", "fahrenheit": "degF", "deg_f": "degF", "deg.f": "degF",
    "k": "kelvin", "kelvin": "kelvin",
    "um": "um", "μm": "um", "micron": "um", "microns": "um", "мкм": "um", "微米": "um", "micrometer": "um",
    "micrometre": "um", "mkm": "um", "ミクロン": "um", "my": "um", "mu": "um",
    "mm": "mm", "мм": "mm", "毫米": "mm", "millimeter": "mm", "millimetre": "mm",
    "nm": "nm", "m": "m", "м": "m", "cm": "cm", "0.1um": "decimicron",
    "mil": "thou", "mils": "thou", "thou": "thou", "in": "inch", "inch": "inch", "inches": "inch", '"': "inch",
    "rpm": "rpm", "r/min": "rpm", "1/min": "rpm", "u/min": "rpm", "min-1": "rpm", "min^-1": "rpm", "rev/min": "rpm",
    "об/мин": "rpm", "转/分": "rpm", "/min": "rpm", "upm": "rpm", "r.p.m.": "rpm",
    "rad/s": "rad/s", "hz": "Hz", "1/s": "Hz", "rps": "revolution/s", "гц": "Hz",
    "mm/min": "mm/min", "m/min": "m/min", "mm/s": "mm/s", "m/s": "m/s", "мм/мин": "mm/min", "in/min": "inch/min",
    "ipm": "inch/min",
    "n": "N", "kn": "kN", "н": "N", "a": "A", "ma": "mA", "v": "V", "mv": "mV", "в": "V",
    "m/s^2": "m/s^2", "m/s2": "m/s^2", "g": "g_0", "mm/s^2": "mm/s^2", "mm/s2": "mm/s^2", "in/s": "inch/s",
    "in/s^2": "inch/s^2", "in/s2": "inch/s^2", "lbf": "lbf",
    "l/min": "liter/min", "l/h": "liter/hour", "m3/h": "m^3/hour", "m^3/h": "m^3/hour", "m^3/s": "m^3/s",
    "m3/s": "m^3/s", "л/мин": "liter/min",
    "hpa": "hPa", "mbar": "mbar", "kpa": "kPa", "pa": "Pa", "bar": "bar",
    "1": "1", "-": "1", "": "1", "bool": "1", "on/off": "1", "0/1": "1", "%": "percent",
    "s": "s", "sec": "s", "secs": "s", "second": "s", "seconds": "s", "sek": "s", "с.": "s", "сек": "s", "秒": "s",
    "ms": "ms", "msec": "ms", "millisecond": "ms", "milliseconds": "ms", "мс": "ms", "毫秒": "ms", "us": "us",
    "μs": "us", "ns": "ns", "millis": "ms",
    "min": "min", "mins": "min", "minute": "min", "minutes": "min", "мин": "min", "分": "min", "分钟": "min",
    "minuten": "min", "h": "hour", "hr": "hour", "hrs": "hour", "hour": "hour", "hours": "hour", "std": "hour",
    "stunden": "hour", "ч": "hour", "час": "hour", "小时": "hour", "時間": "hour", "d": "day", "day": "day",
    "days": "day",
}  # fmt: skip

_PINT_NAMES = frozenset(_SPELLINGS.values())


@functools.cache
def _registry() -> pint.UnitRegistry[float]:
    registry: pint.UnitRegistry[float] = pint.UnitRegistry(autoconvert_offset_to_baseunit=True, cache_folder=None)
    registry.define("decimicron = 0.1 * micrometer")
    registry.define("millidegC = 0.001 * kelvin; offset: 273.15")
    return registry


def parse_unit(text: str) -> str | None:
    """The pint name of a unit as people write it in files, or None when it is not known.

    >>> parse_unit("°C"), parse_unit("µm"), parse_unit("U/min"), parse_unit("PT01")
    ('degC', 'um', 'rpm', None)
    """
    folded = unicodedata.normalize("NFKC", text.strip().strip("[](){}")).strip()
    # NFKC turns MICRO SIGN into GREEK MU and RING ABOVE variants are common in GBK files.
    folded = folded.replace("º", "°").replace("˚", "°").replace("℃", "°C").replace("℉", "°F")
    # what was understood once is understood again, in the file that it is written to
    return _SPELLINGS.get(folded.replace(" ", "").lower(), text if text in _PINT_NAMES else None)


def unit_for_role(unit: str, role: str, *, where: str) -> str:
    """The pint name of `unit`, checked to have the dimension that `role` needs.

    Raises UnitError: the unit is unknown, or cannot be converted to the canonical unit of the role.
    """
    canonical = CANONICAL_UNITS[role]
    known = parse_unit(unit)
    if known is None:
        raise UnitError(
            f"unit {unit!r} is not known",
            expected=f"a unit that can be converted to {canonical}, the unit of role {role!r}",
            where=where,
            advice=f'correct the unit in the machine file, e.g. unit = "{canonical}"',
        )
    if not same_dimension(known, canonical):
        raise UnitError(
            f"unit {unit!r} does not fit role {role!r}",
            expected=f"a unit that can be converted to {canonical}",
            where=where,
            advice="correct the unit or the role of this channel in the machine file",
        )
    return known


def same_dimension(unit: str, other: str) -> bool:
    """Whether one unit can be converted to the other."""
    registry = _registry()
    rotation = {"rpm", "Hz", "rad/s", "revolution/s"}
    if unit in rotation and other in rotation:
        # pint calls rpm an angle per time and hertz a bare rate; a tachometer makes no such difference
        return unit == other or "rpm" in (unit, other) or "Hz" not in (unit, other)
    return bool(registry.Unit(unit).dimensionality == registry.Unit(other).dimensionality) and (
        (unit in rotation) == (other in rotation)
    )


def convert(values: NDArray[np.float64], unit: str, to: str) -> NDArray[np.float64]:
    """Values in another unit [pint names], float64; temperatures are readings, not differences.

    Raises UnitError: the two units have different dimensions.
    """
    array = np.asarray(values, dtype=np.float64)
    if unit == to:
        return array
    if unit == "Hz" and to == "rpm":
        return array * 60.0
    if unit == "rpm" and to == "Hz":
        return array / 60.0
    registry = _registry()
    try:
        quantity: Any = registry.Quantity(array, unit)
        return np.asarray(quantity.to(to).magnitude, dtype=np.float64)
    except pint.DimensionalityError as error:
        raise UnitError(
            f"{unit} cannot be converted to {to}",
            expected=f"a unit with the dimension of {to}",
            where="unit conversion",
            advice="correct the unit in the machine file",
        ) from error


def to_canonical(values: NDArray[np.float64], unit: str, role: str) -> NDArray[np.float64]:
    """Values [unit] as a recording holds them for this role, see `CANONICAL_UNITS`."""
    return convert(values, unit, CANONICAL_UNITS[role])
