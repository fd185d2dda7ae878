"""What is left when a sensor breaks: the chosen model fitted again without it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from selector.models.design import Datum
from selector.models.least_squares import FittedModel
from selector.models.rows import rows_of
from selector.recording import RunSource
from selector.selection.fitting import Part, Recipe, final_models, predictions
from selector.selection.options import Question


@dataclass(frozen=True)
class Fallback:
    """The model without one input.

    Attributes
    ----------
    without : str
        The sensor, or the spindle speed.
    recipe : Recipe
    models : mapping of str to FittedModel
        One per response.
    heldout_rmse_um : mapping of str to float
        Per response, on the parts that were left out of the fit; NaN where nothing was left out.
    """

    without: str
    recipe: Recipe
    models: Mapping[str, FittedModel]
    heldout_rmse_um: Mapping[str, float]


def fallbacks_of(
    question: Question, recipe: Recipe, source: RunSource, runs: Sequence[str], parts: Sequence[Part], ridge: float
) -> tuple[Fallback, ...]:
    """One fallback per input of a model, on the same time constants; none for an input without which none is left."""
    found = []
    for name in recipe.design.inputs:
        rest = _without(question, recipe.design.datum, recipe, name)
        if rest is None:
            continue
        rows = rows_of(source, rest.design, runs)
        squares, n = np.zeros(len(rest.design.responses)), 0
        for part in parts:
            unseen, training = rows.only(part.unseen(rows)), rows.only(part.training(rows))
            error = unseen.responses - predictions(rest, training, unseen, ridge=ridge)
            squares += (error**2).sum(axis=0)
            n += len(error)
        rmse = np.sqrt(squares / n) if n else np.full(len(squares), np.nan)
        found.append(
            Fallback(
                name,
                rest,
                final_models(rest, rows, ridge=ridge),
                dict(zip(rest.design.responses, map(float, rmse), strict=True)),
            )
        )
    return tuple(found)


def _without(question: Question, datum: Datum, recipe: Recipe, name: str) -> Recipe | None:
    sensors = tuple(sensor for sensor in recipe.sensors if sensor != name)
    shape, speeds = recipe.shape, tuple(speed for speed in question.speeds if speed != name)
    if name in question.speeds and not speeds:
        shape = replace(shape, speed_taus_s=())
    if not sensors:
        return None
    return Recipe.of(replace(question, speeds=speeds), datum, sensors, shape)
