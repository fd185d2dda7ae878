"""Two load cells of a swing, hung in series and loaded with weights of 10 lb, one after the other."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, pair
from benchmarks.real.rigs.fifth.common import first_share, over
from benchmarks.real.rigs.fourth.common import SILENT, numbers
from selector.recording import Channel

_FORCE = Channel("force", "force", "N", place="first cell")
_NEWTONS = 0.00445


def _first_day(folder: Path) -> pd.DataFrame:
    counts = np.asarray(numbers(folder / "calibration/loadCellCalData.mat")["acquiredData"], dtype=np.float64)[:, 3:]
    return over(pd.DataFrame(_NEWTONS * counts, columns=["force", "other"]), 0.1)


def _second_day(folder: Path) -> pd.DataFrame:
    """Without the rows in which the converter slips."""
    counts = pd.DataFrame(np.loadtxt(folder / "calibration/LoadCellCalibrationData.txt", delimiter=",")[:, 10:12])
    usual = counts.rolling(5, center=True, min_periods=1).median()
    counts = counts[((counts - usual).abs() < 2000.0).all(axis=1)]
    return over(_NEWTONS * counts.set_axis(["force", "other"], axis=1), 0.1)


def _in_series(folder: Path, *, second: bool) -> Pair:
    run = _second_day(folder) if second else _first_day(folder)
    known = first_share(run)
    run["force" + SIMULATED] = np.polyval(np.polyfit(known["other"], known["force"], 1), run.pop("other"))
    return pair({"weights": run}, (_FORCE,))


def _other_day(folder: Path) -> Pair:
    """The law of the first day, whose weights are put on and taken off."""
    first = _first_day(folder)
    law = np.polyfit(first["other"], first["force"], 1)
    half = len(first) // 2
    runs = {
        "weights on": first.iloc[:half],
        "another day": _second_day(folder),
        "weights off": over(first.iloc[half:], 0.1),
    }
    given = {}
    for name, run in runs.items():
        given[name] = run[["force"]].assign(**{"force" + SIMULATED: np.polyval(law, run["other"])})
    return pair(given, (_FORCE,))


_COUNTS = "0.1 s a row; counts of the converter, 1000 to the pound, as newtons"
_SLIPS = f"{_COUNTS}; rows that slip by 9 N are left out"

CASES = (
    RealCase(
        name="load_cells/in series",
        kind="control",
        build=partial(_in_series, second=False),
        model="one cell by the other, with a gain and an offset fitted to the first 70 %; the rest is held out",
        truth="nothing is missing: 'the calibration factor is the same for both load cells' (the author); 0.5 to 0.9 N "
        "of 187 N are left, white, with single spikes while a weight is put on",
        verdicts=SILENT,
        reading=_COUNTS,
    ),
    RealCase(
        name="load_cells/second day",
        kind="control",
        build=partial(_in_series, second=True),
        model="the same on another day, with a gain and an offset of its own; the last 30 % are held out",
        truth="nothing is missing: 0.5 N of 58 N are left, white",
        verdicts=SILENT,
        reading=_SLIPS,
    ),
    RealCase(
        name="load_cells/another day",
        kind="positive",
        build=_other_day,
        model="one cell by the other, with the gain and the offset of the first day; its second half is held out",
        truth="on the other day the cells stand 10 N apart: they are not tared ('also remove offsets', the author)",
        right=("data.zero",),
        tolerated=("data.step", "data.gain"),
        verdicts=("data-fault",),
        reading=_SLIPS,
    ),
)
