"""Pictures of the model: how sure its coefficients are, and what a broken sensor does to it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import plotly.graph_objects as go

from selector.figures import style
from selector.figures.style import Changes
from selector.models.least_squares import FaultGain
from selector.number_text import number_text

COLLINEAR_VIF = 10.0
_FAULTS = (("per_kelvin_um", "+1 K"), ("stuck_um", "stuck"), ("open_um", "open"))


@dataclass(frozen=True)
class TermShown:
    """A term of a model as a picture shows it: label, value [µm], half of its 95 % interval [µm], VIF."""

    label: str
    value_um: float
    half_um: float
    vif: float

    @property
    def is_unsure(self) -> bool:
        """Whether zero is within the interval."""
        return abs(self.value_um) <= self.half_um


def coefficients_title(response: str, terms: Sequence[TermShown]) -> str:
    """Which terms cannot be told from zero."""
    n = len(terms)
    which = [term.label for term in terms if term.is_unsure]
    if not which:
        which_terms = {1: "the only term is", 2: "both terms are"}.get(n, f"all {n} terms are")
        return f"{style.label(response)}: {which_terms} clearly different from zero"
    listed = ", ".join(which[:5]) + (f" and {len(which) - 5} more" if len(which) > 5 else "")
    return f"{style.label(response)}: {len(which)} of {n} terms cannot be told from zero: {listed}"


def coefficients_picture(height: int, title: str) -> go.Figure:
    """The frame of the coefficients of a response; `coefficient_changes` fills it."""
    drawn = style.figure(title, height)
    for text, colour in (("coefficient, 95 % interval", style.PREDICTED), ("cannot be told from zero", style.MUTED)):
        half = {"error_x": {"type": "data", "thickness": 2, "width": 5}}
        style.points(drawn, None, None, colour, text, "%{x:.4g} ± %{error_x.array:.2g} µm", **half)
    style.bars(drawn, None, None, None, None, "VIF %{x:.3g}", xaxis="x2", textposition="auto", showlegend=False)
    drawn.update_layout(
        bargap=0.45,
        xaxis={"domain": [0.0, 0.68], "zeroline": True, "zerolinecolor": style.INK},
        xaxis2={"domain": [0.74, 1.0], "title": {"text": "VIF [–]"}, "type": "log"},
        yaxis={"showgrid": True},
    )
    style.rule(drawn, COLLINEAR_VIF, style.RESIDUAL, width=1.5, xref="x2", yref="paper")
    return drawn


def coefficient_changes(response: str, terms: Sequence[TermShown]) -> Changes:
    """Coefficients, intervals and VIF in the frame of `coefficients_picture`."""
    n = len(terms)
    across = f"change of {style.label(response)} per standard deviation [µm]"
    changes: dict[tuple[str | int, ...], object] = {("layout", "xaxis", "title", "text"): across}
    for k, unsure in enumerate((False, True)):
        rows = [row for row, term in enumerate(terms) if term.is_unsure == unsure]
        changes["data", k, "x"] = [terms[row].value_um for row in rows]
        changes["data", k, "y"] = rows
        changes["data", k, "error_x", "array"] = [terms[row].half_um for row in rows]
        changes["data", k, "showlegend"] = bool(rows)
    vif = [term.vif if math.isfinite(term.vif) else math.nan for term in terms]
    changes["data", 2, "x"] = [max(value, 1.0) if math.isfinite(value) else None for value in vif]
    changes["data", 2, "y"] = list(range(n))
    changes["data", 2, "text"] = [number_text(value, 2) for value in vif]
    changes["data", 2, "marker", "color"] = [style.RESIDUAL if value > COLLINEAR_VIF else style.BEFORE for value in vif]
    top = max(12.0, max((value for value in vif if math.isfinite(value)), default=1.0) * 1.3)
    changes["layout", "xaxis2", "range"] = [0, math.log10(top)]
    changes["layout", "xaxis2", "dtick"] = 1 if top > 30 else "D2"
    changes["layout", "yaxis", "range"] = [n - 0.5, -0.5]
    changes["layout", "yaxis", "tickvals"] = list(range(n))
    changes["layout", "yaxis", "ticktext"] = [term.label for term in terms]
    return changes


def faults_title(faults: Sequence[FaultGain]) -> str:
    """The worst fault of a single sensor."""
    worst = max(faults, key=lambda one: one.worst_um)
    how = "open" if worst.open_um >= worst.stuck_um else "stuck"
    return (
        f"The worst single sensor fault, {style.label(worst.sensor)} {how}, "
        f"moves the correction of {style.label(worst.response)} by {number_text(worst.worst_um)} µm"
    )


def faults_picture(n_responses: int, height: int, title: str) -> go.Figure:
    """The frame of the faults of sensors; `fault_changes` fills it."""
    drawn = style.figure(title, height)
    columns = list(range(n_responses * len(_FAULTS)))
    drawn.add_heatmap(
        x=columns, zmin=0.0, colorscale=style.HARM_SCALE, showscale=False, xgap=2, ygap=2,
        texttemplate="%{text}", textfont={"size": 13}, hovertemplate="%{customdata}: %{z:.4g} µm<extra></extra>",
    )  # fmt: skip
    bare = {"showgrid": False, "showline": False, "ticks": ""}
    drawn.update_xaxes(tickvals=columns, side="bottom", **bare)
    drawn.update_yaxes(**bare)
    return drawn


def fault_changes(sensors: Sequence[str], responses: Sequence[str], faults: Sequence[FaultGain]) -> Changes:
    """The faults of some sensors in the frame of `faults_picture`."""
    gain = {(one.sensor, one.response): one for one in faults}
    names = [style.label(sensor) for sensor in sensors]
    columns = [(response, key, text) for response in responses for key, text in _FAULTS]
    z = [[float(getattr(gain[sensor, response], key)) for response, key, _ in columns] for sensor in sensors]
    n = len(names)
    return {
        ("data", 0, "z"): z,
        ("data", 0, "y"): list(range(n)),
        ("data", 0, "zmax"): max(1e-9, *(value for row in z for value in row)),
        ("data", 0, "text"): [[number_text(value) for value in row] for row in z],
        ("data", 0, "customdata"): [[f"{name}, {text}" for _, _, text in columns] for name in names],
        ("layout", "xaxis", "ticktext"): [f"{style.label(one, 12)} [µm]<br>{text}" for one, _, text in columns],
        ("layout", "yaxis", "range"): [n - 0.5, -0.5],
        ("layout", "yaxis", "tickvals"): list(range(n)),
        ("layout", "yaxis", "ticktext"): names,
    }
