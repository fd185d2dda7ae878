"""A brushless motor without load on an ODrive: chirps and steps of voltage, five of each."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, pair
from benchmarks.real.rigs.fourth.common import SILENT
from selector.recording import Channel

_DATA = "docs/motor_characterization_references/demo_data"
_TICKS_HZ = 8000.0
_DELAY_S = 0.0045
_CHANNELS = (
    Channel("u", "voltage", "V", place="motor", axis="C"),
    Channel("v", "velocity", "m/s", place="shaft, a turn as a metre", axis="C"),
)
_ANGLE = Channel("angle", "position", "m", place="shaft, a turn as a metre", axis="C")


def _read(folder: Path, name: str, first_s: float, last_s: float) -> pd.DataFrame:
    """Ticks, voltage, turns, turns a second; the log goes on with rows of zero ticks."""
    lines = (folder / _DATA / f"{name}.csv").read_text(encoding="utf-8").splitlines()
    rows = [line.strip(" ;").split(",")[:4] for line in lines if line.strip() and not line.startswith("%")]
    values = np.array(rows, dtype=np.float64)
    values = values[np.isfinite(values).all(axis=1)]
    values = values[: int(np.flatnonzero(values[:, 0] > 0.0)[-1]) + 1]
    values = values[np.r_[True, np.diff(values[:, 0]) > 0.0]]
    time_s = values[:, 0] / _TICKS_HZ
    kept = (time_s > first_s) & (time_s < last_s)
    index = pd.Index(time_s[kept] - time_s[kept][0], name="time_s")
    return pd.DataFrame(values[kept, 1:], columns=["u", "angle", "v"], index=index)


def _chirps(folder: Path, *, delay_s: float) -> Pair:
    runs = {f"chirp {k}": _read(folder, f"chirp{k}", 1.9, 4.0)[["u", "v"]] for k in (1, 2, 4, 5)}
    given = {name: np.interp(run.index - delay_s, run.index, run["u"]) for name, run in runs.items()}
    known = list(runs)[:3]
    gain = sum(given[name] @ runs[name]["v"] for name in known) / sum(given[name] @ given[name] for name in known)
    for name, run in runs.items():
        run["v" + SIMULATED] = gain * given[name]
    return pair(runs, _CHANNELS)


def _steady(folder: Path) -> Pair:
    runs = {f"step {k}": _read(folder, f"step{k}", 2.3, 7.0) for k in (1, 2, 3, 4)}
    level = float(np.mean([run["v"].mean() for run in list(runs.values())[:3]]))
    for run in runs.values():
        run["v" + SIMULATED] = np.full(len(run), level)
    return pair(runs, (*_CHANNELS, _ANGLE))


_READING = "every 5 to 9 ms by the drive's own ticks; turns as metres"

CASES = (
    RealCase(
        name="odrive_chirp/no lag",
        kind="positive",
        build=partial(_chirps, delay_s=0.0),
        model="speed proportional to voltage, fitted to three chirps up to 2 s after their start; a fourth is held out",
        truth="the speed is 4.5 ms late (read off)",
        right=("data.clock", "drive.delay"),
        tolerated=("gauging.lag", "drive.mass", "drive.elasticity"),
        verdicts=("miscalibrated",),
        reading=_READING,
    ),
    RealCase(
        name="odrive_chirp/steady",
        kind="positive",
        build=_steady,
        model="one speed at 0.25 V, the mean of three runs; a fourth is held out",
        truth="it goes up and down six times a turn (read off)",
        right=("drive.ripple", "vibration.line"),
        tolerated=("vibration.imbalance", "drive.pitch_error", "vibration.mode"),
        reading=_READING,
    ),
    RealCase(
        name="odrive_chirp/late",
        kind="control",
        build=partial(_chirps, delay_s=_DELAY_S),
        model="as `no lag`, with the 4.5 ms",
        truth="nothing is left out that matters",
        tolerated=("data.clock", "drive.delay"),
        verdicts=SILENT,
        reading=_READING,
    ),
)
