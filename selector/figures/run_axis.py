"""All runs of a comparison on one time axis, one after the other, with the time from the start of each as its ticks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from selector.diagnosis.comparison import Comparison
from selector.figures import style

Vector = NDArray[np.float64]
_GAP = 0.015
_WIDTH_PX = 780.0
_TICK_PX, _NAME_PX = 46.0, 60.0
_STEPS_S: tuple[float, ...] = (
    0.01,
    0.02,
    0.05,
    0.1,
    0.2,
    0.5,
    1,
    2,
    5,
    10,
    20,
    30,
    60,
    120,
    300,
    600,
    1200,
    1800,
    3600,
)
_STEPS_S += tuple(hours * 3600.0 for hours in (2, 4, 6, 12, 24, 48, 120, 240, 1000))


class RunAxis:
    """Where every sample stands.

    Attributes
    ----------
    starts_s : tuple of float
        Start of every run on the axis [s].
    end_s : float
        End of the axis [s].
    """

    def __init__(self, comparison: Comparison) -> None:
        self._comparison = comparison
        self._lengths = [_length_s(comparison, rows) for _, rows in comparison.rows_of_runs()]
        gap = _GAP * sum(self._lengths)
        starts = np.cumsum([0.0, *(length + gap for length in self._lengths)])
        self.starts_s = tuple(float(start) for start in starts[:-1])
        self.end_s = float(starts[-1] - gap)

    def by_run(self, values: Vector) -> list[tuple[Vector, Vector]]:
        """(times on the axis, values) of every run."""
        rows = [part for _, part in self._comparison.rows_of_runs()]
        time = self._comparison.time_s
        pairs = zip(self.starts_s, rows, strict=True)
        return [(start + time[part] - time[part][0], values[part]) for start, part in pairs]

    def place_s(self, run: str, time_s: float) -> float:
        """Where a time from the start of a run stands."""
        k = self._comparison.runs.index(run)
        return self.starts_s[k] + float(np.clip(time_s, 0.0, self._lengths[k]))

    def held_out_s(self) -> list[tuple[float, float]]:
        """Stretches of the axis that nothing was fitted to."""
        found = []
        for start, (_, rows) in zip(self.starts_s, self._comparison.rows_of_runs(), strict=True):
            held = np.concatenate([[False], self._comparison.held_out[rows], [False]])
            time = self._comparison.time_s[rows] - self._comparison.time_s[rows][0]
            edges = np.flatnonzero(np.diff(held.astype(np.int8)))
            found += [
                (start + float(time[a]), start + float(time[b - 1]))
                for a, b in zip(edges[::2], edges[1::2], strict=True)
                if b - a > 1
            ]
        return found

    def ticks(self, seconds: float) -> dict[str, Sequence[object]]:
        """Ticks of a Plotly axis whose unit has that many seconds: the time from the start of each run."""
        per_px = self.end_s / _WIDTH_PX
        step = next((one for one in _STEPS_S if one >= _TICK_PX * per_px), _STEPS_S[-1])
        values: list[float] = []
        texts: list[str] = []
        for start, length in zip(self.starts_s, self._lengths, strict=True):
            if values and start / seconds - values[-1] < 0.4 * _TICK_PX * per_px / seconds:
                continue
            for k in range(int(length // step) + 1):
                if k == 0 or k * step <= length - 0.25 * _TICK_PX * per_px:
                    values.append((start + k * step) / seconds)
                    texts.append(f"{k * step / seconds:.4g}")
        return {"tickvals": values, "ticktext": texts}

    def name_runs(self, drawn: go.Figure, seconds: float, xref: str = "x") -> None:
        """Writes the names of the runs above the picture, and that a run is held out."""
        room = self.end_s * _NAME_PX / _WIDTH_PX
        last = -np.inf
        for run, start, length, (_, rows) in zip(
            self._comparison.runs, self.starts_s, self._lengths, self._comparison.rows_of_runs(), strict=True
        ):
            if start - last < room:
                continue
            last = start
            is_held = bool(self._comparison.held_out[rows].all()) and length > 2 * room
            text = f"<b>{style.label(run, 18)}</b>" + (" (held out)" if is_held else "")
            drawn.add_annotation(
                text=text, x=start / seconds, xref=xref, xanchor="left", y=1.0, yref="paper", yanchor="bottom",
                showarrow=False, font={"size": 12},
            )  # fmt: skip


def _length_s(comparison: Comparison, rows: slice) -> float:
    time = comparison.time_s[rows]
    return float(time[-1] - time[0])
