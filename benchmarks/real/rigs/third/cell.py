"""Lithium cells that are discharged at one to four times their rate, and again and again at one rate."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, pair, thinned
from benchmarks.real.rigs.third.common import SILENT
from selector.recording import Channel

_RATES = ("1C", "2C", "3C", "4C")
_T = Channel("T", "temperature", "degC", place="surface of the cell")
_I = Channel("I", "current", "A", place="cell")
_U = Channel("U", "voltage", "V", place="cell")
_AIR = Channel("T_air", "ambient", "degC", place="chamber")


def _discharge(path: Path, mean_of: int) -> pd.DataFrame:
    raw = pd.read_csv(path, header=None, encoding="utf-8-sig").to_numpy(dtype=np.float64)[1:]
    columns = {"I": -raw[:, 1], "T": raw[:, 4], "T_air": raw[:, 6]}
    return thinned(pd.DataFrame(columns, index=pd.Index(raw[:, 0] - raw[0, 0], name="time_s")), mean_of)


def _isothermal(folder: Path) -> Pair:
    runs = {}
    for cell in ("S001", "S003"):
        for rate in _RATES if cell == "S001" else ("1C", "3C", "4C"):
            frame = _discharge(folder / "data" / cell / f"Q30_{cell}_{rate}.csv", 5)
            frame["T" + SIMULATED] = frame["T_air"]
            runs[f"{cell} {rate}"] = frame
    return pair(runs, (_T, _I, _AIR))


def _cycle(folder: Path, number: int) -> pd.DataFrame:
    raw = np.loadtxt(folder / "data/Dataset-2/cell1/discharge" / f"discharge_1_{number}.lvm")[2:]
    columns = {"I": -raw[:, 1], "U": raw[:, 2], "T": raw[:, 3]}
    return pd.DataFrame(columns, index=pd.Index(raw[:, 0] - raw[0, 0], name="time_s"))


def _again(folder: Path, *, name: str, cycles: tuple[int, ...]) -> Pair:
    """Later cycles beside the mean of the first four at the same time since their start."""
    known = [_cycle(folder, number) for number in cycles[:4]]
    runs = {}
    for number in cycles[4:]:
        frame = _cycle(folder, number)
        last_s = min(float(one.index[-1]) for one in (*known, frame))
        frame = frame[frame.index < last_s][["I", name]].copy()
        means = [np.interp(frame.index, one.index, one[name]) for one in known]
        frame[name + SIMULATED] = np.mean(means, axis=0)
        runs[f"cycle {number}"] = thinned(frame, 5)
    return pair(runs, (_I, _U if name == "U" else _T))


CASES = (
    RealCase(
        name="cell/isothermal",
        kind="positive",
        build=_isothermal,
        model="the cell is as warm as the chamber; two cells at one to four times their rate, the last with four times "
        "is held out",
        truth="README.md: 'The monitored data includes current, voltage, temperature'; it warms by 11 K at 1C and 40 K "
        "at 4C (read off)",
        right=("thermal.second_source",),
        tolerated=("thermal.memory", "thermal.interaction", "thermal.speed_heating", "thermal.ambient"),
        reading="means of five rows (5 s); the columns are those that data/HPPC test data 20C/README.md names",
    ),
    RealCase(
        name="cycled_cell/voltage again",
        kind="control",
        build=partial(_again, name="U", cycles=(60, 61, 62, 63, 64, 65, 66)),
        model="the mean voltage of four cycles; the next three are compared, the last is held out",
        truth="the same discharge at 3 A again and again (read off)",
        verdicts=SILENT,
        reading="means of five rows (5 s), up to where the shortest ends",
    ),
    RealCase(
        name="cycled_cell/temperature again",
        kind="control",
        build=partial(_again, name="T", cycles=(60, 61, 62, 63, 64, 65, 66)),
        model="the mean temperature of four cycles; the next three are compared, the last is held out",
        truth="the same discharge at 3 A again and again (read off)",
        verdicts=SILENT,
        reading="means of five rows (5 s), up to where the shortest ends",
    ),
)
