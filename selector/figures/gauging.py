"""How a gauge sees a part: its characteristic with line and thresholds, one part over time, the chain's waveform."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from selector.figures import style
from selector.figures.panels import Line, Panel, stacked
from selector.physics.gauging.transducer import LinearGauge

Vector = NDArray[np.float64]

CURVE, LINE, THRESHOLD = style.PREDICTED, style.RESIDUAL, style.CHOSEN
SEEN, TRUE = style.RESIDUAL, style.PREDICTED
_RIGHT_PX = 150
_LABEL_PX = 17
_CURVE_PX, _ERROR_PX, _GAP_PX, _BOTTOM_PX = 300, 130, 16, 44
_SHOWN_ERRORS = 4.0
"""The error of the line is shown up to so many times its largest one within the valid range."""


def gauge_characteristic(
    allowance_um: Vector,
    voltage_v: Vector,
    gauge: LinearGauge,
    line_um: tuple[float, float],
    thresholds: Sequence[tuple[float, float]] = (),
) -> go.Figure:
    """Mean smoothed voltage over the allowance, the line beside it, and by how much of size the line is wrong.

    Parameters
    ----------
    allowance_um, voltage_v : ndarray of shape (n_points,)
        The characteristic, allowances increasing [µm], [V].
    gauge : LinearGauge
        The line.
    line_um : tuple of float
        Allowances between which the line holds [µm].
    thresholds : sequence of (until_um, threshold_v)
        One a stage: allowance at which it is to end [µm], and voltage of the relay [V].
    """
    line_v = gauge.bias_v + gauge.gain_v_per_um * allowance_um
    error_um = (voltage_v - line_v) / gauge.gain_v_per_um
    valid = (allowance_um >= line_um[0]) & (allowance_um <= line_um[1])
    title = (
        f"Computed: {style.number(gauge.gain_v_per_um * 1e3)} mV/µm at {style.number(gauge.allowance_um)} µm; the line "
        f"holds from {style.number(line_um[0])} to {style.number(line_um[1])} µm"
    )
    inside = _CURVE_PX + _GAP_PX + _ERROR_PX
    drawn = style.figure(title, inside)
    drawn.update_layout(height=int(drawn.layout.margin.t) + inside + _BOTTOM_PX, showlegend=False)
    drawn.update_layout(margin={"b": _BOTTOM_PX, "r": _RIGHT_PX})
    split = (_ERROR_PX + _GAP_PX / 2) / inside
    low, high = _widened(voltage_v, [threshold for _, threshold in thresholds])
    most = _SHOWN_ERRORS * max(float(np.abs(error_um[valid]).max(initial=0.0)), 1e-3)
    shown = (line_v >= low) & (line_v <= high)
    for x, y, axis, colour, dash, name in (
        (allowance_um, voltage_v, "", CURVE, "solid", "characteristic"),
        (allowance_um[shown], line_v[shown], "", LINE, "dash", "line"),
        (allowance_um, error_um, "2", LINE, "solid", "error of the line"),
    ):
        unit = "µm" if axis else "V"
        drawn.add_scatter(
            x=x.astype(np.float32), y=y.astype(np.float32), xaxis=f"x{axis}", yaxis=f"y{axis}", mode="lines", name=name,
            line={"color": colour, "width": 2.0, "dash": dash},
            hovertemplate=f"%{{x:.4g}} µm: %{{y:.4g}} {unit}<extra>{name}</extra>",
        )  # fmt: skip
    _band(drawn, line_um, allowance_um)
    _thresholds(drawn, allowance_um, voltage_v, thresholds, (low, high), split * inside + _GAP_PX / 2, inside)
    across = {"range": [float(allowance_um[0]), float(allowance_um[-1])]}
    drawn.update_layout(
        xaxis={"anchor": "y", "showticklabels": False, "ticks": "", "matches": "x2", **across},
        yaxis={"anchor": "x", "domain": [split + _GAP_PX / 2 / inside, 1.0], "range": [low, high],
               "title": {"text": "voltage [V]"}},
        xaxis2={"anchor": "y2", "title": {"text": "allowance [µm]"}, **across},
        yaxis2={"anchor": "x2", "domain": [0.0, split - _GAP_PX / 2 / inside], "range": [-most, most],
                "title": {"text": "line is off [µm]"}, "nticks": 5, "zeroline": True, "zerolinecolor": style.MUTED},
    )  # fmt: skip
    return drawn


def part_in_time(
    time_s: Vector,
    allowance_um: Vector,
    measured_um: Vector,
    voltage_v: Vector,
    feed_um_per_s: Vector | None,
    thresholds: Sequence[tuple[float, float]] = (),
    ends_s: Sequence[float] = (),
    *,
    is_finished: bool = True,
    from_s: float = 0.0,
    name: str = "",
) -> go.Figure:
    """Allowance of one part, what the gauge reads, its voltage against the thresholds, and the feed.

    Parameters
    ----------
    time_s : ndarray of shape (n_samples,)
        From the start of the part [s].
    allowance_um, measured_um, voltage_v, feed_um_per_s : ndarray of shape (n_samples,)
        True and measured allowance [µm], voltage behind the filter [V], infeed [µm/s]; None: it is not known.
    thresholds : sequence of (until_um, threshold_v)
        One a stage.
    ends_s : sequence of float
        When the stages end: dotted lines [s].
    is_finished : bool
        Whether the last allowance is the size of a finished part.
    from_s : float
        Where the picture begins; thresholds of stages that are over by then are left out [s].
    name : str
        Of the part.
    """
    kept = time_s >= from_s
    time, end = time_s[kept], float(time_s[-1])
    wanted = thresholds[-1][0] if thresholds else 0.0
    ends = np.array([max(from_s, 0.0), end])
    over = sum(end_s < from_s for end_s in ends_s)
    limits = [
        Line(f"{style.number(volts, 4)} V, end of stage {k}", ends, np.full(2, volts), THRESHOLD, dash="dot")
        for k, (_, volts) in enumerate(thresholds, start=1)
        if k > over
    ]
    panels = [
        Panel(
            "allowance [µm]",
            [
                Line("gauge reads", time, measured_um[kept], SEEN, width=1.2),
                Line("true", time, allowance_um[kept], TRUE, width=2.4),
                Line(f"wanted, {style.number(wanted)} µm", ends, np.full(2, wanted), style.MUTED, dash="dash", width=1),
            ],
            210,
        ),
        Panel("voltage [V]", [*limits, Line("", time, voltage_v[kept], SEEN)], 170),
    ]
    if feed_um_per_s is not None:
        fed = Line("", time, feed_um_per_s[kept], style.INK, steps=True)
        panels.append(Panel("feed [µm/s]", [fed], 90, least=0.0))
    size = float(allowance_um[-1])
    who = style.label(name, 20) if name else "the part"
    off = size - wanted
    if from_s > 0:
        title = f"Simulated: the last {style.number(end - from_s)} s of {who}, when the gauge stops the feed"
    elif is_finished:
        title = (
            f"Simulated: {who} ends at {style.number(size)} µm after {style.number(end)} s, "
            f"{style.number(abs(off))} µm {'above' if off >= 0 else 'below'} the wanted {style.number(wanted)} µm"
        )
    else:
        apart = float(np.abs(measured_um - allowance_um).max())
        title = f"Simulated: what the gauge reads of {who} is up to {style.number(apart)} µm off"
    marks = [mark for mark in ends_s if from_s <= mark <= end]
    drawn = stacked(title, panels, end, marks)
    if from_s > 0:
        _, seconds = style.time_unit(end)
        drawn.update_xaxes(range=[from_s / seconds, end / seconds])
    return drawn


def chain_waveform(
    time_s: Vector, probe_um: Vector, surface_um: Vector, contact_n: Vector, generator_v: Vector, smoothed_v: Vector
) -> go.Figure:
    """A few strokes of the whole chain: probe against the workpiece, contact force, rectified and smoothed voltage.

    Parameters
    ----------
    time_s : ndarray of shape (n_samples,)
    probe_um : ndarray of shape (n_samples,)
        Position of the tip, towards the workpiece [µm].
    surface_um : ndarray of shape (n_samples,)
        Where the workpiece stands on the same count [µm].
    contact_n, generator_v, smoothed_v : ndarray of shape (n_samples,)
        [N], [V], [V].
    """
    start = float(time_s[0])
    time, end = time_s - start, float(time_s[-1]) - start
    force = float(contact_n.max())
    stroke = float(np.ptp(probe_um))
    panels = [
        Panel(
            "probe [µm]",
            [
                Line("workpiece", time, surface_um, style.MUTED, dash="dash"),
                Line("tip", time, probe_um, style.PREDICTED),
            ],
            190,
        ),
        Panel("contact [N]", [Line("", time, contact_n, style.INK)], 100, least=0.0),
        Panel(
            "voltage [V]",
            [
                Line("rectified", time, np.abs(generator_v), style.BEFORE, width=1.2),
                Line("smoothed", time, smoothed_v, SEEN, width=2.2),
            ],
            170,
            least=0.0,
        ),
    ]
    title = f"Simulated: strokes of {style.number(stroke)} µm, " + (
        f"and {style.number(force)} N when the tip meets the workpiece" if force > 0 else "the workpiece out of reach"
    )
    drawn = stacked(title, panels, end)
    drawn.update_yaxes(exponentformat="none")
    return drawn


def _widened(values: Vector, others: Sequence[float]) -> tuple[float, float]:
    ends = [float(values.min()), float(values.max()), *others]
    room = 0.08 * max(max(ends) - min(ends), 1e-9)
    return min(ends) - room, max(ends) + room


def _band(drawn: go.Figure, line_um: tuple[float, float], allowance_um: Vector) -> None:
    """Shade where the line holds, as far as it is drawn."""
    first, last = max(line_um[0], float(allowance_um[0])), min(line_um[1], float(allowance_um[-1]))
    for axis in ("", "2"):
        drawn.add_shape(
            type="rect", xref=f"x{axis}", x0=first, x1=last, yref=f"y{axis} domain", y0=0, y1=1,
            fillcolor=CURVE, opacity=0.08, line={"width": 0}, layer="below",
        )  # fmt: skip


def _thresholds(
    drawn: go.Figure,
    allowance_um: Vector,
    voltage_v: Vector,
    thresholds: Sequence[tuple[float, float]],
    shown_v: tuple[float, float],
    floor_px: float,
    inside_px: float,
) -> None:
    """Dotted lines at the thresholds, and their names to the right, apart from each other."""
    low, high = shown_v
    order = sorted(range(len(thresholds)), key=lambda k: thresholds[k][1])
    wanted = [_CURVE_PX * (thresholds[k][1] - low) / (high - low) for k in order]
    placed: list[float] = []
    for want in wanted:
        placed.append(max(want, placed[-1] + _LABEL_PX if placed else _LABEL_PX / 2))
    ceiling = _CURVE_PX - _LABEL_PX / 2
    for k in reversed(range(len(placed))):
        placed[k] = min(placed[k], ceiling)
        ceiling = placed[k] - _LABEL_PX
    falls = voltage_v[-1] < voltage_v[0]
    rising_v, at_um = (voltage_v[::-1], allowance_um[::-1]) if falls else (voltage_v, allowance_um)
    for k, place in zip(order, placed, strict=True):
        until, volts = thresholds[k]
        reads = float(np.interp(volts, rising_v, at_um))
        drawn.add_shape(
            type="line", xref="x domain", x0=0, x1=1, yref="y", y0=volts, y1=volts,
            line={"color": THRESHOLD, "width": 1.4, "dash": "dot"}, layer="below",
        )  # fmt: skip
        drawn.add_scatter(
            x=[reads], y=[volts], mode="markers", showlegend=False, name=f"stage {k + 1}",
            marker={"color": THRESHOLD, "size": 9, "line": {"color": "#ffffff", "width": 1.4}},
            hovertemplate=f"stage {k + 1} ends: %{{y:.4g}} V, reads %{{x:.4g}} µm, wanted {until:.4g}<extra></extra>",
        )  # fmt: skip
        drawn.add_annotation(
            text=f"{style.number(volts, 4)} V, end of stage {k + 1}", font={"color": THRESHOLD, "size": 12},
            x=1.0, xref="paper", xanchor="left", xshift=6, y=(floor_px + place) / inside_px, yref="paper",
            yanchor="middle", showarrow=False,
        )  # fmt: skip
