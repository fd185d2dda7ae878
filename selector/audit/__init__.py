"""Whether patent CN1868666 agrees with itself and with our results: its printed numbers, checked one by one."""

import csv
from pathlib import Path

import numpy as np

from selector.audit import checks
from selector.audit.checks import SENSORS, AuditLine, audit_table_text
from selector.errors import ReadError
from selector.shipped import shipped

__all__ = ["AuditLine", "audit_patent", "audit_table_text"]


def audit_patent(recording: Path | None = None) -> tuple[AuditLine, ...]:
    """Every number that the patent prints, next to ours, with a verdict and the reason.

    `recording` is a table like the shipped reconstruction ``patent8/recording.csv``, the default. Raises InputError:
    that is missing or damaged.
    """
    path = shipped("patent8") / "recording.csv" if recording is None else recording
    table = _table(path)
    rises = {name: table[name] - table[name][0] for name in SENSORS}
    matrix = np.column_stack(list(rises.values()))
    z, y, z_second = table["Z"], table["Y"], table["Z_embodiment2"]
    return (
        *checks.similarity_lines(matrix),
        *checks.closure_lines(),
        *checks.group_lines(),
        *checks.representative_lines(matrix, z, y),
        *checks.r2_lines(rises, {"Z": z, "Y": y}),
        *checks.model_lines(rises, z, y, z_second),
        *checks.symbol_lines(rises, z),
        *checks.effect_lines(rises),
        *_remarks(),
    )


def _remarks() -> list[AuditLine]:
    """What is read in the text, and needs no calculation."""
    with Path(__file__).with_name("remarks.csv").open(encoding="utf-8", newline="") as stream:
        return [AuditLine(**row) for row in csv.DictReader(stream)]  # type: ignore[arg-type]


def _table(path: Path) -> dict[str, np.ndarray[tuple[int], np.dtype[np.float64]]]:
    # the readers stand above this layer, and this file is always the same plain table
    wanted = (*SENSORS, "Y", "Z", "Z_embodiment2")
    try:
        with path.open(encoding="utf-8", newline="") as stream:
            rows = list(csv.DictReader(stream))
        return {name: np.array([float(row[name]) for row in rows]) for name in wanted}
    except (OSError, ValueError, KeyError, TypeError, csv.Error) as error:
        raise ReadError(
            f"{type(error).__name__}: {error}",
            expected="a table with the numeric columns " + ", ".join(wanted),
            where=str(path),
            advice="restore the file, or make it again with fixtures/make/patent8.py",
        ) from error
