"""The tests beside what the prediction that was learnt from them makes of each, taken as a duty cycle of its own."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from selector.errors import InputError
from selector.physics.thermal.characteristics import Characteristics
from selector.physics.thermal.cyclogram import Cyclogram
from selector.physics.thermal.mode_data import SAME_SPEED, ModeData, mode_data
from selector.physics.thermal.modes import ModalModel
from selector.physics.thermal.piecewise import piecewise_displacement_um
from selector.physics.thermal.thermal_test import ThermalTest

Vector = NDArray[np.float64]

MOST_SAMPLES = 20_000
"""A longer test is repeated at evenly spaced samples."""


@dataclass(frozen=True)
class RepeatedTest:
    """A test and what the prediction makes of it.

    Attributes
    ----------
    run : str
        Name of the run.
    time_s : ndarray of shape (n_times,)
        Times [s] from the start of the run.
    speed_rpm : ndarray of shape (n_times,)
        Spindle speed [r/min].
    measured_um, predicted_um : ndarray of shape (n_times, n_responses)
        Displacements [µm]; what was not measured is NaN. The zero of the gauge is part of the prediction.
    """

    run: str
    time_s: Vector
    speed_rpm: Vector
    measured_um: Vector
    predicted_um: Vector

    @property
    def rmse_um(self) -> Vector:
        """Root mean square of measured minus predicted [µm], shape (n_responses,)."""
        error = self.measured_um - self.predicted_um
        return np.asarray(np.sqrt(np.nansum(error**2, axis=0) / np.maximum(np.isfinite(error).sum(axis=0), 1)))


def modal_repeats(
    tests: Sequence[ThermalTest], model: ModalModel, *, warm: Collection[str] = (), with_hall: bool = False
) -> tuple[RepeatedTest, ...]:
    """The tests as thermal modes repeat them: from rest and cold, each with a zero of its own.

    What else was fitted to the tests is fitted here again, with the modes as they are: the state at the start of runs
    that were `warm` then (their names), and the part of the hall temperature, if it drove the modes.
    """
    data = mode_data(tests)
    cyclograms = [_cyclogram(data, run) for run in range(len(tests))]
    taken = [_samples(test) for test in tests]
    plain = [
        model.displacement_um(_within(cyclogram, model.fastest_rpm), time)
        for cyclogram, (time, _) in zip(cyclograms, taken, strict=True)
    ]
    columns = []
    for run, (cyclogram, (time, _)) in enumerate(zip(cyclograms, taken, strict=True)):
        own = [np.ones(len(time))]
        if tests[run].run in warm:
            own += list(_fading(model, _within(cyclogram, model.fastest_rpm), time).T)
        shared = _hall_states(data, run, cyclogram, model.tau_s, time) if with_hall else np.zeros((len(time), 0))
        columns.append((np.column_stack(own), shared))
    fitted = _fitted([m - p for (_, m), p in zip(taken, plain, strict=True)], columns)
    return tuple(
        RepeatedTest(test.run, time, cyclogram.speed_at(time), measured, first + rest)
        for test, cyclogram, (time, measured), first, rest in zip(tests, cyclograms, taken, plain, fitted, strict=True)
    )


def piecewise_repeats(tests: Sequence[ThermalTest], curves: Sequence[Characteristics]) -> tuple[RepeatedTest, ...]:
    """The tests as pieces of the characteristics repeat them, each with a zero of its own.

    Runs in which the spindle never turns, or turns faster than the characteristics reach, are not repeated.
    """
    data = mode_data(tests)
    repeats = []
    for run, test in enumerate(tests):
        cyclogram = _at_levels(_cyclogram(data, run), data)
        time, measured = _samples(test)
        if not (cyclogram.speed_rpm > 0).any():
            continue
        try:
            first = piecewise_displacement_um(curves, cyclogram, time)[0]
        except InputError:
            continue
        rest = _fitted([measured - first], [(np.ones((len(time), 1)), np.zeros((len(time), 0)))])[0]
        repeats.append(RepeatedTest(test.run, time, cyclogram.speed_at(time), measured, first + rest))
    return tuple(repeats)


def _samples(test: ThermalTest) -> tuple[Vector, Vector]:
    """Times from the start and displacements where anything was read, thinned where there are very many."""
    read = np.flatnonzero(np.isfinite(test.displacement_um).any(axis=1))
    read = read[:: max(1, -(-len(read) // MOST_SAMPLES))]
    return test.time_s[read] - test.time_s[0], test.displacement_um[read]


def _cyclogram(data: ModeData, run: int) -> Cyclogram:
    """The speeds of a run's blocks, standing where it is near 0."""
    blocks = slice(*data.bounds[run])
    ends = np.cumsum(data.before_s[blocks] + data.after_s[blocks])
    speed = np.where(data.speed_rpm[blocks] < 0.01 * data.fastest_rpm, 0.0, data.speed_rpm[blocks])
    # the last sample counts for as long as the one before it, so this is beyond it
    return Cyclogram(np.r_[0.0, ends[:-1]], speed, float(ends[-1]))


def _within(cyclogram: Cyclogram, fastest_rpm: float) -> Cyclogram:
    """The duty cycle with what overshoots the fastest level held there."""
    return Cyclogram(cyclogram.start_s, np.minimum(cyclogram.speed_rpm, fastest_rpm), cyclogram.end_s)


def _at_levels(cyclogram: Cyclogram, data: ModeData) -> Cyclogram:
    """The duty cycle with speeds that are a level up to jitter taken for it, one segment a level."""
    levels = np.array(data.levels_rpm)
    nearest = levels[np.abs(cyclogram.speed_rpm[:, None] - levels).argmin(axis=1)]
    near = np.abs(cyclogram.speed_rpm - nearest) < SAME_SPEED * data.fastest_rpm
    speed = np.where(near & (cyclogram.speed_rpm > 0), nearest, cyclogram.speed_rpm)
    first = np.r_[True, np.diff(speed) != 0]
    return Cyclogram(cyclogram.start_s[first], speed[first], cyclogram.end_s)


def _fading(model: ModalModel, cyclogram: Cyclogram, time_s: Vector) -> Vector:
    """What is left of a unit of each mode that is there at the start, shape (n_times, n_modes²).

    Mode by mode, because convection may couple them; where it does not, only n_modes of the columns are not zero.
    """
    modes = len(model.tau_s)
    none = model.states_at(cyclogram, time_s)

    def left(k: int) -> Vector:
        start = np.zeros(none.shape[1:])
        start[k, 0] = 1.0
        return np.asarray(model.states_at(cyclogram, time_s, start)[:, :, 0] - none[:, :, 0])

    return np.hstack([left(k) for k in range(modes)])


def _hall_states(data: ModeData, run: int, cyclogram: Cyclogram, tau_s: Vector, time_s: Vector) -> Vector:
    """The hall temperature as every mode follows it [K], shape (n_times, n_modes); films that grow are left out."""
    if data.ambient_k is None:
        return np.zeros((len(time_s), 0))
    hall = data.ambient_k[slice(*data.bounds[run])]
    at = np.clip(np.searchsorted(cyclogram.start_s, time_s, side="right") - 1, 0, None)
    lengths = np.diff(np.r_[cyclogram.start_s, cyclogram.end_s])
    entry = np.zeros((len(hall), len(tau_s)))
    for i in range(1, len(hall)):
        entry[i] = hall[i - 1] + (entry[i - 1] - hall[i - 1]) * np.exp(-lengths[i - 1] / tau_s)
    since = (time_s - cyclogram.start_s[at])[:, None]
    return np.asarray(hall[at, None] + (entry[at] - hall[at, None]) * np.exp(-since / tau_s))


def _fitted(rest_um: Sequence[Vector], columns: Sequence[tuple[Vector, Vector]]) -> list[Vector]:
    """What the columns of each run's own and those shared by all describe of the rest, run by run [µm]."""
    answers = [np.zeros(rest.shape) for rest in rest_um]
    for r in range(rest_um[0].shape[1]):
        there = [np.isfinite(rest[:, r]) for rest in rest_um]
        seen = [
            (own[rows], shared[rows], rest[rows, r])
            for (own, shared), rest, rows in zip(columns, rest_um, there, strict=True)
        ]
        design = np.vstack([shared - own @ _best(own, shared) for own, shared, _ in seen])
        aim = np.concatenate([rest - own @ _best(own, rest) for own, _, rest in seen])
        gains = _best(design, aim)
        for answer, (own, shared), (own_seen, shared_seen, rest) in zip(answers, columns, seen, strict=True):
            answer[:, r] = shared @ gains + own @ _best(own_seen, rest - shared_seen @ gains)
    return answers


def _best(design: Vector, aim: Vector) -> Vector:
    """Least squares; the smallest solution where columns are alike."""
    return np.asarray(np.linalg.lstsq(design, aim, rcond=1e-8)[0])
