"""Fifteen thermometers on a load in an oven that heats to 370 degC in five hours and cools: beside them the oven's."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, Vector, pair
from benchmarks.real.rigs.fifth.common import first_share, over, simulated
from benchmarks.real.rigs.fourth.common import SILENT
from selector.recording import Channel

_STEP_S, _OVEN = 12.0, "Oven_Mon"


def _read(folder: Path) -> pd.DataFrame:
    """All rows but the one whose time stamp lies far before those of its neighbours."""
    raw = pd.read_csv(folder / "ovenData.csv")
    return over(raw[~(np.diff(raw["Time_(s)"], prepend=0.0) < 0.0)].reset_index(drop=True), _STEP_S)


def _columns(folder: Path, of: str, beside: str, name: str) -> pd.DataFrame:
    return _read(folder)[[of, beside]].rename(columns={of: "T", beside: name})


def _channels(of: str, *others: Channel) -> tuple[Channel, ...]:
    return (Channel("T", "temperature", "degC", place=f"load, thermometer {of}"), *others)


def _oven(folder: Path, *, heated: bool) -> Pair:
    run = _columns(folder, "7", _OVEN, "oven")
    known = first_share(run)
    if heated:
        law = simulated({"fitted": known.copy()}, "T", _line, [0.0, 0.8], 1)
        run["T" + SIMULATED] = _line(law, run)
    else:
        run["T" + SIMULATED] = np.full(len(run), known["T"].mean())
    return pair({"bake": run}, _channels("7", Channel("oven", "ambient", "degC", place="air of the oven")))


def _line(x: Vector, run: pd.DataFrame) -> Vector:
    return np.asarray(x[0] + x[1] * run["oven" if "oven" in run else "beside"])


def _neighbours(folder: Path, of: str, beside: str, share: float = 0.7) -> Pair:
    run = _columns(folder, of, beside, "beside")
    law = simulated({"fitted": first_share(run, share).copy()}, "T", _line, [0.0, 1.0], 1)
    run["T" + SIMULATED] = _line(law, run)
    return pair(
        {"bake": run}, _channels(of, Channel("beside", "temperature", "degC", place=f"load, thermometer {beside}"))
    )


_READING = "12 s a row, 10.7 h; a row whose time stamp is wrong is left out; the last 30 % are held out"
_ONE = "fitted to the first 70 %; the rest is held out"

CASES = (
    RealCase(
        name="loaded_oven/at once",
        kind="positive",
        build=partial(_oven, heated=True),
        model=f"the load by the oven's air at once, a straight line, {_ONE}",
        truth="the load follows the air with a time constant of some 40 min (read off)",
        right=("thermal.memory",),
        tolerated=("thermal.ambient", "thermal.second_source", "thermal.convection", "gauging.lag", "data.clock",
                   "drive.delay"),
        reading=_READING,
    ),
    RealCase(
        name="loaded_oven/cold",
        kind="positive",
        build=partial(_oven, heated=False),
        model="the load keeps its mean of the first 70 %, with the air of the oven at hand",
        truth="the air around it warms it, with a time constant of some 40 min (what an oven is for)",
        right=("thermal.ambient",),
        tolerated=("thermal.memory", "thermal.second_source", "thermal.coolant", "thermal.convection"),
        reading=_READING,
    ),
    RealCase(
        name="loaded_oven/come off",
        kind="positive",
        build=partial(_neighbours, of="11", beside="12", share=0.5),
        model="one thermometer by its neighbour, a straight line, fitted to the first half; the last 30 % are held out",
        truth="6.9 h after the start it falls by 8 K within ten minutes and stays below, as one that comes off (read "
        "off)",
        right=("data.step",),
        tolerated=("data.drift", "data.gain", "data.zero", "thermal.interaction", "thermal.memory"),
        verdicts=("unexplained",),
        reading=_READING,
    ),
    RealCase(
        name="loaded_oven/neighbours",
        kind="control",
        build=partial(_neighbours, of="10", beside="8"),
        model=f"one thermometer by its neighbour, a straight line, {_ONE}",
        truth="nothing is missing: 0.3 of 98 K are left",
        verdicts=SILENT,
        reading=_READING,
    ),
    RealCase(
        name="loaded_oven/other neighbours",
        kind="control",
        build=partial(_neighbours, of="14", beside="12"),
        model=f"one thermometer by its neighbour, a straight line, {_ONE}",
        truth="nothing is missing: 0.3 of 98 K are left",
        verdicts=SILENT,
        reading=_READING,
    ),
)  # fmt: skip
