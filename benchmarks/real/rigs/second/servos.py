"""Two hobby servos: one follows commands, the other lifts weights on a pulley."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares as minimised

from benchmarks.real.case import SIMULATED, Pair, RealCase, Vector, pair, table, thinned
from selector.recording import Channel

_SET = "src/sysid/dataset/real-action-state-dataset.json"
_STEP_S = 0.02
_KNOWN = {"step 0.625": 1, "step 0.35": 3, "step back 0.5": 9, "square 0.6": 30, "triangle 0.6": 24}
_HELD = {"noise 0.6": 13}
_FOLLOWS = (
    Channel("command", "position_command", "m", place="servo, angle as travel at a lever of 1 m"),
    Channel("angle", "position", "m", place="servo, at the same lever"),
)
_LIFTS = (
    Channel("angle", "position", "m", place="servo, angle as travel at a lever of 1 m", axis="C"),
    Channel("I", "current", "A", place="servo", axis="C"),
)
_WEIGHTS = (0, 200, 350, 500)
_SKIPPED_MS = 60.0


def _lagged(tau_s: float, command: Vector, start: float) -> Vector:
    course, value = np.empty(len(command)), start
    for k, wanted in enumerate(command):
        course[k] = value
        value += (1.0 - np.exp(-_STEP_S / tau_s)) * (wanted - value)
    return course


def _follows(folder: Path) -> Pair:
    parts = json.loads((folder / _SET).read_text(encoding="utf-8"))["data"]
    runs = {}
    for name, number in {**_KNOWN, **_HELD}.items():
        command, angle = (np.ravel(np.asarray(parts[number][key], dtype=float)) for key in ("actions", "sensor_data"))
        runs[name] = table(_STEP_S * np.arange(len(angle)), command=command, angle=angle)
    known = [runs[name] for name in _KNOWN]

    def left(x: Vector) -> Vector:
        courses = [_lagged(abs(x[0]), one["command"].to_numpy(), one["angle"].iloc[0]) - one["angle"] for one in known]
        return np.concatenate(courses)

    tau_s = abs(float(minimised(left, [0.1], x_scale=0.1).x[0]))
    for frame in runs.values():
        frame["angle" + SIMULATED] = _lagged(tau_s, frame["command"].to_numpy(), float(frame["angle"].iloc[0]))
    return pair(runs, _FOLLOWS)


def _lifts(folder: Path) -> Pair:
    runs = {}
    for weight in _WEIGHTS:
        for turn in (0, 2, 4):
            rows = np.loadtxt(folder / "processed" / f"processed{weight}-{turn}.txt")
            rows = rows[np.r_[True, np.diff(rows[:, 0]) > 0]]
            kept = (rows[:, 0] > _SKIPPED_MS) & (rows[:, 1] < rows[:, 1].max() - 12)
            frame = table(1e-3 * rows[kept, 0], angle=np.deg2rad(rows[kept, 1]), I=rows[kept, 2])
            runs[f"{weight} g, {turn // 2 + 1}"] = thinned(frame, 6)
    level = float(np.mean(np.concatenate([frame["I"] for name, frame in runs.items() if name.startswith("0 g")])))
    for frame in runs.values():
        frame["I" + SIMULATED] = np.full(len(frame), level)
    return pair(runs, _LIFTS)


CASES = (
    RealCase(
        name="servo/lag",
        kind="positive",
        build=_follows,
        model="a lag of first order, fitted to steps, a square wave and a triangle; noise of the largest size is held "
        "out",
        truth="steps of 0.25 to 0.625 rad all rise at 1.5 rad/s; a lag with that limit and a delay of 44 ms leaves 10 "
        "instead of 34 mrad of the steps (read off)",
        right=("drive.saturation",),
        tolerated=("drive.delay", "drive.viscous", "drive.mass", "gauging.lag"),
        reading="20 ms; rad as m",
    ),
    RealCase(
        name="hobby_servo/load",
        kind="positive",
        build=_lifts,
        model="the mean current without a weight; runs with 0, 200, 350 g, and the last with 500 g is held out",
        truth="README.md: 'processed(weight-in-grams)'; means of 0.28, 0.54, 0.71, 0.91 A (read off)",
        right=("drive.offset_force",),
        tolerated=("data.zero", "drive.coulomb"),
        reading="the turn upwards at full speed without its first 60 ms; means of six rows (2.5 ms)",
    ),
)
