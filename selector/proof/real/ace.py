"""Thermal error of a lathe over eighteen days beside a static regression on all its thermometers.

`ACE_X.xlsx` and `ACE_Y.xlsx` of the repository srivathsan902/Thermal_Compensation_Webpage, a sheet a day. Neither the
machine nor the sampling interval is documented, nor speed, load or coolant.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from selector.errors import ReadError
from selector.proof.real.regressed import regressed
from selector.recording import Channel, Recording

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

    Raises
    ------
    ReadError
        The folder lacks one of the two workbooks, or a sheet lacks a column.
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
