"""How alike the sensors are: correlation similarity, and the sensors that it cannot compare."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from selector.errors import InputError
from selector.findings import Finding, Where
from selector.sensors.finding_table import FINDINGS
from selector.types import Array

#: A sensor is numerically constant when its standard deviation is at most this share of its magnitude: of the 16
#: digits of a float64, fewer than 7 would be left to correlate, and no thermometer resolves that finely.
CONSTANT_TOLERANCE = 1e-9
#: Two sensors are duplicates up to scale when |r| is this close to 1: unit conversion and summation stay below it.
DUPLICATE_TOLERANCE = 1e-12
ANTICORRELATED_LIMIT = -0.9  #: Sensors whose correlation is at or below this are reported as anti-correlated.

# Sums over 1e7 samples lose at most 1e7 * 2**-53 = 1e-9 of s_i s_j; beyond ten times that it is not a rounding error.
_ROUNDING = 1e-8


@dataclass(frozen=True, eq=False)
class Similarity:
    """Similarity of n sensors, with what a reader of it must know."""

    #: (n_sensors, n_sensors): r_ij, or |r_ij| when `absolute`; exactly symmetric, unit diagonal, within [-1, 1], read-
    #: only
    matrix: Array
    constant: tuple[int, ...] = ()  #: Numerically constant sensors: similarity 0 to all others, 1 to themselves
    #: (first, other): `other` repeats `first` up to scale, |r| ≥ 1 − 1e-12. Each repeated sensor stands here once, with
    #: the first sensor that it repeats.
    duplicates: tuple[tuple[int, int], ...] = ()
    #: (i, j, r) with i < j and signed r ≤ −0.9, also when `absolute`
    anticorrelated: tuple[tuple[int, int, float], ...] = ()
    absolute: bool = False  #: Whether the matrix holds |r|
    #: rows_used and rows_left_out: Complete rows, and rows left out because a sensor was missing; None when made from
    #: cross-products
    rows_used: int | None = None
    rows_left_out: int | None = None


def correlation_similarity(samples: ArrayLike, *, absolute: bool = False) -> Similarity:
    """Pearson correlation of the columns, P eq. 1.

    Rows in which any sensor is missing are left out for all sensors (listwise) and counted. Pairwise-complete
    correlations would compare different stretches of time, and their matrix need not be a correlation matrix at all.

    `samples` have shape (n_samples, n_sensors), NaN = missing. With `absolute` |r| is used, so that sensors that move
    against each other count as alike.

    Raises InputError: no sensors, fewer than three complete rows (two always give |r| = 1), or infinite values.
    """
    values = np.asarray(samples, dtype=np.float64)
    if values.ndim != 2 or values.shape[1] == 0:
        raise InputError(
            f"an array of shape {values.shape}",
            expected="one row per sample and one column per sensor, at least one sensor",
            where="samples",
            advice="choose at least one sensor",
        )
    missing = np.isnan(values)
    complete = values[~missing.any(axis=1)]
    if len(complete) < 3:
        worst = int(np.argmax(missing.sum(axis=0)))
        raise InputError(
            f"{len(complete)} of {len(values)} rows are complete; column {worst} lacks {missing[:, worst].sum()}",
            expected="at least 3 rows in which no sensor is missing",
            where="samples",
            advice="leave out the sensors that are missing most, or fill their gaps before comparing sensors",
        )
    if not np.isfinite(complete).all():
        raise InputError(
            f"infinite values in column {int(np.argmin(np.isfinite(complete).all(axis=0)))}",
            expected="finite readings",
            where="samples",
            advice="mark broken readings as missing (NaN)",
        )
    magnitude = np.abs(complete).max(axis=0)
    # scaled to at most 1 before centring, so that neither sums nor squares can overflow
    scaled = complete / np.where(magnitude > 0, magnitude, 1.0)
    centred = scaled - scaled.mean(axis=0)
    result = similarity_from_cross_products(
        centred.T @ centred, absolute=absolute, constant_at=len(complete) * CONSTANT_TOLERANCE**2
    )
    return replace(result, rows_used=len(complete), rows_left_out=len(values) - len(complete))


def constant_limit(magnitude: ArrayLike, n_samples: int) -> Array:
    """Centred sum of squares at or below which a sensor is numerically constant, shape of `magnitude`.

    `magnitude` is the largest absolute reading of each sensor, in the unit of the readings; see `CONSTANT_TOLERANCE`.
    """
    return n_samples * (CONSTANT_TOLERANCE * np.asarray(magnitude, dtype=np.float64)) ** 2


def similarity_from_cross_products(
    cross: ArrayLike, *, absolute: bool = False, constant_at: ArrayLike | None = None
) -> Similarity:
    """Pearson correlation from centred sums of products, P eq. 1; the number of samples does not matter.

    `cross` is Σ (x_i − x̄_i)(x_j − x̄_j) of shape (n_sensors, n_sensors), or a covariance matrix. `constant_at` is the
    diagonal at or below which a sensor is constant, see `constant_limit`. The raw readings are not known here; without
    it, a sensor is constant when its spread is at most `CONSTANT_TOLERANCE` of the liveliest sensor's.

    Raises InputError: not square, empty, not finite, not symmetric, or not a matrix of sums of products (|r| > 1,
    negative square).
    """
    c = np.asarray(cross, dtype=np.float64)
    if c.ndim != 2 or c.shape[0] != c.shape[1] or c.shape[0] == 0:
        raise _unusable_cross(f"an array of shape {c.shape}", "a square matrix with at least one sensor")
    if not np.isfinite(c).all():
        i, j = np.argwhere(~np.isfinite(c))[0]
        raise _unusable_cross(f"{c[i, j]} at ({i}, {j})", "finite sums of products")
    squares = np.diag(c)
    if (squares < 0).any():
        raise _unusable_cross(f"a negative sum of squares for sensor {int(np.argmin(squares))}", "sums of squares ≥ 0")
    limit = CONSTANT_TOLERANCE**2 * squares.max() if constant_at is None else np.asarray(constant_at, dtype=np.float64)
    constant = squares <= limit
    scale = np.where(constant, 1.0, np.sqrt(squares))
    # column by column, so that the product of two small scales cannot underflow
    r = c / scale[:, None] / scale[None, :]
    r[constant, :] = 0.0
    r[:, constant] = 0.0
    if np.abs(r - r.T).max() > _ROUNDING:
        i, j = np.unravel_index(int(np.argmax(np.abs(r - r.T))), r.shape)
        raise _unusable_cross(f"{c[i, j]} at ({i}, {j}) but {c[j, i]} at ({j}, {i})", "a symmetric matrix")
    r = (r + r.T) / 2
    if np.abs(r).max() > 1 + _ROUNDING:
        i, j = np.unravel_index(int(np.argmax(np.abs(r))), r.shape)
        raise _unusable_cross(f"|r| = {abs(r[i, j]):.6g} for sensors {i} and {j}", "|r| ≤ 1 (Cauchy–Schwarz)")
    np.clip(r, -1.0, 1.0, out=r)
    np.fill_diagonal(r, 1.0)
    r += 0.0  # no negative zeros
    earlier = np.tril(np.abs(r) >= 1 - DUPLICATE_TOLERANCE, -1)
    duplicates = tuple((int(np.argmax(earlier[j])), int(j)) for j in np.flatnonzero(earlier.any(axis=1)))
    opposed = np.argwhere(np.triu(r <= ANTICORRELATED_LIMIT, 1))
    matrix = np.abs(r) if absolute else r
    matrix.setflags(write=False)
    return Similarity(
        matrix=matrix,
        constant=tuple(int(i) for i in np.flatnonzero(constant)),
        duplicates=duplicates,
        anticorrelated=tuple((int(i), int(j), float(r[i, j])) for i, j in opposed),
        absolute=absolute,
    )


def sensor_names(names: Sequence[str], n_sensors: int) -> tuple[str, ...]:
    """The names as given, or x0, x1, … when none are given.

    Raises InputError: there are more or fewer names than sensors, or two sensors share a name.
    """
    checked = tuple(names) if len(names) else tuple(f"x{i}" for i in range(n_sensors))
    if len(checked) != n_sensors or len(set(checked)) != n_sensors:
        raise InputError(
            f"{len(checked)} names ({len(set(checked))} different) for {n_sensors} sensors",
            expected="one name per sensor, all different",
            where="names of the sensors",
            advice="pass one unique name per row of the similarity matrix, or none",
        )
    return checked


def similarity_findings(similarity: Similarity, names: Sequence[str] = ()) -> tuple[Finding, ...]:
    """What a person should know before sensors are grouped: constant, duplicate, anti-correlated, missing rows."""
    label = sensor_names(names, len(similarity.matrix))
    findings: list[Finding] = []
    for i in similarity.constant:
        told = f"{label[i]} does not move: its spread is below 1e-9 of its magnitude, so it correlates with nothing "
        told += "and its similarity to every other sensor is set to 0."
        evidence: dict[str, object] = {"tolerance": CONSTANT_TOLERANCE}
        findings.append(FINDINGS.finding("constant-sensor", told, Where(channel=label[i]), evidence))
    for i, j in similarity.duplicates:
        told = f"{label[j]} repeats {label[i]} up to scale and offset (1 − |r| ≤ 1e-12); two real sensors never "
        told += "agree that well."
        evidence = {"duplicate_of": label[i], "r": float(similarity.matrix[i, j])}
        findings.append(FINDINGS.finding("duplicate-sensors", told, Where(channel=label[j]), evidence))
    count, advice = "|r| is used, so they count as alike.", "check the sign and the wiring of both"
    if not similarity.absolute:
        count = "with signed r they count as unlike, though one predicts the other."
        advice += "; use the absolute correlation if the opposite motion is real"
    for i, j, value in similarity.anticorrelated:
        told = f"{label[i]} and {label[j]} move against each other (r = {value:.4f}); {count}"
        evidence = {"other": label[i], "r": value}
        findings.append(FINDINGS.finding("anticorrelated-sensors", told, Where(channel=label[j]), evidence, advice))
    if left_out := similarity.rows_left_out:
        told = f"{left_out} of {left_out + (similarity.rows_used or 0)} rows lack at least one sensor and are left out "
        told += "when sensors are compared."
        evidence = {"left_out": left_out, "used": similarity.rows_used}
        findings.append(FINDINGS.finding("incomplete-rows", told, evidence=evidence, action="leave-out-stretch"))
    return tuple(findings)


def _unusable_cross(found: str, expected: str) -> InputError:
    return InputError(
        found,
        expected=expected,
        where="cross-products of the sensors",
        advice="build the matrix from centred readings, as XᵀX of the centred samples",
    )
