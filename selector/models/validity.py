"""Where a model may be trusted, and what a sensor fault does to its prediction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from selector.models.least_squares import FittedModel

MAX_POINTS = 400
MAX_SAMPLES = 4000


@dataclass(frozen=True)
class ValidityHull:
    """The convex hull of recorded inputs, held as points in units of `scale`."""

    points: NDArray[np.float64]  #: (n_points, n_variables)
    scale: NDArray[np.float64]  #: (n_variables,): Standard deviation of each input
    #: low and high: (n_variables,): The box around the hull, in the unit of the inputs
    low: NDArray[np.float64]
    high: NDArray[np.float64]

    def distance(self, inputs: NDArray[np.float64]) -> NDArray[np.float64]:
        """Euclidean distance of each input to the hull, in standard deviations; 0 inside. Shape (n_samples,).

        The nearest point of the hull is a convex combination of its points, found by non-negative least squares with
        the weights' sum as a heavy row.
        """
        scaled = np.atleast_2d(inputs) / self.scale
        heavy = 1e4 * max(1.0, float(np.abs(self.points).max(initial=1.0)))
        system = np.vstack([self.points.T, np.full(len(self.points), heavy)])
        found = np.empty(len(scaled))
        for i, point in enumerate(scaled):
            weights, _ = nnls(system, np.r_[point, heavy], maxiter=50 * system.shape[1])
            found[i] = float(np.linalg.norm(self.points.T @ weights - point))
        # the heavy row is met to rounding only, and so is zero
        return np.where(found < 1e-6, 0.0, found)


def validity_hull(inputs: NDArray[np.float64]) -> ValidityHull:
    """The hull of samples of shape (n_samples, n_variables), thinned to its outermost points.

    Extreme samples in many directions span the hull; what they leave out are slivers.
    """
    scale = inputs.std(axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    # a warming machine moves little between neighbours: thinned samples and the extremes of each input stay
    edges = np.concatenate([inputs.argmin(axis=0), inputs.argmax(axis=0)])
    kept = np.unique(np.concatenate([np.arange(0, len(inputs), -(-len(inputs) // MAX_SAMPLES)), edges]))
    scaled = inputs[kept] / scale
    directions = np.random.default_rng(0).normal(size=(2 * MAX_POINTS, inputs.shape[1]))
    directions = np.vstack([np.eye(inputs.shape[1]), -np.eye(inputs.shape[1]), directions @ _whitening(scaled)])
    extreme = np.unique((scaled @ directions.T).argmax(axis=0))
    return ValidityHull(scaled[extreme], scale, inputs.min(axis=0), inputs.max(axis=0))


def _whitening(scaled: NDArray[np.float64]) -> NDArray[np.float64]:
    """Turns random directions into those that see every width of a cloud alike, shape (n_variables, n_variables).

    Temperatures of one machine rise together: their cloud is a needle, and in a random direction it is always one of
    its two ends that is the outermost.
    """
    _, spread, axes = np.linalg.svd(scaled - scaled.mean(axis=0), full_matrices=False)
    floor = max(1e-6 * float(spread.max(initial=0.0)), 1e-300)
    whitening = np.zeros((scaled.shape[1], scaled.shape[1]))
    whitening[: len(spread)] = axes / np.maximum(spread, floor)[:, None]
    return whitening


@dataclass(frozen=True)
class FaultGain:
    """Effect of a fault of one sensor on one response."""

    sensor: str
    response: str
    #: Largest |change| of the prediction for a reading 1 K too high, over the recorded samples, steady state [µm]
    per_kelvin_um: float
    stuck_um: float  #: Largest |change| if the sensor had frozen at its start-of-run reading [µm]
    #: Largest |change| if a break drives the reading to the edge of its valid range, where a guard holds it [µm]
    open_um: float

    @property
    def worst_um(self) -> float:
        """The worst of a stuck and an open sensor [µm]."""
        return max(self.stuck_um, self.open_um)


def fault_gains(
    model: FittedModel,
    variables: NDArray[np.float64],
    sensors: Sequence[str],
    lag_source: dict[str, str],
    *,
    rise: bool,
) -> tuple[FaultGain, ...]:
    """The gain of a fault of each sensor, over recorded samples of shape (n_samples, n_variables).

    `lag_source` is the channel behind each lag variable: a fault that lasts reaches the lag too. The start-of-run
    reading is zero of a `rise`, else the mean: absolute readings have no natural start.
    """
    healthy = model.predicted(variables)
    names = model.scaling.variables

    def change(columns: Sequence[int], reading: float | NDArray[np.float64]) -> float:
        faulty = variables.copy()
        faulty[:, columns] = reading
        return float(np.abs(model.predicted(faulty) - healthy).max())

    gains = []
    for sensor in sensors:
        own = [j for j, name in enumerate(names) if lag_source.get(name, name) == sensor]
        low = min(model.valid_range[j][0] for j in own)
        high = max(model.valid_range[j][1] for j in own)
        rest = 0.0 if rise else float(np.mean(variables[:, own[0]]))
        shifted, stuck = change(own, variables[:, own] + 1.0), change(own, rest)
        gains.append(FaultGain(sensor, model.response, shifted, stuck, max(change(own, low), change(own, high))))
    return tuple(gains)
