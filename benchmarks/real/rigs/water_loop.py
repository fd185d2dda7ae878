"""A water loop with a pump, disturbed on purpose."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, pair, thinned
from selector.recording import Channel

_NORMAL = 540
_CHANNELS = {
    "a": Channel("a", "acceleration", "m/s^2", place="pump, RMS over a second"),
    "water": Channel("water", "temperature", "degC", place="water in the loop"),
}
_OTHERS = (
    Channel("engine", "temperature", "degC", place="engine of the pump"),
    Channel("I", "current", "A", place="engine of the pump"),
    Channel("flow", "flow", "m^3/s", place="loop"),
)
_G = 9.80665
_LITRES = 1e-3 / 60.0


def _read(path: Path) -> pd.DataFrame:
    raw = pd.read_csv(path, sep=";")
    stamp = pd.to_datetime(raw["datetime"])
    columns = {
        "a": _G * raw["Accelerometer1RMS"],
        "water": raw["Thermocouple"],
        "engine": raw["Temperature"],
        "I": raw["Current"],
        "flow": _LITRES * raw["Volume Flow RateRMS"],
    }
    seconds = (stamp - stamp.iloc[0]).dt.total_seconds()
    frame = pd.DataFrame(columns).set_axis(pd.Index(seconds, name="time_s"))
    return frame[~frame.index.duplicated()]


def _beside_normal(folder: Path, *, file: str, name: str, mean_of: int = 1) -> Pair:
    frame = thinned(_read(folder / "data" / f"{file}.csv"), mean_of)
    frame[name + SIMULATED] = np.full(len(frame), frame[name].iloc[: _NORMAL // mean_of].mean())
    return pair({Path(file).name: frame}, (_CHANNELS[name], *_OTHERS))


def _case(file: str, name: str, truth: str, right: tuple[str, ...], tolerated: tuple[str, ...]) -> RealCase:
    return RealCase(
        name=f"water_loop/{file.split('/')[-1]}",
        kind="positive",
        build=partial(_beside_normal, file=file, name=name),
        model="the mean of the first nine minutes, when nothing was disturbed; the last 30 % are held out",
        truth=f"data/README.md: '{truth}'",
        right=right,
        tolerated=tolerated,
        verdicts=("unexplained",),
        reading="1 s; accelerations are root mean squares of a second, which show no line of the rotation",
    )


CASES = (
    _case("other/5", "a", "Sharply behavior of rotor imbalance", ("vibration.imbalance",), ("vibration.line",)),
    _case("other/7", "a", "Step behavior of rotor imbalance", ("vibration.imbalance",), ("vibration.line",)),
    _case(
        "other/14",
        "water",
        "Water supply of increased temperature",
        ("thermal.coolant",),
        ("thermal.second_source", "thermal.memory", "thermal.ambient"),
    ),
    RealCase(
        name="water_loop/normal",
        kind="control",
        build=partial(_beside_normal, file="anomaly-free/anomaly-free", name="a", mean_of=3),
        model="the mean of the first nine minutes; the last 30 % of 9405 s are held out",
        truth="data/README.md: 'Data obtained from the experiments with normal mode'",
        verdicts=("nothing-missing", "miscalibrated"),
        reading="means of three rows (1 s)",
    ),
)
