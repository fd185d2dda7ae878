"""klippy.log → tables: what Klipper notes of a printer every second, and what its probe found."""

import re
from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime, timedelta
from functools import cache, partial
from pathlib import Path

import numpy as np

from selector.errors import ReadError
from selector.readers.finding_table import FINDINGS
from selector.readers.tables import Column, Overrides, Table, checked_size, checked_width, reading_of, unique_headers

_HEAD = re.compile(
    rb"^(Starting Klippy\.\.\.|Args: \[.*klippy\.py|=+ (Config file =|Log rollover at )|Stats \d+\.\d: )", re.MULTILINE
)
_START = re.compile(r"Start printer at (.{1,40}) \(\d+\.\d+ (\d+\.\d+)\)")
_STATS = re.compile(r"Stats (\d+\.\d+): ")
_TEMPERATURE = re.compile(r"(\S{1,80}): (?:target=\S{1,20} )?temp=(-?\d+(?:\.\d+)?)(?=\s|$)")
_NUMBER = r"(-?\d+(?:\.\d+)?)"
_PROBED = re.compile(rf"(?:// )?(?:Result:? |probe:? )(?:at {_NUMBER},{_NUMBER} )?.*?\bz={_NUMBER}")
_SAME_PLACE_MM, _MOST_PLACES = 0.5, 1000


def is_klippy_log(head: bytes) -> bool:
    """Whether a file that begins so is a log of Klipper's."""
    return _HEAD.search(head) is not None


def read_klippy(path: Path, data: bytes, overrides: Overrides) -> list[Table]:
    """One table a start of the printer: temperatures [°C] a line ``Stats``, and Z [µm] where something was probed.

    Z falls from 0 by what the probed height has risen since the first probing, which is what the nozzle came down. Only
    the place that was probed most often counts: elsewhere, as for a mesh, the bed has another height. A printer that is
    started anew is homed anew, and so has another zero.

    Raises ReadError if there are no two lines ``Stats`` with a temperature.
    """
    lines = data.decode("utf-8", "replace").splitlines()
    starts = [number for number, line in enumerate(lines) if _START.match(line)]
    parts = zip([0, *starts], [*starts, len(lines)], strict=True)
    tables = [table for a, b in parts if (table := _table(path, lines[a:b], a)) is not None]
    if not tables:
        raise ReadError(
            f"a log of Klipper's with {sum(bool(_STATS.match(line)) for line in lines)} lines Stats",
            expected="two at least, with temperatures, of one start of the printer",
            where=path.name,
            advice="record while a heater is on or the printer moves: Klipper writes such lines only then",
        )
    if len(tables) == 1:
        return tables
    told = f"{path.name} has {len(tables)} starts of the printer; what followed each was read as a run of its own."
    first, *others = (replace(one, name=f"{one.name}_{k}") for k, one in enumerate(tables, start=1))
    finding = FINDINGS.finding("starts-are-runs", told, evidence={"starts": len(tables)})
    return [replace(first, findings=(finding, *first.findings)), *others]


def _table(path: Path, lines: Sequence[str], before: int) -> Table | None:
    """What follows one start of the printer; `before` lines precede it in the file."""
    rows: list[tuple[int, float, dict[str, float]]] = []
    place, heights = 0j, dict[complex, dict[int, float]]()
    unique, most = cache(partial(unique_headers, where=path.name)), ()
    for number, line in enumerate(lines, start=before + 1):
        if stats := _STATS.match(line):
            if found := _TEMPERATURE.findall(line):
                # a heater and a sensor may share a name
                headers, values = zip(*found, strict=True)
                told = dict(zip(unique(headers)[0], map(float, values), strict=True))
                rows.append((number, float(stats[1]), told))
                most = max(most, headers, key=len)
        elif probed := _PROBED.match(line):
            place = place if probed[1] is None else complex(float(probed[1]), float(probed[2]))
            is_new = place not in heights and len(heights) < _MOST_PLACES
            near = next((of for of in heights if abs(of - place) < _SAME_PLACE_MM), place) if is_new else place
            heights.setdefault(near, {})[len(rows)] = float(probed[3])
    if len(rows) < 2:
        return None
    numbers, times, temperatures = zip(*rows, strict=True)
    names = list(dict.fromkeys(name for told in temperatures for name in told))
    checked_width(len(names), path.name)
    checked_size(len(names) * len(rows), path.name)
    columns = [Column(name, np.array([told.get(name, np.nan) for told in temperatures]), "°C") for name in names]
    findings = list(unique(most)[1])
    if heights:
        at, z_mm = max(heights.items(), key=lambda one: len(one[1]))
        z_um, zero_mm = np.full(len(rows), np.nan), next(iter(z_mm.values()))
        z_um[np.minimum(list(z_mm), len(rows) - 1)] = [round(1000.0 * (zero_mm - one), 3) for one in z_mm.values()]
        columns.append(Column("Z", z_um, "µm"))
        if len(heights) > 1:
            said = f"Z is what was probed at x = {at.real:g} mm, y = {at.imag:g} mm, {len(z_mm)} times, most often; "
            said += f"left out is what was probed elsewhere (places: {len(heights) - 1})."
            findings.append(FINDINGS.finding("probed-elsewhere", said, evidence={"x_mm": at.real, "y_mm": at.imag}))
    time_s, reading = np.array(times) - times[0], reading_of("klippy", encoding="utf-8")
    start = _wall_clock(lines[0], times[0])
    return Table(path.stem, path, tuple(columns), reading, tuple(findings), np.array(numbers), time_s, start)


def _wall_clock(line: str, at_s: float) -> np.datetime64 | None:
    """Local time at a time of Klipper's clock [s], by the line in which the printer starts."""
    start = _START.match(line)
    try:
        told = datetime.strptime(start[1], "%a %b %d %H:%M:%S %Y") if start else None
        return np.datetime64(told + timedelta(seconds=at_s - float(start[2])), "ms") if start and told else None
    except (ValueError, OverflowError):
        return None
