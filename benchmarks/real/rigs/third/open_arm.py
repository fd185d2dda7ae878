"""Joints of an open robot arm that push themselves along until they slip; the motors report their torque."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, least_squares, pair
from selector.recording import Channel

_CHANNELS = (
    Channel("q", "position", "m", place="joint, angle as travel at a lever of 1 m", axis="C"),
    Channel("v", "velocity", "m/s", place="joint, at the same lever", axis="C"),
    Channel("tau", "force", "N", place="motor of the joint, torque at the same lever", axis="C"),
)


def _read(path: Path, joint: int) -> pd.DataFrame:
    with np.load(path) as raw:
        columns = {name: raw[key][:, joint - 1] for name, key in (("q", "q"), ("v", "qd"), ("tau", "tau_measured"))}
        times = raw["time"]
    frame = pd.DataFrame(columns, index=pd.Index(times - times[0], name="time_s")).astype(np.float64)
    return frame[np.r_[True, np.diff(times) > 0.0]]


def _viscous(folder: Path, *, joint: int, files: tuple[str, ...]) -> Pair:
    """Torque by speed and a constant, fitted to all runs but the last, or to the first 70 % of an only one."""
    runs = {name: _read(folder / "results" / f"{name}.npz", joint) for name in files}
    frames = list(runs.values())
    known = frames[0].iloc[: int(0.7 * len(frames[0]))] if len(frames) == 1 else pd.concat(frames[:-1])
    moving = known[known["v"].abs() > 0.03]
    factors = least_squares([moving["v"].to_numpy(), 1.0], moving["tau"].to_numpy())
    for frame in frames:
        frame["tau" + SIMULATED] = factors[0] * frame["v"] + factors[1]
    return pair(runs, _CHANNELS, "0.3" if len(frames) == 1 else "last")


_README = "README.md: identification of friction of a real arm ('hw'); its law is coulomb, viscous, offset"
_READING = "angles and torques at a lever of 1 m; rows of the serial line as they came, 26 to 31 ms"
_TOLERATED = ("drive.stribeck", "drive.asymmetric_friction", "vibration.hysteresis", "drive.offset_force")

CASES = (
    RealCase(
        name="open_arm/wrist viscous",
        kind="positive",
        build=partial(_viscous, joint=7, files=("real_uart_capture", "real_uart_capture_collect_joint_7")),
        model="torque = a x speed + constant, fitted to the moving rows of one run of joint 7; another is held out",
        truth=_README + "; the torque jumps by 0.15 N m with the sign of the speed (read off)",
        right=("drive.coulomb",),
        tolerated=_TOLERATED,
        reading=_READING,
    ),
    RealCase(
        name="open_arm/forearm viscous",
        kind="positive",
        build=partial(_viscous, joint=6, files=("real_uart_capture_collect_joint_6",)),
        model="the same of joint 6, fitted to the first 70 %; the rest is held out",
        truth=_README + "; the torque jumps by 0.35 N m with the sign of the speed (read off)",
        right=("drive.coulomb",),
        tolerated=_TOLERATED,
        reading=_READING,
    ),
    RealCase(
        name="open_arm/upper arm viscous",
        kind="positive",
        build=partial(_viscous, joint=3, files=("real_uart_capture_collect_joint_3",)),
        model="the same of joint 3, fitted to the first 70 %; the rest is held out",
        truth=_README + "; the torque jumps by 0.8 N m with the sign of the speed (read off)",
        right=("drive.coulomb",),
        tolerated=_TOLERATED,
        reading=_READING,
    ),
)
