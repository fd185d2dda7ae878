"""From a selection to the model file that a control is given."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np
import pandas as pd

from selector import __version__
from selector.controllers import model_file
from selector.controllers.application import period_of
from selector.controllers.self_check import sealed
from selector.models.design import Datum, Scaling, datum_of
from selector.models.least_squares import FittedModel
from selector.models.run_before import before_gauge, with_ungauged
from selector.recording import Channel, Recording, RunSource
from selector.selection import fitting as selection_fallbacks
from selector.selection.fitting import Recipe
from selector.selection.result import ProvenModel
from selector.types import Array

RATE_MARGIN = 5.0
LEAST_RATE_PER_MIN = 1.0
#: Beyond what was recorded: a colder or warmer hall is no fault, an input of 0 that nobody has written is one.
READING_MARGIN_K = 15.0
#: A clamp is at most so many times what was measured, whatever a model says of readings from before a gauge.
MOST_UNGAUGED = 2.0


def model_file_of(
    selection: ProvenModel, channels: tuple[Channel, ...], *, source: RunSource | None = None, date: str | None = None
) -> model_file.ModelFile:
    """The model file of a selection: all responses, with ranges, rate limits, validation and test vectors.

    `channels` are those of the recording, for roles, units and places; `source`, the recording, gives the sampling
    period and the fastest change of each sensor, of which five times (at least 1 K/min) is the limit; `date` is written
    as it is.
    """
    by_name = {channel.name: channel for channel in channels}
    recipe = selection.recipe
    scaling = next(iter(selection.models.values())).scaling
    rise = selection.options.reference == "rise"
    seen = {} if source is None else seen_readings(source, recipe.sensors)
    ungauged = np.zeros((0, len(scaling.variables))) if source is None else _ungauged(recipe, source, channels)

    def input_of(name: str) -> model_file.Input:
        channel = by_name[name]
        at = scaling.variables.index(name)
        ranges = [model.valid_range[at] for model in selection.models.values()]
        ranges += [(column.min(), column.max()) for column in ungauged.T[at : at + 1] if len(column)]
        is_sensor = name in recipe.sensors
        of = seen.get(name)
        has_range = of is not None and channel.unit == "degC" and of.lowest <= of.highest
        return model_file.Input(
            name=name,
            role=cast(Any, channel.role),
            unit=channel.unit,
            reference="rise" if rise and is_sensor else "absolute",
            **_scaled(scaling, name),
            valid_min=min(low for low, _ in ranges),
            valid_max=max(high for _, high in ranges),
            rate_limit_per_min=None if of is None else max(RATE_MARGIN * of.fastest_per_min, LEAST_RATE_PER_MIN),
            reading_min=of.lowest - READING_MARGIN_K if of is not None and has_range else None,
            reading_max=of.highest + READING_MARGIN_K if of is not None and has_range else None,
            place=channel.place,
        )

    inputs = tuple(input_of(name) for name in recipe.design.inputs)
    fallbacks = tuple(_fallback(one, inputs, by_name, rise=rise) for one in selection.fallbacks)
    hashes = {
        str(run): str(entry["sha256"])
        for run, entry in selection.provenance.get("runs", {}).items()
        if isinstance(entry, dict) and "sha256" in entry
    }
    model = model_file.ModelFile(
        name=f"displacement {' and '.join(selection.models)}",
        inputs=inputs,
        states=_states(recipe, scaling),
        outputs=tuple(_outputs(selection.models, by_name, rise=rise)),
        guard=model_file.Guard(
            limits=tuple(_limits(selection, name, ungauged) for name in selection.models),
            on_fault="fallback" if fallbacks else "hold",
        ),
        fallbacks=fallbacks,
        provenance=model_file.Provenance(
            machine=selection.provenance.get("machine"),
            data_sha256=hashes,
            period_s=None if source is None else period_of(source),
            version=__version__,
            date=date,
            seed=selection.options.seed,
            method=f"{recipe.shape}; sensors {', '.join(recipe.sensors)}",
            note=selection.because,
        ),
        validation={name: _validation(selection, name) for name in selection.models},
    )
    return sealed(model)


@dataclass(frozen=True)
class SeenReadings:
    """What a sensor did in all runs [its unit, and per minute]; infinite ends where it has no reading."""

    lowest: float
    highest: float
    fastest_per_min: float


def seen_readings(source: RunSource, sensors: tuple[str, ...]) -> dict[str, SeenReadings]:
    """Lowest and highest reading of each sensor, and its largest change over a minute; the source is read once.

    Where samples are further apart than a minute, it is the change from one to the next.
    """
    low, high, rate = np.full(len(sensors), np.inf), np.full(len(sensors), -np.inf), np.zeros(len(sensors))
    for run in source.runs:
        for time_s, values in source.chunks(run, sensors):
            if len(time_s) == 0:
                continue
            low = np.fmin(low, np.nan_to_num(values, nan=np.inf).min(axis=0))
            high = np.fmax(high, np.nan_to_num(values, nan=-np.inf).max(axis=0))
            later = np.minimum(np.searchsorted(time_s, time_s + 60.0), len(time_s) - 1)
            minutes = (time_s[later] - time_s) / 60.0
            whole = minutes > 0
            change = np.abs(values[later[whole]] - values[whole]) / np.maximum(minutes[whole], 1.0)[:, None]
            if len(change):
                rate = np.fmax(rate, np.nan_to_num(change, nan=0.0).max(axis=0))
    ends = zip(low, high, rate, strict=True)
    return {name: SeenReadings(*map(float, of)) for name, of in zip(sensors, ends, strict=True)}


def _ungauged(recipe: Recipe, source: RunSource, channels: tuple[Channel, ...]) -> Array:
    """What a control gets in runs whose gauge began late, shape (n_samples, n_variables): on before, it counts rises
    from earlier. Only of linear models, which are the same from any start; and not of readings further than
    `READING_MARGIN_K` beyond those at which the displacement was measured, which nothing bears out.
    """
    design, form = recipe.design, recipe.shape.form
    late = [run for run in source.runs if before_gauge(design.datum.follows, run)] if recipe.shape.has_memory else []
    found = [np.zeros((0, len(design.variables)))]
    if not late or form.degree > 1 or form.interactions:
        return found[0]
    as_read = replace(design, datum=Datum("absolute"), lags=())
    gauged = [one.variables for run in source.runs for one in as_read.pieces(source, run)]
    low = np.min([of.min(axis=0) for of in gauged], axis=0) - READING_MARGIN_K
    high = np.max([of.max(axis=0) for of in gauged], axis=0) + READING_MARGIN_K
    for run in late:
        time_s, values = with_ungauged(source, run, design.inputs)
        values = np.where((values >= low) & (values <= high), values, np.nan)
        table = pd.DataFrame(values, time_s, list(design.inputs))
        whole = Recording.from_runs({run: table}, [one for one in channels if one.name in design.inputs])
        datum = datum_of(whole, recipe.sensors, (), design.datum.reference)
        found += [one.variables for one in replace(design, responses=(), datum=datum).pieces(whole, run)]
    return np.concatenate(found)


def _fallback(
    of: selection_fallbacks.Fallback, inputs: tuple[model_file.Input, ...], channels: dict[str, Channel], *, rise: bool
) -> model_file.Fallback:
    """A fallback of a selection, with the ranges of the model's own inputs."""
    scaling = next(iter(of.models.values())).scaling
    own = (item for item in inputs if item.name in of.recipe.design.inputs)
    return model_file.Fallback(
        without=(of.without,),
        inputs=tuple(item.model_copy(update=_scaled(scaling, item.name)) for item in own),
        states=_states(of.recipe, scaling),
        outputs=tuple(_outputs(of.models, channels, rise=rise)),
    )


def _scaled(scaling: Scaling, name: str) -> dict[str, float]:
    at = scaling.variables.index(name)
    return {"centre": scaling.centre[at], "scale": scaling.scale[at]}


def _states(recipe: Recipe, scaling: Scaling) -> tuple[model_file.State, ...]:
    return tuple(
        model_file.State(name=lag.name, source=lag.source, tau_s=lag.tau_s, **_scaled(scaling, lag.name))
        for lag in recipe.design.lags
    )


def _outputs(
    models: Mapping[str, FittedModel], channels: dict[str, Channel], *, rise: bool
) -> Iterator[model_file.Output]:
    for name, model in models.items():
        coefficients = model.coefficients.tolist()
        errors = np.sqrt(np.maximum(np.diag(model.covariance), 0.0)).tolist()
        yield model_file.Output(
            name=model.response,
            axis=channels[name].axis,
            reference="rise" if rise else "absolute",
            intercept=coefficients[0],
            intercept_standard_error=errors[0],
            terms=tuple(
                model_file.Term(powers=dict(term.powers), coefficient=coefficient, standard_error=error)
                for term, coefficient, error in zip(model.terms, coefficients[1:], errors[1:], strict=True)
            ),
        )


def _limits(selection: ProvenModel, name: str, ungauged: Array) -> model_file.OutputLimits:
    """The correction is held within the largest recorded displacement, or what the model says of before a gauge."""
    proved = (part.before_max_um for part in selection.proof.per_response[name])
    largest = max((*proved, selection.largest_um.get(name, 0.0)))
    predicted = float(np.abs(selection.models[name].predicted(ungauged)).max(initial=0.0))
    largest = max(largest, min(predicted, MOST_UNGAUGED * largest))
    return model_file.OutputLimits(output=name, clamp_um=float(np.ceil(largest)) or None)


def _validation(selection: ProvenModel, name: str) -> model_file.Validation:
    model, proof = selection.models[name], selection.proof
    ways = proof.baselines_um.get(name, {})
    return model_file.Validation(
        method=f"leave-one-{proof.left_out}-out, sensors and terms chosen inside each fold",
        rmse_um=model.rmse_um,
        heldout_rmse_um=proof.rmse_um(name),
        heldout_max_um=proof.max_um(name),
        heldout_baseline_um=min((ways[way] for way in ("none", "mean") if way in ways), default=None),
        r2=model.r2,
        adjusted_r2=model.adjusted_r2 if np.isfinite(model.adjusted_r2) else None,
        n_runs=len(selection.fit_per_run[name]),
        n_samples=model.n_samples,
    )
