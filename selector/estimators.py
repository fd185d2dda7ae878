"""The same functions as scikit-learn estimators: for pipelines, grid searches and whoever thinks in arrays.

Nothing is computed here that `sensors`, `models` and `selection` do not compute; errors are ValueErrors, as
scikit-learn wants them.
"""

import itertools
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Literal, Self

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.feature_selection import SelectorMixin
from sklearn.utils.validation import check_consistent_length, check_is_fitted, validate_data

from selector.errors import InputError
from selector.models.best_subsets.problem import cross_products, factor_from_rows
from selector.models.best_subsets.results import CRITERIA, Criterion
from selector.models.best_subsets.subsets import best_subsets
from selector.recording import Channel, Recording
from selector.selection import Options, select
from selector.sensors import correlation_similarity, lambda_axis, lambda_cut, screen, transitive_closure
from selector.types import Array, Mask

Level = float | Sequence[float] | Literal["auto"]


class FuzzyClusterSelector(SelectorMixin, BaseEstimator):  # type: ignore[misc]
    """Keep one sensor of each group of sensors that move together (P steps 1 to 4).

    Sensors are grouped by the λ-cut of the transitive closure of their correlation; from each group stays the one
    most correlated with the displacement.

    Parameters
    ----------
    level : float, sequence of float, or "auto"
        λ, or one per round of screening. "auto": in each round the cut whose F-statistic stands out most, and no
        grouping at all when none does.
    rounds : int
        Rounds of screening. A further round at the same λ has no effect; give a falling sequence, or "auto".
    absolute : bool
        Group by |r|, so that a sensor and its mirror image stand together.

    Attributes
    ----------
    level_ : tuple of float
        λ of each round.
    similarity_, closure_ : ndarray of shape (n_features, n_features)
    partition_ : selector.sensors.Partition
        Groups of the first round.
    rounds_ : tuple of selector.sensors.ScreeningRound
        Every round, with a reason for every sensor dropped.
    representatives_ : ndarray of int
        Columns that are kept, ascending.
    """

    def __init__(self, level: Level = "auto", rounds: int = 1, absolute: bool = False) -> None:
        self.level = level
        self.rounds = rounds
        self.absolute = absolute

    def fit(self, X: ArrayLike, y: ArrayLike) -> Self:
        """Group the columns of X, shape (n_samples, n_features), and choose by y, shape (n_samples,).

        Raises ValueError: missing values, fewer than three samples, a λ outside [-1, 1], or no column that moves.
        """
        readings, response = _checked(self, X, y, at_least=3)
        n_features = readings.shape[1]
        given = _levels(self.level, self.rounds)
        with _value_errors():
            both = correlation_similarity(np.column_stack([readings, response]), absolute=self.absolute)
            similarity = both.matrix[:-1, :-1]
            idle = tuple(i for i in both.constant if i < n_features)
            if len(idle) == n_features:
                raise ValueError("No feature moves: every column of X is constant, so there is nothing to group.")
            relevance = np.abs(both.matrix[:-1, -1])
            levels: list[float] = []
            kept: tuple[int, ...] = tuple(range(n_features))
            for i in range(self.rounds):
                levels.append(_strongest_level(similarity[np.ix_(kept, kept)]) if given is None else given[i])
                rounds = screen(similarity, relevance, levels, constant=idle)
                kept = tuple(sorted(rounds[-1].representatives))
            self.partition_ = lambda_cut(similarity, levels[0], _names(self))
        self.level_ = tuple(levels)
        self.similarity_ = np.array(similarity)
        self.closure_ = transitive_closure(similarity)
        self.rounds_ = rounds
        self.representatives_ = np.array(kept)
        return self

    def _get_support_mask(self) -> Mask:
        check_is_fitted(self)
        mask: Mask = np.zeros(self.n_features_in_, dtype=np.bool_)
        mask[self.representatives_] = True
        return mask

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.target_tags.required = True
        return tags


class BestSubsetRegressor(RegressorMixin, BaseEstimator):  # type: ignore[misc]
    """Least squares on the best subset of the columns: exact, not greedy.

    Parameters
    ----------
    max_size : int or None
        Most columns; None = as many as the samples allow.
    criterion : {"adjusted_r2", "aicc", "bic", "cp"}
        Which size wins (P step 5: adjusted R²). Within a size all criteria agree.
    fit_intercept : bool
        Whether the model has a constant.

    Attributes
    ----------
    coef_ : ndarray of shape (n_features,)
        0 for columns that were not chosen.
    intercept_ : float
    support_ : ndarray of bool of shape (n_features,)
    search_ : selector.models.best_subsets.results.SubsetSearch
        The best subset of every size, and the proof.
    """

    def __init__(
        self, max_size: int | None = None, criterion: Criterion = "adjusted_r2", fit_intercept: bool = True
    ) -> None:
        self.max_size = max_size
        self.criterion = criterion
        self.fit_intercept = fit_intercept

    def fit(self, X: ArrayLike, y: ArrayLike) -> Self:
        """Search the subsets of the columns of X, shape (n_samples, n_features), for y, shape (n_samples,).

        Raises ValueError: missing values, too few samples, an unknown criterion, or a `max_size` below 1.
        """
        readings, response = _checked(self, X, y, at_least=3)
        n_samples, n_features = readings.shape
        if self.criterion not in CRITERIA:
            raise ValueError(f"criterion must be one of {', '.join(CRITERIA)}; got {self.criterion!r}.")
        if self.max_size is not None:
            _whole("max_size", self.max_size)
        intercept = bool(self.fit_intercept)
        with _value_errors():
            self.search_ = best_subsets(
                cross_products(readings, response, intercept=intercept),
                n_samples,
                max_size=min(n_features, n_samples - intercept - 1, self.max_size or n_features),
                intercept=intercept,
                factor=factor_from_rows(readings, response, intercept=intercept),
            )
            columns = list(self.search_.best(self.criterion).columns)
        centre = readings.mean(axis=0) if intercept else np.zeros(n_features)
        level = float(response.mean()) if intercept else 0.0
        self.coef_ = np.zeros(n_features)
        self.coef_[columns] = np.linalg.lstsq((readings - centre)[:, columns], response - level, rcond=None)[0]
        self.intercept_ = level - float(centre @ self.coef_)
        self.support_ = np.zeros(n_features, dtype=np.bool_)
        self.support_[columns] = True
        return self

    def predict(self, X: ArrayLike) -> Array:
        """Predictions of shape (n_samples,)."""
        return np.asarray(_checked_again(self, X) @ self.coef_ + self.intercept_)


class ThermalRegressor(RegressorMixin, BaseEstimator):  # type: ignore[misc]
    """The whole selection on arrays: groups, representatives, exact subsets, terms, and a proof on unseen runs.

    The columns are temperatures or, better, rises; y is the displacement [µm]. Rows of a run are in time order. There
    is no memory term here, since a row of an array knows no past: use `selector.selection.select` on a `Recording`.

    Parameters
    ----------
    degree : {1, 2, 3}
        Highest power that is offered to the model; what does not help on unseen runs is not used.
    interactions : bool
        Offer products of different sensors too.
    max_sensors : int
        Most sensors.
    level : float, sequence of float, or "auto"
        λ of the grouping, or one per round.
    rounds : int
        Rounds of screening.
    ridge : bool
        Shrink the coefficients by the amount that predicts unseen runs best.

    Attributes
    ----------
    selection_ : selector.selection.Selection
        Everything: groups, combinations, reasons, proof, findings.
    model_ : selector.models.least_squares.FittedModel
    sensors_ : tuple of str
        Chosen columns by name (x0, x1, … without names).
    support_ : ndarray of bool of shape (n_features,)
    heldout_rmse_ : float
        Root mean square error on runs (or blocks of a single run) that neither sensors nor terms have seen [µm].
    """

    def __init__(
        self,
        degree: int = 1,
        interactions: bool = False,
        max_sensors: int = 5,
        level: Level = "auto",
        rounds: int = 1,
        ridge: bool = False,
    ) -> None:
        self.degree = degree
        self.interactions = interactions
        self.max_sensors = max_sensors
        self.level = level
        self.rounds = rounds
        self.ridge = ridge

    def fit(self, X: ArrayLike, y: ArrayLike, runs: ArrayLike | None = None) -> Self:
        """Select and fit.

        Parameters
        ----------
        X : array of shape (n_samples, n_features)
        y : array of shape (n_samples,)
        runs : array of shape (n_samples,), optional
            Which run each row belongs to; whole runs are left out to prove the model. Without it there is one run.

        Raises ValueError: missing values, or data and parameters that cannot support a model; the message says what to
        change.
        """
        readings, displacement = _checked(self, X, y, at_least=5)
        levels = _levels(self.level, self.rounds)
        _whole("max_sensors", self.max_sensors)
        names = _names(self)
        response = next(name for name in itertools.accumulate(itertools.repeat("y")) if name not in names)
        with _value_errors():
            options = Options(
                level=None if levels is None else tuple(levels),
                rounds=self.rounds,
                max_sensors=self.max_sensors,
                degree=self.degree,
                interactions=self.interactions,
                ridge=self.ridge,
                reference="absolute",
            )
            self.selection_ = select(_recording(readings, displacement, names, response, runs), options)
        self.model_ = self.selection_.models[response]
        self.sensors_ = self.selection_.chosen
        self.support_ = np.isin(names, self.sensors_)
        self.heldout_rmse_ = self.selection_.proof.rmse_um(response)
        return self

    def predict(self, X: ArrayLike) -> Array:
        """Displacements [µm], shape (n_samples,)."""
        readings = _checked_again(self, X)
        names = _names(self)
        return self.model_.predicted(readings[:, [names.index(name) for name in self.model_.scaling.variables]])


def _checked(estimator: BaseEstimator, X: ArrayLike, y: ArrayLike, *, at_least: int) -> tuple[Array, Array]:
    checked: tuple[Array, Array] = validate_data(
        estimator, X, y, dtype=np.float64, y_numeric=True, ensure_min_samples=at_least
    )
    return checked[0], np.asarray(checked[1], dtype=np.float64)


def _checked_again(estimator: BaseEstimator, X: ArrayLike) -> Array:
    check_is_fitted(estimator)
    checked: Array = validate_data(estimator, X, dtype=np.float64, reset=False)
    return checked


def _names(estimator: BaseEstimator) -> tuple[str, ...]:
    """Names of the columns: those seen in fit, or x0, x1, …."""
    given = getattr(estimator, "feature_names_in_", None)
    return tuple(f"x{i}" for i in range(estimator.n_features_in_)) if given is None else tuple(map(str, given))


@contextmanager
def _value_errors() -> Iterator[None]:
    """Errors of the input as scikit-learn raises them."""
    try:
        yield
    except InputError as error:
        raise ValueError(str(error)) from error


def _levels(level: Level, rounds: int) -> list[float] | None:
    """λ of each round, the last one repeated; None = "auto"."""
    _whole("rounds", rounds)
    if isinstance(level, str):
        if level != "auto":
            raise ValueError(f'level must be a number, a sequence of numbers, or "auto"; got {level!r}.')
        return None
    given = np.atleast_1d(np.asarray(level, dtype=np.float64)).tolist()
    if not given:
        raise ValueError("level is empty; give at least one λ.")
    return [float(given[min(i, len(given) - 1)]) for i in range(rounds)]


def _strongest_level(similarity: Array) -> float:
    step = lambda_axis(similarity).strongest()
    return 1.0 if step is None else step.partition.level


def _whole(name: str, value: int) -> None:
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 1:
        raise ValueError(f"{name} must be a whole number of at least 1; got {value!r}.")


def _recording(X: Array, y: Array, names: Sequence[str], response: str, runs: ArrayLike | None) -> Recording:
    """Rows as a recording: those of a run together in the order given, time counted in samples."""
    if runs is None:
        runs = np.full(len(y), "run 1")
    check_consistent_length(y, runs)
    number, found = pd.factorize(np.asarray(runs))
    labels = np.array([str(run) for run in found])
    order = np.argsort(number, kind="stable")
    number = number[order]
    time = np.arange(len(y)) - np.searchsorted(number, number)
    index = pd.MultiIndex.from_arrays([labels[number], time.astype(np.float64)], names=["run", "time_s"])
    frame = pd.DataFrame(np.column_stack([X, y])[order], index=index, columns=[*names, response])
    sensors = tuple(Channel(name, "temperature", "degC") for name in names)
    return Recording(frame, (*sensors, Channel(response, "displacement", "um")))
