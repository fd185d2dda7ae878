"""A coffee roaster: beans and the air of its drum from charge to drop, and the set levels of burner and fan."""

from __future__ import annotations

import ast
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, Vector, pair
from benchmarks.real.rigs.fifth.common import over, simulated
from selector.recording import Channel

_STEP_S = 3.0
_ROASTS = (
    "25-10-11_1319", "25-10-11_1333", "25-10-11_1352", "26-01-11_1347", "26-04-19_1218",
    "26-05-10_1438_R58_brazil_250", "26-05-17_1252_R60_sumava_cos", "26-07-19_R65_sumava_cos",
)  # fmt: skip
_BEANS = Channel("T", "temperature", "degC", place="beans")
_DRUM = Channel("drum", "temperature", "degC", place="air of the drum")
_SETTINGS = (Channel("burner", "state", "1", place="burner, share of its power"),
             Channel("fan", "state", "1", place="fan, share of its speed"))  # fmt: skip


def _read(folder: Path, name: str) -> pd.DataFrame:
    log = ast.literal_eval((folder / f"logs/roast_{name}.alog").read_text(encoding="utf-8"))
    times = np.array(log["timex"])
    grid = np.arange(times[log["timeindex"][0]], times[log["timeindex"][6]], _STEP_S)
    columns = {"T": np.interp(grid, times, log["temp2"]), "drum": np.interp(grid, times, log["temp1"])}
    for kind, channel in ((3, "burner"), (0, "fan")):
        columns[channel] = _level(log, kind, times, grid)
    return over(pd.DataFrame(columns), _STEP_S)


def _level(log: dict[str, list[float]], kind: int, times: Vector, grid: Vector) -> Vector:
    """The level that was set last, of those of one kind; level 1 is none, a level more is a tenth."""
    rows = zip(log["specialevents"], log["specialeventstype"], log["specialeventsvalue"], strict=True)
    events = sorted((times[int(k)], max(value - 1.0, 0.0) / 10.0) for k, of, value in rows if of == kind)
    at = np.searchsorted([time for time, _ in events], grid, side="right") - 1
    return np.array([level for _, level in events])[np.maximum(at, 0)]


def _at_once(folder: Path) -> Pair:
    runs = {name[:13]: _read(folder, name) for name in _ROASTS}
    simulated(runs, "T", lambda x, run: np.asarray(x[0] + x[1] * run["drum"]), [-20.0, 1.0])
    return pair(runs, (_BEANS, _DRUM, *_SETTINGS))


def _unheated(folder: Path) -> Pair:
    runs = {name[:13]: _read(folder, name).drop(columns="T") for name in _ROASTS}
    level = float(pd.concat(list(runs.values())[:-1])["drum"].mean())
    for run in runs.values():
        run["drum" + SIMULATED] = np.full(len(run), level)
    return pair(runs, (_DRUM, *_SETTINGS))


_READING = "1.5 to 2 s a row, evened to 3 s, from charge to drop; steps of 0.25 K (drum) and 0.1 K (beans)"

CASES = (
    RealCase(
        name="roaster/at once",
        kind="positive",
        build=_at_once,
        model="the beans by the air of the drum, a straight line at once, fitted to seven roasts; an eighth is held "
        "out",
        truth="beans and their thermometer follow the air with a time constant of 40 to 60 s (read off)",
        right=("thermal.memory",),
        tolerated=("gauging.lag", "data.clock", "drive.delay", "thermal.second_source", "thermal.convection",
                   "thermal.coolant"),
        reading=_READING,
    ),
    RealCase(
        name="roaster/unheated",
        kind="positive",
        build=_unheated,
        model="the air of the drum keeps the mean of seven roasts, with the levels of burner and fan at hand; an "
        "eighth roast is held out",
        truth="the burner heats it, behind some 400 s (the author logs what he sets)",
        right=("thermal.second_source",),
        tolerated=("thermal.coolant", "thermal.convection", "thermal.memory", "data.drift"),
        reading=_READING,
    ),
)  # fmt: skip
