"""Where the mismatch is: channel, run, window of time, state of the machine, frequency."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from selector.diagnosis.answer import Place
from selector.diagnosis.comparison import Comparison
from selector.diagnosis.mismatch.background import background, innovations, noise_alone, seen_rows, spectrum
from selector.diagnosis.mismatch.regimes import Variable, in_words, variables
from selector.diagnosis.mismatch.segments import large_rows, noisy_rows

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
Mask = NDArray[np.bool_]
_DRAWS = 199
_SCALES = (1, 4, 16, 64)
_SHORTEST = 16
_BINS = 6
_MOST_WINDOWS = 6
_TRIFLE = 0.002
"""Windows with a smaller share of a course are not worth a word."""


@dataclass(frozen=True, eq=False)
class _Box:
    """Rows in question, what they are called, and how unusual they are in each set."""

    channel: str
    rows: Mask
    run: int | None
    regime: str | None
    unusual: Vector


def located(
    comparison: Comparison,
    residuals: Mapping[str, Vector],
    whitened: Mapping[str, Vector],
    *,
    seed: int,
    false_alarm: float,
) -> tuple[Place, ...]:
    """Boxes of the mismatch that noise would not make, with p adjusted for all boxes looked at, by share of the misfit.

    Energy of the residual, whitened by the noise of its short scales and smoothed over 1 to 64 samples, in dyadic
    windows of every run, in bins of every state of the machine and in octaves of frequency. All are compared with their
    largest over noise alone (the recalibration taken off each time), so that any box is named with probability at most
    `false_alarm` where nothing is.

    Parameters
    ----------
    comparison : Comparison
    residuals : mapping of str to ndarray of shape (n_rows,)
        Response → residual after recalibration [its unit]; NaN where missing.
    whitened : mapping of str to ndarray of shape (n_rows,)
        The same after the noise filter; its largest readings count as far as this filter lets them stand out.
    seed : int
    false_alarm : float
    """
    stacks = noise_alone(comparison, residuals, _DRAWS, np.random.default_rng(seed))
    states = variables(comparison)
    boxes = [box for response, stack in stacks.items() for box in _boxes(comparison, response, stack, states)]
    if not boxes:
        return ()
    unusual = np.array([box.unusual for box in boxes])
    of_noise = unusual[:, 1:].max(axis=0)
    places: list[Place] = []
    for response, stack in stacks.items():
        taken: list[_Box] = []
        excess = _excess(stack[0], whitened[response])
        for k in np.argsort(-unusual[:, 0], kind="stable"):
            box, p = boxes[k], float((1 + np.sum(of_noise >= unusual[k, 0])) / (1 + len(of_noise)))
            if box.channel != response or p > max(false_alarm, 1.0 / (1 + len(of_noise))):
                continue
            if len(taken) == _MOST_WINDOWS or any(_alike(box, other) for other in taken):
                continue
            taken.append(box)
            share = float(np.clip(excess[box.rows].sum() / max(excess.sum(), 1e-300), 0.0, 1.0))
            first, last = _window(comparison, box)
            run = None if box.run is None else comparison.runs[box.run]
            places.append(Place(response, _place(comparison, response), run, first, last, box.regime, share, p))
    return tuple(sorted(places, key=lambda place: -place.share))


def active_windows(comparison: Comparison, response: str, course: Vector) -> tuple[Place, ...]:
    """Windows in which something acts.

    `course` is an effect's fitted course, which acts where it is at least a quarter of its largest amount, or a
    residual, in which it acts where that is more than quiet noise. What acts in most of a run acts in all of it. A
    state of the machine stands beside the windows if it tells when they are. `share` is of the course's sum of squares.
    """
    clean = np.nan_to_num(course)
    if _is_clean(comparison, course):
        active = large_rows(comparison, clean)
    else:
        active = noisy_rows(comparison, course)
        if not active.any():
            active = np.isfinite(course)
    regime = in_words(comparison, active)
    total = float(np.sum(clean[active] ** 2)) or 1.0
    places = []
    for run, rows in comparison.rows_of_runs():
        edges = np.flatnonzero(np.diff(np.concatenate([[0], active[rows].astype(np.int8), [0]])))
        for first, end in zip(edges[::2], edges[1::2], strict=True):
            window = slice(rows.start + first, rows.start + end)
            share = float(np.sum(clean[window] ** 2)) / total
            if share < _TRIFLE:
                continue
            start, stop = float(comparison.time_s[window][0]), float(comparison.time_s[window][-1])
            places.append(Place(response, _place(comparison, response), run, start, stop, regime, share))
    return tuple(places)


def _is_clean(comparison: Comparison, course: Vector) -> bool:
    """Whether a course has no noise: complete, and its innovations are a small part of it."""
    if not np.isfinite(course).all():
        return False
    rows = seen_rows(comparison, course)
    if sum(len(here) for here in rows) == 0 or not np.any(course):
        return True
    # A noisy course changes its sense of motion at every other sample.
    turns = [np.mean(np.diff(np.sign(np.diff(course[here]))) != 0.0) for here in rows if len(here)]
    return float(np.mean(turns)) < 0.35


def _place(comparison: Comparison, response: str) -> str | None:
    return comparison.channel(response).place


def _boxes(comparison: Comparison, response: str, stack: Matrix, states: tuple[Variable, ...]) -> list[_Box]:
    rows = seen_rows(comparison, np.where(stack[0] != 0.0, stack[0], np.nan))
    seen = np.concatenate(rows)
    of = spectrum(stack, rows)
    noise = background(of)
    white = innovations(noise.phi, stack, rows)
    white /= 1.4826 * np.median(np.abs(white[:, seen]), axis=1, keepdims=True) + 1e-300
    np.clip(white, -6.0, 6.0, out=white)
    found: list[_Box] = []
    energies = {scale: np.zeros(white.shape) for scale in _SCALES}
    for k, here in enumerate(rows):
        for scale, energy in energies.items():
            if len(here) < 4 * scale or len(here) == 0:
                continue
            energy[:, here] = _smoothed(white[:, here], scale) ** 2
            found += _windows(response, k, here, energy[:, here], scale, len(stack[0]))
    for variable in states:
        bins = variable.bins(_BINS)
        for number in np.unique(bins[seen]):
            mask = np.zeros(len(bins), dtype=np.bool_)
            mask[seen] = bins[seen] == number
            if _SHORTEST <= mask.sum() < 0.9 * len(seen):
                for scale in (1, 16):
                    unusual = _unusual(energies[scale][:, mask].mean(axis=1))
                    found.append(_Box(response, mask, None, _words(variable, bins, int(number)), unusual))
    everywhere = np.zeros(len(stack[0]), dtype=np.bool_)
    everywhere[seen] = True
    ratio = np.abs(of.amplitudes) ** 2 / noise.density(of.frequency)
    high = 0.5
    while high > of.frequency.min() * 2.0:
        band = (of.frequency > high / 2.0) & (of.frequency <= high)
        if band.any():
            words = f"{high / 2.0 / comparison.period_s:.3g} to {high / comparison.period_s:.3g} Hz"
            found.append(_Box(response, everywhere, None, words, _unusual(ratio[:, band].mean(axis=1))))
        high /= 2.0
    return found


def _smoothed(white: Matrix, scale: int) -> Matrix:
    """Moving sums over `scale` samples divided by its root: variance 1 as before."""
    if scale == 1:
        return white
    padded = np.pad(white, ((0, 0), (scale // 2, scale - scale // 2 - 1)))
    sums = np.concatenate([np.zeros((len(white), 1)), np.cumsum(padded, axis=1)], axis=1)
    return np.asarray((sums[:, scale:] - sums[:, :-scale]) / np.sqrt(scale))


def _windows(response: str, run: int, rows: NDArray[np.intp], energy: Matrix, scale: int, n_rows: int) -> list[_Box]:
    found = []
    sums = np.concatenate([np.zeros((len(energy), 1)), np.cumsum(energy, axis=1)], axis=1)
    n = len(rows)
    length = n
    while length >= max(_SHORTEST, 2 * scale):
        for first in range(0, n - length + 1, max(1, length // 2)):
            mask = np.zeros(n_rows, dtype=np.bool_)
            mask[rows[first : first + length]] = True
            found.append(_Box(response, mask, run, None, _unusual((sums[:, first + length] - sums[:, first]) / length)))
        length //= 2
    return found


def _unusual(energy: Vector) -> Vector:
    """Mean energy as a standard normal value under noise (sets 1 and on), by its cube root (Wilson–Hilferty)."""
    root = np.cbrt(energy)
    return np.asarray((root - root[1:].mean()) / max(float(root[1:].std()), 1e-12))


def _words(variable: Variable, bins: NDArray[np.intp], number: int) -> str:
    inside = variable.values[bins == number]
    if number == bins.max():
        return variable.above(float(0.5 * (inside.min() + variable.values[bins < number].max())))
    if number == bins.min():
        return variable.below(float(0.5 * (inside.max() + variable.values[bins > number].min())))
    return f"{variable.words} {inside.min():.4g} to {inside.max():.4g} {variable.unit}".strip()


def _alike(box: _Box, other: _Box) -> bool:
    """Whether two boxes say nearly the same: windows that overlap, or the same kind of state."""
    if (box.run is None) != (other.run is None):
        return False
    if box.run is None:
        return True
    return bool((box.rows & other.rows).sum() > 0.25 * min(box.rows.sum(), other.rows.sum()))


def _window(comparison: Comparison, box: _Box) -> tuple[float | None, float | None]:
    if box.run is None:
        return None, None
    at = np.flatnonzero(box.rows)
    return float(comparison.time_s[at[0]]), float(comparison.time_s[at[-1]])


def _excess(residual: Vector, whitened: Vector) -> Vector:
    """Squares of the residual beyond those of noise, row by row; 0 where the noise filter says nothing."""
    usual = float(np.median(np.abs(np.diff(residual)))) ** 2 / 0.91
    return np.where(np.isfinite(whitened), np.maximum(residual**2 - usual, 0.0), 0.0)
