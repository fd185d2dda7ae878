"""`vibration.line`: a source at a fixed frequency that has nothing to do with the spindle."""

import math
from collections.abc import Iterator

import numpy as np

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.effect import Effect, Fitted, Quantity, Reading, Variant, words_of
from selector.diagnosis.shapes.linear_response import resonances_of
from selector.diagnosis.shapes.residual import unexplained
from selector.diagnosis.shapes.signals import no_vibration, of_a_drive, swept_hz
from selector.diagnosis.shapes.spectral_lines import course_of, fitted_parts, lines

_ROLES = ("displacement", "acceleration", "velocity", "position", "voltage", "force", "current")
_FEWEST_CYCLES = 8.0
#: What a line pays at a resonance that the simulation has: there a structure rings by itself at every knock.
_RINGS = 25.0
_CHANCE = 0.5  #: That noise shows a line at all; what is offered pays for the frequencies that were looked at.


def _variants(comparison: Comparison, response: str) -> Iterator[Variant]:
    if swept_hz(comparison, response) is not None:
        yield from _of_a_curve(comparison, response)
        return
    time, even = comparison.time_s, np.ones(len(comparison.time_s))
    shortest = min(float(comparison.time_s[rows][-1]) for _, rows in comparison.rows_of_runs())
    lowest = max(_FEWEST_CYCLES / max(shortest, comparison.period_s), 0.5)
    n_fitted = sum(part.start < part.stop for part in fitted_parts(comparison))
    octaves = np.log(max(0.5 / comparison.period_s / lowest, math.e))
    found = lines(comparison, unexplained(comparison, response), time, even, lowest=lowest, chance=_CHANCE)
    own = resonances_of(comparison, response) if found else ()
    for line in found:
        # a frequency of many, as likely in one octave as in another
        looked = max(line.cycles * shortest * float(octaves), 1.0)
        shape = {"frequency_hz": Quantity(line.cycles, "Hz")}
        run = comparison.runs[line.runs[0]] if len(line.runs) == 1 and len(comparison.runs) > 1 else None
        aligned = course_of(line, comparison, time, even)
        words = (f"line at {line.cycles:.4g} Hz, phase of each run",)
        # a phase in every run that is fitted; noise between two of the frequencies counts like one run more
        looked_at = looked * float(np.exp(1.0 + min(len(line.runs), n_fitted)))
        looked_at *= len(comparison.runs) if run is not None else 1
        rings = _RINGS if any(abs(line.cycles - f0) < 2.0 * damping * f0 for f0, damping in own) else 1.0
        yield Variant(aligned[:, None], words, shape, run=run, looked_at=looked_at * rings)
        if len(line.runs) > 1:
            turn = 2.0 * np.pi * line.cycles * time
            columns = np.column_stack([np.cos(turn), np.sin(turn)])
            names = (f"cosine of {line.cycles:.4g} Hz from the start of each run", "sine of the same")
            yield Variant(columns, names, shape, looked_at=looked * math.e * rings)


def _of_a_curve(comparison: Comparison, response: str) -> Iterator[Variant]:
    """Amplitudes of unrelated motions add by squares: a constant floor shows where the curve is low."""
    amplitude = np.abs(comparison.simulated_course(response))
    for share in (0.1, 0.3, 1.0):
        floor = share * float(np.median(amplitude))
        if floor > 0.0:
            added = np.sqrt(amplitude**2 + floor**2) - amplitude
            yield Variant(added[:, None], ("floor that adds by squares",), {"floor": Quantity(floor, "um")})


def _testable(comparison: Comparison, response: str) -> str | None:
    if swept_hz(comparison, response) is not None:
        return None
    # what repeats in the residual of a feed repeats with its programme more often than by a source of its own
    return no_vibration(comparison, response, roles=_ROLES) or of_a_drive(comparison, response)


def _reading(fitted: Fitted, comparison: Comparison) -> Reading:
    line = fitted.variant.shape.get("frequency_hz")
    if line is None:
        text = f"a constant vibration of about {fitted.up_to} lies under {fitted.response} at every step"
        return Reading(text, {"amplitude": fitted.size["largest"]})
    amplitude, error = float(np.hypot.reduce(fitted.coefficients)), 1.96 * float(np.max(fitted.standard_errors))
    size = Quantity(amplitude, fitted.unit, amplitude - error, amplitude + error)
    where = f" in run {fitted.variant.run}" if fitted.variant.run else ""
    text = f"{fitted.response} vibrates by ±{amplitude:.3g} {fitted.unit} at a fixed {line.value:.5g} Hz{where}"
    speeds = [comparison.filled(comparison.recorded[name]) for name in comparison.with_role("spindle_speed")]
    if not any(float(np.ptp(speed)) > 0.01 * float(np.abs(speed).max(initial=0.0)) for speed in speeds):
        text += "; the spindle speed does not change, so a source on the spindle would look the same"
    return Reading(text, {"frequency_hz": line, "amplitude": size})


EFFECT = Effect(**words_of("vibration.line"), variants=_variants, testable=_testable, reading=_reading)
