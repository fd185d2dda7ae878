"""What would the recording and the simulation look like in a run that was not made? Learnt from those that were."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.next_run.planned_runs import PlannedRun
from selector.diagnosis.shapes.axis import derivatives
from selector.diagnosis.shapes.heating import SHORTEST_S, follows_sensors, heats, sources
from selector.diagnosis.shapes.signals import SLOWEST_VIBRATION_S, filled, lagged, rise, time_constants
from selector.types import Matrix, Vector

Blocks = list[Matrix]

NEW_RUN = "planned run"
_WEIGHTS = (1e-8, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2)
_AS_WELL = 1.02
_MOST_ROWS = 4000
_LAGS_S = (0.0, 0.004, 0.012, 0.035, 0.1)
_LEAST_KNOWN = 0.8
"""A simulated course of which less than this share of variance is learnt says nothing about another run."""


def extended(comparison: Comparison, planned: PlannedRun, response: str) -> Comparison | None:
    """The comparison with the planned run behind the others; None if the response cannot be foretold there.

    What is set is as planned. Other channels and simulated courses are ridge regressions on what is set, with its lags,
    learnt in the recorded runs: of heat on lagged powers of speed, hall, coolant; of a drive on lagged speed,
    acceleration and sense. A simulated vibration is its filter from the recorded forces, and what these do
    not explain once more. Recorded responses are as simulated.
    """
    n = len(next(iter(planned.inputs.values())))
    stage = _padded(comparison, planned.inputs, n)
    is_slow = comparison.longest_s >= SHORTEST_S
    is_shaken = comparison.period_s <= SLOWEST_VIBRATION_S and not _moved(comparison, tuple(planned.inputs))
    table = _columns(comparison, stage, tuple(planned.inputs), response)
    recorded, simulated = dict(stage.recorded), dict(stage.simulated)
    for channel in comparison.channels:
        if channel.name in planned.inputs or channel.name in comparison.responses:
            continue
        of = filled(comparison, comparison.recorded[channel.name])
        if channel.role == "state":
            recorded[channel.name] = np.r_[comparison.recorded[channel.name], np.full(n, np.median(of))]
        else:
            recorded[channel.name] = np.r_[
                comparison.recorded[channel.name], _foretold(comparison, table, of, as_rise=is_slow)[0]
            ]
    stage = replace(stage, recorded=recorded)
    for name in comparison.simulated:
        if name in planned.inputs:
            continue
        of = filled(comparison, comparison.simulated[name])
        if is_shaken:
            simulated[name] = np.r_[comparison.simulated[name], _shaken(comparison, planned.inputs, of, n)]
            continue
        is_static = is_slow and name in comparison.responses and follows_sensors(comparison, name)
        part, known = _foretold(comparison, [_sensor_columns(stage, name)] if is_static else table, of, as_rise=is_slow)
        if name == response and known < _LEAST_KNOWN:
            return None
        simulated[name] = np.r_[comparison.simulated[name], part]
    for name in comparison.responses:
        usual = np.nanmedian(comparison.difference(name))
        new = planned.inputs.get(name, simulated[name][-n:])
        recorded[name] = np.r_[comparison.recorded[name], new + usual]
    return replace(stage, recorded=recorded, simulated=simulated)


def _padded(comparison: Comparison, inputs: Mapping[str, Vector], n: int) -> Comparison:
    """The comparison with a new run in which only what is set is known; the rest is 0 until it is learnt."""

    def longer(part: Mapping[str, Vector]) -> dict[str, Vector]:
        return {name: np.r_[values, inputs.get(name, np.zeros(n))] for name, values in part.items()}

    return replace(
        comparison,
        runs=(*comparison.runs, NEW_RUN),
        starts=(*comparison.starts, comparison.starts[-1] + n),
        time_s=np.r_[comparison.time_s, np.arange(n) * comparison.period_s],
        recorded=longer(comparison.recorded),
        simulated=longer(comparison.simulated),
        held_out=np.r_[comparison.held_out, np.zeros(n, dtype=bool)],
        findings=(),
        tangents={},
    )


def _columns(comparison: Comparison, stage: Comparison, inputs: tuple[str, ...], response: str) -> Blocks:
    """What a course of this kind of machine is made of, input by input, over all rows of the stage."""
    if comparison.longest_s >= SHORTEST_S:
        return _heat_columns(stage, inputs, response)
    moved = _moved(comparison, inputs)
    if moved:
        return [_drive_columns(stage, moved[0])]
    return [_lag_columns(stage, inputs)]


def _moved(comparison: Comparison, inputs: tuple[str, ...]) -> list[str]:
    return [name for name in inputs if comparison.channel(name).role in ("position_command", "position", "velocity")]


def _heat_columns(stage: Comparison, inputs: tuple[str, ...], response: str) -> Blocks:
    taus = (0.0, *time_constants(stage, 6))
    known = sources(stage, response)
    blocks = []
    for name in inputs:
        role = stage.channel(name).role
        if role in ("ambient", "temperature"):
            drivers = [rise(stage, filled(stage, stage.recorded[name]))]
        elif name == known.spindle:
            speed = np.abs(filled(stage, stage.recorded[name]))
            drivers = [(speed / max(float(speed.max()), 1e-300)) ** power for power in (1.0, 2.0)]
        else:
            drivers = [heat for _, heat in heats(stage, name)]
        blocks.append(np.column_stack([lagged(stage, driver, float(tau)) for driver in drivers for tau in taus]))
    return blocks


def _drive_columns(stage: Comparison, name: str) -> Matrix:
    told = filled(stage, stage.simulated[name] if name in stage.simulated else stage.recorded[name])
    if stage.channel(name).role == "velocity":
        speed, acceleration = told, derivatives(stage, told)[0]
        place = np.zeros(len(told))
    else:
        place = told
        speed, acceleration = derivatives(stage, told)
    sense = np.tanh(speed / max(0.01 * float(np.abs(speed).max()), 1e-12))
    moving = [lagged(stage, course, lag) for course in (speed, acceleration, sense) for lag in _LAGS_S]
    return np.column_stack([np.ones(len(told)), place, *moving])


def _lag_columns(stage: Comparison, inputs: tuple[str, ...]) -> Matrix:
    taus = (0.0, *np.geomspace(4.0 * stage.period_s, max(stage.longest_s, 8.0 * stage.period_s), 6))
    drivers = [filled(stage, stage.recorded[name]) for name in inputs]
    columns = [lagged(stage, driver, float(tau), settled=True) for driver in drivers for tau in taus]
    return np.column_stack([np.ones(len(stage.time_s)), *columns])


def _sensor_columns(stage: Comparison, response: str) -> Matrix:
    """Rises of the temperatures and their products: what a static regression is made of."""
    known = sources(stage, response)
    names = dict.fromkeys((*known.machine, *known.hall, *known.coolant_temperatures))
    rises = [rise(stage, filled(stage, stage.recorded[name])) for name in names]
    return np.column_stack([*rises, *(a * b for k, a in enumerate(rises) for b in rises[k:])])


def _shaken(comparison: Comparison, inputs: Mapping[str, Vector], values: Vector, n: int) -> Vector:
    """A vibration in the new run: through the filter (H1 estimate) from the forces, and the rest as it was."""
    rest, result = np.array(values), np.zeros(n)
    longest = max((rows for _, rows in comparison.rows_of_runs()), key=lambda rows: rows.stop - rows.start)
    size = min(1024, (longest.stop - longest.start) // 2)
    for name, new in inputs.items():
        force = filled(comparison, comparison.recorded[name])
        if comparison.channel(name).role == "spindle_speed" or float(np.std(force)) <= 0.0:
            continue
        power = signal.welch(force, nperseg=size)[1]
        crossed = signal.csd(force, rest, nperseg=size)[1]
        impulse = np.fft.irfft(crossed / (power + 1e-3 * power.max()))[: size // 2]
        for _, rows in comparison.rows_of_runs():
            rest[rows] -= signal.lfilter(impulse, [1.0], force[rows])
        result += signal.lfilter(impulse, [1.0], new)
    return np.asarray(result + np.resize(rest[longest], n))


def _foretold(comparison: Comparison, blocks: Blocks, values: Vector, *, as_rise: bool) -> tuple[Vector, float]:
    """The course in the new run, and the share of its variance in the recorded ones that was learnt."""
    old = len(comparison.time_s)
    target = rise(comparison, values) if as_rise else values
    start = float(np.median([values[first] for first in comparison.starts[:-1]])) if as_rise else 0.0
    table = np.column_stack(blocks)
    scale = np.sqrt(np.mean(table[:old] ** 2, axis=0))
    table = table / np.where(scale > 0.0, scale, np.inf)
    block_of = np.repeat(np.arange(len(blocks)), [block.shape[1] for block in blocks])
    beta = _ridge(comparison, table[:old], target, block_of)
    variance = float(np.var(target))
    left = float(np.var(target - table[:old] @ beta))
    known = 1.0 if variance <= 0.0 else 1.0 - left / variance
    return start + table[old:] @ beta, known


def _ridge(comparison: Comparison, table: Matrix, target: Vector, block_of: NDArray[np.intp]) -> Vector:
    """Ridge regression whose weight foretells one run from the others best; of a single run a weight of 1e-4.

    Inputs without which the other runs are foretold as well are left out: the new run may take them further than any.
    """
    stride = max(1, len(target) // _MOST_ROWS)
    parts = [(table[rows][::stride], target[rows][::stride]) for _, rows in comparison.rows_of_runs()]
    grams = np.array([x.T @ x for x, _ in parts])
    scores = np.array([x.T @ y for x, y in parts])
    size = max(float(np.trace(grams.sum(axis=0))) / max(table.shape[1], 1), 1e-300)

    def solution(without: int | None, weight: float, use: NDArray[np.bool_]) -> Vector:
        gram, score = grams.sum(axis=0), scores.sum(axis=0)
        if without is not None:
            gram, score = gram - grams[without], score - scores[without]
        beta = np.zeros(len(score))
        beta[use] = np.linalg.solve(gram[np.ix_(use, use)] + weight * size * np.eye(int(use.sum())), score[use])
        return beta

    def missed(weight: float, use: NDArray[np.bool_]) -> float:
        return float(sum(np.sum((y - x @ solution(k, weight, use)) ** 2) for k, (x, y) in enumerate(parts)))

    def best(use: NDArray[np.bool_]) -> tuple[float, float]:
        return min((missed(weight, use), weight) for weight in _WEIGHTS)

    use = np.ones(len(block_of), dtype=bool)
    if len(parts) < 2:
        return solution(None, 1e-4, use)
    error, weight = best(use)
    for block in np.unique(block_of):
        fewer = use & (block_of != block)
        if fewer.any() and (found := best(fewer))[0] <= _AS_WELL * error:
            (error, weight), use = found, fewer
    return solution(None, weight, use)
