"""The source's piecewise prediction: every segment of a duty cycle is a part of a measured characteristic."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from selector.findings import Finding, Where
from selector.physics.thermal.finding_table import FINDINGS
from selector.physics.thermal.modes.cyclogram import Cyclogram
from selector.physics.thermal.prediction.characteristics import Characteristics
from selector.types import Vector

_POINTS = 2_000  #: Points of a characteristic among which the entry is looked for.
#: A curve that goes further than this many times its beginning is no cooling that others may be scaled from.
GROWS = 1.05


@dataclass
class _Told:
    """Tables of the characteristics used; finding → when [s] more had to be done than to follow a characteristic."""

    tables: dict[float, tuple[Vector, Vector]] = field(default_factory=dict)
    starts: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))


def piecewise_displacement_um(
    curves: Sequence[Characteristics], cyclogram: Cyclogram, time_s: Vector
) -> tuple[Vector, tuple[Finding, ...]]:
    """Displacements [µm], shape (n_times, n_responses), at times [s] of shape (n_times,), and what had to be assumed.

    A running segment follows the characteristic of its speed, entered where that has the present displacement (C). An
    idle segment follows a cooling characteristic, entered likewise: of those that begin at the present displacement or
    beyond, the one that begins nearest. Where the present displacement is beyond all of the characteristic, as after a
    fall of the speed, the additional operation: the steady level is approached along a cooling curve.

    Raises InputError if a speed is outside the tests.
    """
    time = np.asarray(time_s, dtype=np.float64)
    columns: list[Vector] = []
    findings: list[Finding] = []
    for curve in curves:
        column, told = _of_response(curve, cyclogram, time)
        columns.append(column)
        findings += _findings(curve, told)
    return np.column_stack(columns), tuple(findings)


def _of_response(curve: Characteristics, cyclogram: Cyclogram, time: Vector) -> tuple[Vector, _Told]:
    told = _Told()
    values = np.zeros(len(time))
    change = np.r_[True, np.diff(cyclogram.speed_rpm) != 0]
    starts, speeds = cyclogram.start_s[change], cyclogram.speed_rpm[change]
    present = 0.0
    for start, end, speed in zip(starts, [*starts[1:], cyclogram.end_s], speeds, strict=True):
        inside = (time >= start) & (time <= end)
        at = np.r_[time[inside] - start, end - start]
        if speed > 0:
            piece = _running(curve, float(speed), present, at, float(start), told)
        else:
            piece = _cooling(curve, present, at, float(start), told)
        values[inside] = piece[:-1]
        present = float(piece[-1])
    return values, told


def _running(curve: Characteristics, speed: float, present: float, at: Vector, start: float, told: _Told) -> Vector:
    index = int(np.searchsorted(curve.speeds_rpm, speed * (1.0 - 1e-9)))
    tested_s = float(curve.tested_s[min(index, len(curve.tested_s) - 1)])
    if speed not in told.tables:
        times = np.r_[0.0, np.geomspace(1.0, 12.0 * max(float(curve.tau_s[-1]), tested_s), _POINTS), np.inf]
        told.tables[speed] = times, curve.heating_um(speed, times)
    grid, table = (column[:-1] for column in told.tables[speed])
    steady = float(told.tables[speed][1][-1])
    entries = _crossings(grid, table, present)
    if len(entries):
        if len(entries) > 1 and np.ptp(table[(grid >= entries[0]) & (grid <= entries[-1])]) > 3.0 * curve.noise_um:
            told.starts["entry-not-unique"].append(start)
        if entries[0] + at[-1] > 1.05 * tested_s:
            told.starts["characteristic-extended"].append(start)
        piece = curve.heating_um(speed, entries[0] + at)
        # the entry stands on a chord of the table
        return np.asarray(piece + (present - float(curve.heating_um(speed, entries[:1])[0])))
    if present * steady < 0:
        told.starts["displacement-on-other-side"].append(start)
        return np.asarray(curve.heating_um(speed, at) + present * _fading(curve, present, at, start, told))
    told.starts["additional-operation"].append(start)
    return np.asarray(steady + (present - steady) * _fading(curve, present, at, start, told))


def _cooling(curve: Characteristics, present: float, at: Vector, start: float, told: _Told) -> Vector:
    if present == 0.0:
        return np.zeros(len(at))
    number = _nearest_cooling(curve, present)
    if number is None or abs(curve.cooling_starts_um[number]) < abs(present):
        return present * _fading(curve, present, at, start, told)
    grid = np.r_[0.0, np.geomspace(1.0, 12.0 * float(curve.cooling_tau_s[-1]), _POINTS)]
    entries = _crossings(grid, curve.cooling_curve_um(number, grid), present)
    if not len(entries):  # below what is left at the end of the table
        return present * _fading(curve, present, at, start, told)
    piece = curve.cooling_curve_um(number, entries[0] + at)
    return np.asarray(piece + (present - float(curve.cooling_curve_um(number, entries[:1])[0])))


def _fading(curve: Characteristics, present: float, at: Vector, start: float, told: _Told) -> Vector:
    """A cooling curve from its beginning, scaled to begin at 1."""
    number = _nearest_cooling(curve, present)
    if number is None:
        told.starts["cooling-assumed"].append(start)
        fastest = float(curve.speeds_rpm[-1])
        steady = float(curve.heating_um(fastest, np.array([np.inf]))[0])
        grid = np.geomspace(1.0, 12.0 * float(curve.tau_s[-1]), 200)
        if np.abs(steady - curve.heating_um(fastest, grid)).max() > GROWS * abs(steady):
            return np.asarray(np.exp(-at / float(curve.tau_s[-1])))
        return np.asarray(1.0 - curve.heating_um(fastest, at) / steady)
    begin = float(curve.cooling_starts_um[number])
    if abs(present) > 1.02 * abs(begin):
        told.starts["cooling-scaled"].append(start)
    return np.asarray(curve.cooling_curve_um(number, at) / begin)


def _nearest_cooling(curve: Characteristics, present: float) -> int | None:
    """Of the cooling curves on the same side, the one that begins nearest beyond `present`, else the largest."""
    starts = curve.cooling_starts_um * (np.sign(present) or 1.0)
    # what is left must not grow where a curve that first grows is scaled by its beginning
    usable = np.flatnonzero((starts > 5.0 * curve.noise_um) & (GROWS * starts >= curve.cooling_largest_um))
    if not len(usable):
        return None
    beyond = usable[starts[usable] >= abs(present)]
    return int(beyond[np.argmin(starts[beyond])] if len(beyond) else usable[np.argmax(starts[usable])])


def _crossings(grid: Vector, table: Vector, level: float) -> Vector:
    """Times at which a curve has a level, linear between its points."""
    above = table - level
    exact = grid[above == 0.0]
    k = np.flatnonzero(above[:-1] * above[1:] < 0.0)
    between = grid[k] + (grid[k + 1] - grid[k]) * above[k] / (above[k] - above[k + 1])
    return np.sort(np.r_[exact, between])


_STATEMENTS = {
    "additional-operation": (
        "{response} is beyond all of the characteristic at {times}: the steady level was approached along a cooling "
        "curve."
    ),
    "displacement-on-other-side": (
        "{response} is on the other side of zero than the characteristic at {times}: what is left of it was let fade "
        "along a cooling curve beside the new characteristic."
    ),
    "entry-not-unique": (
        "The characteristic of {response} turns back and has the present displacement more than once at {times}: it "
        "was entered where it has it first."
    ),
    "cooling-scaled": (
        "{response} is beyond the beginning of every recorded cooling at {times}: the largest was scaled."
    ),
    "cooling-assumed": (
        "There is no recorded cooling that {response} can follow at {times}: it was taken to be the heating at the "
        "fastest speed upside down, or where that turns back, one exponential."
    ),
    "characteristic-extended": "{response} is followed further than the test at that speed lasted, from {times} on.",
}


def _findings(curve: Characteristics, told: _Told) -> Iterator[Finding]:
    for name, statement in _STATEMENTS.items():
        times = sorted(set(told.starts[name]))
        if times:
            shown = ", ".join(f"{time / 60:.4g}" for time in times[:6]) + (" …" if len(times) > 6 else "") + " min"
            yield FINDINGS.finding(
                name,
                statement.format(response=curve.response, times=shown),
                Where(channel=curve.response),
                {"times_s": times},
            )
