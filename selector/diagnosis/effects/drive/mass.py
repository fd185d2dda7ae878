"""Moving mass or inertia that is not what the simulation has."""

from __future__ import annotations

from collections.abc import Iterator

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.drive._forces import (
    YIELD,
    any_response,
    coefficient,
    is_force,
    motion_of,
    of_forces,
    size_of,
    with_interval,
)
from selector.diagnosis.effects.effect import Effect, Fitted, Quantity, Reading, ShapeParameter, Variant


def _variants(comparison: Comparison, response: str) -> Iterator[Variant]:
    if any_response(comparison, response) is not None:
        return
    yield from of_forces(
        comparison, response, {"force of inertia": motion_of(comparison, response).acceleration_m_per_s2}
    )


def _reading(fitted: Fitted, comparison: Comparison) -> Reading:
    if is_force(fitted, comparison):
        if fitted.unit == "N":
            mass = coefficient(fitted, 0, "kg")
            text = f"{with_interval(mass, amount=True)} {'more' if mass.value > 0.0 else 'less'}"
            return Reading(f"The axis moves {text} than in the simulation ({size_of(fitted)}).", {"mass_kg": mass})
        slope = coefficient(fitted, 0, f"{fitted.unit}*s^2/m")
        return Reading(
            f"The inertia of the axis asks for {with_interval(slope, amount=True)} "
            f"{'more' if slope.value > 0.0 else 'less'} than in the simulation ({size_of(fitted)}).",
            {"inertia": slope},
        )
    return Reading(
        f"While it speeds up and slows down the axis is off by what another moving mass makes: {size_of(fitted)}.",
        {"largest": Quantity(fitted.largest, fitted.unit)},
    )


EFFECT = Effect(
    id="drive.mass",
    title="Wrong inertia",
    physics="Table, workpiece, screw and motor weigh more or less than the simulation has. Force or current differs in "
    "proportion to acceleration, and at constant speed not at all.",
    reference="A. Janot, M. Gautier, M. Brunot (2019), Data set and reference models of EMPS, Workshop on Nonlinear "
    "System "
    "Identification Benchmarks (inverse dynamic model)",
    enters="force",
    acts_at="table or motor of an axis",
    parameters=(
        ShapeParameter("mass_kg", "kg (A or V per m/s² where these are compared)", -1e5, 1e5, "what is missing"),
        YIELD,
    ),
    needs="current, force, voltage or position error of an axis that speeds up and slows down",
    # in a displacement the wind-up by inertia is the same course
    confounders=("drive.elasticity", "drive.delay", "drive.saturation", "drive.varying_damping"),
    refuted_by="Ramps of different acceleration whose force differs from the simulation by the same amount.",
    experiment="Move 100 mm to and fro with 20, 50 and 100 % of the largest acceleration, at the same speed, with "
    "the table "
    "empty and with a known weight on it.",
    variants=_variants,
    testable=any_response,
    reading=_reading,
)
