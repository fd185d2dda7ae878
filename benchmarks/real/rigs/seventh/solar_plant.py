"""A solar plant on a roof in January: a module, the air, the sun, and an inverter that works by day."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, Vector, pair
from benchmarks.real.rigs.fifth.common import first_share, over, simulated
from selector.recording import Channel

_STEP_S = 900.0
_MODULE = (
    Channel("T", "temperature", "degC", place="module"),
    Channel("outdoors", "ambient", "degC", place="air outdoors"),
    Channel("sun", "state", "1", place="sunshine on the module, 1 kW/m2 as 1"),
)
_INVERTER = Channel("T", "temperature", "degC", place="inverter")
_POWER = Channel("power", "state", "1", place="inverter, 100 kW as 1")
_FEEDS = Channel("feeds", "state", "1", place="inverter, whether it feeds")


def _read(folder: Path) -> pd.DataFrame:
    raw = pd.read_csv(folder / "pvanalytics/data/nrel_RSF_II.csv", index_col=0)
    power = 1e-5 * raw["inv2_ac_power_w__1047"]
    columns = {
        "module": raw["module_temp__1056"], "outdoors": raw["ambient_temp__1053"], "inverter": raw["inv2_temp__1050"],
        "sun": 1e-3 * raw["poa_irradiance__1055"], "power": power, "feeds": (power > 1e-3).astype(float),
    }  # fmt: skip
    return over(pd.DataFrame(columns).reset_index(drop=True), _STEP_S)


def _shade(folder: Path) -> Pair:
    run = _read(folder)[["module", "outdoors", "sun"]].rename(columns={"module": "T"})
    law = simulated({"fitted": first_share(run).copy()}, "T", _by_air, [-5.0, 1.0], 1)
    run["T" + SIMULATED] = _by_air(law, run)
    return pair({"five days": run}, _MODULE)


def _by_air(x: Vector, run: pd.DataFrame) -> Vector:
    return np.asarray(x[0] + x[1] * run["outdoors"])


def _by_feeding(x: Vector, run: pd.DataFrame) -> Vector:
    return np.asarray(x[0] + x[1] * run["feeds"])


def _inverter(folder: Path, *, heated: bool) -> Pair:
    run = _read(folder)[["inverter", "feeds" if heated else "power"]].rename(columns={"inverter": "T"})
    known = first_share(run)
    if heated:
        law = simulated({"fitted": known.copy()}, "T", _by_feeding, [20.0, 30.0], 1)
        run["T" + SIMULATED] = _by_feeding(law, run)
    else:
        run["T" + SIMULATED] = np.full(len(run), known["T"].mean())
    return pair({"five days": run}, (_INVERTER, _FEEDS if heated else _POWER))


_READING = "15 min a row, five days; the last 30 % are held out"

CASES = (
    RealCase(
        name="solar_plant/in the shade",
        kind="positive",
        build=_shade,
        model="a module as warm as the air, a straight line, fitted to the first 70 %, with the sunshine at hand",
        truth="the sun heats it by up to 30 K above the air (every model of a module's temperature)",
        right=("thermal.second_source",),
        tolerated=("thermal.coolant", "thermal.convection", "thermal.memory", "thermal.ambient"),
        reading=_READING,
    ),
    RealCase(
        name="solar_plant/idle inverter",
        kind="positive",
        build=partial(_inverter, heated=False),
        model="an inverter that keeps its mean of the first 70 %, with its power at hand",
        truth="its work heats it by 40 K, and it cools for hours (read off)",
        right=("thermal.second_source",),
        tolerated=("thermal.coolant", "thermal.convection", "thermal.memory"),
        reading=_READING,
    ),
    RealCase(
        name="solar_plant/inverter at once",
        kind="positive",
        build=partial(_inverter, heated=True),
        model="the inverter warm while it feeds and cold else, at once, fitted to the first 70 %",
        truth="it follows with a time constant of about an hour (read off)",
        right=("thermal.memory",),
        tolerated=("thermal.second_source", "thermal.coolant", "thermal.convection", "gauging.lag", "data.clock",
                   "drive.delay"),
        reading=_READING,
    ),
)  # fmt: skip
