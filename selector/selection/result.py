"""The result of a selection, its three errors on unseen data, and its JSON form (`selector.selection/1`)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from selector.errors import OptionError
from selector.findings import Finding
from selector.json_text import fields_of, plain
from selector.models.design import ListedTerms, rows_of
from selector.models.least_squares import FaultGain, FittedModel, ValidityHull
from selector.models.moments import ErrorCurvePoint
from selector.models.run_before import begun, in_parts
from selector.recording import RunSource, no_channel, thinned
from selector.selection.candidates import Grouping
from selector.selection.equal_sets import EqualSets
from selector.selection.fitting import Fallback, Recipe
from selector.selection.options import Options
from selector.types import Array

if TYPE_CHECKING:
    from statsmodels.regression.linear_model import RegressionResultsWrapper

    from selector.sensors.groups import FuzzyGroups, LambdaAxis

SCHEMA = "selector.selection/1"
#: Name in the JSON form of a run → field of its `RunProof`.
PROVEN = {
    "heldout_rmse_um": "rmse_um",
    "heldout_max_um": "max_um",
    "heldout_mean_um": "mean_um",
    "heldout_samples": "n_samples",
    "before_rmse_um": "before_rmse_um",
    "before_max_um": "before_max_um",
    "heldout_sensors": "sensors",
}
MOST_TOLD_FACTOR = 4.0  #: An error that is known to more than this cannot be told.


@dataclass(frozen=True)
class Combination:
    """One set of sensors for one response; the error is that of the fixed set, refitted without each run."""

    sensors: tuple[str, ...]
    response: str
    r2: float
    adjusted_r2: float
    heldout_rmse_um: float
    origin: str


@dataclass(frozen=True)
class RunProof:
    """Errors of a model on one run (or condition, or block) that its sensors, terms and coefficients never saw."""

    name: str
    sensors: tuple[str, ...]
    rmse_um: float
    max_um: float
    mean_um: float
    before_rmse_um: float
    before_max_um: float
    n_samples: int

    @classmethod
    def of(cls, name: str, sensors: tuple[str, ...], measured: Array, error: Array) -> RunProof:
        """From the displacements of the samples and what is left of them [µm], shape (n_samples,)."""
        rmse_um, before_rmse_um = (float(np.sqrt(np.mean(one**2))) for one in (error, measured))
        max_um, before_max_um = (float(np.abs(one).max()) for one in (error, measured))
        return cls(name, sensors, rmse_um, max_um, float(error.mean()), before_rmse_um, before_max_um, len(error))


@dataclass(frozen=True)
class Trace:
    """Measured and predicted displacement of one left-out part, for figures (thinned)."""

    run: str
    time_s: Array  #: (n_samples,)
    #: measured_um and predicted_um: (n_samples, n_responses)
    measured_um: Array
    predicted_um: Array


@dataclass(frozen=True)
class Proof:
    """What unseen parts of the recording say."""

    left_out: str  #: {"run", "condition", "block"}: What was left out in turn
    per_response: Mapping[str, tuple[RunProof, ...]]
    traces: tuple[Trace, ...]
    curve: tuple[ErrorCurvePoint, ...]  #: Number of sensors against held-out error, sets chosen anew inside each fold
    #: Held-out rmse of other ways, per response: "none" (no compensation), "mean", "all sensors" (linear regression on
    #: every sensor), and the same procedure with another offer: "chosen, linear", "chosen, polynomial", "chosen,
    #: memory"
    baselines_um: Mapping[str, Mapping[str, float]]
    #: Run that proves nothing → what the model needs and the run does not have
    not_covered: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def parts_of(self, response: str) -> tuple[RunProof, ...]:
        """What each left-out part says of a response. Raises RecordingError: it was not proved."""
        if response not in self.per_response:
            raise no_channel(response, self.per_response)
        return self.per_response[response]

    def rmse_um(self, response: str, *, before: bool = False) -> float:
        """Held-out rmse pooled over all samples [µm]; or that before compensation."""
        parts = self.parts_of(response)
        squares = ((part.before_rmse_um if before else part.rmse_um) ** 2 * part.n_samples for part in parts)
        return math.sqrt(sum(squares) / max(sum(part.n_samples for part in parts), 1))

    def max_um(self, response: str) -> float:
        """Largest held-out error [µm]."""
        return max((part.max_um for part in self.parts_of(response)), default=float("nan"))


@dataclass(frozen=True)
class Known:
    """How well the error on unseen runs is known."""

    #: On further runs the error is within this factor of the one that is told, 19 times in 20: that of the response
    #: that is known least
    factor: float
    runs: int  #: Runs or conditions that it rests on
    in_a_row: int = 0  #: Runs that begin where another ended
    starts_apart_k: float = 0.0  #: By how much sensors begin apart, from run to run [K]
    is_warm: bool = False  #: Whether that is more than a cold machine shows
    factors: Mapping[str, float] = field(default_factory=dict)  #: The same for every response

    def factor_of(self, response: str) -> float:
        """The factor of one response; results of earlier versions know one for all."""
        return self.factors.get(response, self.factor)

    def span_um(self, response: str, error_um: float) -> tuple[float, float] | None:
        """What that of further runs is between [µm], 19 times in 20, if this one is told; None: it cannot be told."""
        factor = self.factor_of(response)
        return None if factor > MOST_TOLD_FACTOR else (error_um / factor, error_um * factor)


@dataclass(frozen=True, kw_only=True)
class ProvenModel:
    """What a model file says: models, how good they are, and where they come from."""

    options: Options
    because: str  #: Why these sensors
    recipe: Recipe  #: How the model's columns are computed
    models: Mapping[str, FittedModel]  #: One per response
    #: In-sample rmse and largest error [µm] of the final model, per response and run
    fit_per_run: Mapping[str, Mapping[str, tuple[float, float]]]
    proof: Proof
    provenance: Mapping[str, Any]
    fallbacks: tuple[Fallback, ...] = ()  #: The model without each of its inputs, for the time when that one is broken
    largest_um: Mapping[str, float] = field(default_factory=dict)  #: Displacement in runs that proved nothing


@dataclass(frozen=True, kw_only=True)
class Selection(ProvenModel):
    """Sensors kept, models, proof and reasons."""

    sensors: tuple[str, ...]  #: Every sensor that was considered
    grouping: Grouping
    combinations: tuple[Combination, ...]  #: Best first within each response
    chosen: tuple[str, ...]
    reasons: Mapping[str, str]  #: Why each sensor was kept or dropped
    faults: tuple[FaultGain, ...]
    hull: ValidityHull  #: Of the model's inputs
    #: Share of bootstrap resamples of the runs in which each sensor (or a group mate) was chosen
    stability: Mapping[str, float]
    findings: tuple[Finding, ...]
    known: Known | None = None  #: Of the told errors; None where no run was left out
    equal: EqualSets | None = None  #: All sets as large as the chosen one that are about as good as the best

    def fixed_set_errors_um(self, response: str) -> dict[int, float]:
        """Number of sensors → smallest error of a compared fixed set [µm], in the chosen shape."""
        found: dict[int, float] = {}
        for one in self.combinations:
            if one.response == response and math.isfinite(one.heldout_rmse_um):
                size = len(one.sensors)
                found[size] = min(one.heldout_rmse_um, found.get(size, math.inf))
        return dict(sorted(found.items()))

    def statsmodels_results(self, response: str, source: RunSource, *, robust: bool = True) -> RegressionResultsWrapper:
        """The final model of a response in statsmodels, fitted again to the recording: `summary()`, p values, tests.

        `source` is the recording that was selected from; a selection does not keep it. With `robust`, errors allow for
        autocorrelation within runs, as in the report; else they are classical.

        Raises OptionError: it is another recording, or the model is a ridge fit.
        """
        model, runs = self.models[response], tuple(self.fit_per_run[response])
        source = in_parts(source)
        source = begun(source, self.recipe.design.responses) if self.recipe.design.datum.reference == "rise" else source
        rows = rows_of(source, self.recipe.design, runs)
        stride = round(len(rows.run) / model.n_samples)
        if stride > 1:
            rows = rows_of(thinned(source, stride), self.recipe.design, runs)
        column = rows.responses[:, self.recipe.design.responses.index(response)]
        misfit = column - model.predicted(rows.variables)
        if len(column) != model.n_samples or not math.isclose(
            math.sqrt(np.mean(misfit**2)), model.rmse_um, rel_tol=1e-6, abs_tol=1e-9
        ):
            raise OptionError(
                f"a recording with {len(column)} complete samples that is not the one of this selection",
                expected=f"the {model.n_samples} samples that the model of {response} was fitted to",
                where="statsmodels_results",
                advice="give the recording that select() was given, without faulty stretches if they were left out",
            )
        return model.statsmodels_results(rows.variables, column, rows.run, robust=robust)

    def as_dict(self) -> dict[str, Any]:
        """JSON form (`selector.selection/1`); numbers that do not exist are null."""
        from selector.sensors.groups import transitive_closure

        similarity = self.grouping.similarity.matrix
        screening = self.grouping.chosen
        document = {
            "schema": SCHEMA,
            "sensors": list(self.sensors),
            "similarity": similarity.tolist(),
            "closure": transitive_closure(similarity).tolist(),
            "lambda": screening.level,
            "lambda_because": self.grouping.because,
            "rounds": [
                {
                    "lambda": one.level,
                    "groups": [[self.sensors[one.kept[i]] for i in group] for group in one.partition.members],
                    "representatives": [self.sensors[i] for i in one.representatives],
                }
                for one in screening.rounds
            ],
            "screenings": [
                {
                    "lambda": one.level,
                    "lambda_of_rounds": [r.level for r in one.rounds],
                    "groups": len(one.rounds[0].partition.members),
                    "representatives": list(one.representatives),
                    "f_statistic": one.f.value if one.f is not None else None,
                    "heldout_relative": one.error,
                    "chosen": one is screening,
                    **({} if one.fpc is None else {"fpc": one.fpc}),
                }
                for one in self.grouping.screenings
            ],
            "lambda_axis": [
                {
                    "lambda_low": step.low,
                    "lambda_high": step.high,
                    "groups": [list(group) for group in step.partition.groups],
                    "f_statistic": step.f.value if step.f is not None else None,
                    "heldout_relative": next(
                        (
                            s.error
                            for s in self.grouping.screenings
                            if s.fpc is None and s.rounds[0].partition == step.partition
                        ),
                        None,
                    ),
                }
                for step in self.grouping.axis
            ],
            **({} if screening.fuzzy is None else {"fuzzy": _fuzzy(screening.fuzzy, self.grouping.axis)}),
            "combinations": [vars(combination) for combination in self.combinations],
            **({} if self.equal is None else {"equal_sets": self.equal.as_dict(tuple(self.models))}),
            "chosen": {
                "sensors": self.chosen,
                **fields_of(self, "because", "reasons"),
                "shape": str(self.recipe.shape),
                **fields_of(self.recipe.shape.form, "degree", "interactions"),
                **_listed_terms(self.recipe),
                **fields_of(self.recipe.shape, "sensor_taus_s", "speed_taus_s"),
            },
            "valid_range": {
                name: [float(low), float(high)]
                for name, low, high in zip(self.recipe.design.variables, self.hull.low, self.hull.high, strict=True)
            },
            "hull": fields_of(self.hull, "scale", "points"),
            "models": {name: self._model(name) for name in self.models},
            "proof": {
                "left_out": self.proof.left_out,
                "curve": [
                    {
                        "n_sensors": point.n_sensors,
                        "heldout_rmse_um": dict(zip(self.models, point.rmse_um, strict=True)),
                        "standard_error_um": dict(zip(self.models, point.standard_error_um, strict=True)),
                        "per_part_um": [dict(zip(self.models, row, strict=True)) for row in point.per_group_um],
                    }
                    for point in self.proof.curve
                ],
                "baselines_um": {name: dict(values) for name, values in self.proof.baselines_um.items()},
                "traces": [self._trace(trace) for trace in self.proof.traces],
                **({"not_covered": dict(self.proof.not_covered)} if self.proof.not_covered else {}),
                **({"known": vars(self.known)} if self.known else {}),
            },
            "faults": [{**vars(gain), "worst_um": gain.worst_um} for gain in self.faults],
            "fallbacks": [fields_of(one, "without", "heldout_rmse_um") for one in self.fallbacks],
            **fields_of(self, "stability", "options", "provenance", "findings"),
        }
        cleaned: dict[str, Any] = plain(document)
        return cleaned

    def _model(self, name: str) -> dict[str, Any]:
        model = self.models[name]
        terms, coefficients, errors = model.physical()
        vif = {tuple(sorted(term.powers)): float(v) for term, v in zip(model.terms, model.vif, strict=True)}
        return {
            "terms": [
                {
                    "powers": dict(term.powers),
                    "coefficient": float(coefficients[1 + i]),
                    "standard_error": float(errors[1 + i]),
                    "vif": vif.get(tuple(sorted(term.powers))),
                }
                for i, term in enumerate(terms)
            ],
            "intercept": float(coefficients[0]),
            "intercept_standard_error": float(errors[0]),
            "lags": [fields_of(lag, "name", "source", "tau_s") for lag in self.recipe.design.lags],
            **fields_of(model, "r2", "adjusted_r2", "rmse_um"),
            "heldout_rmse_um": self.proof.rmse_um(name),
            "heldout_max_um": self.proof.max_um(name),
            "per_run": self._per_run(name),
            "scaled": {
                **fields_of(model.scaling, "variables", "centre", "scale"),
                "terms": [dict(term.powers) for term in model.terms],
                **fields_of(model, "coefficients", "covariance", "vif"),
            },
            **fields_of(model, "n_samples", "ridge"),
            **fields_of(model.diagnostics, "condition_number", "durbin_watson", "ljung_box_p", "max_cooks_distance"),
        }

    def _trace(self, trace: Trace) -> dict[str, Any]:
        return {
            "run": trace.run,
            "time_s": trace.time_s.tolist(),
            "measured_um": dict(zip(self.models, trace.measured_um.T.tolist(), strict=True)),
            "predicted_um": dict(zip(self.models, trace.predicted_um.T.tolist(), strict=True)),
        }

    def _per_run(self, name: str) -> dict[str, dict[str, Any]]:
        runs: dict[str, dict[str, Any]] = {
            run: {"rmse_um": rmse, "max_um": largest} for run, (rmse, largest) in self.fit_per_run[name].items()
        }
        for part in self.proof.per_response[name]:
            runs.setdefault(part.name, {}).update({told: getattr(part, of) for told, of in PROVEN.items()})
        return runs


def _fuzzy(fuzzy: FuzzyGroups, axis: LambdaAxis) -> dict[str, Any]:
    return {
        "memberships": fuzzy.memberships.tolist(),
        "fpc": fuzzy.fpc,
        "lambda_of_cut": fuzzy.partition.level,
        "agreement_with_cut": fuzzy.agreement(axis.at(fuzzy.partition.level).partition),
        "between": [fuzzy.partition.names[i] for i, _, _ in fuzzy.between],
    }


def _listed_terms(recipe: Recipe) -> dict[str, Any]:
    form = recipe.shape.form
    return {"terms": [dict(term.powers) for term in form.listed]} if isinstance(form, ListedTerms) else {}


PROCEDURE = "whole procedure"
BEST_OF_SIZE = "best of each size"
FIXED_SET = "fixed set"


def told_apart(left_out: str) -> str:
    """What each of the errors lets be chosen anew; `left_out` is that of `Proof`."""
    part = {"run": "run", "condition": "condition", "block": "stretch"}[left_out]
    return (
        f"{_capital(PROCEDURE)}: number and choice of sensors made anew without each {part}, the error to expect. "
        f"{_capital(BEST_OF_SIZE)}: that many sensors, chosen anew without each {part}. "
        f"{_capital(FIXED_SET)}: one set for all, only its coefficients refitted without each {part}; the choice "
        f"compares these errors, and as it has seen every {part} they are too small to promise."
    )


def _capital(words: str) -> str:
    return words[0].upper() + words[1:]
