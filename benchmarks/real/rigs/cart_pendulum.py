"""A pendulum on a standing cart, one free swing in six pieces."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
from scipy.io import loadmat

from benchmarks.real.case import Pair, RealCase, pair, table
from benchmarks.real.swinging import with_swing
from selector.recording import Channel

_FILE = "ParameterEstimation/SinglePendulum/SinglePendulumDataForParameterEstimation.mat"
_STEP_S, _KEPT = 1e-3, 20
_HELD_OUT, _SMALL = "amplitude 0.94", ("amplitude 0.55", "amplitude 0.40")
_AMPLITUDES = (1.62, 1.22, 0.94, 0.73, 0.55, 0.40)
_CHANNELS = (Channel("angle", "position", "m", place="pendulum, angle as travel at a lever of 1 m"),)


def _pieces(folder: Path, *, linear: bool) -> Pair:
    read = loadmat(folder / _FILE)
    courses = [part[0][0] for name in ("Y_id", "Y_vad") for part in read[name]]
    pieces = {}
    for amplitude, course in zip(_AMPLITUDES, courses, strict=True):
        angle = course[::_KEPT] - np.pi
        pieces[f"amplitude {amplitude:.2f}"] = table(_STEP_S * _KEPT * np.arange(len(angle)), angle=angle)
    fitted = _SMALL if linear else tuple(name for name in pieces if name != _HELD_OUT)
    with_swing(pieces, fitted, "angle", linear=linear)
    return pair(pieces, _CHANNELS, _HELD_OUT)


_TRUTH = "SinglePendulumODE.m has gravity by the sine and viscous friction, Instruction.md beside it"

CASES = (
    RealCase(
        name="cart_pendulum/linear",
        kind="positive",
        build=partial(_pieces, linear=True),
        model="linear oscillator, fitted to the two smallest pieces, of others only the starts; 0.94 rad held out",
        truth=_TRUTH,
        right=("vibration.hardening",),
        tolerated=("drive.varying_stiffness", "drive.coulomb"),
        reading="one row of 20 (1 ms); rest is at pi",
    ),
    RealCase(
        name="cart_pendulum/sine",
        kind="control",
        build=partial(_pieces, linear=False),
        model="their own model, fitted to five pieces; the one of 0.94 rad is held out (only its start is fitted)",
        truth=_TRUTH + "; what is left is the dry friction of a bearing, small (read off)",
        tolerated=("drive.coulomb", "drive.stribeck"),
        verdicts=("nothing-missing", "miscalibrated"),
        reading="one row of 20 (1 ms); rest is at pi",
    ),
)
