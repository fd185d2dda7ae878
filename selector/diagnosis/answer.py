"""What a diagnosis says, as values: verdict, where, which effects, what the fit gained, the correction."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.effect import Quantity
from selector.findings import Finding
from selector.types import Vector

Verdict = Literal["missing-physics", "nothing-missing", "data-fault", "miscalibrated", "unexplained"]
SCHEMA = "selector.diagnosis/1"
CORRECTION_SCHEMA = "selector.correction/1"
_ENDS = ("low", "high")
_OF_EFFECT = (
    "id", "channel", "channels", "place", "statement", "parameters", "confidence", "p_value", "share", "suspected",
    "cannot_be_told_from", "experiment",
)  # fmt: skip
_LEAST_GAIN = 0.1  #: Of the simulated course: of less than that no delay can be told.


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
    """An effect that the evidence supports."""

    #: id, channel, place and statement: As in the contract; `channel` is the response that shows it most, `channels`
    #: all that show it
    id: str
    channel: str
    place: str | None
    statement: str
    parameters: Mapping[str, Quantity]  #: Without intervals of no width
    #: confidence, p_value and share: Probability that the name is right, family-wise p, share of the mismatch that it
    #: explains
    confidence: float
    p_value: float
    share: float
    cannot_be_told_from: tuple[str, ...]
    experiment: str  #: The run that would tell
    channels: tuple[str, ...] = ()
    suspected: bool = False  #: Supported, but not confirmed on a part of the data with another programme
    #: (n_rows,): Response → the effect's fitted course [unit of the response]
    courses: Mapping[str, Vector] = field(default_factory=dict)
    #: Run, begin and end [s from its start; None: of the run] of what acts in a part of one run only
    acts: tuple[str, float | None, float | None] | None = None
    #: Whether the improved model of `Fit` holds its courses; a fault that is only told, or left out, is not in it
    is_fitted: bool = False
    sources: tuple[str, ...] = ()  #: Channels that its courses were made of

    def __post_init__(self) -> None:
        real = {
            name: Quantity(one.value, one.unit) if one.low is not None and one.low == one.high else one
            for name, one in self.parameters.items()
        }
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
    #: Shapes that the record has beside what nobody explains, but too small or not borne out: part of no verdict
    also_seen: tuple[NamedEffect, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """The JSON of the contract `selector.diagnosis/1`."""
        return {
            "schema": SCHEMA,
            "verdict": self.verdict,
            "headline": self.headline,
            "where": [
                {key: value for key, value in vars(place).items() if key != "p_value" or value is not None}
                for place in self.where
            ],
            "effects": [_effect(effect) for effect in self.effects],
            "also_seen": [_effect(effect) for effect in self.also_seen],
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


def _effect(effect: NamedEffect) -> dict[str, Any]:
    parameters = {name: _quantity(quantity) for name, quantity in effect.parameters.items()}
    told = {key: parameters if key == "parameters" else vars(effect)[key] for key in _OF_EFFECT}
    return {key: list(value) if isinstance(value, tuple) else value for key, value in told.items()}


def _fit(fit: Fit) -> dict[str, Any]:
    train, held = (
        {"rmse_before": _known(errors.rmse_before), "rmse_after": _known(errors.rmse_after)}
        for errors in (fit.train, fit.heldout)
    )
    return {
        "train": train,
        "heldout": {**held, "noise_floor": fit.heldout.noise_floor},
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


@dataclass(frozen=True)
class Correction:
    """What is to be added to one response of the simulation as it was given; all rows, finite."""

    #: (n_rows,): All of it: recorded − `of_recording` − simulated − `add` has the error that `Fit` promises
    add: Vector
    of_effects: Vector  #: (n_rows,): The part of the effects of physics; the rest is recalibration
    of_recording: Vector  #: (n_rows,): What named faults of the data added to the recording, as far as the fit holds it


def corrections(found: Diagnosis) -> dict[str, Correction]:
    """Response → correction, of every response in which the improved model differs from the simulation."""
    result = {}
    for name, fit in found.fit.items():
        physics, faults = (_course(found, name, of_data=one) for one in (False, True))
        added = fit.after - fit.before - faults
        if np.nanmax(np.abs(added), initial=0.0) > 0.0:
            result[name] = Correction(found.comparison.filled(added), physics, faults)
    return result


def correction_object(found: Diagnosis) -> dict[str, Any]:
    """The JSON of the contract `selector.correction/1`: what makes of a simulation the error of its answer."""
    comparison, of = found.comparison, corrections(found)
    faulty = {name: one.of_recording for name, one in of.items() if one.of_recording.any()}
    runs = {}
    for run, rows in comparison.rows_of_runs():
        runs[run] = {
            "time_s": comparison.time_s[rows].tolist(),
            "add": {name: one.add[rows].tolist() for name, one in of.items()},
            "of_effects": {name: one.of_effects[rows].tolist() for name, one in of.items()},
        }
        if faulty:
            runs[run]["subtract_from_recording"] = {name: course[rows].tolist() for name, course in faulty.items()}
    return {
        "schema": CORRECTION_SCHEMA,
        "effects": [effect.id for effect in physics_of(found)],
        "units": {name: comparison.channel(name).unit for name in of},
        "recalibration": {
            name: {key: dict(vars(one)) for key, one in recalibration_of(found.recalibration[name]).items()}
            for name in of
            if name in found.recalibration
        },
        "runs": runs,
    }


def physics_of(found: Diagnosis) -> tuple[NamedEffect, ...]:
    """The named effects that are no fault of the recording."""
    return tuple(effect for effect in found.effects if not effect.id.startswith("data."))


def _course(found: Diagnosis, name: str, *, of_data: bool) -> Vector:
    """The sum of the courses that the fit of a response holds: of physics, or of faults of the data."""
    total = np.zeros(len(found.comparison.time_s))
    for effect in found.effects:
        if name in effect.courses and effect.id.startswith("data.") == of_data and (effect.is_fitted or not of_data):
            total = total + effect.courses[name]
    return total
