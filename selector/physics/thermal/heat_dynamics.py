"""A warming machine in the form that all simulations share: what it does as inputs, what is read as outputs."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from selector.physics.thermal.heat_system import HeatSystem
from selector.physics.thermal.implicit_stepper import Solve, factorised
from selector.physics.thermal.law_values import film_coefficients, fluid_degc, heat_parts, require_known_places
from selector.physics.thermal.laws import Conditions, Laws
from selector.physics.thermal.stepping import Body, Interval
from selector.physics.thermal.transient import REFERENCE_DEGC

Vector = NDArray[np.float64]

INPUTS = ("spindle_speed", "torque", "ambient_degc", "coolant_on", "coolant_degc", "machine_on")
"""Inputs in this order: [r/min], [N·m], [°C], 0 or 1, [°C], 0 or 1."""


@dataclass(frozen=True)
class HeatDynamics:
    """A heat system and its laws as a `System`, for what treats all physics alike.

    `simulate_heat` gives the same histories much sooner; this form is for linearisation, for joining with other
    physics, and as an independent check.

    Attributes
    ----------
    system, laws
        The body, and how it is heated and cooled.
    reference_degc : float
        Displacements are zero when the body has this temperature everywhere.
    """

    system: HeatSystem
    laws: Laws
    reference_degc: float = REFERENCE_DEGC
    _intervals: dict[bytes, Interval] = field(default_factory=dict, repr=False, compare=False)

    def __post_init__(self) -> None:
        require_known_places(self.laws, self.system)

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states; numbered where they have none."""
        return self.system.states or tuple(f"state {k + 1}" for k in range(self.system.size))

    @property
    def inputs(self) -> tuple[str, ...]:
        """`INPUTS`."""
        return INPUTS

    @property
    def outputs(self) -> tuple[str, ...]:
        """Probes [°C], then displacements [µm]."""
        return (*self.system.probes, *self.system.displacements)

    @property
    def places(self) -> tuple[str, ...]:
        """Named states, sources and surfaces: where heat can enter or leave."""
        return tuple(dict.fromkeys((*self.system.states, *self.system.sources, *self.system.films)))

    def derivative(self, t_s: float, x: Vector, u: Vector) -> Vector:
        """Rates [K/s] of the states at temperatures `x` [°C] under inputs `u`; `t_s` does not matter."""
        body, held = self._body, self._held(u)
        load = body.film_loads @ (held.film_w_per_m2_k * held.fluid_rise)
        heat, soft = body.steady_heat_w(held), body.soft
        heat[soft] += body.lubricants.heat_w(held.lubricant_w[soft], body.lubricants.rows @ x)
        load = load + body.heat_loads @ heat
        return self._divided_by_capacity(load - body.conductance(held) @ x)

    def output(self, t_s: float, x: Vector, u: Vector) -> Vector:
        """Probe temperatures [°C] and displacements [µm]."""
        rows = self._body.rows
        shift = np.r_[np.zeros(len(self.system.probes)), np.full(len(self.system.displacements), self.reference_degc)]
        return np.asarray(rows @ x - shift * (rows @ self.system.uniform))

    @cached_property
    def _body(self) -> Body:
        return Body(self.system, self.laws, 0.0)

    @cached_property
    def _divided_by_capacity(self) -> Solve:
        return factorised(self.system.capacity).solve

    def _held(self, u: Vector) -> Interval:
        """The laws at one set of inputs; solvers ask for the same ones many times in a row."""
        key = np.asarray(u, dtype=np.float64).tobytes()
        if key not in self._intervals:
            given = dict(zip(INPUTS, np.asarray(u, dtype=np.float64), strict=True))
            conditions = Conditions.held([0.0, 1.0], **given)
            firm, lubricant = heat_parts(self.laws, conditions)
            films, fluids = film_coefficients(self.laws, conditions), fluid_degc(self.laws, conditions)
            self._intervals.clear()
            self._intervals[key] = Interval(1.0, films[0], fluids[0], firm[0], lubricant[0])
        return self._intervals[key]
