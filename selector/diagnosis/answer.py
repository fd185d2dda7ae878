"""What a diagnosis says, as values: verdict, where, which effects, what the fit gained; the JSON is made of these."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.effect import Quantity
from selector.findings import Finding

Vector = NDArray[np.float64]
Verdict = Literal["missing-physics", "nothing-missing", "data-fault", "miscalibrated", "unexplained"]
SCHEMA = "selector.diagnosis/1"
_ENDS = ("low", "high")
_LEAST_GAIN = 0.1
"""Of the simulated course: of less than that no delay can be told."""


@dataclass(frozen=True)
class Place:
    """A box of the mismatch: channel, time window of a run [s], regime in words, share of the misfit, adjusted p."""

    channel: str
    place: str | None
    run: str | None
    from_s: float | None
    to_s: float | None
    regime: str | None
    share: float
    p_value: float | None = None


@dataclass(frozen=True)
class NamedEffect:
    """An effect that the evidence supports.

    Attributes
    ----------
    id, channel, place, statement
        As in the contract; `channel` is the response that shows it most, `channels` all that show it.
    parameters : mapping of str to Quantity
        Without intervals of no width.
    confidence, p_value, share : float
        Probability that the name is right, family-wise p, share of the mismatch that it explains.
    cannot_be_told_from : tuple of str
    experiment : str
        The run that would tell.
    suspected : bool
        Supported, but not confirmed on a part of the data with another programme.
    courses : mapping of str to ndarray of shape (n_rows,)
        Response → the effect's fitted course [unit of the response].
    acts : tuple of (str, float or None, float or None), or None
        Run, begin and end [s from its start; None: of the run] of what acts in a part of one run only.
    is_fitted : bool
        Whether the improved model of `Fit` holds its courses; a fault that is only told, or left out, is not in it.
    sources : tuple of str
        Channels that its courses were made of.
    """

    id: str
    channel: str
    place: str | None
    statement: str
    parameters: Mapping[str, Quantity]
    confidence: float
    p_value: float
    share: float
    cannot_be_told_from: tuple[str, ...]
    experiment: str
    channels: tuple[str, ...] = ()
    suspected: bool = False
    courses: Mapping[str, Vector] = field(default_factory=dict)
    acts: tuple[str, float | None, float | None] | None = None
    is_fitted: bool = False
    sources: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        real = {name: quantity.with_real_interval() for name, quantity in self.parameters.items()}
        object.__setattr__(self, "parameters", real)


@dataclass(frozen=True)
class Errors:
    """Root mean square errors of one part of the data [unit], NaN without readings there; `noise_floor` if known."""

    rmse_before: float
    rmse_after: float
    noise_floor: float | None = None


@dataclass(frozen=True)
class Fit:
    """What the improved model gains in one response.

    `before` is the simulation as it was given, `recalibrated` with its own offset, gain and delay fitted, `after` with
    the named effects in it as well; `gap_closed` is the share of the way from the recalibrated error to the noise
    floor, on held-out rows, with its interval; `placebo_gain` what wrong effects of the same size closed (about 0).
    """

    unit: str
    train: Errors
    heldout: Errors
    recalibrated_heldout: float
    gap_closed: Quantity | None
    placebo_gain: Quantity | None
    before: Vector
    recalibrated: Vector
    after: Vector


@dataclass(frozen=True)
class Evidence:
    """How an effect stood in the test: whitened gain by cross-validation, p, and why it was not named or not tested."""

    id: str
    channel: str
    gain: float
    p_value: float
    named: bool
    note: str


@dataclass(frozen=True)
class Detectable:
    """Smallest effect that this record would have shown: `size` [unit] in the response, in `chance` of all cases."""

    id: str
    channel: str
    size: float
    unit: str
    chance: float
    note: str = ""


@dataclass(frozen=True)
class NextRun:
    """A run that the machine can do and what it would tell: the pair that it separates best, its power and duration."""

    description: str
    separates: tuple[str, ...]
    power: float | None
    duration_s: float | None


@dataclass(frozen=True)
class Diagnosis:
    """The answer; every array has the rows of `comparison`. What was not looked for is empty."""

    comparison: Comparison
    verdict: Verdict
    headline: str = ""
    where: tuple[Place, ...] = ()
    effects: tuple[NamedEffect, ...] = ()
    fit: Mapping[str, Fit] = field(default_factory=dict)
    evidence: tuple[Evidence, ...] = ()
    detectable: tuple[Detectable, ...] = ()
    next_runs: tuple[NextRun, ...] = ()
    recalibration: Mapping[str, Mapping[str, Quantity]] = field(default_factory=dict)
    findings: tuple[Finding, ...] = ()
    seed: int = 0

    def as_dict(self) -> dict[str, Any]:
        """The JSON of the contract `selector.diagnosis/1`."""
        return {
            "schema": SCHEMA,
            "verdict": self.verdict,
            "headline": self.headline,
            "where": [_place(place) for place in self.where],
            "effects": [_effect(effect) for effect in self.effects],
            "fit": {name: _fit(fit) for name, fit in self.fit.items()},
            "recalibration": {
                name: {key: _quantity(one) for key, one in recalibration_of(quantities).items()}
                for name, quantities in self.recalibration.items()
            },
            "next_runs": [{**vars(run), "separates": list(run.separates)} for run in self.next_runs],
            "findings": [finding.as_dict() for finding in self.findings],
        }


def recalibration_of(quantities: Mapping[str, Quantity]) -> dict[str, Quantity]:
    """Offset, gain and delay of one response as they stand in gain · s(t − delay) + offset, s being its simulation.

    The fit adds what a delay changes in the course as it was simulated, which is of another size.
    """
    result = dict(quantities)
    gain, delay = result.get("gain"), result.get("delay")
    if gain is not None and delay is not None and abs(gain.value) > _LEAST_GAIN:
        ends = [None if end is None else end / gain.value for end in (delay.low, delay.high)]
        low, high = ends if gain.value > 0.0 else ends[::-1]
        result["delay"] = Quantity(delay.value / gain.value, delay.unit, low, high)
    return result


def _place(place: Place) -> dict[str, Any]:
    return {key: value for key, value in vars(place).items() if key != "p_value" or value is not None}


def _effect(effect: NamedEffect) -> dict[str, Any]:
    return {
        "id": effect.id,
        "channel": effect.channel,
        "channels": list(effect.channels),
        "place": effect.place,
        "statement": effect.statement,
        "parameters": {name: _quantity(quantity) for name, quantity in effect.parameters.items()},
        "confidence": effect.confidence,
        "p_value": effect.p_value,
        "share": effect.share,
        "suspected": effect.suspected,
        "cannot_be_told_from": list(effect.cannot_be_told_from),
        "experiment": effect.experiment,
    }


def _fit(fit: Fit) -> dict[str, Any]:
    train, held = fit.train, fit.heldout
    return {
        "train": {"rmse_before": _known(train.rmse_before), "rmse_after": _known(train.rmse_after)},
        "heldout": {
            "rmse_before": _known(held.rmse_before),
            "rmse_after": _known(held.rmse_after),
            "noise_floor": held.noise_floor,
        },
        "recalibrated_heldout_rmse": _known(fit.recalibrated_heldout),
        "gap_closed": None if fit.gap_closed is None else dict(vars(fit.gap_closed)),
        "placebo_gain": None if fit.placebo_gain is None else dict(vars(fit.placebo_gain)),
        "unit": fit.unit,
    }


def _quantity(quantity: Quantity) -> dict[str, Any]:
    """As the contract has it: an end of the interval that is open is null."""
    ends = {end: None if value is None else _known(value) for end, value in vars(quantity).items() if end in _ENDS}
    return {**vars(quantity), **ends}


def _known(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
