"""A geared motor with a speed loop at five steady speeds, and the angle that its encoder reads."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, pair
from benchmarks.real.rigs.fourth.common import evenly
from selector.recording import Channel

_SETTLING_S = 0.3
_LEVELS = (-60.0, 60.0, -30.0, 30.0, -90.0)
_ANGLE = Channel("angle", "position", "m", place="motor, 100 deg as 1 m", axis="C")


def _steady(folder: Path) -> Pair:
    raw = pd.read_csv(folder / "python/velocity_feedback_comparison.csv")
    stretch = raw["commanded_deg_s"].diff().ne(0).cumsum()
    runs = {}
    for level in _LEVELS:
        longest = max((part for _, part in raw[raw["commanded_deg_s"] == level].groupby(stretch)), key=len)
        part = longest[longest["time_s"] > longest["time_s"].iloc[0] + _SETTLING_S]
        angle = np.unwrap(part["angle_deg"].to_numpy(), period=360.0)
        run = evenly(part["time_s"].to_numpy(), 0.005, angle=0.01 * angle)
        times = run.index.to_numpy()
        line = np.polyval(np.polyfit(times, run["angle"], 1), times)
        runs[f"{level:.0f} deg/s"] = run.assign(**{"angle" + SIMULATED: line})
    return pair(runs, (_ANGLE,))


CASES = (
    RealCase(
        name="speed_servo/steady",
        kind="positive",
        build=_steady,
        model="at each of five set speeds the motor turns steadily, from where and as fast as it did; the last, "
        "-90 deg/s, is held out",
        truth="the encoder is off by a wave of 0.07 deg that repeats every 5.0 deg, the same in both directions and at "
        "every speed (read off)",
        right=("drive.pitch_error",),
        tolerated=("drive.ripple", "vibration.line", "vibration.imbalance"),
        reading="4.5 ms a row, evened to 5 ms; 0.01 deg a step",
    ),
)
