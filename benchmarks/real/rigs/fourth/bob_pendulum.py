"""A wooden ball on a thread, let go at 56 degrees and filmed for half a minute."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import Pair, RealCase, pair
from benchmarks.real.rigs.fourth.common import SILENT
from benchmarks.real.rigs.third.common import pieces
from benchmarks.real.swinging import with_swing
from selector.recording import Channel

_SPANS = {"56 to 43 deg": (0.0, 6.0), "43 to 34 deg": (6.0, 12.0), "34 to 27 deg": (12.0, 18.0),
          "27 to 22 deg": (18.0, 24.0), "22 to 18 deg": (24.0, 30.5)}  # fmt: skip
_CHANNELS = (Channel("angle", "position", "m", place="pendulum, angle as travel at a lever of 1 m"),)


def _swung(folder: Path, *, linear: bool) -> Pair:
    raw = pd.read_excel(folder / "damping_angle.xlsx", header=None, engine="openpyxl").dropna().to_numpy(np.float64)
    whole = pd.DataFrame({"angle": np.deg2rad(raw[:, 1])}, index=pd.Index(raw[:, 0] - raw[0, 0], name="time_s"))
    runs = pieces(whole, _SPANS)
    with_swing(runs, list(runs)[:4], "angle", linear=linear)
    return pair(runs, _CHANNELS)


CASES = (
    RealCase(
        name="bob_pendulum/linear",
        kind="positive",
        build=partial(_swung, linear=True),
        model="gravity by the angle and viscous friction, one law for four stretches; the last stretch is held out",
        truth="gravity goes by the sine: the authors' equation; the period falls with the amplitude",
        right=("vibration.hardening",),
        tolerated=("drive.varying_stiffness", "drive.elasticity", "vibration.hysteresis"),
        reading="30 frames a second; rad as m at 1 m",
    ),
    RealCase(
        name="bob_pendulum/sine",
        kind="control",
        build=partial(_swung, linear=False),
        model="gravity by the sine and viscous friction, one law for four stretches; the last stretch is held out",
        truth="0.7 degrees of 56 are left, those of the camera; the authors' drag by the square of the speed takes "
        "6 % of them",
        tolerated=("drive.varying_damping", "vibration.hysteresis", "drive.coulomb"),
        verdicts=SILENT,
        reading="30 frames a second; rad as m at 1 m",
    ),
)
