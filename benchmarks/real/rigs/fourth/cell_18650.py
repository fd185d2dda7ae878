"""Lithium cells (18650) in a holder: current, air, and two thermometers on the surface, near the poles."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.optimize import least_squares as minimised

from benchmarks.real.case import SIMULATED, Pair, RealCase, Vector, least_squares, pair, thinned
from benchmarks.real.rigs.fourth.common import SILENT, lagging, step_of
from selector.recording import Channel

_NAMES = {
    "current": "I",
    "ambient_temperature": "air",
    "surface_temperature_plus": "T",
    "surface_temperature_minus": "T2",
}
_PLUS = Channel("T", "temperature", "degC", place="surface of the cell, near its plus pole")
_MINUS = Channel("T2", "temperature", "degC", place="surface of the cell, near its minus pole")
_AIR = Channel("air", "ambient", "degC", place="air around the cell")
_CURRENT = Channel("I", "current", "A", place="cell")


def _read(folder: Path, cell: int, programme: str, mean_of: int = 20) -> pd.DataFrame:
    (path,) = (folder / f"dataset-thermal/BID{cell:03d}").glob(f"BID{cell:03d}_{programme}_*.txt")
    raw = pd.read_csv(path, sep=";", on_bad_lines="skip").apply(pd.to_numeric, errors="coerce").dropna()
    frame = raw.rename(columns=_NAMES)[list(_NAMES.values())]
    return thinned(frame.set_index(pd.Index(raw["time"] - raw["time"].iloc[0], name="time_s")), mean_of)


def _warmed(x: Vector, run: pd.DataFrame, air: Vector) -> Vector:
    """Kelvin an ampere, kelvin an ampere squared, time constant [s], on an air."""
    current = run["I"].to_numpy()
    heat = x[0] * current + x[1] * current**2
    return np.asarray(lagging(air + heat, step_of(run), abs(x[2]) + 1.0, float(run["T"].iloc[0])))


def _as_the_air(folder: Path) -> Pair:
    runs = {f"cell {cell}": _read(folder, cell, "RSDch") for cell in (2, 3, 6, 8)}
    for run in runs.values():
        run["T" + SIMULATED] = run["air"]
    return pair({name: run.drop(columns="T2") for name, run in runs.items()}, (_PLUS, _AIR, _CURRENT))


def _joule(folder: Path, *, lag: bool) -> Pair:
    runs = {f"cell {cell}": _read(folder, cell, "RSDch") for cell in (2, 3, 6, 8)}
    known = list(runs.values())[:3]
    if lag:

        def warmed(x: Vector, run: pd.DataFrame) -> Vector:
            return _warmed(np.array([0.0, x[0], x[1]]), run, run["air"].to_numpy())

        law = minimised(lambda x: np.concatenate([warmed(x, run) - run["T"] for run in known]), [1.0, 800.0],
                        x_scale=[1.0, 800.0]).x  # fmt: skip
        given = {name: warmed(law, run) for name, run in runs.items()}
    else:
        fitted = pd.concat(known)
        squared = fitted["I"].to_numpy() ** 2
        factor = squared @ (fitted["T"] - fitted["air"]) / (squared @ squared)
        given = {name: (run["air"] + factor * run["I"] ** 2).to_numpy() for name, run in runs.items()}
    for name, run in runs.items():
        run["T" + SIMULATED] = given[name]
    return pair({name: run.drop(columns="T2") for name, run in runs.items()}, (_PLUS, _AIR, _CURRENT))


def _constant_air(folder: Path) -> Pair:
    """The pulses of ten hours; each cell has the offset of its thermometer against the air at the start."""
    runs = {f"cell {cell}": _read(folder, cell, "DPDch", 60) for cell in (2, 6, 4, 1)}
    known = list(runs.values())[:3]

    def warmed(x: Vector, run: pd.DataFrame) -> Vector:
        return _warmed(x, run, np.full(len(run), float(run["T"].iloc[0])))

    law = minimised(lambda x: np.concatenate([warmed(x, run) - run["T"] for run in known]), [1.5, 0.3, 700.0],
                    x_scale=[1.0, 1.0, 700.0]).x  # fmt: skip
    for run in runs.values():
        run["T" + SIMULATED] = warmed(law, run)
    return pair({name: run.drop(columns="T2") for name, run in runs.items()}, (_PLUS, _AIR, _CURRENT))


def _beside(folder: Path, *, fitted: bool) -> Pair:
    runs = {programme: _read(folder, 2, programme) for programme in ("CDch050.0", "CDch100.0", "RSDch")}
    rise, other = (
        np.concatenate([(run[name] - run[name].mean()).to_numpy() for run in list(runs.values())[:2]])
        for name in ("T", "T2")
    )
    gain = rise @ other / (rise @ rise) if fitted else 1.0
    for run in runs.values():
        run["T2" + SIMULATED] = run["T2"].mean() + gain * (run["T"] - run["T"].mean())
    return pair({name: run[["T2", "I", "T2" + SIMULATED]] for name, run in runs.items()}, (_MINUS, _CURRENT))


def _twins(folder: Path) -> Pair:
    """Of each cell how much it is warmer than the air, beside the mean of the three others."""
    rows = 160
    warm: Mapping[int, Vector] = {
        cell: (one["T"] - one["air"]).to_numpy()[:rows]
        for cell, one in ((cell, _read(folder, cell, "CDch100.0")) for cell in (3, 4, 5, 8))
    }
    runs = {}
    for cell, course in warm.items():
        run = _read(folder, cell, "CDch100.0").iloc[:rows][["I"]].copy()
        others = np.mean([other for name, other in warm.items() if name != cell], axis=0)
        gain, offset = least_squares((others, 1.0), course)
        run["T"], run["T" + SIMULATED] = course, gain * others + offset
        runs[f"cell {cell}"] = run
    return pair(runs, (_PLUS, _CURRENT))


_READING = "means of 20 readings, one a second"

CASES = (
    RealCase(
        name="cell_18650/as the air",
        kind="positive",
        build=_as_the_air,
        model="the surface is as warm as the air, with the current at hand; a fourth cell is held out",
        truth="it is warmed by the current, up to 20 K (read off)",
        right=("thermal.second_source",),
        tolerated=("thermal.memory", "thermal.convection", "thermal.ambient"),
        reading=_READING,
    ),
    RealCase(
        name="cell_18650/at once",
        kind="positive",
        build=partial(_joule, lag=False),
        model="warmer than the air by the square of the current, at once; a fourth cell is held out",
        truth="it follows with a time constant of 15 min (read off)",
        right=("thermal.memory",),
        tolerated=("gauging.lag", "thermal.second_source", "thermal.convection", "data.clock", "drive.delay"),
        reading=_READING,
    ),
    RealCase(
        name="cell_18650/joule",
        kind="positive",
        build=partial(_joule, lag=True),
        model="one heat capacity with one loss on the square of the current, fitted to three cells; a fourth is held "
        "out",
        truth="0.8 K are left, most at the end of the discharge, where resistance and entropy of the cell change with "
        "its charge, which no channel tells (read off)",
        tolerated=("thermal.memory", "thermal.second_source", "thermal.convection", "thermal.interaction"),
        verdicts=("unexplained",),
        reading=_READING,
    ),
    RealCase(
        name="cell_18650/constant air",
        kind="positive",
        build=_constant_air,
        model="warmed by the current, in an air that stays as it was; fitted to three cells, a fourth is held out",
        truth="the air warms by up to 2.5 K in ten hours, and the cells with it (read off)",
        right=("thermal.ambient",),
        tolerated=("thermal.second_source", "thermal.memory"),
        reading="means of 60 readings, one a second",
    ),
    RealCase(
        name="cell_18650/other pole",
        kind="control",
        build=partial(_beside, fitted=True),
        model="the other thermometer on the same cell by its gain, fitted to two discharges; a third is held out",
        truth="nothing is left but 0.08 K (read off)",
        verdicts=SILENT,
        reading=_READING + "; each run with its own offset of the two thermometers, which were mounted anew",
    ),
    RealCase(
        name="cell_18650/same reading",
        kind="control",
        build=partial(_beside, fitted=False),
        model="the other thermometer on the same cell, as it reads",
        truth="a gain of 0.98, and nothing else (read off)",
        tolerated=("data.gain", "data.zero"),
        verdicts=SILENT,
        reading=_READING + "; each run with its own offset of the two thermometers, which were mounted anew",
    ),
    RealCase(
        name="cell_18650/twins",
        kind="control",
        build=_twins,
        model="each of four cells by the mean of the other three, with a gain of its own; the same discharge",
        truth="nothing is left but 0.1 to 0.25 K of 10",
        verdicts=SILENT,
        reading=_READING + "; warmth above the air",
    ),
)
