"""How do tool and workpiece vibrate, what does that leave on the part, and where do the chains agree."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import plotly.graph_objects as go

from selector.figures import style
from selector.figures.panels import Line, Panel, stacked
from selector.figures.style import log_ticks
from selector.number_text import number_text
from selector.physics.vibration.periodic_error import Cutting, PeriodicError, StabilityLimit, Surface
from selector.types import Vector

MOST_SOURCES = len(style.GROUPS)  #: Sources that are told apart by colour; answers and forces are drawn of no more.
_PANEL_PX, _TAPPED_PX, _GAP_PX, _BELOW_PX = 250, 190, 34, 50
_MOTIONS = (style.PREDICTED, style.RESIDUAL, style.INK)
_DECADES = 4.0  #: Answers weaker than this many powers of ten below the strongest are off the picture.


@dataclass(frozen=True, eq=False)
class Answer:
    """Motion of one final member per unit force of one source."""

    source: str
    coupled_um_per_n: Vector  #: (n_frequencies,): Amplitude by the coupled structure [µm/N]
    #: (n_frequencies,): By the chains, NaN where none leads from the source to the final [µm/N]
    chains_um_per_n: Vector | None
    lines_hz: Vector  #: (n_lines,): Frequencies at which the source shakes [Hz]


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

    `answers` is final member → its answer to every source, `colours` that of `source_colours`, `title` plain text, as
    `style.label` makes it. At `split_hz` the chains of the low range end and those of the high one begin [Hz].
    """
    ends = np.log10(frequency_hz[[0, -1]]).tolist()
    axes = [f"{style.label(final, 12)} [µm/N]" for final in answers]
    drawn = _over_frequency(title, axes, _PANEL_PX, ends)
    has_chains = any(one.chains_um_per_n is not None for ones in answers.values() for one in ones)
    named: set[str] = set()
    for key, ones in zip(map(_key, range(len(axes))), answers.values(), strict=True):
        strongest = np.log10(max(float(one.coupled_um_per_n.max()) for one in ones))
        weakest = np.log10(min(float(one.coupled_um_per_n.min()) for one in ones))
        drawn.layout[f"yaxis{key}"].range = [max(weakest - 0.15, strongest - _DECADES), strongest + 0.25]
        for one in ones:
            is_first = one.source not in named
            named.add(one.source)
            _add_answer(drawn, frequency_hz, one, colours[one.source], key, is_first=is_first)
        if split_hz is not None and has_chains:
            drawn.add_shape(style.rule(split_hz, style.INK, panel=key))
    if has_chains:
        for name, dash in (("coupled", "solid"), ("chains", "dash")):
            style.curve(drawn, [None], [None], style.INK, name, dash=dash)
    return drawn


def _over_frequency(title: str, axes: Sequence[str], panel_px: int, ends: Sequence[float]) -> go.Figure:
    """Panels whose axes are logarithmic, with these titles, over frequencies from 10^ends to 10^ends."""
    drawn = style.rows(title, [panel_px] * len(axes), _GAP_PX, _BELOW_PX)
    drawn.update_xaxes(type="log", range=ends, **log_ticks(*ends))
    drawn.update_xaxes(title_text="frequency [Hz]", row=len(axes))
    drawn.update_yaxes(type="log", dtick=1, exponentformat="power")
    for number, axis in enumerate(axes, start=1):
        drawn.update_yaxes(title_text=axis, row=number)
    return drawn


def _key(number: int) -> str:
    """What the axes of a panel end with; they are counted from 0."""
    return str(number + 1) if number else ""


def _add_answer(drawn: go.Figure, frequency_hz: Vector, one: Answer, colour: str, key: str, *, is_first: bool) -> None:
    name = style.label(one.source, 16)
    common: dict[str, Any] = {"xaxis": f"x{key}", "yaxis": f"y{key}", "legendgroup": name}
    told = "%{x:.4g} Hz: %{y:.3g} µm/N<extra>" + name
    coupled = f"{told}, coupled</extra>"
    style.curve(drawn, frequency_hz, one.coupled_um_per_n, colour, name, coupled, showlegend=is_first, **common)
    common["showlegend"] = False
    if one.chains_um_per_n is not None:
        look = {"width": 1.6, "dash": "dash"}
        style.curve(drawn, frequency_hz, one.chains_um_per_n, colour, name, f"{told}, chains</extra>", **look, **common)
    there = one.lines_hz[(one.lines_hz >= frequency_hz[0]) & (one.lines_hz <= frequency_hz[-1])]
    at = np.exp(np.interp(np.log(there), np.log(frequency_hz), np.log(np.maximum(one.coupled_um_per_n, 1e-300))))
    hollow = {"line": {"color": colour, "width": 2}}
    style.points(drawn, there, at, "#ffffff", name, f"{told}, line</extra>", size=7, marker=hollow, **common)


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

    Motions, forces and speeds stand by what they are called [µm, N, r/min], from the start of what is shown [s].
    `title` is plain text, as `style.label` makes it.
    """
    panels = []
    turning = {name: rpm for name, rpm in speeds_rpm.items() if np.ptp(rpm) > 0}
    if turning:
        lines = [Line(name, time_s, rpm, style.GROUPS[k % 6]) for k, (name, rpm) in enumerate(turning.items())]
        panels.append(Panel("speed [r/min]", lines, 90, least=0.0))
    *parts, last = motions_um
    if parts:
        lines = [Line(final_text(name), time_s, motions_um[name], _MOTIONS[k % 3]) for k, name in enumerate(parts)]
        panels.append(Panel("motion [µm]", lines, 190, least=0.0))
    panels.append(Panel(f"{final_text(last)} [µm]", [Line("", time_s, motions_um[last], style.INK)], 190, least=0.0))
    shown = [name for name in colours if name in forces_n][:MOST_SOURCES]
    if shown:
        lines = [Line(name, time_s, forces_n[name], colours.get(name, style.MUTED), width=1.4) for name in shown]
        panels.append(Panel("force [N]", lines, 150, least=0.0))
    return stacked(title, panels, float(time_s[-1]))


_HEIGHT_PANEL_PX, _HEIGHT_GAP_PX = 320, 66
_HEIGHT_DECADES = 5.0  #: Errors lower than this many powers of ten below the highest are off the picture.
ZONES = {"roughness": "#eaf3f9", "waviness": "#f4f4f4", "lobing": "#fdf1e3", "runout": "#f9ecf3"}
_SEVERAL = "several sources"
_LEAST_LOBES = 1.5  #: Waves per revolution from which on an error is one of form, and below which it is runout.
_ALONG = {"cut": "wavelength along the cut [mm]", "feed": "wavelength along the feed [mm]"}


def stability_lobes(limit: StabilityLimit, title: str) -> go.Figure:
    """Depth of cut at which chatter begins over the speed of the workpiece, from a quarter to four times its own."""
    speed, depth = limit.lobes
    known = depth[np.isfinite(depth)]
    drawn = style.figure(title, 300)
    if not known.size:
        return drawn
    top = 3.0 * float(np.median(known))
    shown = np.minimum(depth, 2.0 * top)
    style.curve(drawn, speed, shown, style.PREDICTED, "chatter begins", "%{x:.4g} r/min: %{y:.3g} mm<extra></extra>")
    drawn.add_shape(style.rule(limit.cutting.workpiece_rpm, style.INK))
    ends = np.log10(speed[[0, -1]]).tolist()
    drawn.layout.xaxis = {
        "type": "log", "range": ends, "title": {"text": "speed of the workpiece [r/min]"}, **log_ticks(*ends)
    }  # fmt: skip
    drawn.layout.yaxis = {"range": [0.0, top], "title": {"text": "depth of cut [mm]"}}
    return drawn


def errors_over_wavelength(
    errors: Sequence[PeriodicError], cutting: Cutting, surface: Surface, colours: Mapping[str, str], title: str
) -> go.Figure:
    """Both heights of every error over its wavelength; a second panel has those that lie along the feed.

    Filled: what a tip leaves that copies the motion; hollow: W by the law of the cutting force (V eq. 2).

    At least one error; those of several sources are grey. `title` is plain text, as `style.label` makes it.
    """
    highest = max(max(one.published_um, one.kinematic_um) for one in errors)
    panels = [(key, [one for one in errors if one.direction == key]) for key in _ALONG]
    panels = [(direction, ones) for direction, ones in panels if ones]
    drawn = style.rows(title, [_HEIGHT_PANEL_PX] * len(panels), _HEIGHT_GAP_PX, _BELOW_PX, is_shared=False)
    top = math.log10(highest) if highest > 0 else 0.0
    for number, (direction, ones) in enumerate(panels):
        key = _key(number)
        waves = np.log10([one.wavelength_mm for one in ones])
        low, high = float(waves.min()) - 0.3, float(waves.max()) + 0.3
        if direction == "cut":
            # the limits of the kinds belong into the picture
            low = min(low, math.log10(surface.roughness_below_mm) - 0.5)
            high = max(high, _lobing_mm(cutting, surface)[0])
        _add_zones(drawn, direction, cutting, surface, key, (low, high))
        _add_errors(drawn, ones, colours, key, is_first=number == 0)
        look = {"showgrid": False, **log_ticks(low, high)}
        drawn.update_xaxes(type="log", range=[low, high], title_text=_ALONG[direction], **look, row=number + 1)
    heights = {"range": [top - _HEIGHT_DECADES, top + 0.45], "title_text": "height [µm]"}
    drawn.update_yaxes(type="log", dtick=1, exponentformat="none", **heights)
    for name, fill in (("copied motion", style.INK), ("W by the force", "#ffffff")):
        style.points(drawn, [None], [None], fill, name, marker={"line": {"color": style.INK, "width": 1.8}})
    return drawn


def _add_errors(
    drawn: go.Figure, ones: Sequence[PeriodicError], colours: Mapping[str, str], key: str, *, is_first: bool
) -> None:
    axes = {"xaxis": f"x{key}", "yaxis": f"y{key}"}
    by_source: dict[str, list[PeriodicError]] = {}
    for one in ones:
        by_source.setdefault(one.sources[0] if len(one.sources) == 1 else _SEVERAL, []).append(one)
    for source, mine in by_source.items():
        colour, name = colours.get(source, style.MUTED), style.label(source, 16)
        x: list[float | None] = []
        y: list[float | None] = []
        for one in mine:
            x += [one.wavelength_mm, one.wavelength_mm, None]
            y += [one.published_um or None, one.kinematic_um or None, None]
        style.curve(drawn, x, y, colour, width=1, showlegend=False, legendgroup=name, **axes)
        for heights, fill, told in (
            ([one.kinematic_um or None for one in mine], colour, "copied motion"),
            ([one.published_um or None for one in mine], "#ffffff", "W by the force"),
        ):
            is_new = is_first or name not in [trace.legendgroup for trace in drawn.data[:-1]]
            text = [f"{number_text(one.frequency_hz, 4)} Hz, {one.kind}" for one in mine]
            more = {"text": text, "legendgroup": name, "showlegend": fill == colour and is_new, **axes}
            hover = f"%{{text}}: %{{y:.3g}} µm, %{{x:.4g}} mm<extra>{told}</extra>"
            look = {"line": {"color": colour, "width": 1.8}}
            style.points(drawn, [one.wavelength_mm for one in mine], heights, fill, name, hover, marker=look, **more)


def _add_zones(
    drawn: go.Figure, direction: str, cutting: Cutting, surface: Surface, key: str, ends: tuple[float, float]
) -> None:
    rough = math.log10(surface.roughness_below_mm)
    if direction == "cut":
        lobing, runout = _lobing_mm(cutting, surface)
        rough = min(rough, lobing)
        zones = [("roughness", -math.inf, rough), ("waviness", rough, lobing)]
        zones += [("lobing", lobing, runout), ("runout", runout, math.inf)]
    else:
        zones = [("roughness", -math.inf, rough), ("waviness", rough, math.inf)]
    low, high = ends
    for name, start, stop in zones:
        start, stop = max(start, low), min(stop, high)
        if stop <= start:
            continue
        drawn.add_shape(style.zone(10**start, 10**stop, ZONES[name], 1.0, panel=key))
        if stop - start > 0.08 * (high - low):
            at = {"xref": f"x{key}", "yref": f"y{key} domain", "yanchor": "top"}
            drawn.add_annotation(style.words(name, (start + stop) / 2, 1.0, style.MUTED, **at))


def _lobing_mm(cutting: Cutting, surface: Surface) -> tuple[float, float]:
    """log₁₀ of the wavelengths [mm] at which errors of form begin and end."""
    around = math.pi * cutting.diameter_mm
    return math.log10(around / surface.lobing_up_to_upr), math.log10(around / _LEAST_LOBES)


def tapped_compliances(panels: Mapping[str, Mapping[str, tuple[Vector, Vector]]], title: str) -> go.Figure:
    """Amplitudes per force over frequency, a panel each response: "measured" as dots, "by the file", and "fitted".

    `panels` is title → curve → (frequency [Hz], amplitude [µm/N]); `title` plain text, as `style.label` makes it.
    """
    every = np.concatenate([x for curves in panels.values() for x, _ in curves.values()])
    ends = np.log10([every.min(), every.max()]).tolist()
    drawn = _over_frequency(title, [f"{style.label(called, 24)}<br>[µm/N]" for called in panels], _TAPPED_PX, ends)
    looks = {"by the file": (style.MUTED, "dash"), "fitted": (style.PREDICTED, "solid")}
    for number, curves in enumerate(panels.values()):
        key = _key(number)
        axes: dict[str, Any] = {"xaxis": f"x{key}", "yaxis": f"y{key}", "showlegend": number == 0}
        for name, (x, y) in curves.items():
            if name in looks:
                style.curve(drawn, x, y, looks[name][0], name, dash=looks[name][1], **axes)
            else:
                style.points(drawn, x, y, style.INK, name, "%{x:.4g} Hz: %{y:.3g} µm/N", size=4, **axes)
    return drawn
