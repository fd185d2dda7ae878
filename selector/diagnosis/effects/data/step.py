"""A sensor that jumps and stays there."""

from collections.abc import Iterator

import numpy as np

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.data._places import Part, amount, fitted_runs, later_parts, step_unit, window
from selector.diagnosis.effects.effect import Effect, Fitted, Quantity, Reading, Variant, words_of
from selector.diagnosis.shapes.input_faults import fault_variants, or_of_input
from selector.diagnosis.shapes.residual import unexplained

_BESIDE = 8  #: Samples on each side of a moment by whose means a jump is seen.
_CLEAR = 6.0  #: Standard deviations of that difference from which the moment of a jump is read off.


def _variants(comparison: Comparison, response: str) -> Iterator[Variant]:
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


def _testable(comparison: Comparison, response: str) -> str | None:
    some = next(later_parts(comparison), None)
    return "no fitted run is long enough to have a before and an after" if some is None else None


def _reading(fitted: Fitted, comparison: Comparison) -> Reading:
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


EFFECT = Effect(**words_of("data.step"), variants=_variants, testable=_testable, reading=or_of_input(_reading))
