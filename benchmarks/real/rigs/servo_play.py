"""A small servo that holds its place while it is pulled to both sides."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from scipy.signal import lfilter

from benchmarks.real.case import SIMULATED, Pair, RealCase, Vector, pair
from selector.recording import Channel

_FILE = "logs/motor_telemetry_single.csv"
_RAD_PER_COUNT = 2.0 * np.pi / 4096
_RELAXED = {3: 1748, 4: 2347}
_FIT = 0.7
_CHANNELS = (
    Channel("target", "position_command", "m", place="servo 5, angle as travel at a lever of 1 m", axis="5"),
    Channel("pull_up", "state", "1", place="servo 3, stretched or not"),
    Channel("pull_down", "state", "1", place="servo 4, stretched or not"),
    Channel("angle", "position", "m", place="servo 5, at the same lever", axis="5"),
)


def _held(folder: Path) -> Pair:
    raw = pd.read_csv(folder / _FILE).dropna(subset=["pos (5)"])
    stamp = pd.to_datetime(raw["timestamp"])
    middle = 2047
    frame = pd.DataFrame({
        "target": _RAD_PER_COUNT * (raw["target pos (5)"] - middle),
        "pull_up": (np.abs(raw["pos (3)"] - _RELAXED[3]) > 10).astype(np.float64),
        "pull_down": (np.abs(raw["pos (4)"] - _RELAXED[4]) > 10).astype(np.float64),
        "angle": _RAD_PER_COUNT * (raw["pos (5)"] - middle),
    }).set_axis(pd.Index((stamp - stamp.iloc[0]).dt.total_seconds(), name="time_s"))  # fmt: skip
    angle, n = frame["angle"].to_numpy(), int(_FIT * len(frame))
    lags = [_lagged(frame["target"].to_numpy(), angle[0], pole) for pole in np.linspace(0.0, 0.95, 39)]
    frame["angle" + SIMULATED] = min(lags, key=lambda lag: float(np.sum((lag - angle)[:n] ** 2)))
    return pair({"held": frame}, _CHANNELS)


def _lagged(target: Vector, start: float, pole: float) -> Vector:
    return np.asarray(lfilter([1.0 - pole], [1.0, -pole], target, zi=[pole * start])[0])


CASES = (
    RealCase(
        name="servo_play/held",
        kind="positive",
        build=_held,
        model="the target behind a lag of first order, fitted to the first 70 %; the rest is held out",
        truth="README.md: 'characterizing backlash in low-cost UART servo actuators'; it stands at +5 or -7 counts "
        "after it was pulled up or down (read off)",
        right=("drive.backlash",),
        tolerated=("drive.elasticity", "vibration.hysteresis", "drive.coulomb", "drive.delay", "drive.saturation"),
        reading="counts of 0.088 degrees; 273 rows of 0.1 s",
    ),
)
