"""What sizes come out of gauged grinding: their histogram, their course over the parts, and what a filter trades."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from selector.figures import style
from selector.figures.panels import shown_samples

Vector = NDArray[np.float64]

DRAWN, LIMIT, WANTED = style.BEFORE, style.RESIDUAL, style.MUTED
CURVES = (style.PREDICTED, style.CHOSEN, "#CC79A7")
MOST_MARKERS = 600
"""Parts that are drawn one by one; of more the smallest and largest of each stretch."""

MOST_DRESSINGS = 40
_BINS = 60
_FEW_DECADES = 1.5
"""Up to so many 2 and 5 are written between the powers of ten."""

_DECADES = 5.0
"""Decades below the largest error that the trade-off shows at most."""


def size_histogram(
    size_um: Vector,
    curves: Mapping[str, tuple[Vector, Vector]],
    tolerance_um: tuple[float, float] | None,
    wanted_um: float,
    title: str,
) -> go.Figure:
    """Sizes of the simulated parts as a histogram, the densities by formula as lines, and the tolerance.

    Parameters
    ----------
    size_um : ndarray of shape (n_parts,)
        Finished sizes, counted from the nominal size [µm].
    curves : mapping of str to (size_um, density_per_um)
        By what the line is called.
    tolerance_um : (lower, upper) or None
        [µm].
    wanted_um : float
        x_k, for which the threshold is meant [µm].
    title : str
        Plain text, as `style.label` makes it.
    """
    counts, edges = np.histogram(size_um, bins=_edges(size_um))
    density = counts / (len(size_um) * np.diff(edges))
    drawn = style.figure(title, 400)
    centres = (edges[:-1] + edges[1:]) / 2.0
    drawn.add_bar(
        x=centres.astype(np.float32), y=(100.0 * density).astype(np.float32), width=np.diff(edges).astype(np.float32),
        name=f"Monte Carlo, {len(size_um)} parts", marker={"color": DRAWN, "line": {"width": 0}},
        hovertemplate="%{x:.4g} µm: %{y:.3g} % per µm<extra>Monte Carlo</extra>",
    )  # fmt: skip
    for k, (name, (at_um, per_um)) in enumerate(curves.items()):
        drawn.add_scatter(
            x=at_um.astype(np.float32), y=(100.0 * per_um).astype(np.float32), mode="lines", name=style.label(name, 60),
            line={"color": CURVES[k % len(CURVES)], "width": 2.2, "dash": ("solid", "dash", "dot")[k % 3]},
            hovertemplate=f"%{{x:.4g}} µm: %{{y:.3g}} % per µm<extra>{style.label(name, 60)}</extra>",
        )  # fmt: skip
    ends = [float(edges[0]), float(edges[-1]), wanted_um, *(tolerance_um or ())]
    room = 0.06 * (max(ends) - min(ends))
    _upright(drawn, [(wanted_um, "wanted", WANTED, "dash")])
    if tolerance_um is not None:
        limits = [(value, name, LIMIT, "solid") for value, name in zip(tolerance_um, ("lower", "upper"), strict=True)]
        _upright(drawn, limits)
    top = max(float(density.max()), *(float(per_um.max()) for _, per_um in curves.values()), 1e-12)
    drawn.update_layout(
        bargap=0,
        xaxis={"title": {"text": "finished size, from nominal [µm]"}, "range": [min(ends) - room, max(ends) + room]},
        yaxis={"title": {"text": "share of the parts [% per µm]"}, "range": [0.0, _rounded(116.0 * top)],
               "exponentformat": "none"},
        margin={"t": int(drawn.layout.margin.t) + 18},
        height=418,
    )  # fmt: skip
    return drawn


def sizes_over_parts(
    size_um: Vector,
    tolerance_um: tuple[float, float] | None,
    wanted_um: float,
    dressed: Sequence[int],
    title: str,
) -> go.Figure:
    """Finished sizes in the order of grinding, with the tolerance, and dotted lines where the wheel was dressed.

    Parameters
    ----------
    size_um : ndarray of shape (n_parts,)
        [µm].
    tolerance_um : (lower, upper) or None
        [µm].
    wanted_um : float
        [µm].
    dressed : sequence of int
        Numbers of the parts, from 1, before which the wheel was dressed.
    title : str
        Plain text, as `style.label` makes it.
    """
    number = np.arange(1, len(size_um) + 1, dtype=np.float64)
    few = len(size_um) <= MOST_MARKERS
    at = np.arange(len(size_um)) if few else shown_samples(number, size_um)
    drawn = style.figure(title, 340)
    drawn.add_scatter(
        x=number[at].astype(np.float32), y=size_um[at].astype(np.float32), mode="lines+markers" if few else "lines",
        name="finished size", showlegend=False,
        line={"color": style.BEFORE if few else style.PREDICTED, "width": 1.0},
        marker={"color": style.PREDICTED, "size": 5},
        hovertemplate="part %{x:.0f}: %{y:.4g} µm<extra></extra>",
    )  # fmt: skip
    ends = [float(size_um.min()), float(size_um.max()), wanted_um, *(tolerance_um or ())]
    room = 0.08 * max(max(ends) - min(ends), 1e-6)
    lines = [(wanted_um, "wanted", WANTED, "dash")]
    if tolerance_um is not None:
        lines += [(tolerance_um[0], "lower limit", LIMIT, "solid"), (tolerance_um[1], "upper limit", LIMIT, "solid")]
    for value, name, colour, dash in lines:
        drawn.add_shape(
            type="line", xref="x domain", x0=0, x1=1, yref="y", y0=value, y1=value,
            line={"color": colour, "width": 1.4, "dash": dash},
        )  # fmt: skip
        drawn.add_annotation(
            text=name, font={"color": colour, "size": 12}, x=1.0, xref="paper", xanchor="left", xshift=6, y=value,
            yref="y", yanchor="middle", showarrow=False,
        )  # fmt: skip
    shown = list(dressed)[:MOST_DRESSINGS] if len(dressed) <= MOST_DRESSINGS else []
    for part in shown:
        drawn.add_shape(
            type="line", xref="x", x0=part - 0.5, x1=part - 0.5, yref="y domain", y0=0, y1=1,
            line={"color": style.CHOSEN, "width": 1.4, "dash": "dot"},
        )  # fmt: skip
    drawn.update_layout(
        margin={"r": 100},
        xaxis={"title": {"text": "part [number]"}, "range": [0.5 - 0.01 * len(size_um), 0.5 + 1.01 * len(size_um)]},
        yaxis={"title": {"text": "size [µm]"}, "range": [min(ends) - room, max(ends) + room], "exponentformat": "none"},
    )
    return drawn


def filter_trade_off(
    time_constant_s: Vector,
    bias_um: Vector,
    sd_um: Vector,
    best: tuple[float, float],
    present: tuple[float, float],
    title: str,
    checked: tuple[Vector, Vector] | None = None,
) -> go.Figure:
    """Bias², variance and their sum over the time constant of the filter, both on logarithmic axes.

    Parameters
    ----------
    time_constant_s, bias_um, sd_um : ndarray of shape (n_filters,)
        T_Φ [s]; mean error and standard deviation of the finished size with it [µm].
    best, present : (time_constant_s, mean_square_um2)
        The best filter, and the one of the gauge with its own threshold [s], [µm²].
    title : str
        Plain text, as `style.label` makes it.
    checked : (time_constant_s, mean_square_um2) or None
        Mean square errors by Monte Carlo at some of them [s], [µm²].
    """
    bias2, variance = bias_um**2, sd_um**2
    total = bias2 + variance
    drawn = style.figure(title, 400)
    for values, name, colour, dash, width in (
        (bias2, "bias²", style.RESIDUAL, "dash", 1.8),
        (variance, "variance", style.PREDICTED, "dot", 1.8),
        (total, "mean square error", style.INK, "solid", 2.6),
    ):
        seen = values > 0
        if not seen.any():
            continue
        drawn.add_scatter(
            x=(1e3 * time_constant_s[seen]).astype(np.float32), y=values[seen].astype(np.float32), mode="lines",
            name=name, line={"color": colour, "width": width, "dash": dash},
            hovertemplate=f"%{{x:.4g}} ms: %{{y:.4g}} µm²<extra>{name}</extra>",
        )  # fmt: skip
    if checked is not None:
        drawn.add_scatter(
            x=(1e3 * checked[0]).astype(np.float32), y=checked[1].astype(np.float32), mode="markers",
            name="Monte Carlo", marker={"color": "#ffffff", "size": 9, "line": {"color": style.INK, "width": 1.6}},
            hovertemplate="%{x:.4g} ms: %{y:.4g} µm²<extra>Monte Carlo</extra>",
        )  # fmt: skip
    for (at_s, value), name, colour, symbol in (
        (best, "best", style.CHOSEN, "star"),
        (present, "present", style.BASELINES["all sensors"], "diamond"),
    ):
        drawn.add_scatter(
            x=[_rounded(1e3 * at_s)], y=[_rounded(value)], mode="markers",
            name=f"{name}: {style.number(1e3 * at_s)} ms",
            marker={"color": colour, "size": 13, "symbol": symbol, "line": {"color": "#ffffff", "width": 1}},
            hovertemplate=f"{name}: %{{x:.4g}} ms, %{{y:.4g}} µm²<extra></extra>",
        )  # fmt: skip
    positive = np.concatenate([row[row > 0] for row in (bias2, variance, total, np.array([best[1], present[1]]))])
    high = math.log10(float(positive.max()))
    low = max(math.log10(float(positive.min())), high - _DECADES)
    drawn.update_layout(
        xaxis={"type": "log", "title": {"text": "time constant of the filter [ms]"}, "dtick": 1,
               "minor": {"ticks": "outside", "ticklen": 3},
               "range": [math.log10(1e3 * time_constant_s[0]), math.log10(1e3 * time_constant_s[-1])]},
        yaxis={"type": "log", "title": {"text": "error of the size [µm²]"}, "exponentformat": "power",
               **_decade_ticks(low, high),
               "range": [_rounded(low - 0.1), _rounded(high + 0.1)]},
        height=420,
    )  # fmt: skip
    return drawn


def _decade_ticks(low: float, high: float) -> dict[str, object]:
    """Ticks of a logarithmic axis from 10^low to 10^high."""
    if high - low > _FEW_DECADES:
        return {"dtick": 1}
    values = [step * 10.0**power for power in range(math.floor(low), math.ceil(high) + 1) for step in (1, 2, 5)]
    return {"tickvals": [_rounded(value) for value in values], "ticktext": [f"{value:.6g}" for value in values]}


def _rounded(value: float) -> float:
    """Six digits: the last ones of a result may depend on the machine, and equal results shall look alike."""
    return float(f"{value:.6g}")


def _edges(size_um: Vector) -> Vector:
    """Edges of bins as Freedman and Diaconis choose them, at most `_BINS` between the bulk's ends."""
    low, high = float(size_um.min()), float(size_um.max())
    if high - low <= 1e-9 * max(abs(low), 1.0):
        half = max(0.05, 1e-3 * abs(low))
        return np.array([low - half, low + half])
    bulk = np.quantile(size_um, [0.25, 0.75])
    width = 2.0 * float(bulk[1] - bulk[0]) / len(size_um) ** (1.0 / 3.0)
    count = _BINS if width <= 0 else int(np.clip(math.ceil((high - low) / width), 5, _BINS))
    return np.linspace(low, high, count + 1)


def _upright(drawn: go.Figure, marks: Sequence[tuple[float, str, str, str]]) -> None:
    for value, name, colour, dash in marks:
        drawn.add_shape(
            type="line", xref="x", x0=value, x1=value, yref="y domain", y0=0, y1=0.93,
            line={"color": colour, "width": 1.8, "dash": dash},
        )  # fmt: skip
        drawn.add_annotation(
            text=name, font={"color": colour, "size": 12}, x=value, xref="x", y=0.93, yref="y domain",
            yanchor="bottom", showarrow=False,
        )  # fmt: skip
