"""A brushless motor turned slowly, with and without a table against cogging, and maps of the current by angle."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, least_squares, pair, table, thinned
from selector.recording import Channel

_DATA = "analysis/cogging_torque"
_COUNTS = 8192
_MEAN_OF = 3
_POINTS = 16
_BACK_S = 0.5
"""In this time the motor goes back to where it starts from."""
_CHANNELS = (
    Channel("angle", "position", "m", place="shaft, a turn as a metre", axis="C"),
    Channel("Iq", "current", "A", place="motor", axis="C"),
)


def _read(path: Path, mean_of: int) -> pd.DataFrame:
    """Angle and current; the simulated angle is that of a constant speed."""
    time_s, counts, current = np.load(path)
    kept = np.r_[True, np.diff(time_s) > 0] & (time_s > _BACK_S)
    angle = counts[kept] / _COUNTS
    line = least_squares([time_s[kept], 1.0], angle)
    steady = line[0] * time_s[kept] + line[1]
    return thinned(table(time_s[kept], angle=angle, Iq=current[kept], angle_simulated=steady), mean_of)


def _steady(folder: Path, *, files: Sequence[str], mean_of: int) -> Pair:
    runs = {Path(name).name: _read(folder / _DATA / f"{name}.npy", mean_of) for name in files}
    return pair(runs, _CHANNELS)


def _repeated(folder: Path, *, first: str, others: Sequence[str]) -> Pair:
    """Deviation from the constant speed by angle of one run, in the others."""
    known = _read(folder / _DATA / f"{first}.npy", _MEAN_OF)
    runs = {Path(name).name: _read(folder / _DATA / f"{name}.npy", _MEAN_OF) for name in others}
    course = (known["angle"] - known["angle" + SIMULATED]).to_numpy()
    order = np.argsort(known["angle" + SIMULATED].to_numpy() % 1.0)
    turned = known["angle" + SIMULATED].to_numpy()[order] % 1.0
    for frame in runs.values():
        steady = frame["angle" + SIMULATED]
        frame["angle" + SIMULATED] = steady + np.interp(steady % 1.0, turned, course[order], period=1.0)
    return pair(runs, _CHANNELS)


def _maps(folder: Path) -> Pair:
    """The current by angle of one map as the simulation of another; a point is taken as a second."""
    one, other = (np.load(folder / _DATA / "coggingmap_0" / f"cogging_measure_final_{k}_16.npy") for k in "ab")
    points = np.arange(0, _COUNTS, _POINTS)
    frame = table(points / _POINTS, angle=points / _COUNTS, Iq=other[points], Iq_simulated=one[points])
    return pair({"map b": frame}, _CHANNELS)


_TRUTH = (
    "analysis/cogging_torque/notes.md: 'how much oscillation (position error) there is with and without anti-cogging "
    "compensation'"
)
_SPEED = "angle = speed x time, of each run its own"
_READING = "a turn is a metre; means of rows of 2.3 ms (uneven); the first 0.5 s are left out"
_SILENT = ("nothing-missing", "miscalibrated")

CASES = (
    RealCase(
        name="odrive/slow",
        kind="positive",
        build=partial(_steady, files=[f"slow2/nocomp_{k}" for k in range(3)], mean_of=_MEAN_OF),
        model=_SPEED + "; the third is held out",
        truth=_TRUTH + "; 35 counts without, 8 with",
        right=("drive.ripple",),
        tolerated=("drive.pitch_error", "drive.stribeck"),
        reading=_READING,
    ),
    RealCase(
        name="odrive/slower",
        kind="positive",
        build=partial(_steady, files=["slow2_slower/nocomp_0"], mean_of=4),
        model=_SPEED + "; the last 30 % are held out",
        truth=_TRUTH + "; 23 counts without, 5 with",
        right=("drive.ripple",),
        tolerated=("drive.pitch_error", "drive.stribeck"),
        reading=_READING,
    ),
    RealCase(
        name="odrive/again",
        kind="control",
        build=partial(_repeated, first="slow2/nocomp_0", others=["slow2/nocomp_1", "slow2/nocomp_2"]),
        model="deviation by angle of the first of three runs without the table, in the others; the third is held out",
        truth="the same run again: 35.3, 35.2, 35.3 counts",
        verdicts=_SILENT,
        reading=_READING,
    ),
    RealCase(
        name="odrive/compensated again",
        kind="control",
        build=partial(_repeated, first="slow2/comp_0", others=["slow2/comp_1", "slow2/comp_2"]),
        model="deviation by angle of the first of three runs with the table, in the others; the third is held out",
        truth="the same run again: 8.3, 8.4, 8.3 counts",
        verdicts=_SILENT,
        reading=_READING,
    ),
    RealCase(
        name="odrive/maps",
        kind="control",
        build=_maps,
        model="the current by angle as it was measured before",
        truth="notes.md: 'just ran again to see repeatability - very repeatable'; 0.043 A of 0.83 A (read off)",
        verdicts=_SILENT,
        reading="512 points of a turn, a point as a second",
    ),
)
