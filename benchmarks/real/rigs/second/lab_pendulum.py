"""A pendulum of a first-year laboratory, filmed; free swings from 90 degrees down to rest."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from numba import njit
from scipy.optimize import least_squares as minimised

from benchmarks.real.case import SIMULATED, Pair, RealCase, Vector, pair, table
from benchmarks.real.rigs.second.common import SILENT
from benchmarks.real.swinging import with_swing
from selector.recording import Channel

_FILES = ("data31", "data32", "data33")
_TAIL = (100.0, 145.0)
_PIECES = {"large": (5.0, 20.0), "middle": (45.0, 60.0), "small": (80.0, 95.0)}
_CHANNELS = (Channel("angle", "position", "m", place="pendulum, angle as travel at a lever of 1 m"),)


def _read(folder: Path, name: str, part: tuple[float, float]) -> pd.DataFrame:
    raw = pd.read_csv(folder / f"{name}.csv", sep=", *", engine="python")
    time_s = raw["time"].to_numpy() - raw["time"].iloc[0]
    kept = (time_s >= part[0]) & (time_s < part[1])
    return table(time_s[kept][::2], angle=raw["angle"].to_numpy()[kept][::2])


def _linear(folder: Path) -> Pair:
    pieces = {name: _read(folder, "data31", part) for name, part in _PIECES.items()}
    pieces["middle again"] = _read(folder, "data33", _PIECES["middle"])
    with_swing(pieces, ("small",), "angle", linear=True)
    return pair(pieces, _CHANNELS)


def _viscous(folder: Path) -> Pair:
    pieces = {name: _read(folder, name, _TAIL) for name in _FILES}
    with_swing(pieces, _FILES[:2], "angle", linear=False)
    return pair(pieces, _CHANNELS)


def _sine(folder: Path) -> Pair:
    """Fitted to the first 70 % of one large swing, and run on from there."""
    whole = _read(folder, "data32", (5.0, 25.0))
    pieces = {"first": whole.iloc[: int(0.7 * len(whole))].copy(), "whole": whole}
    with_swing(pieces, ("first",), "angle", linear=False)
    return pair({"data32": pieces["whole"]}, _CHANNELS)


@njit(cache=True)
def _run(square, dry, angle, speed, times):
    course = np.empty(len(times))
    for k in range(len(times)):
        course[k] = angle
        if k + 1 == len(times):
            break
        step = (times[k + 1] - times[k]) / 6
        for _ in range(6):
            speed += step * (-square * np.sin(angle) - dry * np.tanh(speed / 0.02))
            angle += step * speed
    return course


def _dry(folder: Path) -> Pair:
    """Gravity by the sine and dry friction alone; of the run held out only the start is fitted, to its first 4 s."""
    pieces = {name: _read(folder, name, _TAIL) for name in _FILES}
    known = [pieces[name] for name in _FILES[:2]]

    def course(law: Vector, start: Vector, frame: pd.DataFrame) -> Vector:
        return np.asarray(_run(np.exp(law[0]), np.exp(law[1]), start[0], start[1], frame.index.to_numpy()))

    def begun(frame: pd.DataFrame) -> list[float]:
        first = frame.iloc[:20]
        slope, level = np.polyfit(first.index, first["angle"], 2)[1:]
        return [float(level), float(slope)]

    guess = np.r_[np.log(37.2), np.log(0.06), begun(known[0]), begun(known[1])]
    x = minimised(
        lambda x: np.concatenate(
            [course(x, x[2 + 2 * k : 4 + 2 * k], one) - one["angle"] for k, one in enumerate(known)]
        ),
        guess, x_scale="jac",
    ).x  # fmt: skip
    starts = {_FILES[0]: x[2:4], _FILES[1]: x[4:6]}
    first = pieces[_FILES[2]].iloc[:200]
    starts[_FILES[2]] = minimised(lambda s: course(x, s, first) - first["angle"].to_numpy(), begun(first)).x
    for name, frame in pieces.items():
        frame["angle" + SIMULATED] = course(x, starts[name], frame)
    return pair(pieces, _CHANNELS)


_READING = "one row of two (10 ms); angles in steps of 5.2 mrad"

CASES = (
    RealCase(
        name="lab_pendulum/linear",
        kind="positive",
        build=_linear,
        model="linear oscillator, fitted to a piece of 0.3 rad, of others only the starts; a piece of 0.65 rad of "
        "another swing is held out",
        truth="the period falls from 1.215 to 1.044 s while the amplitude falls from 1.6 to 0.2 rad (read off): "
        "gravity "
        "by the sine",
        right=("vibration.hardening",),
        tolerated=("drive.varying_stiffness", "drive.coulomb", "data.zero"),
        reading=_READING,
    ),
    RealCase(
        name="lab_pendulum/tail",
        kind="positive",
        build=_viscous,
        model="gravity by the sine and viscous friction, fitted to the last 45 s of two swings; that of a third "
        "is held "
        "out (only its start is fitted)",
        truth="peaks fall by equal steps: 0.220, 0.178, 0.136, 0.094, 0.052 rad; dry instead of viscous friction "
        "leaves "
        "5.8 instead of 14 mrad (read off)",
        right=("drive.coulomb",),
        tolerated=("drive.stribeck", "vibration.hysteresis", "drive.varying_damping", "data.zero"),
        reading=_READING,
    ),
    RealCase(
        name="lab_pendulum/tail dry",
        kind="control",
        build=_dry,
        model="the same with dry instead of viscous friction",
        truth="a step is 5.2 mrad and 5.8 mrad are left, of 260 (read off)",
        tolerated=("drive.stribeck", "drive.viscous", "drive.coulomb", "data.zero"),
        verdicts=SILENT,
        reading=_READING,
    ),
    RealCase(
        name="lab_pendulum/sine",
        kind="control",
        build=_sine,
        model="gravity by the sine and viscous friction, fitted to the first 70 % of 20 s of a large swing; the "
        "rest is "
        "held out",
        truth="4 mrad of 1.4 rad are left, steps are 5.2 mrad (read off); dry friction is small there",
        tolerated=("drive.coulomb", "drive.stribeck", "drive.viscous", "data.zero"),
        verdicts=SILENT,
        reading=_READING,
    ),
)
