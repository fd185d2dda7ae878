"""Displacement against temperature, run by run, and where a model was learnt."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from selector.figures import style
from selector.models.least_squares import ValidityHull
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


POINTS = 1500
MOST_PAIRS = 6
#: Distances in standard deviations of the inputs: up to the first a sample is inside, but for noise; beyond the second
#: one it is far outside. With many inputs hardly a sample is inside: no two days are alike in all of them.
INSIDE, FAR = 0.1, 1.0
_VALIDITY_PANEL_PX = 290


def validity_pairs(
    hull: ValidityHull,
    axes: Sequence[tuple[str, str]],
    samples: NDArray[np.float64],
    beyond: NDArray[np.float64] | None = None,
    known: str = "what the model has learnt from",
) -> go.Figure:
    """Pairs of inputs with the outline of the hull; samples that lie outside what is known stand out.

    A sample may lie outside the hull of all inputs and inside that of every pair; it is marked in each picture. At
    most `POINTS` samples are judged and drawn, evenly spaced, and at most `MOST_PAIRS` pairs, those of the first
    inputs.

    `hull` is that of the training samples, `axes` its variables and their units, two at least; `samples` have the shape
    (n_samples, n_inputs), `beyond` is the distance of each to what is `known`, in standard deviations; default: to the
    hull.
    """
    keep = np.unique(np.linspace(0, len(samples) - 1, min(POINTS, len(samples))).astype(np.int64))
    shown = samples[keep]
    distance = beyond[keep] if beyond is not None else hull.distance(shown) if len(shown) else np.zeros(0)
    far = distance > FAR
    pairs = sorted(combinations(range(len(axes)), 2), key=lambda pair: pair[1])[:MOST_PAIRS]
    title = f"{style.share(far).capitalize()} of the samples lie" if far.any() else "No sample lies"
    title += f" more than one standard deviation outside {known}"
    classes = (
        (distance <= INSIDE, "inside", style.MUTED),
        ((distance > INSIDE) & ~far, "outside by up to 1 standard deviation", style.HARM_SCALE[1][1]),
        (far, "farther outside", style.HARM_SCALE[-1][1]),
    )
    rows = max(-(-len(pairs) // _COLUMNS), 1)
    drawn = style.figure(title, 60 + _VALIDITY_PANEL_PX * rows)
    drawn.update_layout(margin={"b": 10})
    wide = min(_COLUMNS, len(pairs))
    for k, (i, j) in enumerate(pairs):
        row, column = divmod(k, _COLUMNS)
        axis = {"xaxis": f"x{k + 1}", "yaxis": f"y{k + 1}"}
        around = _outline(hull.points[:, [i, j]] * hull.scale[[i, j]])
        drawn.add_scatter(
            x=around[:, 0], y=around[:, 1], **axis, mode="lines", fill="toself", name="learnt from", legendgroup="hull",
            line={"color": style.CHOSEN, "width": 1.5}, fillcolor="rgba(0,158,115,0.12)", hoverinfo="skip",
            showlegend=k == 0,
        )  # fmt: skip
        for mask, name, colour in classes:
            drawn.add_scatter(
                x=shown[mask, i].astype(np.float32), y=shown[mask, j].astype(np.float32), **axis, mode="markers",
                name=f"{name}: {style.share(mask)}", legendgroup=name, showlegend=k == 0 and bool(mask.any()),
                marker={"color": colour, "size": 4, "opacity": 0.7}, hovertemplate="%{x:.3g}, %{y:.3g}<extra></extra>",
            )  # fmt: skip
        left, right = column / wide, (column + 1) / wide
        top, bottom = 1 - row / rows, 1 - (row + 1) / rows
        number = str(k + 1) if k else ""
        drawn.layout[f"xaxis{number}"] = {
            "domain": [left + 0.05, right - 0.01], "anchor": f"y{k + 1}",
            "title": {"text": _axis_text(*axes[i]), "standoff": 2},
        }  # fmt: skip
        drawn.layout[f"yaxis{number}"] = {
            "domain": [bottom + 0.20 / rows, top - 0.04 / rows], "anchor": f"x{k + 1}",
            "title": {"text": _axis_text(*axes[j]), "standoff": 2},
        }  # fmt: skip
    return drawn


def _axis_text(name: str, unit: str) -> str:
    return f"{style.label(name, 24)} [{unit}]"


def _outline(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Corners around points of a plane, the first one again at the end; the points themselves where they are a line."""
    try:
        corners = points[ConvexHull(points).vertices]
    except QhullError:
        corners = points[np.argsort(points[:, 0])]
    return np.vstack([corners, corners[:1]])
