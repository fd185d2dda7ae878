"""Recordings that the program was made with: a drive, an oscillator, two tanks, a lathe, a spindle."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import Pair, RealCase
from selector.proof.real.emps import Law, emps
from selector.proof.real.regressed import ace_thermal
from selector.proof.real.tables import cascaded_tanks, silverbox
from selector.recording import Channel, Recording

_FRICTION = ("drive.viscous", "drive.stribeck")
_SPINDLE_KEPT = 6


def _every(given: Recording, n: int) -> Recording:
    tables = {
        run: pd.DataFrame(given.values(run, given.names), columns=list(given.names)).set_axis(
            pd.Index(given.time_s(run), name="time_s")
        )
        for run in given.runs
    }
    return Recording.from_runs({run: table.iloc[::n] for run, table in tables.items()}, given.channels)


def _emps(_: Path, *, law: Law, runs: tuple[str, ...] = ("nominal", "pulses")) -> Pair:
    return Pair(*(_every(one, 2 * len(runs)) for one in emps(law, runs)))


def _silverbox(folder: Path, *, cubic: bool) -> Pair:
    return Pair(*(_every(one, 4) for one in silverbox(folder, cubic=cubic)))


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
        reading="one row of 16 (1 ms)",
    ),
    RealCase(
        name="emps/symmetric",
        kind="positive",
        build=partial(_emps, law="symmetric"),
        model="the same with dry friction alike in both directions",
        truth=_TRUTH,
        right=("drive.asymmetric_friction",),
        tolerated=("drive.elasticity", "drive.delay", "drive.coulomb", *_FRICTION),
        reading="one row of 16 (1 ms)",
    ),
    RealCase(
        name="emps/pulses",
        kind="positive",
        build=partial(_emps, law="by direction", runs=("pulses",)),
        model="friction by direction, fitted to the nominal record; the last 30 % of the one with pulses are held out",
        truth=_TRUTH,
        right=("drive.elasticity", "drive.delay", "drive.mass"),
        tolerated=("drive.coulomb", *_FRICTION),
        reading="one row of eight (1 ms)",
    ),
    RealCase(
        name="silverbox/linear",
        kind="positive",
        build=partial(_silverbox, cubic=False),
        model="the best linear oscillator of second order on four multisines; the arrow is held out",
        truth=_TRUTH,
        right=("vibration.hardening",),
        reading="one row of four (610 Hz)",
    ),
    RealCase(
        name="silverbox/cubic",
        kind="control",
        build=partial(_silverbox, cubic=True),
        model="the best one with a cubic spring; 0.6 % of the swing is left",
        truth=_TRUTH,
        verdicts=("nothing-missing", "miscalibrated"),
        reading="one row of four (610 Hz)",
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
