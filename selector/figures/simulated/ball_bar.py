"""Circular tests as polar plots: the deviation of both directions, drawn far larger than the circle, a plot a feed."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import plotly.graph_objects as go

from selector.figures import style
from selector.figures.panels import shown_samples
from selector.number_text import number_text
from selector.physics.drive.ball_bar.circle import BallBarTrace
from selector.physics.drive.ball_bar.quantities import centred_traces, paired

DIRECTIONS = {1: ("counter-clockwise ↺", style.PREDICTED), -1: ("clockwise ↻", style.RESIDUAL)}
POINTS = 2400
"""Points of a trace that are drawn: of each stretch the ends, the innermost and the outermost."""

_PX = 620
_SMALL_PX = 430
_TICK_ANGLE = 22.5
_ROUND = (1.0, 1.6, 2.0, 3.0, 4.0, 6.0, 8.0, 10.0, 16.0)
_CIRCLE = np.linspace(0.0, 360.0, 361)


def ball_bar_figure(
    traces: Sequence[BallBarTrace], *, tolerance_um: float | None = None, centred: bool = True
) -> go.Figure:
    """Polar plots of a circular test, one a feed, each with its own scale.

    Parameters
    ----------
    traces : sequence of BallBarTrace
        Both directions of one or more feeds.
    tolerance_um : float or None
        Half the width of a band about the nominal circle [µm]; None: no band.
    centred : bool
        Whether the deviation is drawn about the least-squares centre of both directions, so that the set-up is out.
    """
    pairs = [centred_traces(pair) if centred else pair for pair in paired(traces)]
    columns = 1 if len(pairs) == 1 else 2
    rows = math.ceil(len(pairs) / columns)
    size = _PX if len(pairs) == 1 else _SMALL_PX
    scales = [_scale(pair, tolerance_um) for pair in pairs]
    about = "about the least-squares centre" if centred else "about the centre of the set-up"
    radius = number_text(pairs[0][0].radius_m * 1e3)
    drawn = style.figure(
        f"Deviation from the circle of {radius} mm, {about}" + _at_feed(pairs, scales), 90 + size * rows
    )
    for number, (pair, scale) in enumerate(zip(pairs, scales, strict=True)):
        row, column = divmod(number, columns)
        left, right = column / columns, (column + 1) / columns
        top, bottom = 1 - row / rows, 1 - (row + 1) / rows
        room = 34 / (size * rows)
        key = f"polar{number + 1 if number else ''}"
        drawn.layout[key] = _polar(pair[0].axes, scale, [left, right], [bottom + room, top - 1.6 * room])
        if len(pairs) > 1:
            feed = f"{pair[0].feed_mm_per_min:.6g}"
            drawn.add_annotation(
                text=f"<b>{feed} mm/min</b>, ×{_magnified(pair, scale)}",
                x=(left + right) / 2,
                y=top,
                xref="paper",
                yref="paper",
                xanchor="center",
                yanchor="top",
                showarrow=False,
            )
        _draw(drawn, pair, scale, tolerance_um, key, is_first=number == 0)
    return drawn


def _at_feed(pairs: Sequence[Sequence[BallBarTrace]], scales: Sequence[float]) -> str:
    if len(pairs) > 1:
        return ", drawn larger than the circle by the factor beside each feed"
    feed = f"{pairs[0][0].feed_mm_per_min:.6g}"
    return f", at {feed} mm/min; drawn {_magnified(pairs[0], scales[0])} times larger than the circle"


def _scale(pair: Sequence[BallBarTrace], tolerance_um: float | None) -> float:
    """Deviation that is drawn as half of the nominal radius [µm]; half of it is the step of the rings."""
    most = 1.05 * max(tolerance_um or 0.0, 1e-3, *(float(np.abs(one.deviation_um).max()) for one in pair))
    power = 10.0 ** math.floor(math.log10(most))
    return next(factor * power for factor in _ROUND if factor * power >= most)


def _magnified(pair: Sequence[BallBarTrace], scale_um: float) -> str:
    return number_text(pair[0].radius_m * 1e6 / (2.0 * scale_um))


def _polar(axes: Sequence[str], scale: float, across: list[float], up: list[float]) -> dict[str, object]:
    """A polar plot with the nominal circle at two thirds of its radius."""
    steps = [k * scale / 2.0 for k in range(-3, 3)]
    names = {0: f"+{axes[0]}", 90: f"+{axes[1]}", 180: f"−{axes[0]}", 270: f"−{axes[1]}"}
    angles = range(0, 360, 45)
    return {
        "domain": {"x": across, "y": up},
        "bgcolor": "#ffffff",
        "radialaxis": {
            "range": [-2.0 * scale, scale],
            "tickvals": steps,
            "ticktext": [f"{step:+.3g} µm".replace("-", "−") if step else "0" for step in steps],
            "angle": _TICK_ANGLE,
            "tickangle": _TICK_ANGLE,
            "tickfont": {"size": 10, "color": style.MUTED},
            "gridcolor": style.GRID,
            "showline": False,
            "ticks": "",
        },
        "angularaxis": {
            "tickvals": list(angles),
            "ticktext": [style.label(names[angle]) if angle in names else f"{angle}°" for angle in angles],
            "gridcolor": style.GRID,
            "linecolor": style.GRID,
            "direction": "counterclockwise",
            "rotation": 0,
        },
    }


def _draw(
    drawn: go.Figure,
    pair: Sequence[BallBarTrace],
    scale: float,
    tolerance_um: float | None,
    key: str,
    *,
    is_first: bool,
) -> None:
    for ring in (tolerance_um, -tolerance_um) if tolerance_um else ():
        drawn.add_scatterpolar(
            r=np.full(len(_CIRCLE), ring),
            theta=_CIRCLE,
            subplot=key,
            mode="lines",
            name=f"tolerance ± {number_text(tolerance_um or 0.0)} µm",
            legendgroup="tolerance",
            showlegend=is_first and ring > 0,
            line={"color": style.CHOSEN, "width": 1.4, "dash": "dash"},
            hoverinfo="skip",
        )
    drawn.add_scatterpolar(
        r=np.zeros(len(_CIRCLE)),
        theta=_CIRCLE,
        subplot=key,
        mode="lines",
        name="nominal circle",
        legendgroup="nominal",
        showlegend=is_first,
        line={"color": style.MUTED, "width": 1.6},
        hoverinfo="skip",
    )
    for one in pair:
        name, colour = DIRECTIONS[one.direction]
        at = shown_samples(np.arange(len(one.angle_rad), dtype=np.float64), one.deviation_um, points=POINTS)
        at = np.append(at, at[0])
        drawn.add_scatterpolar(
            r=one.deviation_um[at].astype(np.float32),
            theta=np.degrees(one.angle_rad[at] % (2.0 * np.pi)).astype(np.float32),
            subplot=key,
            mode="lines",
            name=name,
            legendgroup=name,
            showlegend=is_first,
            line={"color": colour, "width": 1.5},
            hovertemplate=f"%{{theta:.1f}}°, {name} %{{r:.4g}} µm<extra></extra>",
        )
    if len(pair[0].axes) == 2:
        drawn.add_scatterpolar(
            r=np.zeros(4),
            theta=[0.0, 90.0, 180.0, 270.0],
            subplot=key,
            mode="markers",
            name="an axis reverses",
            legendgroup="reversal",
            showlegend=is_first,
            marker={"color": "#ffffff", "size": 8, "symbol": "diamond", "line": {"color": style.INK, "width": 1.4}},
            hoverinfo="skip",
        )
