"""Faults of a reading: scale, zero, drift, jump, two channels that changed places."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations

import numpy as np

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.data._places import (
    Part,
    amount,
    everywhere,
    fitted_runs,
    later_parts,
    single_runs,
    step_unit,
    whole_runs,
    window,
)
from selector.diagnosis.effects.effect import Fitted, Quantity, Reading, Variant, always, declared, equally_likely
from selector.diagnosis.shapes.input_faults import fault_variants, or_of_input
from selector.diagnosis.shapes.residual import exchanged, unexplained, weights_of_readings
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


def _gain(comparison: Comparison, response: str) -> Iterator[Variant]:
    course = comparison.simulated_course(response)
    with_zero = comparison.channel(response).role in ("temperature", "ambient")
    parts = whole_runs(comparison, lambda rows: _slope(comparison, response, rows) - 1.0)
    for part in (everywhere(comparison), *parts):
        found = part.variant(course, "simulated course", "scale")
        yield found
        if with_zero and part.run is not None:
            # another temperature scale has another zero too
            both = np.column_stack([found.columns[:, 0], part.over(np.ones(len(course)))])
            yield replace(found, columns=both, names=("simulated course", "zero"))


def _slope(comparison: Comparison, response: str, rows: slice) -> float:
    """Slope of recorded on simulated readings in a run."""
    recorded, simulated = comparison.recorded[response][rows], comparison.simulated[response][rows]
    seen = np.isfinite(recorded) & np.isfinite(simulated)
    if not seen.any():
        return 1.0
    x, y = simulated[seen] - simulated[seen].mean(), recorded[seen] - recorded[seen].mean()
    return float(x @ y / (x @ x)) if x @ x > 0.0 else 1.0


def _gain_testable(comparison: Comparison, response: str) -> str | None:
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


def _gain_reading(fitted: Fitted, comparison: Comparison) -> Reading:
    gain = fitted.coefficient("1", offset=1.0)
    meaning = known_factor(gain)
    means = f" Such a factor is known: {meaning}." if meaning else ""
    return Reading(
        f"{fitted.response} is recorded {gain.value:.4g} times as large as it was{fitted.where}.{means}", {"gain": gain}
    )


def _zero(comparison: Comparison, response: str) -> Iterator[Variant]:
    for part in (everywhere(comparison), *whole_runs(comparison, lambda rows: _level(comparison, response, rows))):
        yield part.variant(np.ones(len(comparison.time_s)), "constant", "zero")


def _level(comparison: Comparison, response: str, rows: slice) -> float:
    left = comparison.difference(response)[rows]
    seen = left[np.isfinite(left)]
    return float(np.median(seen)) if len(seen) else 0.0


def _zero_reading(fitted: Fitted, comparison: Comparison) -> Reading:
    zero = fitted.coefficient(step_unit(fitted.unit))
    return Reading(
        f"{fitted.response} is recorded {amount(zero.value, fitted.unit)} too {'high' if zero.value > 0 else 'low'}"
        f"{fitted.where}.",
        {"zero": zero},
    )


_STARTS = 12
_BENDS = (1.0, 0.5, 2.0)


def _drift(comparison: Comparison, response: str) -> Iterator[Variant]:
    yield _ramp(comparison, everywhere(comparison))
    runs = fitted_runs(comparison)
    for run, rows in comparison.rows_of_runs():
        if run in runs and len(runs) > 1:
            yield _ramp(comparison, replace(window(comparison, run, rows.start, rows.stop - 1), words=f"run {run}"))
    for part in later_parts(comparison, _STARTS, 5 * _STARTS, (0.04, 0.8)):
        for bend in _BENDS:
            yield _ramp(comparison, part, bend)
    yield from fault_variants(comparison, response, "data.drift")


def _ramp(comparison: Comparison, part: Part, bend: float = 1.0) -> Variant:
    """Hours since the drift began; bent, so that it is fast at first (below 1) or at last, and the same at the end."""
    hours = np.maximum(comparison.time_s - (part.from_s or 0.0), 0.0) / 3600.0
    end = max(float(part.over(hours).max()), 1e-12)
    bent = {} if bend == 1.0 else {"bend": Quantity(bend, "1")}
    return part.variant(end * (hours / end) ** bend, "hours since it began", "sensor", bent)


def _drift_reading(fitted: Fitted, comparison: Comparison) -> Reading:
    shape = fitted.variant.shape
    from_s = shape["from_s"].value if "from_s" in shape else 0.0
    to_s = shape["to_s"].value if "to_s" in shape else comparison.longest_s
    slope = fitted.coefficient(f"{step_unit(fitted.unit)}/h")
    end = slope.value * (to_s - from_s) / 3600.0
    return Reading(
        f"The sensor of {fitted.response} runs away by {amount(slope.value, fitted.unit)}/h on average"
        f"{fitted.where}: {amount(end, fitted.unit)} too {'high' if end > 0 else 'low'} at the end.",
        {"drift": slope} | ({"from_s": shape["from_s"]} if "from_s" in shape else {}),
    )


_BESIDE = 8  #: Samples on each side of a moment by whose means a jump is seen.
_CLEAR = 6.0  #: Standard deviations of that difference from which the moment of a jump is read off.


def _step(comparison: Comparison, response: str) -> Iterator[Variant]:
    tried = [(part, 1.0) for part in later_parts(comparison)]
    for part, looked_at in (*tried, *_seen(comparison, response)):
        for one in part.also_going_on(comparison):
            yield one.variant(np.ones(len(part.rows)), "jump", "sensor", looked_at=looked_at)
    yield from fault_variants(comparison, response, "data.step")


def _seen(comparison: Comparison, response: str) -> Iterator[tuple[Part, float]]:
    """The clearest jump of what is left in every fitted run, and among how many moments it was looked for.

    A jump at a moment between those that are tried leaves a spike as large as itself, if it is large.
    """
    left = unexplained(comparison, response)
    for run, rows in comparison.rows_of_runs():
        here = np.flatnonzero(np.isfinite(comparison.difference(response)[rows])) + rows.start
        if run not in fitted_runs(comparison) or len(here) < 4 * _BESIDE:
            continue
        means = np.convolve(left[here], np.full(_BESIDE, 1.0 / _BESIDE), "valid")
        change = means[_BESIDE:] - means[:-_BESIDE]
        usual = 1.4826 * float(np.median(np.abs(change - np.median(change))))
        at = int(np.argmax(np.abs(change)))
        if usual > 0.0 and abs(change[at]) > _CLEAR * usual:
            yield window(comparison, run, int(here[at + _BESIDE]), rows.stop - 1), float(len(change))


def _step_testable(comparison: Comparison, response: str) -> str | None:
    some = next(later_parts(comparison), None)
    return "no fitted run is long enough to have a before and an after" if some is None else None


def _step_reading(fitted: Fitted, comparison: Comparison) -> Reading:
    step = fitted.coefficient(step_unit(fitted.unit))
    from_s = fitted.variant.shape["from_s"].value
    low, high = fitted.shape_intervals.get("from_s", (from_s, from_s))
    tried_s = [part.from_s or 0.0 for part in later_parts(comparison) if part.run == fitted.variant.run]
    half_s = 0.5 * (float(np.median(np.diff(tried_s))) if len(tried_s) > 1 else comparison.longest_s)
    since = Quantity(from_s, "s", max(0.0, min(low, from_s - half_s)), max(high, from_s + half_s))
    return Reading(
        f"{fitted.response} jumps {'up' if step.value > 0 else 'down'} by {amount(step.value, fitted.unit)} and stays "
        f"there: {fitted.variant.regime}.",
        {"step": step, "from_s": since},
    )


_AROUND_ONE = ((0.7, 1.3),)


def _swapped(comparison: Comparison, response: str) -> Iterator[Variant]:
    yield from equally_likely(
        _of_response(comparison, response),
        _of_readings(comparison, response),
        fault_variants(comparison, response, "data.swapped"),
    )


def _of_response(comparison: Comparison, response: str) -> Iterator[Variant]:
    """The response stands under the name of another one of the same quantity, which was simulated and differs."""
    own, simulated = comparison.channel(response), comparison.simulated_course(response)
    for other in (c.name for c in comparison.channels if c.role == own.role and c.name in comparison.simulated):
        change, words = comparison.simulated_course(other) - simulated, f"simulated {other} less simulated {response}"
        for part in whole_runs(comparison) if excited(change) else ():
            yield part.variant(change, words, "wiring", sources=(response, other), bounds=_AROUND_ONE)


def _of_readings(comparison: Comparison, response: str) -> Iterator[Variant]:
    """Two readings that the simulation was computed from changed places in a run: how much that makes is known."""
    weights = weights_of_readings(comparison, response)
    for one, other in combinations(weights, 2):
        if comparison.channel(one).role != comparison.channel(other).role:
            continue
        change = exchanged(comparison, weights, one, other)
        words = f"{one} and {other} put back in their places"
        for part in single_runs(comparison):
            yield part.variant(change, words, "wiring", sources=(one, other), bounds=_AROUND_ONE)


def _swapped_testable(comparison: Comparison, response: str) -> str | None:
    lacking = "no other channel of the same quantity was recorded and simulated, or read by the simulation"
    return lacking if next(_swapped(comparison, response), None) is None else None


def _swapped_reading(fitted: Fitted, comparison: Comparison) -> Reading:
    one, other = fitted.variant.sources
    changed = f"have changed places{fitted.where}"
    text = (
        f"{one} and {other} {changed}: so read, the simulation of {fitted.response} is off by up to {fitted.up_to}."
        if one != fitted.response
        else f"What stands under {one} is what was simulated for {other}: the two channels {changed}."
    )
    return Reading(text, {"share": fitted.coefficient("1")})


EFFECTS = (
    declared("data.gain", _gain, _gain_testable, _gain_reading),
    declared("data.zero", _zero, always, _zero_reading),
    declared("data.drift", _drift, always, or_of_input(_drift_reading)),
    declared("data.step", _step, _step_testable, or_of_input(_step_reading)),
    declared("data.swapped", _swapped, _swapped_testable, or_of_input(_swapped_reading)),
)
