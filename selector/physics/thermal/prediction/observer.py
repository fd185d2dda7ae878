"""A day that leaves its plan: which stops the thermometers show, and the displacement of the machine that had them.

How readings weigh the courses that the day may have had stands in docs/explanation/duty-cycles.md. The displacement is
their mean, and after the last reading that of the likeliest; the course at a reading uses that and those before it.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from selector.physics.thermal.modes.modes import Cyclogram
from selector.types import Matrix, Vector

STOP_EVERY_S, STOP_LASTS_S = 24 * 3600.0, 45 * 60.0  #: Expected of stops before anything is read.
STEP_S, MOST_STEPS = 60.0, 600  #: Readings are means over so long, and over longer where the day has more of them.
MOST_PLACES = 12  #: Moments between two readings, one a step, at which a stop may begin or end.
#: Courses whose logarithm of the likelihood is further below the best are given up, and do not branch.
GIVEN_UP, BRANCHES = 10.0, 4.0
_TIED = 1e-6  #: Courses closer than that in it differ by rounding only: they are the same up to the last reading.
MOST_PATHS = 120
_MOST_BRANCHING = 12
#: Mean square of what readings differ from the likeliest course, in units of what is expected, that is no chance.
FAR_OFF = 3.0
_LEAST_K, _WALK = 0.01, 2.0  #: Least noise [K]; so many times what left-out tests were off, a reading walks in an hour.
#: A stop that begins so shortly before a planned one is the planned one: no operation begins to the second.
_AHEAD_S = np.array([0.0, 60.0, 120.0])
_UNKNOWN_K = 1e3  #: A thermometer that has not been read yet may be off by so much.


@dataclass(frozen=True)
class DayReadings:
    """What thermometers read on a day that begins with the duty cycle."""

    thermometers: tuple[str, ...]  #: Their names, as in the tests
    time_s: Vector  #: (n_times,): Times from its start [s]
    temperature_degc: Vector  #: (n_times, n_thermometers): Readings [°C]; NaN where missing
    #: Response → displacement that was measured on the day [µm], (n_times,), if it was
    measured_um: dict[str, Vector]

    @property
    def steps(self) -> tuple[Vector, Vector]:
        """Mean times (n_steps,) [s] and rises since the first reading (n_steps, n_thermometers) [K]."""
        step_s = max(STEP_S, float(self.time_s[-1]) / MOST_STEPS)
        begins = np.flatnonzero(np.diff(np.floor(self.time_s / step_s), prepend=-1.0))
        known = np.isfinite(self.temperature_degc)
        counts = np.add.reduceat(known, begins, axis=0, dtype=np.float64)
        sums = np.add.reduceat(np.where(known, self.temperature_degc, 0.0), begins, axis=0)
        means = np.divide(sums, counts, out=np.full(sums.shape, np.nan), where=counts > 0)
        lengths = np.diff(np.r_[begins, len(self.time_s)])
        first = np.array([one[np.isfinite(one)][0] for one in means.T])
        return np.add.reduceat(self.time_s, begins) / lengths, means - first


@dataclass(frozen=True)
class Stop:
    """The spindle stood, as no plan said."""

    from_s: float  #: from_s and to_s: From when to when [s]; `to_s` is None while it stands
    to_s: float | None = None
    delays: bool = False  #: Whether the plan went on from where it was left, and not by the clock


@dataclass(frozen=True)
class Observed:
    """What the readings say of the day."""

    thermometers: tuple[str, ...]
    read_until_s: float  #: The last reading [s]; what follows is foreseen
    time_s: Vector  #: (n_times,): Times [s] from the start of the day
    displacement_um: Vector  #: (n_times, n_responses): Displacements [µm]
    stops: tuple[Stop, ...]  #: Those of the likeliest course
    misfit: float  #: Mean square of what readings are off that course, in units of what is expected of them
    #: Response with values of the day → root mean square of plan alone, and of this, less what was measured [µm]
    errors_um: dict[str, tuple[float, float]]

    @property
    def explains_nothing(self) -> bool:
        """Whether readings are off the likeliest course by more than chance: it says nothing of the day."""
        return self.misfit > FAR_OFF

    def as_dict(self, responses: Sequence[str]) -> dict[str, Any]:
        """JSON form, a part of `selector.prediction/1`; courses of thermometers are in K, whatever their key."""
        return {
            "thermometers": list(self.thermometers),
            "read_until_s": self.read_until_s,
            "time_s": self.time_s.tolist(),
            "displacement_um": dict(zip(responses, self.displacement_um.T.tolist(), strict=True)),
            "stops": [
                {"from_s": one.from_s, "to_s": one.to_s, "delays_plan": one.delays}
                for one in (() if self.explains_nothing else self.stops)
            ],
            "misfit": self.misfit,
            "errors_um": {name: {"plan": plan, "observed": seen} for name, (plan, seen) in self.errors_um.items()},
        }


@dataclass(frozen=True)
class _Path:
    """A course of the day that may have been, and what each thermometer is off for other reasons."""

    stops: tuple[Stop, ...]
    cyclogram: Cyclogram
    course: Vector  # (n_steps, n_responses)
    slope: Vector  # (n_steps, n_responses): how it changes with the moment of the last stop, or of its end [1/s]
    log_weight: float
    state: Vector  # (n_thermometers + 1,): what each thermometer is off [K], and how much later that moment is [s]
    covariance: Matrix
    squares: float = 0.0

    @property
    def settled(self) -> tuple[Stop, ...]:
        """Its stops, the last moment where the readings have it."""
        return _later(self.stops, float(self.state[-1])) if self.stops else ()

    def at(self, i: int) -> Vector:
        """The responses at a step."""
        return np.asarray(self.course[i] + self.slope[i] * self.state[-1])

    @property
    def stands(self) -> bool:
        return bool(self.stops) and self.stops[-1].to_s is None

    def read(self, i: int, rise_k: Vector, columns: list[int], noise_k: Vector, walk_k2: Vector) -> "_Path":
        """After the readings of a step; `walk_k2` is what each thermometer may have wandered since the last."""
        state, covariance = self.state.copy(), self.covariance.copy()
        covariance[np.arange(len(walk_k2)), np.arange(len(walk_k2))] += walk_k2
        lost = squares = 0.0
        for k in np.flatnonzero(np.isfinite(rise_k)):
            slope = self.slope[i, columns[k]]
            shared = covariance[:, k] + slope * covariance[:, -1]
            variance = float(shared[k] + slope * shared[-1] + noise_k[k] ** 2)
            off = float(rise_k[k] - self.course[i, columns[k]] - state[k] - slope * state[-1])
            state += shared * off / variance
            covariance -= np.outer(shared, shared) / variance
            squares += off**2 / variance
            lost += 0.5 * (off**2 / variance + float(np.log(variance)))
        weight, all_squares = self.log_weight - lost, self.squares + squares
        return replace(self, log_weight=weight, state=state, covariance=covariance, squares=all_squares)


def as_run(plan: Cyclogram, stops: Sequence[Stop], end_s: float) -> Cyclogram:
    """The duty cycle with stops in it, up to a time [s]; after the plan the spindle stands."""
    rows = [*zip(plan.start_s.tolist(), plan.speed_rpm.tolist(), strict=True), (plan.end_s, 0.0)]
    for stop in stops:
        before = [row for row in rows if row[0] < stop.from_s]
        if stop.to_s is None:
            rows = [*before, (stop.from_s, 0.0)]
            continue
        left_s, later_s = (stop.from_s, stop.to_s - stop.from_s) if stop.delays else (stop.to_s, 0.0)
        speed = next(speed for start, speed in reversed(rows) if start <= left_s)
        after = [(start + later_s, speed) for start, speed in rows if start > left_s]
        rows = [*before, (stop.from_s, 0.0), (stop.to_s, speed), *after]
    starts, speeds = zip(*(row for row in rows if row[0] < end_s), strict=True)
    return Cyclogram(np.array(starts), np.array(speeds), end_s)


def observed(
    course: Callable[[Cyclogram, Vector], Vector],
    plan: Cyclogram,
    responses: Sequence[str],
    readings: DayReadings,
    noise_k: Vector,
    drift_k: Vector,
) -> Observed:
    """The displacement of the day as the readings have it, and from the last one on as it is foreseen.

    `course` gives the responses (n_times, n_responses) of a duty cycle at times; the thermometers are among them.
    `noise_k` and `drift_k`, (n_thermometers,), are standard deviations of a reading, and of what left-out tests were
    off [K].
    """
    time_s, rise_k = readings.steps
    columns = [responses.index(name) for name in readings.thermometers]
    noise_k, drift_k = np.maximum(noise_k, _LEAST_K), _WALK * np.maximum(drift_k, _LEAST_K)
    last_s = float(time_s[-1])
    until_s = last_s + STEP_S + float(_AHEAD_S[-1])

    def path(stops: tuple[Stop, ...], like: _Path, chance: float, within_s: float) -> _Path:
        """A course that has just come to its last moment, which lies anywhere `within_s`."""
        by_s = 0.1 * within_s
        cycle, later = (as_run(plan, moved, until_s) for moved in (stops, _later(stops, by_s)))
        went = course(cycle, time_s)
        slope = (course(later, time_s) - went) / by_s
        state, covariance = like.state.copy(), like.covariance.copy()
        state[-1], covariance[-1], covariance[:, -1] = 0.0, 0.0, 0.0
        covariance[-1, -1] = within_s**2 / 12.0
        weight = like.log_weight + float(np.log(chance))
        return _Path(stops, cycle, went, slope, weight, state, covariance, like.squares)

    def branches(one: _Path, moments_s: Vector, each_s: float) -> list[_Path]:
        """It may stop, or go on, around each of these moments."""
        found, planned = [], as_run(plan, (), until_s).speed_at(moments_s)
        stops = one.settled
        for at_s, speed in zip(moments_s.tolist(), planned.tolist(), strict=True):
            if one.stands:
                *before, stop = stops
                for delays in (False, True) if speed > 0 else (True,):
                    ended = (*before, replace(stop, to_s=max(at_s, stop.from_s), delays=delays))
                    found.append(path(ended, one, each_s / STOP_LASTS_S / 2.0, each_s))
            elif (one.cyclogram.speed_at(at_s + _AHEAD_S) > 0).all():
                found.append(path((*stops, Stop(at_s)), one, each_s / STOP_EVERY_S, each_s))
        return found

    begin = as_run(plan, (), until_s)
    variances = np.where(np.isfinite(rise_k[0]), noise_k, _UNKNOWN_K) ** 2
    as_planned, nothing = course(begin, time_s), np.zeros(len(columns) + 1)
    still = np.zeros_like(as_planned)
    paths = [_Path((), begin, as_planned, still, 0.0, nothing, np.diag(np.r_[variances, 0.0]))]
    followed = as_planned.copy()
    for i in range(1, len(time_s)):
        step_s = float(time_s[i] - time_s[i - 1])
        places = int(np.clip(round(step_s / STEP_S), 1, MOST_PLACES))
        moments_s = time_s[i - 1] + step_s * (np.arange(places) + 0.5) / places
        for one in [one for one in paths[:_MOST_BRANCHING] if one.log_weight > paths[0].log_weight - BRANCHES]:
            paths += branches(one, moments_s, step_s / places)
        walk_k2 = drift_k**2 * step_s / 3600.0
        paths = [one.read(i, rise_k[i], columns, noise_k, walk_k2) for one in paths]
        paths.sort(key=lambda one: -one.log_weight)
        paths = [one for one in paths[:MOST_PATHS] if one.log_weight > paths[0].log_weight - GIVEN_UP]
        weights = np.exp([one.log_weight - paths[0].log_weight for one in paths])
        followed[i] = np.tensordot(weights / weights.sum(), np.array([one.at(i) for one in paths]), 1)
    tied = [one for one in paths if one.log_weight > paths[0].log_weight - _TIED]
    likeliest = min(tied, key=lambda one: sum(stop.delays for stop in one.stops))
    stops = likeliest.settled
    end_s = plan.end_s + sum(stop.to_s - stop.from_s for stop in stops if stop.to_s and stop.delays)
    ahead_s = np.arange(last_s + STEP_S, end_s + STEP_S - 1e-6, STEP_S).clip(max=end_s)
    ahead = course(as_run(plan, stops, end_s + STEP_S), ahead_s)
    followed = np.vstack([followed, ahead])
    every_s, count = np.r_[time_s, ahead_s], max(int(np.isfinite(rise_k[1:]).sum()), 1)
    errors = {}
    for name, measured in readings.measured_um.items():
        rows = np.flatnonzero(np.isfinite(measured) & (readings.time_s <= min(plan.end_s, last_s)))
        if not rows.size:
            continue
        at_s, moved, r = readings.time_s[rows], measured[rows] - measured[rows[0]], responses.index(name)
        both = course(plan, at_s)[:, r], np.interp(at_s, every_s, followed[:, r])
        plain, seen = (float(np.sqrt(np.mean((one - one[0] - moved) ** 2))) for one in both)
        errors[name] = plain, seen
    misfit = likeliest.squares / count
    return Observed(readings.thermometers, last_s, every_s, followed, stops, misfit, errors)


def _later(stops: tuple[Stop, ...], by_s: float) -> tuple[Stop, ...]:
    """The same with the last moment so much later [s]."""
    *before, last = stops
    moved = Stop(last.from_s + by_s) if last.to_s is None else replace(last, to_s=max(last.to_s + by_s, last.from_s))
    return (*before, moved)
