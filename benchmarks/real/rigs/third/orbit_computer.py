"""A small computer under load, on the ground and in a satellite in orbit."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, Vector, pair, thinned
from benchmarks.real.rigs.third.common import fitted, lagged
from selector.recording import Channel

_DATA = "Temperature-HeatingRate/Data"
_GROUND = {f"load {k}": f"{_DATA}/gnd_pi_stress_and_infer/pi_stress_lv{k}_5.5V.csv" for k in (1, 2, 4, 3)}
_ORBIT = {f"{k} cores": f"{_DATA}/sat_pi_stress_and_infer/PiA_Sun_{k}C_StressTest_180.csv" for k in (1, 2, 3)}
_T = Channel("T", "temperature", "degC", place="chip of the computer")
_I = Channel("I", "current", "A", place="computer")
_SUN = Channel("sun", "current", "A", place="solar panel of the satellite")


def _read(path: Path, columns: dict[str, str], mean_of: int) -> pd.DataFrame:
    raw = pd.read_csv(path)
    times = raw["TIME"].to_numpy(dtype=np.float64)
    frame = pd.DataFrame({new: raw[old].to_numpy(dtype=np.float64) for new, old in columns.items()})
    frame = frame.set_axis(pd.Index(times - times[0], name="time_s"))[np.r_[True, np.diff(times) > 0.0]]
    for name in set(columns) & {"I", "sun"}:
        frame[name] /= 1000.0
    return thinned(frame, mean_of)


def _warm(x: Vector, frame: pd.DataFrame) -> Vector:
    """Temperature without current, kelvin per ampere, time constant [s]."""
    course = lagged(x[0] + x[1] * frame["I"].to_numpy(), frame.index.to_numpy(), x[2], float(frame["T"].iloc[0]))
    return course


def _one_lag(folder: Path, *, orbit: bool) -> Pair:
    columns = {"T": "TEMP", "I": "I_Pi-A", "sun": "MPPT1_Iin"} if orbit else {"T": "TEMP", "I": "Main(mA)"}
    runs = {name: _read(folder / path, columns, 20) for name, path in (_ORBIT if orbit else _GROUND).items()}
    law = fitted(_warm, list(runs.values())[:-1], "T", [20.0, 30.0, 300.0])
    for frame in runs.values():
        frame["T" + SIMULATED] = _warm(law, frame)
    return pair(runs, (_T, _I, _SUN) if orbit else (_T, _I))


def _cold(folder: Path) -> Pair:
    runs = {name: _read(folder / path, {"T": "TEMP", "I": "Main(mA)"}, 20) for name, path in _GROUND.items()}
    for frame in runs.values():
        frame["T" + SIMULATED] = np.full(len(frame), frame["T"].iloc[0])
    return pair(runs, (_T, _I))


_READING = "means of 20 rows (20 s); mA as A"

CASES = (
    RealCase(
        name="orbit_computer/cold",
        kind="positive",
        build=_cold,
        model="it stays as warm as it was at the start; three loads on the ground, the load between is held out",
        truth="Temperature-HeatingRate/README.md: 'Generate Table 3', the heating rate by load; 14 to 30 K (read off)",
        right=("thermal.second_source",),
        tolerated=("thermal.memory", "thermal.ambient"),
        reading=_READING,
    ),
    RealCase(
        name="orbit_computer/one lag",
        kind="positive",
        build=partial(_one_lag, orbit=False),
        model="one heat capacity with one loss on the current, fitted to three loads; the load between is held out",
        truth="a second lag (10 and 330 s instead of 190 s) leaves 0.5 instead of 0.7 K (read off)",
        right=("thermal.memory",),
        tolerated=("thermal.ambient", "thermal.convection", "thermal.second_source", "gauging.lag"),
        reading=_READING,
    ),
    RealCase(
        name="orbit_computer/no sun",
        kind="positive",
        build=partial(_one_lag, orbit=True),
        model="the same in orbit, fitted to loads of one and two cores; three cores are held out",
        truth="folder Temperature-DaylightEclipse: temperature of the payload by day and eclipse; a wave of 2 to 3 K "
        "with each orbit (read off)",
        right=("thermal.second_source",),
        tolerated=("thermal.memory", "thermal.ambient"),
        reading=_READING,
    ),
)
