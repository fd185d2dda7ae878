"""A payload hung on a pendulum under a driven frame: three inductive gauges, once with a sine of 1 Hz, once without."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, Vector, least_squares, pair
from benchmarks.real.rigs.fifth.common import over
from benchmarks.real.rigs.third.common import SILENT, pieces
from selector.recording import Channel

_STEP_S = 0.02
_SPANS = {"first": (0.0, 60.0), "second": (60.0, 120.0), "third": (120.0, 180.0)}


def _read(folder: Path, name: str) -> pd.DataFrame:
    raw = pd.read_csv(folder / f"Medha_sum_displacements{name}.csv", comment="%").to_numpy(dtype=np.float64)
    return over(pd.DataFrame(1000.0 * raw[:, 1:4], columns=["one", "two", "three"]), _STEP_S)


def _at_rest(folder: Path, record: str, gauge: str) -> Pair:
    runs = pieces(_read(folder, record)[[gauge]], _SPANS)
    level = pd.concat(list(runs.values())[:2])[gauge].mean()
    for run in runs.values():
        run[gauge + SIMULATED] = np.full(len(run), level)
    return pair(runs, (Channel(gauge, "displacement", "um", place="gauge, 1 V as 1 mm"),))


def _with_lines(folder: Path) -> Pair:
    """Waves of 20 and of 10 Hz, of the size and phase that two thirds of the record give them."""
    runs = pieces(_read(folder, "2_20240724_171652")[["three"]], _SPANS)

    def waves(run: pd.DataFrame) -> list[Vector | float]:
        turned = [2.0 * np.pi * hertz * run.index.to_numpy() for hertz in (20.0, 10.0)]
        return [*(wave(angle) for angle in turned for wave in (np.cos, np.sin)), 1.0]

    known = list(runs.values())[:2]
    columns = [np.concatenate(column) for column in zip(*(waves(run)[:-1] for run in known), strict=True)]
    law = least_squares([*columns, 1.0], pd.concat(known)["three"].to_numpy())
    for run in runs.values():
        run["three" + SIMULATED] = sum(factor * column for factor, column in zip(law, waves(run), strict=True))
    return pair(runs, (Channel("three", "displacement", "um", place="gauge, 1 V as 1 mm"),))


_READING = "20 ms a row, a record of 180 s in three; 1 V as 1 mm"

CASES = (
    RealCase(
        name="hung_payload/driven",
        kind="positive",
        build=partial(_at_rest, record="_20240724_170336", gauge="two"),
        model="the frame is at rest; the last third is held out",
        truth="a generator drives it: 'Output 1 (on) Sine, 1.000 000 Hz' in the header of the file",
        right=("vibration.line",),
        tolerated=("vibration.mode", "data.drift", "data.zero"),
        reading=_READING,
    ),
    RealCase(
        name="hung_payload/still",
        kind="positive",
        build=partial(_at_rest, record="2_20240724_171652", gauge="three"),
        model="the frame is at rest; the last third is held out",
        truth="the third gauge has a line of 18 mV at 20 Hz and 5 mV at 10 Hz, though the generator is off (read off)",
        right=("vibration.line",),
        tolerated=("vibration.mode", "data.drift", "data.zero"),
        reading=_READING,
    ),
    RealCase(
        name="hung_payload/with its lines",
        kind="control",
        build=_with_lines,
        model="waves of 20 and 10 Hz, fitted to two thirds; the last third is held out",
        truth="noise is left, and 1 % of it are a swing at 0.77 Hz (read off)",
        verdicts=SILENT,
        reading=_READING,
    ),
)
