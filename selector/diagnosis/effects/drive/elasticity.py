"""Wind-up of what stands between drive and table, and its natural mode."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.signal import bilinear, lfilter

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.drive._forces import (
    PLACES,
    any_response,
    coefficient,
    direct,
    motion_of,
    of_forces,
    presliding_m,
    shape_quantity,
    size_of,
    with_interval,
)
from selector.diagnosis.effects.effect import Effect, Fitted, Quantity, Reading, ShapeParameter, Variant
from selector.diagnosis.shapes.axis import simulated_drive_force
from selector.diagnosis.shapes.signals import rate
from selector.types import Vector

_DAMPING = (0.04,)
_N_FREQUENCIES = 12
_LOWEST_HZ = 8.0
_HIGHEST_SHARE = 0.8


def _variants(comparison: Comparison, response: str) -> Iterator[Variant]:
    if any_response(comparison, response) is not None:
        return
    moving = motion_of(comparison, response)
    acceleration = moving.acceleration_m_per_s2
    if comparison.channel(response).role in PLACES:
        yield direct(comparison, response, {"wind-up by inertia": acceleration}, _at(0.0))
        drive = simulated_drive_force(comparison, comparison.channel(response).axis)
        if drive is not None:
            name, force = drive
            yield direct(comparison, response, {f"wind-up by {name}": force}, _at(0.0))
            both = {f"wind-up by {name}": force, "wind-up by inertia": acceleration}
            yield direct(comparison, response, both, _at(0.0))
        else:
            friction = {
                "wind-up by inertia": acceleration,
                "wind-up by friction": moving.friction_state(presliding_m(comparison, response)),
            }
            yield direct(comparison, response, friction, _at(0.0))
    else:
        # the control of a motor that runs ahead of its table by the wind-up feels the rate of it
        jerk = {"rate of the wind-up by inertia": rate(comparison, acceleration, over_samples=5)}
        yield from of_forces(comparison, response, jerk, _at(0.0), of_motor=True)
    top = _HIGHEST_SHARE * 0.5 / comparison.period_s
    if top <= _LOWEST_HZ:
        return
    for frequency in np.geomspace(_LOWEST_HZ, min(top, 40.0 * _LOWEST_HZ), _N_FREQUENCIES):
        for damping in _DAMPING:
            ringing = _mode(comparison, acceleration, float(frequency), damping) - acceleration
            forces = {"mode rung by acceleration": ringing}
            shape = _at(float(frequency)) | {"damping_ratio": Quantity(damping, "1")}
            if comparison.channel(response).role in PLACES:
                yield direct(comparison, response, forces | {"wind-up by inertia": acceleration}, shape)
            else:
                yield from of_forces(comparison, response, forces, shape, of_motor=True)


def _at(frequency_hz: float) -> dict[str, Quantity]:
    """0: without a mode that the sampling shows."""
    return {"frequency_hz": Quantity(frequency_hz, "Hz")}


def _mode(comparison: Comparison, course: Vector, frequency_hz: float, damping: float) -> Vector:
    """ω²·x/(s² + 2ζωs + ω²), run by run (Tustin, true at ω)."""
    omega = 2.0 * np.pi * frequency_hz
    rate = omega / (2.0 * np.tan(0.5 * omega * comparison.period_s))
    b, a = bilinear([omega**2], [1.0, 2.0 * damping * omega, omega**2], rate)
    result = np.empty(len(course))
    for _, rows in comparison.rows_of_runs():
        result[rows] = lfilter(b, a, course[rows])
    return result


def _reading(fitted: Fitted, comparison: Comparison) -> Reading:
    parameters = {"largest": Quantity(fitted.largest, fitted.unit)}
    frequency = fitted.variant.shape["frequency_hz"].value
    if frequency > 0.0:
        parameters["frequency_hz"] = shape_quantity(fitted, "frequency_hz")
        return Reading(
            f"A flexible mode near {frequency:.3g} Hz rings when the axis changes its acceleration: {size_of(fitted)}.",
            parameters,
        )
    per = coefficient(fitted, 0, f"{fitted.unit}*s^2/m" if "inertia" in fitted.variant.names[0] else fitted.unit)
    return Reading(
        f"The axis winds up between drive and table, by {with_interval(per, amount=True)} per unit of the "
        f"{fitted.variant.names[0]}"
        f": {size_of(fitted)}.",
        parameters | {"compliance": per},
    )


EFFECT = Effect(
    id="drive.elasticity",
    title="Wind-up",
    physics="Screw, coupling, nut and bearings yield by the force that they carry, so that the table stays behind "
    "the motor with "
    "friction and acceleration. Changes of acceleration make the table ring at the natural frequency against the "
    "motor.",
    reference="Yao, Zhang, time-varying characteristics of an NC feed system (equations 4 and 5: stiffness of screw, "
    "nut and "
    "bearings in series); Y. Altintas et al. (2011), Machine tool feed drives, CIRP Annals 60(2), 779–796",
    enters="state",
    acts_at="screw, coupling, nut or bearings of an axis",
    parameters=(
        ShapeParameter("compliance", "unit of the response per force or acceleration", -1e3, 1e3, "yield per load"),
        ShapeParameter("frequency_hz", "Hz", 0.0, 1e3, "natural frequency; 0: only wind-up was seen"),
        ShapeParameter("damping_ratio", "1", 0.0, 1.0, "of the mode"),
    ),
    needs="displacement or position of the table, or the force of the drive, of an axis that speeds up and slows down",
    # in a displacement alone wind-up by inertia is mass, and wind-up by friction is lost motion
    confounders=(
        "drive.mass",
        "drive.coulomb",
        "drive.backlash",
        "drive.varying_stiffness",
        "drive.delay",
        "vibration.mode",
    ),
    refuted_by="A table that stays where the motor is under a known push, or an error that is the same for every "
    "acceleration.",
    experiment="Push the standing table with 0, 200 and 500 N both ways with the drive on; then strokes of 50 mm "
    "with 20, 50 and "
    "100 % of the largest acceleration, and a sine sweep from 5 to 200 Hz.",
    variants=_variants,
    testable=any_response,
    reading=_reading,
)
