"""Two tanks over each other, fed by a pump: the level of the lower one at eleven settings of the pump."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from numba import njit

from benchmarks.real.case import SIMULATED, Pair, RealCase, Vector, pair
from benchmarks.real.rigs.fifth.common import first_share, over, simulated
from selector.recording import Channel

_STEP_S = 5.0
_CHANNELS = (
    Channel("level", "voltage", "V", place="lower tank, 1 cm as 1 V"),
    Channel("pump", "voltage", "V", place="pump, 10 % of its voltage as 1 V"),
)


def _read(folder: Path) -> pd.DataFrame:
    raw = pd.read_csv(folder / "System_identification/SYS_IDENT.csv").to_numpy(dtype=np.float64)
    return over(pd.DataFrame({"level": raw[:, 3], "pump": 0.1 * raw[:, 4]}), 1.0).iloc[:: int(_STEP_S)]


@njit(cache=True)
def _tank(inflow, outlet, level):  # type: ignore[no-untyped-def]
    course = np.empty(len(inflow))
    for k in range(len(inflow)):
        course[k] = level
        level = max(level + inflow[k] - outlet * np.sqrt(max(level, 0.0)), 0.0)
    return course


def _law(x: Vector, run: pd.DataFrame) -> Vector:
    """Inflow by the pump's voltage above a threshold, outflow by the root of the level."""
    inflow = abs(x[0]) * np.maximum(run["pump"].to_numpy() - x[2], 0.0)
    return np.asarray(_tank(inflow, abs(x[1]), float(run["level"].iloc[0])))


def _no_brim(folder: Path) -> Pair:
    run = _read(folder)
    law = simulated({"fitted": first_share(run).copy()}, "level", _law, [0.05, 0.2, -5.0], 1)
    run["level" + SIMULATED] = _law(law, run)
    return pair({"steps": run}, _CHANNELS)


CASES = (
    RealCase(
        name="tank_pair/no brim",
        kind="positive",
        build=_no_brim,
        model="inflow by the pump's voltage, a straight line, and outflow by the root of the level, fitted to the "
        "first 70 %; the rest is held out",
        truth="above 13 cm the level does not rise, whatever the pump gets from 50 to 99 % of its voltage; whether a "
        "brim or the pump does it is not said (read off)",
        right=("flow.overflow", "drive.saturation"),
        tolerated=("data.stuck", "data.gain", "thermal.interaction"),
        verdicts=("unexplained",),
        reading="a row a second, one of five is taken; 1 cm as 1 V",
    ),
)
