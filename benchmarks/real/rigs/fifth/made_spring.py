"""An actuator that behaves as a spring whose force is limited, pressed by a testing machine to and fro, three times."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, Vector, pair
from benchmarks.real.rigs.fifth.common import over, simulated
from benchmarks.real.rigs.fourth.common import SILENT
from selector.recording import Channel

_CHANNELS = (
    Channel("x", "position", "m", place="testing machine", axis="Z"),
    Channel("F", "force", "N", place="testing machine", axis="Z"),
)


def _read(folder: Path, threshold: int) -> dict[str, pd.DataFrame]:
    raw = pd.read_csv(folder / f"data/validation/static_force_test_{threshold}n_threshold.csv")
    runs = {}
    for k in (1, 2, 3):
        trial = raw[[f"Trial {k}_x", f"Trial {k}_y"]].dropna().set_axis(["x", "F"], axis=1)
        way = trial["x"].rolling(13, center=True, min_periods=1).mean()
        runs[f"trial {k}"] = over(trial.assign(x=1e-3 * way), 0.01)
    return runs


def _spring(x: Vector, run: pd.DataFrame) -> Vector:
    return np.asarray(1000.0 * x[0] * run["x"])


def _limited(folder: Path) -> Pair:
    """The part of the way on which the limit acts."""
    runs = {name: over(run[run["x"] < -0.6e-3], 0.01) for name, run in _read(folder, 5).items()}
    level = pd.concat(list(runs.values())[:2])["F"].mean()
    for run in runs.values():
        run["F" + SIMULATED] = np.full(len(run), level)
    return pair(runs, _CHANNELS)


def _first_part(folder: Path) -> Pair:
    """The stiffness of the part below half the limit, for all of the way."""
    runs = _read(folder, 20)
    known = {name: run[run["F"] > -10.0].copy() for name, run in runs.items()}
    law = simulated(known, "F", _spring, [15.0], 2)
    for run in runs.values():
        run["F" + SIMULATED] = _spring(law, run)
    return pair(runs, _CHANNELS)


def _again(folder: Path) -> Pair:
    """Each trial by the mean of the other two at the same place of the way."""
    runs = _read(folder, 10)
    whole = {name: run.copy() for name, run in runs.items()}

    def at(run: pd.DataFrame, other: pd.DataFrame) -> Vector:
        """Force of the other trial at the way that this one has gone."""
        ways = [np.concatenate([[0.0], np.cumsum(np.abs(np.diff(one["x"])))]) for one in (run, other)]
        return np.asarray(np.interp(ways[0], ways[1], other["F"]))

    for name, run in runs.items():
        run["F" + SIMULATED] = np.mean([at(run, whole[other]) for other in whole if other != name], axis=0)
    return pair(runs, _CHANNELS)


_READING = (
    "rows of equal way are taken for 10 ms; way smoothed over 13 rows, its steps are 0.05 mm; pressed is negative"
)

CASES = (
    RealCase(
        name="made_spring/straight",
        kind="positive",
        build=_first_part,
        model="force by way, the stiffness of the first half of the force, fitted to two trials; a third is held out",
        truth="the force is limited to 20 N, 'programmed force threshold': the README",
        right=("drive.saturation", "vibration.hardening", "drive.varying_stiffness"),
        tolerated=("drive.coulomb", "vibration.hysteresis", "data.gain"),
        verdicts=("unexplained",),
        reading=_READING,
    ),
    RealCase(
        name="made_spring/without friction",
        kind="positive",
        build=_limited,
        model="the force is at its limit beyond 0.6 mm, the mean of two trials of the 5 N spring; a third is held out",
        truth="to and fro differ by 0.4 N at every place: friction of the actuator (read off)",
        right=("drive.coulomb", "vibration.hysteresis"),
        tolerated=("drive.viscous", "drive.stribeck", "drive.asymmetric_friction", "drive.backlash"),
        reading=_READING,
    ),
    RealCase(
        name="made_spring/again",
        kind="control",
        build=_again,
        model="a trial of the 10 N spring by the mean of the two others at the same way; the third is held out",
        truth="the same programme",
        verdicts=SILENT,
        reading=_READING,
    ),
)
