"""A magnetorheological damper on a shaking table, moved to and fro by sines of several amplitudes."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.io import loadmat

from benchmarks.real.case import SIMULATED, Pair, RealCase, Vector, least_squares, pair
from benchmarks.real.rigs.second.common import SILENT
from selector.recording import Channel

_MM = 1e-3
_SHARP = 2e-3
_BEGIN = 150
_CHANNELS = (
    Channel("x", "position", "m", place="rod of the damper", axis="X"),
    Channel("F", "force", "N", place="load cell at the damper", axis="X"),
)


def _read(path: Path) -> pd.DataFrame:
    raw = loadmat(path)
    time_s, rows = raw["Tout"].ravel()[_BEGIN:], raw["x_F"][_BEGIN:]
    columns = {"x": _MM * rows[:, 0], "v": np.gradient(_MM * rows[:, 0], time_s), "F": rows[:, 2]}
    return pd.DataFrame(columns, index=pd.Index(time_s - time_s[0], name="time_s"))


def _damped(folder: Path, *, files: Sequence[str], dry: bool) -> Pair:
    runs = {name: _read(folder / "data" / f"{name}.mat") for name in files}

    def laws(frame: pd.DataFrame) -> list[Vector]:
        speed = frame["v"].to_numpy()
        columns = [speed, np.ones(len(speed))]
        return [*columns, np.tanh(speed / _SHARP)] if dry else columns

    fitted = pd.concat(list(runs.values())[:-1])
    factors = least_squares(laws(fitted), fitted["F"].to_numpy())
    for frame in runs.values():
        frame["F" + SIMULATED] = np.column_stack(laws(frame)) @ factors
    return pair(runs, _CHANNELS)


def _again(folder: Path) -> Pair:
    """The mean cycle of one test, in another of the same amplitude, by the phase of each."""
    known, other = (_read(folder / "data" / f"ensaio.vali.{k}.mat") for k in (3, 6))
    turns = [_turns(one) for one in (known, other)]
    order = np.argsort(turns[0] % 1.0)
    cycle = pd.Series(known["F"].to_numpy()[order]).rolling(9, center=True, min_periods=1).mean().to_numpy()
    other["F" + SIMULATED] = np.interp(turns[1] % 1.0, (turns[0] % 1.0)[order], cycle, period=1.0)
    return pair({"vali.6": other}, _CHANNELS)


def _turns(frame: pd.DataFrame) -> Vector:
    """Cycles since the first upward crossing of the mean displacement."""
    centred, times = frame["x"].to_numpy() - frame["x"].mean(), frame.index.to_numpy()
    up = np.flatnonzero((centred[:-1] < 0.0) & (centred[1:] >= 0.0))
    crossings = times[up] - centred[up] / (centred[up + 1] - centred[up]) * (times[up + 1] - times[up])
    slope, start = np.polyfit(np.arange(len(crossings)), crossings, 1)
    return (times - start) / slope


_TRUTH = (
    "README.md: 'Shaking table with MR-damper'; maincode.m fits a Dahl model (force = Kx x speed + Kw x w, w with "
    "memory) to the force"
)
_READING = "mm as m; the first 1.5 s, in which it starts, are left out; 10 ms"

CASES = (
    RealCase(
        name="magnetic_damper/viscous",
        kind="positive",
        build=partial(_damped, files=("ensaio1.1", "ensaio4.1", "ensaio7.1", "ensaio9.1"), dry=False),
        model="force = c x speed + constant, fitted to three amplitudes (12, 10, 8 mm); 7 mm is held out",
        truth=_TRUTH + "; the force jumps by 140 N where the speed changes its sign (read off)",
        right=("drive.coulomb", "vibration.hysteresis"),
        tolerated=("drive.stribeck", "drive.asymmetric_friction", "drive.backlash"),
        reading=_READING,
    ),
    RealCase(
        name="magnetic_damper/strong viscous",
        kind="positive",
        build=partial(_damped, files=("ensaio.A.1", "ensaio.A.4", "ensaio.A.6", "ensaio.A.8"), dry=False),
        model="the same, at a higher force; the smallest amplitude is held out",
        truth=_TRUTH + "; the force jumps by 1000 N with the sign of the speed (read off)",
        right=("drive.coulomb", "vibration.hysteresis"),
        tolerated=("drive.stribeck", "drive.asymmetric_friction", "drive.backlash"),
        reading=_READING,
    ),
    RealCase(
        name="magnetic_damper/dry",
        kind="positive",
        build=partial(_damped, files=("ensaio1.1", "ensaio4.1", "ensaio7.1", "ensaio9.1"), dry=True),
        model="force = c x speed + constant + dry friction, fitted to three amplitudes; 7 mm is held out",
        truth=_TRUTH + "; force over speed is a loop, 20 to 40 N wide at slow speeds (read off)",
        right=("vibration.hysteresis",),
        tolerated=(
            "drive.backlash",
            "drive.elasticity",
            "drive.stribeck",
            "drive.asymmetric_friction",
            "drive.coulomb",
        ),
        reading=_READING,
    ),
    RealCase(
        name="magnetic_damper/again",
        kind="control",
        build=_again,
        model="the mean cycle of one test of 8.5 mm and 1 Hz, by the phase of another; its last 30 % held out",
        truth="the same amplitude and frequency again: -137 to 393 N and -140 to 401 N (read off)",
        verdicts=SILENT,
        reading=_READING,
    ),
)
