"""A house of the Solar Decathlon, unheated in spring: two rooms, the air outdoors and the sun, every quarter of an "
"hour."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, Vector, pair
from benchmarks.real.rigs.fifth.common import over, simulated
from benchmarks.real.rigs.third.common import pieces
from selector.recording import Channel

_STEP_S = 900.0
_DAY_S = 86400.0
_T = Channel("T", "temperature", "degC", place="dining room")
_AIR = Channel("outdoors", "ambient", "degC", place="air outdoors")
_SUN = Channel("sun", "state", "1", place="sunshine on the roof, 1000 W/m2 as 1")
_COLUMNS = {2: "T", 17: "sun", 21: "outdoors"}


def _read(folder: Path, name: str) -> pd.DataFrame:
    rows = [line.split() for line in (folder / f"data/NEW-DATA-{name}.T15.txt").read_text().splitlines()]
    whole = pd.DataFrame([row for row in rows if row and "/" in row[0]])[list(_COLUMNS)].astype(float)
    found = over(whole.rename(columns=_COLUMNS), _STEP_S)
    return found.assign(sun=found["sun"] / 1000.0)


def _weeks(folder: Path) -> dict[str, pd.DataFrame]:
    spans = {f"week {k + 1}": (7.0 * k * _DAY_S, 7.0 * (k + 1) * _DAY_S) for k in range(4)}
    return pieces(_read(folder, "1"), spans)


def _outdoors(x: Vector, run: pd.DataFrame) -> Vector:
    return np.asarray(x[0] + x[1] * run["outdoors"])


def _rooms(folder: Path, *, weather: bool) -> Pair:
    runs = _weeks(folder)
    if weather:
        simulated(runs, "T", _outdoors, [5.0, 0.8])
        return pair(runs, (_T, _AIR, _SUN))
    level = pd.concat(list(runs.values())[:3])["T"].mean()
    for run in runs.values():
        run["T" + SIMULATED] = np.full(len(run), level)
    return pair({name: run.drop(columns="sun") for name, run in runs.items()}, (_T, _AIR))


_READING = "means of 15 min; weeks are taken for runs"

CASES = (
    RealCase(
        name="two_rooms/no weather",
        kind="positive",
        build=partial(_rooms, weather=False),
        model="the mean of three weeks, with the air outdoors at hand; a fourth week is held out",
        truth="the house follows the weather",
        right=("thermal.ambient",),
        tolerated=("thermal.memory", "thermal.second_source"),
        reading=_READING,
    ),
    RealCase(
        name="two_rooms/at once",
        kind="positive",
        build=partial(_rooms, weather=True),
        model="a straight line of the air outdoors, at once, fitted to three weeks; a fourth week is held out",
        truth="walls and floor follow with five to six hours (read off)",
        right=("thermal.memory",),
        tolerated=(
            "thermal.ambient",
            "thermal.second_source",
            "thermal.convection",
            "data.clock",
            "drive.delay",
            "gauging.lag",
        ),
        reading=_READING,
    ),
)
