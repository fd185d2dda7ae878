"""Published records read from their tables: the oscillator Silverbox, and two cascaded tanks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from numba import njit
from scipy.optimize import least_squares

from selector.errors import ReadError
from selector.recording import Channel, Recording
from selector.types import Vector


def table(path: Path, columns: tuple[str, ...]) -> pd.DataFrame:
    """A file with commas between its columns, these among them.

    Raises ReadError: there is no such file, or it lacks a column.
    """
    expected = f"a table with the columns {', '.join(columns)}"
    advice = "download the recording, see docs/reference/sources.md"
    try:
        found = pd.read_csv(path)
    except (OSError, ValueError) as error:
        raise ReadError(str(error), expected=expected, where=str(path), advice=advice) from error
    missing = [name for name in columns if name not in found]
    if missing:
        raise ReadError(f"no column {missing[0]!r}", expected=expected, where=str(path), advice=advice)
    return found


_RATE_HZ = 1e7 / 2**14
_FIRST_REALISATION, _REALISATION, _REALISATIONS = 40_650, 8_700, 4
_ARROW = (24_000, 40_000)


def silverbox(folder: Path, *, cubic: bool = False) -> tuple[Recording, Recording]:
    """The recorded oscillator, and the best linear one, or with `cubic` the best with a cubic spring.

    Four realisations of the multisine, to which the simulation is fitted, and the upper half of the growing noise.

    Raises ReadError: the folder has no `SNLS80mV.csv` with the columns V1 and V2.
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


_STEP_S = 4.0
_LEAST_LEVEL = 1e-6
_SUBSTEPS = 4


def cascaded_tanks(folder: Path) -> tuple[Recording, Recording]:
    """The recorded tanks, and the same with outflow by the square root and no brims.

    The estimation record, to which the simulation is fitted, and the validation record.

    Raises ReadError: the folder has no `dataBenchmark.csv` with the columns uEst, uVal, yEst and yVal.
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
