"""Ball-bar files → measured circles: a table with the angle and the deviation of the bar, or with two positions."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Literal

import numpy as np

from selector.findings import Finding, Where
from selector.physics.checks import errors_name
from selector.physics.drive.ball_bar.circle import BallBarTrace, middle_turn, positions_trace
from selector.readers.cells import is_time_name
from selector.readers.clock.stamps import time_unit
from selector.readers.files import recording_files, tables_of
from selector.readers.finding_table import FINDINGS
from selector.readers.roles.names import folded_name, name_and_unit, printable_name
from selector.readers.tables import Column, Overrides, Table
from selector.readers.text.encodings import decoded
from selector.readers.text.lines import refused
from selector.types import Indices, Mask, Vector
from selector.units import convert, parse_unit, same_dimension

Way = Literal[1, -1]

_CCW = (
    "ccw",
    "counterclockwise",
    "counter-clockwise",
    "anticlockwise",
    "anti-clockwise",
    "g3",
    "g03",
    "逆时针",
    "1",
    "+1",
)
_CW = ("cw", "clockwise", "g2", "g02", "顺时针", "-1", "−1")
_WAYS: dict[str, Way] = {**dict.fromkeys(_CCW, 1), **dict.fromkeys(_CW, -1)}
_ANGLE = re.compile(r"angle|theta|θ|φ|phi|winkel|угол|角", re.IGNORECASE)
_VALUES = (
    re.compile(r"dev|delta|abweich|отклон|偏差|^Δr$|^dr$", re.IGNORECASE),
    re.compile(r"radi|length|länge|laenge|радиус|半径|^r$", re.IGNORECASE),
    re.compile(r"error|误差", re.IGNORECASE),
)
_WAY = re.compile(r"^(dir(ection)?|sense|rotation|richtung|drehsinn|направление|方向)$", re.IGNORECASE)
_FEED = re.compile(r"feed|vorschub|подача|进给", re.IGNORECASE)
_SAID = re.compile(r"^[\W_]*(?P<name>[^\W\d_][^:=;,\t]*?)\s*[:=;,\t]+\s*(?P<value>[^\s;,\t].*?)[\s;,\t]*$")
_AMOUNT = re.compile(r"(?P<number>\d+(?:[.,]\d+)?)\s*(?P<unit>[^\s\d;,]+)?")
_LENGTH_SHARE = 0.5
_BACK_RAD = np.radians(10.0)  #: An angle that turns back by more belongs to another circle.


@dataclass(frozen=True)
class CircleOptions:
    """What the user says about ball-bar files; it counts more than what stands in them."""

    radius_m: float | None = None  #: Nominal length of the bar [m]
    feed_mm_per_min: float | None = None  #: Feed [mm/min]
    axes: tuple[str, str] | None = None  #: First and second axis, whose angle is 0 and 90°


@dataclass(frozen=True, eq=False)
class ReadCircle:
    """A measured circle and how it was read."""

    trace: BallBarTrace
    file: Path
    columns: tuple[str, ...]  #: Headings it was read from
    is_reversed: bool = False  #: Whether it stood sorted by angle, against its direction


@dataclass
class _Said:
    """What lines above a table say."""

    radius_m: float | None = None
    feed_mm_per_min: float | None = None
    direction: Way | None = None
    axes: tuple[str, str] | None = None
    findings: list[Finding] = field(default_factory=list)


def read_circles(
    paths: Sequence[Path], asked: CircleOptions | None = None
) -> tuple[tuple[ReadCircle, ...], tuple[Finding, ...]]:
    """The circles in files, and in the files of folders, and what was noticed of them.

    A table has a column of angles and one of deviations or lengths of the bar, both directions under one another (a
    column of the direction), side by side (columns cw and ccw), or a file each; or times and two positions. Radius,
    feed, direction and axes may stand in lines above it; without a direction the order of the angles tells it.

    Raises InputError: a file cannot be read, has no such table, or does not hold full circles.
    """
    found: list[ReadCircle] = []
    findings: list[Finding] = []
    files = recording_files(paths)
    for path in files.files:
        tables, _ = tables_of(path, Overrides())
        for table in tables:
            said = _said_above(path, table)
            found += _circles(table, said, asked or CircleOptions())
            findings += said.findings
    return tuple(found), (*files.findings, *findings)


def _said_above(path: Path, table: Table) -> _Said:
    """Radius, feed, direction and axes in the lines above the header of a text."""
    said = _Said()
    header = table.reading.get("header_row")
    if table.reading["format"] != "delimited" or not header:
        return said
    lines = decoded(path.read_bytes(), path.name).utf8.decode("utf-8").split("\n")[: header - 1]
    for match in filter(None, (_SAID.match(line) for line in lines)):
        name, unit_said = name_and_unit(match["name"])
        value = match["value"].strip().strip('"')
        amount = _AMOUNT.match(value)
        unit = parse_unit((amount["unit"] if amount else None) or unit_said or "")
        if _WAY.match(name) and folded_name(value) in _WAYS:
            said.direction = _WAYS[folded_name(value)]
        elif re.search(r"plane|axes|ebene|achsen|плоскость|оси|平面", name, re.IGNORECASE):
            letters = re.findall(r"[XYZUVW]\d?", value.upper())
            said.axes = (letters[0], letters[1]) if len(letters) == 2 else None
        elif amount and (_FEED.search(name) or re.search(r"radi|length|länge|радиус|半径", name, re.IGNORECASE)):
            number = np.array([float(amount["number"].replace(",", "."))])
            if _FEED.search(name):
                said.feed_mm_per_min = float(convert(number, _or(unit, "mm/min", "mm/min"), "mm/min")[0])
            else:
                said.radius_m = float(convert(number, _or(unit, "mm", "m"), "m")[0])
    return said


def _or(unit: str | None, otherwise: str, like: str) -> str:
    return unit if unit is not None and same_dimension(unit, like) else otherwise


def _circles(table: Table, said: _Said, asked: CircleOptions) -> Iterator[ReadCircle]:
    where = printable_name(table.file.name)
    columns = {column.header: name_and_unit(column.header, time=True)[0] for column in table.columns}
    by_header = {column.header: column for column in table.columns}

    def having(pattern: re.Pattern[str]) -> list[Column]:
        return [by_header[header] for header, name in columns.items() if pattern.search(name)]

    angles, feeds, ways = having(_ANGLE), having(_FEED), having(_WAY)
    times = [by_header[header] for header, name in columns.items() if is_time_name(name)]
    radius_m = asked.radius_m or said.radius_m
    if radius_m is None:
        raise refused(
            "no radius", "the nominal length of the bar", where,
            "give --radius in mm, or write a line such as 'Radius: 100 mm' above the table",
        )  # fmt: skip
    axes = asked.axes or said.axes
    named = [by_header[header] for header, name in columns.items() if name.upper() in (axes or ("X", "Y", "Z"))]
    if not angles and len(times) == 1 and len(named) == 2:
        names = (columns[named[0].header].upper(), columns[named[1].header].upper())
        yield _of_positions(table, times[0], named, names, radius_m, said)
        return
    free = [one for one in table.columns if one not in (*angles, *feeds, *ways, *times)]
    of_ways = [(one, _way_in(columns[one.header])) for one in free]
    plain = ([one for one in free if pattern.search(columns[one.header])] for pattern in _VALUES)
    values = [pair for pair in of_ways if pair[1]] or [(one, None) for one in next(filter(None, plain), [])]
    if len(angles) != 1 or not values or len({way for _, way in values}) != len(values):
        raise refused(
            f"the columns {', '.join(columns)[:200]}",
            "one with the angle of the bar and one with its deviation or length, or one of each direction (ccw, cw)",
            where, "name them e.g. angle_deg and deviation_um, or angle_deg, ccw_um and cw_um",
        )  # fmt: skip
    if axes is None:
        said.findings.append(
            FINDINGS.finding(
                "ball-bar-axes-assumed",
                f"Nothing says which axes {where} is of: X at 0° and Y at 90° were assumed.",
                Where(file=where),
            )
        )
    angle = _angles(angles[0], where)
    feed_of = _numbers(feeds[0], ("mm/min", "mm/min"), said, where) if feeds else None
    for value, of_column in values:
        deviation = _deviation(value, radius_m, said, where)
        known = np.isfinite(angle) & np.isfinite(deviation)
        said.findings += _left_out(known, where, value.header)
        pieces = [rows[known[rows]] for rows in _pieces(table, [*ways, *feeds])]
        if not ways and of_column is None and said.direction is None:
            pieces = [part for rows in pieces for part in _there_and_back(rows, angle)]
        for kept in pieces:
            if len(kept) < 2:
                raise refused(
                    f"{len(kept)} samples with one direction and one feed", "a full circle, 100 samples or more",
                    f"{where}, {value.header}", "correct these rows, or leave them out",
                )  # fmt: skip
            place = f"{where}, {value.header}, rows {kept.min() + 1} to {kept.max() + 1}"
            turned = np.unwrap(angle[kept])
            rising: Way = 1 if turned[-1] > turned[0] else -1
            way = of_column or (_direction(ways[0], kept[0], where) if ways else said.direction) or rising
            kept, turned = kept[:: way * rising], turned[:: way * rising]
            back = float(np.max(np.maximum.accumulate(way * turned) - way * turned))
            if back > _BACK_RAD:
                raise refused(
                    f"an angle that runs back by {np.degrees(back):.0f}°", "one circle in one direction", place,
                    "say each circle's direction and feed in columns of their own",
                )  # fmt: skip
            inside = middle_turn(turned, way)
            kept, turned = kept[inside], turned[inside]
            feed = asked.feed_mm_per_min or (said.feed_mm_per_min if feed_of is None else float(feed_of[kept[0]]))
            if feed is None and times and way == rising:
                feed = float(np.ptp(turned) / np.ptp(_seconds(times[0], where)[kept]) * radius_m * 60e3)
            if feed is None:
                raise refused(
                    "no feed", "the feed at which the circle was run", place,
                    "give --feed in mm/min, a column feed_mm_per_min, or a line 'Feed: 1000 mm/min' above the table",
                )  # fmt: skip
            with errors_name(place):
                trace = BallBarTrace(turned, deviation[kept], way, feed, radius_m, axes or ("X", "Y"))
            yield ReadCircle(trace, table.file, (angles[0].header, value.header), way != rising)


def _left_out(known: Mask, where: str, header: str) -> Iterator[Finding]:
    """Samples that are no finite numbers, and which; a column that ends before the others is no matter."""
    there = np.flatnonzero(known)
    rows = np.flatnonzero(~known) + 1
    rows = rows[(rows > there[0]) & (rows <= there[-1])] if len(there) else rows[:0]
    if len(rows):
        listed = ", ".join(map(str, rows[:5].tolist())) + (" …" if len(rows) > 5 else "")
        yield FINDINGS.finding(
            "ball-bar-samples-left-out",
            f"{len(rows)} of {len(known)} samples of {header!r} in {where} have no finite angle or value and were left "
            f"out: row{'s' * (len(rows) > 1)} {listed} of the table.",
            Where(file=where, channel=header),
            {"samples": len(rows), "of": len(known), "rows": rows[:100].tolist()},
        )


def _of_positions(
    table: Table, time: Column, positions: Sequence[Column], axes: tuple[str, str], radius_m: float, said: _Said
) -> ReadCircle:
    where = printable_name(table.file.name)
    first, second = (_numbers(one, ("m", "mm"), said, where) for one in positions)
    middle = tuple(float(np.ptp(one) / 2.0 + one.min()) for one in (first, second))
    time_s = _seconds(time, where)
    with errors_name(where):
        trace = positions_trace(time_s, first, second, radius_m=radius_m, centre_m=(middle[0], middle[1]), axes=axes)
    return ReadCircle(trace, table.file, tuple(one.header for one in (time, *positions)))


def _pieces(table: Table, columns: Sequence[Column]) -> Iterator[Indices]:
    """Rows that follow each other with one direction and one feed."""
    changed = np.zeros(len(table), dtype=np.bool_)
    for cells in (one.values.astype(str) for one in columns):
        changed[1:] |= cells[1:] != cells[:-1]
    for begin, end in pairwise([0, *np.flatnonzero(changed), len(table)]):
        yield np.arange(begin, end)


def _there_and_back(rows: Indices, angle: Vector) -> list[Indices]:
    """The rows of one circle, or of one and another back again."""
    turned = np.unwrap(angle[rows])
    farthest = int(np.argmax(np.abs(turned - turned[0]))) if len(rows) else 0
    is_back = len(rows) > 0 and abs(turned[-1] - turned[farthest]) > _BACK_RAD
    return [rows[: farthest + 1], rows[farthest:]] if is_back else [rows]


def _way_in(name: str) -> Way | None:
    words = re.split(r"[\s_.()]+", name.casefold())
    return next((_WAYS[word] for word in words if word in _WAYS and not word[-1:].isdigit()), None)


def _direction(column: Column, row: int, where: str) -> Way:
    cell = column.values[row]
    text = f"{cell:g}" if column.kind == "number" else str(cell)
    way = _WAYS.get(folded_name(text))
    if way is None:
        raise refused(
            f"direction {text[:40]!r}", "ccw or cw, or 1 or −1", f"{where}, {column.header}", "correct the cell"
        )
    return way


def _numbers(column: Column, units: tuple[str, str], said: _Said, where: str) -> Vector:
    """A column in the first of two units; without one it is in the second, which is told."""
    if column.kind != "number":
        raise refused(f"no numbers in {column.header!r}", "numbers", where, "correct the column")
    unit = column.unit or name_and_unit(column.header, time=True)[1]
    known = parse_unit(unit) if unit else None
    if known is not None and same_dimension(known, units[0]):
        return convert(column.values, known, units[0])
    statement = f"{column.header!r} of {where} has no unit: read as {units[1].replace('um', 'µm')}."
    said.findings.append(FINDINGS.finding("ball-bar-unit-assumed", statement, Where(file=where, channel=column.header)))
    return convert(column.values, units[1], units[0])


def _deviation(column: Column, radius_m: float, said: _Said, where: str) -> Vector:
    """Deviation [µm] from a column that holds it, or the whole length of the bar."""
    least = _LENGTH_SHARE * radius_m
    known = column.values[np.isfinite(column.values)] if column.kind == "number" else column.values[:0]
    unit = "mm" if len(known) and np.median(known) > least * 1e3 else "um"
    found = _numbers(column, ("um", unit), said, where)
    return found - radius_m * 1e6 if len(known) and np.nanmedian(found) > least * 1e6 else found


def _angles(column: Column, where: str) -> Vector:
    """Angles [rad]: a full circle is 6.28 or 360."""
    if column.kind != "number" or not np.isfinite(column.values).any():
        raise refused(f"no numbers in {column.header!r}", "angles in ° or rad", where, "correct the column")
    return column.values if np.ptp(column.values[np.isfinite(column.values)]) < 20.0 else np.radians(column.values)


def _seconds(column: Column, where: str) -> Vector:
    if column.kind != "number":
        raise refused(f"times that are no numbers in {column.header!r}", "seconds", where, "write the time in s")
    unit = time_unit(column.unit or name_and_unit(column.header, time=True)[1])
    return convert(column.values, unit or "s", "s")
