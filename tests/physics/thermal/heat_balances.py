"""What a heat system does at one moment and in the end, without the steppers of the product."""

from __future__ import annotations

import numpy as np

from selector.physics.thermal.network.heat_system import (
    Conditions,
    HeatSystem,
    Laws,
    film_coefficients,
    fluid_degc,
    heat_parts,
    solver_of,
)
from selector.physics.thermal.network.transient import _Body, _Interval


def rates(system: HeatSystem, laws: Laws, conditions: Conditions, x):
    """Rates [K/s] of the states at temperatures `x` [°C] under the first of the conditions."""
    firm, lubricant = (part[0] for part in heat_parts(laws, conditions))
    flow = -system.conduction @ x
    for law, watt, nominal in zip(laws.heat, firm, lubricant, strict=True):
        warmer = system.probes[law.at] @ x - law.softening_degc if law.softening_per_k else 0.0
        flow = flow + system.sources[law.source] * (watt + nominal * np.exp(-law.softening_per_k * warmer))
    films, fluids = film_coefficients(laws, conditions)[0], fluid_degc(laws, conditions)[0]
    for law, coefficient, fluid in zip(laws.films, films, fluids, strict=True):
        flow = flow + coefficient * (system.film_loads[law.film] * fluid - system.films[law.film] @ x)
    return np.linalg.solve(system.capacity, flow)


def steady_state(system: HeatSystem, laws: Laws, conditions: Conditions):
    """State [°C], shape (n,), in which nothing changes while the conditions stay what they are at their start."""
    columns = (film_coefficients(laws, conditions), fluid_degc(laws, conditions), *heat_parts(laws, conditions))
    films, fluids, firm, lubricant = (values[0] for values in columns)
    datum = float(np.mean(fluids))
    body = _Body(system, laws, datum)
    held = _Interval(0.0, films, fluids - datum, firm, lubricant)
    solve = solver_of(body.conductance(held)).solve
    soft = body.soft
    rise = solve(body.film_loads @ (films * held.fluid_rise) + body.heat_loads @ body.steady_heat_w(held))
    if len(soft):
        per_watt = np.column_stack([solve(load) for load in body.heat_loads[:, soft].T])
        rows = body.lubricants.rows
        rise = rise + per_watt @ body.lubricants.settled_heat_w(lubricant[soft], rows @ rise, rows @ per_watt)
    return rise + datum * system.uniform
