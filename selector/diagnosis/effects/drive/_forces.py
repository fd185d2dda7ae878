"""How forces on an axis become the shapes of a drive effect, and how a fit of them is put into words."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.effect import Fitted, Quantity, ShapeParameter, Variant
from selector.diagnosis.shapes.force_response import PLACE_ROLES, guesses, passed, responds, yields_s2
from selector.diagnosis.shapes.motion import Motion, motion
from selector.diagnosis.shapes.simulated_axis import FORCE_ROLES, simulated_axis
from selector.diagnosis.shown_units import displayed

Vector = NDArray[np.float64]

PLACES = PLACE_ROLES
YIELD = ShapeParameter("yield_s2", "s^2", 0.0, 1e-4, "compliance between drive and table times the moving mass")


_USUAL_PRESLIDING_M = 4e-6

LEADS_LOOKED_AT = 30.0
"""Of some hundreds of leads that can be told apart, what is left to chance when the highest few are offered."""


def motion_of(comparison: Comparison, response: str) -> Motion:
    """The motion of the axis that the response belongs to."""
    found = motion(comparison, comparison.channel(response).axis)
    if found is None:
        raise ValueError(f"asked for shapes in {response!r}, which no motion was recorded for")
    return found


def of_forces(
    comparison: Comparison,
    response: str,
    forces: Mapping[str, Vector],
    shape: Mapping[str, Quantity] | None = None,
    *,
    of_motor: bool = False,
    most: int | None = None,
) -> Iterator[Variant]:
    """Forces [any unit], by what they are, as shapes in the response, one for each compliance that it may have.

    The compliance is not free beside the loop: a course that only bends and moves nothing is no force. Those of the
    motor bend nothing. `most` limits how many compliances are tried.
    """
    sources = motion_of(comparison, response).sources
    looked_at = _looked_at(shape)
    for guess in (None, *guesses(comparison, response)):
        for yield_s2 in (0.0,) if of_motor else yields_s2(comparison, response)[:most]:
            parts = {
                what: passed(comparison, response, force, yield_s2=yield_s2, guess=guess)
                for what, force in forces.items()
            }
            columns = np.column_stack([course for course, _ in parts.values()])
            names = tuple(f"{what}, {how}" for what, (_, how) in parts.items())
            own = {"yield_s2": Quantity(yield_s2, "s^2")} if yield_s2 > 0.0 else {}
            yield Variant(columns, names, dict(shape or {}) | own, sources=sources, looked_at=looked_at)


def direct(
    comparison: Comparison, response: str, columns: Mapping[str, Vector], shape: Mapping[str, Quantity] | None = None
) -> Variant:
    """Courses that stand in the response as they are."""
    sources = motion_of(comparison, response).sources
    stacked = np.column_stack(list(columns.values()))
    return Variant(stacked, tuple(columns), dict(shape or {}), sources=sources, looked_at=_looked_at(shape))


def _looked_at(shape: Mapping[str, Quantity] | None) -> float:
    return LEADS_LOOKED_AT if shape and "lead_mm" in shape else 1.0


def any_response(comparison: Comparison, response: str) -> str | None:
    """None if a force on an axis can be seen here."""
    return responds(comparison, response)


def reverses(comparison: Comparison, response: str) -> str | None:
    """None if a force can be seen here and the axis goes both ways."""
    lacking = responds(comparison, response)
    if lacking is not None:
        return lacking
    sense = motion_of(comparison, response).sense
    if not (np.any(sense > 0.0) and np.any(sense < 0.0)):
        return "the axis moves one way only, where dry friction is a constant"
    return None


def place_only(comparison: Comparison, response: str) -> str | None:
    """None if the response is a displacement or position of an axis that moves."""
    lacking = responds(comparison, response)
    if lacking is None and comparison.channel(response).role not in PLACES:
        return f"{response} is no displacement or position, and it does not show elsewhere"
    return lacking


def presliding_m(comparison: Comparison, response: str) -> float:
    """Way within which dry friction turns over: that of the simulation's own, else a usual one [m]."""
    told = simulated_axis(comparison, comparison.channel(response).axis)
    return told.presliding_m if told is not None and told.dry_m_per_s2 > 0.0 else _USUAL_PRESLIDING_M


def centred_place(moving: Motion) -> Vector:
    """Position from the middle of the way that was travelled, −1…1 over it; 0 if there is none."""
    low, high = float(moving.position_m.min()), float(moving.position_m.max())
    if high <= low:
        return np.zeros(len(moving.position_m))
    return np.asarray((2.0 * moving.position_m - low - high) / (high - low))


def coefficient(fitted: Fitted, column: int, unit: str | None = None, factor: float = 1.0) -> Quantity:
    """A fitted coefficient with its 95 % interval, times a factor, in this unit (None: of the response)."""
    value, half = (
        factor * float(fitted.coefficients[column]),
        1.96 * abs(factor * float(fitted.standard_errors[column])),
    )
    return Quantity(value, fitted.unit if unit is None else unit, value - half, value + half)


def shape_quantity(fitted: Fitted, name: str) -> Quantity:
    """A shape parameter with the interval of its profile."""
    found = fitted.variant.shape[name]
    low, high = fitted.shape_intervals.get(name, (found.low, found.high))
    return Quantity(found.value, found.unit, low, high)


def size_of(fitted: Fitted) -> str:
    """How large the effect's course is, in words."""
    factor, unit = displayed(fitted.unit, fitted.largest)
    rms, largest = _number(factor * fitted.rms), _number(factor * fitted.largest)
    return f"{rms} {unit} rms and up to {largest} {unit} in {fitted.response}"


def with_interval(quantity: Quantity, *, amount: bool = False) -> str:
    """Value, interval and unit in words; with `amount` without its sign."""
    factor, unit = displayed(quantity.unit, quantity.value)
    value = factor * (abs(quantity.value) if amount else quantity.value)
    unit = f" {unit}" if unit else ""
    if quantity.low is None or quantity.high is None:
        return f"{_number(value)}{unit}"
    low, high = factor * quantity.low, factor * quantity.high
    if amount and quantity.value < 0.0:
        low, high = -high, -low
    return f"{_number(value)} ({_number(low)} to {_number(high)}){unit}"


def is_force(fitted: Fitted, comparison: Comparison) -> bool:
    """Whether the fitted response is a force, current or voltage: its first coefficient then is a force in its unit."""
    return comparison.channel(fitted.response).role in FORCE_ROLES


def key_of(fitted: Fitted) -> str:
    """Name of a parameter that is a force in the unit of the response."""
    return {"N": "force_n", "A": "current_a", "V": "voltage_v"}.get(fitted.unit, "amount")


def _number(value: float) -> str:
    return f"{value:.3g}"
