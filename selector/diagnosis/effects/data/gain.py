"""A recorded channel on a wrong scale: unit, range or calibration."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.data._places import Part, estimate, where_of, whole_runs
from selector.diagnosis.effects.effect import Effect, Fitted, Quantity, Reading, ShapeParameter, Variant
from selector.diagnosis.shapes.signals import excited, filled
from selector.types import Vector

_FACTORS = {
    1000.0: "a thousandfold: mm for µm, or mA for A",
    25.4: "25.4: inch and mm, or mil and µm",
    60.0: "60: per second and per minute",
    10.0: "tenfold: a decimal place, or a switch of range",
    9.81: "9.81: g and m/s², or kgf and N",
    2.0 * np.pi: "2π: revolutions and radians",
    2.0: "twofold: radius and diameter, or single and double amplitude",
    1.8: "1.8: °F and °C",
    np.sqrt(2.0): "√2: effective value and amplitude",
    -1.0: "the sign is reversed",
}
"""Factors between units and habits, and what they would mean."""
_NEAR = 0.02
"""How near a fitted factor must come to one of a table to be recognised, if its interval is not wider."""


def _variants(comparison: Comparison, response: str) -> Iterator[Variant]:
    course = filled(comparison, comparison.simulated[response])
    everywhere = Part(np.ones(len(course), dtype=bool), None, "")
    with_zero = comparison.channel(response).role in ("temperature", "ambient")
    for part in [everywhere, *whole_runs(comparison, lambda rows: _gain(comparison, response, rows) - 1.0)]:
        yield _variant(part, course)
        if with_zero and part.run is not None:
            # another temperature scale has another zero too
            yield _variant(part, course, np.ones(len(course)))


def _variant(part: Part, *courses: Vector) -> Variant:
    return Variant(
        columns=np.column_stack([part.over(values) for values in courses]),
        names=("simulated course", "zero")[: len(courses)],
        place="scale",
        run=part.run,
        regime=part.regime,
    )


def _gain(comparison: Comparison, response: str, rows: slice) -> float:
    """Slope of recorded on simulated readings in a run."""
    recorded, simulated = comparison.recorded[response][rows], comparison.simulated[response][rows]
    seen = np.isfinite(recorded) & np.isfinite(simulated)
    if not seen.any():
        return 1.0
    x, y = simulated[seen] - simulated[seen].mean(), recorded[seen] - recorded[seen].mean()
    return float(x @ y / (x @ x)) if x @ x > 0.0 else 1.0


def _testable(comparison: Comparison, response: str) -> str | None:
    if not excited(filled(comparison, comparison.simulated[response])):
        return "the simulated course does not move, so that a scale would not show"
    return None


def known_factor(gain: Quantity) -> str | None:
    """What a factor that separates units or habits means; None of any other."""
    half = 0.0 if gain.high is None else gain.high - gain.value
    for factor, words in _FACTORS.items():
        for times in (factor, 1.0 / factor):
            if abs(gain.value - times) <= max(_NEAR * abs(times), min(half, 2.0 * _NEAR * abs(times))):
                return words
    return None


def _reading(fitted: Fitted, comparison: Comparison) -> Reading:
    gain = estimate(fitted, "1", offset=1.0)
    meaning = known_factor(gain)
    means = f" Such a factor is known: {meaning}." if meaning else ""
    return Reading(
        f"{fitted.response} is recorded {gain.value:.4g} times as large as it was{where_of(fitted)}.{means}",
        {"gain": gain},
    )


EFFECT = Effect(
    id="data.gain",
    title="Scale of a channel",
    physics="A channel is recorded on a wrong scale: another unit or range of the amplifier, a wrong calibration. The "
    "difference is a constant times the course itself.",
    reference="ISO Guide 99:2007 (VIM) 4.31 (calibration curve), taken as a straight line",
    enters="measurement",
    acts_at="a recorded channel, in all runs, in one, or from one run on",
    parameters=(ShapeParameter("gain", "1", -np.inf, np.inf, "recorded by true change of reading"),),
    needs="a simulated course that moves; at least two fitted runs if one of them is to be found at fault",
    confounders=("thermal.convection", "thermal.interaction", "drive.viscous"),
    refuted_by="A reference (gauge block, ice water, shunt) that the channel reads rightly in the run in question.",
    experiment="Let the channel read a reference at two points of its range before and after a run.",
    variants=_variants,
    testable=_testable,
    reading=_reading,
)
