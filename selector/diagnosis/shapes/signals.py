"""Courses made of recorded courses, run by run, the even clock they need, and what kind of record they stand in."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from scipy.signal import savgol_filter

from selector.diagnosis.comparison import Comparison
from selector.physics.thermal.schedule import lagged as first_order
from selector.types import Matrix, Vector


def by_run(comparison: Comparison, made: Callable[..., Vector], *courses: Vector) -> Vector:
    """A course that is made of others run by run."""
    return np.concatenate([made(*(values[rows] for values in courses)) for _, rows in comparison.rows_of_runs()])


def course(comparison: Comparison, name: str) -> Vector:
    """The recorded channel without holes, in its canonical unit; of a channel that is only simulated, that."""
    return comparison.filled(comparison.recorded[name] if name in comparison.recorded else comparison.simulated[name])


def by_movement(comparison: Comparison, names: Iterable[str]) -> list[str]:
    """The channels that move [each in its unit], those that move most first: where some are looked at, it is these.

    In what order a file has its columns says nothing.
    """
    spread = {name: float(np.std(course(comparison, name))) for name in names}
    return sorted((n for n in spread if excited(course(comparison, n))), key=lambda name: -spread[name])


def rise(comparison: Comparison, values: Vector, *, over_samples: int = 5) -> Vector:
    """What the course has risen since the start of its run (median of the first samples)."""
    return by_run(comparison, lambda part: part - np.median(part[:over_samples]), values)


def lagged(comparison: Comparison, values: Vector, tau_s: float, *, settled: bool = False) -> Vector:
    """First-order lag of a course, run by run, see `schedule.lagged`; it starts at 0, or with `settled` settled."""
    start = None if settled else 0.0
    return by_run(comparison, lambda x, t: first_order(t, x, tau_s, start), values, comparison.time_s)


def rate(comparison: Comparison, values: Vector, *, over_samples: int = 1) -> Vector:
    """Time derivative [unit/s]; with `over_samples` > 2 of a quadratic through that many (odd number of) samples."""
    result = np.zeros(len(values))
    for _, rows in comparison.rows_of_runs():
        part, time = values[rows], comparison.time_s[rows]
        if len(part) < 3:
            continue
        if over_samples > 2 and len(part) > over_samples:
            part = savgol_filter(part, over_samples | 1, 2)
        result[rows] = np.gradient(part, time)
    return result


def time_constants(comparison: Comparison, n: int = 8) -> Vector:
    """Time constants worth trying [s], even in their logarithm: from 4 samples to the length of the longest run."""
    low = max(4.0 * comparison.period_s, comparison.longest_s / 200.0)
    return np.geomspace(low, max(comparison.longest_s, 2.0 * low), n)


def quick_time_constants(comparison: Comparison, first: float) -> Vector:
    """Shorter ones than the `first` of `time_constants` [s], twice as long each as the one before, from a sample on."""
    steps = int(np.log2(max(first / comparison.period_s, 1.0)))
    return np.asarray(first * 0.5 ** np.arange(steps, 0, -1))


def in_run(comparison: Comparison, run: str, values: Vector) -> Vector:
    """The course in one run, 0 in all others."""
    return np.asarray(np.where(comparison.run_index == comparison.runs.index(run), values, 0.0))


def scaled(values: Vector) -> Vector:
    """The course divided by its root mean square (an all-zero course stays)."""
    rms = float(np.sqrt(np.mean(values**2)))
    return np.asarray(values / rms) if rms > 0.0 else values


def excited(values: Vector, resolution: float = 0.0) -> bool:
    """Whether a course moves at all: its spread is above rounding and above half its resolution.

    What takes few values far apart (a switch, steps of speed) has a resolution as large as its range, and moves.
    """
    step = resolution if resolution < 0.5 * float(np.ptp(values)) else 0.0
    return float(np.std(values)) > max(1e-9 * float(np.abs(values).max(initial=0.0)), 0.5 * step, 1e-300)


#: Stamps that are off by less than this share of a period are even: what a filter makes of it is below 1 %.
_JITTER = 0.02
#: A run is stretched to at most so many times its rows; beyond, its gaps are too long for a filter anyway.
_MOST_FILLED = 20


@dataclass(frozen=True, eq=False)
class EvenRun:
    """A run on an even clock."""

    rows: slice  #: Its rows in the comparison
    time_s: Vector  #: (n_rows,): Their stamps [s]
    clock_s: Vector  #: (n_even,): The even clock [s]; of a run that is even already, the stamps

    def on(self, values: Vector) -> Vector:
        """The run's part of a course without holes, on the even clock."""
        part = values[self.rows]
        return part if self.is_even else np.interp(self.clock_s, self.time_s, part)

    def back(self, values: Vector) -> Vector:
        """A course of the even clock at the rows of the run."""
        return values if self.is_even else np.interp(self.time_s, self.clock_s, values)

    @property
    def is_even(self) -> bool:
        """Whether nothing had to be interpolated."""
        return self.clock_s is self.time_s


def even_runs(comparison: Comparison) -> tuple[EvenRun, ...]:
    """Every run on the even clock of the median period."""
    period = comparison.period_s
    found = []
    for _, rows in comparison.rows_of_runs():
        time = comparison.time_s[rows]
        n = round((time[-1] - time[0]) / period) + 1 if len(time) else 0
        clock = time[:1] + period * np.arange(min(n, _MOST_FILLED * len(time)))
        even = n == len(time) and float(np.abs(clock - time).max(initial=0.0)) <= _JITTER * period
        found.append(EvenRun(rows, time, time if even else clock))
    return tuple(found)


def on_even_clock(comparison: Comparison, made: Callable[[Vector], Vector], values: Vector) -> Vector:
    """A course that is made of another one, without holes, on the even clock of every run."""
    return np.concatenate([run.back(np.asarray(made(run.on(values)))) for run in even_runs(comparison)])


def slope(comparison: Comparison, response: str, swept_hz: Vector) -> Vector:
    """f·dA/df of the simulated curve, run by run [unit of the response]: what a shift of all resonances adds."""
    amplitude = comparison.simulated_course(response)
    result = np.zeros(len(amplitude))
    for _, rows in comparison.rows_of_runs():
        f, a = swept_hz[rows], amplitude[rows]
        levels, which = np.unique(f, return_inverse=True)
        if len(levels) < 3:
            continue
        mean = np.bincount(which, a) / np.bincount(which)
        result[rows] = (levels * np.gradient(mean, levels))[which]
    return result


def resonance(swept_hz: Vector, frequency_hz: float, damping: float) -> Matrix:
    """Real and imaginary part of 1/(1 − r² + 2iζr), r = f/f₀, shape (n_rows, 2)."""
    r = swept_hz / frequency_hz
    h = 1.0 / (1.0 - r * r + 2j * damping * r)
    return np.column_stack([h.real, h.imag])


SLOWEST_VIBRATION_S = 0.05  #: A record with longer steps shows no vibration of a machine, which begin at some hertz.
FEWEST_ROWS = 60  #: Of fewer rows no spectrum has a floor that a line could stand out of.
MOTION_ROLES = ("displacement", "acceleration", "velocity", "position", "voltage", "force")
_GAUGE_ROLES = ("displacement", "voltage", "amplitude", "position")
_ROOM_ROLES = ("temperature", "ambient")
_DRIVE_ROLES = ("position_command", "current")


def no_vibration(comparison: Comparison, response: str, *, roles: tuple[str, ...] = MOTION_ROLES) -> str | None:
    """Why the response is no vibration in time, in one clause; None if it is one."""
    role = comparison.channel(response).role
    if role not in roles:
        return f"{response} is of role {role!r}; a vibration is recorded as {', '.join(roles)}"
    if comparison.period_s > SLOWEST_VIBRATION_S:
        return f"a sample every {comparison.period_s:.3g} s is too slow for vibration"
    rows = int(np.sum(np.isfinite(comparison.recorded[response]) & ~comparison.held_out))
    if rows < FEWEST_ROWS:
        return f"{rows} samples to fit to are too few for vibration"
    return None


def of_a_drive(comparison: Comparison, response: str) -> str | None:
    """Why the structural effects are left to those of drives, in one clause; None if this is no feed drive.

    What an axis shakes is seen by an accelerometer, and no effect of a drive is looked for in that.
    """
    if comparison.channel(response).role == "acceleration":
        return None
    roles = {c.role for c in comparison.channels}
    if "feed_rate" in roles and not roles & {"force", "acceleration"}:
        return f"{response} belongs to a feed that is recorded with it, not to a structure that is shaken"
    if "position_command" in roles or ("current" in roles and roles & {"velocity", "position"}):
        return f"{response} belongs to a feed drive, whose flexibility and friction are effects drive.*"
    return None


def swept_hz(comparison: Comparison, response: str) -> Vector | None:
    """Frequency of every row of a response curve taken step by step [Hz]; None if the response is no such curve."""
    role = comparison.channel(response).role
    if role != "amplitude" and not (role == "displacement" and comparison.with_role("frequency")):
        return None
    if role == "displacement" and comparison.period_s <= SLOWEST_VIBRATION_S:
        return None
    for name in comparison.with_role("frequency", "spindle_speed"):
        per_hz = 60.0 if comparison.channel(name).role == "spindle_speed" else 1.0
        steps = course(comparison, name) / per_hz
        if excited(steps) and float(np.ptp(steps)) > 0.05 * float(np.abs(steps).max()):
            return steps
    return None


def no_gauging(comparison: Comparison, response: str) -> str | None:
    """Why the response is neither a gauged size nor the reading of a gauge, in one clause; None if it is."""
    role = comparison.channel(response).role
    if role == "size":
        return None
    roles = {c.role for c in comparison.channels}
    if role not in _GAUGE_ROLES:
        return f"{response} is of role {role!r}, not a size and not the reading of a gauge"
    if "size" in roles:
        return None
    if roles & set(_ROOM_ROLES) or roles & set(_DRIVE_ROLES) or "feed_rate" not in roles:
        return "neither a channel of role 'size' nor the feed of a gauged grinding process is recorded"
    return None


def part_by_part(comparison: Comparison, response: str) -> bool:
    """Whether every row is a finished part, and not a sample of a course in time."""
    return comparison.channel(response).role == "size" and comparison.period_s >= 0.5


def no_flow(comparison: Comparison, response: str) -> str | None:
    """Why the response is no level of a store that something flows into, in one clause; None if it is."""
    role = comparison.channel(response).role
    if role not in ("voltage", "displacement", "position", "flow", "state", "size", "amplitude"):
        return f"{response} is of role {role!r}, not a level or a flow"
    roles = {c.role for c in comparison.channels}
    if comparison.period_s < SLOWEST_VIBRATION_S:
        return f"a sample every {comparison.period_s:.3g} s is too quick for a store that fills"
    if "flow" not in roles and role != "voltage":
        return "no flow is recorded"
    if roles & {*_ROOM_ROLES, *_DRIVE_ROLES, "spindle_speed", "feed_rate", "force", "acceleration"}:
        return "the record is one of a machine, not of stores and flows"
    return None
