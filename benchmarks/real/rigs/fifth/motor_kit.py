"""A small motor of a teaching kit: steps, sweeps and stairs of voltage, each six times, and the speed."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.io import loadmat

from benchmarks.real.case import SIMULATED, Pair, RealCase, Vector, pair, thinned
from benchmarks.real.rigs.fifth.common import over, simulated
from benchmarks.real.rigs.fourth.common import SILENT, lagging, step_of
from selector.recording import Channel

_CHANNELS = (
    Channel("u", "voltage", "V", place="motor", axis="C"),
    Channel("v", "velocity", "m/s", place="shaft, 100 of the record as 1 m/s", axis="C"),
)


def _read(folder: Path, study: str, kind: str, number: int, mean_of: int) -> pd.DataFrame:
    (path,) = (folder / f"PART2_study{study}").glob(f"part2_{kind}_{number}_*/*_Raw.mat")
    raw = loadmat(path, squeeze_me=True, struct_as_record=False)["RawData"]
    values = {"u": np.asarray(raw.Input, dtype=np.float64), "v": 0.01 * np.asarray(raw.Velo, dtype=np.float64)}
    return thinned(over(pd.DataFrame(values), 0.0005), mean_of)


def _line(x: Vector, run: pd.DataFrame) -> Vector:
    return np.asarray(x[0] + x[1] * run["u"])


def _lag(x: Vector, run: pd.DataFrame) -> Vector:
    return np.asarray(lagging(_line(x, run), step_of(run), abs(x[2]) + 1e-3, float(run["v"].iloc[0])))


def _sines(folder: Path) -> Pair:
    runs = {f"sine {k}": _read(folder, "V4", "Sine", k, 10) for k in (1, 2, 3, 5)}
    simulated(runs, "v", _lag, [-0.01, 0.2, 0.017])
    return pair(runs, _CHANNELS)


def _sweeps(folder: Path) -> Pair:
    runs = {f"sweep {k}": _read(folder, "V4", "Chirp", k, 4).iloc[:8000] for k in (1, 2, 3)}
    simulated(runs, "v", _line, [-0.01, 0.2])
    return pair(runs, _CHANNELS)


def _again(folder: Path, kind: str, mean_of: int) -> Pair:
    """Each of six recordings by the mean of the others, as it is."""
    runs = {f"{kind} {k}": _read(folder, "V4", kind, k, mean_of) for k in range(1, 7)}
    courses = np.array([run["v"] for run in runs.values()])
    for k, run in enumerate(runs.values()):
        run["v" + SIMULATED] = np.delete(courses, k, axis=0).mean(axis=0)
    return pair(runs, _CHANNELS)


def _late(folder: Path) -> Pair:
    """The law of the later study, whose steps are in time, on those that begin late."""
    known = {f"in time {k}": _read(folder, "V4", "Step", k, 4) for k in (1, 2, 3)}
    law = simulated(known, "v", _lag, [0.0, 0.2, 0.015], 3)
    runs = {f"step {k}": _read(folder, "V3_12V", "Step", k, 4) for k in (1, 3, 4, 5)}
    for run in runs.values():
        run["v" + SIMULATED] = _lag(law, run)
    return pair(runs, _CHANNELS)


_READING = "0.5 ms a row, means of ten; the unit of the speed is not said"

CASES = (
    RealCase(
        name="motor_kit/straight",
        kind="positive",
        build=_sines,
        model="speed by voltage, a straight line behind a lag, fitted to three slow sines; a fourth is held out",
        truth="dry friction: below 0.8 V the motor stands (read off; the author starts his records where the speed "
        "'overcomes friction')",
        right=("drive.coulomb",),
        tolerated=("drive.viscous", "drive.stribeck", "drive.varying_damping", "drive.asymmetric_friction"),
        reading=_READING,
    ),
    RealCase(
        name="motor_kit/at once",
        kind="positive",
        build=_sweeps,
        model="speed by voltage, a straight line at once, fitted to two sweeps; a third is held out",
        truth="it follows with a time constant of 15 ms (read off)",
        right=("drive.mass", "gauging.lag", "drive.delay", "data.clock"),
        tolerated=("drive.viscous", "drive.coulomb", "drive.elasticity"),
        verdicts=("miscalibrated",),
        reading="0.5 ms a row, means of four",
    ),
    RealCase(
        name="motor_kit/late",
        kind="positive",
        build=_late,
        model="the straight line and the lag of a later study on steps of an earlier one; a fourth step is held out",
        truth="these records begin 0.09 to 0.1 s before the motor does: the author's PART2_data_sync.m puts them in "
        "time",
        right=("data.clock", "drive.delay"),
        tolerated=("gauging.lag", "drive.mass", "data.gain"),
        verdicts=("miscalibrated",),
        reading="0.5 ms a row, means of four",
    ),
    RealCase(
        name="motor_kit/sine again",
        kind="control",
        build=partial(_again, kind="Sine", mean_of=10),
        model="a sine by the mean of five others; the sixth is held out",
        truth="the same programme",
        verdicts=SILENT,
        reading=_READING,
    ),
    RealCase(
        name="motor_kit/sweep again",
        kind="control",
        build=partial(_again, kind="Chirp", mean_of=10),
        model="a sweep by the mean of five others; the sixth is held out",
        truth="the same programme",
        verdicts=SILENT,
        reading=_READING,
    ),
    RealCase(
        name="motor_kit/stairs again",
        kind="control",
        build=partial(_again, kind="Stair", mean_of=40),
        model="stairs of voltage by the mean of five others; the sixth is held out",
        truth="the same programme",
        verdicts=SILENT,
        reading="0.5 ms a row, means of forty",
    ),
)
