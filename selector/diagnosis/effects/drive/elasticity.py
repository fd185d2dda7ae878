"""Wind-up of what stands between drive and table, and its natural mode."""

from collections.abc import Iterator
from functools import partial

import numpy as np
from scipy.signal import bilinear, lfilter

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.drive._forces import direct, motion_of, of_forces, presliding_m
from selector.diagnosis.effects.effect import Effect, Fitted, Quantity, Reading, Variant, words_of
from selector.diagnosis.shapes.axis import simulated_drive_force
from selector.diagnosis.shapes.force_response import PLACE_ROLES, responds
from selector.diagnosis.shapes.signals import by_run, rate
from selector.types import Vector

_DAMPING = 0.04
_N_FREQUENCIES = 12
_LOWEST_HZ = 8.0
_HIGHEST_SHARE = 0.8


def _variants(comparison: Comparison, response: str) -> Iterator[Variant]:
    moving = motion_of(comparison, response)
    acceleration = moving.acceleration_m_per_s2
    inertia = {"wind-up by inertia": acceleration}
    is_place = comparison.channel(response).role in PLACE_ROLES
    if is_place:
        yield direct(comparison, response, inertia, _at(0.0))
        drive = simulated_drive_force(comparison, comparison.channel(response).axis)
        if drive is not None:
            of_drive = {f"wind-up by {drive[0]}": drive[1]}
            yield direct(comparison, response, of_drive, _at(0.0))
            yield direct(comparison, response, of_drive | inertia, _at(0.0))
        else:
            friction = {"wind-up by friction": moving.friction_state(presliding_m(comparison, response))}
            yield direct(comparison, response, inertia | friction, _at(0.0))
    else:
        # the control of a motor that runs ahead of its table by the wind-up feels the rate of it
        jerk = {"rate of the wind-up by inertia": rate(comparison, acceleration, over_samples=5)}
        yield from of_forces(comparison, response, jerk, _at(0.0), of_motor=True)
    top = _HIGHEST_SHARE * 0.5 / comparison.period_s
    if top <= _LOWEST_HZ:
        return
    for frequency in np.geomspace(_LOWEST_HZ, min(top, 40.0 * _LOWEST_HZ), _N_FREQUENCIES):
        ringing = _mode(comparison, acceleration, float(frequency), _DAMPING) - acceleration
        forces = {"mode rung by acceleration": ringing}
        shape = _at(float(frequency)) | {"damping_ratio": Quantity(_DAMPING, "1")}
        if is_place:
            yield direct(comparison, response, forces | inertia, shape)
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
    return by_run(comparison, partial(lfilter, b, a), course)


def _reading(fitted: Fitted, comparison: Comparison) -> Reading:
    frequency = fitted.parameter("frequency_hz")
    if frequency.value > 0.0:
        text = f"A flexible mode near {frequency.value:.3g} Hz rings when the axis changes its acceleration"
        return Reading(f"{text}: {fitted.size_words}.", fitted.size | {"frequency_hz": frequency})
    per = fitted.coefficient(f"{fitted.unit}*s^2/m" if "inertia" in fitted.variant.names[0] else fitted.unit)
    text = f"The axis winds up between drive and table, by {per.words(amount=True)} per unit of the"
    return Reading(f"{text} {fitted.variant.names[0]}: {fitted.size_words}.", fitted.size | {"compliance": per})


EFFECT = Effect(**words_of("drive.elasticity"), variants=_variants, testable=responds, reading=_reading)
