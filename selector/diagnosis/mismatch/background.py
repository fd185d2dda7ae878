"""What in a residual is noise, judged at short scales only; what such noise alone would look like.

The noise model of `noise` follows whatever is in the residual, slow structure too: after it nothing slow stands out.
Here noise may have any smooth spectrum at short scales, but at long ones only a memory of a few samples, seen
beside a white part; what the long scales hold beyond that is structure. Noise that itself remembers longer cannot be
told from structure by one record.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter
from scipy.signal.windows import tukey
from scipy.stats import norm, rankdata

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.shapes.signals import filled, rate

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
LONGEST_NOISE_PERIOD = 45.0
"""Samples: slower than this is judged against the noise, not part of it."""
_SHORTEST_FITTED = 6.5
"""Samples: periods from here to the longest decide how much memory the noise has."""
_FREE = (0.03, 0.045)
"""Cycles per sample: below the first the noise has the memory that was fitted, above the second any smooth spectrum."""
_MEMORY = (0.0, 0.3, 0.5, 0.6, 0.7, 0.75, 0.8, 0.83, 0.86, 0.88)
_WHITE = (0.0, 0.01, 0.03, 0.1, 0.2, 0.4, 0.8, 1.5, 3.0)
_OCTAVE_PART = 1.15
_MARGIN = 1.0
"""Logarithm of the likelihood that a shape may be short of the best."""
_ORDER = 12
_SHORTEST_RUN = 48


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Fourier bins of all runs of one response.

    Attributes
    ----------
    frequency : ndarray of shape (n_bins,)
        [cycles per sample].
    run : ndarray of int of shape (n_bins,)
        The run that a bin is of.
    amplitudes : complex ndarray of shape (n_sets, n_bins)
        Scaled so that white noise of variance 1 has the mean square 1.
    """

    frequency: Vector
    run: NDArray[np.intp]
    amplitudes: NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class Background:
    """Noise of several residuals.

    Attributes
    ----------
    levels : ndarray of shape (n_sets, n_points)
        Power at n_points frequencies, even from 0 to 1/2 cycle per sample.
    phi : ndarray of shape (n_sets, order)
        The autoregression e_t = Σ φ_i·e_(t−i) + w_t with nearly this spectrum.
    """

    levels: Matrix
    phi: Matrix

    def density(self, frequency: Vector) -> Matrix:
        """Power at these frequencies [cycles per sample], shape (n_sets, n_frequencies)."""
        at = np.clip(frequency, 0.0, 0.5) * 2.0 * (self.levels.shape[1] - 1)
        low = np.minimum(at.astype(np.intp), self.levels.shape[1] - 2)
        part = at - low
        return np.asarray(self.levels[:, low] * (1.0 - part) + self.levels[:, low + 1] * part)


def seen_rows(comparison: Comparison, residual: Vector) -> list[NDArray[np.intp]]:
    """Rows of every run in which the residual is there; runs too short for a spectrum are empty."""
    rows = [part.start + np.flatnonzero(np.isfinite(residual[part])) for _, part in comparison.rows_of_runs()]
    return _long_enough(rows)


def seen_in_both(first: Sequence[NDArray[np.intp]], second: Sequence[NDArray[np.intp]]) -> list[NDArray[np.intp]]:
    """Rows of every run in which two residuals are there."""
    return _long_enough([np.intersect1d(one, other) for one, other in zip(first, second, strict=True)])


def _long_enough(rows: list[NDArray[np.intp]]) -> list[NDArray[np.intp]]:
    return [here if len(here) >= _SHORTEST_RUN else here[:0] for here in rows]


def spectrum(residuals: Matrix, rows: Sequence[NDArray[np.intp]]) -> Spectrum:
    """Spectra of residuals of shape (n_sets, n_rows), run by run, ends tapered; frequency 0 is left out."""
    frequency, run, amplitudes = [], [], []
    for k, here in enumerate(rows):
        if len(here) == 0:
            continue
        window = tukey(len(here), 0.2)
        part = residuals[:, here]
        part = (part - part.mean(axis=1, keepdims=True)) * window
        bins = np.fft.rfft(part, axis=1)[:, 1 : (len(here) + 1) // 2] / np.sqrt(np.sum(window**2))
        frequency.append(np.arange(1, bins.shape[1] + 1) / len(here))
        run.append(np.full(bins.shape[1], k))
        amplitudes.append(bins)
    return Spectrum(np.concatenate(frequency), np.concatenate(run), np.concatenate(amplitudes, axis=1))


def background(of: Spectrum) -> Background:
    """Noise of every set of a spectrum.

    At long scales σ²·((1 − φ)²/|1 − φ·e^(−iω)|² + w), the φ and w of a grid that are likeliest (Whittle 1953) for the
    periods between 6.5 and 45 samples; at short ones the smoothed periodogram. Lines are clipped first.
    """
    order = np.argsort(of.frequency, kind="stable")
    frequency, power = of.frequency[order], np.abs(of.amplitudes[:, order]) ** 2
    smooth = _smooth(frequency, power, frequency)
    smooth = _smooth(frequency, np.minimum(power, 4.0 * smooth), frequency)
    clipped = np.minimum(power, 6.0 * smooth)
    fitted = (frequency >= 1.0 / LONGEST_NOISE_PERIOD) & (frequency <= 1.0 / _SHORTEST_FITTED)
    if fitted.sum() < 12:
        fitted = frequency >= 1.0 / LONGEST_NOISE_PERIOD
    grid = np.linspace(0.0, 0.5, 513)
    shapes = _shapes(frequency[fitted])
    level = clipped[:, fitted] @ (1.0 / shapes).T / max(int(fitted.sum()), 1)
    likely = fitted.sum() * np.log(np.maximum(level, 1e-300)) + np.log(shapes).sum(axis=1)
    # Of the shapes that are about as likely the one with most power at long scales: what it leaves over is structure.
    plateau = level * _shapes(np.zeros(1))[:, 0]
    best = np.argmax(np.where(likely <= likely.min(axis=1, keepdims=True) + _MARGIN, plateau, 0.0), axis=1)
    remembered = _shapes(grid)[best] * np.take_along_axis(level, best[:, None], axis=1)
    free = np.clip((grid - _FREE[0]) / (_FREE[1] - _FREE[0]), 0.0, 1.0)
    measured = _smooth(frequency, np.minimum(power, 4.0 * smooth), grid)
    floor = 1e-6 * np.maximum(measured.mean(axis=1, keepdims=True), 1e-300)
    logs = (1.0 - free) * np.log(np.maximum(remembered, floor)) + free * np.log(np.maximum(measured, floor))
    levels = np.exp(logs)
    waves = np.cos(2.0 * np.pi * np.outer(grid, np.arange(_ORDER + 1)))
    waves[[0, -1]] *= 0.5
    return Background(levels, _autoregression(levels @ waves / (len(grid) - 1)))


def _shapes(frequency: Vector) -> Matrix:
    """Spectra of short memory and a white part, shape (n_shapes, n_frequencies)."""
    turned = np.exp(-2j * np.pi * frequency)
    red = [(1.0 - memory) ** 2 / np.abs(1.0 - memory * turned) ** 2 for memory in _MEMORY]
    flat = np.ones((1, len(frequency)))
    return np.concatenate([flat, *(np.array(red[1:]) + white for white in _WHITE)])


def _smooth(frequency: Vector, power: Matrix, at: Vector) -> Matrix:
    """Mean power within 15 % of each frequency, of 20 bins at least; `frequency` in order."""
    n = len(frequency)
    least = min(20, n)
    low = np.searchsorted(frequency, at / _OCTAVE_PART)
    high = np.searchsorted(frequency, at * _OCTAVE_PART, side="right")
    middle = np.clip(np.searchsorted(frequency, at), least // 2, n - (least - least // 2))
    narrow = high - low < least
    low, high = np.where(narrow, middle - least // 2, low), np.where(narrow, middle - least // 2 + least, high)
    sums = np.concatenate([np.zeros((len(power), 1)), np.cumsum(power, axis=1)], axis=1)
    return np.asarray((sums[:, high] - sums[:, low]) / (high - low))


def _autoregression(lags: Matrix) -> Matrix:
    order = lags.shape[1] - 1
    at = np.abs(np.subtract.outer(np.arange(order), np.arange(order)))
    toeplitz = lags[:, at] + 1e-6 * lags[:, :1, None] * np.eye(order)
    return np.asarray(np.linalg.solve(toeplitz, lags[:, 1:, None])[:, :, 0])


def innovations(phi: Matrix, residuals: Matrix, rows: Sequence[NDArray[np.intp]]) -> Matrix:
    """What each reading brings that those before it do not say, shape as `residuals`; 0 in the first rows of a run."""
    result = np.zeros_like(residuals)
    order = phi.shape[1]
    for here in rows:
        part = residuals[:, here]
        left = part.copy()
        for lag in range(1, order + 1):
            left[:, lag:] -= phi[:, lag - 1 : lag] * part[:, :-lag]
        left[:, :order] = 0.0
        result[:, here] = left
    return result


def recalibrated_away(comparison: Comparison, response: str, rows: Sequence[NDArray[np.intp]]) -> Matrix:
    """Orthonormal columns of what a recalibration takes: an offset a run, gain and delay; shape (n_rows, p)."""
    n = len(comparison.time_s)
    seen = np.concatenate(rows)
    simulated = filled(comparison, comparison.simulated[response])
    columns = [(comparison.run_index == k).astype(np.float64) for k in range(len(comparison.runs))]
    columns += [simulated, rate(comparison, simulated)]
    table = np.zeros((n, len(columns)))
    table[seen] = np.column_stack(columns)[seen]
    size = np.linalg.norm(table, axis=0)
    left, values, _ = np.linalg.svd(table[:, size > 0] / size[size > 0], full_matrices=False)
    return np.asarray(left[:, values > 1e-6])


def noise_alone(
    comparison: Comparison, residuals: Mapping[str, Vector], n_sets: int, rng: np.random.Generator
) -> dict[str, Matrix]:
    """Residuals as noise alone would make them: innovations in another order, the same for all responses.

    Response → shape (1 + n_sets, n_rows): the first is the residual itself, all with the recalibration taken off.
    Readings are rounded as the recorded ones are (`Comparison.resolution`). Missing rows are 0. A response without
    enough readings, or without any residual, is not in the result.
    """
    order = [np.tile(np.arange(part.start, part.stop), (n_sets, 1)) for _, part in comparison.rows_of_runs()]
    mixed = np.concatenate([rng.permuted(part, axis=1) for part in order], axis=1)
    found = {}
    for response, residual in residuals.items():
        rows = seen_rows(comparison, residual)
        seen = np.concatenate(rows)
        taken = recalibrated_away(comparison, response, rows) if len(seen) else np.zeros((len(residual), 0))
        own = _without(np.where(np.isin(np.arange(len(residual)), seen), residual, 0.0)[None, :], taken, seen)
        spread = float(np.std(own[0, seen])) if len(seen) else 0.0
        if spread <= 1e-9 * float(np.nanmax(np.abs(comparison.recorded[response]), initial=0.0)) or spread == 0.0:
            continue
        model = background(spectrum(own, rows))
        bringing = innovations(model.phi, own, rows)[0]
        unseen = np.setdiff1d(np.arange(len(residual)), seen)
        bringing[unseen] = rng.choice(bringing[seen], len(unseen))
        step = comparison.resolution.get(response, 0.0)
        if step > 0.7 * spread:
            # Readings of a few steps say little of the noise before it was rounded: normal values in the same order.
            ranks = rankdata(bringing + 1e-6 * spread * rng.standard_normal(len(bringing)))
            bringing = float(np.std(bringing)) * norm.ppf((ranks - 0.5) / len(ranks))
        shaped = np.empty((n_sets, len(residual)))
        for part in (np.arange(rows.start, rows.stop) for _, rows in comparison.rows_of_runs()):
            drawn = bringing[mixed[:, part]]
            course = np.concatenate([drawn[:, -200:], drawn], axis=1)
            shaped[:, part] = lfilter([1.0], np.concatenate([[1.0], -model.phi[0]]), course, axis=1)[:, -len(part) :]
        if step > 0.0:
            shaped *= np.sqrt(max(1.0 - step**2 / 12.0 / spread**2, 0.05))
            course = filled(comparison, comparison.recorded[response] - residual)
            shaped = step * np.round((course + shaped) / step) - course
        shaped[:, unseen] = 0.0
        found[response] = np.concatenate([own, _without(shaped, taken, seen)])
    return found


def _without(values: Matrix, taken: Matrix, seen: NDArray[np.intp]) -> Matrix:
    result = np.zeros_like(values)
    result[:, seen] = values[:, seen] - (values[:, seen] @ taken[seen]) @ taken[seen].T
    return result
