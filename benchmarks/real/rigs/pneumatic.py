"""Pneumatic cylinders with printed seals, drawn out and in at a set pressure: the force beside area times pressure."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, Vector, least_squares, pair, thinned
from selector.recording import Channel

_DATA = "results_pneumatic-actuator/data"
_SKIPPED = 15
_MEAN_OF = 8
_BINS = 60
_SLOW_M_PER_S = 2e-3
_CHANNELS = (
    Channel("s", "position", "m", place="laser, travel of the rod", axis="X"),
    Channel("F", "force", "N", place="load cell", axis="X"),
)
_TRUTH = (
    "results_pneumatic-actuator/README.md: 'dynamic sliding friction force', 10 strokes a file; the notebook there "
    "takes friction from the forces out and in"
)
_LAW = ("drive.asymmetric_friction", "drive.stribeck", "vibration.hysteresis")


def _read(path: Path) -> pd.DataFrame:
    raw = pd.read_csv(path, sep=r"\s+", header=None).iloc[_SKIPPED:]
    columns = {"s": 1e-3 * raw[4], "p": raw[5], "F": raw[6]}
    frame = pd.DataFrame(columns).set_axis(pd.Index(1e-3 * (raw[0] - raw[0].iloc[0]), name="time_s"))
    return thinned(frame, _MEAN_OF)


def _seal(folder: Path, *, seal: str, bars: tuple[int, ...], held_out: int) -> Pair:
    runs = {f"{bar} bar": _read(folder / _DATA / "friction" / f"{seal}_{bar}bar.csv") for bar in bars}
    fitted = pd.concat([frame for run, frame in runs.items() if run != f"{held_out} bar"])
    (area,) = least_squares([fitted["p"].to_numpy()], fitted["F"].to_numpy())
    for frame in runs.values():
        frame["F" + SIMULATED] = area * frame["p"]
    return pair(runs, _CHANNELS, f"{held_out} bar")


def _speed(frame: pd.DataFrame) -> Vector:
    return np.gradient(frame["s"].to_numpy(), frame.index.to_numpy())


def _repeated(folder: Path, *, first: str, others: tuple[str, ...], held_out: str) -> Pair:
    """Force over pressure of one file by place and direction, times the pressure of the others."""
    tabled = _read(folder / _DATA / "repeatability" / first)
    runs = {Path(name).stem: _read(folder / _DATA / "repeatability" / name) for name in others}
    for frame in runs.values():
        frame["F" + SIMULATED] = frame["p"] * _by_place(tabled, frame)
    return pair(runs, _CHANNELS, held_out)


def _by_place(tabled: pd.DataFrame, frame: pd.DataFrame) -> Vector:
    course = np.full(len(frame), np.nan)
    ratio, speed, asked = (tabled["F"] / tabled["p"]).to_numpy(), _speed(tabled), _speed(frame)
    for sign in (1.0, -1.0):
        rows = sign * speed > _SLOW_M_PER_S
        edges = np.linspace(*np.quantile(tabled["s"], [0.01, 0.99]), _BINS + 1)
        counts = np.histogram(tabled["s"][rows], edges)[0]
        sums = np.histogram(tabled["s"][rows], edges, weights=ratio[rows])[0]
        seen = counts > 0
        middle = (0.5 * (edges[1:] + edges[:-1]))[seen]
        there = sign * asked > _SLOW_M_PER_S
        course[there] = np.interp(frame["s"].to_numpy()[there], middle, sums[seen] / counts[seen])
    return course


def _positive(seal: str, bars: tuple[int, ...], held_out: int) -> RealCase:
    fitted = ", ".join(str(bar) for bar in bars if bar != held_out)
    return RealCase(
        name=f"pneumatic/{seal}",
        kind="positive",
        build=partial(_seal, seal=seal, bars=bars, held_out=held_out),
        model=f"force = area x pressure, without friction; area fitted at {fitted} bar, {held_out} bar held out",
        truth=_TRUTH,
        right=("drive.coulomb",),
        tolerated=_LAW,
        reading="means of eight rows (10 ms); the first 15 rows deviate and are left out",
    )


def _control(name: str, first: str, others: tuple[str, ...], held_out: str, tolerated: tuple[str, ...]) -> RealCase:
    return RealCase(
        name=f"pneumatic/{name}",
        kind="control",
        build=partial(_repeated, first=first, others=others, held_out=held_out),
        model=f"force by place and direction in {first}, scaled with the pressure; {held_out} held out",
        truth="the same actuator and seal again; forces agree to 0.1 to 3 N (read off)",
        tolerated=tolerated,
        verdicts=("nothing-missing", "miscalibrated"),
        reading="as the positives; rows slower than 2 mm/s have no simulation",
    )


CASES = (
    _positive("O-ring257", (1, 3, 7, 5), 5),
    _positive("Kidney", (1, 2, 4, 3), 3),
    _positive("KDN", (1, 3, 7, 5), 5),
    _positive("X-ring257", (1, 3, 7, 5), 5),
    _control(
        "rerun",
        "rerun/friction/1_O-ring257_3bar.csv",
        ("rerun/friction/2_O-ring257_3bar.csv", "rerun/friction/3_O-ring257_3bar.csv"),
        "3_O-ring257_3bar",
        (),
    ),
    _control(
        "reconnected",
        "rerun/friction/3_O-ring257_5bar.csv",
        ("reconnected/friction/1_O-ring257_5bar.csv", "reconnected/friction/3_O-ring257_5bar.csv"),
        "3_O-ring257_5bar",
        ("drive.coulomb",),
    ),
)
