"""Sums of products of whitened columns, block by block: all that tests of the candidates need of the samples."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from selector.diagnosis.shapes.residual import least_squares
from selector.types import Matrix, Vector

Indices = NDArray[np.intp]
#: Share of a column that must be left after projection; below it the column is the others' and cannot be tested.
_LEFT = 1e-5


@dataclass(frozen=True, eq=False)
class Moments:
    """Sums over blocks of rows: base columns, candidate columns and the target, all whitened."""

    #: base and base_target: (n_blocks, p, p)
    base: Matrix
    base_target: Matrix
    cross: Matrix  #: (n_blocks, p, m): Base columns with candidate columns
    target: Matrix  #: (n_blocks, m): Candidate columns with the target
    #: (n_blocks, n_variants, k, k): For every number of columns k: products of a variant's columns with each other
    within: list[Matrix]
    square: Vector  #: (n_blocks,): Sum of squares of the target
    groups: list[Indices]  #: (n_variants, k): For every k, the candidate columns of its variants
    members: list[Indices]  #: (n_variants,): For every k, the numbers of its variants
    bounds: list[Matrix]  #: (n_variants, k, 2): For every k, between what every coefficient may lie

    @property
    def n_variants(self) -> int:
        """How many variants there are."""
        return sum(len(members) for members in self.members)

    def place(self, v: int) -> tuple[int, int]:
        """In which of the lists a variant stands, and where there."""
        return next((q, int(np.flatnonzero(of == v)[0])) for q, of in enumerate(self.members) if v in of)


def column_groups(counts: Sequence[int]) -> tuple[list[Indices], list[Indices]]:
    """Columns and numbers of the variants that have 1, 2, … columns, for variants that stand side by side."""
    first = np.concatenate([[0], np.cumsum(counts)])[:-1].astype(np.intp)
    sizes = np.asarray(counts, dtype=np.intp)
    groups, members = [], []
    for k in sorted(set(counts)):
        here = np.flatnonzero(sizes == k)
        groups.append(first[here][:, None] + np.arange(k)[None, :])
        members.append(here)
    return groups, members


def moments(columns: Matrix, target: Vector, blocks: Sequence[slice], counts: Sequence[int], bounds: Matrix) -> Moments:
    """The sums over each of the `blocks` of rows, beside no base; `bounds` (n_columns, 2) of the coefficients."""
    groups, members = column_groups(counts)
    m, n = columns.shape[1], len(blocks)
    sums = Moments(
        base=np.empty((n, 0, 0)),
        base_target=np.empty((n, 0)),
        cross=np.empty((n, 0, m)),
        target=np.empty((n, m)),
        within=[np.empty((n, *group.shape, group.shape[1])) for group in groups],
        square=np.empty(n),
        groups=groups,
        members=members,
        bounds=[bounds[group] for group in groups],
    )
    for b, rows in enumerate(blocks):
        z, y = columns[rows], target[rows]
        sums.target[b], sums.square[b] = z.T @ y, y @ y
        for part, group in zip(sums.within, groups, strict=True):
            k = group.shape[1]
            for i in range(k):
                for j in range(i, k):
                    part[b, :, i, j] = np.einsum("nv,nv->v", z[:, group[:, i]], z[:, group[:, j]])
                    part[b, :, j, i] = part[b, :, i, j]
    return sums


def beside(sums: Moments, base: Matrix, columns: Matrix, target: Vector, blocks: Sequence[slice]) -> Moments:
    """The same sums beside whitened `base` columns of shape (n_rows, p)."""
    parts = [(base[rows], columns[rows], target[rows]) for rows in blocks]
    return replace(
        sums,
        base=np.array([x.T @ x for x, _, _ in parts]),
        base_target=np.array([x.T @ y for x, _, y in parts]),
        cross=np.array([x.T @ z for x, z, _ in parts]),
    )


def inverse_of(gram: Matrix) -> Matrix:
    """Pseudo-inverse of products of columns, whose sizes may differ by many powers of ten."""
    size = 1.0 / np.sqrt(np.maximum(np.diag(gram), 1e-300))
    scaled = gram * size[:, None] * size[None, :]
    return np.asarray(np.linalg.pinv(scaled, rcond=1e-10, hermitian=True) * size[:, None] * size[None, :])


@dataclass(frozen=True, eq=False)
class Solved:
    """Every variant fitted together with the base."""

    #: (n_variants,): By how much the sum of squares falls when the variant is added; 0 if it cannot be told from the
    #: base
    gain: Vector
    coefficients: list[Matrix]  #: (n_variants, k): For every number of columns k


def solved(sums: Moments) -> Solved:
    """Fit of every variant beside the base."""
    a, g = sums.base.sum(axis=0), sums.base_target.sum(axis=0)
    cross, target = sums.cross.sum(axis=0), sums.target.sum(axis=0)
    inverse = inverse_of(a)
    alone, carried = inverse @ g, inverse @ cross
    gain = np.zeros(sums.n_variants)
    coefficients = []
    for part, group, members, limits in zip(sums.within, sums.groups, sums.members, sums.bounds, strict=True):
        whole = part.sum(axis=0)
        b = cross[:, group]
        left = whole - np.einsum("pvi,pvj->vij", b, carried[:, group])
        score = target[group] - np.einsum("pvi,p->vi", b, alone)
        beta, told = _solutions(left, whole, score)
        beta = np.clip(beta, limits[:, :, 0], limits[:, :, 1])
        rise = 2.0 * np.einsum("vi,vi->v", score, beta) - np.einsum("vi,vij,vj->v", beta, left, beta)
        gain[members] = np.where(told, rise, 0.0)
        coefficients.append(beta)
    return Solved(np.maximum(gain, 0.0), coefficients)


def _solutions(left: Matrix, whole: Matrix, score: Matrix) -> tuple[Matrix, NDArray[np.bool_]]:
    """S⁻¹·s for every variant; columns of which nothing is left beside the base or each other count as none."""
    scale, values, vectors = _directions(left, whole)
    kept = values > _LEFT
    inverse = np.where(kept, 1.0 / np.where(kept, values, 1.0), 0.0)
    turned = np.einsum("vij,vi->vj", vectors, score * scale)
    beta = np.einsum("vij,vj->vi", vectors, inverse * turned) * scale
    return beta, np.asarray(kept.any(axis=1))


def _directions(left: Matrix, whole: Matrix) -> tuple[Matrix, Matrix, Matrix]:
    """Scale of the columns of every variant, and eigenvalues and -vectors of what is left of their products."""
    scale = 1.0 / np.sqrt(np.maximum(np.einsum("vii->vi", whole), 1e-300))
    return scale, *np.linalg.eigh(left * scale[:, :, None] * scale[:, None, :])


def scores_of_noise(sums: Moments, noise_base: Matrix, noise_target: Matrix) -> list[tuple[Matrix, Matrix]]:
    """Per number of columns k: what noise says of every variant, block by block, and the root of its inverse product.

    `noise_base` (n_blocks, p) and `noise_target` (n_blocks, m) are products of base and candidate columns with noise.
    Returns shapes (n_blocks, n_variants, k) and (n_variants, k, k): with signs ε of the blocks, the gain that noise
    alone makes is ‖root·Σ ε_b·score_b‖².
    """
    a, cross = sums.base.sum(axis=0), sums.cross.sum(axis=0)
    inverse = inverse_of(a)
    carried = inverse @ cross
    found = []
    for part, group in zip(sums.within, sums.groups, strict=True):
        whole = part.sum(axis=0)
        left = whole - np.einsum("pvi,pvj->vij", cross[:, group], carried[:, group])
        score = noise_target[:, group] - np.einsum("bp,pvi->bvi", noise_base, carried[:, group])
        scale, values, vectors = _directions(left, whole)
        kept = values > _LEFT
        root = np.where(kept, 1.0 / np.sqrt(np.where(kept, values, 1.0)), 0.0)
        found.append((score, np.einsum("vj,vij,vi->vji", root, vectors, scale)))
    return found


def moderated(beta: Vector, covariance: Matrix) -> Vector:
    """Coefficients of one shape, drawn towards 0 in the directions that the record hardly tells.

    They are means after the record if each direction beforehand was normal around 0 with one spread τ, ln τ² being the
    mean of ln β² over the directions, weighted by what each gains (ridge regression with an empirical prior: A. Hoerl,
    R. Kennard, Technometrics 12, 1970). Columns that nearly are one another then do not cancel where the record was
    fitted and run away where it was not.

    `beta`, shape (k,), is by generalised least squares, of columns of about one size.
    """
    variances, directions = np.linalg.eigh(covariance)
    told = variances > 1e-12 * variances.max(initial=0.0)
    along = directions.T @ beta
    gains = np.where(told, along**2 / np.where(told, variances, 1.0), 0.0)
    if len(beta) < 2 or gains.sum() <= 0.0:
        return beta
    spread = np.exp(np.sum(gains * np.log(np.maximum(along**2, 1e-300))) / gains.sum())
    return np.asarray(directions @ (along * spread / (spread + np.maximum(variances, 0.0))))


def all_moderated(beta: Vector, covariance: Matrix, own: int, counts: Sequence[int]) -> Vector:
    """The first `own` coefficients as they are, then those of shapes with so many columns each, `moderated`."""
    result, first = np.array(beta), own
    for count in counts:
        here = slice(first, first + count)
        result[here] = moderated(beta[here], covariance[here, here])
        first = here.stop
    return result


def plain_fit(base: Matrix, target: Vector, own: int, counts: Sequence[int]) -> Vector:
    """Coefficients by plain least squares, those of the shapes behind the first `own` columns `moderated`."""
    beta = least_squares(base, target)
    spread = float(np.mean((target - base @ beta) ** 2))
    beta = all_moderated(beta, spread * inverse_of(base.T @ base), own, counts)
    beta[:own] = least_squares(base[:, :own], target - base[:, own:] @ beta[own:])
    return beta
