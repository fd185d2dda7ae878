"""Touch-off file → what the probe found when; strict, because a wrong cell would move the correction."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path

from selector.csv_text import as_written
from selector.readers.roles.names import printable_name
from selector.readers.text.lines import refused, strict_number, strict_rows
from selector.recording import named_by_axis

LARGEST_UM = 1e6
_EXAMPLE = "a header such as run,time_s,Z and below it one row a touch-off"
_SLACK_S = 1e-6


@dataclass(frozen=True)
class TouchOff:
    """One reading of the probe."""

    time_s: float  #: From the start of the run
    displacement_um: float


def read_touch_offs(
    path: Path, durations_s: Mapping[str, float], responses: Mapping[str, str | None]
) -> dict[str, dict[str, tuple[TouchOff, ...]]]:
    """Response → run → touch-offs in the order of time, from text with the columns run, time_s and one a response [µm].

    An empty cell is a response that was not probed. `durations_s` has the runs that there are, `responses` the axis of
    each, which may stand for its name.

    Raises ReadError: the file cannot be read, a column or a run is not known, a cell holds no number, or a time is not
    in its run.
    """
    name = printable_name(path.name)
    rows, mark = strict_rows(path, name, "touch-offs", _EXAMPLE)
    header = [named_by_axis(cell, responses) for cell in rows[0][1]]
    probed = _responses(header, responses, f"{name}, line {rows[0][0]}")
    found: dict[str, dict[str, list[TouchOff]]] = {one: {} for one in probed}
    for line, cells in rows[1:]:
        where = f"{name}, line {line}"
        row = dict(zip(header, cells, strict=True))
        run = as_written(row["run"])
        if run not in durations_s:
            raise refused(
                f"run {run[:60]!r}", "one of the runs " + ", ".join(list(durations_s)[:20]), where,
                "write the name of the run as `selector describe` shows it",
            )  # fmt: skip
        time_s = strict_number(row["time_s"], "time", where, comma=mark != ",")
        if not -_SLACK_S <= time_s <= durations_s[run] + _SLACK_S:
            raise refused(
                f"time {time_s:g} s", f"0 to {durations_s[run]:g} s, the length of run {run}", where,
                "count the time from the start of the run, in seconds",
            )  # fmt: skip
        for one in probed:
            if row[one]:
                um = strict_number(row[one], one, where, comma=mark != ",")
                if abs(um) > LARGEST_UM:
                    raise refused(f"{um:g} µm of {one}", "a displacement in µm", where, "correct the cell")
                found[one].setdefault(run, []).append(TouchOff(time_s, um))
    return {
        one: {run: tuple(sorted(of, key=lambda touch: touch.time_s)) for run, of in runs.items()}
        for one, runs in found.items()
    }


def _responses(header: list[str], responses: Collection[str], where: str) -> list[str]:
    for needed in ("run", "time_s"):
        if header.count(needed) != 1:
            raise refused(
                f"{header.count(needed)} columns {needed!r} among {', '.join(header)[:200]}", _EXAMPLE, where,
                f"name one column {needed}",
            )  # fmt: skip
    probed = [cell for cell in header if cell not in ("run", "time_s")]
    for cell in probed:
        if cell not in responses or probed.count(cell) > 1:
            raise refused(
                f"column {cell[:60]!r}" + (" twice" if probed.count(cell) > 1 else ""),
                "the responses of the model, each once: " + ", ".join(responses), where, "rename or remove the column",
            )  # fmt: skip
    if not probed:
        raise refused("no column of a response", "one of " + ", ".join(responses), where, "add what the probe found")
    return probed
