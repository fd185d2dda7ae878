"""Eight loggers of the same kind in one bath, each with a clock of its own."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import Pair, RealCase, pair, table
from selector.recording import Channel

_START = pd.Timestamp("2023-03-02T15:48:30Z")
_END = pd.Timestamp("2023-03-02T16:24:00Z")
_SOUND = ("KS", "DKB", "LG")
"""Loggers that the simulation is the mean of, with the clocks as their owner corrected them."""
_CHANNELS = (Channel("T", "temperature", "degC", place="logger in the bath"),)


def _adjusted(folder: Path, name: str) -> tuple[np.ndarray, np.ndarray]:
    raw = _rows(folder / "data" / "adjusted" / f"time_TSENSOR_{name}.LOG")
    return _stamped(raw)


def _raw(folder: Path, name: str) -> tuple[np.ndarray, np.ndarray]:
    return _stamped(_rows(folder / "data" / f"TSENSOR_{name}.LOG"))


def _rows(path: Path) -> pd.DataFrame:
    lines = [line.split(",") for line in path.read_text(encoding="latin-1").splitlines() if line[:1] == "2"]
    return pd.DataFrame([line[:4] for line in lines if len(line) >= 4], columns=["stamp", "millis", "id", "value"])


def _stamped(raw: pd.DataFrame) -> tuple[np.ndarray, np.ndarray]:
    """Seconds from the common start: running milliseconds, set once by the stamps."""
    stamp_s = (pd.to_datetime(raw["stamp"].str.strip(), utc=True, format="ISO8601") - _START).dt.total_seconds()
    run_s = 1e-3 * pd.to_numeric(raw["millis"])
    values = pd.to_numeric(raw["value"]).to_numpy(dtype=np.float64)
    time_s = (run_s + float(np.median(stamp_s - run_s))).to_numpy(dtype=np.float64)
    kept = np.r_[True, np.diff(time_s) > 0.0]
    return time_s[kept], values[kept]


def _beside_mean(folder: Path, *, name: str, corrected: bool) -> Pair:
    time_s, values = (_adjusted if corrected else _raw)(folder, name)
    kept = (time_s >= 0.0) & (time_s <= (_END - _START).total_seconds())
    time_s, values = time_s[kept], values[kept]
    mean = np.mean([np.interp(time_s, *_adjusted(folder, other)) for other in _SOUND if other != name], axis=0)
    if corrected:
        mean = mean + float(np.mean((values - mean)[: int(0.7 * len(mean))]))
    return pair({"bath": table(time_s, T=values, T_simulated=mean)}, _CHANNELS)


def _clock(name: str, shift_s: int) -> RealCase:
    return RealCase(
        name=f"bath/{name}",
        kind="positive",
        build=partial(_beside_mean, name=name, corrected=False),
        model="the mean of three loggers whose clocks were corrected; the last 30 % are held out",
        truth=f"README.md: 'DS18B20 data with synchronized time axis'; data/adjusted shifts this one by {shift_s} s",
        right=("data.clock",),
        tolerated=("data.zero", "data.gain", "gauging.lag"),
        verdicts=("miscalibrated",),
        reading="raw clock: stamps of whole seconds set the running milliseconds; 1.15 s, 35 min with the plunge",
    )


CASES = (
    _clock("DF", 6),
    _clock("QR", 7),
    RealCase(
        name="bath/KM",
        kind="control",
        build=partial(_beside_mean, name="KM", corrected=True),
        model="the mean of three corrected loggers and the mean difference of the first 70 %; the rest is held out",
        truth="the same bath, and the clock as data/adjusted has it; sensors of one kind differ by their time "
        "constants (analysis/Time-Constant.py)",
        tolerated=("gauging.lag", "thermal.memory"),
        verdicts=("nothing-missing", "miscalibrated"),
        reading="as the others, with the corrected clock",
    ),
)
