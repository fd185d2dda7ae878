"""How a feed axis moved: its error over time, what varied, its frequency response; a circular test as a polar plot."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import plotly.graph_objects as go

from selector.figures import style
from selector.figures.panels import Line, Panel, shown_samples, stacked
from selector.number_text import number_text
from selector.physics.drive.ball_bar.circle import BallBarTrace, centred_traces
from selector.physics.drive.drive_summary import LINEAR, Measures
from selector.physics.drive.trajectory import Motion
from selector.physics.ranges import joined, true_stretches
from selector.types import Mask, Vector

COMMANDED, TABLE, ERROR, OUTPUT = style.MUTED, style.PREDICTED, style.RESIDUAL, style.CHOSEN
SHORTEST_SPAN = 1 / 500  #: Stretches of the run that are closer together than this share of it are shaded as one.
_FLOOR_DB = -80.0
_PHASE_STEP = 90.0


def axis_course(
    motion: Motion, name: str, output_unit: str, *, limited: Mask | None = None, measures: Measures = LINEAR
) -> go.Figure:
    """Position and speed of an axis, below them its tracking error and the output of its control.

    `name` is empty if there is one axis only; `output_unit` is that of the control's output, e.g. "A". Where `limited`,
    shape (n_samples,), a limit of current or speed was reached: shaded.
    """
    time_s, error = motion.time_s, motion.tracking_error_m * measures.error[1]
    dry = float(np.ptp(motion.friction_n)) > 0
    (place, per_m), (pace, per_m_per_s) = measures.position, measures.speed
    lines = [
        Line("commanded", time_s, motion.reference_m * per_m, COMMANDED, width=4.0),
        Line("table", time_s, motion.table_m * per_m, TABLE),
    ]
    panels = [Panel(f"position [{place}]", lines, 140)]
    for what, course, colour, height in (
        (f"speed [{pace}]", motion.table_speed_m_per_s * per_m_per_s, TABLE, 90),
        (f"error [{measures.error[0]}]", error, ERROR, 230),
        (f"output [{output_unit}]", motion.command, OUTPUT, 110),
        *([(f"dry friction [{measures.force}]", motion.friction_n, style.INK, 100)] if dry else []),
    ):
        panels.append(Panel(what, [Line("", time_s, course, colour)], height, least=0.0))
    worst = int(np.argmax(np.abs(error)))
    rms = float(np.sqrt(np.mean(error**2)))
    who = style.label(name, 12) if name else "the table"
    unit, seconds = style.time_unit(float(time_s[-1]))
    title = (
        f"Simulated: {who} is off by up to {number_text(abs(error[worst]))} {measures.error[0]} "
        f"(after {time_s[worst] / seconds:.3g} {unit}), rms {number_text(rms)} {measures.error[0]}"
    )
    spans = () if limited is None else stretches(time_s, limited)
    return stacked(title, panels, float(time_s[-1]), spans_s=spans)


def stiffness_and_damping(
    time_s: Vector, stiffness_n_per_m: Vector, damping_ns_per_m: Vector, marks_s: Sequence[float] = ()
) -> go.Figure:
    """Axial stiffness and guide damping over time (F figs. 6, 7); at `marks_s` the frequency response is shown."""
    stiffness, damping = stiffness_n_per_m * 1e-6, damping_ns_per_m * 1e-3
    varies = 100.0 * (stiffness.max() / stiffness.min() - 1.0)
    title = (
        f"Simulated: axial stiffness {number_text(stiffness.min())} to {number_text(stiffness.max())} N/µm "
        f"({number_text(varies)} % more at its highest)"
    )
    panels = [
        Panel("stiffness [N/µm]", [Line("", time_s, stiffness, style.PREDICTED)], 170),
        Panel("damping [kN·s/m]", [Line("", time_s, damping, style.RESIDUAL)], 170, least=0.0),
    ]
    return stacked(title, panels, float(time_s[-1]), marks_s)


def frequency_response(
    frequency_hz: Vector, amplitudes: Mapping[str, Vector], phases_deg: Mapping[str, Vector], title: str
) -> go.Figure:
    """Amplitude and phase from commanded to actual position, one line an instant (F fig. 8).

    Amplitudes and phases stand by what the line is called, in the same order; `title` is plain text, as `style.label`
    makes it.
    """
    drawn = style.rows(title, [220, 165], 25, 50)
    for number, (name, amplitude) in enumerate(amplitudes.items()):
        colour = style.GROUPS[number % len(style.GROUPS)]
        decibels = 20.0 * np.log10(np.maximum(np.abs(amplitude), 10.0 ** (1.5 * _FLOOR_DB / 20.0)))
        for values, axis, unit in ((decibels, "y", "dB"), (phases_deg[name], "y2", "°")):
            hover = f"%{{x:.4g}} Hz: %{{y:.4g}} {unit}<extra>{style.label(name)}</extra>"
            legend = {"legendgroup": str(number), "showlegend": axis == "y" and len(amplitudes) > 1}
            dash = ("solid", "dash", "dot")[number % 3]
            style.curve(
                drawn,
                frequency_hz,
                values,
                colour,
                style.label(name),
                hover,
                dash=dash,
                yaxis=axis,
                xaxis=axis.replace("y", "x"),
                **legend,
            )
    every = 20.0 * np.log10(np.maximum(np.abs(np.concatenate(list(amplitudes.values()))), 1e-12))
    low, high = float(every.min()), float(every.max())
    drawn.add_shape(style.rule(-20.0 * math.log10(math.sqrt(2.0)), across=True))
    least = min(float(np.min(p)) for p in phases_deg.values())
    ticks = _PHASE_STEP * max(1, math.ceil(abs(least) / _PHASE_STEP / 6))
    ends = np.log10(frequency_hz[[0, -1]]).tolist()
    drawn.update_xaxes(type="log", dtick=1, range=ends)
    drawn.update_xaxes(title_text="frequency [Hz]", row=2)
    drawn.update_yaxes(title_text="amplitude [dB]", range=[max(low, _FLOOR_DB) - 3.0, high + 3.0], row=1)
    drawn.update_yaxes(title_text="phase [°]", dtick=ticks, row=2)
    return drawn


def stretches(time_s: Vector, mask: Mask) -> list[tuple[float, float]]:
    """(from, to) [s] of the stretches where `mask` holds; those closer than `SHORTEST_SPAN` of the run are one.

    A single sample is as wide as its distance to the next.
    """
    if not mask.any():
        return []
    starts, ends = true_stretches(mask).T
    end_s = time_s[np.minimum(ends, len(time_s) - 1)]
    least = SHORTEST_SPAN * float(time_s[-1] - time_s[0])
    return joined(zip(time_s[starts].tolist(), end_s.tolist(), strict=True), least)


_UNITS = {"um": ("mm", 1e-3, "µm"), "urad": ("rad", 1e-6, "µrad")}


def recorded_and_simulated(time_s: Vector, recorded: Vector, simulated: Vector, name: str, unit: str) -> go.Figure:
    """Both courses, and simulated minus recorded; each stretch keeps its lowest and highest sample.

    Times are from the start of the run [s]; `unit` is that of a `ChannelDifference`; courses in µm are drawn in mm.
    """
    whole, times, text = _UNITS.get(unit, (unit, 1.0, unit))
    text, whole = ("", "") if unit == "1" else (text, whole)
    difference = simulated - recorded
    worst = int(np.argmax(np.abs(difference)))
    rms = float(np.sqrt(np.mean(difference**2)))
    span, seconds = style.time_unit(float(time_s[-1]))
    title = (
        f"{style.label(name)}: simulated and recorded differ by {number_text(rms)} {text} rms, at most "
        f"{number_text(abs(difference[worst]))} {text} (after {time_s[worst] / seconds:.3g} {span})"
    )
    lines = [
        Line("recorded", time_s, recorded * times, style.MEASURED, width=4.0),
        Line("simulated", time_s, simulated * times, style.PREDICTED),
    ]
    panels = [
        Panel(_titled("course", whole), lines, 170),
        Panel(_titled("difference", text), [Line("", time_s, difference, style.RESIDUAL)], 230, least=0.0),
    ]
    return stacked(title, panels, float(time_s[-1]))


def _titled(what: str, unit: str) -> str:
    return f"{what} [{unit}]" if unit else what


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
