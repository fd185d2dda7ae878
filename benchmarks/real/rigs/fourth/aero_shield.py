"""A pendulum that a propeller lifts (AeroShield): voltage in steps, and its angle."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, least_squares, pair
from benchmarks.real.rigs.fourth.common import numbers
from benchmarks.real.rigs.third.common import pieces
from selector.recording import Channel

_DATA = "matlab/examples/AeroShield"
_STEP_S = 0.01
_CHANNELS = (
    Channel("u", "voltage", "V", place="motor of the propeller"),
    Channel("angle", "position", "m", place="pendulum, angle as travel at a lever of 1 m"),
)


def _read(folder: Path, name: str, ending: str) -> pd.DataFrame:
    found = numbers(folder / _DATA / f"{name}_Data.mat")
    values = {"u": found["u" + ending].astype(np.float64)[:-5], "angle": found["yrad" + ending].astype(np.float64)[:-5]}
    return pd.DataFrame(values, index=pd.Index(_STEP_S * np.arange(len(values["u"])), name="time_s"))


def _settled(folder: Path) -> Pair:
    first, second = _read(folder, "Identification", ""), _read(folder, "Validation", "val")
    halves = {"start": (2.0, 25.0), "end": (25.0, 48.0)}
    runs = {f"identification {name}": run for name, run in pieces(first, halves).items()}
    runs |= {f"validation {name}": run for name, run in pieces(second, halves).items()}
    fitted = pd.concat(list(runs.values())[:3])
    gain, offset = least_squares((fitted["u"].to_numpy(), 1.0), fitted["angle"].to_numpy())
    for run in runs.values():
        run["angle" + SIMULATED] = gain * run["u"] + offset
    return pair(runs, _CHANNELS)


CASES = (
    RealCase(
        name="aero_shield/settled",
        kind="positive",
        build=_settled,
        model="the angle of rest by voltage, a straight line, fitted to three half records; a fourth is held out",
        truth="it swings for seconds after every step; the authors' equation is that of a damped pendulum",
        right=("vibration.mode",),
        tolerated=("drive.elasticity", "drive.mass", "vibration.back_reaction"),
        reading="10 ms; rad as m at 1 m; from 2 s on, when it hangs in the air",
    ),
)
