"""What do rivals choose from: the residual of a recalibrated simulation, and a shape of every effect there is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from selector.diagnosis.comparison import Comparison, Mask
from selector.diagnosis.effects.catalogue import catalogue
from selector.diagnosis.shapes.signals import filled, rate

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
MOST_ROWS = 4000
_SMALL = 1e-8


@dataclass(frozen=True, eq=False)
class Candidates:
    """One response: its recalibrated residual and one shape of every effect that can be tested there.

    Attributes
    ----------
    response : str
    residual : ndarray of shape (n_fitted,)
        On fitted rows (at most `MOST_ROWS`, evenly taken), offset, gain and delay projected off, of unit size (RMS).
    columns : ndarray of shape (n_fitted, n_columns)
        The same was projected off, and each has unit size.
    owners : tuple of str
        Id of the effect that every column belongs to.
    nuisances, unscaled, recorded, simulated : ndarrays
        Columns of recalibration and of effects, recorded and simulated course, over all rows, for the last fit.
    fitted, held_out : ndarray of bool of shape (n_rows,)
        Rows where both are there, of either part.
    """

    response: str
    residual: Vector
    columns: Matrix
    owners: tuple[str, ...]
    nuisances: Matrix
    unscaled: Matrix
    recorded: Vector
    simulated: Vector
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
    smooth = filled(comparison, simulated)
    nuisances = np.column_stack([np.ones(len(smooth)), smooth, rate(comparison, smooth)])
    fitted = seen & ~comparison.held_out
    rows = np.flatnonzero(fitted)
    rows = rows[:: max(1, -(-len(rows) // MOST_ROWS))]
    free = _orthonormal(nuisances[rows])
    residual = (recorded - simulated)[rows]
    residual = residual - free @ (free.T @ residual)
    size = _rms(residual)
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


def _rms(values: Vector) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else 0.0
