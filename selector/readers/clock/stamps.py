"""Dates and times of day as loggers write them, and which clock numbers belong to."""

import re
from dataclasses import dataclass

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from selector.findings import Finding, Where
from selector.readers.finding_table import FINDINGS
from selector.types import Vector
from selector.units import convert, parse_unit, same_dimension

_MONTHS = (
    "jan feb mar apr may jun jul aug sep oct nov dec", "jän feb mär apr mai jun jul aug sep okt nov dez",
    "jan fev mrz avr mag giu lug ago set ott nov dic", "янв фев мар апр май июн июл авг сен окт ноя дек",
    "ene fév mär abr mai juin juil août sept out nov déc", "jan feb maa apr mei jun jul aug sep okt nov dec",
)  # fmt: skip
_MONTH_NUMBER = {name: i + 1 for row in _MONTHS for i, name in enumerate(row.split())}
_NOON = r"(?P<noon>[AaPp]\.?\s?[Mm]\.?|上午|下午|午前|午後)"
_NOON_BEFORE = _NOON.replace("noon", "noonb")
# ranges: what Unicode itself calls letters takes RE2 20 ms for every file
_LETTER = r"[A-Za-z\x{C0}-\x{D6}\x{D8}-\x{F6}\x{F8}-\x{1FFF}\x{2C00}-\x{D7FF}\x{F900}-\x{FEFE}]"
_DATE = (
    rf"(?:(?P<a>\d{{1,4}})(?P<s1>[-/.年 ]\s?)(?P<b>\d{{1,2}}|{_LETTER}{{3,10}}\.?)"
    r"(?P<s2>[-/.月 ]\s?)(?P<c>\d{1,4})[.日]?"
    r"|(?P<compact>[12]\d{3}[01]\d[0-3]\d)(?:[T_ -]?(?P<ch>[0-2]\d)(?P<cm>[0-5]\d)(?P<cs>[0-5]\d)(?:[.,]\d+)?)?"
    rf"|(?P<mb>{_LETTER}{{3,10}})\.?\s(?P<mday>\d{{1,2}}),?\s(?P<myear>\d{{4}}))"
)
_TIME = (
    rf"(?:{_NOON_BEFORE}\s?)?(?:(?P<days>\d+)\s?[dD](?:ays?)?,?\s+)?(?P<h>\d{{1,5}})[:h时時](?P<m>\d{{1,2}})"
    rf"(?:[:m分](?P<s>\d{{1,2}})(?:[.,:](?P<f>\d{{1,9}}))?)?[s秒分]?(?:\s?{_NOON})?"
)
_ZONE = r"\s?(?P<zone>Z|UTC|GMT|[+-]\d{2}:?\d{2}|[A-Z]{3,5})?"
_PATTERN_BOTH = rf"^(?:{_LETTER}{{2,3}}\.?,?\s)?{_DATE}(?:[T ,;_-]\s*{_TIME})?{_ZONE}$"
_PATTERN_TIME = rf"^{_TIME}{_ZONE}$"


@dataclass(frozen=True)
class Stamps:
    """Times read from text."""

    #: (n_rows,): Since `base_s` if `kind` has a date, otherwise since midnight or of elapsed time; NaN = not a time
    seconds: Vector
    #: Midnight of the first date, since 1970-01-01 UTC or in the local time of the file; exact. 0 without a date
    base_s: float
    kind: str  #: {"datetime", "date", "time"}: What the text holds
    zone_s: float | None  #: Offset from UTC of the first stamp [s], None if the file names no zone
    two_parts: bool  #: Whether a time of day has no seconds: 00:30 may be half an hour or half a minute
    findings: tuple[Finding, ...]  #: Ambiguous order of day and month


def stamps(cells: NDArray[np.object_], column: str, where: str, order: str | None, comma_file: bool) -> Stamps | None:
    """The times in a column of text, or None when fewer than half of its cells are times.

    `order` of day, month and year is what the user named; a decimal comma in the file speaks for day before month.
    """
    text = pa.array([None if c is None else str(c) for c in cells], pa.string())
    text = pc.utf8_trim(text, "\"'\u00a0\u202f \t")
    filled = len(text) - text.null_count
    if filled == 0:
        return None
    both = _parts(text, _PATTERN_BOTH) if _worth(text, _PATTERN_BOTH) else None
    if both is not None and _count(both) >= 0.5 * filled:
        return _with_date(both, column, where, order, comma_file)
    time = _parts(text, _PATTERN_TIME) if _worth(text, _PATTERN_TIME) else None
    if time is not None and _count(time) >= 0.5 * filled:
        seconds = _time_of_day(time)
        return Stamps(seconds, 0.0, "time", _first(_zone(time)), not _has(time, "s"), ())
    return None


def _worth(text: pa.Array, pattern: str) -> bool:
    """Whether any of some hundred cells fits, so that all are worth the search."""
    told = pc.drop_null(text)
    some = pc.take(told, pa.array(np.unique(np.linspace(0, len(told) - 1, min(300, len(told))).astype(np.int64))))
    parts = _parts(some, pattern)
    return parts is not None and _count(parts) >= 0.3 * len(some)


def _parts(text: pa.Array, pattern: str) -> pa.StructArray | None:
    try:
        return pc.extract_regex(text, pattern)
    except pa.ArrowInvalid:  # bytes that are no text for the pattern matcher
        return None


def _count(parts: pa.StructArray) -> int:
    return len(parts) - parts.null_count


def _field(parts: pa.StructArray, name: str) -> pa.Array:
    value = pc.struct_field(parts, name)
    return pc.if_else(pc.equal(value, ""), pa.scalar(None, pa.string()), value)


def _has(parts: pa.StructArray, name: str) -> bool:
    return _field(parts, name).null_count < len(parts)


def _number(parts: pa.StructArray, name: str) -> Vector:
    """The field as numbers; names of months become 1 to 12, anything else NaN."""
    value = _field(parts, name)
    try:
        return np.array(pc.cast(value, pa.float64()).to_numpy(zero_copy_only=False), dtype=np.float64)
    except pa.ArrowInvalid:
        return np.array([_month_or_number(v) for v in value.to_pylist()], dtype=np.float64)


def _month_or_number(text: str | None) -> float:
    if text is None:
        return np.nan
    if text.isascii() and text.isdigit():
        return float(text)
    folded = text.lower().strip(".")
    for length in (len(folded), 4, 3):
        if folded[:length] in _MONTH_NUMBER:
            return float(_MONTH_NUMBER[folded[:length]])
    return np.nan


def _time_of_day(parts: pa.StructArray) -> Vector:
    hour, minute = _number(parts, "h"), _number(parts, "m")
    second = np.nan_to_num(_number(parts, "s"))
    digits = _field(parts, "f")
    fraction = pc.cast(pc.binary_join_element_wise("0", digits, "."), pa.float64())
    part = np.nan_to_num(np.array(fraction.to_numpy(zero_copy_only=False), dtype=np.float64))
    for name in ("noon", "noonb"):
        mark = _field(parts, name)
        if mark.null_count == len(mark):
            continue
        after = pc.fill_null(pc.match_substring_regex(mark, "^([Pp]|下午|午後)"), False).to_numpy(zero_copy_only=False)
        before = pc.fill_null(pc.match_substring_regex(mark, "^([Aa]|上午|午前)"), False).to_numpy(zero_copy_only=False)
        hour = np.where(after & (hour < 12), hour + 12, np.where(before & (hour == 12), 0.0, hour))
    seconds = np.nan_to_num(_number(parts, "days")) * 86400 + hour * 3600 + minute * 60 + second + part
    out: Vector = np.where((minute < 60) & (second <= 60), seconds, np.nan)
    return out


def _zone(parts: pa.StructArray) -> Vector:
    texts = _field(parts, "zone")
    if texts.null_count == len(texts):
        return np.full(len(texts), np.nan)
    offsets = {text: _zone_offset_s(text) for text in pc.unique(texts).to_pylist()}
    return np.array([offsets[text] for text in texts.to_pylist()], dtype=np.float64)


def _zone_offset_s(text: str | None) -> float:
    if text is None:
        return np.nan
    match = re.fullmatch(r"([+-])(\d{2}):?(\d{2})", text)
    if match is None:
        # a name such as CET: local time, its offset is not known here
        return 0.0 if text in ("Z", "UTC", "GMT") else np.nan
    return (1 if match[1] == "+" else -1) * (int(match[2]) * 3600.0 + int(match[3]) * 60.0)


def _first(values: Vector) -> float | None:
    known = values[np.isfinite(values)]
    return float(known[0]) if len(known) else None


def _with_date(parts: pa.StructArray, column: str, where: str, order: str | None, comma_file: bool) -> Stamps:
    a, b, c = (_number(parts, name) for name in "abc")
    findings: list[Finding] = []
    noon = _has(parts, "noon") or _has(parts, "noonb")
    time = np.nan_to_num(_time_of_day(parts)) if _has(parts, "h") else np.zeros(len(a))
    if _has(parts, "h"):
        spoiled = np.isfinite(_number(parts, "h")) & ~np.isfinite(_time_of_day(parts))
        time = np.where(spoiled, np.nan, time)
    compact = _number(parts, "compact")
    told = np.isfinite(a)
    months = pc.unique(_field(parts, "b")).to_pylist()[:50]
    named_month = any(text is not None and not text.isdigit() for text in months)
    if not told.any() or np.nanmax(a) > 31:
        order = "ymd"
    elif named_month:
        order = "dmy"
    elif order is None or (order == "ymd" and np.nanmax(c) > 31):
        separator = next((s for s in _field(parts, "s1").to_pylist() if s), "/")
        order, findings = _order(a, b, c, time, separator.strip() or "/", noon, comma_file, column, where)
    year, month, day = {"ymd": (a, b, c), "dmy": (c, b, a), "mdy": (c, a, b)}[order]
    year = np.where(np.isfinite(compact), compact // 10000, year)
    month = np.where(np.isfinite(compact), compact // 100 % 100, month)
    day = np.where(np.isfinite(compact), compact % 100, day)
    for target, name in ((0, "myear"), (1, "mb"), (2, "mday")):
        value = _number(parts, name)
        if np.isfinite(value).any():
            year, month, day = (
                np.where(np.isfinite(value), value, old) if k == target else old
                for k, old in enumerate((year, month, day))
            )
    if _has(parts, "ch"):
        time = time + np.nan_to_num(_number(parts, "ch") * 3600 + _number(parts, "cm") * 60 + _number(parts, "cs"))
    zone = _zone(parts)
    midnight = epoch_s(year, month, day)
    base_s = _first(midnight) or 0.0
    # whole days are taken off before the time of day is added: 1.7e9 s would leave only 0.2 µs
    seconds = (midnight - base_s) + time - np.nan_to_num(zone)
    kind = "datetime" if _has(parts, "h") or _has(parts, "ch") else "date"
    return Stamps(seconds, base_s, kind, _first(zone), False, tuple(findings))


def epoch_s(year: Vector, month: Vector, day: Vector) -> Vector:
    """Seconds from 1970-01-01 to midnight of a day of the Gregorian calendar; NaN where there is no such day."""
    year = np.where(year < 70, year + 2000, np.where(year < 100, year + 1900, year))
    fine = (month >= 1) & (month <= 12) & (day >= 1) & (day <= 31) & (year >= 1600) & (year <= 2262)
    y, m, d = (np.where(fine, part, 1).astype(np.int64) for part in (year, month, day))
    months = ((y - 1970) * 12 + (m - 1)).astype("datetime64[M]")
    days = months.astype("datetime64[D]") + (d - 1)
    fine &= days.astype("datetime64[M]") == months
    out: Vector = np.where(fine, days.astype(np.int64) * 86400.0, np.nan)
    return out


def _order(
    a: Vector, b: Vector, c: Vector, time: Vector, separator: str, noon: bool, comma_file: bool, column: str, where: str
) -> tuple[str, list[Finding]]:
    """Which part is the day: by impossible dates, by the order in time of several dates, or by custom."""
    custom = "dmy" if separator == "." or comma_file or (separator == "-" and not noon) else "mdy"
    merits: dict[str, tuple[int, int, float]] = {}
    for name in (custom, "mdy" if custom == "dmy" else "dmy", "ymd"):
        if name == "ymd" and float(np.nanmax(c)) > 31:
            continue
        year, month, day = {"ymd": (a, b, c), "dmy": (c, b, a), "mdy": (c, a, b)}[name]
        moments = epoch_s(year, month, day)
        impossible = int((~np.isfinite(moments) & np.isfinite(a)).sum())
        moments = (moments + np.nan_to_num(time))[np.isfinite(moments)]
        span = float(np.ptp(moments)) if len(moments) else np.inf
        merits[name] = impossible, int((np.diff(moments) < 0).sum()), span
    best = min(merits, key=lambda name: merits[name])
    clear = [
        name for name, merit in merits.items() if merit[:2] == merits[best][:2] and merits[best][2] >= 0.2 * merit[2]
    ]
    chosen = next(name for name in merits if name in clear)
    excluded = {chosen} | ({"mdy"} if separator == "." else set())
    if np.array_equal(a, b, equal_nan=True) and chosen != "ymd":
        excluded |= {"dmy", "mdy"}
    rivals = [name for name in clear if name not in excluded]
    if not rivals:
        return chosen, []
    words = {"dmy": "day, month, year", "mdy": "month, day, year", "ymd": "year, month, day"}
    alternatives = " or as ".join(words[name] for name in rivals)
    single = all(abs(merits[name][2] - merits[chosen][2]) < 1.0 for name in rivals)
    told = f"The dates in column {column!r} of {where} were read as {words[chosen]}; they could be read as "
    told += f"{alternatives}."
    told += " Only the absolute start of the run depends on it, not the time within the run." if single else ""
    advice = f'date_order = "{rivals[0]}" under [time] in the machine file, or --date-order'
    evidence = {"read_as": chosen, "alternatives": rivals}
    advice = f"name the order of the date ({advice})"
    return chosen, [FINDINGS.finding("ambiguous-date", told, Where(channel=column), evidence, advice)]


_EXCEL_DAY_ZERO_S = -25569 * 86400.0
_MATLAB_DAY_ZERO_S = -719529 * 86400.0
_LABVIEW_ZERO_S = -2082844800.0
_FILETIME_ZERO_S = -11644473600.0
_DOTNET_ZERO_S = -62135596800.0


@dataclass(frozen=True)
class NumericClock:
    """Seconds since `base_s` [s since 1970-01-01], or of a relative clock when `base_s` is None."""

    seconds: Vector
    base_s: float | None
    unit: str
    sure: bool


def time_unit(text: str | None) -> str | None:
    """The pint name of a unit of time, or None; the Cyrillic letter that is °C elsewhere is a second here."""
    known = "s" if text == "\u0441" else parse_unit(text) if text else None
    return known if known is not None and same_dimension(known, "s") else None


def numeric_clock(values: Vector, unit: str | None) -> NumericClock:
    """Numbers of a time column in seconds.

    Without a unit, ranges tell the absolute clocks apart (epoch in s, ms, µs, ns; FILETIME; .NET ticks; LabVIEW's 1904;
    days of Excel and MATLAB; 20261120080000); anything else is taken for seconds, and `sure` is False.
    """
    if unit is not None:
        return NumericClock(convert(values, unit, "s"), None, unit, True)
    known = values[np.isfinite(values)]
    if len(known) == 0:
        return NumericClock(values, None, "s", False)
    absolute = _absolute(values, known)
    if absolute is not None:
        return absolute
    if _is_day_fraction(known):
        return NumericClock(np.round(values * 86400.0, 4), None, "day", False)
    return NumericClock(values, None, "s", False)


#: Where the numbers of a clock lie, in how many a second, from when they count [s since 1970], and its name.
_ABSOLUTE = (
    (5e8, 3.3e9, 1.0, 0.0, "epoch s"),
    (3.3e9, 4.3e9, 1.0, _LABVIEW_ZERO_S, "LabVIEW s since 1904"),
    (5e11, 4.2e12, 1e3, 0.0, "epoch ms"),
    (5e14, 4.2e15, 1e6, 0.0, "epoch us"),
    (1.15e17, 1.65e17, 1e7, _FILETIME_ZERO_S, "FILETIME"),
    (6.2e17, 6.7e17, 1e7, _DOTNET_ZERO_S, ".NET ticks"),
    (5e17, 4.2e18, 1e9, 0.0, "epoch ns"),
)


def _absolute(values: Vector, known: Vector) -> NumericClock | None:
    low, high = float(known.min()), float(known.max())

    def within(a: float, b: float) -> bool:
        return a <= low and high <= b

    for first, last, per_second, zero_s, unit in _ABSOLUTE:
        if within(first, last):
            # the first stamp is taken off in the file's own unit, where it is exact
            return NumericClock((values - known[0]) / per_second, float(known[0]) / per_second + zero_s, unit, True)
    if within(1.95e13, 2.2e13):
        return _digits(values)
    fractional = bool(np.any(known != np.round(known)))
    small_steps = len(known) > 1 and float(np.median(np.abs(np.diff(known)))) < 0.5
    if within(25_000, 75_000) and fractional and high - low < 400 and small_steps:
        return _days(values, known, _EXCEL_DAY_ZERO_S, "Excel days")
    if within(690_000, 780_000) and fractional and high - low < 400:
        return _days(values, known, _MATLAB_DAY_ZERO_S, "MATLAB days")
    return None


def _days(values: Vector, known: Vector, zero_s: float, unit: str) -> NumericClock:
    # days as float64 resolve about 1 µs; writers round to a millisecond at best
    first = float(np.floor(known[0]))
    return NumericClock(np.round((values - first) * 86400.0, 4), first * 86400.0 + zero_s, unit, True)


def _digits(values: Vector) -> NumericClock | None:
    """20261120080000 = 2026-11-20 08:00:00."""
    date, time = values // 1_000_000, values % 1_000_000
    midnight = epoch_s(date // 10000, date // 100 % 100, date % 100)
    seconds = midnight + time // 10000 * 3600 + time // 100 % 100 * 60 + time % 100
    finite = np.isfinite(seconds)
    if finite.sum() < 0.9 * np.isfinite(values).sum():
        return None
    base_s = float(midnight[finite][0])
    return NumericClock(seconds - base_s, base_s, "yyyymmddhhmmss", True)


def _is_day_fraction(known: Vector) -> bool:
    """Times of day as a spreadsheet holds them: below 1, in steps of whole seconds that are no round numbers."""
    if len(known) < 3 or known.min() < 0 or known.max() >= 1.0:
        return False
    steps = np.abs(np.diff(known))
    step = float(np.median(steps[steps > 0])) if np.any(steps > 0) else 0.0
    seconds = step * 86400.0
    whole = seconds >= 0.5 and abs(seconds - round(seconds)) < 1e-3 * max(1.0, seconds) and round(seconds) > 0
    return whole and abs(step * 1e5 - round(step * 1e5)) > 1e-3
