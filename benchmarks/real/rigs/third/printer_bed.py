"""The heated bed of a printer and the board in its tool head, out of the log of its firmware."""

from __future__ import annotations

import re
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, Vector, pair, thinned
from benchmarks.real.rigs.third.common import fitted, lagged, pieces
from selector.recording import Channel

_ROOM_DEGC = 25.0
_HOT, _WARM = "logs/klippy.log", "logs/klippy.log.2024-07-17"
_BED = Channel("bed", "temperature", "degC", place="heated bed")
_HEAT = Channel("heat", "state", "1", place="heater of the bed, share of its power")
_BOARD = Channel("board", "temperature", "degC", place="board in the tool head")
_NOZZLE = Channel("nozzle", "temperature", "degC", place="nozzle")
_NUMBERS = {
    "bed": r"heater_bed: target=\S+ temp=(\S+)",
    "heat": r"heater_bed: target=\S+ temp=\S+ pwm=(\S+)",
    "board": r"EBB_NTC: temp=(\S+)",
    "nozzle": r"extruder: target=\S+ temp=(\S+)",
}


def _read(path: Path) -> pd.DataFrame:
    rows = []
    for line in path.read_text(encoding="latin-1").split("\n"):
        if line.startswith("Stats "):
            found = [re.search(pattern, line) for pattern in _NUMBERS.values()]
            if all(found):
                rows.append([float(line.split()[1].rstrip(":")), *(float(one.group(1)) for one in found if one)])
    values = np.array(rows)
    values = values[np.r_[True, np.diff(values[:, 0]) > 0.0]]
    return pd.DataFrame(values[:, 1:], columns=list(_NUMBERS), index=pd.Index(values[:, 0] - values[0, 0]))


def _runs(folder: Path) -> dict[str, pd.DataFrame]:
    hot = pieces(_read(folder / _HOT), {"hot 1": (0.0, 2400.0), "hot 2": (2400.0, 4010.0)})
    warm = pieces(_read(folder / _WARM), {"warm": (300.0, 3000.0)})
    return {name: thinned(frame, 5) for name, frame in {**hot, **warm}.items()}


def _bed(x: Vector, frame: pd.DataFrame) -> Vector:
    """Kelvin at full power, time constant [s]; around is the first reading of the log."""
    return lagged(
        _ROOM_DEGC + x[0] * frame["heat"].to_numpy(), frame.index.to_numpy(), abs(x[1]), float(frame["bed"].iloc[0])
    )


def _one_lag(folder: Path) -> Pair:
    runs = _runs(folder)
    law = fitted(_bed, list(runs.values())[:2], "bed", [200.0, 600.0])
    for name, frame in runs.items():
        frame["bed" + SIMULATED] = _bed(law, frame)
        runs[name] = frame[["bed", "heat", "bed" + SIMULATED]]
    return pair(runs, (_BED, _HEAT))


def _board(folder: Path, *, known: tuple[str, ...]) -> Pair:
    runs = _runs(folder)
    for name, frame in runs.items():
        frame["board" + SIMULATED] = np.full(len(frame), frame["board"].iloc[0])
        runs[name] = frame[["board", *known, "board" + SIMULATED]]
    return pair(runs, (_BOARD, *(one for one in (_BED, _NOZZLE) if one.name in known)))


_READING = "one row a second of the log, means of five; two heatings to 110 degC, and one to 60 degC"

CASES = (
    RealCase(
        name="printer_bed/one lag",
        kind="positive",
        build=_one_lag,
        model="one heat capacity with one loss on the power of the heater, fitted to two heatings to 110 degC; a print "
        "at 60 degC is held out",
        truth="the bed warms quickly at first and slowly behind: plate, frame and air warm later (read off)",
        right=("thermal.memory", "thermal.convection"),
        tolerated=("gauging.lag", "thermal.ambient", "drive.delay", "thermal.second_source"),
        reading=_READING,
    ),
    RealCase(
        name="printer_bed/board",
        kind="positive",
        build=partial(_board, known=("bed", "nozzle")),
        model="the board stays as warm as it was at the start; a print at 60 degC is held out",
        truth="it warms by 35 K over the bed at 110 degC and by 12 K over the bed at 60 degC (read off)",
        right=("thermal.second_source",),
        tolerated=("thermal.memory", "thermal.ambient"),
        reading=_READING,
    ),
)
