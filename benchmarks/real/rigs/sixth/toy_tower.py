"""A model of a skyscraper with an accelerometer, pushed once: bare, and with a pendulum as a tuned damper."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, Vector, pair
from benchmarks.real.rigs.fifth.common import first_share, simulated
from benchmarks.real.rigs.fourth.common import SILENT, evenly
from selector.recording import Channel

_STEP_S = 0.05
_TOP = Channel("a", "acceleration", "m/s^2", place="top", axis="X")


def _read(folder: Path, column: int) -> pd.DataFrame:
    """From the largest acceleration on."""
    raw = pd.read_csv(folder / "CSV files/with_tmd.csv", encoding="utf-8-sig").iloc[:, [column, column + 1]].dropna()
    run = evenly(*raw.to_numpy(dtype=np.float64).T[:1], _STEP_S, a=raw.to_numpy(dtype=np.float64)[:, 1])
    run = run.iloc[int(run["a"].abs().to_numpy().argmax()) :]
    return run.set_axis(run.index - run.index[0])


def _swing(x: Vector, run: pd.DataFrame) -> Vector:
    times = run.index.to_numpy()
    return np.asarray(np.exp(-abs(x[0]) * times) * (x[2] * np.cos(x[1] * times) + x[3] * np.sin(x[1] * times)) + x[4])


def _one_swing(folder: Path, column: int) -> Pair:
    run = _read(folder, column)
    law = simulated({"fitted": first_share(run).copy()}, "a", _swing, [0.55, 19.5, -0.9, 0.3, 0.0], 1)
    run["a" + SIMULATED] = _swing(law, run)
    return pair({"push": run}, (_TOP,))


_MODEL = "one swing that dies away, fitted to the first 70 %; the rest is held out"
_TRUTH = "nothing is missing: what is left, a sixth, is white"
_READING = "about 50 ms a row, evened, from the largest acceleration on"

CASES = (
    RealCase(
        name="toy_tower/bare",
        kind="control",
        build=partial(_one_swing, column=4),
        model=_MODEL,
        truth=_TRUTH,
        verdicts=SILENT,
        reading=_READING,
    ),
    RealCase(
        name="toy_tower/with its damper",
        kind="control",
        build=partial(_one_swing, column=0),
        model=_MODEL,
        truth=_TRUTH,
        verdicts=SILENT,
        reading=_READING,
    ),
)
