"""A lithium cell between two plates of constant temperature: random steps of current, and its surface."""

from __future__ import annotations

import io
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.io import loadmat
from scipy.io.matlab._mio5 import MatFile5Reader

from benchmarks.real.case import SIMULATED, Pair, RealCase, Vector, pair
from benchmarks.real.rigs.fifth.common import over
from selector.recording import Channel

_STEP_S = 5.0
_HEAD = b"MATLAB 5.0 MAT-file".ljust(116) + b"\0" * 8 + b"\x00\x01IM"
_CHANNELS = (
    Channel("T", "temperature", "degC", place="surface of the cell"),
    Channel("I", "current", "A", place="cell"),
)


def _series(path: Path) -> tuple[Vector, Vector]:
    """Times and values of a MATLAB timeseries, whose objects stand in the workspace of the file."""
    reader = MatFile5Reader(io.BytesIO(_HEAD + loadmat(path)["__function_workspace__"].tobytes()[8:]))
    reader.initialize_read()
    reader.mat_stream.seek(128)
    header, _ = reader.read_var_header()
    objects: Any = reader.read_var_array(header, process=False)["MCOS"].ravel()[0]["arr"].ravel()[0].ravel()
    objects = objects if len(objects) > 5 else objects[0].ravel()
    long = [one.ravel() for one in objects if getattr(one, "size", 0) > 500 and one.dtype == np.float64]
    return long[0], long[-1]


def _read(folder: Path, test: str) -> pd.DataFrame:
    time_s, surface = _series(folder / test / "Temperature_Profile.mat")
    moments, amperes = _series(folder / test / "Current_Profile.mat")
    grid = np.arange(time_s[0], moments[-1], _STEP_S)
    current = np.interp(grid, moments, amperes)
    return over(pd.DataFrame({"T": np.interp(grid, time_s, surface), "I": current}), _STEP_S)


def _walk(folder: Path, *, joule: bool) -> Pair:
    """At rest, or by what the end of a discharge at 18 A gives for an ampere squared."""
    run, full = _read(folder, "03 - Random Walk Test"), _read(folder, "01 - Constant Current Discharge Test")
    risen = float(full["T"].iloc[-1] - full["T"].iloc[0]) / float(full["I"].iloc[-1]) ** 2 if joule else 0.0
    run["T" + SIMULATED] = run["T"].iloc[0] + risen * run["I"] ** 2
    return pair({"walk": run}, _CHANNELS)


_READING = "interpolated every 5 s"

CASES = (
    RealCase(
        name="discharged_cell/cold",
        kind="positive",
        build=partial(_walk, joule=False),
        model="the cell stays as it was at the start, with the current at hand; the last 30 % are held out",
        truth="it is warmed by the current, up to 8 K (read off)",
        right=("thermal.second_source",),
        tolerated=("thermal.memory", "thermal.convection"),
        reading=_READING,
    ),
    RealCase(
        name="discharged_cell/at once",
        kind="positive",
        build=partial(_walk, joule=True),
        model="warmer than at the start by the square of the current, at once, as the end of another discharge gave "
        "it; the last 30 % are held out",
        truth="it follows with a time constant of 9 min (read off)",
        right=("thermal.memory",),
        tolerated=("gauging.lag", "thermal.second_source", "thermal.convection", "data.clock", "drive.delay"),
        reading=_READING,
    ),
)
