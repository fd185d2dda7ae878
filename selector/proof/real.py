"""Real recordings beside simulations from which a known effect is left out: Silverbox and the cascaded tanks.

Neither recording is part of the package; a function gets the folder that it lies in. The simulations are the best of
their kind (a linear oscillator; tanks without brims), fitted here by least squares on the free run.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from numba import njit
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.signal import lfilter

from selector.errors import ReadError
from selector.recording import Channel, Recording

Vector = NDArray[np.float64]
Pair = tuple[Recording, Recording]

SILVERBOX_HZ = 1e7 / 2**14
TANK_STEP_S = 4.0
_FIRST_REALISATION, _REALISATION, _REALISATIONS = 40_650, 8_700, 4
_ARROW = (24_000, 40_000)
_LEAST_LEVEL = 1e-6
_SUBSTEPS = 4


def silverbox(folder: Path) -> Pair:
    """The electronic oscillator with a cubic spring, and the best linear oscillator.

    Four realisations of the multisine, to which the simulation is fitted, and the upper half of the growing noise.
    Wigren & Schoukens: Three free data sets for development and benchmarking in nonlinear system identification,
    European Control Conference 2013.

    Raises
    ------
    ReadError
        The folder has no `SNLS80mV.csv` with the columns V1 and V2.
    """
    table = _table(folder / "SNLS80mV.csv", ("V1", "V2"))
    begins = _FIRST_REALISATION + _REALISATION * np.arange(_REALISATIONS)
    parts = {f"multisine {k + 1}": slice(int(a), int(a) + _REALISATION) for k, a in enumerate(begins)}
    parts["arrow"] = slice(_ARROW[0], _ARROW[1])
    u = {name: table["V1"].to_numpy()[rows] for name, rows in parts.items()}
    y = {name: table["V2"].to_numpy()[rows] for name, rows in parts.items()}
    whole = table["V1"].to_numpy()
    trained = slice(int(begins[0]), int(begins[-1]) + _REALISATION)
    model = _fitted_oscillator([whole[trained]], [table["V2"].to_numpy()[trained]])
    swing = _oscillation(model, whole)
    time = {name: np.arange(len(v)) / SILVERBOX_HZ for name, v in u.items()}
    channels = (Channel("V1", "voltage", "V", place="force"), Channel("V2", "voltage", "V", place="displacement"))
    recorded = {n: pd.DataFrame({"V1": u[n], "V2": y[n]}, index=time[n]) for n in parts}
    simulated = {n: pd.DataFrame({"V2": swing[parts[n]]}, index=time[n]) for n in parts}
    return Recording.from_runs(recorded, channels), Recording.from_runs(simulated, channels[1:])


def cascaded_tanks(folder: Path) -> Pair:
    """Two tanks, of which both spill, and the same with outflow by the square root and no brims.

    The estimation record, to which the simulation is fitted, and the validation record. Schoukens, Mattsson, Wigren,
    Noël: Cascaded tanks benchmark combining soft and hard nonlinearities, 2016.

    Raises
    ------
    ReadError
        The folder has no `dataBenchmark.csv` with the columns uEst, uVal, yEst and yVal.
    """
    table = _table(folder / "dataBenchmark.csv", ("uEst", "uVal", "yEst", "yVal"))
    parts = {"estimation": ("uEst", "yEst"), "validation": ("uVal", "yVal")}
    u = {name: table[pair[0]].to_numpy(dtype=np.float64) for name, pair in parts.items()}
    y = {name: table[pair[1]].to_numpy(dtype=np.float64) for name, pair in parts.items()}

    def left(x: Vector) -> Vector:
        return np.asarray(_tank_level(np.exp(x[:4]), np.abs(x[4:6]), u["estimation"]) - y["estimation"])

    guess = np.r_[np.log([0.05, 0.05, 0.05, 0.05]), y["estimation"][0], y["estimation"][0]]
    found = least_squares(left, guess, x_scale="jac").x
    time = TANK_STEP_S * np.arange(len(table))
    channels = (Channel("u", "voltage", "V", place="pump"), Channel("y", "voltage", "V", place="lower tank"))
    recorded, simulated = {}, {}
    for name in parts:
        start = np.array([abs(found[4]), y[name][0]])
        level = _tank_level(np.exp(found[:4]), start if name != "estimation" else np.abs(found[4:6]), u[name])
        recorded[name] = pd.DataFrame({"u": u[name], "y": y[name]}, index=time)
        simulated[name] = pd.DataFrame({"y": level}, index=time)
    return Recording.from_runs(recorded, channels), Recording.from_runs(simulated, channels[1:])


def _table(path: Path, columns: tuple[str, ...]) -> pd.DataFrame:
    expected = f"a table with the columns {', '.join(columns)}"
    advice = "download the benchmark, see docs/reference/sources.md"
    try:
        table = pd.read_csv(path)
    except (OSError, ValueError) as error:
        raise ReadError(str(error), expected=expected, where=str(path), advice=advice) from error
    missing = [name for name in columns if name not in table]
    if missing:
        raise ReadError(f"no column {missing[0]!r}", expected=expected, where=str(path), advice=advice)
    return table


def _fitted_oscillator(u: list[Vector], y: list[Vector]) -> Vector:
    """a1, a2, b0, b1, b2, offset of the second-order filter with the smallest free-run error."""

    def left(x: Vector) -> Vector:
        return np.concatenate([_oscillation(x, a) - b for a, b in zip(u, y, strict=True)])

    late = np.column_stack(
        [
            np.concatenate([-b[1:-1] for b in y]),
            np.concatenate([-b[:-2] for b in y]),
            *(np.concatenate([a[2 - k : len(a) - k] for a in u]) for k in range(3)),
        ]
    )
    start = np.linalg.lstsq(late, np.concatenate([b[2:] for b in y]), rcond=None)[0]
    return np.asarray(least_squares(left, np.r_[start, 0.0], x_scale="jac").x)


def _oscillation(model: Vector, u: Vector) -> Vector:
    return np.asarray(lfilter(model[2:5], np.r_[1.0, model[:2]], u) + model[5])


def _tank_level(rates: Vector, start: Vector, u: Vector) -> Vector:
    """Level of the lower tank [V] by Heun's method, the pump's voltage held over a sample."""
    return np.asarray(_heun(rates, float(start[0]), float(start[1]), u, TANK_STEP_S / _SUBSTEPS))


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
