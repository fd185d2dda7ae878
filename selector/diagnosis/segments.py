"""When does something act: a course freed of noise, and the windows in which it is large."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from selector.diagnosis.background import Background, Spectrum, background, innovations, seen_rows, spectrum
from selector.diagnosis.comparison import Comparison
from selector.diagnosis.signals import filled

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
Mask = NDArray[np.bool_]
_POINTS = 400
_ROUNDS = 2
_MOST_STEPS = 24
_NEAR = 0.045
"""Cycles per sample: noise here stands for that of all longer scales."""
_ACTS = 0.25
"""Something acts where it is at least this part of its largest amount."""
_GAP = 0.025
"""Gaps shorter than this part of the run are no gaps."""
_ALWAYS = 0.85
"""Something that acts in more than this part of a run acts in all of it."""


@dataclass(frozen=True, eq=False)
class _Piece:
    """Block means of one run and the rows of each, what recalibration may change (orthonormal), and their noise."""

    rows: list[NDArray[np.intp]]
    values: Vector
    free: Matrix
    variance: float


def without_noise(comparison: Comparison, response: str, residual: Vector) -> Vector:
    """What a residual would be without its noise, where it is made of steps that build up slowly; shape (n_rows,).

    Each run is an offset, some part of what is simulated (a recalibration took it for the effect) and steps at unknown
    times, seen through one first-order lag; steps are added while they explain more than the best of as many would of
    noise, then those are taken out that are not needed. Only the steps are in the result: all 0 where none is.
    """
    rows = seen_rows(comparison, residual)
    if sum(len(here) for here in rows) == 0:
        return np.zeros(len(residual))
    simulated = filled(comparison, comparison.simulated[response])
    course = np.zeros(len(residual))
    for _ in range(_ROUNDS):
        # What has been found is taken off before the noise is judged: strong steps reach its scale too.
        left = np.where(np.isfinite(residual), residual - course, 0.0)
        noise = background(spectrum(left[None, :], rows))
        pieces = [_piece(residual, simulated, here, noise) for here in rows if len(here)]
        course, misfit = _likeliest(pieces, len(residual))
        as_it_is, plain = _likeliest([replace(piece, free=piece.free[:, :1]) for piece in pieces], len(residual))
        course = as_it_is if plain <= misfit else course
    return course


def _likeliest(pieces: list[_Piece], n_rows: int) -> tuple[Vector, float]:
    """The course with the lag that explains all runs best, and its misfit."""
    best, lowest = np.zeros(n_rows), np.inf
    for lag in (0.0, *np.geomspace(2.0, _POINTS / 4.0, 8)):
        course, score = np.zeros(n_rows), 0.0
        for piece in pieces:
            fitted, misfit = _stepwise(piece, lag)
            score += misfit
            for part, value in zip(piece.rows, fitted, strict=True):
                course[part] = value
        if score < lowest:
            best, lowest = course, score
    return best, lowest


def _piece(residual: Vector, simulated: Vector, rows: NDArray[np.intp], noise: Background) -> _Piece:
    size = max(1, -(-len(rows) // _POINTS))
    parts = np.array_split(rows, len(rows) // size)
    # Steps are asked for where something is known to act: the noise just beyond its scale is what they must exceed.
    variance = 1.5 * float(noise.density(np.array([_NEAR]))[0, 0]) / size
    values = np.array([residual[part].mean() for part in parts])
    table = np.column_stack([np.ones(len(parts)), [simulated[part].mean() for part in parts]])
    table[:, 1] -= table[:, 1].mean()
    size_of = np.linalg.norm(table, axis=0)
    kept = size_of > 1e-9 * np.abs(simulated).max(initial=1.0)
    return _Piece(parts, values, table[:, kept] / size_of[kept], variance)


def _stepwise(piece: _Piece, lag: float) -> tuple[Vector, float]:
    """Steps through a lag [points] that explain a run: their course, and the misfit with its penalty."""
    values, variance, free = piece.values, piece.variance, piece.free
    n, fixed = len(values), free.shape[1]
    penalty = 2.0 * np.log(8.0 * n)
    variance = max(variance, 1e-6 * float(np.var(values)), 1e-300)
    since = np.arange(n)[:, None] - np.arange(1, n - 1)[None, :]
    answers = np.where(
        since >= 0, 1.0 if lag == 0.0 else -np.expm1(-(np.maximum(since, 0) + 0.5) / max(lag, 1e-9)), 0.0
    )
    chosen = _added(values - free @ (free.T @ values), answers - free @ (free.T @ answers), penalty * variance)
    while True:
        table = np.column_stack([free, answers[:, chosen]])
        inverse = np.linalg.pinv(table.T @ table)
        weights = inverse @ (table.T @ values)
        loss = weights[fixed:] ** 2 / np.maximum(np.diag(inverse)[fixed:], 1e-300)
        if len(chosen) == 0 or loss.min() >= penalty * variance:
            break
        chosen = np.delete(chosen, int(np.argmin(loss)))
    misfit = float(np.sum((values - table @ weights) ** 2)) / variance + penalty * (len(chosen) + fixed)
    return np.asarray(table[:, fixed:] @ weights[fixed:]), misfit


def _added(values: Vector, answers: Matrix, least: float) -> NDArray[np.intp]:
    """Columns, one after the other that explains most, while one explains at least this much."""
    left, free = values, answers / np.maximum(np.linalg.norm(answers, axis=0), 1e-9)
    chosen: list[int] = []
    for _ in range(_MOST_STEPS):
        along = left @ free
        k = int(np.argmax(along**2))
        if along[k] ** 2 < least or k in chosen:
            break
        chosen.append(k)
        direction = free[:, k].copy()
        left = left - along[k] * direction
        free -= np.outer(direction, direction @ free)
        size = np.linalg.norm(free, axis=0)
        free *= np.where(size > 1e-3, 1.0 / np.maximum(size, 1e-3), 0.0)
    return np.array(sorted(chosen), dtype=np.intp)


def envelope(comparison: Comparison, residual: Vector) -> Vector:
    """By how much the spread of a residual exceeds its usual spread in windows of 1/40 of a run; shape (n_rows,)."""
    rows = seen_rows(comparison, residual)
    result = np.zeros(len(residual))
    if sum(len(here) for here in rows) == 0:
        return result
    values = np.where(np.isfinite(residual), residual, 0.0)[None, :]
    of: Spectrum = spectrum(values, rows)
    power = innovations(background(of).phi, values, rows)[0] ** 2
    smooth = np.zeros(len(residual))
    for here in rows:
        width = max(16, len(here) // 40)
        if len(here):
            smooth[here] = np.convolve(power[here], np.ones(width) / width, "same")
    seen = np.concatenate(rows)
    usual = float(np.median(smooth[seen]))
    least = usual * (1.0 + 4.0 * np.sqrt(2.0 / max(16, min(len(here) for here in rows if len(here)) // 40)))
    result[seen] = np.sqrt(np.where(smooth[seen] > least, smooth[seen] - usual, 0.0))
    return result


def active_rows(comparison: Comparison, course: Vector) -> Mask:
    """Rows in which a course without noise acts: at least a quarter of its largest amount; short gaps are filled."""
    active = np.abs(course) >= _ACTS * float(np.abs(course).max(initial=0.0))
    if not np.any(course):
        return np.zeros(len(course), dtype=np.bool_)
    for _, rows in comparison.rows_of_runs():
        part, time = active[rows], comparison.time_s[rows]
        on = np.flatnonzero(part)
        if len(on) == 0:
            continue
        longest = _GAP * float(time[-1] - time[0])
        for last, first in pairwise(on):
            if first - last > 1 and time[first] - time[last] <= longest:
                part[last:first] = True
        if part.mean() > _ALWAYS:
            part[:] = True
    return np.asarray(active)
