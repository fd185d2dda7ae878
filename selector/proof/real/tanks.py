"""Two cascaded tanks, which both spill, beside tanks without brims.

M. Schoukens, P. Mattsson, T. Wigren, J.-P. Noël: Cascaded tanks benchmark combining soft and hard nonlinearities,
Workshop on Nonlinear System Identification Benchmarks, Brussels 2016.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from numba import njit
from numpy.typing import NDArray
from scipy.optimize import least_squares

from selector.proof.real.tables import table
from selector.recording import Channel, Recording

Vector = NDArray[np.float64]

_STEP_S = 4.0
_LEAST_LEVEL = 1e-6
_SUBSTEPS = 4


def cascaded_tanks(folder: Path) -> tuple[Recording, Recording]:
    """The recorded tanks, and the same with outflow by the square root and no brims.

    The estimation record, to which the simulation is fitted, and the validation record.

    Raises
    ------
    ReadError
        The folder has no `dataBenchmark.csv` with the columns uEst, uVal, yEst and yVal.
    """
    read = table(folder / "dataBenchmark.csv", ("uEst", "uVal", "yEst", "yVal"))
    parts = {"estimation": ("uEst", "yEst"), "validation": ("uVal", "yVal")}
    u = {name: read[pair[0]].to_numpy(dtype=np.float64) for name, pair in parts.items()}
    y = {name: read[pair[1]].to_numpy(dtype=np.float64) for name, pair in parts.items()}

    def left(x: Vector) -> Vector:
        return np.asarray(_level(np.exp(x[:4]), np.abs(x[4:6]), u["estimation"]) - y["estimation"])

    guess = np.r_[np.log([0.05, 0.05, 0.05, 0.05]), y["estimation"][0], y["estimation"][0]]
    found = least_squares(left, guess, x_scale="jac").x
    index = pd.Index(_STEP_S * np.arange(len(read)), name="time_s")
    channels = (Channel("u", "voltage", "V", place="pump"), Channel("y", "voltage", "V", place="lower tank"))
    recorded, simulated = {}, {}
    for name in parts:
        # the upper tank was not measured: it starts as in the estimation record
        start = np.array([abs(found[4]), y[name][0]]) if name != "estimation" else np.abs(found[4:6])
        recorded[name] = pd.DataFrame({"u": u[name], "y": y[name]}, index=index)
        simulated[name] = pd.DataFrame({"y": _level(np.exp(found[:4]), start, u[name])}, index=index)
    return Recording.from_runs(recorded, channels), Recording.from_runs(simulated, channels[1:])


def _level(rates: Vector, start: Vector, u: Vector) -> Vector:
    """Level of the lower tank [V] by Heun's method, the pump's voltage held over a sample."""
    return np.asarray(_heun(rates, float(start[0]), float(start[1]), u, _STEP_S / _SUBSTEPS))


@njit(cache=True, nogil=True)
def _heun(rates, upper, lower, u, step):  # type: ignore[no-untyped-def]
    level = np.empty(len(u))
    for i in range(len(u)):
        level[i] = lower
        for _ in range(_SUBSTEPS):
            a, b = np.sqrt(max(upper, _LEAST_LEVEL)), np.sqrt(max(lower, _LEAST_LEVEL))
            du, dl = rates[3] * u[i] - rates[0] * a, rates[1] * a - rates[2] * b
            a, b = np.sqrt(max(upper + step * du, _LEAST_LEVEL)), np.sqrt(max(lower + step * dl, _LEAST_LEVEL))
            upper = max(upper + 0.5 * step * (du + rates[3] * u[i] - rates[0] * a), 0.0)
            lower = max(lower + 0.5 * step * (dl + rates[1] * a - rates[2] * b), 0.0)
    return level
