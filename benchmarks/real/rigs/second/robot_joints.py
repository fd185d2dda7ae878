"""Joints of two robots that follow paths; the torque is what their inverse dynamics leave, in short: friction."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, Vector, least_squares, pair, thinned
from benchmarks.real.rigs.second.common import SILENT, folded, period_of
from selector.recording import Channel

_FRANKA = "Comparative data/Franka Robot"
_FAIRINO = "Comparative data/FAIRINO Robot"
_SHARP = {"franka": 2e-3, "fairino": 3e-4}
_CHANNELS = (
    Channel("q", "position", "m", place="joint, angle as travel at a lever of 1 m", axis="C"),
    Channel("v", "velocity", "m/s", place="joint, at the same lever", axis="C"),
    Channel("tau", "force", "N", place="joint, torque less inverse dynamics, at the same lever", axis="C"),
)


def _read(path: Path, mean_of: int) -> pd.DataFrame:
    raw = pd.read_csv(path)
    columns = {"q": raw.iloc[:, 1], "v": raw.iloc[:, 2], "tau": raw.iloc[:, 4]}
    frame = pd.DataFrame(columns).set_axis(pd.Index(raw["time"] - raw["time"].iloc[0], name="time_s"))
    return thinned(frame, mean_of)


def _law(frame: pd.DataFrame, sharp: float, dry: bool) -> list[Vector | float]:
    speed = frame["v"].to_numpy()
    return [speed, 1.0, np.tanh(speed / sharp)] if dry else [speed, 1.0]


def _friction(folder: Path, *, robot: str, files: Sequence[str], mean_of: int, dry: bool, all_fitted: bool) -> Pair:
    """Friction by speed and a constant, fitted to all runs but the last, or to the first 70 % of an only one."""
    where = folder / (_FRANKA if robot == "franka" else _FAIRINO)
    runs = {name: _read(where / f"{name}.csv", mean_of) for name in files}
    frames = list(runs.values())
    fitted = frames[0].iloc[: int(0.7 * len(frames[0]))] if all_fitted else pd.concat(frames[:-1])
    factors = least_squares(_law(fitted, _SHARP[robot], dry), fitted["tau"].to_numpy())
    for frame in frames:
        columns = [np.broadcast_to(one, len(frame)) for one in _law(frame, _SHARP[robot], dry)]
        frame["tau" + SIMULATED] = np.column_stack(columns) @ factors
    return pair(runs, _CHANNELS)


def _again(folder: Path, *, path: str, mean_of: int, first_s: float) -> Pair:
    frame = _read(folder / f"{path}.csv", mean_of)
    period_s = period_of(frame["q"].to_numpy(), frame.index.to_numpy())
    bins = int(period_s / float(np.median(np.diff(frame.index))))
    return pair({Path(path).name: folded(frame, ("tau",), period_s, first_s, bins)}, _CHANNELS)


_README = "README.md: raw 'joint angles, joint angular velocities, and joint friction torques'"
_READING = "angles and torques at a lever of 1 m"

CASES = (
    RealCase(
        name="franka/wrist viscous",
        kind="positive",
        build=partial(
            _friction,
            robot="franka",
            files=("case4_slow", "case4_middle", "case4_high"),
            mean_of=10,
            dry=False,
            all_fitted=False,
        ),
        model="torque = a x speed + constant, fitted to two runs of joint 7; the third, the slowest, is held out",
        truth=_README + "; the torque jumps by 0.4 to 0.6 N m where the speed changes its sign (read off)",
        right=("drive.coulomb",),
        tolerated=("drive.stribeck", "drive.asymmetric_friction", "vibration.hysteresis"),
        reading=_READING + "; means of ten rows (4.7 ms)",
    ),
    RealCase(
        name="franka/wrist dry",
        kind="positive",
        build=partial(
            _friction,
            robot="franka",
            files=("case4_slow", "case4_middle", "case4_high"),
            mean_of=10,
            dry=True,
            all_fitted=False,
        ),
        model="the same with dry friction",
        truth=_README + ", with 'Stribeck' and 'LuGre' fitted in the same folder; half the difference of both "
        "directions in the slowest run: 0.40, 0.35, 0.30, 0.26 N m at 6, 15, 30, 100 mrad/s; 0.33 to 0.20 and 0.23 "
        "to 0.18 in the others (read off)",
        right=("drive.stribeck",),
        tolerated=("vibration.hysteresis", "drive.varying_damping", "drive.coulomb", "drive.viscous"),
        verdicts=(),
        reading=_READING + "; means of ten rows (4.7 ms)",
    ),
    RealCase(
        name="franka/shoulder viscous",
        kind="positive",
        build=partial(
            _friction,
            robot="franka",
            files=("case3_high", "case3_middle", "case3_slow"),
            mean_of=10,
            dry=False,
            all_fitted=False,
        ),
        model="torque = a x speed + constant, fitted to two runs of joint 2; the slowest is held out",
        truth=_README + "; the torque jumps by 0.5 to 0.9 N m with the sign of the speed in the slower runs (read off)",
        right=("drive.coulomb",),
        tolerated=(
            "drive.stribeck",
            "drive.asymmetric_friction",
            "drive.ripple",
            "drive.varying_stiffness",
            "vibration.hysteresis",
            "drive.varying_damping",
        ),
        reading=_READING + "; means of ten rows (2.4 ms)",
    ),
    RealCase(
        name="franka/again",
        kind="control",
        build=partial(_again, path=f"{_FRANKA}/case4_slow", mean_of=10, first_s=40.0),
        model="the mean cycle of the first 40 s of a path that repeats; the last 30 % of the other 80 s are held out",
        truth="the same path again, run by the same robot (read off: 6.25 s)",
        verdicts=SILENT,
        reading=_READING + "; means of ten rows (4.7 ms)",
    ),
    RealCase(
        name="fairino/base dry",
        kind="positive",
        build=partial(
            _friction,
            robot="fairino",
            files=("verify_robot_yuanhu_slow_processed",),
            mean_of=2,
            dry=True,
            all_fitted=True,
        ),
        model="torque = a x speed + constant + dry friction of joint 1, fitted to the first 70 %; the rest is held out",
        truth="a torque of period 1.25 mrad along the way is left, the same in all joints: with a sine of it 1.2 "
        "instead of 2.2 N m (read off)",
        right=("drive.ripple",),
        tolerated=("drive.stribeck", "drive.pitch_error"),
        reading=_READING + "; means of two rows (16 ms)",
    ),
    RealCase(
        name="fairino/elbow viscous",
        kind="positive",
        build=partial(
            _friction, robot="fairino", files=("verify_robot_S_slow_processed",), mean_of=2, dry=False, all_fitted=True
        ),
        model="torque = a x speed + constant of joint 3, fitted to the first 70 %; the rest is held out",
        truth=_README + "; the torque jumps by 12 N m where the speed changes its sign: 3.0 N m left without, 1.7 with "
        "dry friction, of which 1.2 with a sine of period 1.24 mrad (read off)",
        right=("drive.coulomb", "drive.ripple"),
        tolerated=("drive.stribeck", "drive.asymmetric_friction", "drive.pitch_error"),
        reading=_READING + "; means of two rows (16 ms)",
    ),
    RealCase(
        name="fairino/elbow dry",
        kind="positive",
        build=partial(
            _friction,
            robot="fairino",
            files=("verify_robot_S_slow_processed", "verify_robot_zhixian_slow_processed"),
            mean_of=2,
            dry=True,
            all_fitted=False,
        ),
        model="torque = a x speed + constant + dry friction of joint 3, fitted to one path; the other is held out",
        truth="a torque of period 1.24 mrad along the way is left (read off)",
        right=("drive.ripple",),
        tolerated=("drive.stribeck", "drive.pitch_error", "drive.viscous", "drive.offset_force"),
        reading=_READING + "; means of two rows (16 ms)",
    ),
    RealCase(
        name="fairino/again",
        kind="control",
        build=partial(_again, path=f"{_FAIRINO}/verify_robot_zhixian_slow_processed", mean_of=2, first_s=60.0),
        model="the mean cycle of the first 60 s of a path that repeats; the last 30 % of the other 120 s are held out",
        truth="the same path again, run by the same robot (read off: 9.387 s)",
        verdicts=SILENT,
        reading=_READING + "; means of two rows (16 ms)",
    ),
)
