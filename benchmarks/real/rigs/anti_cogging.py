"""A brushless motor turned at one revolution a second, with and without a table against cogging."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, pair, thinned
from selector.recording import Channel

_DATA = "codes/Testing/speed_data"
_SMOOTH_S = {"speed_test": 8.2, "speed_test_old": 8.2, "speed_test1": 15.2}
"""From here on the motor turns steadily; before it sticks and jumps, whatever the flag is."""
_MEAN_OF = 8
_CHANNELS = (
    Channel("angle", "position", "m", place="shaft, angle as travel at a lever of 1 m", axis="C"),
    Channel("speed", "velocity", "m/s", place="shaft, at the same lever", axis="C"),
    Channel("Iq", "current", "A", place="motor", axis="C"),
)


def _steady(folder: Path) -> Pair:
    runs = {}
    for name, begin_s in _SMOOTH_S.items():
        raw = pd.read_csv(folder / _DATA / f"{name}.txt", skipinitialspace=True)
        raw = raw[raw["Time"] > begin_s].drop_duplicates("Time")
        columns = {"angle": raw["Position"], "speed": raw["Velocity"], "Iq": raw["Iq"]}
        index = pd.Index(raw["Time"], name="time_s")
        runs[name] = thinned(pd.DataFrame(columns).set_axis(index), _MEAN_OF)
    current = float(np.mean([runs[name]["Iq"].mean() for name in ("speed_test", "speed_test_old")]))
    for frame in runs.values():
        frame["Iq" + SIMULATED] = np.full(len(frame), current)
    return pair(runs, _CHANNELS, "speed_test1")


CASES = (
    RealCase(
        name="anti_cogging/steady",
        kind="positive",
        build=_steady,
        model="at a constant speed a constant current, fitted to two records of 8 s; the one of 15 s with the flag the "
        "other way is held out",
        truth="README.md: 'Compensating the cogging torques of a brushless motor'; orders 12, 18, 24, 36 of a turn in "
        "the current (read off)",
        right=("drive.ripple",),
        tolerated=("drive.stribeck",),
        reading="the part of each record in which the motor turns steadily; means of eight rows (1 ms)",
    ),
)
