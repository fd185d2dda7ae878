"""Thermometers in the shelter of a weather station, three days; the station's clock is in another time zone."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, least_squares, pair
from selector.recording import Channel

_DATA = "Sensor_Test/Temperatur_and_Humidity/Data"
_DAYS = (3, 4, 5)
_LATE_S = 7200.0
_STATION = "MET_CS215_AirTemperature_degC_Avg"
_TRUTH = (
    "Sensor_Test/Temperatur_and_Humidity/readme.md, 'Coefficients to correct temperatures': 1_BME280 +0.94, 2_BME280 "
    "+0.73, 2_HTU21D +0.45 K; slopes of AM2320 and DHT22 1.03 with -0.29 to -0.45 K"
)


def _station(folder: Path, clock_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Seconds of the loggers' clock and temperatures of the station, all days in one piece."""
    parts = [
        pd.read_csv(folder / _DATA / f"FRWRTM_MET_1min_2020-04-0{day}.csv", header=1, skiprows=[2, 3])
        for day in (*_DAYS, _DAYS[-1] + 1)
    ]
    whole = pd.concat(parts)
    return _seconds(whole["TIMESTAMP"]) + clock_s, pd.to_numeric(whole[_STATION]).to_numpy(dtype=np.float64)


def _seconds(stamps: pd.Series) -> np.ndarray:
    return (pd.to_datetime(stamps) - pd.Timestamp("2020-04-03")).dt.total_seconds().to_numpy(dtype=np.float64)


def _loggers(folder: Path, names: tuple[str, ...]) -> dict[str, pd.DataFrame]:
    runs = {}
    for day in _DAYS:
        raw = pd.read_csv(folder / _DATA / f"Ta_RH_Test-2020-04-0{day}.csv", on_bad_lines="skip").drop_duplicates(
            "Time"
        )
        columns = {_plain(name): pd.to_numeric(raw[name], errors="coerce") for name in names}
        runs[f"April {day}"] = pd.DataFrame(columns).set_axis(pd.Index(_seconds(raw["Time"]), name="time_s"))
    return runs


def _plain(name: str) -> str:
    return "T_" + name.removesuffix("_Ta")


def _zeroed(frame: pd.DataFrame) -> pd.DataFrame:
    return frame.set_axis(frame.index - frame.index[0])


def _channels(names: tuple[str, ...]) -> tuple[Channel, ...]:
    return tuple(Channel(_plain(name), "temperature", "degC", place="in the station's shelter") for name in names)


def _beside_station(folder: Path, *, names: tuple[str, ...], clock_s: float) -> Pair:
    runs = _loggers(folder, names)
    time_s, values = _station(folder, clock_s)
    for run, frame in runs.items():
        for name in names:
            frame[_plain(name) + SIMULATED] = np.interp(frame.index, time_s, values)
        runs[run] = _zeroed(frame)
    return pair(runs, _channels(names))


def _beside_sibling(folder: Path, *, name: str, sibling: str) -> Pair:
    runs = _loggers(folder, (name, sibling))
    fitted = pd.concat(list(runs.values())[:-1]).dropna()
    slope, zero = least_squares([fitted[_plain(sibling)].to_numpy(), 1.0], fitted[_plain(name)].to_numpy())
    for run, frame in runs.items():
        frame[_plain(name) + SIMULATED] = slope * frame[_plain(sibling)] + zero
        runs[run] = _zeroed(frame)
    return pair(runs, _channels((name,)))


_CLOCKED = "the station's temperature, its clock put right by two hours; the third day is held out"
_LAGS = ("gauging.lag", "thermal.memory", "data.clock")
"""Slow thermometers add one to four minutes of their own."""

CASES = (
    RealCase(
        name="station/clock",
        kind="positive",
        build=partial(_beside_station, names=("1_BME680_Ta",), clock_s=0.0),
        model="the station's temperature with its own clock; the third day is held out",
        truth="read off: the station's clock (UTC) is 120 min behind the logger's (summer time) on all days; with it "
        "the differences are those of the readme's table",
        right=("data.clock",),
        tolerated=("data.zero", "data.gain", "gauging.lag"),
        verdicts=("miscalibrated",),
    ),
    RealCase(
        name="station/zero",
        kind="positive",
        build=partial(_beside_station, names=("1_BME280_Ta", "2_BME280_Ta"), clock_s=_LATE_S),
        model=_CLOCKED,
        truth=_TRUTH,
        right=("data.zero",),
        tolerated=(*_LAGS, "data.gain"),
        verdicts=("miscalibrated",),
    ),
    RealCase(
        name="station/gain",
        kind="positive",
        build=partial(_beside_station, names=("AM2320_Ta", "2_DHT22_Ta"), clock_s=_LATE_S),
        model=_CLOCKED,
        truth=_TRUTH,
        right=("data.gain", "data.zero"),
        tolerated=_LAGS,
        verdicts=("miscalibrated",),
    ),
    RealCase(
        name="station/siblings",
        kind="control",
        build=partial(_beside_sibling, name="1_MCP9808", sibling="2_MCP9808"),
        model="slope and zero of one thermometer on another of its kind, fitted to two days; the third is held out",
        truth="the same air, sensors of one kind",
        tolerated=("gauging.lag",),
        verdicts=("nothing-missing", "miscalibrated"),
        reading="steps of 0.0625 K",
    ),
    RealCase(
        name="station/BME680",
        kind="control",
        build=partial(_beside_sibling, name="2_BME680_Ta", sibling="1_BME680_Ta"),
        model="slope and zero of one thermometer on another of its kind, fitted to two days; the third is held out",
        truth="the same air, sensors of one kind",
        tolerated=("gauging.lag",),
        verdicts=("nothing-missing", "miscalibrated"),
    ),
)
