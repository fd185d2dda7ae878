"""A fitted model: coefficients with robust uncertainty, quality of fit, collinearity; where it may be trusted.

Coefficients and covariances are computed here, because every fallback of every model needs them and statsmodels takes
a hundred times longer for the robust one; `FittedModel.statsmodels_results` gives the same fit to statsmodels.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from scipy.linalg import solve_triangular
from scipy.special import chdtrc

from selector.errors import OptionError
from selector.models.best_subsets.results import adjusted_r2
from selector.models.design import Scaling, Term, design_matrix, physical_transform
from selector.types import Array, Indices

if TYPE_CHECKING:
    from statsmodels.regression.linear_model import RegressionResultsWrapper

#: Unit columns that are nearer than this to depending on each other are taken to do so: what is left is noise.
_RANK = 1e-12


@dataclass(frozen=True)
class Diagnostics:
    """What the residuals and the design say about the trust in a fit."""

    durbin_watson: float  #: Near 2 = uncorrelated; near 0 = neighbouring residuals are alike. Within runs.
    ljung_box_p: float  #: p-value of "no autocorrelation up to lag 10", smallest over runs
    condition_number: float  #: Of the centred, scaled columns
    max_cooks_distance: float  #: Largest influence of one sample, > 1 is a sample that bends the model alone
    most_influential: int  #: Its row


@dataclass(frozen=True)
class FittedModel:
    """A displacement as a polynomial of scaled variables, with all that is needed to use and to doubt it."""

    response: str
    scaling: Scaling  #: Centre and scale of the variables; fitted in z = (x − centre)/scale
    terms: tuple[Term, ...]
    has_intercept: bool
    coefficients: Array  #: (1 + n_terms,): Intercept [µm], then one per term in z [µm]
    #: (1 + n_terms, 1 + n_terms): Robust to autocorrelation within runs (HAC, Newey–West per run)
    covariance: Array
    #: (1 + n_terms, 1 + n_terms): σ²(X'X)⁻¹, right for independent residuals only: what other programs print
    classical_covariance: Array
    vif: Array  #: (n_terms,): Variance inflation of each column
    valid_range: tuple[tuple[float, float], ...]  #: Smallest and largest value met while fitting, in x
    n_samples: int
    #: r2 and adjusted_r2: About the mean; about zero without an intercept: never rank the two together
    r2: float
    adjusted_r2: float
    rmse_um: float  #: √(mean squared residual), in sample
    residual_sd_um: float  #: √(rss/(n − coefficients))
    diagnostics: Diagnostics
    ridge: float = 0.0  #: Penalty on the squared scaled coefficients, per sample; 0 = ordinary least squares

    def __post_init__(self) -> None:
        for array in (self.coefficients, self.covariance, self.classical_covariance, self.vif):
            array.setflags(write=False)

    def predicted(self, variables: Array) -> Array:
        """Displacement [µm] for variables x of shape (n_samples, n_variables), in the order of `scaling`."""
        scaled = self.scaling.scaled(variables)
        columns = design_matrix(scaled, self.scaling.variables, self.terms)
        return columns @ self.coefficients[1:] + self.coefficients[0]

    def physical(self, *, robust: bool = True) -> tuple[tuple[Term, ...], Array, Array]:
        """Terms in x, coefficients (intercept first) and their standard errors: what people read.

        E.g. µm per K for a linear term. The control gets the scaled form: it keeps its digits in 32 bits. With
        `robust` the errors allow for autocorrelation, without it they are the classical ones.
        """
        terms, matrix = physical_transform(self.terms, self.scaling)
        covariance = self.covariance if robust else self.classical_covariance
        errors = np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", matrix, covariance, matrix), 0.0))
        return terms, matrix @ self.coefficients, errors

    def statsmodels_results(
        self, variables: Array, response: Array, runs: Indices | None = None, *, robust: bool = True
    ) -> RegressionResultsWrapper:
        """The same fit in statsmodels, in physical units: `summary()`, p values, tests of hypotheses, influence.

        It takes the samples that this model was fitted to, as `fit` does. With `robust`, errors allow for
        autocorrelation within runs (``hac-panel``), as those of `physical`; else they are classical.

        Raises OptionError: a ridge fit, or terms that ordinary least squares on physical variables does not have.
        """
        from statsmodels.regression.linear_model import OLS

        terms, matrix = physical_transform(self.terms, self.scaling)
        if self.ridge or len(terms) > len(self.terms) or (not self.has_intercept and matrix[0, 1:].any()):
            raise OptionError(
                f"a model of {self.response} " + ("with a ridge penalty" if self.ridge else "with terms of its own"),
                expected="ordinary least squares, every product with its factors",
                where="statsmodels_results",
                advice="fit without ridge, or read the coefficients and errors of physical()",
            )
        names = [*(["Intercept"] if self.has_intercept else []), *map(str, terms)]
        columns = design_matrix(variables, self.scaling.variables, terms)
        columns = np.column_stack([np.ones(len(columns)), columns]) if self.has_intercept else columns
        model = OLS(
            pd.Series(response, name=self.response), pd.DataFrame(columns, columns=names), hasconst=self.has_intercept
        )
        if not robust:
            return model.fit()
        groups = np.zeros(len(response), dtype=np.int64) if runs is None else runs
        lags = {"groups": groups, "maxlags": _largest_lag(groups), "df_correction": False}
        return model.fit(cov_type="hac-panel", cov_kwds=lags, use_t=True)


def fit(
    variables: Array,
    response: Array,
    *,
    scaling: Scaling,
    terms: Sequence[Term],
    name: str,
    runs: Indices | None = None,
    intercept: bool = True,
    ridge: float = 0.0,
) -> FittedModel:
    """Least squares (QR) of a `response`, shape (n_samples,), on the terms of some variables.

    `variables`, shape (n_samples, n_variables), are in physical units, in the order of `scaling`; rows of a run stand
    together in time order; nothing is missing. `runs`, shape (n_samples,), is the run of each row, 0-based and
    non-decreasing: residuals of different runs are independent. `ridge` is the penalty λ: minimised is
    ‖y − Xb‖²/n + λ‖b‖² over the scaled coefficients, intercept free.

    Raises OptionError: fewer samples than coefficients.
    """
    terms = tuple(terms)
    n, k = len(response), len(terms) + int(intercept)
    if n <= k:
        raise OptionError(
            f"{n} complete samples for {k} coefficients of {name}",
            expected=f"more than {k} samples at which nothing is missing",
            where="fit",
            advice="record longer, use a lower --degree, or fewer sensors (--max-sensors)",
        )
    columns = design_matrix(scaling.scaled(variables), scaling.variables, terms)
    exogenous = np.column_stack([np.ones(n), columns]) if intercept else columns
    groups = np.zeros(n, dtype=np.int64) if runs is None else runs
    penalty = np.sqrt(ridge * n) * np.eye(k)
    if intercept:
        penalty[0, 0] = 0.0
    beta, bread = _solution(np.vstack([exogenous, penalty]), np.r_[response, np.zeros(k)])
    residuals = response - exogenous @ beta
    rss = float(residuals @ residuals)
    residual_sd = float(np.sqrt(rss / (n - k)))
    # the bread of the sandwich carries the ridge penalty
    meat = long_run_covariance(exogenous * residuals[:, None], groups, 1 + _largest_lag(groups))
    covariance = bread @ meat @ bread * n / (n - k)
    covariance = (covariance + covariance.T) / 2.0
    classical = residual_sd**2 * (bread - bread @ penalty**2 @ bread)
    with warnings.catch_warnings():
        # an exact fit divides by a zero residual variance; the numbers say so themselves
        warnings.simplefilter("ignore", RuntimeWarning)
        diagnostics = _diagnostics(exogenous, columns, residuals, groups, intercept)
    reference = response - response.mean() if intercept else response
    total = float(reference @ reference)
    r2 = 1.0 - rss / total if total > 0 else float("nan")
    if not intercept:
        beta = np.r_[0.0, beta]
        covariance, classical = (np.pad(one, ((1, 0), (1, 0))) for one in (covariance, classical))
    return FittedModel(
        response=name,
        scaling=scaling,
        terms=terms,
        has_intercept=intercept,
        coefficients=beta,
        covariance=covariance,
        classical_covariance=classical,
        vif=variance_inflation(columns, intercept=intercept),
        valid_range=tuple(zip(variables.min(axis=0).tolist(), variables.max(axis=0).tolist(), strict=True)),
        n_samples=n,
        r2=r2,
        adjusted_r2=adjusted_r2(r2, n, len(terms), intercept=intercept),
        rmse_um=float(np.sqrt(rss / n)),
        residual_sd_um=residual_sd,
        diagnostics=diagnostics,
        ridge=ridge,
    )


def variance_inflation(columns: Array, *, intercept: bool = True) -> Array:
    """1/(1 − R²_j) of each column on the others, shape (n_terms,); inf for a column that the others make up."""
    if columns.shape[1] == 0:
        return np.zeros(0)
    centred = columns - columns.mean(axis=0) if intercept else columns
    norm = np.linalg.norm(centred, axis=0)
    # what centring leaves of a constant column is rounding
    constant = norm <= 1e-14 * np.linalg.norm(columns, axis=0)
    _, singular, rotation = np.linalg.svd(centred[:, ~constant] / norm[~constant], full_matrices=False)
    independent = singular > _RANK * singular.max(initial=0.0)
    inflation = (rotation[independent].T ** 2 / singular[independent] ** 2).sum(axis=1)
    made_up = 1.0 - (rotation[independent] ** 2).sum(axis=0) > 1e-8
    result = np.full(columns.shape[1], np.inf)
    result[~constant] = np.where(made_up, np.inf, np.maximum(inflation, 1.0))
    return result


def long_run_covariance(scores: Array, runs: Indices, width: int) -> Array:
    """Newey–West sum of the lagged products of scores within each run, shape (k, k): the filling of the sandwich.

    `scores` have shape (n_samples, k), `runs` is the run of each row, non-decreasing; `width` is that of the Bartlett
    triangle, the largest lag + 1 [samples].
    """
    meat = np.zeros((scores.shape[1], scores.shape[1]))
    for rows in _run_slices(runs):
        # the triangle is a box run over a box: two running sums in place of a sum over all lags
        sums = np.cumsum(np.pad(scores[rows], ((width, width), (0, 0))), axis=0)
        box = sums[width:] - sums[:-width]
        meat += box.T @ box / width
    return meat


def _solution(stacked: Array, right: Array) -> tuple[Array, Array]:
    """Least-squares solution and (X'X)⁻¹ by orthogonal factors; minimum norm where columns depend on each other.

    The normal equations are never formed: they have the square of the condition number.
    """
    norm = np.linalg.norm(stacked, axis=0)
    # a power of two divides without rounding
    norm = np.exp2(np.round(np.log2(np.where(norm > 0, norm, 1.0))))
    basis, triangle = np.linalg.qr(stacked / norm)
    left, singular, rotation = np.linalg.svd(triangle)
    keep = singular > _RANK * singular[0] if len(singular) else np.zeros(0, dtype=np.bool_)
    if keep.all():
        root = solve_triangular(triangle, np.eye(len(triangle)))
        beta = solve_triangular(triangle, basis.T @ right)
    else:
        root = rotation[keep].T / singular[keep]
        beta = root @ (left[:, keep].T @ (basis.T @ right))
    root = root / norm[:, None]
    return beta / norm, root @ root.T


def _largest_lag(groups: Indices) -> int:
    lengths = [rows.stop - rows.start for rows in _run_slices(groups)]
    # 4(n/100)^(2/9) is the textbook bandwidth; thermal residuals stay correlated for much longer
    return max(min(int(np.sqrt(len(groups) / len(lengths))), min(lengths) - 1), 0)


def _diagnostics(exogenous: Array, columns: Array, residuals: Array, groups: Indices, intercept: bool) -> Diagnostics:
    n, k = exogenous.shape
    rss = float(residuals @ residuals)
    parts = _run_slices(groups)
    steps = sum(float((np.diff(residuals[rows]) ** 2).sum()) for rows in parts)
    box = [
        _ljung_box_p(residuals[rows], min(10, (rows.stop - rows.start) // 3))
        for rows in parts
        if rows.stop - rows.start >= 12 and np.ptp(residuals[rows]) > 0
    ]
    basis = np.linalg.qr(exogenous)[0]
    leverage = np.minimum((basis**2).sum(axis=1), 1.0 - 1e-12)
    variance = rss / max(n - k, 1)
    cooks = residuals**2 * leverage / (k * max(variance, 1e-300) * (1.0 - leverage) ** 2)
    centred = columns - columns.mean(axis=0) if intercept else columns
    unit = centred / np.maximum(np.linalg.norm(centred, axis=0), 1e-300)
    return Diagnostics(
        durbin_watson=steps / rss if rss > 0 else 2.0,
        ljung_box_p=min(box) if box else float("nan"),
        condition_number=float(np.linalg.cond(unit)) if columns.shape[1] else 1.0,
        max_cooks_distance=float(cooks.max()) if rss > 0 else 0.0,
        most_influential=int(cooks.argmax()),
    )


def _ljung_box_p(residuals: Array, lags: int) -> float:
    # as statsmodels has it, which takes 0.6 s to load (decision 11)
    n, left = len(residuals), residuals - residuals.mean()
    correlation = np.array([left[lag:] @ left[: n - lag] for lag in range(1, lags + 1)]) / (left @ left)
    return float(chdtrc(lags, n * (n + 2) * np.sum(correlation**2 / np.arange(n - 1, n - lags - 1, -1))))


def _run_slices(groups: Indices) -> list[slice]:
    starts = np.flatnonzero(np.r_[True, groups[1:] != groups[:-1]])
    stops = np.r_[starts[1:], len(groups)]
    return [slice(int(a), int(b)) for a, b in zip(starts, stops, strict=True)]


MAX_POINTS = 400
MAX_SAMPLES = 4000


@dataclass(frozen=True)
class ValidityHull:
    """The convex hull of recorded inputs, held as points in units of `scale`."""

    points: Array  #: (n_points, n_variables)
    scale: Array  #: (n_variables,): Standard deviation of each input
    #: low and high: (n_variables,): The box around the hull, in the unit of the inputs
    low: Array
    high: Array

    def distance(self, inputs: Array) -> Array:
        """Euclidean distance of each input to the hull, in standard deviations; 0 inside. Shape (n_samples,).

        The nearest point of the hull is a convex combination of its points, found by non-negative least squares with
        the weights' sum as a heavy row.
        """
        from scipy.optimize import nnls

        scaled = np.atleast_2d(inputs) / self.scale
        heavy = 1e4 * max(1.0, float(np.abs(self.points).max(initial=1.0)))
        system = np.vstack([self.points.T, np.full(len(self.points), heavy)])
        found = np.empty(len(scaled))
        for i, point in enumerate(scaled):
            weights, _ = nnls(system, np.r_[point, heavy], maxiter=50 * system.shape[1])
            found[i] = float(np.linalg.norm(self.points.T @ weights - point))
        # the heavy row is met to rounding only, and so is zero
        return np.where(found < 1e-6, 0.0, found)


def validity_hull(inputs: Array) -> ValidityHull:
    """The hull of samples of shape (n_samples, n_variables), thinned to its outermost points.

    Extreme samples in many directions span the hull; what they leave out are slivers.
    """
    scale = _deviation(inputs)
    return ValidityHull(inputs[outermost_samples(inputs)] / scale, scale, inputs.min(axis=0), inputs.max(axis=0))


def _deviation(inputs: Array) -> Array:
    scale = inputs.std(axis=0)
    return np.where(scale > 0, scale, 1.0)


def outermost_samples(inputs: Array) -> Indices:
    """Positions of the samples that span `validity_hull`, ascending."""
    scale = _deviation(inputs)
    # a warming machine moves little between neighbours: thinned samples and the extremes of each input stay
    edges = np.concatenate([inputs.argmin(axis=0), inputs.argmax(axis=0)])
    kept = np.unique(np.concatenate([np.arange(0, len(inputs), -(-len(inputs) // MAX_SAMPLES)), edges]))
    scaled = inputs[kept] / scale
    directions = np.random.default_rng(0).normal(size=(2 * MAX_POINTS, inputs.shape[1]))
    directions = np.vstack([np.eye(inputs.shape[1]), -np.eye(inputs.shape[1]), directions @ _whitening(scaled)])
    return np.asarray(kept[np.unique((scaled @ directions.T).argmax(axis=0))])


def _whitening(scaled: Array) -> Array:
    """Turns random directions into those that see every width of a cloud alike, shape (n_variables, n_variables).

    Temperatures of one machine rise together: their cloud is a needle, and in a random direction it is always one of
    its two ends that is the outermost.
    """
    _, spread, axes = np.linalg.svd(scaled - scaled.mean(axis=0), full_matrices=False)
    floor = max(1e-6 * float(spread.max(initial=0.0)), 1e-300)
    whitening = np.zeros((scaled.shape[1], scaled.shape[1]))
    whitening[: len(spread)] = axes / np.maximum(spread, floor)[:, None]
    return whitening


@dataclass(frozen=True)
class FaultGain:
    """Effect of a fault of one sensor on one response."""

    sensor: str
    response: str
    #: Largest |change| of the prediction for a reading 1 K too high, over the recorded samples, steady state [µm]
    per_kelvin_um: float
    stuck_um: float  #: Largest |change| if the sensor had frozen at its start-of-run reading [µm]
    #: Largest |change| if a break drives the reading to the edge of its valid range, where a guard holds it [µm]
    open_um: float

    @property
    def worst_um(self) -> float:
        """The worst of a stuck and an open sensor [µm]."""
        return max(self.stuck_um, self.open_um)


def fault_gains(
    model: FittedModel, variables: Array, sensors: Sequence[str], lag_source: dict[str, str], *, rise: bool
) -> tuple[FaultGain, ...]:
    """The gain of a fault of each sensor, over recorded samples of shape (n_samples, n_variables).

    `lag_source` is the channel behind each lag variable: a fault that lasts reaches the lag too. The start-of-run
    reading is zero of a `rise`, else the mean: absolute readings have no natural start.
    """
    healthy = model.predicted(variables)
    names = model.scaling.variables

    def change(columns: Sequence[int], reading: float | Array) -> float:
        faulty = variables.copy()
        faulty[:, columns] = reading
        return float(np.abs(model.predicted(faulty) - healthy).max())

    gains = []
    for sensor in sensors:
        own = [j for j, name in enumerate(names) if lag_source.get(name, name) == sensor]
        low = min(model.valid_range[j][0] for j in own)
        high = max(model.valid_range[j][1] for j in own)
        rest = 0.0 if rise else float(np.mean(variables[:, own[0]]))
        shifted, stuck = change(own, variables[:, own] + 1.0), change(own, rest)
        gains.append(FaultGain(sensor, model.response, shifted, stuck, max(change(own, low), change(own, high))))
    return tuple(gains)
