"""A heated box with a fan; its lid is opened, water is put in, a fungus grows."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from numba import njit
from scipy.optimize import least_squares

from benchmarks.real.case import SIMULATED, Pair, RealCase, Vector, pair, thinned
from selector.recording import Channel

_DATA = "software/incubator/datasets"
_SEMI_RANDOM = "20200918_calibration_fan_24V/semi_random_movement.csv"
_LID = "20210321_lid_opening_7pmodel/lid_opening_experiment_mar_2021.csv"
_LID_BEFORE = "20210122_lid_opening_kalman/lid_opening_experiment_jan_2021.csv"
_EMPTY = "20230501_calibration_empty_system/20230501_calibration_empty_system.csv"
_TEMPEH = "20230501_tempeh_batch/rec_2023-05-01__08_09_06.csv"
_HOUR_S = 3600.0
_CHANNELS = (
    Channel("heater", "state", "1", place="heater on"),
    Channel("room", "ambient", "degC", place="room beside the box"),
    Channel("T", "temperature", "degC", place="air in the box, mean of two"),
)


def _read(path: Path, room: str) -> pd.DataFrame:
    raw = pd.read_csv(path)
    raw = raw[np.r_[True, np.diff(raw["time"]) > 0]]
    per_s = 1e9 if raw["time"].iloc[0] > 1e12 else 1.0
    inside = [name for name in ("t1", "t2", "t3") if name != room]
    columns = {"heater": raw["heater_on"].astype(np.float64), "room": raw[room], "T": raw[inside].mean(axis=1)}
    seconds = (raw["time"] - raw["time"].iloc[0]) / per_s
    return pd.DataFrame(columns).set_axis(pd.Index(seconds.to_numpy(dtype=np.float64), name="time_s"))


def _clock_s(path: Path, clock: str) -> float:
    """Seconds from the start of a file to a time of that day in UTC + 1 h."""
    begin = pd.Timestamp(int(pd.read_csv(path, usecols=["time"])["time"].iloc[0])) + pd.Timedelta(hours=1)
    return float((pd.Timestamp(f"{begin:%Y-%m-%d} {clock}") - begin).total_seconds())


@njit(cache=True)
def _box(law, heater, room, times, air, wall):
    """Air of the box, warmed by a heater with a heat capacity of its own (law[2] > 0) or at once."""
    course = np.empty(len(times))
    for k in range(len(times)):
        course[k] = air
        if k + 1 == len(times):
            break
        step = (times[k + 1] - times[k]) / 4
        for _ in range(4):
            power = law[0] * heater[k]
            warmed = law[2] * (wall - air) if law[2] > 0.0 else power
            if law[2] > 0.0:
                wall += step * (power - law[3] * (wall - air))
            air += step * (warmed - law[1] * (air - room[k]))
    return course


def _course(law: Vector, frame: pd.DataFrame) -> Vector:
    start = float(frame["T"].iloc[0])
    columns = (frame[name].to_numpy() for name in ("heater", "room"))
    return np.asarray(_box(law, *columns, frame.index.to_numpy(), start, start))


def _fitted(frame: pd.DataFrame, *, with_heater: bool) -> Vector:
    """Power, loss and, if wanted, transfer and rate of the heater: least squares of the free run."""
    guess = np.log([0.03, 0.001, 0.01, 0.01][: 4 if with_heater else 2])

    def law(x: Vector) -> Vector:
        return np.r_[np.exp(x), np.zeros(4 - len(x))]

    left = least_squares(lambda x: _course(law(x), frame) - frame["T"].to_numpy(), guess, x_scale="jac")
    return law(left.x)


def _first(frame: pd.DataFrame, share: float) -> pd.DataFrame:
    return frame.iloc[: int(share * len(frame))]


def _one_capacity(folder: Path) -> Pair:
    frame = _read(folder / _DATA / _SEMI_RANDOM, "t1")
    frame["T" + SIMULATED] = _course(_fitted(_first(frame, 0.7), with_heater=False), frame)
    return pair({"box": frame}, _CHANNELS)


def _shut(folder: Path) -> Pair:
    frame = _read(folder / _DATA / _EMPTY, "t3")
    frame["T" + SIMULATED] = _course(_fitted(_first(frame, 0.7), with_heater=True), frame)
    return pair({"box": frame}, _CHANNELS)


def _opened(folder: Path, *, file: str, shut_until: str, until: str) -> Pair:
    path = folder / _DATA / file
    frame = _read(path, "t1")
    law = _fitted(frame[frame.index < _clock_s(path, shut_until)], with_heater=True)
    frame = frame[frame.index < _clock_s(path, until)].copy()
    frame["T" + SIMULATED] = _course(law, frame)
    return pair({"box": frame}, _CHANNELS)


def _watered(folder: Path) -> Pair:
    path = folder / _DATA / _LID
    frame = _read(path, "t1")
    law = _fitted(frame[frame.index < _clock_s(path, "13:31:00")], with_heater=True)
    frame = frame[(frame.index > _clock_s(path, "15:41:00")) & (frame.index < _clock_s(path, "16:51:00"))]
    frame = frame.set_axis(frame.index - frame.index[0])
    frame["T" + SIMULATED] = _course(law, frame)
    return pair({"with water": frame}, _CHANNELS)


def _tempeh(folder: Path) -> Pair:
    law = _fitted(_read(folder / _DATA / _EMPTY, "t3"), with_heater=True)
    frame = _read(folder / _DATA / _TEMPEH, "t3")
    frame["T" + SIMULATED] = _course(law, frame)
    return pair({"batch": thinned(frame, 10)}, _CHANNELS)


_OPENED = "a box with a heater of its own capacity, fitted while the lid was shut; the last 30 % are held out"

CASES = (
    RealCase(
        name="incubator/one capacity",
        kind="positive",
        build=_one_capacity,
        model="two parameters: heat capacity and loss of the box, fitted to the first 70 %; the rest is held out",
        truth="README.md of the folder: 'the second takes into account the heat capacity of the heater itself as well'",
        right=("thermal.memory",),
        tolerated=("thermal.second_source", "thermal.convection"),
        reading="3 s",
    ),
    RealCase(
        name="incubator/lid",
        kind="positive",
        build=partial(_opened, file=_LID, shut_until="13:31:00", until="15:13:00"),
        model=_OPENED,
        truth="README.md of the folder: '13:31:00 open', '13:33:40 close' and three more",
        right=("thermal.convection",),
        tolerated=("thermal.ambient",),
        verdicts=("unexplained",),
        reading="3 s; up to 15:13, before water was put in",
    ),
    RealCase(
        name="incubator/lid before",
        kind="positive",
        build=partial(_opened, file=_LID_BEFORE, shut_until="15:59:58", until="16:20:00"),
        model=_OPENED,
        truth="README.md of the folder: '1st open lid on 15:59:58', '2nd open lid on 16:09:19'",
        right=("thermal.convection",),
        tolerated=("thermal.ambient",),
        verdicts=("unexplained",),
        reading="3 s, 467 rows",
    ),
    RealCase(
        name="incubator/water",
        kind="positive",
        build=_watered,
        model=_OPENED,
        truth="README.md of the folder: '15:13:30 open and added a cup of water'",
        right=("thermal.memory",),
        tolerated=("thermal.convection", "thermal.second_source"),
        reading="3 s, 15:41 to 16:51",
    ),
    RealCase(
        name="incubator/tempeh",
        kind="positive",
        build=_tempeh,
        model="the same, fitted to the empty box; the last 30 % of 22 h are held out",
        truth="README.md of the folder: 'After the fungus starts to grow'; the heater is off from 11.2 h on and the "
        "box stays 11 K above the room (read off)",
        right=("thermal.second_source",),
        tolerated=("thermal.memory", "thermal.convection"),
        verdicts=("unexplained",),
        reading="means of ten rows (3 s); the room is t3 here, in the others t1",
    ),
    RealCase(
        name="incubator/shut",
        kind="control",
        build=_shut,
        model="the same, fitted to the first 70 % of the empty box; the rest is held out",
        truth="name of the folder: calibration, empty system",
        tolerated=("thermal.memory",),
        verdicts=("nothing-missing", "miscalibrated"),
        reading="3 s",
    ),
)
