"""A sensor that slowly runs away by itself."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.data._places import (
    Part,
    amount,
    everywhere,
    fitted_runs,
    later_parts,
    step_unit,
    window,
)
from selector.diagnosis.effects.effect import Effect, Fitted, Quantity, Reading, Variant, always, words_of
from selector.diagnosis.shapes.input_faults import fault_variants, or_of_input

_STARTS = 12
_BENDS = (1.0, 0.5, 2.0)


def _variants(comparison: Comparison, response: str) -> Iterator[Variant]:
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


def _reading(fitted: Fitted, comparison: Comparison) -> Reading:
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


EFFECT = Effect(**words_of("data.drift"), variants=_variants, testable=always, reading=or_of_input(_reading))
