"""Thermal recordings beside a static regression: a lathe over eighteen days, and the virtual machining centre."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from selector.errors import ReadError
from selector.readers.reading import read
from selector.recording import Channel, Recording
from selector.shipped import shipped
from selector.types import Matrix

_START = 5


def regressed(
    recording: Recording,
    responses: Sequence[str],
    inputs: Sequence[str],
    fitted: Sequence[str],
    *,
    of_rises: bool = False,
) -> Recording:
    """Ordinary least squares of responses on inputs and a constant, on the runs `fitted`, computed for all runs.

    Rows without a missing value are fitted. `of_rises`: inputs count from their mean over the first `_START` rows of a
    run, as displacements do that are zeroed there.
    """

    def regressors(run: str) -> Matrix:
        values = recording.values(run, inputs)
        start = np.nanmean(values[:_START], axis=0) if of_rises else 0.0
        return np.column_stack([np.ones(len(values)), values - start])

    x = np.concatenate([regressors(run) for run in fitted])
    y = np.concatenate([recording.values(run, responses) for run in fitted])
    rows = np.isfinite(x).all(axis=1) & np.isfinite(y).all(axis=1)
    factors = np.linalg.lstsq(x[rows], y[rows], rcond=None)[0]
    courses = {
        run: pd.DataFrame(
            regressors(run) @ factors, columns=list(responses), index=pd.Index(recording.time_s(run), name="time_s")
        )
        for run in recording.runs
    }
    return Recording.from_runs(courses, tuple(recording.channel(name) for name in responses))


_STEP_S = 60.0
"""Assumed; a sample is a sample. Times of the answer are in samples times this."""
_COLUMNS = {
    "Ambient": ("Tamb", "ambient", "hall"),
    "Ref Temp on Bed": ("T1", "temperature", "bed, reference"),
    "Spindle Rear": ("T2", "temperature", "spindle, rear"),
    "Coolantwall": ("T3", "temperature", "coolant wall"),
    "Transfomerbed": ("T4", "temperature", "bed at the transformer"),
    "Spindle Front": ("T5", "temperature", "spindle, front"),
}
_RESPONSE = "Dia Disp"


def ace_thermal(folder: Path) -> tuple[Recording, Recording]:
    """All days, and a regression on all six thermometers that was fitted to all days but the last.

    Raises ReadError: the folder lacks one of the two workbooks, or a sheet lacks a column.
    """
    inputs, errors = (_sheets(folder / name) for name in ("ACE_X.xlsx", "ACE_Y.xlsx"))
    runs = {}
    for k, (sheet, of) in enumerate(inputs.items(), start=1):
        columns = {name: _column(of, column, sheet, folder) for column, (name, _, _) in _COLUMNS.items()}
        columns["D"] = _column(errors[sheet], _RESPONSE, sheet, folder) if sheet in errors else np.empty(0)
        if len({len(values) for values in columns.values()}) > 1:
            raise _error("other numbers of rows in the two workbooks", f"{folder}, {sheet}")
        index = pd.Index(_STEP_S * np.arange(len(columns["D"])), name="time_s")
        runs[f"day{k:02d}"] = pd.DataFrame(columns, index=index)
    channels = [Channel(name, role, "degC", place=place) for name, role, place in _COLUMNS.values()]
    channels.append(Channel("D", "displacement", "um", place="diameter of the part"))
    recording = Recording.from_runs(runs, tuple(channels))
    names = [name for name, _, _ in _COLUMNS.values()]
    return recording, regressed(recording, ("D",), names, recording.runs[:-1])


def _sheets(path: Path) -> dict[str, pd.DataFrame]:
    try:
        return pd.read_excel(path, sheet_name=None, engine="calamine")
    except (OSError, ValueError) as error:
        raise _error(str(error), str(path)) from error


def _column(sheet: pd.DataFrame, name: str, where: str, folder: Path) -> NDArray[np.float64]:
    if name not in sheet:
        raise _error(f"no column {name!r}", f"{folder}, {where}")
    return np.asarray(sheet[name].to_numpy(dtype=np.float64))


def _error(found: str, where: str) -> ReadError:
    expected = f"the workbooks ACE_X.xlsx and ACE_Y.xlsx with {', '.join(_COLUMNS)} and {_RESPONSE}, a sheet a day"
    return ReadError(
        found, expected=expected, where=where, advice="download the recording, see docs/reference/sources.md"
    )


FEW = ("T01", "T05", "T08", "T13", "T27", "T28", "T36")
"""Thermometers that serve a regression well (fixtures/vmc37/README.md)."""


def vmc37(thermometers: Sequence[str] = (), responses: Sequence[str] = ("Y", "Z")) -> tuple[Recording, Recording]:
    """All eight runs, and a regression on rises of thermometers (default: of all) fitted to all runs but the last."""
    folder = shipped("vmc37")
    recording = read([folder / f"r{k}.csv" for k in range(1, 9)], machine=folder / "machine.toml").recording
    chosen = list(thermometers) or [c.name for c in recording.channels if c.role in ("temperature", "ambient")]
    return recording, regressed(recording, responses, chosen, recording.runs[:-1], of_rises=True)
