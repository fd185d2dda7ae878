"""What offset, gain and delay of a simulation leave of the difference, fitted to the rows that may be fitted to."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.shapes.signals import filled, rate

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


def leftover(comparison: Comparison, response: str) -> Vector:
    """Recorded − simulated [unit of the response] less offset, gain and delay; 0 where either is missing."""
    difference = comparison.difference(response)
    simulated = filled(comparison, comparison.simulated[response])
    columns = np.column_stack([np.ones(len(simulated)), simulated, rate(comparison, simulated)])
    seen = np.isfinite(difference)
    left = np.where(seen, difference, 0.0)
    fitted = seen & ~comparison.held_out
    if not fitted.any():
        return left
    return np.where(seen, left - columns @ least_squares(columns[fitted], left[fitted]), 0.0)


def least_squares(columns: Matrix, values: Vector) -> Vector:
    """Coefficients by least squares, columns brought to one size first."""
    size = np.sqrt(np.mean(columns**2, axis=0))
    size = np.where(size > 0.0, size, 1.0)
    return np.asarray(np.linalg.lstsq(columns / size, values, rcond=1e-12)[0] / size)


class Remainder:
    """How much of the difference a single course explains, beyond offset, gain and delay, in the fitted rows."""

    def __init__(self, comparison: Comparison, response: str) -> None:
        difference = comparison.difference(response)
        simulated = filled(comparison, comparison.simulated[response])
        self._rows = np.isfinite(difference) & ~comparison.held_out
        columns = np.column_stack([np.ones(len(simulated)), simulated, rate(comparison, simulated)])[self._rows]
        size = np.sqrt(np.mean(columns**2, axis=0)) if len(columns) else np.ones(3)
        self._base = np.linalg.qr(columns / np.where(size > 0.0, size, 1.0))[0]
        self._left = self._off(difference[self._rows])
        self._whole = float(self._left @ self._left)

    def share(self, column: Vector, *, only_positive: bool = True, most: float = np.inf) -> float:
        """Share of the remaining squares, 0 … 1, with a coefficient of 0 to `most` (of either sign if not positive)."""
        part = self._off(column[self._rows])
        squares, along = float(part @ part), float(part @ self._left)
        if squares <= 1e-20 * float(column @ column) or self._whole <= 0.0 or (only_positive and along < 0.0):
            return 0.0
        size = min(along / squares, most)
        return (2.0 * along - size * squares) * size / self._whole

    def best(self, course: Callable[[float], Vector | None], tried: Vector, *, rounds: int = 3) -> float | None:
        """The value whose course explains most: of those tried (even in the logarithm), then between them."""
        step = float(tried[1] / tried[0])
        scores = {float(value): self._score(course(float(value))) for value in tried}
        for _ in range(rounds):
            top = max(scores, key=lambda value: scores[value])
            step = step**0.5
            for value in (top / step, top * step):
                scores[value] = self._score(course(value))
        top = max(scores, key=lambda value: scores[value])
        return top if scores[top] > 0.0 else None

    def _score(self, column: Vector | None) -> float:
        return 0.0 if column is None else self.share(column)

    def _off(self, values: Vector) -> Vector:
        return np.asarray(values - self._base @ (self._base.T @ values))
