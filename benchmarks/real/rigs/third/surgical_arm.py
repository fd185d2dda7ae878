"""Pitch of a surgical robot's arm that a motor pushes to and fro in small random steps of its voltage."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from scipy.signal import cont2discrete, lfilter

from benchmarks.real.case import SIMULATED, Pair, RealCase, Vector, pair, thinned
from benchmarks.real.rigs.third.common import fitted
from selector.recording import Channel

_RUNS = {
    "a": "pitch_prbs_response/old/prbs_roll_0_pitch_0.csv",
    "b": "prbs_pitch_V5.csv",
    "c": "pitch_prbs_response/prbs_roll_0_pitch_0.csv",
    "roll 20": "pitch_prbs_response/prbs_roll_20_pitch_0.csv",
}
_STEP_S = 0.01
_CHANNELS = (
    Channel("u", "voltage", "V", place="motor of the pitch, duty in per cent as V", axis="C"),
    Channel("q", "position", "m", place="pitch, angle as travel at a lever of 1 m", axis="C"),
)


def _read(path: Path) -> pd.DataFrame:
    raw = pd.read_csv(path)
    times = raw["/psm_joint_telemetry/header/stamp"].to_numpy()
    kept = np.r_[True, np.diff(times) > 0.0]
    grid = np.arange(0.0, times[-1] - times[0], 0.0025)
    columns = {"u": "velocity", "q": "position"}
    course = {
        new: np.interp(grid, times[kept] - times[0], raw[f"/psm_joint_telemetry/pitch/{old}"].to_numpy()[kept])
        for new, old in columns.items()
    }
    frame = pd.DataFrame({"u": course["u"], "q": np.deg2rad(course["q"])}, index=pd.Index(grid, name="time_s"))
    return thinned(frame, 4)


def _swing(x: Vector, frame: pd.DataFrame) -> Vector:
    """Mass, spring of the weight and damper on the duty: gain, angular frequency, damping ratio."""
    gain, omega, damping = x
    top, bottom, _ = cont2discrete(([gain * omega**2], [1.0, 2.0 * damping * omega, omega**2]), _STEP_S)
    course = lfilter(np.ravel(top), bottom, frame["u"].to_numpy() - frame["u"].mean())
    return np.asarray(course - course.mean() + frame["q"].mean())


def _linear(folder: Path) -> Pair:
    runs = {name: _read(folder / path) for name, path in _RUNS.items()}
    law = fitted(_swing, list(runs.values())[:3], "q", [0.001, 6.0, 0.5])
    for frame in runs.values():
        frame["q" + SIMULATED] = _swing(law, frame)
    return pair(runs, _CHANNELS)


CASES = (
    RealCase(
        name="surgical_arm/linear pitch",
        kind="positive",
        build=_linear,
        model="mass, spring (weight) and damper on the duty of the motor, fitted to three runs; another pose of the "
        "roll is held out",
        truth="the pitch stands still for up to 2 s while the duty varies, and leaves with a jump (read off)",
        right=("drive.coulomb",),
        tolerated=("drive.stribeck", "vibration.hysteresis", "drive.asymmetric_friction"),
        reading="duty, recorded as velocity, in per cent; on a grid of 2.5 ms, means of four (10 ms)",
    ),
)
