"""`vibration.hysteresis`: restoring force with memory."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.effect import Effect, Fitted, Quantity, Reading, ShapeParameter, Variant
from selector.diagnosis.linear_response import LinearResponse, linear_responses
from selector.diagnosis.member_chain import displacement_of
from selector.diagnosis.record_kind import no_vibration, of_a_drive, swept_hz
from selector.diagnosis.restoring_force import Law, fed_back, linear_part, restoring
from selector.diagnosis.signals import filled, rate

Vector = NDArray[np.float64]

_ROLES = ("displacement", "acceleration", "velocity", "position", "voltage")
_WIDTHS = (0.03, 0.1, 0.3, 1.0)
"""Displacement until the element slips, over the root mean square of the motion."""
_LAWS: tuple[Law, ...] = ("stop", "dahl")
_STRENGTHS = (0.1, 0.4)
"""Largest force of the element over the elastic force at the root mean square of the motion."""
_FREE = ((0.0, 1e300),)


def _variants(comparison: Comparison, response: str) -> Iterator[Variant]:
    if _testable(comparison, response) is not None:
        return
    simulated = filled(comparison, comparison.simulated[response])
    y = displacement_of(comparison, response, simulated)
    fitted = ~comparison.held_out
    swing = float(np.sqrt(np.mean((y[fitted] - y[fitted].mean()) ** 2)))
    if swing <= 0.0:
        return
    paths = linear_responses(comparison, response)
    for path in paths:
        for law in _LAWS:
            for share in _WIDTHS:
                yield from _of_width(comparison, path, y, law, share * swing, swing, y is simulated)


def _of_width(
    comparison: Comparison, path: LinearResponse, y: Vector, law: Law, width: float, swing: float, direct: bool
) -> Iterator[Variant]:
    force = restoring(comparison, y, law, width)
    if float(np.std(force)) < 1e-9:
        return
    seen = linear_part(comparison, path, y, force)
    for linear, words in (((0.0, 0.0), "beside the simulated stiffness"), (seen, "simulation fitted at this swing")):
        weak = -path.passed(comparison, force - linear[0] * y - linear[1] * rate(comparison, y))
        yield _variant(path, weak, law, width, words)
        if not direct or path.static_gain <= 0.0 or path.source is None:
            continue
        for strength in _STRENGTHS:
            k = strength * swing / path.static_gain
            moved = fed_back(comparison, path, y, law, k, width=width, linear=linear)
            if moved is not None:
                yield _variant(path, moved / k, law, width, words)


def _variant(path: LinearResponse, column: Vector, law: Law, width: float, words: str) -> Variant:
    name = "elastic element that slips" if law == "stop" else "Bouc–Wen element"
    return Variant(
        column[:, None],
        (f"{name}, {words}",),
        {"slip": Quantity(width, "unit of the motion"), "static_gain": Quantity(path.static_gain, "1")},
        sources=() if path.source is None else (path.source,),
        bounds=_FREE,
    )


def _testable(comparison: Comparison, response: str) -> str | None:
    if swept_hz(comparison, response) is not None:
        return "a response curve taken step by step does not show what happens within a cycle"
    reason = no_vibration(comparison, response, roles=_ROLES) or of_a_drive(comparison, response)
    if reason is None and not linear_responses(comparison, response):
        return f"the simulated {response} shows no resonance that a force could pass through"
    return reason


def _reading(fitted: Fitted, comparison: Comparison) -> Reading:
    low, high = fitted.shape_intervals.get("slip", (None, None))
    slip = fitted.variant.shape["slip"]
    unit = {"acceleration": "m", "velocity": "m"}.get(comparison.channel(fitted.response).role, fitted.unit)
    parameters = {"slip": Quantity(slip.value, unit, low, high), "largest": Quantity(fitted.largest, fitted.unit)}
    text = (
        f"a restoring force with memory: it slips {slip.value:.3g} {unit} after each reversal and moves {fitted.response} by up "
        f"to {fitted.largest:.3g} {fitted.unit}"
    )
    if fitted.variant.sources:
        value, error = float(fitted.coefficients[0]), 1.96 * float(fitted.standard_errors[0])
        of_force = (
            comparison.channel(fitted.variant.sources[0]).unit
            if fitted.variant.sources[0] in comparison.recorded
            else ""
        )
        parameters["force"] = Quantity(value, of_force, value - error, value + error)
        text += f"; at most {value:.3g} {of_force}".rstrip()
    return Reading(text, parameters)


EFFECT = Effect(
    id="vibration.hysteresis",
    title="Restoring force with memory",
    physics=(
        "Joints that stick and slip hold a force that depends on the motion since the last reversal, not on the position "
        "alone. Loops of force over displacement open, damping depends on amplitude, and the stiffness falls as joints slip."
    ),
    reference="Bouc 1967; Wen, J. Eng. Mech. Div. ASCE 102, 1976; Worden & Tomlinson, Nonlinearity in Structural Dynamics, 2001",
    enters="force",
    acts_at="the joint of the member whose motion is recorded",
    parameters=(
        ShapeParameter(
            "slip", "unit of the motion", 0.0, 1e12, "displacement after a reversal until the element slips"
        ),
        ShapeParameter("force", "unit of the input", 0.0, 1e300, "largest force of the element"),
        ShapeParameter("largest", "unit of the response", 0.0, 1e12, "largest amount in the response"),
    ),
    needs="the motion within the cycle, at two amplitudes at least",
    confounders=("vibration.hardening", "drive.coulomb"),
    refuted_by="force over displacement is one curve, the same to and fro, at a frequency far below resonance",
    experiment="Move slowly to and fro, far below the resonance, at three amplitudes, with the force recorded.",
    variants=_variants,
    testable=_testable,
    reading=_reading,
)
