"""How much heat and which film coefficients the laws of a machine give under given conditions."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from selector.errors import InputError
from selector.physics.thermal.heat_system import HeatSystem
from selector.physics.thermal.laws import Conditions, FilmLaw, HeatLaw, Laws

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


def film_coefficients(laws: Laws, conditions: Conditions) -> Matrix:
    """Film coefficients [W/(m²·K)], shape (n_samples, n_film_laws), in the order of `laws.films`."""
    columns = [
        (law.still_w_per_m2_k + law.speed_w_per_m2_k * _power_of_speed(conditions, law))
        * (conditions.coolant_on if law.while_coolant else 1.0)
        for law in laws.films
    ]
    return _table(columns, len(conditions.time_s))


def fluid_degc(laws: Laws, conditions: Conditions) -> Matrix:
    """Temperatures [°C] of the fluids, shape (n_samples, n_film_laws), in the order of `laws.films`."""
    fluids = {"ambient": conditions.ambient_degc, "coolant": conditions.coolant_degc}
    columns = [fluids.get(law.fluid, np.full(len(conditions.time_s), law.fixed_degc)) for law in laws.films]
    return _table(columns, len(conditions.time_s))


def heat_parts(laws: Laws, conditions: Conditions) -> tuple[Matrix, Matrix]:
    """Heat [W] that does not depend on temperature, and the lubricant's at its reference temperature.

    Both of shape (n_samples, n_heat_laws), in the order of `laws.heat`.
    """
    turns_per_s = np.abs(conditions.spindle_speed) / 60.0
    firm = [
        law.on_w * conditions.machine_on
        + law.turning_w * (turns_per_s > 0)
        + law.coolant_w * conditions.coolant_on
        + law.torque_share * np.abs(conditions.torque) * 2.0 * np.pi * turns_per_s
        for law in laws.heat
    ]
    lubricant = [law.speed_w * _power_of_speed(conditions, law) for law in laws.heat]
    return _table(firm, len(turns_per_s)), _table(lubricant, len(turns_per_s))


def heat_w(laws: Laws, conditions: Conditions, readings: Mapping[str, Vector] | None = None) -> Matrix:
    """Heat [W] of every law, shape (n_samples, n_heat_laws).

    Parameters
    ----------
    laws, conditions
        What the machine does, and how it heats.
    readings : mapping of str to ndarray of shape (n_samples,)
        Temperatures [°C] at the probes that lubricants follow (`HeatLaw.at`); needed for those only.

    Raises
    ------
    InputError
        If a law names a probe that has no readings.
    """
    firm, lubricant = heat_parts(laws, conditions)
    for column, law in enumerate(laws.heat):
        if law.softening_per_k != 0.0:
            if law.at not in (readings or {}):
                raise _unknown("probe", law.at, tuple(readings or {}), f"the law of the source {law.source!r}")
            at_degc = np.asarray((readings or {})[law.at])
            lubricant[:, column] *= np.exp(-law.softening_per_k * (at_degc - law.softening_degc))
    return firm + lubricant


def require_known_places(laws: Laws, system: HeatSystem) -> None:
    """Refuse laws of sources, films, fluids and probes that do not exist, and film coefficients below zero.

    Raises
    ------
    InputError
        With the name that is unknown and those that are known.
    """
    for heat in laws.heat:
        where = f"the law of the source {heat.source!r}"
        if heat.source not in system.sources:
            raise _unknown("source", heat.source, tuple(system.sources), where)
        if heat.softening_per_k != 0.0 and heat.at not in system.probes:
            raise _unknown("probe", heat.at, tuple(system.probes), where)
        _require_finite(heat, where)
        if heat.softening_per_k < 0:
            raise InputError(
                f"softening_per_k = {heat.softening_per_k:g}",
                expected="0 or more",
                where=where,
                advice="friction falls as a lubricant warms: write the coefficient without a sign",
            )
    for film in laws.films:
        where = f"the law of the surface {film.film!r}"
        if film.film not in system.films:
            raise _unknown("surface", film.film, tuple(system.films), where)
        if film.fluid not in ("ambient", "coolant", "fixed"):
            raise _unknown("fluid", film.fluid, ("ambient", "coolant", "fixed"), where)
        _require_finite(film, where)
        if film.still_w_per_m2_k < 0 or film.speed_w_per_m2_k < 0:
            raise InputError(
                f"a film coefficient of {min(film.still_w_per_m2_k, film.speed_w_per_m2_k):g} W/(m²·K)",
                expected="0 or more",
                where=where,
                advice="a warm surface gives heat to a cool fluid: write the coefficient without a sign",
            )


def _require_finite(law: HeatLaw | FilmLaw, where: str) -> None:
    for name, value in vars(law).items():
        if isinstance(value, float | int) and not np.isfinite(value):
            raise InputError(f"{name} = {value}", expected="a number", where=where, advice="correct the law")
    if law.reference_rpm <= 0 or law.exponent < 0:
        raise InputError(
            f"reference_rpm = {law.reference_rpm:g}, exponent = {law.exponent:g}",
            expected="a reference speed above 0 and an exponent of 0 or more",
            where=where,
            advice="give the speed at which the law has the stated heat or film coefficient",
        )


def _power_of_speed(conditions: Conditions, law: HeatLaw | FilmLaw) -> Vector:
    """(n / reference)^exponent, 0 at standstill whatever the exponent."""
    speed = np.abs(conditions.spindle_speed)
    return np.where(speed > 0, (speed / law.reference_rpm) ** law.exponent, 0.0)


def _table(columns: list[Vector], rows: int) -> Matrix:
    return np.column_stack(columns) if columns else np.zeros((rows, 0))


def _unknown(kind: str, name: str, known: tuple[str, ...], where: str) -> InputError:
    return InputError(
        f"no {kind} called {name!r}",
        expected="one of " + (", ".join(known) or "those of the machine (there are none)"),
        where=where,
        advice=f"correct the name, or add the {kind} to the machine",
    )
