"""A rack and its pinion, pulled once to 0.66 m/s and stopped, with the force that it needs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, pair
from benchmarks.real.rigs.fourth.common import numbers
from selector.recording import Channel

_CHANNELS = (
    Channel("F", "force", "N", place="load cell at the rack", axis="X"),
    Channel("v", "velocity", "m/s", place="rack", axis="X"),
    Channel("x", "position", "m", place="rack", axis="X"),
)


def _inertia(folder: Path) -> Pair:
    found = numbers(folder / "input/sample_workspace_4.mat")
    mass = found["a"] @ found["F"] / (found["a"] @ found["a"])
    run = pd.DataFrame(
        {"F": found["F"], "v": found["v"], "x": found["x"], "F" + SIMULATED: mass * found["a"]},
        index=pd.Index(found["t"] - found["t"][0], name="time_s"),
    )
    return pair({"pull": run.astype(np.float64)}, _CHANNELS, "0.3")


CASES = (
    RealCase(
        name="rack_pinion/inertia",
        kind="positive",
        build=_inertia,
        model="a mass, fitted to the whole stroke; its last 30 % are held out",
        truth="a dry friction and one that grows with the speed, which the authors fit",
        right=("drive.coulomb", "drive.viscous"),
        tolerated=("drive.asymmetric_friction", "drive.stribeck", "drive.offset_force", "drive.mass"),
        reading="force and speed as the authors filtered and put them on one clock",
    ),
)
