"""A tower of five storeys for tests, shaken by a hybrid mass damper on its top with white noise."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, Vector, least_squares, pair
from benchmarks.real.rigs.fifth.common import over
from benchmarks.real.rigs.seventh.common import resonance
from selector.recording import Channel

_STEP_S, _MEANS, _ROWS = 0.05, 5, 4096
_COLUMNS = {"damper": (1, 9.8), "fourth": (3, 2.0), "second": (5, 1.0)}
"""Column and m/s2 a volt, as in the author's programs."""
_FIRST = (0.523, 0.015)


def _read(folder: Path, number: int, floor: str) -> pd.DataFrame:
    raw = np.loadtxt(folder / f"wn_0{number}.dat")
    raw = (raw - raw.mean(axis=0))[: _ROWS * _MEANS].reshape(-1, _MEANS, raw.shape[1]).mean(axis=1)
    columns = {name: raw[:, _COLUMNS[of][0]] * _COLUMNS[of][1] for name, of in (("a", floor), ("damper", "damper"))}
    return over(pd.DataFrame(columns), _STEP_S)


def _noise(folder: Path, floor: str, *, swinging: bool) -> Pair:
    runs = {f"noise {k}": _read(folder, k, floor) for k in (1, 2, 3)}
    shapes = {name: _shapes(run, swinging=swinging) for name, run in runs.items()}
    known = list(runs)[:-1]
    parts = zip(*(shapes[name] for name in known), strict=True)
    target = np.concatenate([runs[name]["a"].to_numpy() for name in known])
    factors = least_squares([np.concatenate(part) for part in parts], target)
    for name, run in runs.items():
        run["a" + SIMULATED] = sum(factor * shape for factor, shape in zip(factors, shapes[name], strict=True))
    return pair(
        runs,
        (
            Channel("a", "acceleration", "m/s^2", place=f"{floor} floor", axis="X"),
            Channel("damper", "acceleration", "m/s^2", place="mass of the damper", axis="X"),
        ),
    )


def _shapes(run: pd.DataFrame, *, swinging: bool) -> tuple[Vector, ...]:
    """A share of the damper's acceleration, or what one mode makes of it as a force."""
    damper = run["damper"].to_numpy()
    if not swinging:
        return (damper,)
    deflection, _ = resonance(damper, *_FIRST, _STEP_S)
    return deflection, np.gradient(np.gradient(deflection, _STEP_S), _STEP_S)


_READING = "10 ms a row, means over five; the first 205 s of each record, less their mean"
_TOLERATED = ("vibration.line", "vibration.back_reaction", "drive.elasticity", "vibration.hardening")

CASES = (
    RealCase(
        name="office_tower/fourth floor",
        kind="positive",
        build=partial(_noise, floor="fourth", swinging=False),
        model="the fourth floor moves with a share of the damper's acceleration, fitted to two records; a third is "
        "held out",
        truth="the tower swings at 0.52 Hz (the author's subject: its modes)",
        right=("vibration.mode",),
        tolerated=_TOLERATED,
        reading=_READING,
    ),
    RealCase(
        name="office_tower/second floor",
        kind="positive",
        build=partial(_noise, floor="second", swinging=True),
        model="the second floor with the mode at 0.52 Hz, fitted to two records; a third is held out",
        truth="its second mode at 1.8 Hz is strongest there (the author's subject: its modes)",
        right=("vibration.mode",),
        tolerated=_TOLERATED,
        verdicts=("unexplained",),
        reading=_READING,
    ),
)
