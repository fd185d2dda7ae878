"""How the published files of a recording are read, and what is said where one is not there."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from selector.errors import ReadError


def table(path: Path, columns: tuple[str, ...]) -> pd.DataFrame:
    """A file with commas between its columns, these among them.

    Raises
    ------
    ReadError
        There is no such file, or it lacks a column.
    """
    expected = f"a table with the columns {', '.join(columns)}"
    advice = "download the recording, see docs/reference/sources.md"
    try:
        found = pd.read_csv(path)
    except (OSError, ValueError) as error:
        raise ReadError(str(error), expected=expected, where=str(path), advice=advice) from error
    missing = [name for name in columns if name not in found]
    if missing:
        raise ReadError(f"no column {missing[0]!r}", expected=expected, where=str(path), advice=advice)
    return found
