"""What offset, gain and delay of a simulation leave of the difference, and what it makes of readings as inputs."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.shapes.signals import course, excited, rate, rise
from selector.types import Matrix, Vector


def unexplained(comparison: Comparison, response: str) -> Vector:
    """Recorded − simulated [unit of the response] less offset, gain and delay; 0 where either is missing."""
    difference = comparison.difference(response)
    simulated = comparison.simulated_course(response)
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


def basis(columns: Matrix, *, least: float = 1e-8) -> Matrix:
    """Orthonormal columns that span the same; what is below `least` of the strongest is rounding."""
    size = np.linalg.norm(columns, axis=0)
    left, values, _ = np.linalg.svd(columns[:, size > 0.0] / size[size > 0.0], full_matrices=False)
    return np.asarray(left[:, values > least * values.max(initial=0.0)])


def off(base: Matrix, columns: Any) -> Any:
    """Columns, or one, without what lies in an orthonormal base."""
    return columns - base @ (base.T @ columns)


class Remainder:
    """How much of the difference a single course explains, beyond offset, gain and delay, in the fitted rows."""

    def __init__(self, comparison: Comparison, response: str) -> None:
        difference = comparison.difference(response)
        simulated = comparison.simulated_course(response)
        self._rows = np.isfinite(difference) & ~comparison.held_out
        columns = np.column_stack([np.ones(len(simulated)), simulated, rate(comparison, simulated)])[self._rows]
        self._base = basis(columns)
        self._left = off(self._base, difference[self._rows])
        self._whole = float(self._left @ self._left)

    def share(self, column: Vector, *, most: float = np.inf) -> float:
        """Share of the remaining squares, 0 … 1, with a coefficient of 0 to `most` (of either sign if not positive)."""
        part = off(self._base, column[self._rows])
        squares, along = float(part @ part), float(part @ self._left)
        if squares <= 1e-20 * float(column @ column) or self._whole <= 0.0 or along < 0.0:
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


_ROLES = ("temperature", "ambient")
_EXACT = 0.02  #: Misfit over the spread of the simulated course, below which it is a sum of the readings.
_NOTICED = 0.05  #: Of what the reading does that does most: a weight that makes less may be none.
_MOST = 40  #: So many readings are not told apart by a few runs.


def weights_of_readings(comparison: Comparison, response: str) -> Mapping[str, float]:
    """By how much the simulated response follows each temperature, at once [unit/K]; empty if it is no such sum.

    The rise of the response since the start of every run is compared with the rises of the temperatures.
    """
    names = [name for name in comparison.with_role(*_ROLES) if name != response and name in comparison.recorded]
    rises = {name: rise(comparison, course(comparison, name)) for name in names}
    rises = {name: values for name, values in rises.items() if excited(values)}
    simulated = rise(comparison, comparison.simulated_course(response))
    if not 2 <= len(rises) <= _MOST or not excited(simulated):
        return {}
    columns = np.column_stack([*rises.values(), *np.eye(len(comparison.runs))[:, comparison.run_index]])
    weights = least_squares(columns[:, np.any(columns, axis=0)], simulated)
    left = simulated - columns[:, np.any(columns, axis=0)] @ weights
    if float(np.std(left)) > _EXACT * float(np.std(simulated)):
        return {}
    return {name: float(weight) for name, weight in zip(rises, weights, strict=False)}


def exchanged(comparison: Comparison, weights: Mapping[str, float], one: str, other: str) -> Vector:
    """What the response would have more, had these two readings not changed places [its unit], from every start."""
    apart = rise(comparison, course(comparison, other)) - rise(comparison, course(comparison, one))
    return np.asarray((weights[one] - weights[other]) * apart)


def read_by(comparison: Comparison, response: str) -> tuple[str, ...]:
    """The temperatures that a simulated response is computed from, those that move it most first; none if unknown."""
    moves = {
        name: abs(weight) * float(np.std(course(comparison, name)))
        for name, weight in weights_of_readings(comparison, response).items()
    }
    told = [name for name, size in moves.items() if size > _NOTICED * max(moves.values())]
    return tuple(sorted(told, key=lambda name: -moves[name]))
