"""A wheel of a small robot: duty of its motor over the speed at which it turns, through standstill."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, pair
from selector.recording import Channel

_CHANNELS = (
    Channel("u", "voltage", "V", place="motor, duty of 255 as 25.5 V", axis="C"),
    Channel("v", "velocity", "m/s", place="wheel, 100 rpm as 1 m/s", axis="C"),
)


def _read(folder: Path, number: int) -> pd.DataFrame:
    raw = pd.read_csv(folder / f"matlab/data/wheelSpeedCalibration{number}.csv", skipinitialspace=True)
    raw = raw.apply(pd.to_numeric, errors="coerce").dropna()
    values = {"u": 0.1 * raw["motorCommand"].to_numpy(), "v": 0.01 * raw["leftSpeedRpm"].to_numpy()}
    return pd.DataFrame(values, index=pd.Index(1e-3 * (raw["time"] - raw["time"].iloc[0]).to_numpy(), name="time_s"))


def _proportional(folder: Path) -> Pair:
    runs = {f"sweep {number}": _read(folder, number) for number in (2, 4)}
    known = runs["sweep 2"]
    factor = known["v"] @ known["u"] / (known["v"] @ known["v"])
    for run in runs.values():
        run["u" + SIMULATED] = factor * run["v"]
    return pair(runs, _CHANNELS)


CASES = (
    RealCase(
        name="micromouse/proportional",
        kind="positive",
        build=_proportional,
        model="duty proportional to speed, fitted to a sweep of the duty; another one is held out",
        truth="the wheel stands up to a duty of 40 and gains little above 150: by the sign and the cube of the speed "
        "half of the rest (read off), for which together there is no id",
        tolerated=(
            "drive.coulomb", "drive.stribeck", "drive.asymmetric_friction", "drive.viscous", "drive.saturation",
            "drive.varying_damping",
        ),
        verdicts=("unexplained",),
        reading="a step of the duty by 5 in one or two seconds; 100 rpm as 1 m/s",
    ),
)  # fmt: skip
