"""The error of a fit on parts that were left out, without fitting anew: by the fit's linearisation."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from selector.physics.thermal.mode_data import ModeData
from selector.physics.thermal.mode_fit import STEP, Fit, columns
from selector.physics.thermal.mode_search import expectations

Vector = NDArray[np.float64]
Rows = NDArray[np.bool_]
FIRMEST = 1e-4
"""What is left of a direction in which only the part left out had a say; smaller is as good as unknown."""


def jacobian(fit: Fit, data: ModeData, *, own_zeros: bool) -> Vector:
    """Derivative of the weighted prediction, rows block by block within response by response.

    Columns: searched parameters, then coefficients, then zeros and starts of the runs. With `own_zeros` these last are
    eliminated instead, so that a run left out as a whole may still choose its zero.
    """
    spec, theta, weights = fit.spec, fit.theta, fit.weights
    states, left = columns(spec, data, theta)
    design = states.reshape(len(states), -1)
    solution = fit.solution.coefficients
    searched = []
    for i in range(len(theta)):
        moved = theta.copy()
        moved[i] += STEP
        change = columns(spec, data, moved)[0].reshape(len(states), -1) - design
        searched.append((change @ solution) / STEP)
    nuisances = _nuisances(fit, data, left)
    pieces = []
    for r in range(weights.shape[1]):
        block = np.column_stack([np.column_stack([one[:, r] for one in searched]), design]) * weights[:, r : r + 1]
        zeros = nuisances * weights[:, r : r + 1]
        if own_zeros:
            basis = np.linalg.qr(zeros)[0]
            block = block - basis @ (basis.T @ block)
            zeros = zeros[:, :0]
        own = np.column_stack([block[:, len(theta) :], zeros])
        full = np.zeros((len(states), len(theta) + weights.shape[1] * own.shape[1]))
        full[:, : len(theta)] = block[:, : len(theta)]
        begin = len(theta) + r * own.shape[1]
        full[:, begin : begin + own.shape[1]] = own
        pieces.append(full)
    return np.vstack(pieces)


def _nuisances(fit: Fit, data: ModeData, left: Vector) -> Vector:
    parts = []
    for run, (begin, end) in enumerate(data.bounds):
        here = np.zeros((len(left), 1))
        here[begin:end] = 1.0
        parts.append(here)
        if run in fit.spec.free_starts:
            parts.append(here * left)
    return np.column_stack(parts)


def expected_rows(fit: Fit, width: int) -> Vector:
    """Derivative of what is known without the tests, shape (n_rows, width), for a `jacobian` of that many columns."""
    moves = []
    for i in range(len(fit.theta)):
        moved = fit.theta.copy()
        moved[i] += STEP
        moves.append((expectations(fit.spec, moved) - expectations(fit.spec, fit.theta)) / STEP)
    usual = np.zeros((len(moves[0]), width))
    usual[:, : len(moves)] = np.column_stack(moves)
    n_columns, n_responses = fit.solution.coefficients.shape
    own = (width - len(moves)) // n_responses
    shrunk = np.zeros((n_responses * n_columns, width))
    for r in range(n_responses):
        rows = np.arange(n_columns)
        shrunk[r * n_columns + rows, len(moves) + r * own + rows] = fit.solution.shrinkage[r]
    return np.vstack([usual, shrunk])


def held_out_um(fit: Fit, data: ModeData, folds: Sequence[Rows], *, own_zeros: bool) -> Vector:
    """Root mean square error [µm] of every fold and response, shape (n_folds, n_responses).

    For a linear fit with orthonormal columns Q, the error on the rows f when they are left out is
    r_f + Q_f (I − Q_fᵀ Q_f)⁻¹ Q_fᵀ r_f, exactly; a fit of modes is nearly linear around its optimum.
    """
    derivative = jacobian(fit, data, own_zeros=own_zeros)
    rows = np.vstack([derivative, expected_rows(fit, derivative.shape[1])])
    size = np.sqrt((rows**2).sum(axis=0))
    size[size == 0.0] = 1.0
    q = np.linalg.qr(np.vstack([rows / size, 1e-7 * np.eye(rows.shape[1])]))[0]
    n_blocks, n_responses = fit.weights.shape
    residual = fit.solution.residual.T.ravel()
    out = np.full((len(folds), n_responses), np.nan)
    for number, fold in enumerate(folds):
        part = np.tile(fold, n_responses) & (fit.weights.T.ravel() > 0)
        mine = q[: len(residual)][part]
        value, vector = np.linalg.eigh(np.eye(q.shape[1]) - mine.T @ mine)
        push = vector @ ((vector.T @ (mine.T @ residual[part])) / np.maximum(value, FIRMEST))
        error = np.zeros(len(residual))
        error[part] = residual[part] + mine @ push
        for r in range(n_responses):
            w = fit.weights[:, r]
            keep = fold & (w > 0)
            if keep.any():
                e = error[r * n_blocks : (r + 1) * n_blocks][keep] / w[keep]
                samples = data.counts[keep, r]
                out[number, r] = np.sqrt((samples * e**2).sum() / samples.sum())
    return out


def time_folds(data: ModeData, n_folds: int = 5, n_pieces: int = 4) -> list[Rows]:
    """Every run is cut into n_folds·n_pieces stretches of equally many blocks; fold f has each n_folds-th of them."""
    folds = [np.zeros(len(data.before_s), dtype=np.bool_) for _ in range(n_folds)]
    for begin, end in data.bounds:
        piece = (np.arange(end - begin) * n_folds * n_pieces) // (end - begin)
        for f in range(n_folds):
            folds[f][begin:end] = piece % n_folds == f
    return folds


def run_folds(data: ModeData, runs: Sequence[Sequence[int]]) -> list[Rows]:
    """One fold for every group of runs."""
    folds = []
    for group in runs:
        fold = np.zeros(len(data.before_s), dtype=np.bool_)
        for run in group:
            begin, end = data.bounds[run]
            fold[begin:end] = True
        folds.append(fold)
    return folds
