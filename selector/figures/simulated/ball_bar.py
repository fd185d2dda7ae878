"""A circular test as a polar plot: the deviation of both directions, drawn far larger than the circle."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import plotly.graph_objects as go

from selector.figures import style
from selector.figures.panels import shown_samples
from selector.number_text import number_text
from selector.physics.drive.ball_bar.circle import BallBarTrace
from selector.physics.drive.ball_bar.quantities import centred_traces

DIRECTIONS = {1: ("counter-clockwise ↺", style.PREDICTED), -1: ("clockwise ↻", style.RESIDUAL)}
POINTS = 2400  #: Points of a trace that are drawn: of each stretch the ends, the innermost and the outermost.
_PX = 620
_ROOM = 34 / _PX
_TICK_ANGLE = 22.5
_ROUND = (1.0, 1.6, 2.0, 3.0, 4.0, 6.0, 8.0, 10.0, 16.0)
_CIRCLE = np.linspace(0.0, 360.0, 361)


def ball_bar_figure(traces: Sequence[BallBarTrace]) -> go.Figure:
    """Both directions of one feed about their least-squares centre, so that the set-up is out."""
    pair = centred_traces(traces)
    scale = _scale(pair)
    radius, feed = number_text(pair[0].radius_m * 1e3), f"{pair[0].feed_mm_per_min:.6g}"
    larger = number_text(pair[0].radius_m * 1e6 / (2.0 * scale))
    title = (
        f"Deviation from the circle of {radius} mm, about the least-squares centre, at {feed} mm/min; drawn {larger} "
        "times larger than the circle"
    )
    drawn = style.figure(title, 90 + _PX)
    drawn.layout.polar = _polar(pair[0].axes, scale)
    line = {"color": style.MUTED, "width": 1.6}
    _draw(drawn, np.zeros(len(_CIRCLE)), _CIRCLE, "nominal circle", "nominal", line=line)
    for one in pair:
        name, colour = DIRECTIONS[one.direction]
        at = shown_samples(np.arange(len(one.angle_rad), dtype=np.float64), one.deviation_um, points=POINTS)
        at = np.append(at, at[0])
        r, theta = one.deviation_um[at], np.degrees(one.angle_rad[at] % (2.0 * np.pi))
        hover, line = f"%{{theta:.1f}}°, {name} %{{r:.4g}} µm", {"color": colour, "width": 1.5}
        _draw(drawn, r.astype(np.float32), theta.astype(np.float32), name, name, hover, line=line)
    if len(pair[0].axes) == 2:
        look = {"color": "#ffffff", "size": 8, "symbol": "diamond", "line": {"color": style.INK, "width": 1.4}}
        where = [0.0, 90.0, 180.0, 270.0]
        _draw(drawn, np.zeros(4), where, "an axis reverses", "reversal", mode="markers", marker=look)
    return drawn


def _draw(
    drawn: go.Figure, r: Any, theta: Any, name: str, group: str, hover: Any = None, *, mode: Any = "lines", **more: Any
) -> None:
    place = {"r": r, "theta": theta, "subplot": "polar", "mode": mode, "legendgroup": group, "showlegend": True}
    drawn.add_scatterpolar(**place, name=name, **style.hovered(hover), **more)


def _scale(pair: Sequence[BallBarTrace]) -> float:
    """Deviation that is drawn as half of the nominal radius [µm]; half of it is the step of the rings."""
    most = 1.05 * max(1e-3, *(float(np.abs(one.deviation_um).max()) for one in pair))
    power = 10.0 ** math.floor(math.log10(most))
    return next(factor * power for factor in _ROUND if factor * power >= most)


def _polar(axes: Sequence[str], scale: float) -> dict[str, object]:
    """A polar plot with the nominal circle at two thirds of its radius."""
    steps = [k * scale / 2.0 for k in range(-3, 3)]
    names = {0: f"+{axes[0]}", 90: f"+{axes[1]}", 180: f"−{axes[0]}", 270: f"−{axes[1]}"}
    angles = range(0, 360, 45)
    return {
        "domain": {"x": [0.0, 1.0], "y": [_ROOM, 1 - 1.6 * _ROOM]},
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
