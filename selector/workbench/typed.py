"""What a person typed into a field: numbers with either decimal mark, and what is said of them in the fields' words."""

import math
import re
from collections.abc import Iterator
from pathlib import Path

from selector.errors import OptionError
from selector.text_file import rows_by_kind

#: Option of the command line → title of the field that does the same.
FIELDS = {option: title for option, (title,) in rows_by_kind(Path(__file__).with_name("field_titles.txt")).items()}

_LEAST = 1e-6
_AGAIN = "type it again; until then the earlier value counts, and this page starts nothing"
_OPTION = re.compile(r"(?P<mark>`?)(?P<option>--[a-z][a-z-]*[a-z])(?P=mark)")
_NUMBER = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)([eE][+-]?\d+)?")


def in_words_of_fields(text: str) -> str:
    """A message with the titles of fields in place of options.

    >>> in_words_of_fields("name the unit (or `--time-unit`); see --help")
    'name the unit (or “Unit of time”); see --help'
    """
    return _OPTION.sub(lambda of: f"“{FIELDS[of['option']]}”" if of["option"] in FIELDS else of[0], text)


def number(text: str | None, where: str, low: float = -math.inf, high: float = math.inf, unit: str = "") -> float:
    """The number that was typed, with a point or a comma, alone or with the unit of the field.

    Raises OptionError: It is none, or not within the limits.

    >>> number("0,98", "λ"), number(" 1e-3 ", "cost"), number("0,5 um/s", "fastest change", unit="µm/s")
    (0.98, 0.001, 0.5)
    """
    value = _value(_without_unit(text or "", unit))
    if value is None or not low <= value <= high:
        raise _refused(text, f"a number{_limits(low, high, unit)}, e.g. {_example(low, high)}", where)
    return value


def above_zero(text: str | None, where: str, unit: str = "") -> float | None:
    """The size that was typed; None where nothing was. Raises OptionError: it is none, or not above 0."""
    return number(text, where, _LEAST, unit=unit) if (text or "").strip() else None


def whole(text: str | None, where: str, least: int = 1) -> int:
    """The whole number that was typed. Raises OptionError: it is none, or too small."""
    value = _value(text or "")
    if value is None or value != int(value) or value < least:
        raise _refused(text, f"a whole number of at least {least}", where)
    return int(value)


def numbers(
    text: str | None, where: str, low: float = -math.inf, high: float = math.inf, unit: str = ""
) -> tuple[float, ...]:
    """The numbers that were typed, apart by blanks, semicolons, or commas where these are no decimal marks.

    Raises OptionError: One of them is no number or not within the limits, or it cannot be told which commas are decimal
    marks.

    >>> numbers("0,99 0,95", "λ"), numbers("0.99,0.95", "λ"), numbers("0,99; 0,95", "λ"), numbers("1, 0,95", "λ")
    ((0.99, 0.95), (0.99, 0.95), (0.99, 0.95), (1.0, 0.95))
    """
    found = [_value(word) for word in _words(_without_unit(text or "", unit))]
    values = tuple(value for value in found if value is not None and low <= value <= high)
    if not values or len(values) != len(found):
        example = _example(low, high)
        raise _refused(text, f"numbers{_limits(low, high, unit)}, e.g. {example}; several apart by blanks", where)
    return values


def _words(text: str) -> Iterator[str]:
    for word in re.split(r"[;\s]+|,\s+", text.strip(" ,;")):
        yield from word.split(",") if "." in word else [word]


def _value(text: str) -> float | None:
    text = text.strip()
    value = float(text.replace(",", ".")) if _NUMBER.fullmatch(text) else math.nan
    return value if math.isfinite(value) else None


def _without_unit(text: str, unit: str) -> str:
    """The text without the unit behind its numbers; a micro sign may be a mu or a u."""
    if not unit:
        return text
    return re.sub(rf"(?<=[\d.,])\s*{re.escape(unit).replace('µ', '[µμu]')}(?![\w/])", "", text)


def _limits(low: float, high: float, unit: str) -> str:
    if 0.0 < low <= _LEAST:
        # it only keeps 0 out
        said = f" above 0, at most {high:g}" if math.isfinite(high) else " above 0"
    elif math.isfinite(low) and math.isfinite(high):
        said = f" from {low:g} to {high:g}"
    else:
        said = f" of at least {low:g}" if math.isfinite(low) else ""
    return f"{said} {'' if said else 'in '}{unit}" if unit else said


def _example(low: float, high: float) -> str:
    return "0.98 or 0,98" if (low, high) == (0.0, 1.0) else "0.5 or 0,5" if high <= 1.0 else "2.5 or 2,5"


def _refused(text: str | None, expected: str, where: str) -> OptionError:
    found = f"“{text}” was typed" if text else "nothing was typed"
    return OptionError(found, expected=expected, where=where, advice=_AGAIN)
