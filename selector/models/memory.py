"""Memory of past heating: first-order lags of a variable.

A mass that is heated through a resistance follows τ·s' = x − s (C: thermal modes). A displacement that depends
on such hidden temperatures is a function of lagged readings, which no static model of the readings can give.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray


@dataclass(frozen=True)
class Lag:
    """A first-order lag of a channel with time constant `tau_s` [s]."""

    source: str
    tau_s: float

    @property
    def name(self) -> str:
        """Name of the lagged variable, e.g. ``"T1.lag1800s"``."""
        return f"{self.source}.lag{self.tau_s:.6g}s"


def lagged(
    values: NDArray[np.float64],
    time_s: NDArray[np.float64],
    tau_s: NDArray[np.float64],
    state: NDArray[np.float64],
    last_s: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Lagged samples, the states after the last one and their time stamps, so that a run can be fed in pieces.

    Backward Euler, s_k = s_{k−1} + Δt/(τ + Δt)·(x_k − s_{k−1}): stable for any step, and the control can compute it
    with + − × ÷ alone, so that the model on the machine is the model that was fitted.

    Parameters
    ----------
    values : ndarray of shape (n_samples, n_lags)
        Source of each lag; where it is missing the state waits, and then takes the whole gap in one step.
    time_s : ndarray of shape (n_samples,)
        Time stamps [s], increasing, not necessarily regular.
    tau_s : ndarray of shape (n_lags,)
        Time constants [s].
    state : ndarray of shape (n_lags,)
        State before the first sample; NaN = equilibrium with the first reading.
    last_s : ndarray of shape (n_lags,)
        Time stamp of each state; anything where the state is NaN.

    Returns
    -------
    ndarray of shape (n_samples, n_lags), ndarray of shape (n_lags,), ndarray of shape (n_lags,)
    """
    state, last_s = np.array(state, dtype=np.float64), np.array(last_s, dtype=np.float64)
    result = np.empty(values.shape)
    _lag_kernel(np.ascontiguousarray(values), time_s, np.asarray(tau_s, dtype=np.float64), state, last_s, result)
    return result, state, last_s


@njit(cache=True, nogil=True)
def _lag_kernel(values, time_s, tau_s, state, last_s, result):  # type: ignore[no-untyped-def]
    for k in range(values.shape[0]):
        for j in range(values.shape[1]):
            x = values[k, j]
            if np.isnan(x):
                result[k, j] = np.nan
                continue
            if np.isnan(state[j]):
                state[j] = x
            else:
                step = time_s[k] - last_s[j]
                state[j] += step / (tau_s[j] + step) * (x - state[j])
            last_s[j] = time_s[k]
            result[k, j] = state[j]


def time_constant_grid(period_s: float, duration_s: float, n: int = 9) -> NDArray[np.float64]:
    """Time constants worth trying [s], evenly spaced in their logarithm.

    From three sampling periods (a faster lag is noise) to the length of the longest run (a slower one is a straight
    line there, and what it does on a longer day nobody has seen).
    """
    low = max(3.0 * period_s, duration_s / 200.0)
    high = max(duration_s, 2.0 * low)
    return np.geomspace(low, high, n)
