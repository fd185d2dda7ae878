"""Two pendulums that swing out, one with a dry bearing and one without."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
from scipy.io import loadmat

from benchmarks.real.case import Pair, RealCase, pair, table
from benchmarks.real.swinging import with_swing
from selector.recording import Channel

_KEPT = 20
_PIECES_S = ((20.0, 40.0), (40.0, 60.0), (80.0, 100.0), (60.0, 80.0))
_CHANNELS = (Channel("angle", "position", "m", place="pendulum, angle as travel at a lever of 1 m"),)


def _swings(folder: Path, *, file: str, name: str) -> Pair:
    read = loadmat(folder / "mfiles" / "p1c3" / f"{file}.mat")
    time_s, angle = (np.ravel(read[key]) for key in ("t", name))
    pieces = {}
    for begin_s, end_s in _PIECES_S:
        rows = np.flatnonzero((time_s >= begin_s) & (time_s < end_s))[::_KEPT]
        pieces[f"from {begin_s:g} s"] = table(time_s[rows], angle=angle[rows])
    with_swing(pieces, ("from 80 s",), "angle", linear=True)
    return pair(pieces, _CHANNELS)


_MODEL = "linear oscillator, fitted to the piece from 80 s, of the others only their starts; the one from 60 s held out"

CASES = (
    RealCase(
        name="two_pendulums/dry",
        kind="positive",
        build=partial(_swings, file="cdip_pend_data", name="theta"),
        model=_MODEL,
        truth="free swing; its peaks fall by equal steps at the end, its period from 1.167 to 1.090 s (read off)",
        right=("drive.coulomb", "vibration.hardening"),
        tolerated=("drive.stribeck", "drive.varying_stiffness"),
        reading="one row of 20 (1 ms); steps of 0.44 mrad",
    ),
    RealCase(
        name="two_pendulums/viscous",
        kind="positive",
        build=partial(_swings, file="adip_pend_data", name="theta2"),
        model=_MODEL,
        truth="free swing; its peaks fall by equal ratios (read off): the control for dry friction",
        right=("vibration.hardening",),
        tolerated=("drive.varying_stiffness",),
        reading="one row of 20 (1 ms)",
    ),
)
