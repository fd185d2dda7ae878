"""A flexible robot arm on a motor: reaction torque and acceleration under a periodic sweep (DaISy)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import Pair, RealCase, least_squares, pair, table
from benchmarks.real.rigs.second.common import SILENT
from selector.recording import Channel

_STEP_S = 2e-3
_CHANNELS = (
    Channel("M", "force", "N", place="reaction torque on the ground, at a lever of 1 m"),
    Channel("a", "acceleration", "m/s^2", place="flexible arm"),
)


def _read(folder: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    raw = pd.read_csv(folder / "src/data/robot-arm.csv")
    return _STEP_S * np.arange(len(raw)), raw["u"].to_numpy(), raw["y"].to_numpy()


def _rigid(folder: Path) -> Pair:
    time_s, torque, seen = _read(folder)
    known = slice(0, int(0.7 * len(seen)))
    (factor,) = least_squares([torque[known]], seen[known])
    return pair({"sweep": table(time_s, M=torque, a=seen, a_simulated=factor * torque)}, _CHANNELS)


def _again(folder: Path) -> Pair:
    """The second half beside the first, which it repeats with the other sign."""
    time_s, torque, seen = _read(folder)
    half = len(seen) // 2
    frame = table(time_s[half:], M=torque[half:], a=seen[half:], a_simulated=-seen[:half])
    return pair({"second half": frame}, _CHANNELS)


CASES = (
    RealCase(
        name="flexible_arm/rigid",
        kind="positive",
        build=_rigid,
        model="acceleration = c x torque, fitted to the first 70 % of one sweep; the rest is held out",
        truth="Rafa7046 README.md: 'flexible robot arm ... measured reaction torque of the structure on the ground to "
        "the acceleration of the flexible arm'; the response peaks at 6 and 12.6 % of the sampling rate (read off)",
        right=("vibration.mode", "drive.elasticity"),
        tolerated=("vibration.back_reaction",),
        reading="the sampling time is not stated: 2 ms are taken",
    ),
    RealCase(
        name="flexible_arm/again",
        kind="control",
        build=_again,
        model="the first half of the sweep, turned over, beside the second; its last 30 % are held out",
        truth="the two halves of the torque are the same but for the sign (correlation -0.996)",
        tolerated=("vibration.mode",),
        verdicts=SILENT,
        reading="the sampling time is not stated: 2 ms are taken",
    ),
)
