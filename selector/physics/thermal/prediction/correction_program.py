"""When to correct by how much to keep a tolerance of the drift, how that is written, and in which order it is least."""

import itertools
import math
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from selector.csv_text import csv_text
from selector.errors import InputError
from selector.physics.thermal.modes.modes import Cyclogram
from selector.types import Vector

#: More corrections than this in one program are a mistake in the tolerance or in the unit of the displacement.
MOST_CORRECTIONS = 10_000
_SAME = 1e-9  #: Share of the tolerance, and of the time, below which a difference is rounding.


@dataclass(frozen=True)
class Operation:
    """Corrections of one technological operation (C eq. 5, one line)."""

    #: start_s and end_s: Start and end of the operation [s]; the displacement at the start is its zero
    start_s: float
    end_s: float
    times_s: Vector  #: (n,): When each correction comes into force [s]; the first is the start of the operation
    #: (n,): Displacement [µm] that is taken off from then on, in addition to those before; the first is 0
    corrections_um: Vector
    tolerance_um: float  #: Drift since the last correction, or since the zero, that is never exceeded [µm]

    @property
    def durations_s(self) -> Vector:
        """How long each correction is the last one [s], shape (n,); they add up to the length of the operation."""
        return np.asarray(np.diff(np.r_[self.times_s, self.end_s]))

    @property
    def offsets_um(self) -> Vector:
        """All that is taken off from each time on [µm], counted from the zero of the operation, shape (n,)."""
        return np.asarray(np.cumsum(self.corrections_um))

    def as_dict(self) -> dict[str, Any]:
        """JSON form, durations in minutes."""
        return {
            "durations_min": (self.durations_s / 60.0).tolist(),
            "corrections_um": self.corrections_um.tolist(),
            "tolerance_um": self.tolerance_um,
        }


@dataclass(frozen=True)
class CorrectionProgram:
    """The corrections of all operations, one after the other (C eq. 5), for one displacement."""

    operations: tuple[Operation, ...]  #: The first starts at 0 s, each of the others where the one before it ends

    @property
    def tolerances_um(self) -> tuple[float, ...]:
        """The tolerance of every operation [µm]; one if they are all the same."""
        told = tuple(operation.tolerance_um for operation in self.operations)
        return told[:1] if len(set(told)) == 1 else told

    @property
    def tolerance_um(self) -> float:
        """The smallest of them [µm]."""
        return min(self.tolerances_um)

    def drift_left_um(self, time_s: Vector, displacement_um: Vector) -> tuple[Vector, Vector]:
        """What this program leaves of another curve, e.g. of the true one: times [s] and drift [µm].

        The curve is linear between its samples. Where a correction comes into force and where an operation ends, the
        time appears twice, with the drift before and after. Drift beyond the tolerance is the prediction's error, not
        the program's.

        Raises InputError if the curve cannot be used or ends before the operations do.
        """
        time, displacement = _checked_curve(time_s, displacement_um, self.operations[-1].end_s)
        times: list[Vector] = []
        left: list[Vector] = []
        for operation in self.operations:
            zero_um = float(np.interp(operation.start_s, time, displacement))
            stops = [*operation.times_s[1:], operation.end_s]
            for begin, end, offset in zip(operation.times_s, stops, operation.offsets_um, strict=True):
                inside = time[(time > begin) & (time < end)]
                times.append(np.r_[begin, inside, end])
                left.append(np.interp(times[-1], time, displacement) - zero_um - offset)
        return np.concatenate(times), np.concatenate(left)


def correction_program(
    time_s: Vector,
    displacement_um: Vector,
    operations_s: Sequence[float],
    tolerance_um: float | Sequence[float],
    resolution_s: float | None = None,
) -> CorrectionProgram:
    """The corrections that keep the drift of a curve within a tolerance (C eq. 5).

    When one comes: docs/explanation/duty-cycles.md, *The correction program*. The curve is linear between its samples.

    `operations_s` are the lengths of the operations [s], the first from 0 s on; they share a tolerance, or each has its
    own. With `resolution_s` corrections come only at whole multiples of this time [s] after the start of the operation,
    before the tolerance is reached.

    Raises InputError if the curve cannot be used, more than `MOST_CORRECTIONS` would be needed, or the drift grows by
    more than the tolerance within `resolution_s`.
    """
    ends = np.cumsum(operations_s)
    time, displacement = _checked_curve(time_s, displacement_um, float(ends[-1]))
    tolerances = np.broadcast_to(np.asarray(tolerance_um, dtype=np.float64), ends.shape).tolist()
    with np.errstate(over="ignore"):
        needed = float(np.abs(np.diff(displacement)).sum() / min(tolerances))
    if not needed <= MOST_CORRECTIONS:
        raise InputError(
            f"a curve that would need up to {needed:.3g} corrections of {min(tolerances):g} µm",
            expected=f"at most {MOST_CORRECTIONS}",
            where="correction program",
            advice="choose a larger tolerance, or check the unit of the displacement",
        )
    operations = []
    for start, end, allowed in zip(np.r_[0.0, ends[:-1]], ends, tolerances, strict=True):
        inside = (time > start) & (time < end)
        t = np.r_[start, time[inside], end]
        d = np.asarray(np.interp(t, time, displacement))
        d = d - d[0]
        if resolution_s is None:
            times, corrections = _when_reached(t, d, allowed)
        else:
            times, corrections = _on_a_grid(t, d, allowed, resolution_s)
        operations.append(Operation(float(start), float(end), np.r_[start, times], np.r_[0.0, corrections], allowed))
    return CorrectionProgram(tuple(operations))


def _when_reached(t: Vector, d: Vector, tolerance_um: float) -> tuple[list[float], list[float]]:
    """Times and corrections of one operation, its displacement counted from its start."""
    times: list[float] = []
    corrections: list[float] = []
    reference = 0.0
    reached = tolerance_um * (1.0 - _SAME)
    for i in range(1, len(t)):
        while abs(d[i] - reference) >= reached:
            step = float(np.copysign(tolerance_um, d[i] - reference))
            share = (reference + step - d[i - 1]) / (d[i] - d[i - 1])
            at = float(t[i - 1] + min(max(share, 0.0), 1.0) * (t[i] - t[i - 1]))
            # what is reached at the end of the operation only, its end takes off
            ends_here = at >= t[-1] - _SAME * (t[-1] - t[0])
            if ends_here and float(np.abs(d[i:] - reference).max()) <= tolerance_um * (1.0 + _SAME):
                return times, corrections
            reference += step
            if times and at <= times[-1]:
                corrections[-1] += step
            else:
                times.append(at)
                corrections.append(step)
    return times, corrections


def _on_a_grid(t: Vector, d: Vector, tolerance_um: float, resolution_s: float) -> tuple[list[float], list[float]]:
    """Times and corrections of one operation at whole multiples of the resolution."""
    count = int(np.ceil((t[-1] - t[0]) / resolution_s * (1.0 - _SAME)))
    if count > 100 * MOST_CORRECTIONS:
        raise InputError(
            f"a resolution of {resolution_s:g} s in an operation of {(t[-1] - t[0]) / 60:g} min",
            expected="a resolution that is no smaller than a millionth of the operation",
            where="resolution",
            advice="choose a longer time, e.g. one minute, or leave the resolution out",
        )
    grid = t[0] + resolution_s * np.arange(count)
    edges = np.r_[grid, t[-1]]
    at_edges = np.asarray(np.interp(edges, t, d))
    # smallest and largest value between neighbouring edges, both included
    lows, highs = np.minimum(at_edges[:-1], at_edges[1:]), np.maximum(at_edges[:-1], at_edges[1:])
    cell = np.clip(np.searchsorted(edges, t, side="right") - 1, 0, count - 1)
    np.minimum.at(lows, cell, d)
    np.maximum.at(highs, cell, d)
    times: list[float] = []
    corrections: list[float] = []
    reference = 0.0
    bound = tolerance_um * (1.0 + _SAME)
    for k in range(count):
        if max(highs[k] - reference, reference - lows[k]) <= bound:
            continue
        here = float(at_edges[k])
        if max(highs[k] - here, here - lows[k]) > bound:
            raise InputError(
                f"a drift of {max(highs[k] - here, here - lows[k]):.3g} µm within {resolution_s:g} s "
                f"after {grid[k] / 60:.4g} min",
                expected=f"at most the tolerance, {tolerance_um:g} µm",
                where="correction program",
                advice="choose a finer resolution or a larger tolerance, or leave the resolution out",
            )
        times.append(float(grid[k]))
        corrections.append(here - reference)
        reference = here
    return times, corrections


def _checked_curve(time_s: Vector, displacement_um: Vector, end_s: float) -> tuple[Vector, Vector]:
    time = np.array(time_s, dtype=np.float64)
    displacement = np.array(displacement_um, dtype=np.float64)
    if time.ndim != 1 or time.shape != displacement.shape or len(time) < 2:
        _refuse_curve(f"{time.size} times and {displacement.size} displacements", "at least two pairs")
    if not (np.isfinite(time).all() and np.isfinite(displacement).all()):
        _refuse_curve("values that are missing or infinite", "numbers throughout")
    if (np.diff(time) <= 0).any():
        _refuse_curve("times that repeat or go back", "times that increase")
    slack = _SAME * end_s
    if time[0] > slack or time[-1] < end_s - slack:
        _refuse_curve(
            f"a curve from {time[0] / 60:g} to {time[-1] / 60:g} min",
            f"a curve that covers the operations, 0 to {end_s / 60:g} min",
        )
    return time, displacement


def _refuse_curve(found: str, expected: str) -> None:
    raise InputError(
        found, expected=expected, where="curve of the displacement", advice="correct the curve that the program is for"
    )


_HEADINGS = ["response", "operation", "correction", "start_min", "duration_min"]
_HEADINGS += ["step_um", "offset_um", "step_mm", "offset_mm"]


def notation(operation: Operation) -> str:
    """One operation as the source prints it (C eq. 5): ``3-{18,27,15}-{0,10,10}``, minutes and µm.

    For reading: the times of the corrections are rounded down to 0.1 min, so that none is late and the durations add up
    to the operation, the corrections to 0.1 µm; `Operation` has the exact values.
    """
    # what is less than 0.06 s before a tenth of a minute counts as that tenth: curves are fitted
    starts = [math.floor((time_s - operation.start_s) / 6.0 + 0.01) / 10.0 for time_s in operation.times_s.tolist()]
    ends = [*starts[1:], (operation.end_s - operation.start_s) / 60.0]
    durations = ",".join(_minutes(end - start) for start, end in zip(starts, ends, strict=True))
    corrections = ",".join(_short(value) for value in operation.corrections_um)
    return f"{len(operation.corrections_um)}-{{{durations}}}-{{{corrections}}}"


def program_table(programs: Mapping[str, CorrectionProgram]) -> str:
    """The programs (response → program) as CSV, one row a correction; times are rounded down to 0.0001 min.

    Names of responses are those of `selector.csv_text.defused`.
    """
    rows: list[tuple[object, ...]] = []
    for response, program in programs.items():
        for number, operation in enumerate(program.operations, start=1):
            for correction, (time_s, duration_s, step_um, offset_um) in enumerate(_rows(operation), start=1):
                rows.append(
                    (
                        response,
                        number,
                        correction,
                        f"{_ten_thousandths(time_s):.4f}",
                        f"{_ten_thousandths(time_s + duration_s) - _ten_thousandths(time_s):.4f}",
                        f"{step_um:.3f}",
                        f"{offset_um:.3f}",
                        f"{step_um / 1000.0:.6f}",
                        f"{offset_um / 1000.0:.6f}",
                    )
                )
    return csv_text(_HEADINGS, rows)


def program_blocks(programs: Mapping[str, CorrectionProgram], doubtful: Collection[str] = ()) -> str:
    """The programs (response → program) as timed offset blocks for people; those of `doubtful` ones say so."""
    lines = [Path(__file__).with_name("program_rules.txt").read_text(encoding="utf-8")]
    for response, program in programs.items():
        allowed = ", ".join(f"{one:g}" for one in program.tolerances_um)
        name = "".join(sign if sign.isprintable() else " " for sign in response)
        unless = "   DO NOT USE: the prediction is not good enough" * (response in doubtful)
        lines.append(f"[{name}]   tolerance {allowed} µm{unless}")
        number = 0
        for place, operation in enumerate(program.operations, start=1):
            lines.append("")
            lines.append(
                f"; operation {place}: {_clock(operation.start_s)} to {_clock(operation.end_s)}   {notation(operation)}"
            )
            for correction, (time_s, _, step_um, offset_um) in enumerate(_rows(operation)):
                number += 10
                what = "new zero" if correction == 0 else f"step {step_um:+9.3f} µm ({step_um / 1000.0:+.6f} mm)"
                lines.append(
                    f"N{number:<5} AT {_clock(time_s):>9}  OFFSET {offset_um:+9.3f} µm ({offset_um / 1000.0:+.6f} mm)"
                    f"  ; {what}"
                )
        lines.append("")
    return "\n".join(lines)


def _rows(operation: Operation) -> Iterator[tuple[float, float, float, float]]:
    columns = (operation.times_s, operation.durations_s, operation.corrections_um, operation.offsets_um)
    yield from zip(*(column.tolist() for column in columns), strict=True)


def _clock(time_s: float) -> str:
    # down, so that a correction read from here is never late
    seconds = int(time_s + 1e-6)
    return f"{seconds // 3600}:{seconds // 60 % 60:02d}:{seconds % 60:02d}"


def _ten_thousandths(time_s: float) -> float:
    return math.floor(time_s / 60.0 * 1e4 + 1e-4) / 1e4


def _minutes(minutes: float) -> str:
    text = f"{max(minutes, 0.0):.4f}".rstrip("0").rstrip(".")
    return text or "0"


def _short(value: float) -> str:
    text = f"{value:.1f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


#: Operations of which every order is tried; of more, two change places as long as that saves corrections.
MOST_TRIED_ALL = 6
_STEP_S, _WARM_UP_STEP_S = 60.0, 300.0
#: Duty cycle and times (n_times,) [s] → displacements (n_times, n_responses) [µm].
Course = Callable[[Cyclogram, Vector], Vector]


@dataclass(frozen=True)
class BestOrder:
    """The order that needs the fewest corrections; the given one if none needs fewer."""

    operations: tuple[int, ...]  #: Numbers of the operations as they were given, from 1 on
    corrections: int  #: Corrections of all displacements together
    as_given: int  #: Those of the order that was given
    tried: int  #: Orders that were tried
    is_exact: bool  #: Whether they were all orders


def best_order(
    course: Course,
    cyclogram: Cyclogram,
    operations_s: Sequence[float],
    tolerances_um: Mapping[int, Sequence[float]],
    resolution_s: float | None = None,
) -> BestOrder:
    """The order of operations whose correction programs are the shortest; of equal ones the nearest to the given one.

    Each operation keeps its length, its speeds and its tolerance; what comes after the last stays there, and the hall
    moves by the clock. `tolerances_um` is the position of a response → its tolerance in each operation [µm].
    """
    count = len(operations_s)

    def needed(order: Sequence[int]) -> float:
        own = {r: [one[k] for k in order] for r, one in tolerances_um.items()}
        lengths = [operations_s[k] for k in order]
        return _corrections(course, reordered(cyclogram, operations_s, order), lengths, own, resolution_s)

    given = tuple(range(count))
    first = best = (needed(given), given)
    tried = 1
    is_exact = count <= MOST_TRIED_ALL
    while True:
        orders: Iterable[tuple[int, ...]] = itertools.permutations(given) if is_exact else _swapped(best[1])
        found = [(needed(order), order) for order in orders if order != best[1]]
        tried += len(found)
        least = min(found, key=lambda one: one[0], default=best)
        is_better = least[0] < best[0]
        best = least if is_better else best
        if is_exact or not is_better:
            break
    return BestOrder(tuple(k + 1 for k in best[1]), int(best[0]), int(first[0]), tried, is_exact)


def _corrections(
    course: Course,
    cyclogram: Cyclogram,
    operations_s: Sequence[float],
    tolerances_um: Mapping[int, Sequence[float]],
    resolution_s: float | None,
) -> float:
    """How many all displacements need together; infinite where one is too steep for the resolution."""
    time = np.union1d(np.arange(0.0, cyclogram.end_s, _STEP_S), np.r_[cyclogram.start_s, np.cumsum(operations_s)])
    displacement, total = course(cyclogram, time), 0
    for r, tolerance in tolerances_um.items():
        try:
            program = correction_program(time, displacement[:, r], operations_s, tolerance, resolution_s)
        except InputError:
            return np.inf
        total += sum(len(one.times_s) - 1 for one in program.operations)
    return total


@dataclass(frozen=True)
class BestWarmUp:
    """The warm-up before the duty cycle that leaves the fewest corrections, the shortest of these."""

    minutes: float  #: 0 if none needs fewer
    speed_rpm: float
    corrections: int  #: Of all displacements together
    without: int  #: Those without a warm-up
    tried: int


def best_warm_up(
    course: Course,
    cyclogram: Cyclogram,
    operations_s: Sequence[float],
    tolerances_um: Mapping[int, Sequence[float]],
    resolution_s: float | None,
    longest_s: float,
) -> BestWarmUp:
    """As `best_order`, of warm-ups of up to so long, in steps of 5 min, at the speeds of the duty cycle."""
    without = _corrections(course, cyclogram, operations_s, tolerances_um, resolution_s)
    best, tried = (without, 0.0, 0.0), 0
    for speed in np.unique(cyclogram.speed_rpm[cyclogram.speed_rpm > 0]).tolist():
        for length_s in np.arange(_WARM_UP_STEP_S, longest_s + 1e-6, _WARM_UP_STEP_S).tolist():

            def warmed(cycle: Cyclogram, time_s: Vector, before: tuple[float, float] = (length_s, speed)) -> Vector:
                starts, speeds = np.r_[0.0, cycle.start_s + before[0]], np.r_[before[1], cycle.speed_rpm]
                return course(Cyclogram(starts, speeds, cycle.end_s + before[0]), time_s + before[0])

            needed = _corrections(warmed, cyclogram, operations_s, tolerances_um, resolution_s)
            best, tried = min(best, (needed, length_s, speed)), tried + 1
    return BestWarmUp(best[1] / 60.0, best[2], int(best[0]), int(without), tried)


def _swapped(order: tuple[int, ...]) -> Iterable[tuple[int, ...]]:
    for i, j in itertools.combinations(range(len(order)), 2):
        other = list(order)
        other[i], other[j] = order[j], order[i]
        yield tuple(other)


def reordered(cyclogram: Cyclogram, operations_s: Sequence[float], order: Sequence[int]) -> Cyclogram:
    """The duty cycle with its operations in another order; what comes after them stays there."""
    edges = np.r_[0.0, np.cumsum(operations_s)]
    pieces = [(edges[k], edges[k + 1]) for k in order]
    if edges[-1] < cyclogram.end_s * (1.0 - 1e-12):
        pieces.append((edges[-1], cyclogram.end_s))
    starts, speeds, now = [], [], 0.0
    for begin, end in pieces:
        changes = cyclogram.start_s[(cyclogram.start_s > begin) & (cyclogram.start_s < end)]
        at = np.r_[begin, changes]
        starts.append(now + at - begin)
        speeds.append(cyclogram.speed_at(at))
        now += end - begin
    return Cyclogram(np.concatenate(starts), np.concatenate(speeds), float(now))
