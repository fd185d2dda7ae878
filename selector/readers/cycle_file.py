"""What a prediction reads: the duty cycle, and the displacements of heating and cooling tests.

The cycle file is read strictly, because a wrong cell would be a wrong prediction; of the tests no faults are used, and
no units that nobody said.
"""

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from selector.errors import OptionError
from selector.findings import Finding, Where
from selector.physics.thermal.finding_table import FINDINGS
from selector.physics.thermal.prediction.observer import DayReadings
from selector.quality import inspect, without_faults
from selector.quality.finding_table import RUN_STARTS_WARM
from selector.readers.cells import is_time_name
from selector.readers.clock.stamps import time_unit
from selector.readers.reading import Reading
from selector.readers.roles.names import name_and_unit, printable_name, role_guess
from selector.readers.text.lines import refused, strict_number, strict_rows
from selector.recording import Recording, at_pauses
from selector.types import Vector
from selector.units import convert, parse_unit, unit_for_role

_LATE_S = 60.0  #: First reading of a day whose clock began with the duty cycle.
MOST_THERMOMETERS = 4  #: That observe a day: each is one response more that the modes have to describe.
_EXAMPLE = "a header such as time_s,spindle_speed and below it one row for every change of the speed"


@dataclass(frozen=True)
class CycleFile:
    """A duty cycle as it stands in its file."""

    file: str  #: Name of the file, fit to be shown
    #: time_s and speed_rpm: (n_rows,): From each time [s] on the speed [r/min] is held; times start at 0 and increase
    time_s: Vector
    speed_rpm: Vector
    others: Mapping[str, tuple[str, ...]] = field(default_factory=dict)  #: Further columns: heading → cells as written
    lines: tuple[int, ...] = ()  #: (n_rows,): Where each row stands in the file
    comma: bool = False  #: Whether numbers have decimal commas

    def temperatures(self, names: Sequence[str]) -> dict[str, Vector]:
        """The further columns with these names [°C], (n_rows,) each; a unit may stand in their heading.

        Raises ReadError: a cell holds no number, or the unit is none of a temperature.
        """
        found = {}
        for heading, cells in self.others.items():
            word, unit = name_and_unit(heading, time=False)
            name = next((one for one in names if one in (heading.strip(), word)), None)
            if name is None:
                continue
            where = f"{self.file}, {heading!r}"
            unit = unit_for_role(unit or "degC", "ambient", where=where)
            values = [
                strict_number(cell, "temperature", f"{self.file}, line {line}", comma=self.comma)
                for cell, line in zip(cells, self.lines, strict=True)
            ]
            found[name] = convert(np.array(values), unit, "degC")
        return found

    def ignored(self, used: Collection[str], names: Sequence[str]) -> tuple[Finding, ...]:
        """What is told of further columns of numbers, where `used` are those with `names`, the halls of the tests."""
        others = [one for one in self.others if not {one.strip(), name_and_unit(one)[0]} & {*used}]
        cells = {one: [cell.strip() for cell in self.others[one] if cell.strip()] for one in others}
        left = [repr(one) for one, of in cells.items() if of and all(re.fullmatch(r"[-+−]?[\d.,]+", it) for it in of)]
        more = f" and {len(left) - 5} more" * (len(left) > 5)
        told = f"Not used of {self.file}: {', '.join(left[:5])}{more}; ambient channels of the tests: "
        return (FINDINGS.finding("cycle-columns-ignored", f"{told}{', '.join(names) or 'none'}."),) if left else ()


def read_cycle(path: Path) -> CycleFile:
    """Read a duty cycle: text with a header, a column of times with their unit, and a column of the spindle speed.

    The unit of the time stands in its heading (``time_s``, ``t_min``, ``time [h]``). Without one, a speed is in r/min.
    Other columns are refused only if it is not clear which one is the speed.

    Raises ReadError: the file cannot be read, a unit is missing or unknown, a cell holds no number, times do not start
    at 0 or do not increase, or a speed is negative.
    """
    name = printable_name(path.name)
    rows, mark = strict_rows(path, name, "duty cycle", _EXAMPLE)
    time, speed, scale = _columns(rows[0][1], name)
    comma = mark != "," and not any("." in cell for _, cells in rows[1:] for cell in cells)
    times, speeds = np.empty(len(rows) - 1), np.empty(len(rows) - 1)
    for i, (line, cells) in enumerate(rows[1:]):
        where = f"{name}, line {line}"
        times[i] = strict_number(cells[time], "time", where, comma=comma)
        speeds[i] = strict_number(cells[speed], "speed", where, comma=comma)
    times, speeds = convert(times, scale[0], "s"), convert(speeds, scale[1], "rpm")
    lines = tuple(line for line, _ in rows[1:])
    _check(times, speeds, lines, name)
    header = rows[0][1]
    others = {header[i]: tuple(cells[i] for _, cells in rows[1:]) for i in range(len(header)) if i not in (time, speed)}
    return CycleFile(name, times, speeds, others, lines, comma)


def _columns(header: list[str], name: str) -> tuple[int, int, tuple[str, str]]:
    """Positions of time and speed, and their units."""
    parts = [name_and_unit(cell, time=True) for cell in header]
    times = [i for i, (word, _) in enumerate(parts) if is_time_name(word)]
    where = f"{name}, header"
    if len(times) != 1:
        raise refused(
            f"{len(times)} columns of time among {', '.join(map(repr, header))}", "one, such as time_s", where,
            "name the column with the times time_s, or t_min if they are in minutes",
        )  # fmt: skip
    _refuse_unknown_unit(header[times[0]], parts[times[0]][1], where)
    unit = time_unit(parts[times[0]][1])
    if unit is None:
        written = parts[times[0]][1]
        raise refused(
            f"no unit of time in {header[times[0]]!r}" if written is None else f"unit {written!r} of the time",
            "a unit of time, as in time_s, t_min or time [h]", where, "write the unit into the heading of the times",
        )  # fmt: skip
    others = [i for i in range(len(header)) if i != times[0]]
    speeds = [i for i in others if _is_speed(*parts[i])]
    if len(speeds) != 1:
        raise refused(
            f"{len(speeds)} columns of the spindle speed among {', '.join(map(repr, header))}",
            "one, such as spindle_speed", where, "name the column with the speeds spindle_speed",
        )  # fmt: skip
    _refuse_unknown_unit(header[speeds[0]], parts[speeds[0]][1], where)
    speed_unit = unit_for_role(parts[speeds[0]][1] or "rpm", "spindle_speed", where=f"{where} {header[speeds[0]]!r}")
    return times[0], speeds[0], (unit, speed_unit)


def _refuse_unknown_unit(heading: str, unit: str | None, where: str) -> None:
    bracketed = re.search(r"[\[({<]([^\])}>]*)[\])}>]", heading)
    if unit is None and bracketed:
        raise refused(
            f"unit {bracketed[1]!r} in {heading!r}", "a unit that is known", where,
            "write s, min or h for times, and rpm or 1/s for speeds",
        )  # fmt: skip


def _is_speed(name: str, unit: str | None) -> bool:
    example = np.array([0.0, 1000.0, 2000.0])
    units = {None, parse_unit(unit) if unit else None}
    return any(role_guess(name, known, example).role == "spindle_speed" for known in units)


def _check(time: Vector, speed: Vector, lines: Sequence[int], name: str) -> None:
    for i, line in enumerate(lines):
        where = f"{name}, line {line}"
        if i == 0 and time[0] != 0:
            raise refused(
                f"a first time of {time[0]:g} s", "a first row at time 0", where,
                "add a row for time 0, with speed 0 if the spindle stands at first",
            )  # fmt: skip
        if i and time[i] <= time[i - 1]:
            raise refused(
                f"time {time[i]:g} s after {time[i - 1]:g} s", "times that increase", where,
                "sort the rows by time and keep one row a time",
            )  # fmt: skip
        if speed[i] < 0:
            raise refused(
                f"speed {speed[i]:g} r/min", "a speed of 0 or more", where,
                "give the speed without a sign: the sense of rotation does not matter here",
            )  # fmt: skip


#: Names of a spindle speed that say its unit, r/min.
_SPEED_UNIT = re.compile(r"rpm|(1|r|u|rev|об)\s*/\s*min|min\s*(\^?-1|⁻¹)|об/мин", re.IGNORECASE)


def heating_tests(
    reading: Reading, response: Sequence[str] = ()
) -> tuple[Recording, tuple[str, ...], tuple[Finding, ...]]:
    """The recording, cut at pauses, without the faults of speed and displacements, which these are, and what was found.

    `response` are the displacements or temperatures to be predicted; default: all displacements there are. Faults of
    temperatures around the machine are left out, too.

    Raises OptionError: There is no displacement, one is faulty in every run, or a unit was guessed.
    """
    recording = reading.recording
    responses = tuple(dict.fromkeys(response)) if response else recording.with_role("displacement")
    speeds = recording.with_role("spindle_speed")
    if not responses:
        raise OptionError(
            "no displacement in the recordings", expected="a channel with the role displacement",
            where="the recordings", advice="give the channel of the gauge that role in the machine file",
        )  # fmt: skip
    used = {name for name in (*responses, *speeds) if name in recording.names}
    _require_units(reading, used)
    # where a displacement starts is its zero here, and it may have moved on within the first samples
    halls = set(recording.with_role("ambient"))
    faults = [fault for fault in inspect(recording, used | halls) if fault.id != RUN_STARTS_WARM]
    clean = at_pauses(without_faults(recording, faults))
    gone = sorted(used - set(clean.names))
    if gone:
        why = next((fault.statement for fault in faults if fault.where.channel == gone[0]), "it is faulty in every run")
        raise OptionError(
            f"{gone[0]} is left out of every run: {why}", expected="readings without a fault",
            where="the recordings", advice="look at the findings of `selector describe`, and correct the files",
        )  # fmt: skip
    return clean, responses, (*reading.findings, *faults)


def day_readings(
    day: Reading, tests: Recording, responses: Sequence[str], observe: Sequence[str] = ()
) -> tuple[DayReadings, tuple[Finding, ...]]:
    """The thermometers of one recorded run that the tests have too, without their faults, and what was found.

    `observe` are those to go by; default: all good ones, at most `MOST_THERMOMETERS`. Measured `responses` are kept.

    Raises OptionError: there is not one run, no such thermometer, too many, or one without a reading.
    """
    recording = day.recording
    common = [name for name in recording.with_role("temperature") if name in tests.with_role("temperature")]
    chosen = tuple(dict.fromkeys(observe or common))
    unknown = [name for name in chosen if name not in common]
    if len(recording.runs) != 1 or unknown or not 0 < len(chosen) <= MOST_THERMOMETERS:
        found = f"{len(recording.runs)} runs" if len(recording.runs) != 1 else f"thermometers {', '.join(chosen)}"
        raise OptionError(
            f"no thermometer {unknown[0]!r}" if unknown else found if chosen else "no thermometer that the tests have",
            expected=f"one run with 1 to {MOST_THERMOMETERS} thermometers of the tests ({', '.join(common) or 'none'})",
            where="--readings", advice="name one or two near the heat with --observe",
        )  # fmt: skip
    run = recording.runs[0]
    # how a thermometer goes in the tests, by itself and beside the others, tells whether it still does
    tables = {f"{run}, test {test}": tests.frame.loc[[test]].droplevel(0) for test in tests.runs}
    tables[run] = recording.frame.loc[[run]].droplevel(0)
    whole = Recording.from_runs(tables, [recording.channel(name) for name in common])
    faults = tuple(one for one in inspect(whole, set(chosen)) if one.where.run in (None, run))
    clean = without_faults(recording, faults)
    dead = [name for name in chosen if name not in clean.names or not np.isfinite(clean.values(run, [name])).any()]
    if not observe:
        # its fault is among the findings
        chosen = tuple(name for name in chosen if name not in dead)
    if dead and (observe or not chosen):
        said = next((f": {one.statement.rstrip('.')}" for one in faults if one.where.channel == dead[0]), "")
        raise OptionError(
            f"no usable reading of {dead[0]}{said}", expected="readings of the day", where="--readings",
            advice="leave it out with --observe, or correct the file",
        )  # fmt: skip
    time_s = recording.time_s(run)
    gauges = [name for name in responses if name in recording.with_role("displacement")]
    measured = {name: recording.values(run, [name])[:, 0] for name in gauges}
    readings = DayReadings(chosen, time_s - time_s[0], clean.values(run, chosen), measured)
    told, begins_s = [*day.findings, *faults], day.runs[0].begins_s
    if begins_s > _LATE_S:
        said = f"The day's clock begins at {begins_s / 60.0:.3g} min; that was taken as the start of the duty cycle."
        told.append(FINDINGS.finding("day-begins-late", said, Where(run=run), {"begins_s": begins_s}))
    return readings, tuple(told)


def _require_units(reading: Reading, used: set[str]) -> None:
    """A displacement in the wrong unit becomes a wrong correction, a time in the wrong unit a late one: no guessing."""
    if "unit" in reading.reading["time"]["guessed"]:
        raise OptionError(
            f"no unit of the time (column {', '.join(map(repr, reading.reading['time']['columns']))})",
            expected="a unit that the file or the machine file says", where="the recordings",
            advice='write unit = "s" (or "min", ...) under [time] in the machine file, or give --time-unit',
        )  # fmt: skip
    choices = {"spindle_speed": ("rpm", "1/s"), "displacement": ("um", "mm")}
    for channel in reading.channels:
        if channel.name not in used or channel.role not in choices or "unit" not in channel.guessed:
            continue
        named = any(_SPEED_UNIT.search(name) for name in (channel.name, str(channel.column)))
        if channel.role == "displacement" or not named:
            unit, other = choices[channel.role]
            raise OptionError(
                f"no unit of {channel.name} (taken for {channel.unit_in_file})",
                expected="a unit that the file or the machine file says", where="the recordings",
                advice=f'write unit = "{unit}" (or "{other}") under [channels.{channel.name}], or give --unit '
                f"{channel.name}={unit}",
            )  # fmt: skip
