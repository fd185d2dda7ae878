"""A rotor rig with faults made on purpose: more damping, a lateral load, a vibration."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, Vector, least_squares, pair, thinned
from selector.recording import Channel

HEALTHY = tuple(f"Healthy Mode/merged_data{k}.csv" for k in (104, 108, 112, 116, 120, 124, 128))
"""At 300, 250, 100, 180, 200, 150 and 300: what the simulation of the effort is fitted to."""
_LEFT_OUT = 3
_LEVEL_S = 2.0
"""The level differs from run to run with the charge of the battery: it is taken from the start of each."""
_CHANNELS = (
    Channel("command", "velocity", "m/s", place="commanded speed of the shaft, unit not stated"),
    Channel("speed", "velocity", "m/s", place="encoder of the shaft, unit not stated", axis="C"),
    Channel("effort", "voltage", "V", place="drive of the shaft, PWM in percent as volts", axis="C"),
)
_SHAKEN = (
    Channel("speed", "spindle_speed", "rpm", place="encoder of the shaft"),
    Channel("az", "acceleration", "m/s^2", place="on the shaft"),
)
_READING = "effort and speed as volts and m/s (their units are not stated); means of two rows of "
"15 to 16 ms by the clock of the host"


def _read(path: Path) -> pd.DataFrame:
    raw = pd.read_csv(path, skipinitialspace=True).iloc[_LEFT_OUT:]
    raw.columns = raw.columns.str.strip()
    raw = raw[np.r_[True, np.diff(raw["Time"]) > 0]]
    columns = {"command": "Desired Speed", "speed": "Actual Speed", "effort": "Shaft Control Effort", "az": "LinAcc. z"}
    time_s = 1e-3 * (raw["Time"] - raw["Time"].iloc[0])
    return pd.DataFrame({name: raw[of] for name, of in columns.items()}).set_axis(pd.Index(time_s, name="time_s"))


def _beside_healthy(folder: Path, *, files: tuple[str, ...]) -> Pair:
    healthy = pd.concat([_read(folder / name) for name in HEALTHY])
    factors = least_squares([healthy["command"].to_numpy(), 1.0], healthy["effort"].to_numpy())
    runs = {Path(name).stem: thinned(_read(folder / name), 2) for name in files}
    for frame in runs.values():
        frame["effort" + SIMULATED] = factors[0] * frame["command"] + factors[1]
    return pair(runs, _CHANNELS)


def _shaken(folder: Path, *, files: tuple[str, ...]) -> Pair:
    runs = {Path(name).stem: _read(folder / name) for name in files}
    fitted = pd.concat([_read(folder / name) for name in HEALTHY])
    level = float(np.mean(fitted["az"]))
    for frame in runs.values():
        frame["az" + SIMULATED] = np.full(len(frame), level)
    return pair(runs, _SHAKEN)


def _same_speed(folder: Path, *, files: tuple[str, ...], fitted: int) -> Pair:
    """The effort of healthy runs at one speed beside a law of the control's error, from its level at the start."""
    runs = {Path(name).stem: thinned(_read(folder / name), 2) for name in files}
    levels = [float(frame["effort"][frame.index < _LEVEL_S].mean()) for frame in runs.values()]
    known = list(zip(runs.values(), levels, strict=True))[:fitted]
    error = np.concatenate([_error(frame) for frame, _ in known])
    (slope,) = least_squares([error], np.concatenate([frame["effort"].to_numpy() - level for frame, level in known]))
    for frame, level in zip(runs.values(), levels, strict=True):
        frame["effort" + SIMULATED] = slope * _error(frame) + level
    return pair(runs, _CHANNELS)


def _error(frame: pd.DataFrame) -> Vector:
    return (frame["speed"] - frame["command"]).to_numpy(dtype=np.float64)


def _files(mode: str, numbers: tuple[int, ...]) -> tuple[str, ...]:
    return tuple(f"{mode}/merged_data{k}.csv" for k in numbers)


_FITTED = "effort = a x commanded speed + b, fitted to seven healthy runs at 100 to 300; the last run is held out"

CASES = (
    RealCase(
        name="rosa/damped",
        kind="positive",
        build=partial(_beside_healthy, files=_files("Manual D Mode", (400, 408, 417, 421, 429, 433))),
        model=_FITTED,
        truth="README.md: 'External damper motor resistance (15ohm is regular operating condition)'; 3 to 12 ohm here, "
        "changed by hand within the runs",
        right=("drive.viscous", "drive.varying_damping"),
        tolerated=("drive.coulomb", "drive.mass"),
        verdicts=("unexplained",),
        reading=_READING,
    ),
    RealCase(
        name="rosa/pressed",
        kind="positive",
        build=partial(_beside_healthy, files=_files("Manual N Mode", (200, 208, 216, 220, 224))),
        model=_FITTED,
        truth="README.md: 'Lateral force reading introduced to the plant', 4 to 17 by hand within the runs: it rubs",
        right=("drive.coulomb", "drive.offset_force"),
        tolerated=("drive.viscous", "drive.mass"),
        verdicts=("unexplained",),
        reading=_READING,
    ),
    RealCase(
        name="rosa/shaken",
        kind="positive",
        build=partial(_shaken, files=_files("MC-generated V Mode", (300, 304, 312))),
        model="the mean acceleration of seven healthy runs",
        truth="README.md: 'V-mode is the vibration frequency', of a programme with steps, 5 to 25 Hz",
        right=("vibration.line", "vibration.imbalance"),
        tolerated=("vibration.mode",),
        verdicts=("unexplained",),
        reading="acceleration along z of the shaft's sensor, which turns with it: imbalance and weight show, too; "
        "speed in r/min, as the sensor's own speed of turning says",
    ),
    RealCase(
        name="rosa/healthy250",
        kind="control",
        build=partial(_same_speed, files=_files("Healthy Mode", (42, 46, 67, 71, 108)), fitted=4),
        model="effort = a x (speed - command) + the mean of the run's first 2 s, fitted to four runs at 250; the fifth "
        "is held out",
        truth="README.md: 'Healthy mode'; the same command in all runs",
        verdicts=("nothing-missing", "miscalibrated"),
        reading=_READING,
    ),
    RealCase(
        name="rosa/healthy300",
        kind="control",
        build=partial(_same_speed, files=_files("Healthy Mode", (104, 128, 132)), fitted=2),
        model="the same, fitted to two runs at 300; the third is held out",
        truth="README.md: 'Healthy mode'; the same command in all runs",
        verdicts=("nothing-missing", "miscalibrated"),
        reading=_READING,
    ),
)
