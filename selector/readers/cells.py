"""What one cell says: a number, a time, nothing, a broken sensor, or words."""

from __future__ import annotations

import functools
import re
import unicodedata

from selector.units import parse_unit

_MISSING = (
    "nan na n/a #n/a #na #nv #wert! #value! #ref! #div/0! #name? #null! #num! null none nil - -- --- ---- . .. ? ?? "
    "-nan nan(ind) -nan(ind) 1.#qnan -1.#qnan 1.#ind -1.#ind 1.#snan 1,#qnan -1,#qnan 1,#ind -1,#ind 1.#inf -1.#inf "
    "inf -inf +inf infinity -infinity void missing unavailable n.a. n.v. k.a. empty leer 无 欠測 нет invalid"
)
_BREAK = (
    "open opn o.c. oc brk break broken burnout b.out burn-out err error #err err! #error fault fail failed ol o.l. "
    "o.l +ol -ol over overflow overrange over-range ovr ovfl +over -over under underrange under-range short shorted "
    "rangeerr sensor-error discon disconnected offline no_sensor nosensor bad bruch fühlerbruch fuehlerbruch "
    "kurzschluss offen 断线 断路 开路 短路 故障 断線 обрыв кз ошибка авария ***** **** *** ** * +++++ ++++ +++ ----- "
    "------ ##### ###### ####### ######## >>>> <<<< >>>>> <<<<< lo hi"
)
MISSING_WORDS = frozenset(_MISSING.split())
"""Words that mean "no value", after trimming and lower case."""

BREAK_WORDS = frozenset(_BREAK.split())
"""Words that loggers write for a broken or saturated sensor, after trimming and lower case."""

BOOLEAN_WORDS = {
    "on": 1.0, "off": 0.0, "true": 1.0, "false": 0.0, "yes": 1.0, "no": 0.0, "ein": 1.0, "aus": 0.0, "an": 1.0,
    "ja": 1.0, "nein": 0.0, "wahr": 1.0, "falsch": 0.0, "вкл": 1.0, "выкл": 0.0, "да": 1.0, "开": 1.0, "关": 0.0,
    "是": 1.0, "否": 0.0, "auf": 1.0, "zu": 0.0, "closed": 0.0, "running": 1.0, "stopped": 0.0, "start": 1.0,
    "stop": 0.0, "オン": 1.0, "オフ": 0.0, "active": 1.0, "inactive": 0.0, "run": 1.0, "high": 1.0, "low": 0.0,
}  # fmt: skip
"""Words of two-valued columns."""

_POINT = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][+-]?\d{1,4})?")
_COMMA = re.compile(r"[+-]?(?:\d+,?\d*|,\d+)(?:[eEdD][+-]?\d{1,4})?")
_THOUSANDS_POINT = re.compile(r"[+-]?\d{1,3}(?:[ '’_\u00a0\u202f]\d{3})+(?:\.\d+)?|[+-]?\d{1,3}(?:,\d{3})+(?:\.\d+)?")
_THOUSANDS_COMMA = re.compile(r"[+-]?\d{1,3}(?:[ '’_\u00a0\u202f]\d{3})+(?:,\d+)?|[+-]?\d{1,3}(?:\.\d{3})+(?:,\d+)?")
_CLOCK = r"\d{1,4}[:h]\d{1,2}(?:[:m]\d{1,2}(?:[.,:]\d{1,9})?)?s?"
_NOON = r"(?:[ap]\.?\s?m\.?|上午|下午|午前|午後)"
_ZONE = r"(?:Z|UTC|GMT|[+-]\d{2}:?\d{2}|[A-Z]{3,5})"
_DATE = (
    r"(?:\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4}\.?|\d{1,4}[- ][^\W\d_]{3,10}\.?[- ,]+\d{1,4}"
    r"|\d{2,4}年\d{1,2}月\d{1,2}日|[^\W\d_]{3,10}\.? \d{1,2},? \d{4}"
    r"|[12]\d{3}[01]\d[0-3]\d[T_ -][0-2]\d[0-5]\d[0-5]\d(?:[.,]\d+)?)"
)
_TIME = re.compile(
    rf"(?:(?:[^\W\d_]{{2,3}},? )?{_DATE}(?:[T ,;_]\s*{_NOON}?\s?{_CLOCK}\s?{_NOON}?)?\s?{_ZONE}?"
    rf"|{_NOON}?\s?{_CLOCK}\s?{_NOON}?\s?{_ZONE}?|\d{{1,2}}时\d{{1,2}}分(?:\d{{1,2}}秒)?|(?:\d+\s?d(?:ays?)?,?\s)?{_CLOCK})",
    re.IGNORECASE,
)
_WITH_UNIT = re.compile(r"([+-]?[\d.,]*\d[\d.,]*(?:[eE][+-]?\d+)?)\s*([^\d\s.,+-][^\d,;]{0,11})")


def is_number(text: str, decimal: str) -> bool:
    """Whether a trimmed cell is a number with this decimal mark."""
    return (_COMMA if decimal == "," else _POINT).fullmatch(text) is not None


def is_grouped_number(text: str, decimal: str) -> bool:
    """Whether a trimmed cell is a number whose thousands are set apart, such as ``1.234,5`` or ``1'234.5``."""
    return (_THOUSANDS_COMMA if decimal == "," else _THOUSANDS_POINT).fullmatch(text) is not None


def is_time(text: str) -> bool:
    """Whether a trimmed cell is a date, a time of day, or both."""
    return 3 < len(text) < 60 and _TIME.fullmatch(text) is not None


def number_and_unit(text: str) -> tuple[str, str] | None:
    """The two parts of a cell such as ``21,5 °C``, or None."""
    match = _WITH_UNIT.fullmatch(text)
    return (match[1], match[2].strip()) if match else None


def folded_word(text: str) -> str:
    """A cell as it is compared with the word lists."""
    return unicodedata.normalize("NFKC", text).strip().strip("\"'").strip().lower()


@functools.lru_cache(maxsize=20_000)
def cell_kind(text: str, decimal: str) -> str:
    """``"empty"``, ``"number"``, ``"time"``, ``"missing"``, ``"break"`` or ``"text"``."""
    cell = text.strip().strip('"').strip()
    if not cell:
        return "empty"
    if is_number(cell, decimal):
        return "number"
    if len(cell) > 80:
        return "text"
    if is_time(cell):
        return "time"
    word = folded_word(cell)
    if word in MISSING_WORDS:
        return "missing"
    if word in BREAK_WORDS:
        return "break"
    if is_grouped_number(cell, decimal) or is_number(plain_digits(cell), decimal):
        return "number"
    parts = number_and_unit(cell)
    if parts is not None and is_number(parts[0], decimal) and parse_unit(parts[1]) is not None:
        return "number"
    return "text"


def plain_digits(text: str) -> str:
    """Full-width digits and typographic minus signs as ASCII."""
    return unicodedata.normalize("NFKC", text).replace("−", "-").replace("–", "-").strip()
