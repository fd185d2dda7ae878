"""A band brake as a damper, pulled to and fro."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, least_squares, pair, thinned
from selector.recording import Channel

_DATA = "data/dataset-2/characterization datasets"
_FILES = ("0.25Hz30lbtension1amplitude", "1Hz30lbtension1amplitude", "0.5Hz30lbtension1amplitude")
_MEAN_OF = 16
_INCH_M, _KIP_N = 0.0254, 4448.22
_SHARP = 5e-3
_CHANNELS = (
    Channel("x", "position", "m", place="rod of the damper", axis="X"),
    Channel("F", "force", "N", place="friction", axis="X"),
)


def _read(path: Path) -> pd.DataFrame:
    rows = np.array(json.loads(path.read_text(encoding="utf-8"))["data"])
    columns = {"x": _INCH_M * rows[:, 1], "F": _KIP_N * rows[:, 2], "v": _INCH_M * rows[:, 3]}
    return thinned(pd.DataFrame(columns).set_axis(pd.Index(rows[:, 0], name="time_s")), _MEAN_OF)


def _damped(folder: Path, *, dry: bool) -> Pair:
    runs = {name.split("30")[0]: _read(folder / _DATA / f"{name}.json") for name in _FILES}

    def laws(frame: pd.DataFrame) -> list[np.ndarray]:
        speed = frame["v"].to_numpy()
        return [speed, np.tanh(speed / _SHARP)] if dry else [speed]

    fitted = pd.concat(list(runs.values())[:-1])
    factors = least_squares(laws(fitted), fitted["F"].to_numpy())
    for frame in runs.values():
        frame["F" + SIMULATED] = np.column_stack(laws(frame)) @ factors
    return pair(runs, _CHANNELS)


_TRUTH = "README.md: 'exhibits hysteretic and backlash effects'"
_READING = "means of 16 rows (1024 Hz)"

CASES = (
    RealCase(
        name="friction_damper/viscous",
        kind="positive",
        build=partial(_damped, dry=False),
        model="force = c x speed, fitted at 0.25 and 1 Hz; 0.5 Hz is held out",
        truth=_TRUTH + "; a band brake",
        right=("drive.coulomb",),
        tolerated=("drive.asymmetric_friction", "drive.backlash", "vibration.hysteresis", "drive.stribeck"),
        reading=_READING,
    ),
    RealCase(
        name="friction_damper/dry",
        kind="positive",
        build=partial(_damped, dry=True),
        model="force = c x speed + dry friction, fitted at 0.25 and 1 Hz; 0.5 Hz is held out",
        truth=_TRUTH + "; 7 mm are travelled after a reversal before half the force is back (read off)",
        right=("drive.backlash", "vibration.hysteresis"),
        tolerated=("drive.asymmetric_friction", "drive.stribeck", "drive.elasticity"),
        reading=_READING,
    ),
)
