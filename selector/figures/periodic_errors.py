"""What does vibration leave on the part: heights of periodic errors over their wavelength, in zones of their kinds."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
import plotly.graph_objects as go

from selector.figures import style
from selector.figures.log_axis import log_ticks
from selector.physics.vibration.cutting import Cutting
from selector.physics.vibration.periodic_error import PeriodicError, Surface

_PANEL_PX, _GAP_PX, _BELOW_PX = 320, 66, 50
_DECADES = 5.0
"""Errors lower than this many powers of ten below the highest are off the picture."""

ZONES = {"roughness": "#eaf3f9", "waviness": "#f4f4f4", "lobing": "#fdf1e3", "runout": "#f9ecf3"}
_SEVERAL = "several sources"
_LEAST_LOBES = 1.5
"""Waves per revolution from which on an error is one of form, and below which it is runout."""

_ALONG = {"cut": "wavelength along the cut [mm]", "feed": "wavelength along the feed [mm]"}


def errors_over_wavelength(
    errors: Sequence[PeriodicError], cutting: Cutting, surface: Surface, colours: Mapping[str, str], title: str
) -> go.Figure:
    """Both heights of every error over its wavelength; a second panel has those that lie along the feed.

    Filled: what a tip leaves that copies the motion; hollow: W by the law of the cutting force (V eq. 2).

    Parameters
    ----------
    errors : sequence of PeriodicError
        At least one.
    cutting : Cutting
    surface : Surface
        Where one kind ends and the next begins.
    colours : mapping of str to str
        Source → colour; errors of several sources are grey.
    title : str
        Plain text, as `style.label` makes it.
    """
    highest = max(max(one.published_um, one.kinematic_um) for one in errors)
    panels = [(key, [one for one in errors if one.direction == key]) for key in _ALONG]
    panels = [(direction, ones) for direction, ones in panels if ones]
    inside = len(panels) * _PANEL_PX + (len(panels) - 1) * _GAP_PX
    drawn = style.figure(title, inside)
    drawn.update_layout(height=int(drawn.layout.margin.t) + inside + _BELOW_PX)
    top = math.log10(highest) if highest > 0 else 0.0
    for number, (direction, ones) in enumerate(panels):
        key = "" if number == 0 else str(number + 1)
        edge = 1.0 - number * (_PANEL_PX + _GAP_PX) / inside
        waves = np.log10([one.wavelength_mm for one in ones])
        low, high = float(waves.min()) - 0.3, float(waves.max()) + 0.3
        if direction == "cut":
            # the limits of the kinds belong into the picture
            low, high = (
                min(low, math.log10(surface.roughness_below_mm) - 0.5),
                max(high, _lobing_mm(cutting, surface)[0]),
            )
        _add_zones(drawn, direction, cutting, surface, key, (low, high))
        _add_errors(drawn, ones, colours, key, is_first=number == 0)
        drawn.layout[f"xaxis{key}"] = {
            "type": "log", "anchor": f"y{key}", "range": [low, high], "title": {"text": _ALONG[direction]},
            "showgrid": False, **log_ticks(low, high),
        }  # fmt: skip
        drawn.layout[f"yaxis{key}"] = {
            "type": "log", "anchor": f"x{key}", "domain": [max(edge - _PANEL_PX / inside, 0.0), edge], "dtick": 1,
            "range": [top - _DECADES, top + 0.45], "title": {"text": "height [µm]"}, "exponentformat": "none",
        }  # fmt: skip
    for name, fill in (("copied motion", style.INK), ("W by the force", "#ffffff")):
        drawn.add_scatter(
            x=[None], y=[None], mode="markers", name=name,
            marker={"color": fill, "size": 9, "line": {"color": style.INK, "width": 1.8}},
        )  # fmt: skip
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
        between: list[list[float | None]] = [[], []]
        for one in mine:
            between[0] += [one.wavelength_mm, one.wavelength_mm, None]
            between[1] += [one.published_um or None, one.kinematic_um or None, None]
        drawn.add_scatter(
            x=between[0], y=between[1], mode="lines", line={"color": colour, "width": 1}, hoverinfo="skip",
            showlegend=False, legendgroup=name, **axes,
        )  # fmt: skip
        for heights, fill, told in (
            ([one.kinematic_um or None for one in mine], colour, "copied motion"),
            ([one.published_um or None for one in mine], "#ffffff", "W by the force"),
        ):
            drawn.add_scatter(
                x=[one.wavelength_mm for one in mine],
                y=heights,
                mode="markers",
                name=name,
                legendgroup=name,
                showlegend=fill == colour
                and (is_first or name not in [trace.legendgroup for trace in drawn.data[:-1]]),
                marker={"color": fill, "size": 9, "line": {"color": colour, "width": 1.8}},
                text=[f"{style.number(one.frequency_hz, 4)} Hz, {one.kind}" for one in mine],
                hovertemplate=f"%{{text}}: %{{y:.3g}} µm, %{{x:.4g}} mm<extra>{told}</extra>",
                **axes,
            )


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
        drawn.add_shape(
            type="rect", xref=f"x{key}", x0=10**start, x1=10**stop, yref=f"y{key} domain", y0=0, y1=1,
            fillcolor=ZONES[name], line={"width": 0}, layer="below",
        )  # fmt: skip
        if stop - start > 0.08 * (high - low):
            drawn.add_annotation(
                text=name, xref=f"x{key}", x=(start + stop) / 2, yref=f"y{key} domain", y=1.0, yanchor="top",
                showarrow=False, font={"color": style.MUTED, "size": 12},
            )  # fmt: skip


def _lobing_mm(cutting: Cutting, surface: Surface) -> tuple[float, float]:
    """log₁₀ of the wavelengths [mm] at which errors of form begin and end."""
    around = math.pi * cutting.diameter_mm
    return math.log10(around / surface.lobing_up_to_upr), math.log10(around / _LEAST_LOBES)
