"""What most of the good sets predict: of few runs one set is soon the best by luck."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from selector.models.moments import coefficients, squared_error
from selector.selection.library import ROUNDING, Bench, Shape
from selector.types import Array

#: How quickly a set loses weight with its error, for each group that was left out. Of four groups one with 1.2 times
#: the least error still counts a twentieth; of thirty hardly any but the best.
SHARPNESS = 4.0
LEAST_WEIGHT = 1e-3  #: Of that of the best; what weighs less is left out.


@dataclass(frozen=True)
class Agreement:
    """The mean of what many sets predict, each weighted by how well it does.

    A set that stays near it is chosen where several are as good (projection on a reference model, as in Piironen,
    Paasiniemi and Vehtari 2020).
    """

    bench: Bench
    cross: Array  #: (k, k): Cross-products of [1, columns, mean predictions] over the rows of the bench

    @classmethod
    def of(cls, bench: Bench, sets: Sequence[tuple[tuple[str, ...], Shape]], errors: Array) -> "Agreement":
        """With weights (least error ÷ error)^(`SHARPNESS` · groups); the held-out `errors` have shape (n_sets,)."""
        errors = np.maximum(errors, np.sqrt(ROUNDING))
        weights = (errors.min() / errors) ** (SHARPNESS * len(bench.samples))
        weights[weights < LEAST_WEIGHT] = 0.0
        n = 1 + bench.library.moments.n_columns
        beta, responses = np.zeros((n, len(bench.power))), range(n, len(bench.total))
        for i in np.flatnonzero(weights).tolist():
            at = [1 + column for column in bench.library.columns(*sets[i])]
            beta[[0, *at]] += weights[i] / weights.sum() * coefficients(bench.total, at, responses)
        columns = bench.total[:n, :n]
        return cls(bench, np.block([[columns, columns @ beta], [beta.T @ columns, beta.T @ columns @ beta]]))

    def distance(self, sensors: Sequence[str], shape: Shape) -> float:
        """How near a set can come to it, as a root mean square, in spreads of the displacements."""
        at = [1 + column for column in self.bench.library.columns(sensors, shape)]
        of = range(1 + self.bench.library.moments.n_columns, len(self.cross))
        left = squared_error(self.cross, at, of, coefficients(self.cross, at, of)) / self.bench.n_samples
        return float(np.sqrt(np.maximum(left / self.bench.power, ROUNDING).mean()))
