"""A robot with one flexible link, a steel ruler: its motor follows sweeps, an accelerometer sits at the tip."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, least_squares, pair
from benchmarks.real.rigs.fifth.common import over
from benchmarks.real.rigs.fourth.common import SILENT
from selector.recording import Channel

_STEP_S = 0.002
_ANGLE = Channel("angle", "position", "m", place="motor, 1000 counts as 1 m", axis="C")
_COMMAND = Channel("wanted", "position_command", "m", place="motor, 1000 counts as 1 m", axis="C")
_VOLTAGE = Channel("u", "voltage", "V", place="amplifier, 100 counts as 1 V", axis="C")
_TIP = Channel("a", "acceleration", "m/s^2", place="tip, 10 counts as 1 m/s2", axis="C")


def _read(folder: Path, name: str) -> pd.DataFrame:
    raw = np.loadtxt(folder / f"example/2009-04-21/{name}.txt")
    columns = {"wanted": raw[:, 2] / 1000.0, "u": raw[:, 3] / 100.0, "angle": raw[:, 4] / 1000.0, "a": raw[:, 5] / 10.0}
    return over(pd.DataFrame(columns), _STEP_S)


def _sweeps(folder: Path, numbers: tuple[int, ...]) -> dict[str, pd.DataFrame]:
    return {f"sweep {k}": _read(folder, f"swept{k}-0-10hz") for k in numbers}


def _smooth(values: pd.Series) -> pd.Series:
    return values.rolling(9, center=True, min_periods=1).mean()


def _rigid(folder: Path) -> Pair:
    runs = _sweeps(folder, (1, 2, 3, 10))
    known = list(runs.values())[:3]
    for run in runs.values():
        angle = _smooth(run["angle"]).to_numpy()
        run["turned"] = _smooth(pd.Series(np.gradient(np.gradient(angle, _STEP_S), _STEP_S))).to_numpy()
    gain, offset = least_squares((np.concatenate([run["turned"] for run in known]), 1.0),
                                 np.concatenate([run["a"] for run in known]))  # fmt: skip
    for run in runs.values():
        run["a" + SIMULATED] = gain * run.pop("turned") + offset
    return pair({name: run[["angle", "a", "a" + SIMULATED]] for name, run in runs.items()}, (_ANGLE, _TIP))


def _again(folder: Path, name: str) -> Pair:
    runs = _sweeps(folder, tuple(range(1, 11)))
    courses = np.array([run[name] for run in runs.values()])
    for k, run in enumerate(runs.values()):
        run[name + SIMULATED] = np.delete(courses, k, axis=0).mean(axis=0)
    kept = {key: runs[key][["wanted", name, name + SIMULATED]] for key in ("sweep 1", "sweep 4", "sweep 7", "sweep 10")}
    return pair(kept, (_COMMAND, _VOLTAGE))


_READING = "2 ms a row; counts of the converters, scaled"

CASES = (
    RealCase(
        name="ruler_robot/rigid",
        kind="positive",
        build=_rigid,
        model="the acceleration of the tip by that of the motor, a rigid link, fitted to three sweeps to 10 Hz; a "
        "fourth is held out",
        truth="the link is a flexible ruler: one mode at 17 Hz takes four fifths of the rest (read off)",
        right=("vibration.mode",),
        tolerated=("drive.elasticity", "vibration.back_reaction", "vibration.hardening", "drive.mass"),
        reading=_READING,
    ),
    RealCase(
        name="ruler_robot/again",
        kind="control",
        build=partial(_again, name="u"),
        model="the voltage of a sweep by the mean of nine others; a fourth sweep is held out",
        truth="the same programme",
        verdicts=SILENT,
        reading=_READING,
    ),
)
