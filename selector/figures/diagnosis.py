"""Pictures of a diagnosis: fit, evidence, what cannot be told apart, the run that tells, what is missed."""

from __future__ import annotations

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from selector.diagnosis.answer import Detectable, Diagnosis
from selector.diagnosis.shown_units import displayed, p_words
from selector.diagnosis.wording import amount, listed
from selector.figures import style
from selector.figures.log_axis import log_ticks
from selector.figures.panels import Line, Panel, stacked
from selector.figures.run_axis import RunAxis

Vector = NDArray[np.float64]
_BAR_PX = 28
_MOST_BARS = 10
_MOST_EFFECTS = 4
_LONGEST_ID = 34


def before_after(found: Diagnosis, response: str) -> go.Figure:
    """A response as recorded, as simulated, and with what was found; the error below; held-out parts shaded."""
    comparison, fit = found.comparison, found.fit[response]
    axis = RunAxis(comparison)
    factor, unit = displayed(fit.unit, float(np.nanmax(np.abs(fit.before - np.nanmean(fit.before)), initial=0.0)))
    fine, fine_unit = displayed(fit.unit, fit.train.rmse_before)
    recorded = comparison.recorded[response]
    is_better = any(response in effect.courses for effect in found.effects)
    after, name = (fit.after, "with it") if is_better else (fit.recalibrated, "recalibrated")
    error = fit.heldout.rmse_after if is_better else fit.recalibrated_heldout
    courses = [("simulated", factor * fit.before, style.BEFORE), ("recorded", factor * recorded, style.MEASURED)]
    courses.append((name, factor * after, style.PREDICTED))
    errors = [
        ("before", fine * (recorded - fit.before), style.BEFORE),
        ("after", fine * (recorded - after), style.RESIDUAL),
    ]
    panels = [
        Panel(f"{style.label(response, 12)} [{unit}]", [line for one in courses for line in _lines(axis, *one)], 220),
        Panel(f"error [{fine_unit}]", [line for one in errors for line in _lines(axis, *one)], 130),
    ]
    shown = [effect for effect in found.effects if response in effect.courses][:_MOST_EFFECTS]
    if shown:
        lines = [
            line
            for k, effect in enumerate(shown)
            for line in _lines(
                axis, effect.id, fine * effect.courses[response], style.GROUPS[(k + 2) % len(style.GROUPS)]
            )
        ]
        panels.append(Panel(f"found [{fine_unit}]", lines, 110, least=0.0))
    if np.isfinite(error):
        change = f"{style.number(fine * fit.heldout.rmse_before)} to {style.number(fine * error)} {fine_unit}"
        fallen = "falls" if error < fit.heldout.rmse_before else "goes"
        title = f"The error of {style.label(response)} on what was held out {fallen} from {change}"
    else:
        title = f"{style.label(response)}: nothing of it was held out to check the fit on"
    drawn = stacked(title, panels, axis.end_s, spans_s=axis.held_out_s())
    _, seconds = style.time_unit(axis.end_s)
    last = "" if len(panels) == 1 else str(len(panels))
    for number in range(1, len(panels) + 1):
        drawn.layout[f"xaxis{'' if number == 1 else number}"].update(axis.ticks(seconds))
    time_title = drawn.layout[f"xaxis{last}"].title.text
    drawn.layout[f"xaxis{last}"].title.text = time_title.replace("time", "time from the start of each run")
    axis.name_runs(drawn, seconds)
    return drawn


def evidence(found: Diagnosis) -> go.Figure:
    """How much better every effect makes rows that it was not fitted to: what is named, and the runner-up."""
    tested = [one for one in found.evidence if not one.note.startswith("not testable")]
    tested = sorted(tested, key=lambda one: (not one.named, -one.gain))
    shown = sorted(tested[:_MOST_BARS], key=lambda one: -one.gain)
    named = [one for one in shown if one.named]
    others = [one for one in shown if not one.named]
    if named and others:
        rest = max(others, key=lambda one: one.gain)
        title = (
            f"{style.listed([one.id for one in named])} {'gain' if len(named) > 1 else 'gains'} "
            f"{' and '.join(style.number(one.gain) for one in named)}; the runner-up {style.label(rest.id)} "
            f"{style.number(rest.gain)}"
        )
    else:
        title = (
            "What was tested, and what it gains" if not named else f"{style.listed([one.id for one in named])} is named"
        )
    drawn = style.figure(title, 100 + _BAR_PX * max(len(shown), 1))
    for is_named, colour, text in ((True, style.CHOSEN, "named"), (False, style.BEFORE, "not named")):
        part = [one for one in shown if one.named == is_named]
        if part:
            drawn.add_bar(
                x=[max(one.gain, 0.0) for one in part],
                y=[style.label(one.id, _LONGEST_ID) for one in part],
                orientation="h",
                name=text,
                marker={"color": colour},
                text=[p_words(one.p_value, " p = ").replace("<", "&lt;") for one in part],
                textposition="outside",
                cliponaxis=False,
                customdata=[[style.label(one.channel), style.label(one.note, 60)] for one in part],
                hovertemplate="%{y} in %{customdata[0]}: gain %{x:.3g}<br>%{customdata[1]}<extra></extra>",
            )
    order = [style.label(one.id, _LONGEST_ID) for one in shown]
    drawn.update_yaxes(categoryorder="array", categoryarray=order[::-1], showgrid=False)
    drawn.update_xaxes(title_text="gain on rows not fitted to [variances of the noise]", rangemode="tozero")
    drawn.update_layout(bargap=0.35, margin={"r": 90})
    return drawn


def told_apart(found: Diagnosis) -> go.Figure | None:
    """Which effects this record cannot tell apart, as a matrix; None where it can tell all that is named."""
    pairs = {(effect.id, other) for effect in found.effects for other in effect.cannot_be_told_from}
    if not pairs:
        return None
    names = list(dict.fromkeys([effect.id for effect in found.effects] + [other for _, other in sorted(pairs)]))
    groups = [[effect.id, *effect.cannot_be_told_from] for effect in found.effects if effect.cannot_be_told_from]
    alike = np.array([[float(a == b or any({a, b} <= set(one) for one in groups)) for b in names] for a in names])
    title = (
        "This record cannot tell " + "; ".join(listed([style.label(name) for name in one]) for one in groups) + " apart"
    )
    labels = [style.label(name, _LONGEST_ID) for name in names]
    drawn = style.figure(title, 150 + 34 * len(names))
    drawn.add_heatmap(
        x=labels, y=labels, z=alike, zmin=0.0, zmax=1.0, showscale=False, xgap=2, ygap=2,
        colorscale=[[0.0, "#f4f6f8"], [1.0, style.BASELINES["mean"]]],
        text=[["alike" if value and a != b else "" for b, value in enumerate(row)] for a, row in enumerate(alike)],
        texttemplate="%{text}", hoverinfo="skip",
    )  # fmt: skip
    drawn.update_yaxes(autorange="reversed", showgrid=False)
    drawn.update_xaxes(showgrid=False, tickangle=-30)
    drawn.update_layout(margin={"r": 320})
    return drawn


def next_runs(found: Diagnosis) -> go.Figure | None:
    """Chance that each possible run would tell, beside how long it takes; None where no run was weighed."""
    weighed = [run for run in found.next_runs if run.power is not None]
    if not weighed:
        return None
    weighed.sort(key=lambda run: run.power or 0.0)
    best = weighed[-1]
    title = f"The run that would tell best: {style.label(best.description, 90)}"
    drawn = style.figure(title, 100 + 38 * len(weighed))
    hours = [f"  {style.number((run.duration_s or 0.0) / 3600.0, 2)} h" if run.duration_s else "" for run in weighed]
    drawn.add_bar(
        x=[100.0 * (run.power or 0.0) for run in weighed],
        y=[style.label(run.description, 60) for run in weighed],
        orientation="h",
        marker={"color": [style.CHOSEN if run is best else style.BEFORE for run in weighed]},
        text=hours,
        textposition="outside",
        cliponaxis=False,
        hovertemplate="%{x:.0f} %<extra></extra>",
    )
    drawn.update_xaxes(title_text="chance that it tells them apart [%]", range=[0.0, 100.0])
    drawn.update_yaxes(showgrid=False)
    drawn.update_layout(bargap=0.4, margin={"r": 80}, showlegend=False)
    return drawn


def detectability(found: Diagnosis) -> go.Figure | None:
    """Smallest effects that this record would have shown, against the error that is left in their response."""
    rows = [(one, size) for one in found.detectable if (size := _relative(found, one)) is not None and size > 0.0]
    if not rows:
        return None
    rows.sort(key=lambda row: row[1])
    sizes = np.array([size for _, size in rows])
    least, most = rows[0], rows[-1]
    title = (
        f"This record would have shown {style.label(least[0].id)} from {_size(least[0])} on, "
        f"and {style.label(most[0].id)} only from {_size(most[0])} on"
    )
    drawn = style.figure(title, 110 + 21 * len(rows))
    names = [style.label(f"{one.id} in {one.channel}", 44) for one, _ in rows]
    drawn.add_scatter(
        x=sizes, y=names, mode="markers", marker={"color": style.PREDICTED, "size": 9},
        customdata=[_size(one) for one, _ in rows], hovertemplate="%{y}: %{customdata}<extra></extra>",
    )  # fmt: skip
    drawn.add_vline(x=1.0, line={"color": style.MUTED, "dash": "dot", "width": 1})
    low, high = float(np.log10(sizes.min() / 1.5)), float(np.log10(max(sizes.max(), 1.0) * 1.5))
    drawn.update_xaxes(
        type="log", range=[low, high],
        title_text="size found in 9 of 10 such records [parts of the error that is left]", **log_ticks(low, high),
    )  # fmt: skip
    drawn.update_yaxes(categoryorder="array", categoryarray=names[::-1], dtick=1)
    return drawn


def _lines(axis: RunAxis, name: str, values: Vector, colour: str) -> list[Line]:
    """A line for each run in which there is anything; the last one carries the name."""
    parts = [(time, part) for time, part in axis.by_run(values) if np.isfinite(part).any()]
    last = len(parts) - 1
    return [Line(name if k == last else "", time, part, colour, width=1.4) for k, (time, part) in enumerate(parts)]


def _relative(found: Diagnosis, one: Detectable) -> float | None:
    fit = found.fit.get(one.channel)
    left = None if fit is None else fit.train.rmse_after
    return None if left is None or left <= 0.0 else one.size / left


def _size(one: Detectable) -> str:
    return amount(one.size, one.unit)
