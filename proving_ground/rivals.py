"""What would others say: known methods of choosing terms, on the same exam and with the same candidates."""

from __future__ import annotations

import importlib.util
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import f as f_distribution

from proving_ground.runner import Answerer
from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.catalogue import catalogue
from selector.diagnosis.shapes.signals import course, rate
from selector.errors import OptionError
from selector.types import Mask, Matrix, Vector

MOST_ROWS = 4000
_SMALL = 1e-8


@dataclass(frozen=True, eq=False)
class Candidates:
    """One response: its recalibrated residual and one shape of every effect that can be tested there."""

    response: str
    #: (n_fitted,): On fitted rows (at most `MOST_ROWS`, evenly taken), offset, gain and delay projected off, of unit
    #: size (RMS)
    residual: Vector
    columns: Matrix  #: (n_fitted, n_columns): The same was projected off, and each has unit size
    owners: tuple[str, ...]  #: Id of the effect that every column belongs to
    #: nuisances, unscaled, recorded and simulated: Columns of recalibration and of effects, recorded and simulated
    #: course, over all rows, for the last fit
    nuisances: Matrix
    unscaled: Matrix
    recorded: Vector
    simulated: Vector
    #: fitted and held_out: (n_rows,): Rows where both are there, of either part
    fitted: Mask
    held_out: Mask

    def of(self, owners: Sequence[str]) -> list[int]:
        """Columns of these effects."""
        return [k for k, owner in enumerate(self.owners) if owner in set(owners)]

    def left(self, owners: Sequence[str]) -> Vector:
        """What is left of the difference, over all rows, once these effects are fitted beside offset, gain, delay."""
        design = np.column_stack([self.nuisances, self.unscaled[:, self.of(owners)]])
        sizes = np.sqrt(np.mean(design[self.fitted] ** 2, axis=0))
        design = design / np.where(sizes > 0, sizes, 1.0)
        difference = self.recorded - self.simulated
        found, *_ = np.linalg.lstsq(design[self.fitted], difference[self.fitted], rcond=_SMALL)
        return np.asarray(difference - design @ found)


def candidates(comparison: Comparison, response: str) -> Candidates:
    """Of every effect the shape that explains most of the residual, so that all rivals choose from the same columns."""
    recorded, simulated = comparison.recorded[response], comparison.simulated[response]
    seen = np.isfinite(recorded) & np.isfinite(simulated)
    smooth = comparison.filled(simulated)
    nuisances = np.column_stack([np.ones(len(smooth)), smooth, rate(comparison, smooth)])
    fitted = seen & ~comparison.held_out
    rows = np.flatnonzero(fitted)
    rows = rows[:: max(1, -(-len(rows) // MOST_ROWS))]
    free = _orthonormal(nuisances[rows])
    residual = (recorded - simulated)[rows]
    residual = residual - free @ (free.T @ residual)
    size = float(np.sqrt(np.mean(residual**2))) if len(residual) else 0.0
    residual = residual / (size if size > 0 else 1.0)
    shapes: list[Matrix] = []
    owners: list[str] = []
    for effect in catalogue():
        if effect.testable(comparison, response) is not None:
            continue
        best: tuple[float, Matrix] | None = None
        for variant in effect.variants(comparison, response):
            basis = _orthonormal(_without(free, variant.columns[rows]))
            explained = float(np.sum((basis.T @ residual) ** 2))
            if basis.shape[1] and (best is None or explained > best[0]):
                best = (explained, variant.columns)
        if best is not None:
            shapes.append(best[1])
            owners += [effect.id] * best[1].shape[1]
    unscaled = np.column_stack(shapes) if shapes else np.empty((len(smooth), 0))
    columns = _without(free, unscaled[rows])
    sizes = np.sqrt(np.mean(columns**2, axis=0))
    kept = sizes > _SMALL * np.sqrt(np.mean(unscaled[rows] ** 2, axis=0))
    return Candidates(
        response=response,
        residual=residual,
        columns=columns[:, kept] / sizes[kept],
        owners=tuple(owner for owner, keep in zip(owners, kept, strict=True) if keep),
        nuisances=nuisances,
        unscaled=unscaled[:, kept],
        recorded=recorded,
        simulated=simulated,
        fitted=fitted,
        held_out=seen & comparison.held_out,
    )


def _without(free: Matrix, columns: Matrix) -> Matrix:
    return np.asarray(columns - free @ (free.T @ columns))


def _orthonormal(columns: Matrix) -> Matrix:
    """An orthonormal basis of the columns; those that are sums of others, to rounding, are left out."""
    sizes = np.linalg.norm(columns, axis=0)
    columns = columns[:, sizes > 0] / sizes[sizes > 0]
    if columns.shape[1] == 0:
        return columns
    basis, values, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(basis[:, values > _SMALL * values[0]])


MOST_POINTS = 250
_CLEAR_NATS = 4.0
"""Gain of log likelihood over noise alone that is called structure: two parameters and more by Akaike."""


def discrepancy(comparison: Comparison, offered: Candidates, seed: int) -> tuple[Vector, bool]:
    """The discrepancy term of Kennedy and O'Hagan (J. R. Statist. Soc. B 63, 2001, 425), after recalibration.

    What the process leaves of the difference over all rows [unit], and whether it saw more than noise. Its inputs are
    the recorded channels that are no response and the simulated response; it is fitted to at most `MOST_POINTS`
    evenly taken rows.
    """
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    left = offered.left(())
    names = [channel.name for channel in comparison.channels if channel.name not in comparison.responses]
    inputs = np.column_stack([*(course(comparison, name) for name in names), offered.nuisances[:, 1]])
    spread = inputs[offered.fitted].std(axis=0)
    inputs = (inputs - inputs[offered.fitted].mean(axis=0)) / np.where(spread > 0, spread, 1.0)
    rows = np.flatnonzero(offered.fitted)
    rows = rows[np.linspace(0, len(rows) - 1, min(MOST_POINTS, len(rows))).astype(int)]
    size = float(left[rows].std())
    if size == 0.0:
        return left, False
    target = left[rows] / size
    kernel = ConstantKernel(0.3, (1e-4, 1e2)) * RBF(2.0, (0.1, 1e2)) + WhiteKernel(0.7, (1e-4, 1e1))
    with warnings.catch_warnings():
        # bounds that are reached are an answer: no structure, or no noise
        warnings.simplefilter("ignore", ConvergenceWarning)
        process = GaussianProcessRegressor(kernel, random_state=seed).fit(inputs[rows], target)
    likelihood = float(process.log_marginal_likelihood_value_)
    noise_alone = -0.5 * len(rows) * (np.log(2 * np.pi * np.mean(target**2)) + 1.0)
    kept = np.flatnonzero(offered.held_out)
    result = left.copy()
    result[kept] -= size * process.predict(inputs[kept]) if len(kept) else 0.0
    return result, bool(likelihood - noise_alone > _CLEAR_NATS)


_FALSE_ALARM = 0.01
_BLOCKS = 4
_THRESHOLDS = np.geomspace(0.02, 0.6, 8)
_MOST_TERMS = 12


@dataclass(frozen=True)
class Rival:
    """Another method: its name, what it is, the package that it needs, and which columns it chooses."""

    name: str
    title: str
    package: str
    choose: Callable[[Candidates, int], Sequence[int]] | None

    @property
    def is_here(self) -> bool:
        """Whether its package is installed."""
        return importlib.util.find_spec(self.package) is not None

    def answer(self, comparison: Comparison, seed: int) -> Mapping[str, Any]:
        """What it says, in the JSON form of the contract as far as it is scored; without a confidence."""
        effects: list[dict[str, Any]] = []
        fits: dict[str, Any] = {}
        structured = False
        for response in comparison.responses:
            offered = candidates(comparison, response)
            if self.choose is None:
                left, more_than_noise = discrepancy(comparison, offered, seed)
                structured = structured or more_than_noise
                fits[response] = _fit(offered, left)
                continue
            chosen = self.choose(offered, seed) if offered.owners else ()
            named = list(dict.fromkeys(offered.owners[k] for k in chosen))
            effects += [{"id": one, "channel": response} for one in named if one not in {e["id"] for e in effects}]
            fits[response] = _fit(offered, offered.left(named))
        verdict = "unexplained" if structured else "nothing-missing"
        if effects:
            is_data = all(one["id"].startswith("data.") for one in effects)
            verdict = "data-fault" if is_data else "missing-physics"
        return {"verdict": verdict, "effects": effects, "where": [], "fit": fits}


def rivals(names: Sequence[str]) -> tuple[Answerer, ...]:
    """Those of these names (``all``: those that are installed) that can sit the exam.

    Raises OptionError if there is none of that name, or its package is not installed.
    """
    known = {rival.name: rival for rival in RIVALS}
    asked = [*known] if "all" in names else list(dict.fromkeys(names))
    for name in asked:
        if name not in known:
            raise OptionError(
                f"rival {name!r}", expected="all, or " + ", ".join(known), where="--rivals", advice="correct the option"
            )
        if "all" not in names and not known[name].is_here:
            raise OptionError(
                f"rival {name!r} needs the package {known[name].package}, which is not installed",
                expected="an installation with the extra `benchmarks`",
                where="--rivals",
                advice=f"install {known[name].package}, or leave this rival out",
            )
    return tuple(Answerer(name, known[name].answer) for name in asked if known[name].is_here)


def _fit(offered: Candidates, left: Vector) -> dict[str, Any]:
    def error(values: Vector) -> float:
        return float(np.sqrt(np.mean(values[offered.held_out] ** 2))) if offered.held_out.any() else 0.0

    return {"heldout": {"rmse_before": error(offered.recorded - offered.simulated), "rmse_after": error(left)}}


def _thresholded(offered: Candidates, seed: int) -> list[int]:
    """Sequentially thresholded least squares; the threshold with the least error on blocks left out, or nothing."""
    from pysindy.optimizers import STLSQ

    def coefficients(columns: Matrix, residual: Vector, threshold: float) -> Vector:
        with warnings.catch_warnings():
            # it warns where nothing is left, which is an answer here
            warnings.simplefilter("ignore")
            return np.ravel(STLSQ(threshold=threshold, alpha=1e-3).fit(columns, residual[:, None]).coef_)

    columns, residual = offered.columns, offered.residual
    blocks = np.array_split(np.arange(len(residual)), _BLOCKS)
    losses = []
    for threshold in _THRESHOLDS:
        loss = 0.0
        for block in blocks:
            kept = np.setdiff1d(np.arange(len(residual)), block)
            found = coefficients(columns[kept], residual[kept], threshold)
            loss += float(np.sum((residual[block] - columns[block] @ found) ** 2))
        losses.append(loss)
    if min(losses) >= float(residual @ residual):
        return []
    return np.flatnonzero(coefficients(columns, residual, _THRESHOLDS[int(np.argmin(losses))])).tolist()


def _frols(offered: Candidates, seed: int) -> list[int]:
    """Forward regression with orthogonal least squares by error reduction ratio, number of terms by BIC."""
    from sysidentpy.model_structure_selection import FROLS
    from sysidentpy.parameter_estimation import LeastSquares

    most = min(_MOST_TERMS, offered.columns.shape[1])
    method = FROLS(n_info_values=most, info_criteria="bic", estimator=LeastSquares())
    # the terms are given, and look back no further
    method.max_lag = 0
    residual = offered.residual[:, None]
    criterion = method.information_criterion(offered.columns, residual)
    # without any term: n·ln(1), the residual has unit size
    if not float(criterion.min()) < 0.0:
        return []
    _, order, _ = method.error_reduction_ratio(offered.columns, residual, int(np.argmin(criterion)) + 1)
    return [int(k) for k in order]


def _lasso(offered: Candidates, seed: int) -> list[int]:
    """Lasso, its penalty by cross-validation over blocks."""
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.linear_model import LassoCV
    from sklearn.model_selection import KFold

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        found = LassoCV(cv=KFold(_BLOCKS), max_iter=3000).fit(offered.columns, offered.residual)
    return np.flatnonzero(found.coef_).tolist()


def _largest_aic_drop(offered: Candidates, seed: int) -> list[int]:
    """The one effect that lowers Akaike's criterion most, if any does."""
    n = len(offered.residual)
    drops = {}
    for owner in dict.fromkeys(offered.owners):
        columns = offered.of([owner])
        drops[owner] = -n * np.log(max(_left_share(offered, columns), 1e-300)) - 2.0 * len(columns)
    best = max(drops, key=lambda owner: drops[owner])
    return offered.of([best]) if drops[best] > 0.0 else []


def _f_test(offered: Candidates, seed: int) -> list[int]:
    """Effects one after the other as long as the F-test of the best is significant, Bonferroni over all of them."""
    n = len(offered.residual)
    owners = list(dict.fromkeys(offered.owners))
    chosen: list[str] = []
    while len(chosen) < min(_MOST_TERMS, len(owners)):
        before = _left_share(offered, offered.of(chosen))
        p_values = {}
        for owner in owners:
            if owner in chosen:
                continue
            columns = offered.of([*chosen, owner])
            new, rest = len(offered.of([owner])), n - len(columns) - offered.nuisances.shape[1]
            after = _left_share(offered, columns)
            p_values[owner] = float(f_distribution.sf((before - after) / new / (after / rest), new, rest))
        best = min(p_values, key=lambda owner: p_values[owner])
        if p_values[best] * len(owners) >= _FALSE_ALARM:
            break
        chosen.append(best)
    return offered.of(chosen)


def _left_share(offered: Candidates, columns: Sequence[int]) -> float:
    """Share of the residual's squares that these columns leave."""
    if not len(columns):
        return 1.0
    design = offered.columns[:, columns]
    found, *_ = np.linalg.lstsq(design, offered.residual, rcond=1e-8)
    return float(np.mean((offered.residual - design @ found) ** 2))


RIVALS: tuple[Rival, ...] = (
    Rival("stlsq", "sequential thresholding (PySINDy)", "pysindy", _thresholded),
    Rival("frols", "FROLS with BIC (SysIdentPy)", "sysidentpy", _frols),
    Rival("lasso", "lasso by cross-validation", "sklearn", _lasso),
    Rival("aic", "largest drop of AIC", "numpy", _largest_aic_drop),
    Rival("f-test", "F-test with Bonferroni, forward", "scipy", _f_test),
    Rival("gp", "Gaussian-process discrepancy (names nothing)", "sklearn", None),
)
