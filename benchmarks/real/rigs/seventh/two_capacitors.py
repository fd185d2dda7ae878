"""A circuit of two resistors and two capacitors that settles after a step of its input."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, Vector, pair
from benchmarks.real.rigs.fifth.common import first_share, over, simulated
from benchmarks.real.rigs.fourth.common import SILENT
from benchmarks.real.rigs.seventh.lab_motor import rows_of
from selector.recording import Channel

_Y = Channel("y", "voltage", "V", place="output, 10 % of its range as 1 V")


def _settling(x: Vector, run: pd.DataFrame) -> Vector:
    times = run.index.to_numpy()
    return np.asarray(x[0] + x[1] * np.exp(-times / abs(x[2])) + x[3] * np.exp(-times / abs(x[4])))


def _two(folder: Path) -> Pair:
    raw = rows_of(folder / "labo3/src/data/5-2-linearisation.txt")
    run = over(pd.DataFrame({"y": 0.1 * raw[:, 3]}), 1.0)
    law = simulated({"fitted": first_share(run).copy()}, "y", _settling, [4.9, -0.83, 12.6, -0.59, 9.9], 1)
    run["y" + SIMULATED] = _settling(law, run)
    return pair({"step": run}, (_Y,))


CASES = (
    RealCase(
        name="two_capacitors/settling",
        kind="control",
        build=_two,
        model="two exponentials, fitted to the first 70 %; the rest is held out",
        truth="nothing is missing: what is left is less than a step of the display, 0.01 %",
        verdicts=SILENT,
        reading="a row a second; steps of 0.001 V",
    ),
)
