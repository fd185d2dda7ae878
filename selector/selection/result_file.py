"""A selection again from its JSON form (`selector.selection/1`): all that its report shows, without the recordings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from selector.models.design import Datum, Design
from selector.models.faults import FaultGain
from selector.models.hull import ValidityHull
from selector.models.least_squares import Diagnostics, FittedModel
from selector.models.memory import Lag
from selector.models.terms import Form, Scaling, Term
from selector.models.validation import ErrorCurvePoint
from selector.selection.candidates import Grouping, Screening
from selector.selection.document import (
    ModelPart,
    OptionsPart,
    PointPart,
    ReadingsPart,
    RoundPart,
    RunPart,
    SelectionDocument,
    TracePart,
)
from selector.selection.fitting import Recipe
from selector.selection.library import Shape
from selector.selection.options import Options
from selector.selection.readings import Readings
from selector.selection.result import Combination, Proof, RunProof, Selection, Trace
from selector.sensors.groups import FStatistic, LambdaAxis, Partition, lambda_axis
from selector.sensors.screening import ScreeningRound
from selector.sensors.similarity import Similarity


def selection_of(document: Mapping[str, Any]) -> Selection:
    """The selection whose JSON form this is: its `as_dict` is the same document, but for what no report shows.

    Fallback models and classical covariances are not in a document; the points of the validity hull and the readings
    are not in one of an earlier version.

    Raises
    ------
    pydantic.ValidationError
        A field is missing, or of the wrong kind.
    ValueError, KeyError, IndexError
        Two fields contradict each other, e.g. a matrix without a row for each sensor.
    """
    told = SelectionDocument.model_validate(document)
    models = {name: _model(name, one) for name, one in told.models.items()}
    recipe = _recipe(told)
    low, high = (np.array([told.valid_range[name][end] for name in recipe.design.variables]) for end in (0, 1))
    names = tuple(models)
    return Selection(
        options=_options(told.options),
        sensors=told.sensors,
        grouping=_grouping(told),
        combinations=tuple(
            Combination(c.sensors, c.response, _nan(c.r2), _nan(c.adjusted_r2), _nan(c.heldout_rmse_um), c.origin)
            for c in told.combinations
        ),
        chosen=told.chosen.sensors,
        because=told.chosen.because,
        reasons=told.chosen.reasons,
        recipe=recipe,
        models=models,
        fit_per_run={
            name: {
                run: (_nan(part.rmse_um), _nan(part.max_um))
                for run, part in one.per_run.items()
                if part.rmse_um is not None
            }
            for name, one in told.models.items()
        },
        proof=Proof(
            told.proof.left_out,
            {name: _run_proofs(one.per_run) for name, one in told.models.items()},
            tuple(_trace(trace, names) for trace in told.proof.traces),
            tuple(_point(point, names) for point in told.proof.curve),
            {name: {way: _nan(v) for way, v in told.proof.baselines_um[name].items()} for name in names},
        ),
        faults=tuple(
            FaultGain(f.sensor, f.response, _nan(f.per_kelvin_um), _nan(f.stuck_um), _nan(f.open_um))
            for f in told.faults
        ),
        hull=_hull(told, low, high),
        stability={name: _nan(share) for name, share in told.stability.items()},
        findings=tuple(part.finding() for part in told.findings),
        provenance=told.provenance,
        readings=tuple(_readings(part, recipe.design.variables, names) for part in told.readings),
    )


def _options(told: OptionsPart) -> Options:
    values = {name: getattr(told, name) for name in OptionsPart.model_fields if name != "level"}
    return Options(level=None if told.level == "auto" else tuple(told.level), **values)


def _recipe(told: SelectionDocument) -> Recipe:
    chosen = told.chosen
    shape = Shape(Form(chosen.degree, chosen.interactions), chosen.sensor_taus_s, chosen.speed_taus_s)
    first = next(iter(told.models.values()))
    lags = tuple(Lag(lag.source, lag.tau_s) for lag in first.lags)
    inputs = tuple(name for name in first.scaled.variables if name not in {lag.name for lag in lags})
    design = Design(inputs, tuple(told.models), Datum(told.options.reference), lags)
    return Recipe(chosen.sensors, shape, design, tuple(Term.of(powers) for powers in first.scaled.terms))


def _grouping(told: SelectionDocument) -> Grouping:
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
        made = Screening(one.level, rounds, one.representatives, f, _nan(one.heldout_relative))
        screenings.append(made)
        chosen = made if one.chosen else chosen
    if chosen is None:
        raise ValueError("no screening is the chosen one")
    return Grouping(similarity, axis, (), tuple(screenings), chosen, told.lambda_because)


def _round(part: RoundPart, position: Mapping[str, int]) -> ScreeningRound:
    kept = tuple(sorted(position[name] for group in part.groups for name in group))
    label = {position[name]: i for i, group in enumerate(part.groups) for name in group}
    names = list(position)
    partition = Partition(tuple(label[i] for i in kept), part.level, tuple(names[i] for i in kept))
    return ScreeningRound(part.level, kept, partition, tuple(position[name] for name in part.representatives), ())


def _known_of_round(axis: LambdaAxis, level: float) -> ScreeningRound:
    """Of a way of grouping that was not chosen: its groups, not who stood for them."""
    partition = axis.at(level).partition
    return ScreeningRound(level, tuple(range(len(partition.labels))), partition, (), ())


def _model(name: str, told: ModelPart) -> FittedModel:
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
        n_samples=told.n_samples,
        r2=_nan(told.r2),
        adjusted_r2=_nan(told.adjusted_r2),
        rmse_um=_nan(told.rmse_um),
        residual_sd_um=float("nan"),
        diagnostics=Diagnostics(
            _nan(told.durbin_watson),
            _nan(told.ljung_box_p),
            _nan(told.condition_number),
            _nan(told.max_cooks_distance),
            0,
        ),
        ridge=told.ridge,
    )


def _run_proofs(per_run: Mapping[str, RunPart]) -> tuple[RunProof, ...]:
    return tuple(
        RunProof(
            run,
            part.heldout_sensors,
            _nan(part.heldout_rmse_um),
            _nan(part.heldout_max_um),
            _nan(part.heldout_mean_um),
            _nan(part.before_rmse_um),
            _nan(part.before_max_um),
            part.heldout_samples,
        )
        for run, part in per_run.items()
        if part.heldout_samples is not None
    )


def _point(told: PointPart, names: Sequence[str]) -> ErrorCurvePoint:
    def row(values: Mapping[str, float | None]) -> tuple[float, ...]:
        return tuple(_nan(values[name]) for name in names)

    return ErrorCurvePoint(
        told.n_sensors,
        row(told.heldout_rmse_um),
        row(told.standard_error_um),
        tuple(row(part) for part in told.per_part_um),
    )


def _trace(told: TracePart, names: Sequence[str]) -> Trace:
    measured, predicted = (
        np.column_stack([_array(courses[name]) for name in names]) for courses in (told.measured_um, told.predicted_um)
    )
    return Trace(told.run, _array(told.time_s), measured, predicted)


def _hull(told: SelectionDocument, low: NDArray[np.float64], high: NDArray[np.float64]) -> ValidityHull:
    points, scale = np.empty((0, len(low))), np.ones(len(low))
    if told.hull is not None:
        points, scale = _array(told.hull.points), _array(told.hull.scale)
        if points.shape[1:] != low.shape or scale.shape != low.shape:
            raise ValueError(f"points of the hull of shape {points.shape} for {len(low)} variables")
    return ValidityHull(points, scale, low, high)


def _readings(told: ReadingsPart, variables: Sequence[str], names: Sequence[str]) -> Readings:
    read, moved = (
        _array([courses[name] for name in wanted]).T
        for courses, wanted in ((told.variables, variables), (told.displacement_um, names))
    )
    made = Readings(told.run, told.n_samples, _array(told.time_s), read, moved, _array(told.beyond_others))
    if len({len(made.time_s), len(made.variables), len(made.displacement_um), len(made.beyond_others)}) > 1:
        raise ValueError(f"courses of {told.run} that are not equally long")
    return made


def _array(values: Any) -> NDArray[np.float64]:
    # None becomes NaN
    return np.array(values, dtype=np.float64)


def _nan(value: float | None) -> float:
    return float("nan") if value is None else value
