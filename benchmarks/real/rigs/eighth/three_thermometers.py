"""Three thermometers of different make beside an optical bench, over an afternoon and a night."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, Vector, pair, thinned
from benchmarks.real.rigs.fifth.common import first_share, over, simulated
from selector.recording import Channel

_STEP_S, _MEANS = 1.0341, 30
_CHANNELS = (
    Channel("T", "temperature", "degC", place="MCP9808, on its board"),
    Channel("air", "temperature", "degC", place="SHT45"),
)


def _line(x: Vector, run: pd.DataFrame) -> Vector:
    return np.asarray(x[0] + x[1] * run["air"])


def _at_once(folder: Path) -> Pair:
    raw = pd.read_csv(folder / "temperature/temperature_log2.csv")
    names = {"MCP_Temperature_C": "T", "SHT_Temperature_C": "air"}
    run = thinned(over(raw[list(names)].rename(columns=names), _STEP_S), _MEANS)
    law = simulated({"fitted": first_share(run).copy()}, "T", _line, [8.6, 0.6], 1)
    run["T" + SIMULATED] = _line(law, run)
    return pair({"night": run}, _CHANNELS)


CASES = (
    RealCase(
        name="three_thermometers/at once",
        kind="positive",
        build=_at_once,
        model="one thermometer by another, a straight line, fitted to the first 70 % of 18 h; the rest is held "
        "out",
        truth="it sits on its board and follows the other with a time constant of some 20 min (read off)",
        right=("thermal.memory",),
        tolerated=("gauging.lag", "data.clock", "drive.delay", "thermal.convection", "thermal.second_source",
                   "thermal.ambient"),
        reading="a row a second (1.034 s, one gap of 134 s), means over thirty; steps of 0.0625 K",
    ),
)  # fmt: skip
