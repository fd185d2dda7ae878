"""Recordings that the program was made with: a drive, an oscillator, two tanks, a lathe, a spindle."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import Pair, RealCase, thinned
from proving_ground.real.emps import Law, emps
from proving_ground.real.regressed import ace_thermal
from proving_ground.real.tables import cascaded_tanks, silverbox
from selector.recording import Channel, Recording

_FRICTION = ("drive.viscous", "drive.stribeck")
_ROWS = {"multisine 1": 2500, "multisine 2": 2500, "multisine 3": 2500, "arrow": 2500}
_SPINDLE_KEPT = 6


def _tables(given: Recording) -> dict[str, pd.DataFrame]:
    return {run: given.frame.loc[run] for run in given.runs}


def _emps(_: Path, *, law: Law, runs: tuple[str, ...] = ("nominal", "pulses")) -> Pair:
    parts = emps(law, runs)
    return Pair(*(
        Recording.from_runs({run: thinned(table, 2 * len(runs)) for run, table in _tables(one).items()}, one.channels)
        for one in parts
    ))  # fmt: skip


def _silverbox(folder: Path, *, cubic: bool) -> Pair:
    """The last rows of some runs, at the full rate: the oscillator answers up to a third of it."""
    parts = silverbox(folder, cubic=cubic)
    kept = [{run: _tables(one)[run].iloc[-rows:] for run, rows in _ROWS.items()} for one in parts]
    begun = [{run: part.set_axis(part.index - part.index[0]) for run, part in of.items()} for of in kept]
    return Pair(*(Recording.from_runs(of, one.channels) for of, one in zip(begun, parts, strict=True)))


def _tanks(folder: Path) -> Pair:
    return Pair(*cascaded_tanks(folder))


def _ace(folder: Path) -> Pair:
    return Pair(*ace_thermal(folder))


def _spindle(folder: Path) -> Pair:
    raw = pd.read_excel(folder / "data.xlsx", engine="calamine").iloc[::_SPINDLE_KEPT]
    raw.columns = [str(name).split("(")[0].strip() for name in raw.columns]
    near = ("t5", "t9")
    warm = tuple(f"t{k}" for k in range(1, 16))
    channels = (
        Channel("spindle", "spindle_speed", "rpm"),
        *(Channel(name, "temperature", "degC") for name in warm),
        Channel("t16", "ambient", "degC", place="looks like the air of the hall"),
        Channel("ch3", "displacement", "um", place="probe, with ch4 one direction", axis="Y"),
    )
    frame = pd.DataFrame({one.name: raw[one.name].to_numpy(dtype=np.float64) for one in channels})
    frame.index = pd.Index(raw.iloc[:, 0].to_numpy(dtype=np.float64), name="time_s")
    recording = Recording.from_runs({"46 h": frame}, channels)
    trained = Recording.from_runs({"46 h": frame.iloc[: int(0.7 * len(frame))]}, channels)
    law = _law(trained, near)
    simulated = pd.DataFrame(
        {"ch3": np.column_stack([np.ones(len(frame)), frame[list(near)]]) @ law}, index=frame.index
    )
    return Pair(recording, Recording.from_runs({"46 h": simulated}, channels[-1:]))


def _law(trained: Recording, near: tuple[str, ...]) -> np.ndarray:
    columns = np.column_stack([np.ones(len(trained.frame)), trained.values("46 h", near)])
    return np.linalg.lstsq(columns, trained.values("46 h", ("ch3",))[:, 0], rcond=None)[0]


_TRUTH = "docs/explanation/real-recordings.md"

CASES = (
    RealCase(
        name="emps/viscous",
        kind="positive",
        build=partial(_emps, law="viscous"),
        model="the drive's loop with mass, viscous friction and a constant force; the record with pulses is held out",
        truth=_TRUTH,
        right=("drive.coulomb",),
        tolerated=("drive.asymmetric_friction", *_FRICTION),
        reading="means of four rows of 4 ms",
    ),
    RealCase(
        name="emps/symmetric",
        kind="positive",
        build=partial(_emps, law="symmetric"),
        model="the same with dry friction alike in both directions",
        truth=_TRUTH,
        right=("drive.asymmetric_friction",),
        tolerated=("drive.elasticity", "drive.delay", "drive.coulomb", *_FRICTION),
        reading="means of four rows of 4 ms",
    ),
    RealCase(
        name="emps/pulses",
        kind="positive",
        build=partial(_emps, law="by direction", runs=("pulses",)),
        model="friction by direction, fitted to the nominal record; the last 30 % of the one with pulses are held out",
        truth=_TRUTH,
        right=("drive.elasticity", "drive.delay", "drive.mass"),
        tolerated=("drive.coulomb", *_FRICTION),
        reading="means of two rows of 4 ms",
    ),
    RealCase(
        name="silverbox/linear",
        kind="positive",
        build=partial(_silverbox, cubic=False),
        model="the best linear oscillator of second order on four multisines; the end of the arrow is held out",
        truth=_TRUTH,
        right=("vibration.hardening",),
        reading="610 Hz; the last 2500 rows of three multisines and of the arrow",
    ),
    RealCase(
        name="silverbox/cubic",
        kind="control",
        build=partial(_silverbox, cubic=True),
        model="the best one with a cubic spring; 0.6 % of the swing is left",
        truth=_TRUTH,
        verdicts=("nothing-missing", "miscalibrated"),
        reading="610 Hz; the last 2500 rows of three multisines and of the arrow",
    ),
    RealCase(
        name="cascaded_tanks/brims",
        kind="positive",
        build=_tanks,
        model="outflow by the square root and no brims, fitted to the estimation record; the validation is held out",
        truth=_TRUTH,
        right=("flow.overflow",),
    ),
    RealCase(
        name="ace_thermal/regression",
        kind="positive",
        build=_ace,
        model="regression on six thermometers, fitted to seventeen days; the eighteenth is held out",
        truth=_TRUTH + ": what separates the days was not recorded",
        verdicts=("unexplained",),
        reading="no clock: a row is taken as 60 s",
    ),
    RealCase(
        name="spindle46/near",
        kind="positive",
        build=_spindle,
        model="regression of one probe on the two thermometers near the spindle, fitted to the first 70 %",
        truth="SOURCE.txt beside the data: 'the hall cools at night: Y moves by tens of um while the spindle stands'",
        right=("thermal.ambient",),
        tolerated=("thermal.memory", "thermal.coolant", "thermal.speed_heating", "thermal.second_source"),
        reading="one row of six (15 s)",
    ),
)
