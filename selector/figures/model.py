"""Pictures of the model: how sure its coefficients are, and what a broken sensor does to it."""

from __future__ import annotations

import numpy as np
import plotly.graph_objects as go

from selector.figures import style
from selector.models.terms import Term
from selector.selection import Selection

COLLINEAR_VIF = 10.0
_NORMAL_95 = 1.96
_LONGEST_FACTOR = 18
_FAULTS = (("per_kelvin_um", "+1 K"), ("stuck_um", "stuck"), ("open_um", "open"))


def coefficient_intervals(selection: Selection, response: str) -> go.Figure:
    """Every coefficient with its 95 % interval, per standard deviation of the variables, and its VIF."""
    model = selection.models[response]
    values = model.coefficients[1:]
    halves = _NORMAL_95 * np.sqrt(np.maximum(np.diag(model.covariance)[1:], 0.0))
    unsure = np.abs(values) <= halves
    n = len(values)
    if unsure.any():
        which = [term_label(selection, term) for term, doubtful in zip(model.terms, unsure, strict=True) if doubtful]
        listed = ", ".join(which[:5]) + (f" and {len(which) - 5} more" if len(which) > 5 else "")
        title = f"{style.label(response)}: {len(which)} of {n} terms cannot be told from zero: {listed}"
    else:
        which_terms = "the only term is" if n == 1 else f"all {n} terms are"
        title = f"{style.label(response)}: {which_terms} clearly different from zero"
    drawn = style.figure(title, 150 + max(100, 26 * n))
    rows = np.arange(n)
    names = [term_label(selection, term) for term in model.terms]
    for mask, text, colour in (
        (~unsure, "coefficient, 95 % interval", style.PREDICTED),
        (unsure, "cannot be told from zero", style.MUTED),
    ):
        if not mask.any():
            continue
        drawn.add_scatter(
            x=values[mask],
            y=rows[mask],
            error_x={"type": "data", "array": halves[mask], "thickness": 2, "width": 5},
            mode="markers",
            name=text,
            marker={"color": colour, "size": 9},
            hovertemplate="%{x:.4g} ± %{error_x.array:.2g} µm<extra></extra>",
        )
    vif = np.where(np.isfinite(model.vif), model.vif, np.nan)
    drawn.add_bar(
        x=np.maximum(vif, 1.0),
        y=rows,
        orientation="h",
        xaxis="x2",
        marker={"color": np.where(vif > COLLINEAR_VIF, style.RESIDUAL, style.BEFORE).tolist()},
        text=[style.number(float(value), 2) for value in vif],
        textposition="auto",
        hovertemplate="VIF %{x:.3g}<extra></extra>",
        showlegend=False,
    )
    top = max(12.0, float(np.nanmax(vif, initial=1.0)) * 1.3)
    drawn.update_layout(
        bargap=0.45,
        xaxis={
            "domain": [0.0, 0.68],
            "title": {"text": f"change of {style.label(response)} per standard deviation [µm]"},
            "zeroline": True,
            "zerolinecolor": style.INK,
        },
        xaxis2={
            "domain": [0.74, 1.0],
            "title": {"text": "VIF [–]"},
            "type": "log",
            "range": [0, float(np.log10(top))],
            "dtick": 1 if top > 30 else "D2",
        },
        yaxis={
            "range": [n - 0.5, -0.5],
            "tickvals": rows.tolist(),
            "ticktext": names,
            "showgrid": True,
        },
    )
    drawn.add_shape(
        type="line",
        xref="x2",
        x0=COLLINEAR_VIF,
        x1=COLLINEAR_VIF,
        yref="paper",
        y0=0,
        y1=1,
        line={"color": style.RESIDUAL, "width": 1.5, "dash": "dot"},
    )
    return drawn


def fault_table(selection: Selection) -> go.Figure:
    """What a fault of each sensor does to each prediction, as a table in colours."""
    responses = list(selection.models)
    gain = {(one.sensor, one.response): one for one in selection.faults}
    columns = [(response, key, text) for response in responses for key, text in _FAULTS]
    z = np.array(
        [[getattr(gain[sensor, response], key) for response, key, _ in columns] for sensor in selection.chosen],
        dtype=np.float64,
    )
    worst = max(selection.faults, key=lambda one: one.worst_um)
    how = "open" if worst.open_um >= worst.stuck_um else "stuck"
    title = (
        f"The worst single sensor fault, {style.label(worst.sensor)} {how}, "
        f"moves the correction of {style.label(worst.response)} by {style.number(worst.worst_um)} µm"
    )
    n = len(selection.chosen)
    drawn = style.figure(title, 160 + 36 * max(n, 2))
    names = [style.label(sensor) for sensor in selection.chosen]
    drawn.add_heatmap(
        z=z,
        x=list(range(len(columns))),
        y=list(range(n)),
        zmin=0.0,
        zmax=max(float(z.max(initial=0.0)), 1e-9),
        colorscale=style.HARM_SCALE,
        text=[[style.number(float(value)) for value in row] for row in z],
        texttemplate="%{text}",
        textfont={"size": 13},
        xgap=2,
        ygap=2,
        customdata=[[f"{name}, {text}" for _, _, text in columns] for name in names],
        hovertemplate="%{customdata}: %{z:.4g} µm<extra></extra>",
        showscale=False,
    )
    drawn.update_xaxes(
        tickvals=list(range(len(columns))),
        ticktext=[f"{style.label(response, 12)} [µm]<br>{text}" for response, _, text in columns],
        side="bottom",
        showgrid=False,
        showline=False,
        ticks="",
    )
    drawn.update_yaxes(
        range=[n - 0.5, -0.5], tickvals=list(range(n)), ticktext=names, showgrid=False, showline=False, ticks=""
    )
    return drawn


def term_label(selection: Selection, term: Term) -> str:
    """A term as it stands in a figure, e.g. ``ΔT1·ΔT3²`` or ``ΔT1 lagged 30 min``."""
    lags = {lag.name: lag for lag in selection.recipe.design.lags}
    parts = []
    for name, power in term.powers:
        lag = lags.get(name)
        source = lag.source if lag else name
        is_rise = selection.options.reference == "rise" and source in selection.chosen
        text = ("Δ" if is_rise else "") + style.label(source, _LONGEST_FACTOR)
        if lag:
            text += f" lagged {_duration(lag.tau_s)}"
        parts.append(text + ("" if power == 1 else "²³"[power - 2]))
    return "·".join(parts)


def _duration(seconds: float) -> str:
    unit, size = style.time_unit(seconds)
    return f"{style.number(seconds / size, 2)} {unit}"
