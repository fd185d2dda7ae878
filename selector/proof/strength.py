"""How strong a concealed effect is: what an oracle, who knows its course and the noise, could detect."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from selector.proof.case import HeldOut
from selector.proof.noise import Noise

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


def recalibration(simulated: Vector, time_s: Vector, starts: Sequence[int]) -> Matrix:
    """What a user may set right without new physics, all runs alike: offset, gain, delay; shape (n_rows, 3)."""
    slope = np.concatenate([np.gradient(simulated[a:b], time_s[a:b]) for a, b in pairwise(starts)])
    return np.column_stack([np.ones_like(simulated), simulated, slope])


def fitted_starts(starts: Sequence[int], share: float = 0.7) -> tuple[int, ...]:
    """First rows, and last of all the number, of the fitted rows: all runs but the last, or `share` of a single one."""
    return tuple(starts[:-1]) if len(starts) > 2 else (starts[0], starts[0] + int(share * (starts[1] - starts[0])))


def d_prime(
    effect_courses: Mapping[str, Vector],
    noise: Mapping[str, Noise],
    nuisances: Mapping[str, Matrix],
    starts: Sequence[int],
) -> float:
    """Norm of an effect in units of the noise, over the fitted rows of all responses together.

    d′² = Σ |(I − P) W e|², with W the whitening of the response's noise and P the projection on its whitened nuisances
    (recalibration, and the repeated course of cycle-locked noise): the separation, in standard deviations, of the
    statistic of a matched filter with the effect on and off (S. M. Kay, Fundamentals of Statistical Signal Processing
    II, section 4.4). Whitening goes by second moments, for heavy tails too.

    Parameters
    ----------
    effect_courses : mapping of str to ndarray of shape (n_rows,)
        Response → course of the effect [unit of the response].
    noise : mapping of str to Noise
    nuisances : mapping of str to ndarray of shape (n_rows, n_nuisances)
        Response → columns that may be fitted without new physics, e.g. `recalibration`.
    starts : sequence of int
        First row of every run, and last of all the number of rows; only `fitted_starts` of them count.
    """
    rows = fitted_starts(starts)
    total = 0.0
    for response, course in effect_courses.items():
        colour = noise[response]
        left = unabsorbed(course[:, None], nuisances[response], colour, rows)
        total += float(np.sum(left**2))
    return float(np.sqrt(total))


def unabsorbed(columns: Matrix, nuisances: Matrix, noise: Noise, starts: Sequence[int]) -> Matrix:
    """Whitened columns in the rows of `starts`, with the nuisances projected off; shape (starts[-1], n_columns)."""
    stop = starts[-1]
    free = np.column_stack([nuisances[:stop], noise.repeated(starts)])
    lengths = np.linalg.norm(free, axis=0)
    both = noise.whitened(np.column_stack([free / np.where(lengths > 0.0, lengths, 1.0), columns[:stop]]), starts)
    basis, values, _ = np.linalg.svd(both[:, : free.shape[1]], full_matrices=False)
    basis = basis[:, values > 1e-10 * values.max(initial=0.0)]
    white = both[:, free.shape[1] :]
    return np.asarray(white - basis @ (basis.T @ white))


def scale_for(
    target: float, strength: Callable[[float], float], *, first: float = 1.0, tolerance: float = 0.01
) -> float:
    """The size of an effect at which its `strength` (d′ as a function of size) is `target`, by secants of logarithms.

    Raises
    ------
    ValueError
        If no size within 12 steps gives the target to `tolerance` (relative).
    """
    size, found = first, strength(first)
    slope = 1.0
    for _ in range(12):
        if not np.isfinite(found) or found <= 0.0:
            break
        if abs(found / target - 1.0) <= tolerance:
            return size
        last_size, last = size, found
        size = size * float(np.clip((target / found) ** (1.0 / slope), 1e-3, 1e3))
        found = strength(size)
        if size != last_size and found > 0.0 and found != last:
            slope = float(np.clip(np.log(found / last) / np.log(size / last_size), 0.2, 5.0))
    if np.isfinite(found) and found > 0.0 and abs(found / target - 1.0) <= tolerance:
        return size
    raise ValueError(f"d′ {found:.3g} at size {size:.3g}, wanted {target:g}")


def held_out_errors(
    recorded: Vector,
    simulated: Vector,
    effect: Vector,
    errors: Vector,
    noise: Noise,
    time_s: Vector,
    starts: Sequence[int],
) -> HeldOut:
    """Root mean square errors of a response in the held-out rows: as given, recalibrated, by the oracle, noise alone.

    The oracle adds the true course of the effect to the simulation and recalibrates; `errors` is recorded minus truth.
    All courses of shape (n_rows,), NaN in `recorded` = missing.
    """
    rows = fitted_starts(starts)
    kept = np.arange(starts[-1]) >= rows[-1]
    kept &= np.isfinite(recorded)

    def rest(model: Vector) -> Vector:
        free = recalibration(model, time_s, starts)
        difference = recorded - model
        seen = np.isfinite(difference)
        both = noise.whitened(np.column_stack([free, np.where(seen, difference, 0.0)])[: rows[-1]], rows)
        both = both[seen[: rows[-1]]]
        lengths = np.linalg.norm(both[:, :3], axis=0)
        lengths = np.where(lengths > 0.0, lengths, 1.0)
        coefficients = np.linalg.lstsq(both[:, :3] / lengths, both[:, 3], rcond=1e-10)[0] / lengths
        return np.asarray(difference - free @ coefficients)

    def rms(values: Vector) -> float:
        return float(np.sqrt(np.mean(values[kept] ** 2)))

    return HeldOut(rms(recorded - simulated), rms(rest(simulated)), rms(rest(simulated + effect)), rms(errors))
