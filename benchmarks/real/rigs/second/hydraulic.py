"""A hydraulic test rig whose oil cooler is switched between three states."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, least_squares, pair
from benchmarks.real.rigs.second.common import SILENT
from selector.recording import Channel

_CYCLE_S = 60.0
_MEAN_OF = 10
_AROUND = {"3 to 20 %": (631, 932), "20 to 100 %": (1363, 1664)}
_BEFORE = 100
_STEADY = (1700, 2204)
_CHANNELS = (
    Channel("cooler", "state", "1", place="cooler of the oil, share of its efficiency"),
    Channel("T1", "temperature", "degC", place="oil, first thermometer"),
)
_PAIR = (
    Channel("T1", "temperature", "degC", place="oil, first thermometer"),
    Channel("T2", "temperature", "degC", place="oil, second thermometer"),
)


def _table(folder: Path, number: int, part: tuple[int, int], mean_of: int) -> tuple[np.ndarray, np.ndarray]:
    rows = np.loadtxt(folder / f"TS{number}.txt")[slice(*part)]
    means = rows.reshape(-1, mean_of).mean(axis=1)
    return (np.arange(len(means)) + 0.5) * mean_of, means


def _cooled(folder: Path, *, told: bool) -> Pair:
    profile = np.loadtxt(folder / "profile.txt")[:, 0] / 100.0
    runs = {}
    for name, part in _AROUND.items():
        time_s, oil = _table(folder, 1, part, _MEAN_OF)
        state = np.repeat(profile[slice(*part)], int(_CYCLE_S) // _MEAN_OF)
        level = oil[: _BEFORE * int(_CYCLE_S) // _MEAN_OF].mean()
        columns = {"cooler": state, "T1": oil, "T1" + SIMULATED: np.full(len(oil), level)}
        runs[name] = pd.DataFrame(columns, index=pd.Index(time_s - time_s[0], name="time_s"))
    return pair(runs, _CHANNELS if told else _CHANNELS[1:])


def _steady(folder: Path) -> Pair:
    time_s, first = _table(folder, 1, _STEADY, int(_CYCLE_S))
    second = _table(folder, 2, _STEADY, int(_CYCLE_S))[1]
    known = slice(0, int(0.7 * len(first)))
    slope, level = least_squares([first[known], 1.0], second[known])
    columns = {"T1": first, "T2": second, "T2" + SIMULATED: slope * first + level}
    return pair({"full efficiency": pd.DataFrame(columns, index=pd.Index(time_s - time_s[0], name="time_s"))}, _PAIR)


_TRUTH = "README.md: 'Cooler condition: 3 close to total failure, 20 reduced efficiency, 100 full efficiency'; "
_MODEL = "the oil stays as warm as in the 100 cycles before the switch; the second switch is held out"

CASES = (
    RealCase(
        name="hydraulic/cooler",
        kind="positive",
        build=partial(_cooled, told=True),
        model=_MODEL,
        truth=_TRUTH + "profile.txt switches at cycles 732 and 1464, and the oil falls by 9 K each time",
        right=("thermal.coolant",),
        tolerated=("thermal.memory", "thermal.convection", "thermal.second_source"),
        verdicts=(),
        reading="means of 10 s",
    ),
    RealCase(
        name="hydraulic/cooler not told",
        kind="positive",
        build=partial(_cooled, told=False),
        model=_MODEL + "; nothing that is recorded tells of the cooler",
        truth=_TRUTH + "here that channel is left out",
        right=("thermal.coolant", "thermal.second_source"),
        tolerated=("thermal.memory", "data.step"),
        verdicts=("unexplained",),
        reading="means of 10 s",
    ),
    RealCase(
        name="hydraulic/steady",
        kind="control",
        build=_steady,
        model="one thermometer by another, a + b x, fitted to the first 70 % of 8 h with the cooler at full efficiency",
        truth=_TRUTH + "0.09 K are left where it was fitted and 0.09 K later, means of a cycle less (read off)",
        tolerated=("thermal.memory",),
        verdicts=SILENT,
        reading="means of a cycle of 60 s",
    ),
)
