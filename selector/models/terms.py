"""Terms of a polynomial, and the centring and scaling in which they are fitted."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from selector.errors import OptionError

MAX_DEGREE = 3


@dataclass(frozen=True)
class Term:
    """A product of powers of variables, e.g. T1·T3 or T1²."""

    powers: tuple[tuple[str, int], ...]  #: Variable and exponent (≥ 1), in the order of the variables in their model

    @classmethod
    def of(cls, powers: Mapping[str, int]) -> Term:
        """The term with these exponents."""
        return cls(tuple(powers.items()))

    @property
    def variables(self) -> tuple[str, ...]:
        """Names of the factors."""
        return tuple(name for name, _ in self.powers)

    @property
    def degree(self) -> int:
        """Sum of the exponents."""
        return sum(power for _, power in self.powers)

    def __str__(self) -> str:
        return "·".join(name if power == 1 else f"{name}^{power}" for name, power in self.powers)


@dataclass(frozen=True)
class Form:
    """Which terms a set of variables brings with it."""

    degree: int = 1  #: Highest power of one variable, 1 to 3
    interactions: bool = False  #: Whether products of different variables come too, up to total degree max(2, degree)

    def __post_init__(self) -> None:
        if not 1 <= self.degree <= MAX_DEGREE:
            raise OptionError(
                f"degree {self.degree}",
                expected=f"1 to {MAX_DEGREE}",
                where="--degree",
                advice="use 1, 2 or 3; higher powers extrapolate wildly outside the recorded temperatures",
            )

    def terms(self, variables: Sequence[str]) -> tuple[Term, ...]:
        """Every term of this form: hierarchical, so no product stands without its factors."""
        return polynomial_terms(variables, self.degree, interactions=self.interactions)

    def simpler(self) -> tuple[Form, ...]:
        """All forms nested in it, the simplest first, and itself."""
        forms = [Form(degree, mixed) for degree in range(1, self.degree + 1) for mixed in (False, True)]
        return tuple(form for form in forms if self.interactions or not form.interactions)

    def __str__(self) -> str:
        shape = ("linear", "quadratic", "cubic")[self.degree - 1]
        return f"{shape} with products" if self.interactions else shape


def polynomial_terms(variables: Sequence[str], degree: int, *, interactions: bool = False) -> tuple[Term, ...]:
    """Terms in `variables` up to `degree`, ordered by total degree, then by the order of the variables.

    >>> [str(term) for term in polynomial_terms(["T1", "T3"], 2, interactions=True)]
    ['T1', 'T3', 'T1^2', 'T1·T3', 'T3^2']
    """
    total = max(2, degree) if interactions else degree
    terms = []
    for order in range(1, total + 1):
        for combination in itertools.combinations_with_replacement(variables, order):
            powers = {name: combination.count(name) for name in dict.fromkeys(combination)}
            if max(powers.values()) > degree or (len(powers) > 1 and not interactions):
                continue
            terms.append(Term.of(powers))
    return tuple(terms)


@dataclass(frozen=True)
class Scaling:
    """z = (x − centre) / scale for each variable.

    Raw temperatures in a polynomial are hopelessly collinear (degree 4 in °C: condition number 1e9); every fit of
    this package is made in z and converted back only for people.
    """

    variables: tuple[str, ...]
    centre: tuple[float, ...]
    scale: tuple[float, ...]

    def scaled(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Z for samples x of shape (n_samples, n_variables)."""
        return (values - np.asarray(self.centre)) / np.asarray(self.scale)

    def only(self, variables: Iterable[str]) -> Scaling:
        """The scaling of some of the variables, in the order given."""
        wanted = tuple(variables)
        position = {name: i for i, name in enumerate(self.variables)}
        return Scaling(
            wanted,
            tuple(self.centre[position[name]] for name in wanted),
            tuple(self.scale[position[name]] for name in wanted),
        )


def design_matrix(scaled: NDArray[np.float64], variables: Sequence[str], terms: Sequence[Term]) -> NDArray[np.float64]:
    """One column per term, shape (n_samples, n_terms), without the intercept.

    `variables` names the columns of `scaled`, shape (n_samples, n_variables), which are centred and scaled.
    """
    position = {name: i for i, name in enumerate(variables)}
    columns = np.empty((len(scaled), len(terms)), order="F")
    made: dict[tuple[tuple[str, int], ...], int] = {}
    for j, term in enumerate(terms):
        name, power = term.powers[-1]
        rest = term.powers[:-1] + (((name, power - 1),) if power > 1 else ())
        factor = scaled[:, position[name]]
        # a hierarchical list holds every shorter product already
        columns[:, j] = factor if not rest else factor * _product(rest, made, columns, scaled, position)
        made[term.powers] = j
    return columns


def _product(
    powers: tuple[tuple[str, int], ...],
    made: Mapping[tuple[tuple[str, int], ...], int],
    columns: NDArray[np.float64],
    scaled: NDArray[np.float64],
    position: Mapping[str, int],
) -> NDArray[np.float64]:
    if powers in made:
        return columns[:, made[powers]]
    product = np.ones(len(scaled))
    for name, power in powers:
        product = product * scaled[:, position[name]] ** power
    return product


def physical_transform(terms: Sequence[Term], scaling: Scaling) -> tuple[tuple[Term, ...], NDArray[np.float64]]:
    """How coefficients of z become coefficients of x.

    Expanding Π((x − c)/s)^p gives every product of lower powers, so for a hierarchical list of terms the expansion
    needs no new ones; for others the missing ones are added.

    Returns
    -------
    terms : tuple of Term
        Terms in x: those given, then any that the expansion adds.
    matrix : ndarray of shape (1 + n_terms_x, 1 + n_terms_z)
        Maps (intercept, coefficients of z) to (intercept, coefficients of x).
    """
    centre = dict(zip(scaling.variables, scaling.centre, strict=True))
    scale = dict(zip(scaling.variables, scaling.scale, strict=True))
    out: dict[tuple[tuple[str, int], ...], int] = {(): 0}
    for term in terms:
        out[tuple(sorted(term.powers))] = len(out)
    expansions: list[dict[tuple[tuple[str, int], ...], float]] = []
    for term in terms:
        expansion: dict[tuple[tuple[str, int], ...], float] = {(): 1.0}
        for name, power in term.powers:
            binomial = np.polynomial.polynomial.polypow([-centre[name] / scale[name], 1.0 / scale[name]], power)
            expansion = {
                tuple(sorted((*key, (name, k)))) if k else key: value * float(factor)
                for key, value in expansion.items()
                for k, factor in enumerate(binomial)
            }
        expansions.append(expansion)
        for key in expansion:
            out.setdefault(key, len(out))
    matrix = np.zeros((len(out), 1 + len(terms)))
    matrix[0, 0] = 1.0
    for j, expansion in enumerate(expansions, start=1):
        for key, value in expansion.items():
            matrix[out[key], j] += value
    given = {tuple(sorted(term.powers)): term for term in terms}
    return tuple(given.get(key, Term(key)) for key in out if key), matrix
