"""How a gauge sees a part, and what sizes come out of gauged grinding."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import plotly.graph_objects as go

from selector.figures import style
from selector.figures.panels import Line, Panel, shown_samples, stacked
from selector.number_text import number_text
from selector.types import Vector

if TYPE_CHECKING:
    from selector.physics.gauging.gauging_summary import Setting
    from selector.physics.gauging.transducer import LinearGauge

CURVE, LINE, THRESHOLD = style.PREDICTED, style.RESIDUAL, style.CHOSEN
SEEN, TRUE = style.RESIDUAL, style.PREDICTED
_CURVE_PX, _ERROR_PX, _GAP_PX, _BOTTOM_PX = 300, 130, 16, 44
_SHOWN_ERRORS = 4.0  #: The error of the line is shown up to so many times its largest one within the valid range.


def gauge_characteristic(
    allowance_um: Vector,
    voltage_v: Vector,
    gauge: LinearGauge,
    line_um: tuple[float, float],
    thresholds: Sequence[tuple[float, float]] = (),
) -> go.Figure:
    """Mean smoothed voltage over the allowance, the line beside it, and by how much of size the line is wrong.

    Allowances increase [µm]; the line holds between the two of `line_um` [µm]. `thresholds` has one a stage: allowance
    at which it is to end [µm], and voltage of the relay [V].
    """
    line_v = gauge.bias_v + gauge.gain_v_per_um * allowance_um
    error_um = (voltage_v - line_v) / gauge.gain_v_per_um
    valid = (allowance_um >= line_um[0]) & (allowance_um <= line_um[1])
    title = (
        f"Computed: {number_text(gauge.gain_v_per_um * 1e3)} mV/µm at {number_text(gauge.allowance_um)} µm; the line "
        f"holds from {number_text(line_um[0])} to {number_text(line_um[1])} µm"
    )
    drawn = style.rows(title, [_CURVE_PX, _ERROR_PX], _GAP_PX, _BOTTOM_PX)
    drawn.update_layout(showlegend=False)
    ends_v = [float(voltage_v.min()), float(voltage_v.max()), *(volts for _, volts in thresholds)]
    room = 0.08 * max(max(ends_v) - min(ends_v), 1e-9)
    low, high = min(ends_v) - room, max(ends_v) + room
    most = _SHOWN_ERRORS * max(float(np.abs(error_um[valid]).max(initial=0.0)), 1e-3)
    shown = (line_v >= low) & (line_v <= high)
    for x, y, axis, colour, dash, name in (
        (allowance_um, voltage_v, "", CURVE, "solid", "characteristic"),
        (allowance_um[shown], line_v[shown], "", LINE, "dash", "line"),
        (allowance_um, error_um, "2", LINE, "solid", "error of the line"),
    ):
        unit = "µm" if axis else "V"
        hover = f"%{{x:.4g}} µm: %{{y:.4g}} {unit}<extra>{name}</extra>"
        style.curve(drawn, x, y, colour, name, hover, width=2, dash=dash, xaxis=f"x{axis}", yaxis=f"y{axis}")
    first, last = max(line_um[0], float(allowance_um[0])), min(line_um[1], float(allowance_um[-1]))
    for axis in ("", "2"):
        drawn.add_shape(style.zone(first, last, CURVE, 0.08, panel=axis))
    falls = voltage_v[-1] < voltage_v[0]
    rising_v, at_um = (voltage_v[::-1], allowance_um[::-1]) if falls else (voltage_v, allowance_um)
    for stage, (until, volts) in enumerate(thresholds, start=1):
        reads = float(np.interp(volts, rising_v, at_um))
        hover = f"stage {stage} ends: %{{y:.4g}} V, reads %{{x:.4g}} µm, wanted {until:.4g}"
        look = {"marker": {"line": {"color": "#ffffff", "width": 1.4}}, "showlegend": False}
        style.points(drawn, [reads], [volts], THRESHOLD, f"stage {stage}", hover, **look)
    drawn.update_xaxes(range=[float(allowance_um[0]), float(allowance_um[-1])], ticks="")
    drawn.update_xaxes(title_text="allowance [µm]", ticks="outside", row=2)
    drawn.update_yaxes(range=[low, high], title_text="voltage [V]", row=1)
    zero = {"nticks": 5, "zeroline": True, "zerolinecolor": style.MUTED}
    drawn.update_yaxes(range=[-most, most], title_text="line is off [µm]", **zero, row=2)
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
    name: str = "",
) -> go.Figure:
    """Allowance of one part, what the gauge reads, its voltage against the thresholds, and the feed.

    Times are from the start of the part [s]; the feed is None where it is not known. `thresholds` has one a stage:
    allowance at which it is to end [µm], and voltage of the relay [V]; at `ends_s` the stages end: dotted lines [s].
    `is_finished` says whether the last allowance is the size of a finished part.
    """
    end = float(time_s[-1])
    wanted = thresholds[-1][0] if thresholds else 0.0
    ends = np.array([0.0, end])
    limits = [
        Line(f"{number_text(volts, 4)} V, end of stage {k}", ends, np.full(2, volts), THRESHOLD, dash="dot")
        for k, (_, volts) in enumerate(thresholds, start=1)
    ]
    allowances = [
        Line("gauge reads", time_s, measured_um, SEEN, width=1.2),
        Line("true", time_s, allowance_um, TRUE, width=2.4),
        Line(f"wanted, {number_text(wanted)} µm", ends, np.full(2, wanted), style.MUTED, dash="dash", width=1),
    ]
    panels = [Panel("allowance [µm]", allowances, 210)]
    panels.append(Panel("voltage [V]", [*limits, Line("", time_s, voltage_v, SEEN)], 170))
    if feed_um_per_s is not None:
        fed = Line("", time_s, feed_um_per_s, style.INK, steps=True)
        panels.append(Panel("feed [µm/s]", [fed], 90, least=0.0))
    size = float(allowance_um[-1])
    who = style.label(name, 20) if name else "the part"
    off = size - wanted
    if is_finished:
        title = (
            f"Simulated: {who} ends at {number_text(size)} µm after {number_text(end)} s, "
            f"{number_text(abs(off))} µm {'above' if off >= 0 else 'below'} the wanted {number_text(wanted)} µm"
        )
    else:
        apart = float(np.abs(measured_um - allowance_um).max())
        title = f"Simulated: what the gauge reads of {who} is up to {number_text(apart)} µm off"
    return stacked(title, panels, end, ends_s)


DRAWN, LIMIT, WANTED = style.BEFORE, style.RESIDUAL, style.MUTED
MOST_MARKERS = 600  #: Parts that are drawn one by one; of more the smallest and largest of each stretch.
MOST_DRESSINGS = 40
_BINS = 60
_DECADES = 5.0  #: Decades below the largest error that the trade-off shows at most.


def size_histogram(
    size_um: Vector,
    curve: tuple[Vector, Vector] | None,
    tolerance_um: tuple[float, float] | None,
    wanted_um: float,
    title: str,
) -> go.Figure:
    """Sizes of the simulated parts as a histogram, the density by formula as a line, and the tolerance.

    Sizes are counted from the nominal size [µm]; `curve` has the sizes [µm] and densities [1/µm] of eq. 25; `wanted_um`
    is x_k, for which the threshold is meant. `title` is plain text, as `style.label` makes it.
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
    top = float(density.max())
    if curve is not None:
        at_um, per_um = curve
        hover = "%{x:.4g} µm: %{y:.3g} % per µm<extra>eq. 25</extra>"
        style.curve(drawn, at_um, 100.0 * per_um, style.PREDICTED, "eq. 25", hover, width=2.2)
        top = max(top, float(per_um.max()))
    ends = [float(edges[0]), float(edges[-1]), wanted_um, *(tolerance_um or ())]
    room = 0.06 * (max(ends) - min(ends))
    for value, name, colour, dash in _marked(tolerance_um, wanted_um, "lower", "upper"):
        drawn.add_shape(style.rule(value, colour, dash=dash, width=1.8, y1=0.93))
        drawn.add_annotation(style.words(name, value, 0.93, colour, yref="y domain", yanchor="bottom"))
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
    size_um: Vector, tolerance_um: tuple[float, float] | None, wanted_um: float, dressed: Sequence[int], title: str
) -> go.Figure:
    """Finished sizes in the order of grinding, with the tolerance, and dotted lines where the wheel was dressed.

    Before the parts numbered `dressed`, from 1, the wheel was dressed. `title` is plain text, as `style.label` makes
    it.
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
    for value, name, colour, dash in _marked(tolerance_um, wanted_um, "lower limit", "upper limit"):
        drawn.add_shape(style.rule(value, colour, across=True, dash=dash, width=1.4))
        drawn.add_annotation(style.words(name, y=value, colour=colour, **style.BESIDE, yref="y"))
    shown = list(dressed)[:MOST_DRESSINGS] if len(dressed) <= MOST_DRESSINGS else []
    for part in shown:
        drawn.add_shape(style.rule(part - 0.5, style.CHOSEN, width=1.4))
    drawn.update_layout(
        margin={"r": 100},
        xaxis={"title": {"text": "part [number]"}, "range": [0.5 - 0.01 * len(size_um), 0.5 + 1.01 * len(size_um)]},
        yaxis={"title": {"text": "size [µm]"}, "range": [min(ends) - room, max(ends) + room], "exponentformat": "none"},
    )
    return drawn


def filter_trade_off(filters: Sequence[Setting], best: Setting, present: Setting, title: str) -> go.Figure:
    """Bias², variance and their sum over the time constant of the filter, both on logarithmic axes.

    The present filter is the one of the gauge with its own threshold. `title` is plain text, as `style.label` makes it.
    """
    time_constant_s = np.array([one.time_constant_s for one in filters])
    bias2, variance = np.array([one.bias_um for one in filters]) ** 2, np.array([one.sd_um for one in filters]) ** 2
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
        hover = f"%{{x:.4g}} ms: %{{y:.4g}} µm²<extra>{name}</extra>"
        style.curve(drawn, 1e3 * time_constant_s[seen], values[seen], colour, name, hover, width=width, dash=dash)
    for one, name, colour, symbol in (
        (best, "best", style.CHOSEN, "star"),
        (present, "present", style.BASELINES["all sensors"], "diamond"),
    ):
        at_s, value = one.time_constant_s, one.rms_um**2
        text, hover = f"{name}: {number_text(1e3 * at_s)} ms", f"{name}: %{{x:.4g}} ms, %{{y:.4g}} µm²"
        look = {"symbol": symbol, "line": {"color": "#ffffff", "width": 1}}
        place = [_rounded(1e3 * at_s)], [_rounded(value)]
        style.points(drawn, *place, colour, text, hover, size=13, marker=look)
    positive = np.concatenate(
        [row[row > 0] for row in (bias2, variance, total, np.array([best.rms_um, present.rms_um]) ** 2)]
    )
    high = _rounded(float(positive.max()))
    low = max(_rounded(float(positive.min())), high * 10.0**-_DECADES)
    drawn.update_layout(
        xaxis={"type": "log", "title": {"text": "time constant of the filter [ms]"}, "dtick": 1,
               "minor": {"ticks": "outside", "ticklen": 3},
               "range": [math.log10(1e3 * time_constant_s[0]), math.log10(1e3 * time_constant_s[-1])]},
        yaxis={"title": {"text": "error of the size [µm²]"}, **style.log_axis(0.8 * low, 1.25 * high)},
        height=420,
    )  # fmt: skip
    return drawn


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


def _marked(
    tolerance_um: tuple[float, float] | None, wanted_um: float, *limits: str
) -> list[tuple[float, str, str, str]]:
    """(size, name, colour, dash) of the wanted size and of the limits, called like this."""
    ends = zip(tolerance_um, limits, strict=True) if tolerance_um is not None else ()
    return [(wanted_um, "wanted", WANTED, "dash"), *((value, name, LIMIT, "solid") for value, name in ends)]
