"""A cart on a rail that a relay drives to and fro, at many places, and a pendulum on it."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.ndimage import gaussian_filter1d

from benchmarks.real.case import SIMULATED, Pair, RealCase, Vector, least_squares, pair, table
from benchmarks.real.swinging import with_swing
from selector.recording import Channel

_DATA = "parameterEstimation/data"
_STEP_S, _WIDTH, _LATE_S, _BORDER = 0.01, 4, 0.005, 40
_SHARE = "0.4"
_PLACES = ("0m20", "0m30", "0m40", "0m50", "0m60")
_CHANNELS = (
    Channel("x", "position", "m", place="cart on its rail", axis="X"),
    Channel("I", "current", "A", place="command to the motor, unit not stated, smoothed as the motion is", axis="X"),
)
_PIECES_S = ((20.0, 34.0), (34.0, 47.0), (47.0, 60.0))
_ANGLE = (Channel("angle", "position", "m", place="pendulum from rest, angle as travel at a lever of 1 m"),)


def _read(path: Path) -> pd.DataFrame:
    raw = pd.read_csv(path, header=None).drop_duplicates(0)
    seen_s, time_s = raw[0].to_numpy(), np.arange(raw[0].iloc[1], raw[0].iloc[-1], _STEP_S)
    held = raw[1].to_numpy()[np.searchsorted(seen_s, time_s - _LATE_S, side="right") - 1]
    x = np.interp(time_s, seen_s, raw[2])
    inner = slice(_BORDER, -_BORDER, 2)
    frame = table(time_s[inner], x=_smooth(x, 0)[inner], I=_smooth(held, 0)[inner])
    laws = {"a": _smooth(x, 2), "v": _smooth(x, 1), "dry": _smooth(np.sign(_smooth(x, 1)), 0)}
    return frame.assign(**{name: values[inner] for name, values in laws.items()}, constant=1.0)


def _smooth(values: Vector, derivative: int) -> Vector:
    return np.asarray(gaussian_filter1d(values, _WIDTH, order=derivative) / _STEP_S**derivative)


def _forces(folder: Path, *, laws: tuple[str, ...]) -> Pair:
    """The current that the laws need, with the same factors at all places."""
    runs = {name: _read(folder / _DATA / "cartTest2" / f"{name}.csv") for name in _PLACES}
    fitted = pd.concat(list(runs.values())[:-1])
    factors = least_squares([fitted[law].to_numpy() for law in laws], fitted["I"].to_numpy())
    for frame in runs.values():
        frame["I" + SIMULATED] = frame[list(laws)].to_numpy() @ factors
    return pair(runs, _CHANNELS)


def _by_place(folder: Path) -> Pair:
    """All laws with factors of their own at every place."""
    runs = {name: _read(folder / _DATA / "cartTest2" / f"{name}.csv") for name in _PLACES}
    laws = ["a", "v", "dry", "constant"]
    for frame in runs.values():
        fitted = frame.iloc[: int((1.0 - float(_SHARE)) * len(frame))]
        factors = least_squares([fitted[law].to_numpy() for law in laws], fitted["I"].to_numpy())
        frame["I" + SIMULATED] = frame[laws].to_numpy() @ factors
    return pair(runs, _CHANNELS, _SHARE)


def _pendulum(folder: Path) -> Pair:
    raw = pd.read_csv(folder / _DATA / "pend1test" / "test1pend1.csv", header=None).drop_duplicates(0).iloc[::2]
    pieces = {}
    for begin_s, end_s in _PIECES_S:
        rows = raw[(raw[0] >= begin_s) & (raw[0] < end_s)]
        pieces[f"from {begin_s:g} s"] = table(rows[0].to_numpy(), angle=rows[1].to_numpy() - np.pi)
    with_swing(pieces, list(pieces)[:-1], "angle", linear=False)
    return pair(pieces, _ANGLE)


_TRUTH = (
    "parameterEstimation/run_estimate.m fits b_c_c_p and b_c_c_m, dry friction by direction and place, first guesses "
    "1.5 to 2.1 and 5.2 to 5.6 N"
)
_READING = "resampled to 20 ms; place and command smoothed alike (Gaussian, 40 ms), the command 5 ms late"

CASES = (
    RealCase(
        name="cart_rail/frictionless",
        kind="positive",
        build=partial(_forces, laws=("a",)),
        model="current = inertia x acceleration, fitted at four places; the fifth is held out",
        truth=_TRUTH,
        right=("drive.coulomb", "drive.asymmetric_friction"),
        tolerated=("drive.offset_force", "drive.stribeck", "drive.viscous"),
        reading=_READING,
    ),
    RealCase(
        name="cart_rail/symmetric",
        kind="positive",
        build=partial(_forces, laws=("a", "v", "dry")),
        model="inertia, viscous and dry friction alike in both directions, fitted at four places; the fifth held out",
        truth=_TRUTH,
        right=("drive.asymmetric_friction", "drive.offset_force"),
        tolerated=("drive.stribeck", "drive.viscous", "drive.coulomb", "drive.varying_damping"),
        verdicts=("miscalibrated",),
        reading=_READING + "; dry friction by direction and a constant force are the same here, and so is an offset",
    ),
    RealCase(
        name="cart_rail/by place",
        kind="control",
        build=_by_place,
        model="inertia, viscous, dry friction and a constant at every place, fitted to 60 % of each; the rest held out",
        truth="all that run_estimate.m fits is in; 0.1 A of 3 A are left (read off)",
        tolerated=("drive.stribeck",),
        verdicts=("nothing-missing", "miscalibrated"),
        reading=_READING,
    ),
    RealCase(
        name="cart_rail/pendulum",
        kind="positive",
        build=_pendulum,
        model="pendulum with gravity by the sine and viscous friction, fitted to two pieces of a free swing; the third "
        "is held out (only its start is fitted)",
        truth="initCartPendulum.m: 'pendulum coulomb friction', 4.1e-3 N m",
        right=("drive.coulomb",),
        tolerated=("drive.stribeck", "vibration.hardening"),
        reading="every second row (6.7 ms); rest is at pi",
    ),
)
