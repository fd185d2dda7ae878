"""What the noise of a channel looks like, and the filter that makes it white."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from selector.diagnosis.comparison import Comparison
from selector.types import Mask, Matrix, Vector

_LONGEST_ORDER = 12
#: A gap of more sampling periods than this starts a new stretch: what was before says little about what comes.
_GAP_PERIODS = 3.5


@dataclass(frozen=True)
class NoiseModel:
    """An autoregression of the noise of one channel, e_t = Σ φ_i·e_(t−i) + s·w_t with white w of variance 1."""

    phi: Vector  #: (order,)
    sd: float  #: s [unit of the channel]

    @property
    def correlation_samples(self) -> float:
        """Samples until two readings say something new: (1 + a)/(1 − a) of the sum a of φ, at least 1."""
        total = float(np.clip(self.phi.sum(), -0.9, 0.999))
        return max(1.0, (1.0 + total) / (1.0 - total))


def stretches(comparison: Comparison, seen: NDArray[np.bool_]) -> list[slice]:
    """Rows that follow each other without a gap, in which a channel was `seen` (holes of up to 3 samples count in)."""
    found = []
    for _, rows in comparison.rows_of_runs():
        here = rows.start + np.flatnonzero(seen[rows])
        if len(here) < 2:
            continue
        time = comparison.time_s[here]
        cuts = np.flatnonzero(np.diff(time) > _GAP_PERIODS * comparison.period_s) + 1
        for part in np.split(here, cuts):
            if len(part) > 2:
                found.append(slice(int(part[0]), int(part[-1]) + 1))
    return found


def noise_model(residual: Vector, parts: list[slice], *, lost: int = 0, rounding: float = 0.0) -> NoiseModel:
    """The autoregression of up to 12 samples that explains a residual best (Bayes' information criterion).

    Large readings count less (Huber), so that a burst does not decide what the noise is. `lost` degrees of freedom went
    into the fit that left this residual. Its standard deviation is `rounding` [unit of the channel] at least.
    """
    whole = filled_rows(residual, parts)
    filled = [whole[part] for part in parts]
    values = np.concatenate(filled)
    # robust; the plain one where more than half of the values are alike
    spread = 1.4826 * float(np.median(np.abs(values - np.median(values)))) or float(np.std(values))
    if spread == 0.0:
        return NoiseModel(np.zeros(0), rounding)
    clipped = [np.clip(part, -4.0 * spread, 4.0 * spread) for part in filled]
    n = sum(len(part) for part in clipped)
    highest = int(min(_LONGEST_ORDER, max(1, n // 40)))
    rows = [np.lib.stride_tricks.sliding_window_view(part, highest + 1) for part in clipped if len(part) > highest + 1]
    if not rows:
        return NoiseModel(np.zeros(0), max(spread, rounding))
    table = np.concatenate(rows)
    target, past = table[:, -1], table[:, -2::-1]
    gram, cross, total = past.T @ past, past.T @ target, float(target @ target)
    best = (np.inf, np.zeros(0), spread)
    for order in range(highest + 1):
        phi = np.linalg.solve(gram[:order, :order] + 1e-9 * np.trace(gram) * np.eye(order), cross[:order])
        variance = max((total - float(phi @ cross[:order])) / max(len(target) - order - lost, 1), 1e-300)
        score = len(target) * np.log(variance) + np.log(len(target)) * order
        if score < best[0] - 1e-9:
            best = (score, phi, float(np.sqrt(variance)))
    phi = best[1]
    plain = NoiseModel(phi, 1.0)
    left = whitened(plain, whole[:, None], parts)[with_past(plain, parts, len(whole)), 0]
    sd = float(np.sqrt(np.mean(left**2) * len(left) / max(len(left) - lost, 1)))
    return NoiseModel(phi, max(sd, rounding, 1e-300))


def whitened(model: NoiseModel, values: Matrix, parts: list[slice]) -> Matrix:
    """Columns passed through the filter that makes the noise white with variance 1, shape as `values`.

    Rows outside the stretches and the first rows of each, which have no past, are 0: they say nothing.
    """
    order, phi = len(model.phi), np.array(model.phi)
    result = np.zeros(values.shape)
    for part in parts:
        block = result[part]
        block[:] = values[part]
        if order:
            _take_off(block, phi)
        block[:order] = 0.0
        block /= model.sd
    return result


def with_past(model: NoiseModel, parts: Sequence[slice], n_rows: int) -> Mask:
    """Rows of the stretches of whose past the filter says something, shape (n_rows,)."""
    told = np.zeros(n_rows, dtype=np.bool_)
    for part in parts:
        told[part.start + len(model.phi) : part.stop] = True
    return told


@njit(cache=True, nogil=True)
def _take_off(rows, phi):  # type: ignore[no-untyped-def]
    # from the last row on, so that those before are still the values
    for i in range(len(rows) - 1, 0, -1):
        for lag in range(min(len(phi), i)):
            weight = phi[lag]
            for j in range(rows.shape[1]):
                rows[i, j] -= weight * rows[i - lag - 1, j]


def filled_rows(values: Vector, parts: Sequence[slice]) -> Vector:
    """The course without holes inside its stretches, 0 outside."""
    result = np.zeros(len(values))
    for part in parts:
        seen = np.isfinite(values[part])
        at = np.arange(part.stop - part.start)
        result[part] = values[part] if seen.all() else np.interp(at, at[seen], values[part][seen])
    return result
