"""A selection again from its JSON form (`selector.selection/1`): all that its report shows, and how that is written."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, WrapValidator

from selector.findings import Finding
from selector.json_text import fields_of
from selector.models.design import Datum, Design, Form, Lag, ListedTerms, Scaling, Term
from selector.models.least_squares import Diagnostics, FaultGain, FittedModel, ValidityHull
from selector.models.moments import ErrorCurvePoint
from selector.selection.candidates import Grouping, Screening
from selector.selection.equal_sets import EqualSet, EqualSets
from selector.selection.fitting import Recipe
from selector.selection.library import Shape
from selector.selection.options import Options
from selector.selection.result import PROVEN, Combination, Known, Proof, RunProof, Selection, Trace
from selector.sensors.groups import FStatistic, FuzzyGroups, LambdaAxis, Partition, lambda_axis
from selector.sensors.screening import ScreeningRound
from selector.sensors.similarity import Similarity
from selector.types import Array

Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
#: A number; NaN where JSON, which has none, says null.
NumberOrNaN = Annotated[Number, WrapValidator(lambda value, number: float("nan") if value is None else number(value))]
Count = Annotated[int, Field(strict=True, ge=0)]
Names = tuple[str, ...]
#: What stands in the document under the names of its fields.
OfNumbers = BeforeValidator(lambda of: {name: float("nan") if value is None else value for name, value in of.items()})


class Part(BaseModel):
    """A part of the document; fields that a later version adds are not looked at."""

    model_config = ConfigDict(extra="ignore", frozen=True)


class _RoundPart(Part):
    level: Annotated[Number, Field(alias="lambda")]
    groups: tuple[Names, ...]
    representatives: Names


class _ScreeningPart(Part):
    level: Annotated[Number, Field(alias="lambda")]
    lambda_of_rounds: Annotated[tuple[Number, ...], Field(min_length=1)]
    representatives: Names
    f_statistic: Number | None
    heldout_relative: NumberOrNaN
    chosen: bool
    fpc: Number | None = None


class _FuzzyPart(Part):
    memberships: Annotated[tuple[tuple[Number, ...], ...], Field(min_length=1)]


class _EqualSetPart(Part):
    sensors: Names
    heldout_rmse_um: dict[str, NumberOrNaN]
    largest_vif: NumberOrNaN
    worst_fault: NumberOrNaN


class _EqualSetsPart(Part):
    """The sets that are about as good; results of earlier versions have none."""

    sets: tuple[_EqualSetPart, ...]
    n_equal: Count
    n_compared: Count
    within_um: Number | None


class _ChosenPart(Part):
    sensors: Annotated[Names, Field(min_length=1)]
    because: str
    reasons: dict[str, str]
    degree: Annotated[int, Field(ge=1, le=3)]
    interactions: bool
    terms: tuple[dict[str, Annotated[int, Field(ge=1, le=9)]], ...] | None = None
    sensor_taus_s: tuple[Number, ...]
    speed_taus_s: tuple[Number, ...]


class _ScaledPart(Part):
    variables: Names
    centre: tuple[Number, ...]
    scale: tuple[Number, ...]
    terms: tuple[dict[str, Annotated[int, Field(ge=1, le=9)]], ...]
    coefficients: tuple[Number, ...]
    covariance: tuple[tuple[NumberOrNaN, ...], ...]
    vif: tuple[NumberOrNaN, ...]


class _RunPart(Part):
    rmse_um: Number | None = None
    max_um: NumberOrNaN = float("nan")
    heldout_rmse_um: NumberOrNaN = float("nan")
    heldout_max_um: NumberOrNaN = float("nan")
    heldout_mean_um: NumberOrNaN = float("nan")
    heldout_samples: Count | None = None
    before_rmse_um: NumberOrNaN = float("nan")
    before_max_um: NumberOrNaN = float("nan")
    heldout_sensors: Names = ()


class _ModelPart(Part):
    lags: tuple[Lag, ...]
    r2: NumberOrNaN
    adjusted_r2: NumberOrNaN
    rmse_um: NumberOrNaN
    per_run: dict[str, _RunPart]
    scaled: _ScaledPart
    n_samples: Count
    ridge: Number
    condition_number: NumberOrNaN
    durbin_watson: NumberOrNaN
    ljung_box_p: NumberOrNaN
    max_cooks_distance: NumberOrNaN


class _PointPart(Part):
    n_sensors: Count
    heldout_rmse_um: dict[str, NumberOrNaN]
    standard_error_um: dict[str, NumberOrNaN]
    per_part_um: tuple[dict[str, NumberOrNaN], ...]


class _TracePart(Part):
    run: str
    time_s: Annotated[tuple[Number, ...], Field(min_length=1)]
    measured_um: dict[str, tuple[NumberOrNaN, ...]]
    predicted_um: dict[str, tuple[NumberOrNaN, ...]]


class _HullPart(Part):
    """The hull of the model's inputs; results of earlier versions have none."""

    scale: tuple[Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0)], ...]
    points: tuple[tuple[Number, ...], ...]


class _ProofPart(Part):
    left_out: Literal["run", "condition", "block"]
    curve: tuple[_PointPart, ...]
    baselines_um: dict[str, dict[str, NumberOrNaN]]
    traces: tuple[_TracePart, ...]
    not_covered: dict[str, Names] = {}
    known: Known | None = None


def _asked(options: dict[str, Any]) -> dict[str, Any]:
    level = options["lambda"]
    return {**options, "level": None if level == "auto" else level}


class _SelectionDocument(Part):
    sensors: Annotated[Names, Field(min_length=1)]
    similarity: tuple[tuple[Number, ...], ...]
    level: Annotated[Number, Field(alias="lambda")]
    lambda_because: str
    rounds: Annotated[tuple[_RoundPart, ...], Field(min_length=1)]
    screenings: tuple[_ScreeningPart, ...]
    fuzzy: _FuzzyPart | None = None
    combinations: tuple[Annotated[Combination, OfNumbers], ...]
    equal_sets: _EqualSetsPart | None = None
    chosen: _ChosenPart
    valid_range: dict[str, tuple[Number, Number]]
    hull: _HullPart | None = None
    models: Annotated[dict[str, _ModelPart], Field(min_length=1)]
    proof: _ProofPart
    faults: tuple[Annotated[FaultGain, OfNumbers], ...]
    stability: dict[str, NumberOrNaN]
    options: Annotated[Options, BeforeValidator(_asked)]
    provenance: dict[str, Any]
    findings: tuple[Finding, ...]


def selection_of(document: Mapping[str, Any]) -> Selection:
    """The selection whose JSON form this is: its `as_dict` is the same document, but for what no report shows.

    Fallback models and classical covariances are not in a document; the points of the validity hull are not
    in one of an earlier version.

    Raises pydantic.ValidationError: a field is missing, or of the wrong kind. Raises ValueError, KeyError
    or IndexError: two fields contradict each other, e.g. a matrix without a row for each sensor.
    """
    told = _SelectionDocument.model_validate(document)
    models = {name: _model(name, one) for name, one in told.models.items()}
    recipe = _recipe(told)
    low, high = (np.array([told.valid_range[name][end] for name in recipe.design.variables]) for end in (0, 1))
    names = tuple(models)
    return Selection(
        grouping=_grouping(told),
        chosen=told.chosen.sensors,
        because=told.chosen.because,
        reasons=told.chosen.reasons,
        recipe=recipe,
        models=models,
        fit_per_run={
            name: {run: (part.rmse_um, part.max_um) for run, part in one.per_run.items() if part.rmse_um is not None}
            for name, one in told.models.items()
        },
        proof=Proof(
            told.proof.left_out,
            {name: tuple(_run_proofs(one.per_run)) for name, one in told.models.items()},
            tuple(_trace(trace, names) for trace in told.proof.traces),
            tuple(_point(point, names) for point in told.proof.curve),
            {name: told.proof.baselines_um[name] for name in names},
            told.proof.not_covered,
        ),
        hull=_hull(told, low, high),
        **fields_of(told, "options", "sensors", "combinations", "faults", "stability", "findings", "provenance"),
        known=told.proof.known,
        equal=None if told.equal_sets is None else _equal_sets(told.equal_sets, names),
    )


def _equal_sets(told: _EqualSetsPart, names: Sequence[str]) -> EqualSets:
    sets = (
        EqualSet(one.sensors, tuple(one.heldout_rmse_um[name] for name in names), one.largest_vif, one.worst_fault)
        for one in told.sets
    )
    return EqualSets(tuple(sets), told.n_equal, told.n_compared, told.within_um)


def _recipe(told: _SelectionDocument) -> Recipe:
    chosen = told.chosen
    form: Form | ListedTerms = Form(chosen.degree, chosen.interactions)
    if chosen.terms is not None:
        form = ListedTerms(tuple(map(Term.of, chosen.terms)))
    shape = Shape(form, chosen.sensor_taus_s, chosen.speed_taus_s)
    first = next(iter(told.models.values()))
    lags = first.lags
    inputs = tuple(name for name in first.scaled.variables if name not in {lag.name for lag in lags})
    design = Design(inputs, tuple(told.models), Datum(told.options.reference), lags)
    return Recipe(chosen.sensors, shape, design, tuple(Term.of(powers) for powers in first.scaled.terms))


def _grouping(told: _SelectionDocument) -> Grouping:
    matrix = np.array(told.similarity, dtype=np.float64)
    similarity = Similarity(matrix, absolute=told.options.absolute_similarity)
    axis = lambda_axis(matrix, told.sensors)
    position = {name: i for i, name in enumerate(told.sensors)}
    screenings, chosen = [], None
    for one in told.screenings:
        rounds = (
            tuple(_round(part, position) for part in told.rounds)
            if one.chosen
            else tuple(_known_of_round(axis, level) for level in one.lambda_of_rounds)
        )
        f = None if one.f_statistic is None else FStatistic(one.f_statistic, 0, 0, 0)
        fuzzy = _fuzzy(told.fuzzy, rounds[0].partition) if one.chosen and told.fuzzy is not None else None
        made = Screening(one.level, rounds, one.representatives, f, one.heldout_relative, one.fpc, fuzzy)
        screenings.append(made)
        chosen = made if one.chosen else chosen
    if chosen is None:
        raise ValueError("no screening is the chosen one")
    return Grouping(similarity, axis, (), tuple(screenings), chosen, told.lambda_because)


def _fuzzy(told: _FuzzyPart, partition: Partition) -> FuzzyGroups:
    memberships = _array(told.memberships)
    if memberships.shape != (len(partition.labels), len(partition.members)):
        raise ValueError(f"memberships of shape {memberships.shape} of {len(partition.labels)} sensors")
    if memberships.min() < 0.0 or not np.allclose(memberships.sum(axis=1), 1.0):
        raise ValueError("memberships of a sensor that do not add up to 1, or are below 0")
    return FuzzyGroups(memberships, partition)


def _round(part: _RoundPart, position: Mapping[str, int]) -> ScreeningRound:
    kept = tuple(sorted(position[name] for group in part.groups for name in group))
    label = {position[name]: i for i, group in enumerate(part.groups) for name in group}
    names = list(position)
    partition = Partition(tuple(label[i] for i in kept), part.level, tuple(names[i] for i in kept))
    return ScreeningRound(part.level, kept, partition, tuple(position[name] for name in part.representatives), ())


def _known_of_round(axis: LambdaAxis, level: float) -> ScreeningRound:
    """Of a way of grouping that was not chosen: its groups, not who stood for them."""
    partition = axis.at(level).partition
    return ScreeningRound(level, tuple(range(len(partition.labels))), partition, (), ())


def _model(name: str, told: _ModelPart) -> FittedModel:
    scaled = told.scaled
    scaling = Scaling(scaled.variables, scaled.centre, scaled.scale)
    covariance = _array(scaled.covariance)
    return FittedModel(
        response=name,
        scaling=scaling,
        terms=tuple(Term.of(powers) for powers in scaled.terms),
        has_intercept=True,
        coefficients=_array(scaled.coefficients),
        covariance=covariance,
        classical_covariance=np.full_like(covariance, np.nan),
        vif=_array(scaled.vif),
        valid_range=(),
        residual_sd_um=float("nan"),
        diagnostics=Diagnostics(
            told.durbin_watson, told.ljung_box_p, told.condition_number, told.max_cooks_distance, 0
        ),
        **fields_of(told, "n_samples", "r2", "adjusted_r2", "rmse_um", "ridge"),
    )


def _run_proofs(per_run: Mapping[str, _RunPart]) -> Iterator[RunProof]:
    for run, part in per_run.items():
        if part.heldout_samples is not None:
            yield RunProof(run, **{field: getattr(part, told) for told, field in PROVEN.items()})


def _point(told: _PointPart, names: Sequence[str]) -> ErrorCurvePoint:
    def row(values: Mapping[str, float]) -> tuple[float, ...]:
        return tuple(values[name] for name in names)

    return ErrorCurvePoint(
        told.n_sensors,
        row(told.heldout_rmse_um),
        row(told.standard_error_um),
        tuple(row(part) for part in told.per_part_um),
    )


def _trace(told: _TracePart, names: Sequence[str]) -> Trace:
    measured, predicted = (
        np.column_stack([_array(courses[name]) for name in names]) for courses in (told.measured_um, told.predicted_um)
    )
    return Trace(told.run, _array(told.time_s), measured, predicted)


def _hull(told: _SelectionDocument, low: Array, high: Array) -> ValidityHull:
    points, scale = np.empty((0, len(low))), np.ones(len(low))
    if told.hull is not None:
        points, scale = _array(told.hull.points), _array(told.hull.scale)
        if points.shape[1:] != low.shape or scale.shape != low.shape:
            raise ValueError(f"points of the hull of shape {points.shape} for {len(low)} variables")
    return ValidityHull(points, scale, low, high)


def _array(values: Any) -> Array:
    return np.array(values, dtype=np.float64)
