"""A diagnosis again from its JSON form (`selector.diagnosis/1`): all of it but courses, evidence and what it misses."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from pydantic import Field

from selector.diagnosis.answer import Diagnosis, Errors, Fit, NamedEffect, NextRun, Place, Verdict, recalibration_of
from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.effect import Quantity
from selector.findings import Finding
from selector.json_text import fields_of
from selector.selection.result_file import Number, Part

Perhaps = Number | None


class _Quantity(Part):
    value: Perhaps
    unit: str = ""
    low: Perhaps = None
    high: Perhaps = None

    def quantity(self) -> Quantity:
        return Quantity(_known(self.value), self.unit, self.low, self.high)


class _Effect(Part):
    id: str
    channel: str
    channels: tuple[str, ...] = ()
    place: str | None = None
    statement: str
    parameters: dict[str, _Quantity]
    confidence: Number
    p_value: Number = float("nan")
    share: Number
    suspected: bool = False
    cannot_be_told_from: tuple[str, ...] = ()
    experiment: str = ""

    def effect(self) -> NamedEffect:
        return NamedEffect(**{**dict(self), "parameters": {name: q.quantity() for name, q in self.parameters.items()}})


class _Errors(Part):
    rmse_before: Perhaps
    rmse_after: Perhaps
    noise_floor: Perhaps = None

    def errors(self) -> Errors:
        return Errors(_known(self.rmse_before), _known(self.rmse_after), self.noise_floor)


class _Fit(Part):
    train: _Errors
    heldout: _Errors
    unit: str
    recalibrated_heldout_rmse: Perhaps = None
    gap_closed: _Quantity | None = None
    placebo_gain: _Quantity | None = None

    def fit(self) -> Fit:
        gap, placebo = (None if one is None else one.quantity() for one in (self.gap_closed, self.placebo_gain))
        errors = self.train.errors(), self.heldout.errors(), _known(self.recalibrated_heldout_rmse)
        return Fit(self.unit, *errors, gap, placebo, _NOTHING, _NOTHING, _NOTHING)


class _Document(Part):
    verdict: Verdict
    headline: str = ""
    where: tuple[Place, ...] = ()
    effects: tuple[_Effect, ...] = ()
    also_seen: tuple[_Effect, ...] = ()
    fit: dict[str, _Fit] = Field(default_factory=dict)
    recalibration: dict[str, dict[str, _Quantity]] = Field(default_factory=dict)
    next_runs: tuple[NextRun, ...] = ()
    findings: tuple[Finding, ...] = ()


_NOTHING = np.zeros(0)


def diagnosis_of(document: Mapping[str, Any]) -> Diagnosis:
    """The diagnosis of a `selector.diagnosis/1` document, its comparison without rows.

    Raises pydantic.ValidationError: a field is missing, or of the wrong kind.
    """
    told = _Document.model_validate(document)
    courses = dict.fromkeys(told.fit, _NOTHING)
    rows = np.zeros(0, dtype=np.bool_)
    return Diagnosis(
        comparison=Comparison((), (0,), _NOTHING, (), courses, courses, tuple(told.fit), rows),
        headline=told.headline or told.verdict,
        effects=tuple(one.effect() for one in told.effects),
        also_seen=tuple(one.effect() for one in told.also_seen),
        fit={name: one.fit() for name, one in told.fit.items()},
        recalibration={
            name: _as_fitted({key: one.quantity() for key, one in of.items()})
            for name, of in told.recalibration.items()
        },
        **fields_of(told, "verdict", "where", "next_runs", "findings"),
    )


def _as_fitted(quantities: Mapping[str, Quantity]) -> dict[str, Quantity]:
    """Offset, gain and delay as the fit has them, of which the document has what `recalibration_of` makes of them."""
    gain = quantities.get("gain")
    if gain is None or gain.value == 0.0:
        return dict(quantities)
    turned = recalibration_of({**quantities, "gain": replace(gain, value=1.0 / gain.value)})
    return {**turned, "gain": gain}


def _known(value: float | None) -> float:
    return float("nan") if value is None else value
