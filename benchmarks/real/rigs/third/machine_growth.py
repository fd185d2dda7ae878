"""Growth of a machine over a long day: sixteen thermometers and a length; no clock was published."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, least_squares, pair, thinned
from selector.recording import Channel

_FILE = "data/thermal expansion error original.csv"
_STEP_S = 10.0
_HALL = ("T14", "T15")
_CHANNELS = (
    Channel("dL", "displacement", "um", place="length"),
    *(Channel(f"T{k}", "ambient" if f"T{k}" in _HALL else "temperature", "degC", place=f"sensor {k}")
      for k in (0, 9, 12, 14, 15)),
)  # fmt: skip


def _one_thermometer(folder: Path) -> Pair:
    raw = pd.read_csv(folder / _FILE, encoding="utf-8-sig").rename(columns={"delta L": "dL"})
    names = [one.name for one in _CHANNELS]
    frame = raw[names].astype(np.float64).set_axis(pd.Index(_STEP_S * np.arange(len(raw)), name="time_s"))
    frame = thinned(frame, 6)
    known = frame.iloc[: int(0.7 * len(frame))]
    warm = frame["T0"] - frame["T0"].iloc[0]
    factors = least_squares([warm.to_numpy()[: len(known)], 1.0], known["dL"].to_numpy())
    frame["dL" + SIMULATED] = factors[0] * warm + factors[1]
    return pair({"day": frame}, _CHANNELS, "0.3")


CASES = (
    RealCase(
        name="machine_growth/one thermometer",
        kind="positive",
        build=_one_thermometer,
        model="length = factor x rise of the first thermometer + constant, fitted to the first 70 %; the rest is held "
        "out",
        truth="lr_minitab/README.md: the best model has T0, T10, T12, T13, T14 and T15, of which the last two are the "
        "hall; the length shrinks by 3 um while the hall warms by 2 K and the machine does not (read off)",
        right=("thermal.ambient",),
        tolerated=("thermal.memory", "thermal.second_source", "thermal.interaction", "thermal.convection"),
        reading="no clock: 10 s a row are assumed; means of six rows; um are assumed",
    ),
)
