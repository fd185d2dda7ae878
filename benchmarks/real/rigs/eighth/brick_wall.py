"""A wall of bricks and insulation (DaISy): temperatures of its two faces, and the heat that flows through."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, Vector, pair
from benchmarks.real.rigs.fifth.common import first_share, over, simulated
from selector.recording import Channel

_STEP_S = 3600.0
_CHANNELS = (
    Channel("q", "displacement", "um", place="heat flow through the wall, 1 W/m2 as 1 um"),
    Channel("first", "temperature", "degC", place="one face of the wall"),
    Channel("second", "temperature", "degC", place="the other face of the wall"),
)


def _resistance(x: Vector, run: pd.DataFrame) -> Vector:
    return np.asarray(x[0] + x[1] * run["first"] + x[2] * run["second"])


def _at_once(folder: Path) -> Pair:
    raw = np.loadtxt(folder / "data/thermic_res_wall.dat")
    run = over(pd.DataFrame(raw, columns=["first", "second", "q"]), _STEP_S)
    law = simulated({"fitted": first_share(run).copy()}, "q", _resistance, [0.0, -0.1, 0.5], 1)
    run["q" + SIMULATED] = _resistance(law, run)
    return pair({"ten weeks": run}, _CHANNELS)


CASES = (
    RealCase(
        name="brick_wall/at once",
        kind="positive",
        build=_at_once,
        model="the heat flow by both temperatures at once, a thermal resistance, fitted to the first 70 %; the rest is "
        "held out",
        truth="the wall stores heat for some five rows (read off)",
        right=("thermal.memory",),
        tolerated=("thermal.interaction", "thermal.convection", "gauging.lag", "data.clock", "drive.delay",
                   "thermal.ambient", "thermal.second_source"),
        reading="1680 rows whose interval is not in the file; taken as an hour",
    ),
)  # fmt: skip
