"""The pendulum of a rotary inverted pendulum, free swings from three angles."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from benchmarks.real.case import Pair, RealCase, pair, table
from benchmarks.real.swinging import with_swing
from selector.recording import Channel

_FILE = "software/modelling/experiment/damping_coefficient/pendulum_free_swing_data_0{}.txt"
_BEGIN, _KEPT, _STEP_S, _LONGEST = 130, 10, 1e-3, 280
_CHANNELS = (Channel("angle", "position", "m", place="pendulum, angle as travel at a lever of 1 m"),)


def _linear(folder: Path) -> Pair:
    pieces = {}
    for name, number, begin in (("45 degrees", 3, 0), ("45 degrees, later", 3, 2000), ("135 degrees, later", 2, 2000)):
        angle = np.deg2rad(np.loadtxt(folder / _FILE.format(number), skiprows=2))[_BEGIN + begin :: _KEPT]
        angle = angle[:_LONGEST]
        pieces[name] = table(_STEP_S * _KEPT * np.arange(len(angle)), angle=angle)
    with_swing(pieces, ("45 degrees, later",), "angle", linear=True)
    return pair(pieces, _CHANNELS)


CASES = (
    RealCase(
        name="rotary_pendulum/linear",
        kind="positive",
        build=_linear,
        model="linear oscillator, fitted to the later part of the swing from 45 degrees, of others only the "
        "starts; the "
        "later part of the one from 135 degrees is held out",
        truth="damping_coefficient/README.md: 'Move the pendulum to approximately 90 degrees ... let go'; a linear "
        "swing leaves 89 mrad of the one from 45 degrees, gravity by the sine 36 (read off)",
        right=("vibration.hardening",),
        tolerated=("drive.varying_stiffness", "drive.coulomb"),
        reading="one row of ten (1 ms); angles in steps of 1.6 mrad",
    ),
)
