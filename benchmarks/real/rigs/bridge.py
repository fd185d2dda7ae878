"""A test bridge of which a support was lowered on purpose, loaded by two jacks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, pair, thinned
from selector.recording import Channel

_STEP_S = 0.01
_MEAN_OF = 100
_SETTLED = {
    "reference": "UniBw_2022-04-11_ref_support_load_01",
    "lowered 1": "UniBw_2022-04-11_support_load_01",
    "lowered 2": "UniBw_2022-04-11_support_load_02",
    "lowered 3": "UniBw_2022-04-11_support_load_03",
}
_CHANNELS = (
    Channel("F1", "force", "N", place="jack 1"),
    Channel("F2", "force", "N", place="jack 2"),
    Channel("strain", "displacement", "um", place="strain gauge CN, um over 1 m"),
)


def _read(strain: Path, force: Path) -> pd.DataFrame:
    parts = [pd.read_csv(path, encoding="latin-1") for path in (strain, force)]
    n = min(len(part) for part in parts)
    columns = {"strain": parts[0].iloc[:n, 1], "F1": 1e3 * parts[1].iloc[:n, 1], "F2": 1e3 * parts[1].iloc[:n, 2]}
    frame = pd.DataFrame(columns).set_axis(pd.Index(_STEP_S * np.arange(n), name="time_s"))
    return thinned(frame, _MEAN_OF)


def _lowered(folder: Path) -> Pair:
    place = folder / "Settlements"
    runs = {
        run: _read(place / f"{name}DMS_CNAt100Hz.csv.zip", place / f"{name}ForceAt100Hz.csv.zip")
        for run, name in _SETTLED.items()
    }
    level = float(runs["reference"]["strain"].mean())
    for frame in runs.values():
        frame["strain" + SIMULATED] = np.full(len(frame), level)
    return pair(runs, _CHANNELS)


CASES = (
    RealCase(
        name="bridge/lowered",
        kind="positive",
        build=_lowered,
        model="the strain of the reference run: the same load, the same strain; the last lowering is held out",
        truth="names of the files: support lowered, 'ref' before it; Jaelani et al., Steel Construction 2023, 16, 215. "
        "The sensor is sound: a boundary moved",
        right=("drive.offset_force",),
        verdicts=("unexplained",),
        reading="means of 100 rows (100 Hz); the stamps have day and month exchanged, samples are counted instead",
    ),
)
