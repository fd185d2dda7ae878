"""A butterfly valve of an engine against its return spring, turned by a motor on a varying voltage."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.io import loadmat
from scipy.signal import cont2discrete, lfilter

from benchmarks.real.case import SIMULATED, Pair, RealCase, Vector, least_squares, pair, thinned
from benchmarks.real.rigs.third.common import SILENT, fitted
from selector.recording import Channel

_FILE = "data/dataIdentificatinThrottle_Labcontrol_HassaneAissam20-Feb-2016_15h{}m.mat"
_CHANNELS = (
    Channel("U", "voltage", "V", place="motor of the valve", axis="C"),
    Channel("q", "position", "m", place="valve, angle as travel at a lever of 1 m", axis="C"),
    Channel("v", "velocity", "m/s", place="valve, at the same lever", axis="C"),
    Channel("I", "current", "A", place="motor of the valve", axis="C"),
)
_FIRST_S = 1.0


def _read(folder: Path, minute: int) -> pd.DataFrame:
    """Current, angle, speed, voltage at 1 ms; the angle is a tenth of radians, as the authors read it."""
    raw = loadmat(folder / _FILE.format(minute), squeeze_me=True, struct_as_record=False)["simout"]
    values = np.asarray(raw.signals.values, dtype=np.float64)
    columns = {"U": values[:, 3], "q": np.deg2rad(10.0 * values[:, 1]), "v": np.deg2rad(10.0 * values[:, 2])}
    frame = pd.DataFrame({**columns, "I": values[:, 0]}, index=pd.Index(np.asarray(raw.time), name="time_s"))
    frame = thinned(frame[(frame["U"] > 0.5) & (frame.index > _FIRST_S)], 10)
    return frame.set_axis(pd.Index(frame.index - frame.index[0], name="time_s"))


def _runs(folder: Path) -> dict[str, pd.DataFrame]:
    return {f"15:{minute:02d}": _read(folder, minute) for minute in (6, 7, 8)}


def _swing(x: Vector, frame: pd.DataFrame) -> Vector:
    """Mass, spring and damper on the voltage: gain, angular frequency, damping ratio, angle without voltage."""
    gain, omega, damping, rest = x
    step = float(np.median(np.diff(frame.index)))
    top, bottom, _ = cont2discrete(([gain * omega**2], [1.0, 2.0 * damping * omega, omega**2]), step)
    drive = frame["U"].to_numpy()
    course = lfilter(np.ravel(top), bottom, drive - drive[0])
    return np.asarray(rest + gain * drive[0] + course)


def _linear(folder: Path) -> Pair:
    runs = _runs(folder)
    law = fitted(_swing, list(runs.values())[:2], "q", [0.2, 6.0, 1.0, 0.1])
    for frame in runs.values():
        frame["q" + SIMULATED] = _swing(law, frame)
    kept = {name: frame[["U", "v", "q", "q" + SIMULATED]] for name, frame in runs.items()}
    return pair(kept, _CHANNELS[:3])


def _current(folder: Path, *, terms: str) -> Pair:
    """Current by the columns of `terms`: voltage; or speed, angle and acceleration."""
    runs = _runs(folder)
    for frame in runs.values():
        frame["a"] = np.gradient(frame["v"].to_numpy(), frame.index.to_numpy())
    known = pd.concat(list(runs.values())[:2])
    names = terms.split()
    factors = least_squares([*(known[name].to_numpy() for name in names), 1.0], known["I"].to_numpy())
    for frame in runs.values():
        frame["I" + SIMULATED] = sum(f * frame[name] for f, name in zip(factors, names, strict=False)) + factors[-1]
    shown = ("U", "q", "v", "I") if names == ["U"] else ("q", "v", "I")
    kept = {name: frame[[*shown, "I" + SIMULATED]] for name, frame in runs.items()}
    return pair(kept, tuple(one for one in _CHANNELS if one.name in shown))


def _again(folder: Path, *, name: str) -> Pair:
    """The third run beside the mean of the first two, at the same times since the voltage began."""
    first, second, third = _runs(folder).values()
    rows = min(len(first), len(second), len(third))
    frame = third.iloc[:rows][["U", name]].copy()
    frame[name + SIMULATED] = np.mean([one[name].to_numpy()[:rows] for one in (first, second)], axis=0)
    return pair({"15:08": frame}, tuple(one for one in _CHANNELS if one.name in ("U", name)), "0.3")


_README = "README.md: 'Experiments were carried out in practice in a laboratory testbed'"
_READING = "means of ten rows (10 ms); angle in tenths of degrees as in the authors' script; the first second left out"

CASES = (
    RealCase(
        name="throttle/linear valve",
        kind="positive",
        build=_linear,
        model="mass, spring and damper on the voltage, fitted to two runs of a growing frequency; the third is held "
        "out",
        truth=_README + "; the valve stands still at each turn of the voltage and leaves late: flat tops (read off)",
        right=("drive.coulomb",),
        tolerated=("vibration.hysteresis", "drive.stribeck", "drive.asymmetric_friction", "drive.saturation"),
        reading=_READING,
    ),
    RealCase(
        name="throttle/spring",
        kind="positive",
        build=partial(_current, terms="v q a"),
        model="current = a x speed + spring x angle + b x acceleration + constant, fitted to two runs; the third is "
        "held out",
        truth="the current jumps by 0.5 A with the direction of motion at the same angle (read off)",
        right=("drive.coulomb",),
        tolerated=("vibration.hysteresis", "drive.stribeck", "drive.asymmetric_friction"),
        reading=_READING,
    ),
    RealCase(
        name="throttle/resistor",
        kind="positive",
        build=partial(_current, terms="U"),
        model="current = voltage / resistance + constant, fitted to two runs; the third is held out",
        truth="code/maincodeExperiments.m: the current's equation has -18.0 x speed: the motor's own voltage",
        right=("drive.viscous",),
        tolerated=("drive.mass", "drive.delay", "drive.coulomb", "drive.asymmetric_friction"),
        reading=_READING,
    ),
    RealCase(
        name="throttle/angle again",
        kind="control",
        build=partial(_again, name="q"),
        model="the mean of two runs of the same voltage; the last 30 % of the third are held out",
        truth="the same voltage to the last digit three times (read off)",
        verdicts=SILENT,
        reading=_READING,
    ),
    RealCase(
        name="throttle/current again",
        kind="control",
        build=partial(_again, name="I"),
        model="the mean of two runs of the same voltage; the last 30 % of the third are held out",
        truth="the same voltage to the last digit three times (read off)",
        verdicts=SILENT,
        reading=_READING,
    ),
)
