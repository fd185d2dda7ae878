"""From a choice to coefficients: the final fit, fits without each sensor, and what the fit has met."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import minimize

from selector.models.design import Datum, Design, Rows, Scaling, Term, design_matrix, rows_of
from selector.models.least_squares import FittedModel, fit, validity_hull
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
) -> tuple[Fallback, ...]:
    """One fallback per input of a model, on the same time constants; none for an input without which none is left."""
    found = []
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
        found.append(
            Fallback(
                name,
                rest,
                final_models(rest, rows, ridge=ridge),
                dict(zip(rest.design.responses, map(float, rmse), strict=True)),
            )
        )
    return tuple(found)


def recipe_without(question: Question, recipe: Recipe, name: str) -> Recipe | None:
    """The recipe without one input; None where no term is left."""
    sensors = tuple(sensor for sensor in recipe.sensors if sensor != name)
    shape, speeds = recipe.shape, tuple(speed for speed in question.speeds if speed != name)
    if name in question.speeds and not speeds:
        shape = replace(shape, speed_taus_s=())
    if not shape.terms(sensors, speeds):
        return None
    return Recipe.of(replace(question, speeds=speeds), recipe.design.datum, sensors, shape)


#: Samples of one run, evenly spaced; the extremes of every variable and displacement are kept beside them.
READING_POINTS = 300
MOST_RUNS = 20
#: Samples of all runs of which the distance to the other runs is computed: each costs about a millisecond.
MOST_JUDGED = 1200
DIGITS = 4  #: Decimals [K, °C, rpm, µm, s]: they are for pictures, and results hold them as text.


@dataclass(frozen=True)
class Readings:
    """Samples of one run, thinned."""

    run: str
    n_samples: int  #: Of the run, before thinning
    time_s: Array  #: (n_kept,)
    #: (n_kept, n_variables): Inputs and lags of the model, as its design has them (rises, or readings)
    variables: Array
    displacement_um: Array  #: (n_kept, n_responses)
    #: (n_kept,): Distance to the hull of all that is not left out together with the sample, in standard deviations of
    #: the inputs; 0 inside, NaN where it was not computed
    beyond_others: Array

    def as_dict(self, variables: Sequence[str], responses: Sequence[str]) -> dict[str, Any]:
        """JSON form, with the names of the columns."""
        return {
            "run": self.run,
            "n_samples": self.n_samples,
            "time_s": self.time_s.tolist(),
            "variables": dict(zip(variables, self.variables.T.tolist(), strict=True)),
            "displacement_um": dict(zip(responses, self.displacement_um.T.tolist(), strict=True)),
            "beyond_others": self.beyond_others.tolist(),
        }


def kept_readings(rows: Rows, parts: Sequence[Part]) -> tuple[Readings, ...]:
    """At most `MOST_RUNS` runs of the fit: those with an extreme of any column, and others evenly between them."""
    columns = np.column_stack([rows.variables, rows.responses])
    present = np.unique(rows.run)
    extreme = np.unique(rows.run[_extremes(columns)])
    others = np.setdiff1d(present, extreme)
    runs = np.union1d(extreme, others[evenly(len(others), MOST_RUNS - len(extreme))])
    at_run = [at[telling_samples(columns[at], READING_POINTS)] for at in (np.flatnonzero(rows.run == r) for r in runs)]
    judged = [at[evenly(len(at), MOST_JUDGED // len(runs))] for at in at_run]
    beyond = _beyond_others(rows, parts, np.concatenate(judged))
    return tuple(
        Readings(
            rows.runs[r],
            int((rows.run == r).sum()),
            *(np.round(course[at], DIGITS) for course in (rows.time_s, rows.variables, rows.responses, beyond)),
        )
        for r, at in zip(runs.tolist(), at_run, strict=True)
    )


def telling_samples(columns: Array, points: int) -> Indices:
    """Positions of samples, evenly spaced, with the lowest and the highest of every column beside them."""
    return np.union1d(evenly(len(columns), points), _extremes(columns))


def evenly(n: int, most: int) -> Indices:
    """At most so many of `n` positions, the first and the last among them."""
    return np.unique(np.linspace(0, n - 1, min(max(most, 0), n)).astype(np.int64))


def _extremes(columns: Array) -> Indices:
    return np.unique(np.concatenate([columns.argmin(axis=0), columns.argmax(axis=0)]))


def _beyond_others(rows: Rows, parts: Sequence[Part], judged: Indices) -> Array:
    distance = np.full(len(rows.run), np.nan)
    kept = {rows.runs[r] for r in np.unique(rows.run[judged]).tolist()}
    for part in parts:
        # of thousands of runs only some are kept, and to look for the samples of each takes a pass over all of them
        if kept.isdisjoint(part.runs):
            continue
        mine = np.intersect1d(judged, np.flatnonzero(part.unseen(rows)))
        training = part.training(rows)
        if len(mine) and training.any():
            distance[mine] = validity_hull(rows.variables[training]).distance(rows.variables[mine])
    return distance
