"""A wing of an aircraft shaken on the ground; a payload hangs in its mount with play and friction."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.linalg import lstsq

from benchmarks.real.case import Pair, RealCase, Vector, pair, table
from selector.recording import Channel

_STEP_S = 1.0 / 400.0
_TAPS, _BEHIND, _FIT = 300, 40, 12_000
_ROWS = slice(4000, 20_000)
_KEPT = 2
_CHANNELS = (
    Channel("F", "force", "N", place="shaker, scaled"),
    Channel("a", "acceleration", "m/s^2", place="mount of the payload, scaled"),
)


def _linear(folder: Path) -> Pair:
    raw = np.loadtxt(folder / "datasets" / "f_16_vibration_test" / "f-16.txt", delimiter=_delimiter(folder))
    force, seen = raw[:, 1], raw[:, 2]
    past = np.column_stack([_late(force, k) for k in range(-_BEHIND, _TAPS)])
    fitted = slice(_TAPS, _FIT)
    factors = lstsq(past[fitted], seen[fitted], lapack_driver="gelsy")[0]
    frame = table(_STEP_S * np.arange(len(force)), F=force, a=seen, a_simulated=past @ factors)
    frame = frame.iloc[_ROWS].iloc[::_KEPT]
    return pair({"level": frame.set_axis(frame.index - frame.index[0])}, _CHANNELS)


def _delimiter(folder: Path) -> str | None:
    with (folder / "datasets" / "f_16_vibration_test" / "f-16.txt").open(encoding="utf-8") as file:
        return "," if "," in file.readline() else None


def _late(course: Vector, k: int) -> Vector:
    moved = np.zeros_like(course)
    if k >= 0:
        moved[k:] = course[: len(course) - k]
    else:
        moved[:k] = course[-k:]
    return moved


CASES = (
    RealCase(
        name="f16/linear",
        kind="positive",
        build=_linear,
        model="the best linear answer to the force, 0.75 s long, fitted to 30 s; the last 30 % of 40 s are held out",
        truth="Noel, Schoukens (2017), F-16 aircraft benchmark: clearance and friction where the payload is mounted",
        right=("vibration.hardening", "vibration.hysteresis"),
        tolerated=("vibration.mode", "drive.varying_stiffness", "drive.backlash", "drive.coulomb"),
        reading="400 Hz as published, one row of two; forces and accelerations scaled to 1",
    ),
)
