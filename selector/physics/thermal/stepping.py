"""What a time stepper is given and gives back: a body and its laws as arrays, one interval of held conditions.

Temperatures are carried as rises r = T − datum·uniform over a datum, so that rounding is relative to the changes of
temperature and not to the temperatures.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from selector.physics.thermal.eigenmodes import conductance
from selector.physics.thermal.heat_system import HeatSystem, Matrix
from selector.physics.thermal.laws import Laws
from selector.physics.thermal.lubricants import Lubricants

Vector = NDArray[np.float64]
Array = NDArray[np.float64]


@dataclass(frozen=True)
class Body:
    """A heat system with its laws, as the arrays that steppers work on.

    Attributes
    ----------
    system, laws
        What is stepped.
    datum_degc : float
        Temperature [°C] that rises are counted from.
    """

    system: HeatSystem
    laws: Laws
    datum_degc: float

    def __post_init__(self) -> None:
        system = self.system
        matrices = {"capacity": system.capacity, "conduction": system.conduction, **system.films}
        for name, matrix in matrices.items():
            if _largest(matrix - matrix.T) > 1e-9 * _largest(matrix):
                raise ValueError(f"the matrix {name!r} is not symmetric: heat would be made or lost on its way")

    @cached_property
    def rows(self) -> Array:
        """Probes, then displacements, shape (n_rows, n)."""
        rows = [*self.system.probes.values(), *self.system.displacements.values()]
        return np.array(rows, dtype=np.float64).reshape(len(rows), self.system.size)

    @cached_property
    def soft(self) -> NDArray[np.intp]:
        """Positions of the heat laws whose heat depends on temperature, shape (n_soft,)."""
        laws = self.laws.heat
        return np.array(
            [k for k, law in enumerate(laws) if law.softening_per_k > 0 and law.speed_w != 0], dtype=np.intp
        )

    @cached_property
    def lubricants(self) -> Lubricants:
        """What the soft laws' heat follows."""
        laws = [self.laws.heat[k] for k in self.soft]
        rows = [self.system.probes[law.at] for law in laws]
        at = np.array(rows, dtype=np.float64).reshape(len(rows), self.system.size)
        zero = np.array([law.softening_degc for law in laws], dtype=np.float64)
        return Lubricants(
            rows=at,
            per_k=np.array([law.softening_per_k for law in laws], dtype=np.float64),
            zero_rise=zero - at @ self.system.uniform * self.datum_degc,
        )

    @cached_property
    def heat_loads(self) -> Array:
        """Share of every state in the heat of a law, shape (n, n_heat_laws)."""
        loads = [self.system.sources[law.source] for law in self.laws.heat]
        return np.array(loads, dtype=np.float64).reshape(len(loads), self.system.size).T

    @cached_property
    def film_loads(self) -> Array:
        """a_f of the surface of every film law, shape (n, n_film_laws)."""
        loads = [self.system.film_loads[law.film] for law in self.laws.films]
        return np.array(loads, dtype=np.float64).reshape(len(loads), self.system.size).T

    @cached_property
    def film_rows(self) -> Array:
        """uniformᵀ·A_f of the surface of every film law: what integrates a temperature over it."""
        rows = [np.asarray(self.system.films[law.film].T @ self.system.uniform) for law in self.laws.films]
        return np.array(rows, dtype=np.float64).reshape(len(rows), self.system.size)

    def steady_heat_w(self, held: Interval) -> Vector:
        """Heat of every law [W] without that which depends on temperature."""
        heat = held.firm_w + held.lubricant_w
        heat[self.soft] = held.firm_w[self.soft]
        return heat

    def conductance(self, held: Interval) -> Matrix:
        """K + Σ h_f·A_f [W/K] with the film coefficients of an interval."""
        films: dict[str, float] = {}
        for law, value in zip(self.laws.films, held.film_w_per_m2_k, strict=True):
            films[law.film] = films.get(law.film, 0.0) + float(value)
        return conductance(self.system, films)


@dataclass(frozen=True)
class Interval:
    """A stretch of time in which nothing changes that the machine does.

    Attributes
    ----------
    duration_s : float
        Its length [s].
    film_w_per_m2_k, fluid_rise : ndarray of shape (n_film_laws,)
        Film coefficients [W/(m²·K)]; fluid temperatures over the datum [K].
    firm_w, lubricant_w : ndarray of shape (n_heat_laws,)
        Heat [W] that does not depend on temperature; heat of the lubricant at its reference temperature.
    """

    duration_s: float
    film_w_per_m2_k: Vector
    fluid_rise: Vector
    firm_w: Vector
    lubricant_w: Vector


@dataclass(frozen=True)
class Advance:
    """What became of a body in one interval.

    Attributes
    ----------
    rise : ndarray of shape (n,)
        States at its end.
    read : ndarray of shape (n_read, n_rows)
        `Body.rows` times the states, at the times asked for.
    kept : ndarray of shape (n_kept, n)
        States at the times asked for.
    film_k_m2_s : ndarray of shape (n_film_laws,)
        ∫ uniformᵀ·A_f·r dt over the interval, in the sense of the stepper.
    heat_j : ndarray of shape (n_heat_laws,)
        Heat put in by every law [J], in the same sense.
    """

    rise: Vector
    read: Array
    kept: Array
    film_k_m2_s: Vector
    heat_j: Vector


class Stepper(Protocol):
    """Carries a body through intervals."""

    def advance(self, rise: Vector, held: Interval, read_s: Vector, keep_s: Vector) -> Advance:
        """From the start of an interval to its end; `read_s`, `keep_s` [s] count from its start and increase."""


def _largest(matrix: Any) -> float:
    """Largest entry without its sign."""
    entries: Array = matrix.data if sparse.issparse(matrix) else matrix  # type: ignore[attr-defined]
    return float(np.max(np.abs(entries), initial=0.0))
