"""A recorded channel with a constant offset, in all runs or in one."""

from collections.abc import Iterator

import numpy as np

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.data._places import amount, everywhere, step_unit, whole_runs
from selector.diagnosis.effects.effect import Effect, Fitted, Reading, Variant, always, words_of


def _variants(comparison: Comparison, response: str) -> Iterator[Variant]:
    for part in (everywhere(comparison), *whole_runs(comparison, lambda rows: _level(comparison, response, rows))):
        yield part.variant(np.ones(len(comparison.time_s)), "constant", "zero")


def _level(comparison: Comparison, response: str, rows: slice) -> float:
    left = comparison.difference(response)[rows]
    seen = left[np.isfinite(left)]
    return float(np.median(seen)) if len(seen) else 0.0


def _reading(fitted: Fitted, comparison: Comparison) -> Reading:
    zero = fitted.coefficient(step_unit(fitted.unit))
    return Reading(
        f"{fitted.response} is recorded {amount(zero.value, fitted.unit)} too {'high' if zero.value > 0 else 'low'}"
        f"{fitted.where}.",
        {"zero": zero},
    )


EFFECT = Effect(**words_of("data.zero"), variants=_variants, testable=always, reading=_reading)
