"""Pictures of the blind proof: what is taken for what, how strong an effect must be, what confidence is worth."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from selector.figures import style
from selector.number_text import number_text

_CELL_PX, _ROW_PX = 26, 24
_STRENGTH_COLOURS = ("#9ecae1", "#3787c0", "#08306b", "#000000")
_MOST_BINS = 40
_LONGEST_ID = 34


@dataclass(frozen=True)
class Share:
    """A share of cases with its 95 % interval."""

    value: float
    low: float
    high: float


def _interval(shares: Sequence[Share], **more: float) -> dict[str, Any]:
    """Error bars."""
    above, below = [one.high - one.value for one in shares], [one.value - one.low for one in shares]
    return {"type": "data", "symmetric": False, "array": above, "arrayminus": below, **more}


def confusion_matrix(
    true: Sequence[str],
    said: Sequence[str],
    counts: NDArray[np.int64],
    cases: Sequence[int],
    right: Sequence[Sequence[str]],
) -> go.Figure:
    """What was put in (rows) against what was said (columns), as a share of the cases of a row."""
    counts = counts.reshape(len(true), len(said))
    share = counts / np.maximum(np.asarray(cases, dtype=np.float64), 1.0)[:, None]
    is_right = np.array([[name in row for name in said] for row in right]).reshape(counts.shape)
    wrong = int(counts[~is_right].sum())
    title = (
        f"{int(counts[is_right].sum())} answers are right, {wrong} are not"
        if wrong
        else f"All {int(counts.sum())} answers are right"
    )
    drawn = style.figure(title, 210 + _CELL_PX * len(true))
    for chosen, scale in ((is_right, style.LIKENESS_SCALE), (~is_right, style.HARM_SCALE)):
        drawn.add_heatmap(
            z=np.where(chosen & (counts > 0), share, np.nan), zmin=0.0, zmax=1.0, showscale=False, xgap=1, ygap=1,
            colorscale=[list(stop) for stop in scale], customdata=counts,
            hovertemplate="put in: %{y}<br>said: %{x}<br>%{customdata} cases, %{z:.0%}<extra></extra>",
        )  # fmt: skip
    for i, j in zip(*np.nonzero(counts), strict=True):
        drawn.add_annotation(
            x=int(j), y=int(i), text=str(counts[i, j]), showarrow=False,
            font={"size": 11, "color": "#ffffff" if share[i, j] > 0.55 else style.INK},
        )  # fmt: skip
    rows = [f"{style.label(name, _LONGEST_ID)} ({n})" for name, n in zip(true, cases, strict=True)]
    drawn.update_xaxes(
        tickvals=list(range(len(said))), ticktext=[style.label(name, _LONGEST_ID) for name in said], tickangle=-60,
        side="bottom", showgrid=False, title_text="said", range=[-0.5, len(said) - 0.5],
    )  # fmt: skip
    drawn.update_yaxes(
        tickvals=list(range(len(true))), ticktext=rows, range=[len(true) - 0.5, -0.5], showgrid=False,
        title_text="put in (cases)",
    )  # fmt: skip
    return drawn


def power_by_effect(
    found: Mapping[str, Mapping[float, Share]], oracle: Mapping[float, float], *, all_effects: Mapping[float, Share]
) -> go.Figure:
    """How often each effect was found at each strength d′, with the oracle's chance as dotted lines.

    `found`: id → strength → share that was named, or in a set; `oracle`: strength → chance that somebody finds it who
    knows the course of the effect.
    """
    strengths = sorted(oracle)
    told = ", ".join(f"{100 * all_effects[d].value:.0f} % at d′ = {d:g}" for d in strengths if d in all_effects)
    drawn = style.figure(
        f"Found, alone or in a set: {told}" if told else "No effect of the catalogue", 150 + _ROW_PX * len(found)
    )
    names = list(found)
    for k, d_prime in enumerate(strengths):
        colour = _STRENGTH_COLOURS[min(k, len(_STRENGTH_COLOURS) - 1)]
        at = [(i, found[name][d_prime]) for i, name in enumerate(names) if d_prime in found[name]]
        offset = 0.22 * (k - (len(strengths) - 1) / 2)
        half, name = _interval([share for _, share in at], thickness=1.2, width=0), f"d′ = {d_prime:g}"
        shares, rows = [share.value for _, share in at], [i + offset for i, _ in at]
        style.points(drawn, shares, rows, colour, name, f"{name}: %{{x:.0%}}", error_x=half)
        drawn.add_shape(style.rule(oracle[d_prime], colour))
    drawn.update_xaxes(title_text="share found [–]", range=[-0.02, 1.02], tickformat=".0%")
    drawn.update_yaxes(
        tickvals=list(range(len(names))), ticktext=[style.label(name, _LONGEST_ID) for name in names],
        range=[len(names) - 0.4, -0.6], ticks="",
    )  # fmt: skip
    return drawn


def reliability(confidence: Sequence[float], right: Sequence[Share], counts: Sequence[int], error: float) -> go.Figure:
    """The share of named effects that is right against the confidence with which they were named."""
    drawn = style.figure(f"Confidence and truth differ by {number_text(error)} on average", 430)
    style.curve(drawn, [0.0, 1.0], [0.0, 1.0], style.MUTED, "as sure as right", dash="dash")
    hover = "%{customdata} effects, mean confidence %{x:.2f}: %{y:.0%} right"
    sizes = [6 + 4 * math.log10(max(n, 1)) for n in counts]
    more = {"mode": "lines+markers", "error_y": _interval(right), "customdata": list(counts)}
    shares = [share.value for share in right]
    style.points(drawn, list(confidence), shares, style.PREDICTED, "named effects", hover, size=sizes, **more)
    drawn.update_xaxes(title_text="confidence [–]", range=[0.0, 1.02])
    drawn.update_yaxes(title_text="share that is right [–]", range=[0.0, 1.02])
    return drawn


def gap_closed(shares: Mapping[str, Sequence[float]]) -> go.Figure:
    """Share of the held-out gap between the recalibrated simulation and the oracle that each answerer closes."""
    first = next(iter(shares))
    median = float(np.median(shares[first])) if len(shares[first]) else float("nan")
    drawn = style.figure(
        f"{style.label(first)} closes {number_text(100 * median)} % of the gap in the median case",
        150 + 40 * len(shares),
    )
    for k, (name, values) in enumerate(shares.items()):
        clipped = np.clip(np.asarray(values, dtype=np.float64), -1.0, 1.5)
        drawn.add_box(
            x=clipped, y=[style.label(name)] * len(clipped), orientation="h", boxpoints="outliers", showlegend=False,
            marker={"color": style.PREDICTED if k == 0 else style.MUTED, "size": 3}, hoverinfo="x",
        )  # fmt: skip
    for at, colour in ((0.0, style.MUTED), (1.0, style.CHOSEN)):
        drawn.add_shape(style.rule(at, colour, width=2))
    drawn.update_xaxes(title_text="share of the gap closed [–]; 0 = recalibrated, 1 = oracle", range=[-1.05, 1.55])
    drawn.update_yaxes(autorange="reversed", ticks="")
    return drawn


def answerers_compared(
    false_on_clean: Mapping[str, Share], found: Mapping[str, Share], *, strength: float
) -> go.Figure:
    """Who names what is not there, and who finds what is: two shares for every answerer."""
    names = list(found)
    first = names[0]
    drawn = style.figure(
        f"{style.label(first)} finds {100 * found[first].value:.0f} %, and names something false on "
        f"{100 * false_on_clean[first].value:.0f} % of clean cases",
        140 + 44 * len(names),
    )
    for offset, shares, text, colour in (
        (-0.38, found, f"right name, or in a set, at d′ = {strength:g}", style.CHOSEN),
        (0.0, false_on_clean, "any false name on clean cases", style.RESIDUAL),
    ):
        found_by, rows = [shares[name] for name in names], list(range(len(names)))
        place = {"offset": offset, "width": 0.36, "error_x": _interval(found_by, thickness=1.2)}
        style.bars(drawn, [one.value for one in found_by], rows, colour, text, f"{text}: %{{x:.1%}}", **place)
    drawn.update_xaxes(title_text="share of cases [–]", range=[0.0, 1.02], tickformat=".0%")
    drawn.update_yaxes(**style.rows_of([style.label(name) for name in names]))
    return drawn


def seconds_histogram(seconds: Sequence[float], limits: Sequence[float]) -> go.Figure:
    """How long a case takes, on a logarithmic axis, with the limits that are wanted."""
    values = np.asarray(seconds, dtype=np.float64)
    values = np.log10(np.maximum(values, 1e-3))
    median = 10.0 ** float(np.median(values))
    drawn = style.figure(
        f"A case takes {number_text(median)} s in the median, {number_text(10.0 ** values.max())} s at most", 330
    )
    low, high = float(values.min()), max(float(values.max()), *(math.log10(limit) for limit in limits))
    edges = np.linspace(low - 0.05, high + 0.05, min(_MOST_BINS, 8 + len(values) // 4))
    count, _ = np.histogram(values, edges)
    drawn.add_bar(
        x=(edges[1:] + edges[:-1]) / 2, y=count, width=np.diff(edges), showlegend=False,
        marker={"color": style.PREDICTED}, hovertemplate="%{y} cases<extra></extra>",
    )  # fmt: skip
    for limit in limits:
        at = math.log10(limit)
        drawn.add_shape(style.rule(at, style.INK, width=2))
        drawn.add_annotation(style.words(f"{limit:g} s", at, 1.0, yref="paper", yanchor="bottom"))
    ticks = [
        tick
        for tick in (0.01, 0.03, 0.1, 0.3, 1, 3, 10, 30, 100, 300, 1000)
        if low - 0.1 <= math.log10(tick) <= high + 0.1
    ]
    drawn.update_xaxes(
        title_text="time for a case [s]", tickvals=[math.log10(tick) for tick in ticks],
        ticktext=[f"{tick:g}" for tick in ticks],
    )  # fmt: skip
    drawn.update_yaxes(title_text="cases [–]", rangemode="tozero")
    return drawn
