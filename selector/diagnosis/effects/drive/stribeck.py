"""Friction that falls with speed near standstill."""

from collections.abc import Iterator

import numpy as np

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.drive._forces import force_key, motion_of, of_forces, presliding_m, reverses
from selector.diagnosis.effects.effect import Effect, Fitted, Quantity, Reading, Variant, words_of

_N_SPEEDS = 6
_SMALLEST_SHARE, _LARGEST_SHARE = 0.006, 0.12
_EXPONENTS = (1.0, 2.0)


def _variants(comparison: Comparison, response: str) -> Iterator[Variant]:
    moving = motion_of(comparison, response)
    speed = np.abs(moving.velocity_m_per_s)
    friction = moving.friction_state(presliding_m(comparison, response))
    top = float(speed.max())
    for stribeck in np.geomspace(_SMALLEST_SHARE * top, _LARGEST_SHARE * top, _N_SPEEDS):
        for exponent in _EXPONENTS:
            force = friction * np.exp(-((speed / stribeck) ** exponent))
            shape = {"stribeck_speed_m_per_s": Quantity(float(stribeck), "m/s"), "exponent": Quantity(exponent, "1")}
            yield from of_forces(comparison, response, {"friction near standstill": force}, shape)


def _testable(comparison: Comparison, response: str) -> str | None:
    lacking = reverses(comparison, response)
    if lacking is not None:
        return lacking
    moving = motion_of(comparison, response)
    speed = np.abs(moving.velocity_m_per_s)
    slow = (speed > moving.rest_speed_m_per_s) & (speed < 0.3 * float(speed.max()))
    return None if int(slow.sum()) >= 10 else "the axis is hardly ever slow without standing"


def _reading(fitted: Fitted, comparison: Comparison) -> Reading:
    speed = fitted.parameter("stribeck_speed_m_per_s")
    below = f"below about {1e3 * speed.value:.3g} mm/s"
    key, force = force_key(fitted, comparison), fitted.coefficient()
    text = f"A friction that falls with speed, felt {below}, pushes the axis aside where it starts and turns"
    if key:
        more = f"{force.words(amount=True)} {'more' if force.value > 0.0 else 'less'}"
        text = f"Friction is {more} near standstill than at speed; it has changed {below}"
    parameters = {key: force} if key else fitted.size
    return Reading(f"{text} ({fitted.size_words}).", parameters | {"stribeck_speed_m_per_s": speed})


EFFECT = Effect(**words_of("drive.stribeck"), variants=_variants, testable=_testable, reading=_reading)
