"""The name and the unit in a header cell, which column a name means, and what the column measures."""

import difflib
import functools
import re
import unicodedata
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from selector.csv_text import as_written
from selector.readers.cells import is_time_name
from selector.readers.tables import Column
from selector.text_file import rows_by_kind
from selector.types import Array
from selector.units import CANONICAL_UNITS, parse_unit, same_dimension

_BRACKETED = re.compile(r"[\[(（【{<](?P<unit>[^\[\](){}（）]{0,20})[\])）】}>]")
_TRAILING = (
    re.compile(r"^(?P<name>.+?)\s+(?P<unit>(?:mm|m|in|l|r|U|u|1|rev|об|мм|л)/(?:min|s|h|мин))$"),
    re.compile(r"^(?P<name>.+?)\s*/\s*(?P<unit>[^/\s].{0,11})$"),
    re.compile(r"^(?P<name>.+?)\s*[,;:]\s+(?P<unit>\S{1,12}(?: \S{1,3})?)$"),
    re.compile(r"^(?P<name>.+?)\s+in\s+(?P<unit>\S{1,14})$", re.IGNORECASE),
    re.compile(
        r"^(?P<name>.+?)\s+(?P<unit>[°º˚℃℉µμ%]\S*|[Uu]/min|1/min|r/min|об/мин|"
        r"мкм|мм|mm|um|rpm|degC|degF|min-1|[Dd]eg ?[CF]|[Cc]elsius|[Ff]ahrenheit|[Kk]elvin|inch|mil|thou|[Mm]icrons?|"
        r"(?<!\d )(?:k?Hz|rps|k[Rr][Pp][Mm]|kN|kgf|daN|Nm|m[AV]|k[AV]|m?m/s\^?2))$"
    ),
)
_SUFFIX = re.compile(r"^(?P<name>.+?)[_.](?P<unit>[A-Za-zµμ°]+(?:_per_[a-z]+|/[a-z]+)?)$")
_LAST_WORD = re.compile(r"^(?P<name>t|..+)[\s_]+(?P<unit>[^\W\d_]+\.?)$")
_TORQUE = re.compile(r"torque|moment|couple|момент", re.IGNORECASE)
_NUMBERED = re.compile(r"\.\d{1,3}$")  #: What is put behind a name that stands twice.
_SUFFIXES = (
    "um µm μm mm nm degc degf rpm celsius kelvin fahrenheit min sec secs seconds minutes hours ms mil thou inch hz kn "
    "micron microns °c °f mm_per_min m_per_s mm_per_s l_per_min mm/min m/min mm/s m/s l/min r/min u/min 1/min"
)
_SAFE_SUFFIXES = frozenset(_SUFFIXES.split())
_SLASH_WORDS = {"mm_per_min": "mm/min", "m_per_s": "m/s", "mm_per_s": "mm/s", "l_per_min": "l/min"}

_COMPARED_NAMES = 2_000
_COMPARED_LENGTH = 200
_LONGEST_NAME = 100


@functools.lru_cache(maxsize=4096)
def name_and_unit(header: str, *, time: bool = False) -> tuple[str, str | None]:
    """The name without its unit, and the unit as written, or None.

    >>> name_and_unit("T1 [°C]"), name_and_unit("Z_um"), name_and_unit("Dia/T2"), name_and_unit("n (1/min)")
    (('T1', '°C'), ('Z', 'um'), ('Dia/T2', None), ('n', '1/min'))

    With `time`, one-letter suffixes such as ``t_s`` count as units too.
    """
    text = unicodedata.normalize("NFKC", header).strip()
    in_brackets = [
        (f"{text[: match.start()].rstrip()} {text[match.end() :].lstrip()}".strip(), match["unit"].strip())
        for match in _BRACKETED.finditer(text)
    ]
    if in_brackets:
        # the name may have brackets of its own
        for name, unit in reversed(in_brackets):
            if unit and unit not in ("1", "-") and not unit.isdigit() and parse_unit(unit):
                return name or header, unit
        name, unit = in_brackets[-1]
        if unit in ("", "-"):
            return name or header, "1" if unit == "-" else None
        return header.strip(), None
    for pattern in _TRAILING:
        match = pattern.match(text)
        if match is not None and not match["unit"].isdigit() and parse_unit(match["unit"]):
            return match["name"].strip(" ,;") or header.strip(), match["unit"].strip()
    match = _LAST_WORD.match(text)
    if match is not None and is_time_name(match["name"]) and same_dimension(parse_unit(match["unit"]) or "1", "s"):
        return match["name"], match["unit"]
    text, mark, number = text.rpartition(".") if _NUMBERED.search(text) else (text, "", "")
    match = _SUFFIX.match(text)
    if match is not None and _is_safe_suffix(match["name"], match["unit"], time):
        unit = _SLASH_WORDS.get(match["unit"].lower(), match["unit"])
        return f"{match['name'].strip()}{mark}{number}", unit
    return header.strip(), None


def _is_safe_suffix(name: str, suffix: str, time: bool) -> bool:
    """Whether ``name_suffix`` ends in a unit; single letters only where the name says what they are."""
    folded = suffix.lower()
    if folded in _SAFE_SUFFIXES:
        return True
    if folded in ("s", "h", "d", "us", "ns"):
        return time or is_time_name(name)
    if folded in ("c", "f", "k"):
        return re.match(r"^(t|temp.*|pt|tc)[ _-]?\w*$", name, re.IGNORECASE) is not None and suffix.isupper()
    if suffix in ("A", "V", "N"):
        return re.match(r"^(i|u|f|current|voltage|force|strom|spannung|kraft)\w*$", name, re.IGNORECASE) is not None
    return suffix == "m" and re.match(r"^(x|y|z|pos|position)\w*$", name, re.IGNORECASE) is not None


def folded_name(text: str) -> str:
    """A name for comparison: compatibility forms, case, blanks and underscores do not count."""
    return re.sub(r"[\s_]+", "", unicodedata.normalize("NFKC", text)).casefold()


def found_column(columns: Sequence[Column], name: str) -> Column | None:
    """The column that `name` means: its header exactly, then without its unit, then apart from case and blanks."""
    position = found_header([column.header for column in columns], name)
    return None if position is None else columns[position]


def found_header(headers: Sequence[str], name: str) -> int | None:
    """Position of the header that `name` means, or None when there is none or more than one."""
    name = as_written(name)
    for form in (lambda text: text, str.strip, lambda text: name_and_unit(text)[0], folded_name):
        wanted = {form(name), name}
        hits = [i for i, header in enumerate(headers) if form(header) in wanted]
        if len(hits) == 1:
            return hits[0]
    bare = folded_name(name)
    hits = [i for i, header in enumerate(headers) if folded_name(name_and_unit(header)[0]) == bare]
    return hits[0] if len(hits) == 1 else None


def closest(name: str, among: Iterable[str]) -> str | None:
    """The nearest of some names, or None when none is near; of long lists of long names only the beginnings count.

    Comparing takes about a microsecond per pair of characters, so that this is for one name in one message: where many
    names are missing, ask for the first few only.
    """
    wanted = folded_name(name)[:_COMPARED_LENGTH]
    folded = {folded_name(candidate)[:_COMPARED_LENGTH]: candidate for candidate in islice(among, _COMPARED_NAMES)}
    near = difflib.get_close_matches(wanted, folded, n=1, cutoff=0.5)
    return folded[near[0]] if near else None


def one_of_words(name: str, known: Iterable[str]) -> str:
    """What a name that is none of these should have been: the nearest of them, and all."""
    names = list(known)
    near = closest(name, names)
    return (f"{near!r} perhaps; " if near else "") + "one of " + ", ".join(names)


def printable_name(text: str) -> str:
    """A name on one line, as it can stand in a terminal, a table and a JSON file: at most 100 characters, never empty.

    Blanks and control characters become one blank; what is no character, such as a byte of a file name that is not
    UTF-8, becomes ``?``.
    """
    marked = "".join("?" if "\ud800" <= c <= "\udfff" else c if c.isprintable() else " " for c in text)
    return " ".join(marked.split())[:_LONGEST_NAME].strip() or "run"


#: What is said in a name → the expression for it: roles, of which the first counts most; places; the spindle itself.
_PATTERNS = {
    kind: re.compile("|".join(rows), re.IGNORECASE)
    for kind, rows in rows_by_kind(Path(__file__).with_name("role_words.txt")).items()
}
_PLACES, _SPINDLE = _PATTERNS.pop("place"), _PATTERNS.pop("spindle")
HOTTEST = 250.0  #: Beyond this [°C] nothing on a machine tool is a temperature
_UNIT_ROLES: tuple[tuple[str, str], ...] = (
    ("degC", "temperature"), ("rpm", "spindle_speed"), ("mm/min", "feed_rate"), ("N", "force"), ("A", "current"),
    ("V", "voltage"), ("m/s^2", "acceleration"), ("liter/min", "flow"), ("Hz", "frequency"),
)  # fmt: skip
_AXIS = re.compile(
    r"(?<![A-Za-z])(?:[dDeEuU]|delta|Delta|Δ|δ|disp|err|pos)?[ _.-]?(?P<axis>[XYZABCUVWxyz])(?:[ _-]?\d)?(?![A-Za-z])"
)

_SPEED_WORD = re.compile(r"speed|rpm|dreh|速|оборот|^[ns]$", re.IGNORECASE)
_ALONG_AN_AXIS = ("displacement", "position", "position_command", "velocity", "acceleration", "force")


@dataclass(frozen=True)
class RoleGuess:
    """A role and where it came from."""

    role: str | None  #: None when nothing speaks for any role
    unit: str  #: pint name of the unit of the values in the file
    axis: str | None  #: Machine axis in the name
    guessed: tuple[str, ...]  #: Which of "role", "unit", "axis" are not written in so many words
    doubt: str | None  #: What else it could be, in words, when the guess is uncertain


def role_guess(name: str, unit: str | None, values: Array, role: str | None = None) -> RoleGuess:
    """The role of a column; with `role` given, only its unit and axis are judged.

    `name` is the header without its unit, `unit` a pint name; the numbers tell a position in mm from an error in mm.
    """
    # "T1.2" is the second column called T1
    folded = re.sub(r"(?<=\w)\.\d{1,3}$", "", unicodedata.normalize("NFKC", name).strip())
    if role is not None:
        return _with_unit(role, folded, unit, None, ())
    named = [r for r, pattern in _PATTERNS.items() if pattern.search(folded)]
    # in a log in capitals
    unit = "N*m" if unit == "nm" and _TORQUE.search(folded) else unit
    if unit is not None and unit != "1":
        return _by_unit(named, folded, unit, values)
    if not named:
        if _SPINDLE.fullmatch(folded) and _up_to(values) > HOTTEST:
            why = "the name says where, not what; the numbers look like speeds"
            return _with_unit("spindle_speed", folded, unit, why, ("role",))
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
    if first in ("temperature", "ambient") and _two_valued(values):
        return _with_unit("state", folded, "1", f"its name could also mean {first}", ("role",))
    if first in ("temperature", "ambient") and not _like_temperature(values):
        rest = [r for r in named if r not in ("temperature", "ambient")]
        doubt = "its numbers are no usual temperatures"
        first = rest[0] if rest else first
    if len(folded) <= 2 and first in ("displacement", "spindle_speed", "velocity", "current", "voltage", "force"):
        doubt = f"a name of {len(folded)} letter(s) and no unit say little"
    is_place = _PLACES.search(folded) and not _SPEED_WORD.search(folded)
    if first == "spindle_speed" and _like_temperature(values) and is_place:
        return _with_unit("temperature", folded, unit, "the name says where, not what", ("role",))
    return _with_unit(first, folded, None, doubt, ("role",))


def role_of_numbers(values: Array) -> str:
    """The role that numbers alone speak for; to be told as a guess."""
    known = values[np.isfinite(values)]
    if _two_valued(values):
        return "state"
    return "temperature" if len(known) and known.min() >= 5 and known.max() <= 150 else "displacement"


def _by_unit(named: list[str], name: str, unit: str, values: Array) -> RoleGuess:
    fitting = [r for r in named if (unit == "1" if r == "state" else same_dimension(unit, CANONICAL_UNITS[r]))]
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
    return RoleGuess(None, unit, None, ("role",), None)


def _length(name: str, unit: str, values: Array, named: list[str]) -> RoleGuess:
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
        if role != "state":
            guessed = (*guessed, "unit")
    match = _AXIS.search(name) if role in _ALONG_AN_AXIS else None
    axis = match["axis"].upper() if match else None
    return RoleGuess(role, unit, axis, (*guessed, *(("axis",) if axis else ())), doubt)


def _up_to(values: Array) -> float:
    """What one reading in twenty is beyond: a spike or a break code is no range."""
    known = values[np.isfinite(values)]
    return float(np.quantile(known, 0.95)) if len(known) else 0.0


def _like_temperature(values: Array) -> bool:
    known = values[np.isfinite(values) & (np.abs(values) < 800)]
    return len(known) == 0 or (-40 <= float(np.median(known)) <= HOTTEST)


def _two_valued(values: Array) -> bool:
    known = values[np.isfinite(values)]
    return bool(len(known)) and bool(np.isin(known, (0.0, 1.0)).all())


def known_unit(text: str | None) -> str | None:
    """The pint name of a unit written in a file; ``-`` and the like mean dimensionless."""
    return parse_unit(text) if text is not None and text.strip() else None
