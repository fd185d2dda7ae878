"""How do tool and workpiece vibrate: their answer over frequency, where each line goes, what the part keeps, when."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from selector.figures import style
from selector.figures.log_axis import log_ticks
from selector.figures.panels import Line, Panel, stacked
from selector.physics.vibration.final_motion import Method
from selector.physics.vibration.vibration_summary import LineSummary

Vector = NDArray[np.float64]

MOST_BARS = 14
MOST_SOURCES = len(style.GROUPS)
"""Sources that are told apart by colour; answers and forces are drawn of no more."""

_PANEL_PX, _GAP_PX, _BELOW_PX = 250, 34, 50
_BAR_PX = 26
_OTHER = {"chains": "chains", "coupled": "coupled structure"}
_MOTIONS = (style.PREDICTED, style.RESIDUAL, style.INK)
_DECADES = 4.0
"""Answers weaker than this many powers of ten below the strongest are off the picture."""


@dataclass(frozen=True, eq=False)
class Answer:
    """Motion of one final member per unit force of one source.

    Attributes
    ----------
    source : str
    coupled_um_per_n : ndarray of shape (n_frequencies,)
        Amplitude by the coupled structure [µm/N].
    chains_um_per_n : ndarray of shape (n_frequencies,) or None
        By the chains, NaN where none leads from the source to the final [µm/N].
    lines_hz : ndarray of shape (n_lines,)
        Frequencies at which the source shakes [Hz].
    """

    source: str
    coupled_um_per_n: Vector
    chains_um_per_n: Vector | None
    lines_hz: Vector


def source_colours(names: Sequence[str]) -> dict[str, str]:
    """Source → its colour, the same in every picture; those after the first `MOST_SOURCES` are grey."""
    return {name: style.GROUPS[k] if k < MOST_SOURCES else style.MUTED for k, name in enumerate(names)}


def response_over_frequency(
    frequency_hz: Vector,
    answers: Mapping[str, Sequence[Answer]],
    colours: Mapping[str, str],
    title: str,
    split_hz: float | None = None,
) -> go.Figure:
    """Amplitude per unit force over frequency, a panel each final member; lines of the sources as circles.

    Parameters
    ----------
    frequency_hz : ndarray of shape (n_frequencies,)
        [Hz].
    answers : mapping of str to sequence of Answer
        Final member → its answer to every source.
    colours : mapping of str to str
        As of `source_colours`.
    title : str
        Plain text, as `style.label` makes it.
    split_hz : float, optional
        Where the chains of the low range end and those of the high one begin [Hz].
    """
    count = len(answers)
    inside = count * _PANEL_PX + (count - 1) * _GAP_PX
    drawn = style.figure(title, inside)
    drawn.update_layout(height=int(drawn.layout.margin.t) + inside + _BELOW_PX)
    ends = np.log10(frequency_hz[[0, -1]])
    has_chains = any(one.chains_um_per_n is not None for ones in answers.values() for one in ones)
    named: set[str] = set()
    for number, (final, ones) in enumerate(answers.items()):
        key = "" if number == 0 else str(number + 1)
        top = 1.0 - number * (_PANEL_PX + _GAP_PX) / inside
        strongest = np.log10(max(float(one.coupled_um_per_n.max()) for one in ones))
        weakest = np.log10(min(float(one.coupled_um_per_n.min()) for one in ones))
        for one in ones:
            is_first = one.source not in named
            named.add(one.source)
            _add_answer(drawn, frequency_hz, one, colours[one.source], key, is_first=is_first)
        drawn.layout[f"xaxis{key}"] = {
            "type": "log", "anchor": f"y{key}", "range": ends.tolist(), "showticklabels": number == count - 1,
            "title": {"text": "frequency [Hz]" if number == count - 1 else ""}, **log_ticks(*ends.tolist()),
            **({"matches": "x"} if number else {}),
        }  # fmt: skip
        drawn.layout[f"yaxis{key}"] = {
            "type": "log", "anchor": f"x{key}", "domain": [max(top - _PANEL_PX / inside, 0.0), top], "dtick": 1,
            "title": {"text": f"{style.label(final, 12)} [µm/N]"}, "exponentformat": "power",
            "range": [max(weakest - 0.15, strongest - _DECADES), strongest + 0.25],
        }  # fmt: skip
        if split_hz is not None and has_chains:
            drawn.add_shape(
                type="line", xref=f"x{key}", x0=split_hz, x1=split_hz, yref=f"y{key} domain", y0=0, y1=1,
                line={"color": style.INK, "width": 1, "dash": "dot"},
            )  # fmt: skip
    if has_chains:
        for name, dash in (("coupled", "solid"), ("chains", "dash")):
            drawn.add_scatter(x=[None], y=[None], mode="lines", name=name, line={"color": style.INK, "dash": dash})
    return drawn


def _add_answer(drawn: go.Figure, frequency_hz: Vector, one: Answer, colour: str, key: str, *, is_first: bool) -> None:
    name = style.label(one.source, 16)
    common = {"xaxis": f"x{key}", "yaxis": f"y{key}", "legendgroup": name, "name": name}
    told = "%{x:.4g} Hz: %{y:.3g} µm/N<extra>" + name
    drawn.add_scatter(
        x=frequency_hz.astype(np.float32), y=one.coupled_um_per_n.astype(np.float32), mode="lines",
        line={"color": colour, "width": 1.8}, showlegend=is_first, hovertemplate=f"{told}, coupled</extra>", **common,
    )  # fmt: skip
    if one.chains_um_per_n is not None:
        drawn.add_scatter(
            x=frequency_hz.astype(np.float32), y=one.chains_um_per_n.astype(np.float32), mode="lines",
            connectgaps=False, line={"color": colour, "width": 1.6, "dash": "dash"}, showlegend=False,
            hovertemplate=f"{told}, chains</extra>", **common,
        )  # fmt: skip
    there = one.lines_hz[(one.lines_hz >= frequency_hz[0]) & (one.lines_hz <= frequency_hz[-1])]
    at = np.exp(np.interp(np.log(there), np.log(frequency_hz), np.log(np.maximum(one.coupled_um_per_n, 1e-300))))
    drawn.add_scatter(
        x=there.astype(np.float32), y=at.astype(np.float32), mode="markers", showlegend=False,
        marker={"color": "#ffffff", "size": 7, "line": {"color": colour, "width": 2}},
        hovertemplate=f"{told}, line</extra>", **common,
    )  # fmt: skip


def line_amplitudes(
    lines: Sequence[LineSummary], finals: Sequence[str], colours: Mapping[str, str], other: Method, title: str
) -> go.Figure:
    """The largest lines as bars in the colour of their source, side by side for every final; crosses: by `other`.

    Parameters
    ----------
    lines : sequence of LineSummary
    finals : sequence of str
        Keys of their motions: what stands side by side; lines are ranked by the last of them.
    colours : mapping of str to str
        As of `source_colours`.
    other : {"chains", "coupled"}
        The method by which the motions were not made.
    title : str
        Plain text, as `style.label` makes it.
    """
    ranked = sorted(lines, key=lambda one: -one.motion_um[finals[-1]])[:MOST_BARS]
    rows = list(range(len(ranked)))
    drawn = style.figure(title, 140 + _BAR_PX * len(rows))
    width = (1.0 - 0.04 * (len(finals) - 1)) / len(finals)
    for number, final in enumerate(finals):
        key = "" if number == 0 else str(number + 1)
        for source in dict.fromkeys(one.source for one in ranked):
            mine = [k for k in rows if ranked[k].source == source]
            drawn.add_bar(
                x=[ranked[k].motion_um[final] for k in mine], y=mine, orientation="h", width=0.62,
                xaxis=f"x{key}",
                name=style.label(source, 16), legendgroup=style.label(source, 16), showlegend=number == 0,
                marker={"color": colours[source]}, hovertemplate="%{x:.4g} µm<extra></extra>",
            )  # fmt: skip
        others = [one.chains_um[final] if other == "chains" else one.coupled_um[final] for one in ranked]
        if any(value is not None for value in others):
            drawn.add_scatter(
                x=others, y=rows, xaxis=f"x{key}", mode="markers", name=f"by the {_OTHER[other]}", legendgroup=other,
                showlegend=number == 0, hovertemplate=f"%{{x:.4g}} µm<extra>{_OTHER[other]}</extra>",
                marker={"symbol": "x-thin", "size": 10, "line": {"color": style.INK, "width": 2}},
            )  # fmt: skip
        start = number * (width + 0.04)
        drawn.layout[f"xaxis{key}"] = {
            "domain": [start, min(start + width, 1.0)], "title": {"text": f"{final_text(final)} [µm]"},
            "rangemode": "tozero", "nticks": 5, "exponentformat": "none", "anchor": "y",
        }  # fmt: skip
    drawn.update_layout(barmode="overlay")
    drawn.update_yaxes(
        range=[len(rows) - 0.4, -0.6], tickvals=rows, ticktext=[line_text(one) for one in ranked], showgrid=False,
        ticks="",
    )  # fmt: skip
    return drawn


def line_text(one: LineSummary) -> str:
    """A line by its source and frequency, as Plotly shows it."""
    return f"{style.label(one.source, 14)}, {one.frequency_hz:.4g} Hz"


def final_text(final: str) -> str:
    """What a final is called; of the difference, what it is the difference of."""
    return style.label(final.replace("_", " – ") if final == "tool_workpiece" else final, 20)


def motion_course(
    time_s: Vector,
    motions_um: Mapping[str, Vector],
    forces_n: Mapping[str, Vector],
    speeds_rpm: Mapping[str, Vector],
    colours: Mapping[str, str],
    title: str,
) -> go.Figure:
    """Motions over time, above them speeds of shafts that change, below the forces of sources that have a colour.

    Parameters
    ----------
    time_s : ndarray of shape (n_samples,)
        From the start of what is shown [s].
    motions_um, forces_n, speeds_rpm : mapping of str to ndarray of shape (n_samples,)
        By what they are called [µm, N, r/min].
    colours : mapping of str to str
        As of `source_colours`.
    title : str
        Plain text, as `style.label` makes it.
    """
    panels = []
    turning = {name: rpm for name, rpm in speeds_rpm.items() if np.ptp(rpm) > 0}
    if turning:
        lines = [Line(name, time_s, rpm, style.GROUPS[k % 6]) for k, (name, rpm) in enumerate(turning.items())]
        panels.append(Panel("speed [r/min]", lines, 90, least=0.0))
    *parts, last = motions_um
    if parts:
        panels.append(
            Panel(
                "motion [µm]",
                [Line(final_text(name), time_s, motions_um[name], _MOTIONS[k % 3]) for k, name in enumerate(parts)],
                190,
                least=0.0,
            )
        )
    panels.append(Panel(f"{final_text(last)} [µm]", [Line("", time_s, motions_um[last], style.INK)], 190, least=0.0))
    shown = [name for name in colours if name in forces_n][:MOST_SOURCES]
    if shown:
        lines = [Line(name, time_s, forces_n[name], colours.get(name, style.MUTED), width=1.4) for name in shown]
        panels.append(Panel("force [N]", lines, 150, least=0.0))
    return stacked(title, panels, float(time_s[-1]))
