"""A buck converter: voltage that sets its duty cycle, and voltage that comes out, 10 ms at 10 us a row, twice."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import Pair, RealCase, Vector, pair
from benchmarks.real.rigs.fifth.common import over, simulated
from selector.recording import Channel

_CHANNELS = (Channel("u", "voltage", "V", place="set value"), Channel("y", "voltage", "V", place="outlet"))


def _line(x: Vector, run: pd.DataFrame) -> Vector:
    return np.asarray(x[0] + x[1] * run["u"])


def _at_once(folder: Path) -> Pair:
    runs = {}
    for name in ("id", "valid"):
        raw = pd.read_csv(folder / f"datasets/buck/buck_{name}.csv")
        runs[name] = over(raw[["input", "y"]].set_axis(["u", "y"], axis=1), 1e-5)
    simulated(runs, "y", _line, [30.0, -7.0])
    return pair(runs, _CHANNELS)


CASES = (
    RealCase(
        name="buck_converter/at once",
        kind="positive",
        build=_at_once,
        model="voltage by the set value, a straight line at once, fitted to one record; another is held out",
        truth="coil and capacitor: it follows within 0.2 ms and overshoots (read off)",
        right=("gauging.lag", "drive.delay", "data.clock", "vibration.mode"),
        tolerated=("drive.mass",),
        verdicts=("miscalibrated", "unexplained"),
        reading="10 us a row",
    ),
)
