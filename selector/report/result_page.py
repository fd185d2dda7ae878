"""Pages of what JSON holds of a diagnosis and of a prediction, for results without their recordings."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np
import plotly.graph_objects as go
from pydantic import BaseModel, ConfigDict, Field

from selector import __version__
from selector.diagnosis.shown_units import unit_words
from selector.figures import style
from selector.report.numbers import NONE, listed, number_text, share_text, span_text
from selector.report.page import Picture, Pictures, rendered
from selector.report.tables import Table, remarks_of, table
from selector.selection.document import FindingPart

Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Perhaps = Number | None


class _Part(BaseModel):
    model_config = ConfigDict(extra="ignore", frozen=True)


class _Quantity(_Part):
    value: Perhaps
    unit: str = ""
    low: Perhaps = None
    high: Perhaps = None


class _Place(_Part):
    channel: str
    place: str | None = None
    run: str | None = None
    from_s: Perhaps = None
    to_s: Perhaps = None
    regime: str | None = None
    share: Number


class _Effect(_Part):
    id: str
    channel: str
    statement: str
    parameters: dict[str, _Quantity]
    confidence: Number
    share: Number
    suspected: bool = False
    cannot_be_told_from: tuple[str, ...] = ()
    experiment: str = ""


class _Errors(_Part):
    rmse_before: Perhaps
    rmse_after: Perhaps
    noise_floor: Perhaps = None


class _Fit(_Part):
    train: _Errors
    heldout: _Errors
    unit: str
    recalibrated_heldout_rmse: Perhaps = None


class DiagnosisDocument(_Part):
    """The fields of a diagnosis' JSON that a page shows."""

    verdict: str
    headline: str = ""
    where: tuple[_Place, ...] = ()
    effects: tuple[_Effect, ...] = ()
    fit: dict[str, _Fit] = {}
    recalibration: dict[str, dict[str, _Quantity]] = {}
    findings: tuple[FindingPart, ...] = ()


class _Mode(_Part):
    tau_s: Number
    low: Perhaps
    high: Perhaps


class _Operation(_Part):
    operation: int
    response: str
    notation: str


class PredictionDocument(_Part):
    """The fields of a prediction's JSON that a page shows."""

    method: str
    kind: str
    time_s: tuple[Number, ...]
    displacement_um: dict[str, tuple[Perhaps, ...]]
    modes: tuple[_Mode, ...] = ()
    program: tuple[_Operation, ...] = ()
    tolerance_um: Perhaps = None
    findings: tuple[FindingPart, ...] = ()


def diagnosis_page(document: Mapping[str, Any]) -> str:
    """The page of a `selector.diagnosis/1` document.

    Raises
    ------
    pydantic.ValidationError
        A field is missing, or of the wrong kind.
    """
    told = DiagnosisDocument.model_validate(document)
    tables = [
        ("What was found", _effects(told)),
        ("Its parameters", _parameters(told)),
        ("Root mean square errors", _errors(told)),
        ("What the simulation itself would have to change", _recalibration(told)),
        ("Where", _places(told)),
    ]
    return _page(
        "What the simulation left out",
        told.headline or told.verdict,
        [one.experiment for one in told.effects if one.cannot_be_told_from and one.experiment],
        "The map of the mismatch, recorded and simulated courses, the evidence of every effect that was tested and "
        "what this record would not have shown: diagnosis.json does not hold them. With the study.toml of the "
        "diagnosis beside it, and its recordings unchanged, they are made again.",
        [("The answer", {"pictures": [], "tables": [(name, one) for name, one in tables if one is not None]})],
        told.findings,
        bad=told.verdict != "nothing-missing",
    )  # fmt: skip


def prediction_page(document: Mapping[str, Any]) -> str:
    """The page of a `selector.prediction/1` document.

    Raises
    ------
    pydantic.ValidationError
        A field is missing, or of the wrong kind.
    ValueError
        A course has another length than its times.
    """
    told = PredictionDocument.model_validate(document)
    pictures = Pictures()
    courses = [pictures.add(_course(told, name)) for name in told.displacement_um]
    most = {
        name: float(np.nanmax(np.abs(_array(course)), initial=0.0)) for name, course in told.displacement_um.items()
    }
    said = "; ".join(f"{name} moves by up to {number_text(value)} µm" for name, value in most.items())
    program = None
    if told.program:
        program = table(
            [">operation", "response", "corrections"],
            [(str(one.operation), one.response, one.notation) for one in told.program],
            f"number-{{minutes}}-{{µm}}; drift between corrections up to {number_text(told.tolerance_um)} µm.",
        )
    modes = None
    if told.modes:
        modes = table(
            [">time constant", ">low", ">high"],
            [tuple(span_text(s) for s in (mode.tau_s, mode.low, mode.high)) for mode in told.modes],
        )
    tables = [(name, one) for name, one in (("Correction program", program), ("Modes", modes)) if one is not None]
    sections: list[tuple[str, dict[str, Any]]] = [("The duty cycle", {"pictures": courses, "tables": tables})]
    return _page(
        "Duty cycle",
        f"In this {told.kind} duty cycle {said}.",
        [f"Predicted by the {told.method} method."],
        "The spindle speed, the heating and cooling tests, how well they are repeated and what each mode contributes: "
        "prediction.json does not hold them. `selector predict` makes the whole page.",
        sections,
        told.findings,
    )


def _page(
    title: str,
    first: str,
    more: list[str],
    left_out: str,
    sections: list[tuple[str, dict[str, list[Picture] | list[tuple[str, Table]]]]],
    findings: tuple[FindingPart, ...],
    *,
    bad: bool = False,
) -> str:
    values = {
        "title": title,
        "version": __version__,
        "first": first,
        "more": more,
        "bad": bad,
        "left_out": left_out,
        "sections": sections,
        "remarks": remarks_of([part.finding() for part in findings]),
    }
    return rendered("result.html", values)


def _effects(told: DiagnosisDocument) -> Table | None:
    rows = [
        (
            one.id,
            one.channel,
            one.statement + (" (suspected)" if one.suspected else ""),
            share_text(one.confidence),
            share_text(one.share),
            listed(list(one.cannot_be_told_from)) or NONE,
        )
        for one in told.effects
    ]
    headings = ["effect", "response", "what", ">sure", ">share", "cannot be told from"]
    return table(headings, rows) if rows else None


def _parameters(told: DiagnosisDocument) -> Table | None:
    rows = [
        (one.id, name, *_cells(quantity)) for one in told.effects for name, quantity in one.parameters.items()
    ]  # fmt: skip
    return table(["effect", "parameter", ">value", ">low", ">high", "unit"], rows) if rows else None


def _recalibration(told: DiagnosisDocument) -> Table | None:
    rows = [
        (response, name, *_cells(quantity))
        for response, quantities in told.recalibration.items()
        for name, quantity in quantities.items()
    ]
    return table(["response", "of the simulation", ">should be", ">low", ">high", "unit"], rows) if rows else None


def _cells(quantity: _Quantity) -> tuple[str, str, str, str]:
    return (*(number_text(v) for v in (quantity.value, quantity.low, quantity.high)), quantity.unit)  # type: ignore[return-value]


def _errors(told: DiagnosisDocument) -> Table | None:
    rows = []
    for name, fit in told.fit.items():
        held, train = fit.heldout, fit.train
        shown = (held.rmse_before, fit.recalibrated_heldout_rmse, held.rmse_after, held.noise_floor)
        rows.append((name, "held out", *map(number_text, shown), fit.unit))
        rows.append(
            (name, "fitted", number_text(train.rmse_before), NONE, number_text(train.rmse_after), NONE, fit.unit)
        )
    headings = ["response", "rows", ">as simulated", ">recalibrated", ">with what was found", ">noise", "unit"]
    return table(headings, rows) if rows else None


def _places(told: DiagnosisDocument) -> Table | None:
    rows = [
        (
            one.channel, one.place or NONE, one.run or "all", span_text(one.from_s), span_text(one.to_s),
            unit_words(one.regime or NONE), share_text(one.share),
        )
        for one in told.where
    ]  # fmt: skip
    return table(["channel", "place", "run", ">from", ">to", "state", ">share"], rows) if rows else None


def _course(told: PredictionDocument, name: str) -> go.Figure:
    time_s, course = _array(told.time_s), _array(told.displacement_um[name])
    if len(time_s) != len(course):
        raise ValueError(f"{len(course)} values of {name} at {len(time_s)} times")
    drawn = style.figure(f"{style.label(name)} in the duty cycle", 380)
    unit, seconds = style.time_unit(float(time_s[-1]) if len(time_s) else 1.0)
    drawn.add_scatter(x=(time_s / seconds).tolist(), y=course.tolist(), mode="lines", line={"color": style.PREDICTED})
    drawn.update_layout(
        xaxis={"title": {"text": f"time [{unit}]"}}, yaxis={"title": {"text": f"{style.label(name)} [µm]"}}
    )
    return drawn


def _array(values: Any) -> np.ndarray[Any, np.dtype[np.float64]]:
    return np.array(values, dtype=np.float64)
