"""Touch-off file → what the probe found when; strict, because a wrong cell would move the correction."""

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path

from selector.csv_text import as_written
from selector.errors import ReadError
from selector.readers.roles.names import printable_name
from selector.readers.text.encodings import decoded
from selector.readers.text.lines import cells_of, is_comment

MOST_BYTES = 20_000_000
LARGEST_UM = 1e6
_NUMBER = re.compile(r"[+-]?(\d+([.]\d*)?|[.]\d+)([eE][+-]?\d+)?")
_EXAMPLE = "a header such as run,time_s,Z and below it one row a touch-off"
_SLACK_S = 1e-6


@dataclass(frozen=True)
class TouchOff:
    """One reading of the probe."""

    time_s: float  #: From the start of the run
    displacement_um: float


def read_touch_offs(
    path: Path, durations_s: Mapping[str, float], responses: Collection[str]
) -> dict[str, dict[str, tuple[TouchOff, ...]]]:
    """Response → run → touch-offs in the order of time, from text with the columns run, time_s and one a response [µm].

    An empty cell is a response that was not probed. `durations_s` has the runs that there are.

    Raises
    ------
    ReadError
        The file cannot be read, a column or a run is not known, a cell holds no number, or a time is not in its run.
    """
    name = printable_name(path.name)
    rows, comma = _rows(path, name)
    probed = _responses(rows[0][1], responses, f"{name}, line {rows[0][0]}")
    found: dict[str, dict[str, list[TouchOff]]] = {one: {} for one in probed}
    for line, cells in rows[1:]:
        where = f"{name}, line {line}"
        if len(cells) != len(rows[0][1]):
            raise _error(f"{len(cells)} cells", f"{len(rows[0][1])}, as in the header", where, "complete the row")
        row = dict(zip(rows[0][1], cells, strict=True))
        run = as_written(row["run"])
        if run not in durations_s:
            raise _error(
                f"run {run[:60]!r}", "one of the runs " + ", ".join(list(durations_s)[:20]), where,
                "write the name of the run as `selector describe` shows it",
            )  # fmt: skip
        time_s = _number(row["time_s"], "time", where, comma)
        if not -_SLACK_S <= time_s <= durations_s[run] + _SLACK_S:
            raise _error(
                f"time {time_s:g} s", f"0 to {durations_s[run]:g} s, the length of run {run}", where,
                "count the time from the start of the run, in seconds",
            )  # fmt: skip
        for one in probed:
            if row[one]:
                um = _number(row[one], one, where, comma)
                if abs(um) > LARGEST_UM:
                    raise _error(f"{um:g} µm of {one}", "a displacement in µm", where, "correct the cell")
                found[one].setdefault(run, []).append(TouchOff(time_s, um))
    return {
        one: {run: tuple(sorted(of, key=lambda touch: touch.time_s)) for run, of in runs.items()}
        for one, runs in found.items()
    }


def _rows(path: Path, name: str) -> tuple[list[tuple[int, list[str]]], bool]:
    """Line numbers and cells, the header first; whether a comma is a decimal mark."""
    if not path.is_file():
        found = "a folder" if path.is_dir() else "no such file" if not path.exists() else "not a regular file"
        raise _error(found, "a text file", name, "name the file with the touch-offs")
    if path.stat().st_size > MOST_BYTES:
        raise _error(f"{path.stat().st_size / 1e6:.0f} MB", f"at most {MOST_BYTES / 1e6:.0f} MB", name, _EXAMPLE)
    data = path.read_bytes()
    text = decoded(data, name).utf8.decode("utf-8") if data.strip() else ""
    lines = [(i, line) for i, line in enumerate(text.split("\n"), start=1) if line.strip(' \t\r;,"')]
    lines = [(i, line) for i, line in lines if not is_comment(line)]
    if len(lines) < 2:
        raise _error("no touch-off", _EXAMPLE, name, "write the touch-offs into the file")
    mark = next((mark for mark in (";", "\t", ",") if mark in lines[0][1]), ",")
    rows = [(number, cells_of(line.rstrip("\r"), mark, quoted=True)) for number, line in lines]
    return rows, mark != ","


def _responses(header: list[str], responses: Collection[str], where: str) -> list[str]:
    for needed in ("run", "time_s"):
        if header.count(needed) != 1:
            raise _error(
                f"{header.count(needed)} columns {needed!r} among {', '.join(header)[:200]}", _EXAMPLE, where,
                f"name one column {needed}",
            )  # fmt: skip
    probed = [cell for cell in header if cell not in ("run", "time_s")]
    for cell in probed:
        if cell not in responses or probed.count(cell) > 1:
            raise _error(
                f"column {cell[:60]!r}" + (" twice" if probed.count(cell) > 1 else ""),
                "the responses of the model, each once: " + ", ".join(responses), where, "rename or remove the column",
            )  # fmt: skip
    if not probed:
        raise _error("no column of a response", "one of " + ", ".join(responses), where, "add what the probe found")
    return probed


def _number(cell: str, what: str, where: str, comma: bool) -> float:
    text = cell.replace("−", "-")
    if comma and text.count(",") == 1:
        text = text.replace(",", ".")
    if not _NUMBER.fullmatch(text):
        raise _error(
            f"{what} {cell[:40]!r}" if cell else f"no {what}", "a number with a decimal point", where,
            "correct the cell; a response that was not probed stays empty",
        )  # fmt: skip
    return float(text)


def _error(found: str, expected: str, where: str, advice: str) -> ReadError:
    return ReadError(found, expected=expected, where=where, advice=advice)
