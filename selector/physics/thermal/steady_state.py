"""Which temperatures a machine settles at when nothing changes any more."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from selector.errors import InputError
from selector.physics.thermal.heat_system import HeatSystem
from selector.physics.thermal.implicit_stepper import factorised
from selector.physics.thermal.law_values import (
    film_coefficients,
    fluid_degc,
    heat_parts,
    require_known_places,
)
from selector.physics.thermal.laws import Conditions, Laws
from selector.physics.thermal.stepping import Body, Interval

Vector = NDArray[np.float64]


def steady_state(system: HeatSystem, laws: Laws, conditions: Conditions) -> Vector:
    """State [°C], shape (n,), in which nothing changes while the conditions stay what they are at their start.

    Raises
    ------
    InputError
        If the conditions change; if a part of the body reaches no fluid.
    """
    require_known_places(laws, system)
    columns = (film_coefficients(laws, conditions), fluid_degc(laws, conditions), *heat_parts(laws, conditions))
    if any((values[:-1] != values[0]).any() for values in columns):
        raise InputError(
            "conditions that change",
            expected="conditions that stay the same",
            where="steady state",
            advice="ask for the steady state of one speed, one hall temperature, one state of the coolant",
        )
    films, fluids, firm, lubricant = (values[0] for values in columns)
    datum = float(np.mean(fluids)) if len(fluids) else 0.0
    body = Body(system, laws, datum)
    held = Interval(0.0, films, fluids - datum, firm, lubricant)
    _require_a_way_to_a_fluid(body, held)
    solve = factorised(body.conductance(held)).solve
    soft = body.soft
    rise = solve(body.film_loads @ (films * held.fluid_rise) + body.heat_loads @ body.steady_heat_w(held))
    if len(soft):
        per_watt = np.column_stack([solve(load) for load in body.heat_loads[:, soft].T])
        rows = body.lubricants.rows
        rise = rise + per_watt @ body.lubricants.settled_heat_w(lubricant[soft], rows @ rise, rows @ per_watt)
    return np.asarray(rise + datum * system.uniform)


def states_without_fluid(system: HeatSystem, film_w_per_m2_k: dict[str, float]) -> NDArray[np.intp]:
    """Indices of the states from which no heat can reach a fluid, at given film coefficients."""
    pattern = sparse.csr_array(system.conduction)
    reach = np.zeros(system.size)
    for name, value in film_w_per_m2_k.items():
        if value > 0:
            pattern = pattern + sparse.csr_array(system.films[name])
            reach += value * system.uniform * (system.films[name] @ system.uniform)
    parts, label = sparse.csgraph.connected_components(abs(pattern) > 0, directed=False)
    cut_off = np.bincount(label, weights=reach, minlength=parts) <= 1e-14 * max(float(reach.sum()), 1e-300)
    return np.flatnonzero(cut_off[label])


def _require_a_way_to_a_fluid(body: Body, held: Interval) -> None:
    system = body.system
    films: dict[str, float] = {}
    for law, value in zip(body.laws.films, held.film_w_per_m2_k, strict=True):
        films[law.film] = films.get(law.film, 0.0) + float(value)
    lost = states_without_fluid(system, films)
    if len(lost):
        names = [system.states[k] for k in lost] if system.states else [f"{len(lost)} of {system.size} states"]
        raise InputError(
            "no way for heat to reach a fluid from " + ", ".join(names[:8]) + (" …" if len(names) > 8 else ""),
            expected="a film with a coefficient above 0 on every connected part",
            where="steady state",
            advice="such a part warms for ever: add convection or a link, or simulate a limited time instead",
        )
