"""What does a refit of a simulation work on: its residuals in standard deviations, and how parameters change them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.evidence.noise import NoiseModel, noise_model, whitened
from selector.diagnosis.open_model.runnable import Runnable
from selector.errors import InputError
from selector.recording import Recording

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

FARTHEST = 3.0
"""Standard deviations of the nameplate that a parameter may go."""
STEP = 0.1
"""Step of a finite difference, in standard deviations of the nameplate."""


@dataclass(frozen=True, eq=False)
class RefitProblem:
    """Weighted residuals of the fitted rows as a function of parameters in nameplate units.

    Attributes
    ----------
    runnable : Runnable
    comparison : Comparison
    names : tuple of str
        Parameters that are fitted.
    centre, spread : ndarrays of shape (n_parameters,)
        What the file says, and its standard deviation.
    free : ndarray of bool of shape (n_parameters,)
        Parameters that no nameplate holds.
    noise : mapping of str to NoiseModel
        Response → what counts as one standard deviation.
    parts : mapping of str to list of slice
        Response → stretches without gaps, fitted rows.
    counted : callable
        Told of every run of the simulation.
    """

    runnable: Runnable
    comparison: Comparison
    names: tuple[str, ...]
    centre: Vector
    spread: Vector
    free: NDArray[np.bool_]
    noise: Mapping[str, NoiseModel]
    parts: Mapping[str, list[slice]]
    counted: Callable[[], None]

    def courses(self, z: Vector) -> dict[str, Vector]:
        """Simulated responses; z is in standard deviations of the nameplate."""
        self.counted()
        values = dict(zip(self.names, (self.centre + self.spread * z).tolist(), strict=True))
        return simulated_rows(self.comparison, self.runnable.simulated(values))

    def white(self, courses: Mapping[str, Vector]) -> Vector:
        """Recorded less simulated in standard deviations, fitted rows, responses behind each other."""
        parts = []
        for name in self.comparison.responses:
            left = self.comparison.recorded[name] - courses[name]
            rows = filled_rows(left, self.parts[name])
            parts.append(whitened(self.noise[name], rows[:, None], self.parts[name])[:, 0])
        kept = ~self.comparison.held_out
        return np.concatenate([part[kept] for part in parts])

    def tangents(
        self, z: Vector, at: Mapping[str, Vector], known: Mapping[str, Mapping[str, Vector]] | None = None
    ) -> dict[str, Matrix]:
        """Response → change of its course with every parameter, by finite differences, shape (n_rows, n_parameters).

        Those that are `known` (response → parameter) are taken as they are.
        """
        found = {name: np.zeros((len(self.comparison.time_s), len(self.names))) for name in self.comparison.responses}
        for k, parameter in enumerate(self.names):
            if known and all(parameter in known[name] for name in found):
                for name, columns in found.items():
                    columns[:, k] = known[name][parameter]
                continue
            for step in (STEP, -STEP):
                moved = np.array(z)
                moved[k] += step
                if abs(moved[k]) > self.limits[1][k] + 1e-12 and step > 0.0:
                    continue
                try:
                    courses = self.courses(moved)
                except InputError:
                    continue
                for name, columns in found.items():
                    columns[:, k] = (courses[name] - at[name]) / step
                break
        return found

    def white_tangents(self, tangents: Mapping[str, Matrix]) -> Matrix:
        """The same in standard deviations of the responses, fitted rows."""
        kept = ~self.comparison.held_out
        return np.concatenate([
            whitened(self.noise[name], np.column_stack([filled_rows(c, self.parts[name]) for c in tangents[name].T])
                     if tangents[name].shape[1] else tangents[name], self.parts[name])[kept]
            for name in self.comparison.responses
        ])  # fmt: skip

    @property
    def limits(self) -> tuple[Vector, Vector]:
        """Between what z may lie: three standard deviations of the nameplate, or the bounds that were said."""
        parameters = self.runnable.parameters
        low, high = (
            np.array([getattr(parameters[name], end) for name in self.names]) for end in ("low", "high")
        )  # fmt: skip
        bounds = (low - self.centre) / self.spread, (high - self.centre) / self.spread
        far = np.where(self.free, np.inf, FARTHEST)
        return np.maximum(bounds[0], -far), np.minimum(bounds[1], far)


def simulated_rows(comparison: Comparison, simulation: Recording) -> dict[str, Vector]:
    """Responses of a simulation that has the recordings' times, at the rows of a comparison, which may be fewer."""
    names = list(comparison.responses)
    rows = np.concatenate([
        simulation.values(run, names)[np.searchsorted(simulation.time_s(run), comparison.time_s[part])]
        for run, part in comparison.rows_of_runs()
    ])  # fmt: skip
    return {name: np.ascontiguousarray(rows[:, k], dtype=np.float64) for k, name in enumerate(names)}


def noise_of(fit: RefitProblem, courses: Mapping[str, Vector]) -> dict[str, NoiseModel]:
    """What counts as one standard deviation of every response: the size of what is left of it, by how long it lasts.

    What is left holds what the model lacks. A filter that made it white would weigh its fast part most, where the model
    is wrong most often; an even weight, which counts readings that repeat each other once, finds the parameters that
    make the error small.
    """
    found = {}
    for name in fit.comparison.responses:
        left = np.where(fit.comparison.held_out, np.nan, fit.comparison.recorded[name] - courses[name])
        model = noise_model(left, [part for part in fit.parts[name] if part.stop - part.start > 8])
        size = float(np.sqrt(np.nanmean(left**2)) * np.sqrt(model.correlation_samples))
        found[name] = NoiseModel(np.zeros(0), max(size, 1e-300))
    return found


def filled_rows(values: Vector, parts: Sequence[slice]) -> Vector:
    """The course without holes inside its stretches, 0 outside."""
    result = np.zeros(len(values))
    for part in parts:
        seen = np.isfinite(values[part])
        at = np.arange(part.stop - part.start)
        result[part] = values[part] if seen.all() else np.interp(at, at[seen], values[part][seen])
    return result
