"""A pendulum on a motor that follows commands of torque: what was commanded, what the motor says, and the angle."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, Vector, least_squares, pair, thinned
from benchmarks.real.rigs.fifth.common import over, simulated
from benchmarks.real.rigs.fourth.common import SILENT
from selector.recording import Channel

_STEP_S, _HALF, _TAPS = 0.005, 4000, 4
_RUNS = {"swing-up 1": ("sac", slice(0, _HALF)), "swing-up 2": ("sac", slice(_HALF, 2 * _HALF)),
         "by energy": ("energy_shaping", slice(0, _HALF))}  # fmt: skip
_CHANNELS = (
    Channel("torque", "force", "N", place="motor, 1 N m as 1 N", axis="C"),
    Channel("angle", "position", "m", place="motor, 1 rad as 1 m", axis="C"),
)


def _method(folder: Path, name: str) -> pd.DataFrame:
    place = folder / f"results/control_method_{name}"
    measured, desired = (pd.read_csv(place / f"data_{what}.csv") for what in ("measured", "desired"))
    columns = {"torque": measured["torque"], "angle": measured["position"], "command": desired["torque"]}
    return pd.DataFrame(columns | {"time": measured["time"]}).dropna()


def _earlier(run: pd.DataFrame) -> list[Vector]:
    """The command one to four rows ago."""
    command = run["command"].to_numpy()
    return [np.concatenate([np.full(k, command[0]), command[:-k]]) for k in range(1, _TAPS + 1)]


def _commanded(folder: Path, *, late: bool) -> Pair:
    runs = {run: over(_method(folder, name).iloc[rows].drop(columns="time").reset_index(drop=True), _STEP_S)
            for run, (name, rows) in _RUNS.items()}  # fmt: skip
    if late:
        known = pd.concat(list(runs.values())[:-1])
        parts = zip(*(_earlier(run) for run in list(runs.values())[:-1]), strict=True)
        factors = least_squares([*(np.concatenate(part) for part in parts), 1.0], known["torque"].to_numpy())
    for name, run in runs.items():
        shapes = [*_earlier(run), 1.0] if late else []
        course = sum(factor * shape for factor, shape in zip(factors, shapes, strict=True)) if late else run["command"]
        runs[name] = run.assign(**{"torque" + SIMULATED: course}).drop(columns="command")
        runs[name] = thinned(runs[name], 2) if late else runs[name]
    return pair(runs, _CHANNELS)


def _gravity(x: Vector, run: pd.DataFrame) -> Vector:
    return np.asarray(x[0] + x[1] * np.sin(run["angle"]))


def _held(folder: Path) -> Pair:
    raw = _method(folder, "gravity_compensation").set_index("time")
    whole = thinned(raw[["torque", "angle"]], 20)
    thirds = [whole.iloc[k * len(whole) // 3 : (k + 1) * len(whole) // 3] for k in range(3)]
    runs = {f"{name} third": part.set_axis(pd.Index(part.index - part.index[0], name="time_s"))
            for name, part in (("first", thirds[0]), ("last", thirds[2]), ("second", thirds[1]))}  # fmt: skip
    simulated(runs, "torque", _gravity, [-0.01, 3.0])
    return pair(runs, _CHANNELS)


CASES = (
    RealCase(
        name="driven_pendulum/as commanded",
        kind="positive",
        build=partial(_commanded, late=False),
        model="the torque is the one that was commanded, in two halves of a swing-up; another swing-up is held out",
        truth="the motor says what it was told one to two cycles of 5 ms ago (read off)",
        right=("drive.delay", "data.clock", "gauging.lag"),
        tolerated=("drive.mass", "drive.elasticity", "drive.viscous"),
        verdicts=("miscalibrated",),
        reading="5 ms a row",
    ),
    RealCase(
        name="driven_pendulum/late command",
        kind="control",
        build=partial(_commanded, late=True),
        model="the torque by the commands of the last four cycles, fitted to the same two halves; the other swing-up "
        "is held out",
        truth="nothing is missing: 7 % are left that alternate, the clock of the motor against that of the commands",
        tolerated=("drive.delay", "data.clock", "gauging.lag"),
        verdicts=SILENT,
        reading="5 ms a row, means of two",
    ),
    RealCase(
        name="driven_pendulum/held",
        kind="control",
        build=_held,
        model="the torque that bears the weight, by the sine of the angle, fitted to two thirds of a record; the third "
        "between them is held out",
        truth="nothing is missing: the control commands just this, and 0.4 % are left, white",
        verdicts=SILENT,
        reading="1 ms a row, means of twenty",
    ),
)
