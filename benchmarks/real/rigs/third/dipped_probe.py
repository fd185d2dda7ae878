"""A resistance thermometer that is moved from cold water to hot and back."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, Vector, pair, table, thinned
from benchmarks.real.rigs.third.common import lagged
from selector.recording import Channel

_BATHS = ((20.5, 56.0), (55.5, 21.0), (21.0, 76.0), (76.0, 22.0), (21.5, 68.0), (68.0, 22.0))
_FIRST = 7
_CHANNELS = (Channel("T", "temperature", "degC", place="thermometer in the water"),)


def _read(folder: Path, number: int) -> tuple[pd.DataFrame, float]:
    """Temperature by the two known baths, and the moment [s] at which a tenth of the step is passed."""
    volts = np.loadtxt(folder / "lab05" / f"lab05log{number}.txt")[:, 2]
    cold, hot = _BATHS[number - _FIRST]
    begins, ends = volts[:100].mean(), volts[-100:].mean()
    frame = thinned(table(0.01 * np.arange(len(volts)), T=cold + (hot - cold) * (volts - begins) / (ends - begins)), 5)
    share = (frame["T"].to_numpy() - cold) / (hot - cold)
    return frame, float(frame.index[np.flatnonzero(share < 0.05)[-1]])


def _runs(folder: Path) -> dict[str, tuple[pd.DataFrame, float]]:
    numbers = range(_FIRST, _FIRST + len(_BATHS))
    return {f"log {number}": _read(folder, number) for number in numbers}


def _bath(frame: pd.DataFrame, moment_s: float, number: int) -> Vector:
    cold, hot = _BATHS[number]
    return np.where(frame.index.to_numpy() < moment_s, cold, hot)


def _at_once(folder: Path) -> Pair:
    runs = {}
    for number, (name, (frame, moment_s)) in enumerate(_runs(folder).items()):
        frame["T" + SIMULATED] = _bath(frame, moment_s, number)
        runs[name] = frame
    return pair(runs, _CHANNELS)


def _lag(folder: Path, *, tau_s: float) -> Pair:
    runs = {}
    for number, (name, (frame, moment_s)) in enumerate(_runs(folder).items()):
        frame["T" + SIMULATED] = lagged(_bath(frame, moment_s, number), frame.index.to_numpy(), tau_s)
        runs[name] = frame
    return pair(runs, _CHANNELS)


_README = "lab05/README.md: 'First Order System Identification Applied To Temperature Measurement System'"
_READING = "means of five rows (50 ms); volts to degrees by the two baths, of which the README gives the temperatures"

CASES = (
    RealCase(
        name="dipped_probe/at once",
        kind="positive",
        build=_at_once,
        model="the water's temperature from the moment at which the reading leaves its first level; six moves, the "
        "last is held out",
        truth=_README + "; it takes 2.5 s for two thirds of the step (read off)",
        right=("gauging.lag",),
        tolerated=("thermal.memory", "data.clock", "drive.delay"),
        reading=_READING,
    ),
    RealCase(
        name="dipped_probe/slow probe",
        kind="positive",
        build=partial(_lag, tau_s=6.0),
        model="the same with a lag of 6 s, as for a probe in air; the last move is held out",
        truth="two thirds of the step are there after 2.5 s (read off)",
        right=("gauging.lag", "thermal.memory", "data.clock"),
        tolerated=("drive.delay", "data.gain"),
        verdicts=("miscalibrated",),
        reading=_READING,
    ),
)
