"""Cross-products of regression columns, run by run and in short stretches; the proof on unseen runs by them."""

from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from selector.models.design import Columns, Design, Scaling, block_bounds
from selector.recording import RunSource
from selector.types import Array, Indices, Mask

_ROWS = 20_000


@dataclass(frozen=True)
class Fold:
    """A part of the data that is left out as a whole: a run, a condition, or a block of a single run."""

    name: str
    runs: tuple[str, ...]
    block: int | None = None


@dataclass(frozen=True)
class Moments:
    """Cross-products of (1, columns, responses) in each fold."""

    #: (n_folds, 1 + n_columns + n_responses, same): W'W of the fold's rows, W = [1, columns, responses]
    products: Array
    folds: tuple[Fold, ...]
    n_columns: int
    n_responses: int
    #: (k, k): The same over all rows of these folds; with blocks, rows purged between them are in here only
    whole: Array

    @property
    def n_samples(self) -> Array:
        """Samples in each fold, shape (n_folds,)."""
        return self.products[:, 0, 0]

    def only(self, folds: Sequence[int]) -> "Moments":
        """The moments of some folds; a fold may stand several times, as in a bootstrap over runs."""
        if list(folds) == list(range(len(self.folds))):
            return self
        products = self.products[list(folds)]
        names = tuple(self.folds[i] for i in folds)
        return Moments(products, names, self.n_columns, self.n_responses, products.sum(axis=0))


def centred(total: Array) -> tuple[Array, float]:
    """Cross-products about the mean, from those of [1, ...] of shape (..., k, k); and the number of samples.

    A column that rests gets exact zeros: what centring leaves of it is rounding.
    """
    n = float(total.flat[0])
    sums = total[..., 0, 1:]
    cross = total[..., 1:, 1:] - sums[..., :, None] * sums[..., None, :] / max(n, 1.0)
    rests = np.einsum("...ii->...i", cross) <= 1e-13 * np.einsum("...ii->...i", total)[..., 1:]
    cross[rests[..., :, None] | rests[..., None, :]] = 0.0
    return (cross + np.swapaxes(cross, -1, -2)) / 2.0, n


def scaling_of(source: RunSource, design: Design) -> Scaling:
    """Centre (mean) and scale (standard deviation) of every variable over all complete samples, in one pass."""
    n = 0.0
    mean = np.zeros(len(design.variables))
    spread = np.zeros(len(design.variables))
    for run in source.runs:
        for piece in design.pieces(source, run):
            values = piece.variables
            m = len(values)
            here = values.mean(axis=0)
            delta = here - mean
            spread += ((values - here) ** 2).sum(axis=0) + delta**2 * n * m / (n + m)
            mean += delta * m / (n + m)
            n += m
    deviation = np.sqrt(spread / max(n - 1.0, 1.0))
    floor = 1e-12 * np.maximum(1.0, np.abs(mean))
    scale = np.where(deviation > floor, deviation, 1.0)
    return Scaling(design.variables, tuple(map(float, mean)), tuple(map(float, scale)))


def moments(
    source: RunSource,
    design: Design,
    columns: Columns,
    *,
    n_blocks: int = 1,
    fold_of: Mapping[str, Hashable] | None = None,
) -> Moments:
    """Cross-products of every run (`n_blocks` = 1), or of the blocks of every run.

    Blocks are those of `block_bounds`. Runs for which `fold_of` says the same make one fold together, named after the
    first. One pass; memory O(n_folds · n_columns²), whatever the number of samples.
    """
    size = 1 + len(columns.terms) + len(design.responses)
    folds: list[Fold] = []
    products: list[Array] = []
    whole = np.zeros((size, size))
    position: dict[Hashable, int] = {}
    for run in source.runs:
        if n_blocks == 1:
            parts = [np.zeros((size, size))]
            for _, variables, responses in _slices(source, design, run):
                _add(parts[0], columns, variables, responses)
            whole += parts[0]
        else:
            parts = _block_products(source, design, columns, run, whole, n_blocks)
        for i, product in enumerate(parts):
            key = None if fold_of is None or n_blocks > 1 else fold_of.get(run)
            if product[0, 0] > 0 and key is not None and key in position:
                at = position[key]
                products[at] += product
                folds[at] = replace(folds[at], runs=(*folds[at].runs, run))
            elif product[0, 0] > 0:
                position[key] = len(folds)
                folds.append(
                    Fold(run if n_blocks == 1 else f"{run} block {i + 1}", (run,), i if n_blocks > 1 else None)
                )
                products.append(product)
    stacked = np.array(products) if products else np.zeros((0, size, size))
    return Moments(stacked, tuple(folds), len(columns.terms), len(design.responses), whole)


def _block_products(
    source: RunSource, design: Design, columns: Columns, run: str, whole: Array, n_blocks: int
) -> list[Array]:
    n = sum(len(piece.time_s) for piece in design.pieces(source, run))
    bounds = block_bounds(n, n_blocks)
    totals = [np.zeros_like(whole) for _ in bounds]
    for first, variables, responses in _slices(source, design, run):
        _add(whole, columns, variables, responses)
        for total, (start, stop) in zip(totals, bounds, strict=True):
            part = slice(max(start - first, 0), max(stop - first, 0))
            if len(variables[part]):
                _add(total, columns, variables[part], responses[part])
    return totals


def _slices(source: RunSource, design: Design, run: str) -> Iterator[tuple[int, Array, Array]]:
    """(position of the first row in the run, variables, responses) of at most `_ROWS` rows at a time."""
    first = 0
    for piece in design.pieces(source, run):
        for start in range(0, len(piece.time_s), _ROWS):
            rows = slice(start, start + _ROWS)
            yield first + start, piece.variables[rows], piece.responses[rows]
        first += len(piece.time_s)


def _add(total: Array, columns: Columns, variables: Array, responses: Array) -> None:
    rows = np.empty((len(variables), total.shape[0]), order="F")
    rows[:, 0] = 1.0
    rows[:, 1 : 1 + len(columns.terms)] = columns.matrix(variables)
    rows[:, 1 + len(columns.terms) :] = responses
    total += rows.T @ rows


def coefficients(total: Array, columns: Sequence[int], responses: Sequence[int]) -> Array:
    """(intercept, coefficients) of the least-squares fit on some columns, shape (..., 1 + len(columns), n_responses).

    `total` has shape (..., k, k): cross-products of [1, columns, responses], in which `columns` and `responses` are
    positions; the constant, position 0, is always in. The solution is that of minimum norm where columns are linearly
    dependent.
    """
    index = np.array([0, *columns])
    normal = total[..., index[:, None], index]
    right = total[..., index[:, None], np.asarray(responses)]
    diagonal = np.sqrt(np.maximum(np.einsum("...ii->...i", normal), 1e-300))
    scaled = normal / diagonal[..., :, None] / diagonal[..., None, :]
    rhs = right / diagonal[..., :, None]
    try:
        # a pivot below the rounding of the cross-products would give noise for coefficients
        factor = np.linalg.cholesky(scaled)
        if np.all(np.einsum("...ii->...i", factor) > 1e-6):
            return np.linalg.solve(scaled, rhs) / diagonal[..., :, None]
    except np.linalg.LinAlgError:
        pass
    solution = np.matmul(np.linalg.pinv(scaled, rcond=1e-12, hermitian=True), rhs)
    return solution / diagonal[..., :, None]


def squared_error(product: Array, columns: Sequence[int], responses: Sequence[int], beta: Array) -> Array:
    """Σ (y − ŷ)² of coefficients on rows that are known by their cross-products only, shape (..., n_responses).

    `product` has shape (..., k, k) and `beta` (..., 1 + len(columns), n_responses), as `coefficients` gives it.
    """
    index = np.array([0, *columns])
    at = np.asarray(responses)
    part = product[..., index[:, None], index]
    cross = product[..., index[:, None], at]
    total = product[..., at, at]
    return np.maximum(total - 2.0 * (beta * cross).sum(axis=-2) + (beta * (part @ beta)).sum(axis=-2), 0.0)


Grouping = tuple[tuple[int, ...], ...]  #: Folds (positions in `Moments.folds`) that are left out together.


@dataclass(frozen=True)
class HeldOut:
    """Errors on folds that a fit has not seen."""

    sse: Array  #: (n_groups, n_responses): Sum of squared prediction errors [µm²] in each group left out
    n_samples: Array  #: (n_groups,)

    @property
    def mse(self) -> Array:
        """Mean squared error [µm²] per group and response."""
        return self.sse / np.maximum(self.n_samples, 1.0)[:, None]

    @property
    def rmse_um(self) -> Array:
        """√ of the error pooled over all samples [µm], per response."""
        return np.sqrt(self.sse.sum(axis=0) / max(float(self.n_samples.sum()), 1.0))


def grouping_by_run(m: Moments) -> Grouping:
    """One group per run."""
    return _grouped(m, lambda runs: runs[0])


def grouping_by_condition(m: Moments, conditions: dict[str, str]) -> Grouping:
    """One group per condition; a run that has none stands for itself."""
    return _grouped(m, lambda runs: conditions.get(runs[0], runs[0]))


def inner_grouping(m: Moments) -> Grouping:
    """Groups to leave out when a choice is made on these folds alone.

    Runs, if there are three or more. With two, leaving one out shows what does not carry over from day to day but is
    only two numbers, so the blocks of the runs are left out as well; with one, its blocks.
    """
    by_run = grouping_by_run(m)
    by_block = tuple((i,) for i in range(len(m.folds)))
    if len(by_run) >= 3 or len(by_run) == len(by_block):
        return by_run
    return by_block if len(by_run) == 1 else (*by_run, *by_block)


def _grouped(m: Moments, key: Callable[[tuple[str, ...]], str]) -> Grouping:
    groups: dict[str, list[int]] = {}
    for i, fold in enumerate(m.folds):
        groups.setdefault(key(fold.runs), []).append(i)
    return tuple(tuple(members) for members in groups.values())


@dataclass(frozen=True)
class LeaveOneOut:
    """Each group of some folds left out in turn; nothing is copied of the cross-products of all folds."""

    products: Array  #: (n_folds, k, k): Those of `Moments`
    groups: Grouping  #: Positions in `products`
    total: Array  #: (n_groups or 1, k, k): What a group is left out of
    n_columns: int

    @classmethod
    def of(cls, m: Moments, grouping: Grouping) -> "LeaveOneOut":
        """From the moments of all folds."""
        return cls(m.products, grouping, m.products.sum(axis=0, keepdims=True), m.n_columns)

    def left_out(self, rows: Any, columns: Any) -> Array:
        """These elements of the cross-products of every group, shape (n_groups, ...)."""
        return np.array([sum(self.products[i][rows, columns] for i in group) for group in self.groups])

    def errors(self, columns: Sequence[int], n_responses: int) -> HeldOut:
        """Errors of the least-squares fit on some columns (0 = first term), refitted without each group."""
        sse = self.errors_of(np.array([columns], dtype=np.int64), n_responses)
        return HeldOut(sse[:, 0], self.left_out(0, 0))

    def errors_of(self, sets: Indices, n_responses: int) -> Array:
        """Sum of squared errors of many sets of as many columns, shape (n_groups, n_sets, n_responses).

        `sets` has shape (n_sets, n_columns of a set).
        """
        n_sets, size = sets.shape
        responses = 1 + self.n_columns + np.arange(n_responses)
        index = np.hstack([np.zeros((n_sets, 1), np.int64), 1 + sets, np.tile(responses, (n_sets, 1))])
        rows, places = index[:, :, None], index[:, None, :]
        at, of = range(1, 1 + size), range(1 + size, 1 + size + n_responses)
        errors, totals = [], [total[rows, places] for total in self.total]
        for k, group in enumerate(self.groups):
            left_out = np.asarray(sum(self.products[i][rows, places] for i in group))
            training = totals[k % len(totals)] - left_out
            errors.append(squared_error(left_out, at, of, coefficients(training, at, of)))
        return np.array(errors)


def response_power(m: Moments) -> Array:
    """Variance of each response over all folds [µm²], shape (n_responses,): what errors are compared to."""
    total = m.whole
    n = max(float(total[0, 0]), 1.0)
    at = np.arange(1 + m.n_columns, total.shape[0])
    return np.asarray(np.maximum(total[at, at] / n - (total[0, at] / n) ** 2, 1e-300))


WORTH_OF_A_SENSOR = 0.05  #: Root mean square errors that are nearer to each other than this share count as equal.
MOST_ABOVE_BEST = 0.10


def more_than_its_error(differences: Array, weights: Array) -> Mask:
    """Whether the mean of differences, one row a part, is above its standard error; of one part it always is."""
    share, n = weights / weights.sum(), len(differences)
    mean = share @ differences
    return np.asarray(mean > (np.sqrt(share @ (differences - mean) ** 2 / (n - 1)) if n > 1 else -np.inf))


def within_one_standard_error(errors: Array, weights: Array) -> Mask:
    """Which candidates predict unseen groups as well as the best one does, as far as the groups can tell.

    A candidate is as good if its mean difference to the best, group by group, is within one standard error of zero and
    its root mean square within `MOST_ABOVE_BEST`; or, whatever the groups say, if that is within `WORTH_OF_A_SENSOR`.

    `errors` are the mean squared errors, shape (n_candidates, n_groups), `weights` the samples in each group.
    """
    mean = errors @ weights / weights.sum()
    best = int(np.argmin(mean))
    is_clear = more_than_its_error((errors - errors[best]).T, weights)
    alike = ~is_clear & (mean <= mean[best] * (1.0 + MOST_ABOVE_BEST) ** 2)
    return np.asarray(alike | (mean <= mean[best] * (1.0 + WORTH_OF_A_SENSOR) ** 2))


@dataclass(frozen=True)
class ErrorCurvePoint:
    """Held-out error of the best set of one size, chosen anew inside every fold.

    `rmse_um` and its standard error over the groups are per response.
    """

    n_sensors: int
    rmse_um: tuple[float, ...]
    standard_error_um: tuple[float, ...]
    per_group_um: tuple[tuple[float, ...], ...]


def error_curve_point(n_sensors: int, held_out: HeldOut) -> ErrorCurvePoint:
    """The point of the sensors-against-error curve that these errors make."""
    rmse = held_out.rmse_um
    per_group = np.sqrt(held_out.mse)
    n = len(per_group)
    # standard error of the mean square, carried through the root
    error = held_out.mse.std(axis=0, ddof=1) / np.sqrt(n) / (2.0 * np.maximum(rmse, 1e-300)) if n > 1 else rmse * np.nan
    return ErrorCurvePoint(
        n_sensors, tuple(map(float, rmse)), tuple(map(float, error)), tuple(tuple(map(float, row)) for row in per_group)
    )
