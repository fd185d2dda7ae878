"""A circuit board on a shaker: accelerometers on its base and on the board."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, least_squares, pair
from benchmarks.real.rigs.second.common import folded, period_of
from benchmarks.real.rigs.third.common import SILENT
from selector.recording import Channel

_SET = "data/testset-B"
_RUNS = {
    "weak": "amplitude_1/Impact_0.0/vibration_0.6.lvm",
    "shock": "amplitude_3/Impact_0.5/vibration_0.3.lvm",
    "strong": "amplitude_3/Impact_0.0/vibration_0.6.lvm",
    "strongest": "amplitude_3/Impact_0.0/vibration_1.lvm",
}
_STEP_S = 0.000586
_ROWS = 8000
_CHANNELS = (
    Channel("base", "acceleration", "m/s^2", place="base"),
    Channel("board", "acceleration", "m/s^2", place="board"),
)


def _read(path: Path) -> pd.DataFrame:
    lines = path.read_text(encoding="latin-1").split("\n")
    first = next(k for k, line in enumerate(lines) if line.startswith("X_Value")) + 1
    rows = [line.split(",") for line in lines[first:] if line.count(",") >= 6]
    values = np.array([[float(cell) for cell in row[5:7]] for row in rows if row[5].strip() and row[6].strip()])
    columns = {"base": 9.81 * values[:, 0], "board": 9.81 * values[:, 1]}
    return pd.DataFrame(columns, index=pd.Index(_STEP_S * np.arange(len(values)), name="time_s"))


def _rigid(folder: Path) -> Pair:
    runs = {name: _read(folder / _SET / path).iloc[:_ROWS] for name, path in _RUNS.items()}
    known = pd.concat(list(runs.values())[:-1])
    factor, zero = least_squares([known["base"].to_numpy(), 1.0], known["board"].to_numpy())
    for frame in runs.values():
        frame["board" + SIMULATED] = factor * frame["base"] + zero
    return pair(runs, _CHANNELS)


def _again(folder: Path) -> Pair:
    frame = _read(folder / _SET / _RUNS["strong"])
    period_s = period_of(
        frame["base"].rolling(100, center=True, min_periods=1).mean().to_numpy(), frame.index.to_numpy()
    )
    later = folded(frame, ("board",), period_s, 4.0, int(period_s / _STEP_S))
    return pair({"strong": later}, _CHANNELS, "0.3")


CASES = (
    RealCase(
        name="shaken_board/rigid",
        kind="positive",
        build=_rigid,
        model="the board moves as its base times a factor; three records are fitted, the strongest is held out",
        truth="data/testset-B/readme.md: 'A PCB mounted on an electromagnetic shaker'; what is left lies at 595 to 635 "
        "Hz, where the board moves up to 35 times as much as its base (read off)",
        right=("vibration.mode",),
        tolerated=("drive.elasticity", "vibration.back_reaction", "vibration.hardening"),
        reading="0.586 ms a row as the header says; g as m/s^2",
    ),
    RealCase(
        name="shaken_board/again",
        kind="control",
        build=_again,
        model="the mean cycle of the first 4 s of a shaking that repeats; the last 30 % of the 3 s behind are held out",
        truth="the same sine again and again (read off: 5.24 Hz)",
        verdicts=SILENT,
        reading="0.586 ms a row as the header says; g as m/s^2",
    ),
)
