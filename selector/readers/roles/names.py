"""The name and the unit in a header cell, and which column a name means."""

from __future__ import annotations

import difflib
import functools
import re
import unicodedata
from collections.abc import Iterable, Sequence
from itertools import islice

from selector.csv_text import as_written
from selector.readers.layout import is_time_name
from selector.readers.tables import Column
from selector.units import parse_unit

_BRACKETED = re.compile(r"[\[(（【{<](?P<unit>[^\[\](){}（）]{0,20})[\])）】}>]")
_TRAILING = (
    re.compile(r"^(?P<name>.+?)\s+(?P<unit>(?:mm|m|in|l|r|U|u|1|rev|об|мм|л)/(?:min|s|h|мин))$"),
    re.compile(r"^(?P<name>.+?)\s*/\s*(?P<unit>[^/\s].{0,11})$"),
    re.compile(r"^(?P<name>.+?)\s*[,;:]\s+(?P<unit>\S{1,12}(?: \S{1,3})?)$"),
    re.compile(r"^(?P<name>.+?)\s+in\s+(?P<unit>\S{1,14})$", re.IGNORECASE),
    re.compile(
        r"^(?P<name>.+?)\s+(?P<unit>[°º˚℃℉µμ%]\S*|[Uu]/min|1/min|r/min|об/мин|"
        r"мкм|мм|mm|um|rpm|degC|degF|min-1|[Dd]eg ?[CF])$"
    ),
)
_SUFFIX = re.compile(r"^(?P<name>.+)[_.](?P<unit>[A-Za-zµμ°]+(?:_per_[a-z]+|/[a-z]+)?)$")
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
    in_brackets = [(_without(text, match), match["unit"].strip()) for match in _BRACKETED.finditer(text)]
    if in_brackets:
        # the name may have brackets of its own
        for name, unit in reversed(in_brackets):
            if unit and unit not in ("1", "-") and not unit.isdigit() and _is_unit(unit):
                return name or header, unit
        name, unit = in_brackets[-1]
        if unit in ("", "-"):
            return name or header, "1" if unit == "-" else None
        return header.strip(), None
    for pattern in _TRAILING:
        match = pattern.match(text)
        if match is not None and not match["unit"].isdigit() and _is_unit(match["unit"]):
            return match["name"].strip(), match["unit"].strip()
    match = _SUFFIX.match(text)
    if match is not None and _is_safe_suffix(match["name"], match["unit"], time):
        unit = _SLASH_WORDS.get(match["unit"].lower(), match["unit"])
        return match["name"].strip(), unit
    return header.strip(), None


def _without(text: str, match: re.Match[str]) -> str:
    return f"{text[: match.start()].rstrip()} {text[match.end() :].lstrip()}".strip()


def _is_unit(text: str) -> bool:
    return parse_unit(text) is not None


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


def printable_name(text: str) -> str:
    """A name on one line, as it can stand in a terminal, a table and a JSON file: at most 100 characters, never empty.

    Blanks and control characters become one blank; what is no character, such as a byte of a file name that is not
    UTF-8, becomes ``?``.
    """
    marked = "".join("?" if "\ud800" <= c <= "\udfff" else c if c.isprintable() else " " for c in text)
    return " ".join(marked.split())[:_LONGEST_NAME].strip() or "run"
