"""A geared motor that turns an eccentric under load, after square waves and its own ramp."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, Vector, pair
from benchmarks.real.rigs.third.common import SILENT, fitted, lagged
from selector.recording import Channel

_RUNS = ("half-travel-1Hz", "full-travel-0.5Hz", "full-travel-1Hz")
_CHANNELS = (
    Channel("target", "position_command", "m", place="eccentric, angle as travel at a lever of 1 m"),
    Channel("q", "position", "m", place="eccentric, at the same lever"),
)


def _read(folder: Path, name: str, given: str) -> pd.DataFrame:
    """Time, target, demand, actual angle, speed, current; from where the first wave begins."""
    raw = np.genfromtxt(folder / "actuators/EccA/data" / f"load-square-wave-{name}.txt")
    columns = {"target": np.deg2rad(raw[:, 1 if given == "target" else 2]), "q": np.deg2rad(raw[:, 3])}
    frame = pd.DataFrame(columns, index=pd.Index(1e-3 * raw[:, 0], name="time_s")).dropna()
    begins = int(np.flatnonzero(np.abs(frame["target"]) > 0.0)[0])
    frame = frame.iloc[max(begins - 20, 0) :]
    return frame.set_axis(pd.Index(frame.index - frame.index[0], name="time_s"))


def _follower(x: Vector, frame: pd.DataFrame) -> Vector:
    return lagged(frame["target"].to_numpy(), frame.index.to_numpy(), abs(x[0]), float(frame["q"].iloc[0]))


def _late(x: Vector, frame: pd.DataFrame) -> Vector:
    times = frame.index.to_numpy()
    return np.interp(times - x[0], times, frame["target"].to_numpy())


def _lag(folder: Path) -> Pair:
    runs = {name: _read(folder, name, "target") for name in _RUNS}
    law = fitted(_follower, list(runs.values())[:2], "q", [0.2])
    for frame in runs.values():
        frame["q" + SIMULATED] = _follower(law, frame)
    return pair(runs, _CHANNELS)


def _demand(folder: Path, *, delayed: bool) -> Pair:
    runs = {name: _read(folder, name, "demand") for name in _RUNS}
    law = fitted(_late, list(runs.values())[:2], "q", [0.01]) if delayed else np.zeros(1)
    for frame in runs.values():
        frame["q" + SIMULATED] = _late(law, frame)
    return pair(runs, _CHANNELS)


_READING = "13 ms; degrees as m at 1 m; from 20 rows before the first wave"

CASES = (
    RealCase(
        name="eccentric/follower",
        kind="positive",
        build=_lag,
        model="a lag of first order after the square wave, fitted to two runs; the full way at 1 Hz is held out",
        truth="it turns with a constant speed of 230 degrees a second and needs longer for the longer way (read off); "
        "the ramp stands in the column of the demand",
        right=("drive.saturation",),
        tolerated=("drive.delay", "gauging.lag", "drive.mass", "drive.elasticity"),
        reading=_READING,
    ),
    RealCase(
        name="eccentric/as demanded",
        kind="positive",
        build=partial(_demand, delayed=False),
        model="it is where its own ramp demands; the full way at 1 Hz is held out",
        truth="the angle trails the demand by a constant time (read off)",
        right=("drive.delay", "data.clock"),
        tolerated=("gauging.lag", "drive.viscous", "drive.elasticity", "drive.mass", "drive.coulomb"),
        verdicts=("miscalibrated",),
        reading=_READING,
    ),
    RealCase(
        name="eccentric/late",
        kind="control",
        build=partial(_demand, delayed=True),
        model="the same, late by the time that leaves least of two runs; the full way at 1 Hz is held out",
        truth="what is left is 5 to 11 mrad of a way of up to 2.5 rad: a fit at its own noise (read off)",
        verdicts=SILENT,
        reading=_READING,
    ),
)
