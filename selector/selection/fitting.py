"""From a choice to coefficients: the final fit, fits without each sensor, and what the fit has met."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from selector.models.design import Datum, Design, Rows, Scaling, Term, design_matrix, rows_of
from selector.models.least_squares import FittedModel, fit
from selector.recording import RunSource
from selector.selection.choice import Trial
from selector.selection.library import Shape
from selector.selection.options import Question
from selector.types import Array, Indices, Mask

#: Samples of the final fit. A warming machine says nothing new between neighbours; 10⁷ samples are thinned to these.
MAX_ROWS = 200_000
#: How far, in the logarithm, a time constant may move off the grid point that unseen data chose: half a step.
TAU_REACH = 0.25


@dataclass(frozen=True)
class Part:
    """What is left out together: whole runs, or a block of a run when there is no other run to leave out."""

    name: str
    runs: tuple[str, ...]
    block: int | None = None
    n_blocks: int = 1
    told_by_run: bool = False  #: Errors are told run by run: these are left out together only because there are many

    def unseen(self, rows: Rows) -> Mask:
        """Which samples are left out."""
        mine = np.isin(rows.run, [i for i, run in enumerate(rows.runs) if run in self.runs])
        return mine if self.block is None else mine & (rows.blocks(self.n_blocks) == self.block)

    def training(self, rows: Rows) -> Mask:
        """Which samples may be learnt from: all others, but for the purged edges of blocks."""
        others = ~self.unseen(rows)
        return others if self.block is None else others & (rows.blocks(self.n_blocks) >= 0)


@dataclass(frozen=True)
class Recipe:
    """All that is needed to compute the columns of a chosen model."""

    sensors: tuple[str, ...]
    shape: Shape
    design: Design
    terms: tuple[Term, ...]

    @classmethod
    def of(cls, question: Question, datum: Datum, sensors: tuple[str, ...], shape: Shape) -> "Recipe":
        """The recipe for a set of sensors and a shape."""
        speeds = question.speeds if shape.speed_taus_s else ()
        design = Design((*sensors, *speeds), question.responses, datum, shape.lags(sensors, question.speeds))
        return cls(sensors, shape, design, shape.terms(sensors, question.speeds))

    def scaling(self, rows: Rows) -> Scaling:
        """Centre and scale of the variables over these samples."""
        mean, deviation = rows.variables.mean(axis=0), rows.variables.std(axis=0)
        scale = np.where(deviation > 1e-12 * np.maximum(1.0, np.abs(mean)), deviation, 1.0)
        scaling = Scaling(self.design.variables, tuple(map(float, mean)), tuple(map(float, scale)))
        return scaling if self.shape.form.is_hierarchical else scaling.about_zero()


def refined(
    question: Question, source: RunSource, datum: Datum, trial: Trial, training: Callable[[Rows], Mask] | None = None
) -> Recipe:
    """The recipe of a trial, its time constants moved off the grid to where they fit the training samples best."""
    recipe = Recipe.of(question, datum, trial.set.sensors, trial.shape)
    if not trial.shape.has_memory:
        return recipe
    n_sensor = len(trial.shape.sensor_taus_s)
    start = np.log([*trial.shape.sensor_taus_s, *trial.shape.speed_taus_s])

    def with_taus(log_taus: Array) -> Recipe:
        taus = [float(f"{tau:.4g}") for tau in np.exp(log_taus)]
        shape = Shape(trial.shape.form, tuple(taus[:n_sensor]), tuple(taus[n_sensor:]))
        return Recipe.of(question, datum, trial.set.sensors, shape)

    from scipy.optimize import minimize

    def misfit(log_taus: Array) -> float:
        bounded = np.clip(log_taus, start - TAU_REACH, start + TAU_REACH)
        trial_recipe = with_taus(bounded)
        rows = rows_of(source, trial_recipe.design, source.runs)
        rows = rows if training is None else rows.only(training(rows))
        columns = _columns(trial_recipe, rows)
        # only the misfit is wanted, and of scaled columns: normal equations are exact enough and much faster
        normal = columns.T @ columns + 1e-12 * len(columns) * np.eye(columns.shape[1])
        residuals = rows.responses - columns @ np.linalg.solve(normal, columns.T @ rows.responses)
        power = np.maximum(rows.responses.var(axis=0), 1e-300)
        return float(((residuals**2).mean(axis=0) / power).mean()) + 1e-3 * float(np.abs(log_taus - bounded).sum())

    best = minimize(misfit, start, method="Nelder-Mead", options={"maxfev": 30 * len(start), "xatol": 0.02})
    return with_taus(np.clip(best.x, start - TAU_REACH, start + TAU_REACH))


def final_models(recipe: Recipe, rows: Rows, *, ridge: float = 0.0) -> dict[str, FittedModel]:
    """One model per response on the same terms."""
    scaling = recipe.scaling(rows)
    return {
        name: fit(
            rows.variables,
            rows.responses[:, j],
            scaling=scaling,
            terms=recipe.terms,
            name=name,
            runs=rows.run,
            ridge=ridge,
        )
        for j, name in enumerate(recipe.design.responses)
    }


def predictions(recipe: Recipe, training: Rows, unseen: Rows, *, ridge: float = 0.0) -> Array:
    """Displacements [µm] of unseen samples from a fit on others, shape (n_unseen, n_responses)."""
    scaling = recipe.scaling(training)
    columns, responses = _columns(recipe, training, scaling), training.responses
    if ridge:
        penalty = np.sqrt(ridge * len(columns)) * np.eye(columns.shape[1])
        penalty[0, 0] = 0.0
        columns = np.vstack([columns, penalty])
        responses = np.vstack([responses, np.zeros((len(penalty), responses.shape[1]))])
    beta = np.linalg.lstsq(columns, responses, rcond=None)[0]
    return np.asarray(_columns(recipe, unseen, scaling) @ beta)


def _unseen_errors(recipe: Recipe, rows: Rows, parts: Sequence[Part], ridge: float) -> Iterator[Array]:
    """Measured minus predicted displacements [µm] of each part, from a fit on the others."""
    for part in parts:
        unseen, training = rows.only(part.unseen(rows)), rows.only(part.training(rows))
        yield unseen.responses - predictions(recipe, training, unseen, ridge=ridge)


def ridge_penalty(recipe: Recipe, rows: Rows, parts: Sequence[Part]) -> tuple[float, float, float]:
    """The ridge penalty that predicts left-out groups best, held-out rmse with it and without [µm, all responses]."""
    best = (0.0, np.inf)
    plain = np.inf
    for penalty in (0.0, *np.geomspace(1e-6, 1.0, 13)):
        sse, n = 0.0, 0
        for error in _unseen_errors(recipe, rows, parts, float(penalty)):
            sse += float((error**2).sum())
            n += error.size
        rmse = float(np.sqrt(sse / max(n, 1)))
        if penalty == 0.0:
            plain = rmse
        if rmse < best[1]:
            best = (float(penalty), rmse)
    return best[0], best[1], plain


def _columns(recipe: Recipe, rows: Rows, scaling: Scaling | None = None) -> Array:
    scaling = scaling or recipe.scaling(rows)
    columns = design_matrix(scaling.scaled(rows.variables), scaling.variables, recipe.terms)
    return np.column_stack([np.ones(len(columns)), columns])


@dataclass(frozen=True)
class Fallback:
    """The model without one input."""

    without: str  #: The sensor, or the spindle speed
    recipe: Recipe
    models: Mapping[str, FittedModel]  #: One per response
    #: Per response, on the parts that were left out of the fit; NaN where nothing was left out
    heldout_rmse_um: Mapping[str, float]


def fallbacks_of(
    question: Question, recipe: Recipe, source: RunSource, runs: Sequence[str], parts: Sequence[Part], ridge: float
) -> Iterator[Fallback]:
    """One fallback per input of a model, on the same time constants; none for an input without which none is left."""
    for name in recipe.design.inputs:
        rest = recipe_without(question, recipe, name)
        if rest is None:
            continue
        rows = rows_of(source, rest.design, runs)
        squares, n = np.zeros(len(rest.design.responses)), 0
        for error in _unseen_errors(rest, rows, parts, ridge):
            squares += (error**2).sum(axis=0)
            n += len(error)
        rmse = np.sqrt(squares / n) if n else np.full(len(squares), np.nan)
        yield Fallback(
            name,
            rest,
            final_models(rest, rows, ridge=ridge),
            dict(zip(rest.design.responses, map(float, rmse), strict=True)),
        )


def recipe_without(question: Question, recipe: Recipe, name: str) -> Recipe | None:
    """The recipe without one input; None where no term is left."""
    sensors = tuple(sensor for sensor in recipe.sensors if sensor != name)
    shape, speeds = recipe.shape, tuple(speed for speed in question.speeds if speed != name)
    if name in question.speeds and not speeds:
        shape = replace(shape, speed_taus_s=())
    if not shape.terms(sensors, speeds):
        return None
    return Recipe.of(replace(question, speeds=speeds), recipe.design.datum, sensors, shape)


def evenly(n: int, most: int) -> Indices:
    """At most so many of `n` positions, the first and the last among them."""
    return np.unique(np.linspace(0, n - 1, min(max(most, 0), n)).astype(np.int64))
