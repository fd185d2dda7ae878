"""A recorded channel on a wrong scale: unit, range or calibration."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.data._places import everywhere, whole_runs
from selector.diagnosis.effects.effect import Effect, Fitted, Quantity, Reading, Variant, words_of
from selector.diagnosis.shapes.signals import excited

#: Factors between units and habits, and what they would mean.
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
_NEAR = 0.02  #: How near a fitted factor must come to one of a table to be recognised, if its interval is not wider.
_KNOWN = 0.1  #: Of a factor, within which it has to be known to be one that is known.


def _variants(comparison: Comparison, response: str) -> Iterator[Variant]:
    course = comparison.simulated_course(response)
    with_zero = comparison.channel(response).role in ("temperature", "ambient")
    parts = whole_runs(comparison, lambda rows: _gain(comparison, response, rows) - 1.0)
    for part in (everywhere(comparison), *parts):
        found = part.variant(course, "simulated course", "scale")
        yield found
        if with_zero and part.run is not None:
            # another temperature scale has another zero too
            both = np.column_stack([found.columns[:, 0], part.over(np.ones(len(course)))])
            yield replace(found, columns=both, names=("simulated course", "zero"))


def _gain(comparison: Comparison, response: str, rows: slice) -> float:
    """Slope of recorded on simulated readings in a run."""
    recorded, simulated = comparison.recorded[response][rows], comparison.simulated[response][rows]
    seen = np.isfinite(recorded) & np.isfinite(simulated)
    if not seen.any():
        return 1.0
    x, y = simulated[seen] - simulated[seen].mean(), recorded[seen] - recorded[seen].mean()
    return float(x @ y / (x @ x)) if x @ x > 0.0 else 1.0


def _testable(comparison: Comparison, response: str) -> str | None:
    moves = excited(comparison.simulated_course(response))
    return None if moves else "the simulated course does not move, so that a scale would not show"


def known_factor(gain: Quantity) -> str | None:
    """What a factor that separates units or habits means; None of any other."""
    half = 0.0 if gain.high is None else gain.high - gain.value
    if half > _KNOWN * abs(gain.value):
        return None
    for factor, words in _FACTORS.items():
        for times in (factor, 1.0 / factor):
            if abs(gain.value - times) <= max(_NEAR * abs(times), min(half, 2.0 * _NEAR * abs(times))):
                return words
    return None


def _reading(fitted: Fitted, comparison: Comparison) -> Reading:
    gain = fitted.coefficient("1", offset=1.0)
    meaning = known_factor(gain)
    means = f" Such a factor is known: {meaning}." if meaning else ""
    return Reading(
        f"{fitted.response} is recorded {gain.value:.4g} times as large as it was{fitted.where}.{means}", {"gain": gain}
    )


EFFECT = Effect(**words_of("data.gain"), variants=_variants, testable=_testable, reading=_reading)
