"""Silverbox, an electronic oscillator with a cubic spring, beside oscillators fitted to it.

T. Wigren, J. Schoukens: Three free data sets for development and benchmarking in nonlinear system identification,
European Control Conference 2013.
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

_RATE_HZ = 1e7 / 2**14
_FIRST_REALISATION, _REALISATION, _REALISATIONS = 40_650, 8_700, 4
_ARROW = (24_000, 40_000)


def silverbox(folder: Path, *, cubic: bool = False) -> tuple[Recording, Recording]:
    """The recorded oscillator, and the best linear one, or with `cubic` the best with a cubic spring.

    Four realisations of the multisine, to which the simulation is fitted, and the upper half of the growing noise.

    Raises
    ------
    ReadError
        The folder has no `SNLS80mV.csv` with the columns V1 and V2.
    """
    read = table(folder / "SNLS80mV.csv", ("V1", "V2"))
    whole, seen = (read[name].to_numpy(dtype=np.float64) for name in ("V1", "V2"))
    begins = _FIRST_REALISATION + _REALISATION * np.arange(_REALISATIONS)
    parts = {f"multisine {k + 1}": slice(int(a), int(a) + _REALISATION) for k, a in enumerate(begins)}
    parts["arrow"] = slice(_ARROW[0], _ARROW[1])
    trained = slice(int(begins[0]), int(begins[-1]) + _REALISATION)
    swing = _oscillation(_fitted(whole[trained], seen[trained], cubic=cubic), whole)
    channels = (Channel("V1", "voltage", "V", place="force"), Channel("V2", "voltage", "V", place="displacement"))
    recorded, simulated = {}, {}
    for name, rows in parts.items():
        index = pd.Index(np.arange(rows.stop - rows.start) / _RATE_HZ, name="time_s")
        recorded[name] = pd.DataFrame({"V1": whole[rows], "V2": seen[rows]}, index=index)
        simulated[name] = pd.DataFrame({"V2": swing[rows]}, index=index)
    return Recording.from_runs(recorded, channels), Recording.from_runs(simulated, channels[1:])


def _fitted(u: Vector, y: Vector, *, cubic: bool) -> Vector:
    """a1, a2, b0, b1, b2, offset and, if `cubic`, the factors of y³ one and two samples ago: least free-run error."""
    late = [-y[1:-1], -y[:-2], u[2:], u[1:-1], u[:-2], np.ones(len(y) - 2)]
    late += [-(y[1:-1] ** 3), -(y[:-2] ** 3)] if cubic else []
    start = np.linalg.lstsq(np.column_stack(late), y[2:], rcond=None)[0]

    def left(x: Vector) -> Vector:
        return _oscillation(x, u) - y

    return np.asarray(least_squares(left, start, x_scale="jac").x, dtype=np.float64)


def _oscillation(model: Vector, u: Vector) -> Vector:
    return np.asarray(_free_run(np.r_[model, np.zeros(8 - len(model))], u))


@njit(cache=True, nogil=True)
def _free_run(model, u):  # type: ignore[no-untyped-def]
    y = np.zeros(len(u))
    for k in range(len(u)):
        last, before = (y[k - 1] if k > 0 else 0.0), (y[k - 2] if k > 1 else 0.0)
        value = model[5] - model[0] * last - model[1] * before - model[6] * last**3 - model[7] * before**3
        for j in range(min(k, 2) + 1):
            value += model[2 + j] * u[k - j]
        y[k] = min(max(value, -1e3), 1e3)
    return y
