"""Channels on several clocks → one table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from selector.findings import Finding
from selector.readers.finding_table import FINDINGS
from selector.readers.tables import Column, listed


@dataclass(frozen=True)
class Rate:
    """Columns that share a clock [s]."""

    time_s: NDArray[np.float64]
    columns: tuple[Column, ...]


def one_clock(rates: Sequence[Rate], path: Path) -> tuple[NDArray[np.float64], tuple[Column, ...], list[Finding]]:
    """Time, columns and findings: all come onto the clock of the most columns (in a tie the slower one).

    Columns of other clocks are interpolated linearly, not beyond their ends and not over pauses of more
    than ten of their periods; text is left out.
    """
    merged: list[Rate] = []
    for rate in rates:
        same = next((k for k, other in enumerate(merged) if np.array_equal(other.time_s, rate.time_s)), None)
        if same is None:
            merged.append(rate)
        else:
            merged[same] = Rate(rate.time_s, (*merged[same].columns, *rate.columns))
    if len(merged) == 1:
        return merged[0].time_s, merged[0].columns, []
    leading = max(merged, key=lambda rate: (len(rate.columns), -len(rate.time_s)))
    columns = list(leading.columns)
    moved: list[str] = []
    for rate in merged:
        if rate is leading:
            continue
        for column in rate.columns:
            if column.kind != "number":
                continue
            values = interpolated(rate.time_s, column.values, leading.time_s)
            columns.append(Column(column.header, values, column.unit, (), column.description))
            moved.append(column.header)
    finding = FINDINGS.finding(
        "several-clocks",
        f"The channels of {path.name} are recorded on {len(merged)} clocks; {len(moved)} of them ({listed(moved, 6)}) "
        "were interpolated onto the clock of the others.",
        evidence={"clocks": len(merged), "channels": moved},
    )
    return leading.time_s, tuple(columns), [finding]


def interpolated(
    time_s: NDArray[np.float64], values: NDArray[np.float64], at_s: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Linear interpolation; NaN outside of the samples and inside long pauses."""
    known = np.isfinite(values) & np.isfinite(time_s)
    t, v = time_s[known], values[known]
    if len(t) < 2 or np.any(np.diff(t) < 0):
        order = np.argsort(t, kind="stable")
        t, v = t[order], v[order]
    if len(t) == 0:
        return np.full(len(at_s), np.nan)
    out: NDArray[np.float64] = np.interp(at_s, t, v, left=np.nan, right=np.nan)
    if len(t) > 2:
        steps = np.diff(t)
        usual = float(np.median(steps))
        position = np.clip(np.searchsorted(t, at_s, side="left"), 1, len(t) - 1)
        exact = t[np.clip(np.searchsorted(t, at_s), 0, len(t) - 1)] == at_s
        own = max(usual, float(np.median(np.diff(at_s))) if len(at_s) > 1 else usual)
        out[(steps[position - 1] > 10 * own) & ~exact] = np.nan
    return out
