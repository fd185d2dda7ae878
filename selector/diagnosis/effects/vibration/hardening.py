"""`vibration.hardening`: stiffness that grows with amplitude."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.effect import Effect, Fitted, Quantity, Reading, ShapeParameter, Variant
from selector.diagnosis.linear_response import LinearResponse, linear_responses
from selector.diagnosis.member_chain import displacement_of, members
from selector.diagnosis.record_kind import no_vibration, of_a_drive, swept_hz
from selector.diagnosis.response_curve import slope
from selector.diagnosis.restoring_force import fed_back, linear_part, restoring
from selector.diagnosis.signals import filled, rate

Vector = NDArray[np.float64]

_ROLES = ("displacement", "acceleration", "velocity", "position", "voltage")
_STRENGTHS = (0.01, 0.1, 0.3, 1.0)
"""Stiffness that the cube adds, over the linear one, at the swing of the simulation."""
_FREE = (0.0, 1e300)


def _variants(comparison: Comparison, response: str) -> Iterator[Variant]:
    if _testable(comparison, response) is not None:
        return
    swept = swept_hz(comparison, response)
    simulated = filled(comparison, comparison.simulated[response])
    if swept is not None:
        shift = -slope(comparison, response, swept) * (simulated / float(np.abs(simulated).max())) ** 2
        yield Variant(shift[:, None], ("resonances raised by the square of the amplitude",), bounds=(_FREE,))
        return
    y = displacement_of(comparison, response, simulated)
    direct = y is simulated
    for path in linear_responses(comparison, response):
        yield from _of_own_motion(comparison, path, y, direct)
        for other in members(comparison, response) if path.source is not None else ():
            if other in comparison.simulated and comparison.channel(other).role == comparison.channel(response).role:
                stretch = y - displacement_of(comparison, other, filled(comparison, comparison.simulated[other]))
                yield from _of_a_joint(comparison, path, stretch, other)


def _of_own_motion(comparison: Comparison, path: LinearResponse, y: Vector, direct: bool) -> Iterator[Variant]:
    cube = restoring(comparison, y, "cubic")
    seen = linear_part(comparison, path, y, cube)
    fitted = ~comparison.held_out
    swing = float(np.mean(y[fitted] ** 4) / max(np.mean(y[fitted] ** 2), 1e-300))
    if swing <= 0.0:
        return
    square = path.passed(comparison, -(y**2))
    for linear, words in (((0.0, 0.0), "small-signal simulation"), (seen, "simulation fitted at this swing")):
        part = cube - linear[0] * y - linear[1] * rate(comparison, y)
        weak = -path.passed(comparison, part)
        yield _variant(path, weak, None, 0.0, words)
        yield _variant(path, weak, square, 0.0, words)
        if not direct or path.static_gain <= 0.0:
            continue
        for strength in _STRENGTHS[1:]:
            k = strength / (swing * path.static_gain)
            moved = fed_back(comparison, path, y, "cubic", k, linear=linear)
            if moved is not None:
                yield _variant(path, moved / k, None, strength, words)
                if strength == _STRENGTHS[2]:
                    yield _variant(path, moved / k, square, strength, words)


def _of_a_joint(comparison: Comparison, path: LinearResponse, stretch: Vector, other: str) -> Iterator[Variant]:
    cube = restoring(comparison, stretch, "cubic")
    alpha, beta = linear_part(comparison, path, stretch, cube)
    for linear in ((0.0, 0.0), (alpha, beta)):
        part = cube - linear[0] * stretch - linear[1] * rate(comparison, stretch)
        column = -path.passed(comparison, part)
        shape = {"relative_to": Quantity(1.0, "1")}
        yield Variant(
            column[:, None], (f"cube of the stretch towards {other}",), shape, sources=(other,), bounds=(_FREE,)
        )


def _variant(path: LinearResponse, column: Vector, square: Vector | None, strength: float, words: str) -> Variant:
    """Coefficient of the first column: k₃, force per cube of the response; divided by the static gain where unknown."""
    columns = column[:, None] if square is None else np.column_stack([column, square])
    names = (f"cubic restoring force ({words})", "quadratic restoring force")[: columns.shape[1]]
    shape = {"static_gain": Quantity(path.static_gain, "1"), "strength": Quantity(strength, "1")}
    source = () if path.source is None else (path.source,)
    return Variant(columns, names, shape, sources=source, bounds=(_FREE, (-1e300, 1e300))[: columns.shape[1]])


def _testable(comparison: Comparison, response: str) -> str | None:
    if swept_hz(comparison, response) is not None:
        return None
    reason = no_vibration(comparison, response, roles=_ROLES) or of_a_drive(comparison, response)
    if reason is None and not linear_responses(comparison, response):
        return f"the simulated {response} shows no resonance that a force could pass through"
    return reason


def _reading(fitted: Fitted, comparison: Comparison) -> Reading:
    largest = {"largest": Quantity(fitted.largest, fitted.unit)}
    gain = fitted.variant.shape.get("static_gain")
    if gain is None:
        text = f"stiffness grows with amplitude; it moves {fitted.response} by up to {fitted.largest:.3g} {fitted.unit}"
        return Reading(text, largest)
    recorded = filled(comparison, comparison.recorded[fitted.response])
    top = float(np.abs(displacement_of(comparison, fitted.response, recorded - np.median(recorded))).max())
    rise = 300.0 * top**2 * gain.value
    value, error = float(fitted.coefficients[0]), 1.96 * float(fitted.standard_errors[0])
    stiffening = Quantity(rise * value, "percent", rise * (value - error), rise * (value + error))
    text = (
        f"stiffness grows with amplitude: at the largest swing it is {stiffening.value:.3g} % above that at rest; this moves "
        f"{fitted.response} by up to {fitted.largest:.3g} {fitted.unit}"
    )
    parameters = largest | {"stiffening": stiffening}
    if fitted.variant.sources:
        unit = f"{comparison.channel(fitted.variant.sources[0]).unit}/{fitted.unit}^3"
        parameters["cubic_stiffness"] = Quantity(value, unit, value - error, value + error)
    return Reading(text, parameters)


EFFECT = Effect(
    id="vibration.hardening",
    title="Stiffness that grows with amplitude",
    physics=(
        "Contact, preload or large deflection add a restoring force that grows with the cube of the displacement. Resonances "
        "move up with amplitude, tops are flattened, and odd harmonics of the excitation appear."
    ),
    reference="Nayfeh & Mook, Nonlinear Oscillations, 1979, ch. 4 (Duffing); Wigren & Schoukens, ECC 2013 (Silverbox)",
    enters="force",
    acts_at="the joint of the member whose motion is recorded, or between two members",
    parameters=(
        ShapeParameter("stiffening", "percent", 0.0, 1e4, "stiffness at the largest swing above that at rest"),
        ShapeParameter("cubic_stiffness", "unit of the input per cube of the response", 0.0, 1e300, "k₃ in k₃·y³"),
        ShapeParameter("largest", "unit of the response", 0.0, 1e12, "largest amount in the response"),
    ),
    needs="excitation at two amplitudes at least, near the resonance",
    confounders=("vibration.hysteresis", "vibration.mode"),
    refuted_by="the frequency response is the same at all amplitudes, or the resonance falls as the amplitude grows",
    experiment="Repeat the same sweep through the resonance at a third, at once and at three times the force.",
    variants=_variants,
    testable=_testable,
    reading=_reading,
)
