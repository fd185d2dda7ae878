"""A pilot winder of webs with three motors: set speed of the second roll, and the speed that it has; a tension."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import Pair, RealCase, Vector, pair, thinned
from benchmarks.real.rigs.fifth.common import over, simulated
from benchmarks.real.rigs.fourth.common import lagging, numbers, step_of
from selector.recording import Channel

_FILE = "Atividade05/matlab/Contsid/Contsid7_3/contsid_winding.mat"
_CHANNELS = (
    Channel("u", "voltage", "V", place="set speed of roll 2", axis="C"),
    Channel("v", "velocity", "m/s", place="roll 2, its voltage as metres a second", axis="C"),
)


_TENSION = (
    Channel("i", "current", "A", place="set current of motor 1", axis="C"),
    Channel("tension", "force", "N", place="web between motors 1 and 2, its voltage as newtons", axis="C"),
)


def _line(x: Vector, run: pd.DataFrame) -> Vector:
    return np.asarray(x[0] + x[1] * run["u"])


def _at_once(folder: Path) -> Pair:
    raw = numbers(folder / _FILE)
    runs = {name: thinned(over(pd.DataFrame({"u": raw[f"s2s{end}"], "v": raw[f"s2{end}"]}), 0.01), 2)
            for name, end in (("first", "e"), ("second", "v"))}  # fmt: skip
    simulated(runs, "v", _line, [0.0, 1.0])
    return pair(runs, _CHANNELS)


def _lag(x: Vector, run: pd.DataFrame) -> Vector:
    course = (x[0] + x[1] * run["i"]).to_numpy()
    return np.asarray(lagging(course, step_of(run), abs(x[2]) + 1e-3, float(run["tension"].iloc[0])))


def _tension(folder: Path) -> Pair:
    raw = numbers(folder / _FILE)
    runs = {name: thinned(over(pd.DataFrame({"i": raw[f"i1s{end}"], "tension": raw[f"t1{end}"]}), 0.01), 2)
            for name, end in (("first", "e"), ("second", "v"))}  # fmt: skip
    simulated(runs, "tension", _lag, [0.8, -3.0, 0.8])
    return pair(runs, _TENSION)


CASES = (
    RealCase(
        name="winder/at once",
        kind="positive",
        build=_at_once,
        model="speed of a roll by its set speed, a straight line at once, fitted to one record; another is held out",
        truth="the roll follows with a time constant of about 0.4 s (read off; the authors identify it)",
        right=("drive.mass", "gauging.lag", "drive.delay", "data.clock"),
        tolerated=("drive.viscous", "drive.coulomb", "drive.elasticity"),
        verdicts=("miscalibrated",),
        reading="10 ms a row, means of two",
    ),
    RealCase(
        name="winder/tension",
        kind="positive",
        build=_tension,
        model="tension of the web by the current of its first motor, one lag, fitted to one record; another is held "
        "out",
        truth="the other two motors pull at the web, too, and were left out of the table (the authors identify all "
        "three): nothing of the catalogue",
        tolerated=("drive.elasticity", "vibration.back_reaction"),
        verdicts=("unexplained",),
        reading="10 ms a row, means of two",
    ),
)
