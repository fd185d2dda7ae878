"""Faults of a response in rows that nothing was fitted to: a step, a drift, a frozen reading on the last day."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from selector.diagnosis.answer import NamedEffect
from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.effect import Effect
from selector.diagnosis.evidence.bench import bench_of
from selector.diagnosis.evidence.naming import named_effect
from selector.diagnosis.evidence.search import Search, numbers, search

Vector = NDArray[np.float64]
_AS_QUIET = 1.3
"""What is left in the held-out rows, in units of what is left in the fitted rows, if a fault explains all."""


def held_out_faults(
    comparison: Comparison, found: Search, effects: Sequence[Effect], *, false_alarm: float, seed: int
) -> tuple[NamedEffect, ...]:
    """Faults of the data in one held-out run that explain why it is off, and the rest of it as quiet as elsewhere.

    Held-out rows may be off because the model does not carry that far. A fault is named only where nothing is missing
    in the fitted rows, the simulation is clearly off in the held-out ones, and with the fault as good as elsewhere.
    """
    if found.named:
        return ()
    local = [effect for effect in effects if effect.family == "data"]
    named: list[NamedEffect] = []
    for response, bench in found.benches.items():
        left = bench.residual(numbers(found.named, response))
        held = comparison.held_out & np.isfinite(left)
        quiet = _rms(left[bench.fitted])
        if held.sum() < 40 or _rms(left[held]) < _AS_QUIET * quiet:
            continue
        rest = _rest(comparison, response, left)
        there, _ = bench_of(rest, response, local)
        there = there.with_noise(bench.noise)
        result = search({response: there}, false_alarm=0.1 * false_alarm, seed=seed)
        chosen = numbers(result.named, response)
        if chosen and _rms(result.benches[response].residual(chosen)[held]) < _AS_QUIET * quiet:
            local_names = [id_ for id_ in result.named if _in_one_run(result, id_, response)]
            named += [replace(named_effect(rest, result, id_), is_fitted=False) for id_ in local_names]
    return tuple(named)


def _in_one_run(result: Search, id_: str, response: str) -> bool:
    return result.benches[response].candidates[result.named[id_][response]].variant.run is not None


def _rest(comparison: Comparison, response: str, left: Vector) -> Comparison:
    """The comparison in which what was fitted is part of the simulation, and held-out rows are fitted as well."""
    recorded = comparison.recorded[response]
    simulated = np.where(np.isfinite(left), recorded - left, comparison.simulated[response])
    return replace(
        comparison,
        simulated={**comparison.simulated, response: simulated},
        held_out=np.zeros_like(comparison.held_out),
        responses=(response,),
    )


def _rms(values: Vector) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else 0.0
