"""A telephone that loads and computes: its power, the warmth of its battery, and of the cores of its processor."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, Vector, pair
from benchmarks.real.rigs.fifth.common import simulated
from benchmarks.real.rigs.fourth.common import SILENT, evenly
from selector.recording import Channel

_STEP_S = 2.0
_LOADS = {
    "three threads": "2_3thread_100Mbps~1.5Gbps", "four threads": "2_4thread_100Mbps~1.9Gbps",
    "five threads": "2_5thread_100Mbps~1.8Gbps", "six threads": "2_6thread_100Mbps~1.8Gbps",
}  # fmt: skip
_COLUMNS, _VOLTAGE, _CURRENT = 83, 23, 24
_T = Channel("T", "temperature", "degC", place="battery")
_POWER = Channel("power", "state", "1", place="battery, 10 W as 1")
_CORE = Channel("core", "temperature", "degC", place="a core of the processor")


def _read(folder: Path, load: str) -> pd.DataFrame:
    """Whole rows of the log, evened; voltage in uV and current in uA."""
    text = (folder / f"Ann_Arbor_experiment/experiment1/5g_data_{_LOADS[load]}.txt").read_text()
    rows = [line.rstrip(",").split(",") for line in text.splitlines()]
    raw = np.array([row for row in rows if len(row) == _COLUMNS], dtype=np.float64)
    power = -1e-13 * raw[:, _VOLTAGE] * raw[:, _CURRENT]
    cores = {f"core {k}": raw[:, k] for k in (12, 13, 14, 15, 17, 19)}
    return evenly(1e-3 * (raw[:, 0] - raw[0, 0]), _STEP_S, T=raw[:, 1], power=power, **cores)


def _line(x: Vector, run: pd.DataFrame) -> Vector:
    return np.asarray(x[0] + x[1] * run["power"])


def _battery(folder: Path, *, heated: bool) -> Pair:
    runs = {load: _read(folder, load)[["T", "power"]] for load in _LOADS}
    if heated:
        simulated(runs, "T", _line, [30.0, 10.0])
    else:
        for run in runs.values():
            run["T" + SIMULATED] = np.full(len(run), run["T"].iloc[0])
    return pair(runs, (_T, _POWER))


def _core(folder: Path, one: int, other: int) -> Pair:
    runs = {}
    for load in _LOADS:
        whole = _read(folder, load)
        runs[load] = whole[[f"core {one}", f"core {other}"]].set_axis(["core", "other"], axis=1)
    simulated(runs, "core", lambda x, run: np.asarray(x[0] + x[1] * run["other"]), [0.0, 1.0])
    return pair({load: run.drop(columns="other") for load, run in runs.items()}, (_CORE,))


_READING = "about a reading a second, evened to 2 s"
_CORES = "a reading a second, evened to 2 s; steps of 0.3 K"

CASES = (
    RealCase(
        name="hot_phone/cold",
        kind="positive",
        build=partial(_battery, heated=False),
        model="a battery that stays as warm as it was when a run began, in four runs; the last is held out",
        truth="7 W of power warm it by 17 K in 8 minutes (the authors' thermal model has power as its input)",
        right=("thermal.second_source",),
        tolerated=("thermal.memory", "thermal.coolant", "thermal.convection", "data.drift"),
        reading=_READING,
    ),
    RealCase(
        name="hot_phone/at once",
        kind="positive",
        build=partial(_battery, heated=True),
        model="the battery's warmth by the power, a straight line at once, fitted to three runs; the last is held out",
        truth="it follows with a time constant of some 400 s (read off)",
        right=("thermal.memory",),
        tolerated=(
            "thermal.second_source",
            "thermal.convection",
            "gauging.lag",
            "data.clock",
            "drive.delay",
            "data.drift",
        ),
        reading=_READING,
    ),
    RealCase(
        name="hot_phone/big core",
        kind="control",
        build=partial(_core, one=14, other=15),
        model="a core by its neighbour, with a gain and an offset fitted to three runs; the last is held out",
        truth="nothing is missing: 0.3 K are left, white, of readings with steps of 0.3 K",
        verdicts=SILENT,
        reading=_CORES,
    ),
    RealCase(
        name="hot_phone/middle core",
        kind="control",
        build=partial(_core, one=12, other=13),
        model="another core by its neighbour, with a gain and an offset fitted to three runs; the last is held out",
        truth="nothing is missing: 0.3 K are left, white, of readings with steps of 0.3 K",
        verdicts=SILENT,
        reading=_CORES,
    ),
    RealCase(
        name="hot_phone/small core",
        kind="control",
        build=partial(_core, one=17, other=19),
        model="a third core by its neighbour, with a gain and an offset fitted to three runs; the last is held out",
        truth="nothing is missing: 0.2 K are left, white, of readings with steps of 0.3 K",
        verdicts=SILENT,
        reading=_CORES,
    ),
)  # fmt: skip
