"""Tests that are left out as a whole, by their speed or one by one, and what the others make of them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from selector.physics.thermal.modes.fit import Fit, solved
from selector.physics.thermal.modes.heldout import held_out_blocks, held_out_um, run_folds
from selector.physics.thermal.modes.thermal_test import ModeData
from selector.types import Vector

Rows = NDArray[np.bool_]
STILL = 0.1  #: A test is at its start until it has moved by this share of what it moves at most.

#: Standard deviation of the logarithm of true ÷ claimed error by a single test (`benchmarks/bench_claims.py`).
SPREAD_OF_CLAIMS = 1.14
AT_MOST = 2.0  #: Times what is claimed from separate tests, the error is 19 times in 20 at most.


def few_factor(judged: int) -> float:
    """How many times what so many left-out tests were off an error is at most, 19 times in 20; never below 2."""
    return max(AT_MOST, float(np.exp(1.645 * SPREAD_OF_CLAIMS / np.sqrt(max(judged, 1)))))


@dataclass(frozen=True)
class SpeedFold:
    """Runs that are left out together: those that mainly ran at this level."""

    level_rpm: float  #: The level [r/min]
    fold: Rows  #: (n_blocks,): Blocks of these runs


def runs_by_level(data: ModeData) -> dict[int, list[int]]:
    """Level, by its number → runs that mainly ran at it."""
    levels = np.array(data.levels_rpm)
    length_s = data.before_s + data.after_s
    main: dict[int, list[int]] = {}
    for run, (begin, end) in enumerate(data.bounds):
        turning = data.speed_rpm[begin:end] > 0.01 * data.fastest_rpm
        if turning.any():
            nearest = np.abs(data.speed_rpm[begin:end, None] - levels).argmin(axis=1)[turning]
            time_s = np.bincount(nearest, length_s[begin:end][turning], minlength=len(levels))
            main.setdefault(int(np.argmax(time_s)), []).append(run)
    return main


def speed_folds(data: ModeData) -> list[SpeedFold]:
    """Left-out levels below the fastest (nobody asks beyond it), as far as other runs remain that turn."""
    main = runs_by_level(data)
    if len(main) < 2:
        return []
    return [
        SpeedFold(data.levels_rpm[level], run_folds(data, [runs])[0])
        for level, runs in sorted(main.items())
        if level < len(data.levels_rpm) - 1
    ]


def law_errors(fit: Fit, data: ModeData, folds: Sequence[SpeedFold]) -> Vector:
    """Root mean square error [µm] at left-out speeds, shape (n_folds, n_responses); the zero of a run is free."""
    if fit.spec.law_kind != "levels":
        return held_out_um(fit, data, [one.fold for one in folds], own_zeros=True)
    errors = np.zeros((len(folds), fit.weights.shape[1]))
    for i, one in enumerate(folds):
        left_out, total, samples = _without_level(fit, data, one), np.zeros(errors.shape[1]), np.zeros(errors.shape[1])
        for begin, end in data.bounds:
            if one.fold[begin]:
                count = np.where(fit.weights[begin:end] > 0, data.counts[begin:end], 0.0)
                own = left_out[begin:end]
                own = own - (own * count).sum(axis=0) / np.maximum(count.sum(axis=0), 1.0)
                total, samples = total + (count * own**2).sum(axis=0), samples + count.sum(axis=0)
        errors[i] = np.sqrt(total / np.maximum(samples, 1.0))
    return errors


def _without_level(fit: Fit, data: ModeData, fold: SpeedFold) -> Vector:
    """Error [µm] of all blocks by a fit without a level, (n_blocks, n_responses); the zero of each run is unknown."""
    # the factor at a left-out level is unknown: it must come from the levels beside it
    kept = tuple(level for level in data.levels_rpm if level != fold.level_rpm)
    return solved(fit.spec, replace(data, levels_rpm=kept), fit.theta, fit.weights * ~fold.fold[:, None]).left_out_um


@dataclass(frozen=True)
class LeftOutTests:
    """Tests that begin cold, each predicted as a duty cycle is: by the others, with the zero of its start.

    error_um and moved_um, of shape (n_tests, n_responses), are root mean squares [µm] from there.
    """

    runs: tuple[int, ...]
    error_um: Vector
    moved_um: Vector
    noise_um: Vector  #: (n_tests, n_responses): What the noise of the gauge adds to both

    @property
    def rmse_um(self) -> Vector:
        """(n_responses,): Over all these tests, less the noise of the gauge, as far as it does not hide the error."""
        noise = np.mean(self.noise_um**2, axis=0)
        square = np.mean(self.error_um**2, axis=0) - noise
        return np.asarray(np.sqrt(np.maximum(square, noise * np.sqrt(2.0 / len(self.runs)))))

    def claimed_um(self, moves_um: Vector) -> Vector:
        """The error to expect in a duty cycle that moves the responses by so much, RMS (n_responses,) [µm].

        The same part of the movement as in the tests, so that it does not shrink with the hours that a machine was
        recorded at rest; of less movement than theirs half-way, by ratio, to their error. Of few tests, so much
        more that it is twice the claim at most, 19 times in 20.
        """
        ratio = moves_um / np.maximum(np.sqrt(np.mean(self.moved_um**2, axis=0)), 1e-9)
        few = few_factor(len(self.runs)) / AT_MOST
        return np.asarray(few * self.rmse_um * np.maximum(ratio, np.sqrt(ratio)))


def left_out_tests(fit: Fit, data: ModeData) -> LeftOutTests | None:
    """Tests that others can predict: those at a level, for levels below the fastest; at the fastest each by itself."""
    levels = speed_folds(data)
    fastest = runs_by_level(data).get(len(data.levels_rpm) - 1, [])
    alone = run_folds(data, [[run] for run in fastest]) if len(fastest) > 1 else []
    folds = [*(one.fold for one in levels), *alone]
    blocks = held_out_blocks(fit, data, folds, own_zeros=True)
    if fit.spec.law_kind == "levels":
        blocks = [*(_without_level(fit, data, one) for one in levels), *blocks[len(levels) :]]
    found = [
        (run, *_from_start(errors, fit, data, run))
        for fold, errors in zip(folds, blocks, strict=True)
        for run, (begin, _) in enumerate(data.bounds)
        if fold[begin] and run not in fit.spec.free_starts
    ]
    if not found:
        return None
    runs, errors, moved, noise = zip(*found, strict=True)
    return LeftOutTests(tuple(runs), np.array(errors), np.array(moved), np.array(noise))


def _from_start(errors_um: Vector, fit: Fit, data: ModeData, run: int) -> tuple[Vector, Vector, Vector]:
    """Error, movement and what noise adds to them, each (n_responses,) [µm], with the zero of the start of a run."""
    begin, end = data.bounds[run]
    counts = np.where(fit.weights[begin:end] > 0, data.counts[begin:end], 0.0)
    predicted = data.displacement_um[begin:end] - fit.solution.left_out_um[begin:end]
    found = np.zeros((3, counts.shape[1]))
    for r, (count, noise) in enumerate(zip(counts.T, data.noise_um, strict=True)):
        there = np.flatnonzero(count)
        if len(there):
            moved = np.abs(predicted[there, r] - predicted[there[0], r])
            start = there[: max(int(np.argmax(moved > STILL * moved.max())), 1)]
            for k, values in enumerate((errors_um[begin:end, r], data.displacement_um[begin:end, r])):
                own = values[there] - np.average(values[start], weights=count[start])
                found[k, r] = np.sqrt(np.average(own**2, weights=count[there]))
            found[2, r] = noise * np.sqrt(1.0 / count[start].sum() + len(there) / count[there].sum())
    return found[0], found[1], found[2]
