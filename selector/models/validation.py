"""Proof on unseen runs: what a fixed set of columns predicts for folds that its fit has not seen."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from selector.models.moments import Moments, coefficients, squared_error

Grouping = tuple[tuple[int, ...], ...]
"""Folds (positions in `Moments.folds`) that are left out together."""


@dataclass(frozen=True)
class HeldOut:
    """Errors on folds that a fit has not seen."""

    sse: NDArray[np.float64]  #: (n_groups, n_responses): Sum of squared prediction errors [µm²] in each group left out
    n_samples: NDArray[np.float64]  #: (n_groups,)

    @property
    def mse(self) -> NDArray[np.float64]:
        """Mean squared error [µm²] per group and response."""
        return self.sse / np.maximum(self.n_samples, 1.0)[:, None]

    @property
    def rmse_um(self) -> NDArray[np.float64]:
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
    """Cross-products with each group left out, made once and used for every candidate."""

    training: NDArray[np.float64]  #: (n_groups, k, k)
    left_out: NDArray[np.float64]  #: (n_groups, k, k)
    n_columns: int

    @classmethod
    def of(cls, m: Moments, grouping: Grouping) -> LeaveOneOut:
        """From the moments of all folds."""
        left_out = np.array([m.products[list(group)].sum(axis=0) for group in grouping])
        return cls(m.products.sum(axis=0) - left_out, left_out, m.n_columns)

    def errors(self, columns: Sequence[int], n_responses: int) -> HeldOut:
        """Errors of the least-squares fit on some columns (0 = first term), refitted without each group."""
        at = [1 + column for column in columns]
        responses = range(1 + self.n_columns, 1 + self.n_columns + n_responses)
        beta = coefficients(self.training, at, responses)
        return HeldOut(squared_error(self.left_out, at, responses, beta), self.left_out[:, 0, 0])


def response_power(m: Moments) -> NDArray[np.float64]:
    """Variance of each response over all folds [µm²], shape (n_responses,): what errors are compared to."""
    total = m.whole
    n = max(float(total[0, 0]), 1.0)
    at = np.arange(1 + m.n_columns, total.shape[0])
    return np.asarray(np.maximum(total[at, at] / n - (total[0, at] / n) ** 2, 1e-300))


WORTH_OF_A_SENSOR = 0.05
"""Root mean square errors that are nearer to each other than this share count as equal."""
MOST_ABOVE_BEST = 0.10


def within_one_standard_error(errors: NDArray[np.float64], weights: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which candidates predict unseen groups as well as the best one does, as far as the groups can tell.

    The differences to the best are taken group by group, which removes what makes a group hard for everyone; a
    candidate is as good if its mean difference is within one standard error of zero. With few groups that error is
    itself uncertain, so a candidate must also stay within `MOST_ABOVE_BEST` of the best in root mean square. The best
    of many is lucky too: what is within `WORTH_OF_A_SENSOR` of it is as good whatever the groups say.

    `errors` are the mean squared errors, shape (n_candidates, n_groups), `weights` the samples in each group.
    """
    share = weights / weights.sum()
    mean = errors @ share
    best = int(np.argmin(mean))
    difference = errors - errors[best]
    n = errors.shape[1]
    spread = np.sqrt(((difference - (difference @ share)[:, None]) ** 2) @ share * n / max(n - 1, 1) / n)
    alike = (mean - mean[best] <= spread) & (mean <= mean[best] * (1.0 + MOST_ABOVE_BEST) ** 2)
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
        n_sensors,
        tuple(map(float, rmse)),
        tuple(map(float, error)),
        tuple(tuple(map(float, row)) for row in per_group),
    )
