"""NIST's linear reference sets: data, certified values, exact solutions, and how many digits of them we match.

`python -m tests.reference.strd` prints the tables of docs/explanation/numerical-accuracy.md.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal, localcontext
from fractions import Fraction
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from selector.models.design import Scaling, Term, design_matrix
from selector.models.least_squares import FittedModel, fit
from selector.models.moments import coefficients

FOLDER = Path(__file__).with_name("nist")
NAMES = (
    *("Norris", "Pontius", "NoInt1", "NoInt2", "Filip", "Longley"),
    *("Wampler1", "Wampler2", "Wampler3", "Wampler4", "Wampler5"),
)
MOST_DIGITS = 15.0
"""NIST prints 15 digits, so no more can be matched."""


@dataclass(frozen=True)
class Solution:
    """Coefficients, classical standard errors, residual standard deviation and R² of a least-squares fit."""

    coefficients: tuple[Fraction, ...]
    standard_errors: tuple[Decimal, ...]
    residual_sd: Decimal
    r2: Fraction


@dataclass(frozen=True)
class ReferenceSet:
    """One data set in decimal, as printed, with the values that NIST certifies."""

    name: str
    difficulty: str
    degree: int
    intercept: bool
    rows: tuple[tuple[Fraction, ...], ...]
    certified: dict[str, tuple[Fraction, ...]]

    @classmethod
    def read(cls, name: str) -> ReferenceSet:
        text = (FOLDER / f"{name.lower()}.toml").read_text(encoding="utf-8")
        document = tomllib.loads(text, parse_float=Decimal)
        certified = {
            key: tuple(Fraction(v) for v in (value if isinstance(value, list) else [value]))
            for key, value in document["certified"].items()
        }
        rows = tuple(tuple(Fraction(v) for v in row) for row in document["observed"]["rows"])
        return cls(document["name"], document["difficulty"], document["degree"], document["intercept"], rows, certified)

    @property
    def variables(self) -> tuple[str, ...]:
        return tuple(f"x{i + 1}" for i in range(len(self.rows[0]) - 1))

    @property
    def terms(self) -> tuple[Term, ...]:
        return tuple(Term(((name, power),)) for name in self.variables for power in range(1, self.degree + 1))

    @cached_property
    def x(self) -> NDArray[np.float64]:
        return np.array([[float(v) for v in row[1:]] for row in self.rows])

    @cached_property
    def y(self) -> NDArray[np.float64]:
        return np.array([float(row[0]) for row in self.rows])

    @cached_property
    def exact(self) -> Solution:
        """The solution of the decimal data in rational arithmetic."""
        return self.solved(self.rows)

    @cached_property
    def exact_of_rounded(self) -> Solution:
        """The solution of the data rounded to 64 bits: no program that reads floats can do better."""
        return self.solved(tuple(tuple(Fraction(float(v)) for v in row) for row in self.rows))

    def solved(self, rows: Sequence[Sequence[Fraction]]) -> Solution:
        design = [self._columns(row) for row in rows]
        y = [row[0] for row in rows]
        k, n = len(design[0]), len(rows)
        columns = list(zip(*design, strict=True))
        augmented = [
            [_dot(columns[i], columns[j]) for j in range(k)]
            + [_dot(columns[i], y)]
            + [Fraction(int(i == j)) for j in range(k)]
            for i in range(k)
        ]
        solved = _eliminated(augmented)
        beta = tuple(row[k] for row in solved)
        residuals = [value - _dot(beta, row) for value, row in zip(y, design, strict=True)]
        rss = _dot(residuals, residuals)
        mean = sum(y, Fraction(0)) / n if self.intercept else Fraction(0)
        total = sum(((value - mean) ** 2 for value in y), Fraction(0))
        variance = rss / (n - k)
        errors = tuple(_root(variance * solved[i][k + 1 + i]) for i in range(k))
        return Solution(beta, errors, _root(variance), 1 - rss / total)

    def _columns(self, row: Sequence[Fraction]) -> list[Fraction]:
        constant = [Fraction(1)] if self.intercept else []
        return constant + [value**power for value in row[1:] for power in range(1, self.degree + 1)]

    @cached_property
    def scaling(self) -> Scaling:
        """Centred and scaled as `selector` does it; without an intercept a centre would bring one in."""
        centre = self.x.mean(axis=0) if self.intercept else np.zeros(self.x.shape[1])
        return Scaling(self.variables, tuple(map(float, centre)), tuple(map(float, self.x.std(axis=0))))

    @cached_property
    def model(self) -> FittedModel:
        return fit(
            self.x, self.y, scaling=self.scaling, terms=self.terms, name=self.name, intercept=self.intercept
        )  # fmt: skip

    @cached_property
    def exact_scaled(self) -> tuple[Fraction, ...]:
        """Exact coefficients in z = (x − centre)/scale, intercept first."""
        beta = list(self.exact.coefficients) if self.intercept else [Fraction(0), *self.exact.coefficients]
        centre = [Fraction(c) for c in self.scaling.centre]
        scale = [Fraction(s) for s in self.scaling.scale]
        scaled = [beta[0]] + [Fraction(0)] * (len(beta) - 1)
        for v in range(len(centre)):
            for power in range(1, self.degree + 1):
                b = beta[1 + v * self.degree + power - 1]
                for j in range(power + 1):
                    part = b * math.comb(power, j) * centre[v] ** (power - j) * scale[v] ** j
                    scaled[0 if j == 0 else 1 + v * self.degree + j - 1] += part
        return tuple(scaled if self.intercept else scaled[1:])

    @cached_property
    def exact_predictions(self) -> tuple[Fraction, ...]:
        return tuple(_dot(self.exact.coefficients, self._columns(row)) for row in self.rows)


def matching_digits(value: float, reference: Fraction | Decimal) -> float:
    """−log10 of the relative error (of the absolute error when the reference is 0), at most `MOST_DIGITS`."""
    truth = Fraction(reference)
    error = abs(Fraction(value) - truth)
    if truth:
        error /= abs(truth)
    return min(MOST_DIGITS, -_log10(error)) if error else MOST_DIGITS


def fewest_digits(values: Sequence[float], references: Sequence[Fraction | Decimal]) -> float:
    """The worst of several."""
    return min(matching_digits(float(v), r) for v, r in zip(values, references, strict=True))


@dataclass(frozen=True)
class Digits:
    """Matching digits of one set; the worst over coefficients and samples."""

    scaled: float
    physical: float
    standard_errors: float
    residual_sd: float
    r2: float
    cross_products: float


def measured(one: ReferenceSet) -> Digits:
    """What our fit reaches, in z and converted back to x, and what the cross-products of a selection reach."""
    model = one.model
    first = 0 if one.intercept else 1
    _, physical, errors = model.physical(robust=False)
    return Digits(
        scaled=fewest_digits(model.coefficients[first:], one.exact_scaled),
        physical=fewest_digits(physical[first:], one.certified["coefficients"]),
        standard_errors=fewest_digits(errors[first:], one.certified["standard_errors"]),
        residual_sd=matching_digits(model.residual_sd_um, one.certified["residual_sd"][0]),
        r2=matching_digits(model.r2, one.certified["r2"][0]),
        cross_products=_from_cross_products(one),
    )


def _from_cross_products(one: ReferenceSet) -> float:
    """Digits in z of a fit that sees sums of products only; these always hold a constant."""
    if not one.intercept:
        return math.nan
    columns = design_matrix(one.scaling.scaled(one.x), one.variables, one.terms)
    rows = np.column_stack([np.ones(len(columns)), columns, one.y])
    k = columns.shape[1]
    return fewest_digits(coefficients(rows.T @ rows, range(1, 1 + k), [1 + k])[:, 0].tolist(), one.exact_scaled)


def raw_digits(one: ReferenceSet) -> tuple[float, float]:
    """What common ways reach on the raw columns 1, x, x², …: QR, and the normal equations."""
    columns = design_matrix(one.x, one.variables, one.terms)
    design = np.column_stack([np.ones(len(columns)), columns]) if one.intercept else columns
    basis, triangle = np.linalg.qr(design)
    by_qr = np.linalg.solve(triangle, basis.T @ one.y)
    try:
        by_normal_equations = np.linalg.solve(design.T @ design, design.T @ one.y)
    except np.linalg.LinAlgError:
        by_normal_equations = np.zeros(design.shape[1])
    certified = one.certified["coefficients"]
    return max(0.0, fewest_digits(by_qr, certified)), max(0.0, fewest_digits(by_normal_equations, certified))


def single_precision_digits(one: ReferenceSet) -> tuple[float, float]:
    """Digits of the predictions when a control evaluates in 32 bits: the form in z, and the form in x.

    Relative to the spread of the response; the coefficients come from the same fit.
    """
    spread = float(one.y.std())
    truth = np.array([float(v) for v in one.exact_predictions])
    _, physical, _ = one.model.physical()
    found = []
    for variables, beta in ((one.scaling.scaled(one.x), one.model.coefficients), (one.x, physical)):
        columns = np.column_stack([np.ones(len(variables)), _powers_32(variables, one.degree)]).astype(np.float32)
        total = np.zeros(len(columns), dtype=np.float32)
        for column, b in zip(columns.T, beta.astype(np.float32), strict=True):
            total += column * b
        error = max(float(np.abs(total - truth).max()) / spread, 2.0**-24)
        found.append(max(0.0, -math.log10(error)))
    return found[0], found[1]


def _powers_32(variables: NDArray[np.float64], degree: int) -> NDArray[np.float32]:
    single = variables.astype(np.float32)
    return np.column_stack(
        [single[:, j] ** np.float32(p) for j in range(single.shape[1]) for p in range(1, degree + 1)]
    )


def _dot(a: Sequence[Fraction], b: Sequence[Fraction]) -> Fraction:
    return sum((p * q for p, q in zip(a, b, strict=True)), Fraction(0))


def _eliminated(matrix: list[list[Fraction]]) -> list[list[Fraction]]:
    """Gauss–Jordan on [A | B]: [1 | A⁻¹B]."""
    rows = [row[:] for row in matrix]
    for i in range(len(rows)):
        pivot = next(r for r in range(i, len(rows)) if rows[r][i])
        rows[i], rows[pivot] = rows[pivot], rows[i]
        rows[i] = [value / rows[i][i] for value in rows[i]]
        for r in range(len(rows)):
            if r != i and rows[r][i]:
                factor = rows[r][i]
                rows[r] = [a - factor * b for a, b in zip(rows[r], rows[i], strict=True)]
    return rows


def _root(square: Fraction) -> Decimal:
    with localcontext() as context:
        context.prec = 40
        return (Decimal(square.numerator) / Decimal(square.denominator)).sqrt()


def _log10(value: Fraction) -> float:
    return math.log10(value.numerator) - math.log10(value.denominator)


def our_table() -> str:
    """What we match, in Markdown."""
    lines = ["| set | difficulty | in z | in x | standard errors | residual sd | R² | cross-products, in z |"]
    lines.append("|---|---|---:|---:|---:|---:|---:|---:|")
    for name in NAMES:
        one = ReferenceSet.read(name)
        cells = ["–" if math.isnan(value) else f"{value:.1f}" for value in vars(measured(one)).values()]
        lines.append(f"| {' | '.join([name, one.difficulty, *cells])} |")
    return "\n".join(lines)


def other_table() -> str:
    """What other ways match, and what limits everybody, in Markdown."""
    lines = ["| set | raw x, QR | raw x, normal equations | exact, from rounded data | 32 bits, in z | 32 bits, in x |"]
    lines.append("|---|---:|---:|---:|---:|---:|")
    for name in NAMES:
        one = ReferenceSet.read(name)
        values = (*raw_digits(one), rounding_digits(one), *single_precision_digits(one))
        lines.append(f"| {' | '.join([name, *(f'{value:.1f}' for value in values)])} |")
    return "\n".join(lines)


def rounding_digits(one: ReferenceSet) -> float:
    """Digits that survive when the decimal data are rounded to 64 bits and all else is exact."""
    pairs = zip(one.exact_of_rounded.coefficients, one.exact.coefficients, strict=True)
    errors = [abs(rounded - exact) / abs(exact) for rounded, exact in pairs]
    worst = max(errors)
    return min(MOST_DIGITS, -_log10(worst)) if worst else MOST_DIGITS


if __name__ == "__main__":
    print(our_table(), other_table(), sep="\n\n")
