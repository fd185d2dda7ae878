"""The source's piecewise prediction: characteristics δ(n, t) of tests, of which every segment of a cycle is a part."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.optimize import least_squares

from selector.errors import InputError
from selector.findings import Finding, Where
from selector.physics.thermal.finding_table import FINDINGS
from selector.physics.thermal.modes.modes import Cyclogram, require_tested
from selector.physics.thermal.modes.thermal_test import (
    ModeData,
    Stretch,
    ThermalTest,
    coolings,
    heating_from_rest,
    mode_data,
)
from selector.types import Vector

MOST_EXPONENTIALS = 3
#: Exponentials closer than this are not told apart by noisy curves, and their amplitudes grow without bound.
CLOSEST_RATIO = 1.5
#: A block counts as at most so many samples: what is left is then lack of fit, no smaller in a longer block.
_MOST_COUNTED = 20.0


@dataclass(frozen=True)
class Characteristics:
    """What the tests say about one displacement (C: thermal characteristics from tests at continuous speeds)."""

    response: str  #: The displacement
    #: speeds_rpm and tested_s: (n_speeds,): Tested speeds, increasing [r/min], and how long each ran [s]
    speeds_rpm: Vector
    tested_s: Vector
    tau_s: Vector  #: (n_exponentials,): Time constants of the heating curves [s]
    #: (n_speeds, n_exponentials): Their amplitudes [µm]: δ(n, t) = Σ_k steady_um[n, k]·(1 − e^(−t/τ_k))
    steady_um: Vector
    exponent: float  #: Power of the speed that is taken off before interpolating between speeds
    cooling_tau_s: Vector  #: (n_cooling_exponentials,): Time constants of the cooling curves [s]
    #: (n_coolings, n_cooling_exponentials): Amplitudes of each recorded cooling curve [µm]: Σ_k cooling_um[j,
    #: k]·e^(−t/τ_k). Empty if none was recorded.
    cooling_um: Vector
    noise_um: float  #: Standard deviation of a sample [µm]

    def heating_um(self, speed_rpm: float, time_s: Vector) -> Vector:
        """δ(n, t) [µm], shape (n_times,), of continuous running from rest; infinite times give the steady level.

        Between tested speeds, δ(n, t)/n^exponent is interpolated in n at each t, by monotone cubics; below the slowest
        it is constant.

        Raises InputError if the speed is negative, or faster than the fastest tested one.
        """
        fastest = float(self.speeds_rpm[-1])
        require_tested(speed_rpm, fastest, "the fastest with a test of continuous heating from rest")
        curves = self.steady_um @ (1.0 - np.exp(-np.asarray(time_s, dtype=np.float64) / self.tau_s[:, None]))
        if len(self.speeds_rpm) > 1:
            knots = np.r_[0.0, self.speeds_rpm]
            ratios = curves / self.speeds_rpm[:, None] ** self.exponent
            ratio = PchipInterpolator(knots, np.vstack([ratios[:1], ratios]))(min(speed_rpm, fastest))
        else:
            ratio = curves[0] / fastest**self.exponent
        return np.asarray(ratio * min(speed_rpm, fastest) ** self.exponent)

    def cooling_curve_um(self, number: int, time_s: Vector) -> Vector:
        """A recorded cooling curve [µm], shape (n_times,), back to the machine at rest and cold."""
        return np.asarray(
            self.cooling_um[number] @ np.exp(-np.asarray(time_s, dtype=np.float64) / self.cooling_tau_s[:, None])
        )

    @property
    def cooling_starts_um(self) -> Vector:
        """Displacement at the beginning of each cooling curve [µm], shape (n_coolings,)."""
        return np.asarray(self.cooling_um.sum(axis=1))

    @property
    def cooling_largest_um(self) -> Vector:
        """Largest displacement of each cooling curve, without sign [µm], shape (n_coolings,)."""
        if not len(self.cooling_um):
            return np.zeros(0)
        time = np.r_[0.0, np.geomspace(1.0, 12.0 * float(self.cooling_tau_s[-1]), 200)]
        return np.asarray(np.abs(self.cooling_um @ np.exp(-time / self.cooling_tau_s[:, None])).max(axis=1))


def characteristics(tests: Sequence[ThermalTest], responses: Sequence[str]) -> tuple[Characteristics, ...]:
    """The characteristics of each response, from the tests.

    Heating curves are the first turning stretch of every run that starts cold; cooling curves all stretches at rest
    after it, and runs at rest. How they are smoothed: docs/explanation/duty-cycles.md, *Pieces of characteristics*.

    Raises InputError if no run heats continuously from rest for long enough.
    """
    data = mode_data(tests)
    heating = heating_from_rest(data)
    if not heating:
        raise InputError(
            "no run that turns at one speed from a cold start",
            expected="at least one test of continuous heating",
            where="the tests",
            advice="record the machine from cold at one speed, one run for each of several speeds",
        )
    cooled = coolings(data)
    return tuple(_of_response(data, response, r, heating, cooled) for r, response in enumerate(responses))


@dataclass(frozen=True)
class _Curve:
    """Blocks that share amplitudes: times, values, weights, and which zero each block has."""

    time_s: Vector
    value_um: Vector
    weight: Vector
    zero: Vector  # (n_blocks, n_zeros), columns of ones for the zeros that are free

    @classmethod
    def of(cls, data: ModeData, r: int, parts: Sequence[Stretch], free: bool, known_um: float = 0.0) -> "_Curve":
        blocks = np.concatenate([part.blocks for part in parts])
        owner = np.repeat(np.arange(len(parts)), [len(part.blocks) for part in parts])
        there = data.counts[blocks, r] > 0
        zeros = np.equal.outer(owner[there], np.arange(len(parts) if free else 0)).astype(np.float64)
        return cls(
            np.concatenate([part.time_s for part in parts])[there],
            data.displacement_um[blocks, r][there] - known_um,
            np.sqrt(np.minimum(data.counts[blocks, r][there], _MOST_COUNTED)) / data.noise_um[r],
            zeros,
        )

    def solved(self, tau_s: Vector, heats: bool) -> tuple[Vector, Vector]:
        """Amplitudes and zeros, and weighted residuals."""
        left = np.exp(-self.time_s[:, None] / tau_s)
        design = np.hstack([1.0 - left if heats else left, self.zero]) * self.weight[:, None]
        target = self.value_um * self.weight
        # short records do not tell long time constants from a straight line: the smallest solution
        found = np.linalg.lstsq(design, target, rcond=1e-6)[0]
        return np.asarray(found), np.asarray(design @ found - target)


def _of_response(
    data: ModeData, response: str, r: int, heating: Sequence[Stretch], cooled: Sequence[Stretch]
) -> Characteristics:
    speeds = sorted({part.speed_rpm for part in heating})
    grouped = [[part for part in heating if part.speed_rpm == speed] for speed in speeds]
    curves = [_Curve.of(data, r, parts, free=True) for parts in grouped]
    longest = max(part.duration_s for part in heating)
    tau = _time_constants(curves, True, data.period_s, longest)
    solutions = [curve.solved(tau, True)[0] for curve in curves]
    steady = np.array([solution[: len(tau)] for solution in solutions])
    zeros = {
        part.run: float(zero)
        for parts, solution in zip(grouped, solutions, strict=True)
        for part, zero in zip(parts, solution[len(tau) :], strict=True)
    }
    falls = [_Curve.of(data, r, [part], part.run not in zeros, zeros.get(part.run, 0.0)) for part in cooled]
    falls = [fall for fall in falls if len(fall.time_s) > MOST_EXPONENTIALS + 1]
    fall_tau = np.zeros(0)
    if falls:
        fall_tau = _time_constants(falls, False, data.period_s, max(part.duration_s for part in cooled))
    return Characteristics(
        response,
        np.array(speeds),
        np.array([max(part.duration_s for part in parts) for parts in grouped]),
        tau,
        steady,
        _exponent(np.array(speeds), steady.sum(axis=1)),
        fall_tau,
        np.array([fall.solved(fall_tau, False)[0][: len(fall_tau)] for fall in falls]).reshape(
            len(falls), len(fall_tau)
        ),
        float(data.noise_um[r]),
    )


def _time_constants(curves: Sequence[_Curve], heats: bool, period_s: float, longest_s: float) -> Vector:
    """As many time constants as the curves support, increasing [s]."""
    low, high = np.log(max(2.0 * period_s, longest_s / 500.0)), np.log(2.0 * longest_s)
    size = sum(len(curve.time_s) for curve in curves)
    shortest = min(len(curve.time_s) - curve.zero.shape[1] for curve in curves)

    def tau_s(shape: Vector) -> Vector:
        """From the logarithm of the first and of the ratios between neighbours."""
        return np.asarray(np.exp(np.minimum(np.cumsum(shape), high)))

    def residual(shape: Vector) -> Vector:
        return np.concatenate([curve.solved(tau_s(shape), heats)[1] for curve in curves])

    closest = np.log(CLOSEST_RATIO)
    best, lowest = np.array([longest_s / 3.0]), np.inf
    for n in range(1, MOST_EXPONENTIALS + 1):
        if n >= shortest:
            break
        step = max((high - low) / (n + 1.0), 1.01 * closest)
        found = least_squares(
            residual,
            np.r_[low + (high - low) / (n + 1.0), np.full(n - 1, step)],
            bounds=(np.r_[low, np.full(n - 1, closest)], np.r_[high, np.full(n - 1, max(high - low, 2.0 * closest))]),
            max_nfev=60,
        )
        free = n + sum(n + curve.zero.shape[1] for curve in curves)
        score = size * np.log(max(2.0 * found.cost, 1e-12) / size) + free * np.log(size)
        if score < lowest - 2.0:
            best, lowest = tau_s(found.x), score
    return best


def _exponent(speeds: Vector, steady_um: Vector) -> float:
    """Power of the speed by which the steady levels grow; 1 where they do not tell."""
    if len(speeds) < 2 or not (np.sign(steady_um) == np.sign(steady_um[-1])).all() or steady_um[-1] == 0.0:
        return 1.0
    slope = float(np.polyfit(np.log(speeds), np.log(np.abs(steady_um)), 1)[0])
    return min(max(slope, 0.5), 3.0)


_POINTS = 2_000  #: Points of a characteristic among which the entry is looked for.
#: A curve that goes further than this many times its beginning is no cooling that others may be scaled from.
GROWS = 1.05


@dataclass
class _Used:
    """Tables of the characteristics used; finding → when [s] more had to be done than to follow a characteristic."""

    tables: dict[float, tuple[Vector, Vector]] = field(default_factory=dict)
    starts: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))


def piecewise_displacement_um(
    curves: Sequence[Characteristics], cyclogram: Cyclogram, time_s: Vector
) -> tuple[Vector, tuple[Finding, ...]]:
    """Displacements [µm], shape (n_times, n_responses), at times [s] of shape (n_times,), and what had to be assumed.

    How segments follow the characteristics (C): docs/explanation/duty-cycles.md, *Pieces of characteristics*.

    Raises InputError if a speed is outside the tests.
    """
    time = np.asarray(time_s, dtype=np.float64)
    columns: list[Vector] = []
    findings: list[Finding] = []
    for curve in curves:
        column, used = _along(curve, cyclogram, time)
        columns.append(column)
        findings += _findings(curve, used)
    return np.column_stack(columns), tuple(findings)


def _along(curve: Characteristics, cyclogram: Cyclogram, time: Vector) -> tuple[Vector, _Used]:
    used = _Used()
    values = np.zeros(len(time))
    change = np.r_[True, np.diff(cyclogram.speed_rpm) != 0]
    starts, speeds = cyclogram.start_s[change], cyclogram.speed_rpm[change]
    present = 0.0
    for start, end, speed in zip(starts, [*starts[1:], cyclogram.end_s], speeds, strict=True):
        inside = (time >= start) & (time <= end)
        at = np.r_[time[inside] - start, end - start]
        if speed > 0:
            piece = _running(curve, float(speed), present, at, float(start), used)
        else:
            piece = _cooling(curve, present, at, float(start), used)
        values[inside] = piece[:-1]
        present = float(piece[-1])
    return values, used


def _running(curve: Characteristics, speed: float, present: float, at: Vector, start: float, used: _Used) -> Vector:
    index = int(np.searchsorted(curve.speeds_rpm, speed * (1.0 - 1e-9)))
    tested_s = float(curve.tested_s[min(index, len(curve.tested_s) - 1)])
    if speed not in used.tables:
        times = np.r_[0.0, np.geomspace(1.0, 12.0 * max(float(curve.tau_s[-1]), tested_s), _POINTS), np.inf]
        used.tables[speed] = times, curve.heating_um(speed, times)
    grid, table = (column[:-1] for column in used.tables[speed])
    steady = float(used.tables[speed][1][-1])
    entries = _crossings(grid, table, present)
    if len(entries):
        if len(entries) > 1 and np.ptp(table[(grid >= entries[0]) & (grid <= entries[-1])]) > 3.0 * curve.noise_um:
            used.starts["entry-not-unique"].append(start)
        if entries[0] + at[-1] > 1.05 * tested_s:
            used.starts["characteristic-extended"].append(start)
        piece = curve.heating_um(speed, entries[0] + at)
        # the entry stands on a chord of the table
        return np.asarray(piece + (present - float(curve.heating_um(speed, entries[:1])[0])))
    if present * steady < 0:
        used.starts["displacement-on-other-side"].append(start)
        return np.asarray(curve.heating_um(speed, at) + present * _fading(curve, present, at, start, used))
    used.starts["additional-operation"].append(start)
    return np.asarray(steady + (present - steady) * _fading(curve, present, at, start, used))


def _cooling(curve: Characteristics, present: float, at: Vector, start: float, used: _Used) -> Vector:
    if present == 0.0:
        return np.zeros(len(at))
    number = _nearest_cooling(curve, present)
    if number is None or abs(curve.cooling_starts_um[number]) < abs(present):
        return present * _fading(curve, present, at, start, used)
    grid = np.r_[0.0, np.geomspace(1.0, 12.0 * float(curve.cooling_tau_s[-1]), _POINTS)]
    entries = _crossings(grid, curve.cooling_curve_um(number, grid), present)
    if not len(entries):  # below what is left at the end of the table
        return present * _fading(curve, present, at, start, used)
    piece = curve.cooling_curve_um(number, entries[0] + at)
    return np.asarray(piece + (present - float(curve.cooling_curve_um(number, entries[:1])[0])))


def _fading(curve: Characteristics, present: float, at: Vector, start: float, used: _Used) -> Vector:
    """A cooling curve from its beginning, scaled to begin at 1."""
    number = _nearest_cooling(curve, present)
    if number is None:
        used.starts["cooling-assumed"].append(start)
        fastest = float(curve.speeds_rpm[-1])
        steady = float(curve.heating_um(fastest, np.array([np.inf]))[0])
        grid = np.geomspace(1.0, 12.0 * float(curve.tau_s[-1]), 200)
        if np.abs(steady - curve.heating_um(fastest, grid)).max() > GROWS * abs(steady):
            return np.asarray(np.exp(-at / float(curve.tau_s[-1])))
        return np.asarray(1.0 - curve.heating_um(fastest, at) / steady)
    begin = float(curve.cooling_starts_um[number])
    if abs(present) > 1.02 * abs(begin):
        used.starts["cooling-scaled"].append(start)
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


def _findings(curve: Characteristics, used: _Used) -> Iterator[Finding]:
    for name, statement in _STATEMENTS.items():
        times = sorted(set(used.starts[name]))
        if times:
            shown = ", ".join(f"{time / 60:.4g}" for time in times[:6]) + (" …" if len(times) > 6 else "") + " min"
            yield FINDINGS.finding(
                name,
                statement.format(response=curve.response, times=shown),
                Where(channel=curve.response),
                {"times_s": times},
            )
