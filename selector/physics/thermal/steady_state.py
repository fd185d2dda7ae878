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
    softening,
)
from selector.physics.thermal.laws import Conditions, Laws
from selector.physics.thermal.stepping import Body, Interval

Vector = NDArray[np.float64]


def steady_state(system: HeatSystem, laws: Laws, conditions: Conditions) -> Vector:
    """State [°C], shape (n,), in which nothing changes while the conditions stay what they are at their start.

    Raises
    ------
    InputError
        If the conditions change; if a part of the body reaches no fluid; if heat that grows with temperature finds
        no balance.
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
    without = solve(body.film_loads @ (films * held.fluid_rise) + body.heat_loads @ firm)
    if body.softens and held.heat_depends_on_temperature:
        per_watt = np.column_stack([solve(load) for load in body.heat_loads.T])
        lubricant_rise = _balance(body, held, body.lubricants @ without, body.lubricants @ per_watt)
        rise = without + per_watt @ (body.heat_w(held, lubricant_rise) - firm)
    else:
        rise = without + solve(body.heat_loads @ lubricant)
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


def _balance(body: Body, held: Interval, without: Vector, per_watt: NDArray[np.float64]) -> Vector:
    """Lubricant temperatures x (rises) with x = without + per_watt·(heat of the lubricants at x); Newton."""
    soft = np.array([law.softening_per_k for law in body.laws.heat])
    x = without.copy()
    for _ in range(200):
        with np.errstate(over="ignore", invalid="ignore"):
            heat = held.lubricant_w * softening(body.laws, x + body.datum_of_lubricants)
            gap = x - without - per_watt @ heat
            slope = np.eye(len(x)) + per_watt * (soft * heat)
        if not np.isfinite(slope).all() or not np.isfinite(gap).all():
            break
        change = np.linalg.solve(slope, -gap)
        x = x + change
        # far below what a sensor tells, far above rounding
        if np.max(np.abs(change)) <= 1e-10 * max(1.0, float(np.max(np.abs(x)))):
            return x
    raise InputError(
        "heat that grows faster with temperature than the machine can give away",
        expected="lubricants whose friction falls as they warm (softening_per_k of 0 or more)",
        where="steady state",
        advice="check softening_per_k, or simulate a limited time instead",
    )
