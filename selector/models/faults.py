"""What a sensor fault does to the prediction: the price of every sensor that a model listens to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from selector.models.least_squares import FittedModel


@dataclass(frozen=True)
class FaultGain:
    """Effect of a fault of one sensor on one response.

    Attributes
    ----------
    sensor, response : str
    per_kelvin_um : float
        Largest |change| of the prediction for a reading 1 K too high, over the recorded samples, steady state [µm].
    stuck_um : float
        Largest |change| if the sensor had frozen at its start-of-run reading [µm].
    open_um : float
        Largest |change| if a break drives the reading to the edge of its valid range, where a guard holds it [µm].
    """

    sensor: str
    response: str
    per_kelvin_um: float
    stuck_um: float
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
    """The gain of a fault of each sensor, over recorded samples.

    Parameters
    ----------
    variables : ndarray of shape (n_samples, n_variables)
        In the order of the model's scaling.
    lag_source : dict
        Channel behind each lag variable: a fault that lasts reaches the lag too.
    rise : bool
        Whether the start-of-run reading is zero (rises) or the mean (absolute readings have no natural start).
    """
    healthy = model.predicted(variables)
    names = model.scaling.variables
    gains = []
    for sensor in sensors:
        own = [j for j, name in enumerate(names) if lag_source.get(name, name) == sensor]
        low = min(model.valid_range[j][0] for j in own)
        high = max(model.valid_range[j][1] for j in own)
        rest = 0.0 if rise else float(np.mean(variables[:, own[0]]))

        def change(faulty: NDArray[np.float64]) -> float:
            return float(np.abs(model.predicted(faulty) - healthy).max())

        def with_reading(value: float, columns: Sequence[int]) -> NDArray[np.float64]:
            faulty = variables.copy()
            faulty[:, columns] = value
            return faulty

        shifted = variables.copy()
        shifted[:, own] += 1.0
        gains.append(
            FaultGain(
                sensor,
                model.response,
                change(shifted),
                change(with_reading(rest, own)),
                max(change(with_reading(low, own)), change(with_reading(high, own))),
            )
        )
    return tuple(gains)
