"""A servo that turns without end: its speed against the width of the pulse, passed through slowly."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, least_squares, pair
from benchmarks.real.rigs.third.common import SILENT
from selector.recording import Channel

_DATA = "Data/Optical Probe"
_RUNS = {
    "clock 1": ("Clock/Training/StepsTest_2022-09-23_092153.csv", -1.0),
    "anti 1": ("Anti-Clock/Training/StepsTest_2022-09-26_095734.csv", 1.0),
    "clock 2": ("Clock/Testing/StepsTest_2022-09-25_075743.csv", -1.0),
    "anti 2": ("Anti-Clock/Testing/StepsTest_2022-09-26_121304.csv", 1.0),
}
_CENTRE_US = 1450.0
_CHANNELS = (
    Channel("u", "voltage", "V", place="pulse of the servo, 1 us as 1 mV from its middle", axis="C"),
    Channel("v", "velocity", "m/s", place="servo, rim of 1 m", axis="C"),
)


def _read(path: Path, sign: float) -> pd.DataFrame:
    """Width of the pulse and speed, whose sign the probe does not tell, by the half that was passed through."""
    raw = pd.read_csv(path, encoding="utf-8-sig", index_col=False)
    times = raw["Time (s)"].to_numpy()
    speed = raw["Motor Optical Speed (RPM)"].to_numpy() * 2.0 * np.pi / 60.0
    width = 1e-3 * (raw["Servo 3 (µs)"].to_numpy() - _CENTRE_US)
    frame = pd.DataFrame({"u": width, "v": sign * speed}, index=pd.Index(times, name="time_s"))
    frame = frame[(sign * width >= 0.0) & np.r_[True, np.diff(times) > 1.0]]
    return frame.set_axis(pd.Index(frame.index - frame.index[0], name="time_s"))


def _runs(folder: Path) -> dict[str, pd.DataFrame]:
    return {name: _read(folder / _DATA / path, sign) for name, (path, sign) in _RUNS.items()}


def _linear(folder: Path, *, limit: float) -> Pair:
    runs = _runs(folder)
    known = pd.concat([frame[frame["u"].abs() < 0.2] for frame in list(runs.values())[:2]])
    factor = float(least_squares([known["u"].to_numpy()], known["v"].to_numpy())[0])
    for frame in runs.values():
        frame["v" + SIMULATED] = np.clip(factor * frame["u"], -limit, limit)
    return pair(runs, _CHANNELS)


def _table(folder: Path, *, side: str) -> Pair:
    """Speed by the pulse as the first run of a side has it, on steps of 10 us."""
    runs = {name: frame for name, frame in _runs(folder).items() if name.startswith(side)}
    first, second = runs.values()
    cells = first.groupby((first["u"] / 0.01).round())["v"].mean()
    second["v" + SIMULATED] = np.interp(second["u"], 0.01 * cells.index.to_numpy(), cells.to_numpy())
    return pair({f"{side} 2": second}, _CHANNELS, "0.3")


_READING = "one row in 5.5 s; rpm as m/s at 1 m; the probe tells no sign: the half of the pulse widths does"

CASES = (
    RealCase(
        name="rotation_servo/linear",
        kind="positive",
        build=partial(_linear, limit=np.inf),
        model="speed = factor x width of the pulse, fitted within 0.2 ms of the middle of one run of each side; of the "
        "second ones the last is held out",
        truth="the speed stays at 5.5 m/s beyond 0.2 to 0.3 ms (read off)",
        right=("drive.saturation",),
        tolerated=("drive.coulomb", "drive.stribeck", "drive.varying_damping", "drive.viscous"),
        reading=_READING,
    ),
    RealCase(
        name="rotation_servo/limited",
        kind="positive",
        build=partial(_linear, limit=5.4),
        model="the same with a limit of 5.4 m/s",
        truth="it stands still within 50 to 100 us of the middle: its motor has to overcome its friction (read off)",
        right=("drive.coulomb",),
        tolerated=("drive.stribeck", "drive.asymmetric_friction", "drive.viscous", "drive.saturation"),
        reading=_READING,
    ),
    RealCase(
        name="rotation_servo/clock again",
        kind="control",
        build=partial(_table, side="clock"),
        model="the speed that the first run of the side has at the same pulse; the last 30 % of the second are held "
        "out",
        truth="the same servo, passed through again two days later (read off)",
        verdicts=SILENT,
        reading=_READING,
    ),
    RealCase(
        name="rotation_servo/anti again",
        kind="control",
        build=partial(_table, side="anti"),
        model="the same on the other side",
        truth="the same servo, passed through again three hours later (read off)",
        verdicts=SILENT,
        reading=_READING,
    ),
)
