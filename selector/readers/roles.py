"""What a column measures, judged by its name, its unit and its numbers."""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from selector.readers.role_words import ROLE_WORDS
from selector.units import CANONICAL_UNITS, parse_unit, same_dimension

_PATTERNS = tuple((role, re.compile("|".join(words), re.IGNORECASE)) for role, words in ROLE_WORDS)
_PLACES = re.compile(
    r"spindle|spindel|bearing|lager|column|st[äa]nder|s[äa]ule|bed|bett|table|tisch|motor|coolant|k[üu]hl|oil|[öo]l\b|nut|mutter|"
    r"screw|housing|geh[äa]use|head(stock)?|nose|front|rear|vorn|hinten|wall|gear|getriebe|tank|hydraul|chiller|guide|"
    r"saddle|carriage|ram|turret|transf|cabinet|ref|主轴|轴承|床身|立柱|电机|丝杠|螺母|前|后|油|冷却|主軸|軸受|шпинд|подшип|станин|"
    r"стойк|двигат|масл|vřeten|ložis|wrzec|łożys|palier|broche|b[âa]ti|arri[èe]re|avant|moteur|huile|cojinete|husillo|mandrino|cuscinetto",
    re.IGNORECASE,
)
_UNIT_ROLES: tuple[tuple[str, str], ...] = (
    ("degC", "temperature"), ("rpm", "spindle_speed"), ("mm/min", "feed_rate"), ("N", "force"), ("A", "current"),
    ("V", "voltage"), ("m/s^2", "acceleration"), ("liter/min", "flow"), ("Hz", "frequency"),
)  # fmt: skip
_AXIS = re.compile(
    r"(?<![A-Za-z])(?:[dDeEuU]|delta|Delta|Δ|δ|disp|err|pos)?[ _.-]?(?P<axis>[XYZABCUVWxyz])(?:[ _-]?\d)?(?![A-Za-z])"
)


@dataclass(frozen=True)
class RoleGuess:
    """A role and where it came from.

    Attributes
    ----------
    role : str or None
        None when nothing speaks for any role.
    unit : str
        pint name of the unit of the values in the file.
    axis : str or None
        Machine axis in the name.
    guessed : tuple of str
        Which of "role", "unit", "axis" are not written in so many words.
    doubt : str or None
        What else it could be, in words, when the guess is uncertain.
    """

    role: str | None
    unit: str
    axis: str | None
    guessed: tuple[str, ...]
    doubt: str | None


def role_guess(name: str, unit: str | None, values: NDArray[np.float64], role: str | None = None) -> RoleGuess:
    """The role of a column; with `role` given, only its unit and axis are judged.

    Parameters
    ----------
    name : str
        Header without its unit.
    unit : str or None
        Unit as a pint name, None if the file names none.
    values : ndarray
        Its numbers, to tell a position in mm from an error in mm.
    """
    # "T1.2" is the second column called T1
    folded = re.sub(r"(?<=\w)\.\d{1,3}$", "", unicodedata.normalize("NFKC", name).strip())
    if role is not None:
        return _with_unit(role, folded, unit, None, ())
    named = [r for r, pattern in _PATTERNS if pattern.search(folded)]
    if unit is not None and unit != "1":
        return _by_unit(named, folded, unit, values)
    if not named:
        if _PLACES.search(folded) and _like_temperature(values):
            place = "the name says where, not what; the numbers look like temperatures"
            return _with_unit("temperature", folded, unit, place, ("role",))
        if _two_valued(values):
            only = None if unit == "1" else "nothing but its two values 0 and 1 says so"
            return _with_unit("state", folded, "1", only, ("role",))
        return RoleGuess(None, unit or "1", None, ("role",), None)
    first = named[0]
    doubt: str | None = None
    if unit == "1" and not same_dimension("1", CANONICAL_UNITS[first]):
        return _with_unit("state", folded, "1", f"its name could also mean {first}", ("role",))
    if first in ("temperature", "ambient") and not _like_temperature(values):
        rest = [r for r in named if r not in ("temperature", "ambient")]
        doubt = "its numbers are no usual temperatures"
        first = rest[0] if rest else first
    if len(folded) <= 2 and first in ("displacement", "spindle_speed", "velocity", "current", "voltage", "force"):
        doubt = f"a name of {len(folded)} letter(s) and no unit say little"
    if first == "spindle_speed" and _like_temperature(values) and _PLACES.search(folded) and not _is_speed_word(folded):
        return _with_unit("temperature", folded, unit, "the name says where, not what", ("role",))
    return _with_unit(first, folded, None, doubt, ("role",))


def role_of_numbers(values: NDArray[np.float64]) -> str:
    """The role that numbers alone speak for; to be told as a guess."""
    known = values[np.isfinite(values)]
    if _two_valued(values):
        return "state"
    return "temperature" if len(known) and known.min() >= 5 and known.max() <= 150 else "displacement"


def _is_speed_word(name: str) -> bool:
    return re.search(r"speed|rpm|dreh|速|оборот|^[ns]$", name, re.IGNORECASE) is not None


def _by_unit(named: list[str], name: str, unit: str, values: NDArray[np.float64]) -> RoleGuess:
    fitting = [role for role in named if _fits(unit, role)]
    if fitting:
        role = fitting[0]
        if role == "displacement" and unit != "um":
            return _length(name, unit, values, named)
        return _with_unit(role, name, unit, None, ("role",))
    if same_dimension(unit, "m"):
        return _length(name, unit, values, named)
    for typical, role in _UNIT_ROLES:
        if same_dimension(unit, typical):
            if role == "feed_rate" and unit in ("m/s", "mm/s"):
                role = "velocity"
            return _with_unit(role, name, unit, None, ("role",))
    if unit == "percent":
        return RoleGuess(None, unit, None, ("role",), None)
    return RoleGuess(None, unit, None, ("role",), None)


def _fits(unit: str, role: str) -> bool:
    if role == "state":
        return unit == "1"
    return same_dimension(unit, CANONICAL_UNITS[role])


def _length(name: str, unit: str, values: NDArray[np.float64], named: list[str]) -> RoleGuess:
    """A length is an error when it is in µm or small, a position when it is large."""
    per_mm = {"um": 1e-3, "mm": 1.0, "nm": 1e-6, "m": 1e3, "cm": 10.0, "inch": 25.4, "thou": 0.0254, "decimicron": 1e-4}
    known = values[np.isfinite(values)]
    span_mm = float(np.ptp(known)) * per_mm.get(unit, 1.0) if len(known) else 0.0
    small = unit in ("um", "nm", "thou", "decimicron") or span_mm < 1.5
    spoken = [r for r in named if r in ("displacement", "position", "position_command", "size", "amplitude")]
    if small and (not spoken or spoken[0] == "displacement"):
        plain = re.fullmatch(r"[XYZxyz]\d?", name) is not None and unit not in ("um", "nm", "thou", "decimicron")
        doubt = f"an axis letter in {unit} could also be a position; its span is {span_mm:.3g} mm" if plain else None
        return _with_unit("displacement", name, unit, doubt, ("role",))
    if spoken and spoken[0] != "displacement":
        return _with_unit(spoken[0], name, unit, None, ("role",))
    doubt = f"its span of {span_mm:.3g} mm is that of a position, its name could mean an error" if spoken else None
    return _with_unit("position", name, unit, doubt, ("role",))


def _with_unit(role: str, name: str, unit: str | None, doubt: str | None, guessed: tuple[str, ...]) -> RoleGuess:
    if unit is None or (unit == "1" and CANONICAL_UNITS[role] != "1"):
        unit = CANONICAL_UNITS[role]
        if role not in ("state",):
            guessed = (*guessed, "unit")
    axis = (
        _axis(name)
        if role in ("displacement", "position", "position_command", "velocity", "acceleration", "force")
        else None
    )
    return RoleGuess(role, unit, axis, (*guessed, *(("axis",) if axis else ())), doubt)


def _axis(name: str) -> str | None:
    match = _AXIS.search(name)
    return match["axis"].upper() if match else None


def _like_temperature(values: NDArray[np.float64]) -> bool:
    known = values[np.isfinite(values) & (np.abs(values) < 800)]
    return len(known) == 0 or (-40 <= float(np.median(known)) <= 250)


def _two_valued(values: NDArray[np.float64]) -> bool:
    known = values[np.isfinite(values)]
    return bool(len(known)) and bool(np.isin(known, (0.0, 1.0)).all())


def known_unit(text: str | None) -> str | None:
    """The pint name of a unit written in a file; ``-`` and the like mean dimensionless."""
    return parse_unit(text) if text is not None and text.strip() else None
