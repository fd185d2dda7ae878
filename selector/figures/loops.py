"""Displacement against temperature, run by run."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from selector.figures import style
from selector.number_text import number_text

MOST_SENSORS = 6
_COLUMNS = 3
_PANEL_PX = 320
_HEAD = 0.16  #: Share of a panel's height for its two lines of text, on paper too, where it is lower.
_LONGEST_NAME = 20
_STEPS = 30


@dataclass(frozen=True)
class LoopShown:
    """One run: its name, readings of some sensors [K or °C] and, at the same instants, displacements."""

    run: str
    readings: NDArray[np.float64]  #: (n_samples, n_sensors)
    displacement_um: NDArray[np.float64]  #: (n_samples,)
    residual_um: NDArray[np.float64] | None = None  #: (n_samples,): What a model leaves of the displacement


def displacement_loops(
    sensors: Sequence[str], response: str, runs: Sequence[LoopShown], *, rise: bool = True
) -> go.Figure:
    """Displacement over the reading of each sensor; where the way back is another one, the loop has a width.

    The width is the largest difference of the displacement between the way up to a run's highest reading and the way
    down from it, at the same reading, see `loop_width_um`. At most `MOST_SENSORS` sensors are drawn; runs as they are:
    thin them first. `rise`: readings are differences to the start of the run.
    """
    shown = [("Δ" if rise else "") + style.label(name, 14) for name in sensors[:MOST_SENSORS]]
    widest = [_widest(runs, j) for j in range(len(shown))]
    drawn = style.figure(_title(response, shown, widest, runs), 60 + _PANEL_PX * -(-len(shown) // _COLUMNS))
    drawn.update_layout(margin={"b": 10})
    wide, rows = min(_COLUMNS, len(shown)), -(-len(shown) // _COLUMNS)
    for j, sensor in enumerate(shown):
        row, column = divmod(j, _COLUMNS)
        number = str(j + 1) if j else ""
        # the widest is drawn last, on top of the others
        order = sorted(range(len(runs)), key=lambda k: k == widest[j][0])
        for place, k in enumerate(order):
            one, stands_out = runs[k], k == widest[j][0] or len(runs) == 1
            colour, width = (style.MEASURED, 1.6) if stands_out else (style.BEFORE, 1.0)
            name = "run with the widest loop" if stands_out else "other runs"
            hover = f"{style.label(one.run)}: %{{x:.3g}}, %{{y:.4g}} µm"
            axes = {"xaxis": f"x{number}", "yaxis": f"y{number}", "legendgroup": str(stands_out), "dash": None}
            is_named = len(runs) > 1 and j == 0 and (stands_out or place == 0)
            x, y = one.readings[:, j], one.displacement_um
            style.curve(drawn, x, y, colour, name, hover, width=width, showlegend=is_named, **axes)
        low, high = 1 - (row + 1) / rows, 1 - row / rows
        drawn.layout[f"xaxis{number}"] = {
            "domain": [column / wide + (0.045 if column else 0), (column + 1) / wide - (0.01 if wide > 1 else 0)],
            "anchor": f"y{number}",
            "title": {"text": f"{sensor} [{'K' if rise else '°C'}]", "standoff": 4},
        }
        drawn.layout[f"yaxis{number}"] = {
            "domain": [low + 0.20 / rows, high - _HEAD / rows],
            "anchor": f"x{number}",
            "title": {"text": f"{style.label(response, 18)} [µm]" if column == 0 else ""},
            **({"matches": "y"} if j else {}),
        }
        drawn.add_annotation(
            text=_panel_text(runs, widest[j], j), x=column / wide + (0.045 if column else 0), xanchor="left",
            xref="paper", y=high - (_HEAD - 0.01) / rows, yanchor="bottom", yref="paper", showarrow=False, align="left",
        )  # fmt: skip
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
    edges = np.linspace(x.min(), x.max(), _STEPS + 1)
    ways = []
    for part in (slice(0, top + 1), slice(top, None)):
        step = np.clip(np.digitize(x[part], edges) - 1, 0, _STEPS - 1)
        n = np.bincount(step, minlength=_STEPS)
        total = np.bincount(step, weights=y[part], minlength=_STEPS)
        ways.append(np.where(n > 0, total / np.maximum(n, 1), np.nan))
    # the step of the highest reading is in both ways
    differences = np.abs(ways[0] - ways[1])[: _STEPS - 1]
    return float(np.nanmax(differences)) if np.isfinite(differences).any() else float("nan")


_Widest = tuple[int | None, float]


def _widest(runs: Sequence[LoopShown], j: int) -> _Widest:
    """Position of the run with the widest loop over one sensor, and its width [µm]; (None, NaN) without any."""
    widths = [loop_width_um(one.readings[:, j], one.displacement_um) for one in runs]
    known = [k for k, width in enumerate(widths) if np.isfinite(width)]
    best = max(known, key=lambda k: widths[k], default=None)
    return best, float("nan") if best is None else widths[best]


def _title(response: str, shown: Sequence[str], widest: Sequence[_Widest], runs: Sequence[LoopShown]) -> str:
    name = style.label(response)
    known = [j for j in range(len(shown)) if widest[j][0] is not None]
    if not known:
        return f"{name}: no run warms up and cools down again, so that no loop can be seen"
    j = max(known, key=lambda j: widest[j][1])
    k, width = widest[j]
    return (
        f"{name}: at the same {shown[j]} it differs by up to {number_text(width, 2)} µm before and after the warmest "
        f"moment ({style.label(runs[k or 0].run)})"
    )


def _panel_text(runs: Sequence[LoopShown], widest: _Widest, j: int) -> str:
    """How wide the widest loop is, and how wide one of what the model leaves."""
    if widest[0] is None:
        return "no way back"
    text = f"{style.label(runs[widest[0]].run, _LONGEST_NAME)}: {number_text(widest[1], 2)} µm"
    left = [loop_width_um(one.readings[:, j], one.residual_um) for one in runs if one.residual_um is not None]
    left = [width for width in left if np.isfinite(width)]
    return f"{text}<br>residual {number_text(max(left), 2)} µm" if left else text
