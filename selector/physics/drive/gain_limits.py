"""At which factors of a gain is the loop of an axis at the edge of stability, and between which is it stable.

Every gain enters the loop once: its characteristic equation is 1 + k·L = 0 with k the factor on the gain. Poles are on
the edge where L(jω), or L(e^jωT) of a sampled servo, is real and negative, and k is −1/L there: nothing is tried, so no
range of factors is missed, however far from 1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from selector.physics.drive.axis import Axis
from selector.physics.drive.closed_loop import plant, servo_of, small_signal_mechanics
from selector.physics.drive.loop_response import Response, loop_response, nyquist_rad_per_s

GAINS = ("position_gain_per_s", "velocity_gain", "velocity_integral_gain")

Vector = NDArray[np.float64]

_BEYOND = 1e3
"""How far the frequencies reach above and below those of the poles; farther off no phase turns any more."""

_A_DECADE, _A_TURN = 60, 48
_NEAR = np.geomspace(1e-9, 0.5, 60)
"""Distances from a resonance, as a share of its frequency, where it is looked at."""

_NO_PHASE = 1e-11
"""Sine of an angle that is rounding."""

_RIGHT_ANGLE = 0.7
"""Sine of an angle that is nearer to a right one than to 0."""

_HALVINGS = 60


@dataclass(frozen=True)
class Crossing:
    """Poles that reach the edge of stability.

    Attributes
    ----------
    factor : float
        On the gain.
    rad_per_s : float
        Where on the edge [rad/s].
    grow : int
        How many poles more grow with a larger factor: 2 of a pair, 1 where a sampled loop swings from sample to sample;
        negative if fewer.
    """

    factor: float
    rad_per_s: float
    grow: int


def gain_crossings(axis: Axis, gain: str, poles: NDArray[np.complex128]) -> tuple[Crossing, ...]:
    """Where poles reach the edge of stability as one of `GAINS` changes, the others as they are; by factor.

    Parameters
    ----------
    axis
        With a servo.
    gain
        Name of the gain, which is above 0.
    poles : ndarray of complex
        Poles of the closed loop [1/s], which tell where to look.

    Raises
    ------
    InputError
        If the axis has no servo, or numbers too far apart to be calculated with.
    """
    rad = _frequencies(axis, poles)
    sine = _sine(*_loop_of_gain(axis, gain, rad))
    told = np.abs(sine) > _NO_PHASE
    rad, sine = rad[told], sine[told]
    at = np.flatnonzero(np.sign(sine[:-1]) != np.sign(sine[1:]))
    low, high, before = rad[at], rad[at + 1], sine[at]
    for _ in range(_HALVINGS if len(at) else 0):
        middle = np.sqrt(low * high)
        same = np.sign(_sine(*_loop_of_gain(axis, gain, middle))) == np.sign(before)
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    found = list(zip(np.sqrt(low * high), np.where(before < 0, 2, -2), strict=True))
    # at half the sample rate L is real; turned by a right angle up to there it is 0, which no factor brings to the edge
    if np.isfinite(edge := nyquist_rad_per_s(axis)) and len(sine) and abs(sine[-1]) < _RIGHT_ANGLE:
        found.append((edge, 1 if sine[-1] < 0 else -1))
    crossings = []
    for frequency, grow in found:
        numerator, denominator = _loop_of_gain(axis, gain, np.array([frequency]))
        with np.errstate(all="ignore"):
            factor = float(-(denominator / numerator).real[0])
        if np.isfinite(factor) and factor > 0:
            crossings.append(Crossing(factor, float(frequency), int(grow)))
    return tuple(sorted(crossings, key=lambda one: one.factor))


def stable_factors(crossings: tuple[Crossing, ...], growing: int) -> tuple[float | None, float | None]:
    """Ends of the range of factors nearest to 1 with which nothing grows; (None, 0) if there is none.

    Parameters
    ----------
    crossings
        As `gain_crossings` gives them.
    growing
        How many poles grow with factor 1.
    """
    factors = [one.factor for one in crossings]
    first = int(np.searchsorted(factors, 1.0, side="right"))
    # poles that grow between crossing number i − 1 and i
    between = [0] * (len(crossings) + 1)
    between[first] = growing
    for number in range(first, len(crossings)):
        between[number + 1] = between[number] + crossings[number].grow
    for number in range(first, 0, -1):
        between[number - 1] = between[number] - crossings[number - 1].grow
    ends: list[float | None] = [None, *factors, None]
    ranges = [(ends[i], ends[i + 1]) for i, count in enumerate(between) if count <= 0]
    if not ranges:
        return None, 0.0
    return min(ranges, key=_distance)


def _distance(ends: tuple[float | None, float | None]) -> float:
    """Of a range from the factor 1, as a logarithm."""
    low, high = ends
    return max(float(np.log(low)) if low else 0.0, -float(np.log(high)) if high else 0.0, 0.0)


def _loop_of_gain(axis: Axis, gain: str, rad_per_s: Vector) -> tuple[Response, Response]:
    """Numerator and denominator of L, which 1 + k·L = 0 is about."""
    servo, found = servo_of(axis), loop_response(axis, rad_per_s)
    integral = servo.velocity_integral_gain * found.integral
    position = servo.position_gain_per_s / axis.mechanics.travel_per_motion * found.measured
    if gain == "position_gain_per_s":
        control = servo.velocity_gain + integral
        return control * position, 1.0 + control * found.motor_speed
    if gain == "velocity_gain":
        return servo.velocity_gain * (found.motor_speed + position), 1.0 + integral * (found.motor_speed + position)
    return integral * (found.motor_speed + position), 1.0 + servo.velocity_gain * (found.motor_speed + position)


def _sine(numerator: Response, denominator: Response) -> Vector:
    """Sine of the angle of L; free of the poles and zeros that L may have on the edge itself."""
    with np.errstate(all="ignore"):
        turned = numerator / np.abs(numerator) * np.conj(denominator / np.abs(denominator))
    return np.nan_to_num(turned.imag)


def _frequencies(axis: Axis, poles: NDArray[np.complex128]) -> Vector:
    """Frequencies between which no phase turns unseen: decades, turns of the delay, and both sides of resonances."""
    servo, edge = servo_of(axis), nyquist_rad_per_s(axis)
    own = plant(small_signal_mechanics(axis)).poles
    corners = np.abs(np.concatenate([poles, own]))
    corners = np.append(corners, [servo.position_gain_per_s, servo.velocity_integral_gain / servo.velocity_gain])
    corners = corners[corners > 1e-15 * corners.max()]
    lowest, highest = corners.min() / _BEYOND, min(corners.max() * _BEYOND, edge)
    lowest = min(lowest, highest / _BEYOND)
    rows = [np.geomspace(lowest, highest, int(_A_DECADE * np.log10(highest / lowest)) + 2)]
    swinging = np.unique(np.abs(np.concatenate([poles, own]).imag))
    rows += [swinging * (1.0 + side * share) for share in _NEAR for side in (-1.0, 1.0)]
    if np.isfinite(edge):
        samples = servo.delay_s / servo.sample_s + (
            axis.sensing.speed_samples if axis.sensing.speed_from_encoder else 1
        )
        rows.append(np.linspace(0.0, edge, int(_A_TURN * (samples + 2.0)) + 2))
    rad = np.unique(np.concatenate(rows))
    return np.asarray(rad[(rad >= lowest) & (rad <= highest) & (rad < edge * (1.0 - 1e-9))])
