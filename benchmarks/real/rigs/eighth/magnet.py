"""A magnet that a coil holds in the air: the voltage of its distance sensor."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, pair
from benchmarks.real.rigs.fifth.common import over
from benchmarks.real.rigs.fourth.common import SILENT, numbers
from selector.recording import Channel

_STEP_S = 0.02
_PARTS = {"first": slice(100, 500), "second": slice(500, 900), "third": slice(900, 1300)}
_Y = Channel("y", "voltage", "V", place="distance of the magnet")


def _held(folder: Path) -> Pair:
    raw = pd.Series(numbers(folder / "data/Proposed_PID.mat")["A"][:, 1], name="y")
    runs = {name: over(raw.iloc[rows].to_frame(), _STEP_S) for name, rows in _PARTS.items()}
    level = float(pd.concat(list(runs.values())[:-1])["y"].mean())
    for run in runs.values():
        run["y" + SIMULATED] = np.full(len(run), level)
    return pair(runs, (_Y,))


CASES = (
    RealCase(
        name="magnet/held",
        kind="control",
        build=_held,
        model="the magnet stands still at the mean of two parts of a record; a third part is held out",
        truth="nothing is missing: white noise of 0.017 V, steps of 0.01 V",
        verdicts=SILENT,
        reading="20 ms a row, of which one in a few is late by 10 ms; taken as even",
    ),
)
