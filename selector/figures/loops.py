"""Displacement against temperature, run by run: a loop is memory that no sensor of this place can undo."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from selector.figures import style

POINTS_PER_RUN = 300
_ONE_COLOUR_FROM = len(style.GROUPS)


@dataclass(frozen=True)
class LoopShown:
    """One run: its name, readings of one sensor [K or °C] and the displacement [µm] at the same instants."""

    run: str
    reading: NDArray[np.float64]
    displacement_um: NDArray[np.float64]


def displacement_loops(sensor: str, response: str, runs: Sequence[LoopShown], *, rise: bool = True) -> go.Figure:
    """Displacement over the reading of one sensor; where the way back is another one, the loop has a width.

    Every run is thinned to `POINTS_PER_RUN` samples, evenly in time. The width that the title tells is the largest
    difference of the displacement between the way up to a run's highest reading and the way down from it, at the same
    reading.

    Parameters
    ----------
    sensor, response : str
    runs : sequence of LoopShown
    rise : bool
        Whether readings are differences to the start of the run.
    """
    widths = {one.run: loop_width_um(one.reading, one.displacement_um) for one in runs}
    known = {run: width for run, width in widths.items() if np.isfinite(width)}
    name = ("Δ" if rise else "") + style.label(sensor)
    title = f"{style.label(response)} over {name}: "
    if known:
        widest = max(known, key=lambda run: known[run])
        title += f"up and down again differ by up to {style.number(known[widest])} µm ({style.label(widest)})"
    else:
        title += "no run goes up and down again"
    drawn = style.figure(title, 460)
    for k, one in enumerate(runs):
        keep = np.unique(np.linspace(0, len(one.reading) - 1, min(POINTS_PER_RUN, len(one.reading))).astype(np.int64))
        colour = style.GROUPS[k] if len(runs) <= _ONE_COLOUR_FROM else style.PREDICTED
        drawn.add_scatter(
            x=one.reading[keep].astype(np.float32),
            y=one.displacement_um[keep].astype(np.float32),
            mode="lines",
            name=style.label(one.run),
            line={"color": colour, "width": 1.4},
            opacity=0.85,
            hovertemplate=f"{style.label(one.run)}: %{{x:.3g}}, %{{y:.4g}} µm<extra></extra>",
            showlegend=len(runs) <= _ONE_COLOUR_FROM,
        )
    drawn.update_xaxes(title_text=f"{name} [{'K' if rise else '°C'}]")
    drawn.update_yaxes(title_text=f"{style.label(response)} [µm]")
    return drawn


def loop_width_um(reading: NDArray[np.float64], displacement_um: NDArray[np.float64]) -> float:
    """Largest difference of the displacement [µm] between both ways at the same reading; NaN where there is one only.

    Each way is the part before, or after, the highest reading; of the several displacements at about one reading (one
    of 30 steps) the mean is taken.
    """
    known = np.isfinite(reading) & np.isfinite(displacement_um)
    x, y = reading[known], displacement_um[known]
    if len(x) < 4 or np.ptp(x) == 0:
        return float("nan")
    top = int(np.argmax(x))
    edges = np.linspace(x.min(), x.max(), 31)
    ways = []
    for part in (slice(0, top + 1), slice(top, None)):
        step = np.clip(np.digitize(x[part], edges) - 1, 0, 29)
        n = np.bincount(step, minlength=30)
        total = np.bincount(step, weights=y[part], minlength=30)
        ways.append(np.where(n > 0, total / np.maximum(n, 1), np.nan))
    differences = np.abs(ways[0] - ways[1])
    return float(np.nanmax(differences)) if np.isfinite(differences).any() else float("nan")
