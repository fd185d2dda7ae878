"""Which runs could this machine do next? A menu within what was recorded: speeds, strokes, amplitudes, levels."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.shapes.axis import derivatives
from selector.diagnosis.shapes.heating import SHORTEST_S, Sources, sources
from selector.diagnosis.shapes.signals import SLOWEST_VIBRATION_S, course, excited, no_gauging
from selector.number_text import span_text
from selector.types import Vector

Given = dict[str, NDArray[Any]]

_HALL_SWING_K = 4.0
_DAY_S = 8.0 * 3600.0
_ROUND_S = 96.0 * 60.0  #: Halves, sixths and sixteenths of it are whole minutes.
_LONGEST_DRIVE_S = 12.0
_MOST_SAMPLES = 4_000
_JERK_S = 0.04
_DWELL_S = 0.3


@dataclass(frozen=True, eq=False)
class PlannedRun:
    """A run that has not been made."""

    description: str  #: Speeds, times and what to log, as an instruction
    #: (n_samples,): What is set, channel by channel [unit of the channel], at the sampling period of the comparison
    inputs: Mapping[str, Vector]
    duration_s: float


def planned_runs(comparison: Comparison, response: str) -> tuple[PlannedRun, ...]:
    """Runs that may tell effects in this response apart; none where the record does not say what moves it."""
    if no_gauging(comparison, response) is None:
        return ()
    axis = _axis_input(comparison, response)
    if axis is not None and comparison.longest_s < SHORTEST_S:
        return tuple(_of_axis(comparison, axis))
    known, displaced = sources(comparison, response), ("displacement", "temperature", "size")
    is_warm = any((known.spindle, known.machine, known.hall, known.coolant_switches, known.other_heat))
    if comparison.longest_s >= SHORTEST_S and is_warm and comparison.channel(response).role in displaced:
        return tuple(_of_heat(comparison, response))
    if comparison.period_s <= SLOWEST_VIBRATION_S:
        return tuple(_of_vibration(comparison, response))
    return tuple(_of_levels(comparison, response))


def _of_heat(comparison: Comparison, response: str) -> Iterator[PlannedRun]:
    known = sources(comparison, response)
    span = _ROUND_S * round(float(np.clip(comparison.longest_s, 2.0 * 3600.0, _DAY_S)) / _ROUND_S)
    n = int(np.clip(round(span / comparison.period_s), 60, _MOST_SAMPLES))
    part = np.arange(n) / n
    log = _logged(comparison, response)
    for words, given in _heat_menu(comparison, known, part, span):
        rest = _at_rest(comparison, known, n)
        yield PlannedRun(f"{words}; log {log} as in the other runs.", rest | given, n * comparison.period_s)


def _heat_menu(comparison: Comparison, known: Sources, part: Vector, span: float) -> Iterator[tuple[str, Given]]:
    half = span_text(span / 2.0)
    if known.spindle is not None:
        name, top = known.spindle, _top(comparison, known.spindle)
        for share in (1.0, 0.5):
            words = f"Run the spindle at {share * top:.0f} rpm for {half}, then let it cool at standstill for {half}"
            yield words, {name: share * top * (part < 0.5)}
        levels = np.array([0.25, 0.5, 0.75, 1.0, 0.6, 0.3])
        stairs = top * levels[np.minimum((6 * part).astype(int), 5)]
        said = ", ".join(f"{level * top:.0f}" for level in levels)
        yield f"Run the spindle at {said} rpm for {span_text(span / 6.0)} each, without stops", {name: stairs}
        on = np.mod(16.0 * part, 2.0) < 1.0
        each = span_text(span / 16.0)
        yield f"Run the spindle at {top:.0f} rpm, {each} on and {each} off, for {span_text(span)}", {name: top * on}
        quick = np.mod(64.0 * part, 2.0) < 1.0
        each = span_text(span / 64.0)
        words = f"Run the spindle at {top:.0f} rpm, {each} on and {each} off, for {half}, then at {0.5 * top:.0f} rpm"
        yield f"{words} without a stop for {half}", {name: np.where(part < 0.5, top * quick, 0.5 * top)}
    if known.hall:
        swing = _HALL_SWING_K * 0.5 * (1.0 - np.cos(2.0 * np.pi * part))
        given = {name: _start(comparison, name) + swing for name in known.hall}
        words = f"Leave the machine switched on but idle for {span_text(span)} while the hall changes by"
        yield f"{words} {_HALL_SWING_K:.0f} K or more (overnight, heating on and off)", given
    wet = {name: _top(comparison, name) * (np.mod(8.0 * part, 2.0) >= 1.0) for name in known.coolant_switches}
    if wet:
        each = span_text(span / 8.0)
        switched = " and ".join(wet)
        yield f"Spindle at standstill, {switched} off and on for {each} each, for {span_text(span)}", dict(wet)
        if known.spindle is not None:
            speed = np.full(len(part), 0.6 * _top(comparison, known.spindle))
            words = f"Run the spindle at {speed[0]:.0f} rpm throughout, {switched} off and on for {each} each"
            yield f"{words}, for {span_text(span)}", wet | {known.spindle: speed}
    for name in known.other_heat:
        on = np.where(np.mod(4.0 * part, 2.0) < 1.0, _top(comparison, name), _low(comparison, name))
        each = span_text(span / 4.0)
        yield f"Spindle at standstill, {name} at its highest for {each}, then off for {each}, twice", {name: on}


def _at_rest(comparison: Comparison, known: Sources, n: int) -> dict[str, Vector]:
    """Everything that can be set, off; the hall as it was at the start of the runs."""
    off = {name: np.full(n, _low(comparison, name)) for name in (*known.coolant_switches, *known.other_heat)}
    calm = {name: np.full(n, _start(comparison, name)) for name in known.hall}
    if known.spindle is not None:
        return off | calm | {known.spindle: np.zeros(n)}
    return off | calm


def _axis_input(comparison: Comparison, response: str) -> str | None:
    """What tells where the axis is to be: its command, else its position, else its speed."""
    axis = comparison.channel(response).axis
    for role in ("position_command", "position", "velocity"):
        for channel in comparison.channels:
            of_axis = axis is None or channel.axis in (None, axis)
            if channel.role == role and of_axis and excited(course(comparison, channel.name)):
                return channel.name
    return None


def _of_axis(comparison: Comparison, name: str) -> Iterator[PlannedRun]:
    role = comparison.channel(name).role
    told = comparison.simulated_course(name) if name in comparison.simulated else course(comparison, name)
    if role == "velocity":
        acceleration = derivatives(comparison, told)[0]
        speed, low, travel = told, 0.0, float(np.abs(told).max()) * 0.25 * comparison.longest_s
    else:
        speed, acceleration = derivatives(comparison, told)
        low, travel = float(told.min()), float(np.ptp(told))
    top = float(np.quantile(np.abs(speed), 0.995))
    push = max(float(np.quantile(np.abs(acceleration), 0.99)), 4.0 * top / max(comparison.longest_s, 1e-9))
    drive = _Drive(comparison.period_s, low, travel, top, push)
    log = _logged(comparison, name, but=name)
    for words, place in _axis_menu(drive):
        course_of = np.gradient(place, comparison.period_s) if role == "velocity" else place
        words = f"{words}; log {name}{f', {log}' if log else ''} as in the other runs."
        yield PlannedRun(words, {name: course_of}, len(place) * comparison.period_s)


@dataclass(frozen=True)
class _Drive:
    """What an axis was seen to do: sampling, lowest place, travel, top speed, acceleration (SI units)."""

    step: float
    low: float
    travel: float
    top: float
    push: float

    def moved(self, strokes: Sequence[tuple[float, float]]) -> Vector:
        """Course of place [m] through strokes (way [m], speed [m/s]), each with a dwell behind it, jerk rounded."""
        speeds = [np.zeros(max(2, round(_DWELL_S / self.step)))]
        for way, speed in strokes:
            size = min(speed, np.sqrt(abs(way) * self.push))
            ramp = max(size / self.push, self.step)
            total = abs(way) / size + ramp
            time = np.arange(0.0, total + self.step, self.step)
            shape = np.clip(np.minimum(time, total - time) / ramp, 0.0, 1.0)
            shape *= way / max(float(shape.sum()) * self.step, 1e-300)
            speeds += [shape, np.zeros(max(2, round(_DWELL_S / self.step)))]
        speed_course = np.concatenate(speeds)[: min(_MOST_SAMPLES, round(_LONGEST_DRIVE_S / self.step))]
        window = np.hanning(max(3, round(_JERK_S / self.step) | 1) + 2)[1:-1]
        smooth = np.convolve(speed_course, window / window.sum(), mode="same")
        return np.asarray(self.low + np.cumsum(smooth) * self.step)

    def way(self, speed: float, share: float, most_s: float) -> float:
        """A part of the travel, no longer than a time at that speed takes."""
        return min(share * self.travel, speed * most_s)


def _axis_menu(drive: _Drive) -> Iterator[tuple[str, Vector]]:
    def said(way: float) -> str:
        return f"{1e3 * way:.3g} mm"

    def per(speed: float) -> str:
        return f"{60e3 * speed:.0f} mm/min"

    def there_and_back(way: float, speed: float, times: int) -> list[tuple[float, float]]:
        return [(way, speed), (-way, speed)] * times

    speeds = [0.1 * drive.top, 0.3 * drive.top, drive.top]
    strokes = [s for v in speeds for s in there_and_back(drive.way(v, 0.5, 1.0), v, 2)]
    listed = ", ".join(per(v) for v in speeds)
    yield f"Move to and fro twice each at {listed}, with dwells of {_DWELL_S:g} s", drive.moved(strokes)
    way = drive.way(drive.top, 0.9, 2.0)
    words = f"Move {said(way)} at constant {per(drive.top)}, there and back three times, with dwells of {_DWELL_S:g} s"
    yield words, drive.moved(there_and_back(way, drive.top, 3))
    slow, fast = 0.1 * drive.top, drive.top
    both = there_and_back(drive.way(slow, 0.9, 2.0), slow, 1) + there_and_back(drive.way(fast, 0.9, 2.0), fast, 2)
    yield f"Move at constant {per(slow)} and {per(fast)}, both there and back, with dwells", drive.moved(both)
    creep = 0.01 * drive.top
    way = drive.way(creep, 0.5, 3.0)
    yield f"Creep {said(way)} at {per(creep)}, there and back twice", drive.moved(there_and_back(way, creep, 2))
    way = 0.02 * drive.travel
    yield f"Make 15 short strokes of {said(way)}, each reversed at once", drive.moved(there_and_back(way, fast, 15))
    yield _sweep(drive)
    stroke = [(1e-9, fast)] * max(1, round(3.0 / _DWELL_S)) + [(0.3 * drive.travel, fast)]
    yield f"Stand for 3 s, then one stroke of {said(0.3 * drive.travel)} at {per(fast)}", drive.moved(stroke)


def _sweep(drive: _Drive) -> tuple[str, Vector]:
    total = min(10.0, _LONGEST_DRIVE_S, _MOST_SAMPLES * drive.step)
    time = np.arange(0.0, total, drive.step)
    first, last = 0.5, min(30.0, 0.1 / drive.step)
    phase = 2.0 * np.pi * first * total / np.log(last / first) * ((last / first) ** (time / total) - 1.0)
    omega = 2.0 * np.pi * first * (last / first) ** (time / total)
    size = np.minimum.reduce([np.full(len(time), 0.2 * drive.travel), 0.8 * drive.top / omega, drive.push / omega**2])
    fade = np.clip(np.minimum(time, total - time) / 0.5, 0.0, 1.0)
    place = drive.low + 0.5 * drive.travel + size * fade * np.sin(phase)
    words = f"Sweep the position with a sine from {first:g} to {last:.3g} Hz in {span_text(total)}"
    return f"{words}, as large as speed and acceleration allow", place


def _of_vibration(comparison: Comparison, response: str) -> Iterator[PlannedRun]:
    names = comparison.with_role("force", "voltage", "current", "acceleration", "displacement")
    drivers, turning = (
        [name for name in of if excited(course(comparison, name))]
        for of in (names, comparison.with_role("spindle_speed"))
    )
    rows = max((rows for _, rows in comparison.rows_of_runs()), key=lambda rows: rows.stop - rows.start)
    n = int(np.clip(rows.stop - rows.start, 200, _MOST_SAMPLES))
    span, part = n * comparison.period_s, np.arange(n) / n
    still = {name: np.zeros(n) for name in drivers} | {
        name: np.full(n, float(np.median(course(comparison, name)))) for name in turning
    }
    log = _logged(comparison, response)
    for words, given in _vibration_menu(comparison, drivers, turning, rows, part, span):
        yield PlannedRun(f"{words}; log {log} as in the other runs.", still | given, span)


def _vibration_menu(
    comparison: Comparison, drivers: Sequence[str], turning: Sequence[str], rows: slice, part: Vector, span: float
) -> Iterator[tuple[str, Given]]:
    n = len(part)
    for name in drivers:
        seen = np.resize(course(comparison, name)[rows], n)
        size = float(np.abs(seen).max())
        steps = np.array([0.2, 0.5, 1.0])[np.minimum((3 * part).astype(int), 2)]
        unit = comparison.channel(name).unit
        words = f"Repeat the excitation {name} at 20, 50 and 100 % of its amplitude, {span_text(span / 3)} each"
        yield words, {name: seen * steps}
        last = 0.2 / comparison.period_s
        first = last / 100.0
        phase = 2.0 * np.pi * first * span / np.log(100.0) * (100.0**part - 1.0)
        band = f"from {first:.3g} to {last:.3g} Hz in {span_text(span)}"
        yield f"Sweep {name} with a sine of {0.5 * size:.3g} {unit} {band}", {name: 0.5 * size * np.sin(phase)}
        words = f"Let {name} rest for {span_text(span / 2)}, then repeat the excitation"
        yield words, {name: np.where(part < 0.5, 0.0, seen)}
    for name in turning:
        top = _top(comparison, name)
        yield f"Run the spindle up from standstill to {top:.0f} rpm in {span_text(span)}, evenly", {name: top * part}
        two = np.where(part < 0.5, 0.6 * top, top)
        yield f"Run the spindle at {0.6 * top:.0f} and {top:.0f} rpm, {span_text(span / 2)} each", {name: two}
        yield f"Spindle at standstill for {span_text(span)}", {name: np.zeros(n)}


def _of_levels(comparison: Comparison, response: str) -> Iterator[PlannedRun]:
    """Whatever else drives a process: stairs up and down, and slow waves, of one input at a time."""
    names = [c.name for c in comparison.channels if c.name not in comparison.responses]
    names = [name for name in names if excited(course(comparison, name))]
    n = int(np.clip(round(comparison.longest_s / comparison.period_s), 60, _MOST_SAMPLES))
    part, span = np.arange(n) / n, n * comparison.period_s
    rest = {name: np.full(n, float(np.median(course(comparison, name)))) for name in names}
    log = _logged(comparison, response)
    for name in names:
        low, high = _low(comparison, name), _top(comparison, name)
        steps = np.array([0.0, 0.5, 1.0, 0.25, 0.75, 0.0])[np.minimum((6 * part).astype(int), 5)]
        wave = 0.5 - 0.5 * np.cos(4.0 * np.pi * part)
        for words, shape in (("steps of 0, 50, 100, 25, 75, 0 %", steps), ("two slow waves", wave)):
            text = f"Take {name} through {words} of its range ({low:.3g} to {high:.3g}) in {span_text(span)}"
            given = rest | {name: low + (high - low) * shape}
            yield PlannedRun(f"{text}; log {log} as in the other runs.", given, span)


def _logged(comparison: Comparison, response: str, *, but: str | None = None) -> str:
    names = dict.fromkeys([*comparison.responses, response])
    return ", ".join(name for name in names if name != but)


def _top(comparison: Comparison, name: str) -> float:
    return float(np.quantile(course(comparison, name), 0.999))


def _low(comparison: Comparison, name: str) -> float:
    values = course(comparison, name)
    return 0.0 if float(values.min()) >= 0.0 else float(np.median(values))


def _start(comparison: Comparison, name: str) -> float:
    values = course(comparison, name)
    return float(np.median([np.median(values[rows][:5]) for _, rows in comparison.rows_of_runs()]))
