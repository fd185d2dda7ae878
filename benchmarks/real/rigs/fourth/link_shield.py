"""A flexible link on a servo (LinkShield) that is turned by 90 degrees once: acceleration at its end."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from scipy.optimize import least_squares as minimised

from benchmarks.real.case import SIMULATED, Pair, RealCase, Vector, pair
from benchmarks.real.rigs.fourth.common import SILENT, numbers
from benchmarks.real.rigs.third.common import pieces
from selector.recording import Channel

_STEP_S = 0.003
_SPANS = {"first": (8.7, 9.75), "second": (9.75, 10.8), "third": (10.8, 11.9)}
_END = Channel("a", "acceleration", "m/s^2", place="end of the link")
_SERVO = Channel("target", "position_command", "m", place="servo, angle as travel at a lever of 1 m")


def _read(folder: Path) -> pd.DataFrame:
    found = numbers(folder / "matlab/examples/LinkShield/resultID.mat")
    values = {"a": found["y"].astype(np.float64)[:-2], "target": np.deg2rad(found["u"].astype(np.float64)[:-2])}
    return pd.DataFrame(values, index=pd.Index(_STEP_S * np.arange(len(values["a"])), name="time_s"))


def _rigid(folder: Path) -> Pair:
    run = _read(folder)
    run["a" + SIMULATED] = np.zeros(len(run))
    return pair({"turn": run}, (_END, _SERVO), "0.3")


def _wave(law: Vector, run: pd.DataFrame) -> Vector:
    """A decaying wave of this frequency and damping, with the start that fits the run."""
    times = run.index.to_numpy()
    held = np.exp(-law[1] * times)
    shapes = np.column_stack(
        [held * np.cos(2.0 * np.pi * law[0] * times), held * np.sin(2.0 * np.pi * law[0] * times), np.ones(len(times))]
    )
    return np.asarray(shapes @ np.linalg.lstsq(shapes, run["a"].to_numpy(), rcond=None)[0])


def _one_mode(folder: Path) -> Pair:
    runs = {name: run[["a"]].copy() for name, run in pieces(_read(folder), _SPANS).items()}
    known = list(runs.values())[:2]
    law = minimised(lambda x: np.concatenate([_wave(x, run) - run["a"] for run in known]), [16.0, 0.27]).x
    for run in runs.values():
        run["a" + SIMULATED] = _wave(law, run)
    return pair(runs, (_END,))


CASES = (
    RealCase(
        name="link_shield/rigid",
        kind="positive",
        build=_rigid,
        model="a rigid link: no acceleration; the last 30 % are held out",
        truth="it rings at 16 Hz for as long as it is recorded; the authors fit this mode",
        right=("vibration.mode",),
        tolerated=("drive.elasticity", "vibration.line", "vibration.back_reaction"),
        reading="3 ms; degrees as m at 1 m",
    ),
    RealCase(
        name="link_shield/one mode",
        kind="control",
        build=_one_mode,
        model="one decaying wave for three stretches of a second, 2 s after the servo has stopped, each from its "
        "own start, fitted to two",
        truth="it rings down at 16.00 Hz, the same within 0.02 % from one stretch to the next (read off)",
        tolerated=("vibration.hardening", "vibration.hysteresis"),
        verdicts=SILENT,
        reading="3 ms",
    ),
)
