"""Which size of an effect would this record have shown? What is smaller may be there."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from scipy import stats

from selector.diagnosis.answer import Detectable
from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.effect import Fitted, Quantity
from selector.diagnosis.evidence.bench import Bench
from selector.diagnosis.evidence.moments import inverse_of
from selector.diagnosis.evidence.search import Search, numbers
from selector.diagnosis.evidence.testing import tail_threshold

_CHANCE = 0.9


def detectability(comparison: Comparison, found: Search, *, false_alarm: float) -> tuple[Detectable, ...]:
    """Per effect that was tested and not named, the size that would have been found in 9 of 10 such records.

    The size is the root mean square of the effect's course in the response that shows it best, of its median shape:
    an effect whose whitened course, recalibration and named effects projected off, has the norm d is found with the
    chance P(χ > threshold), χ normal about d.
    """
    live = max(len(found.standing), 1)
    sizes: dict[str, Detectable] = {}
    for response, bench in found.benches.items():
        thresholds = {
            id_: tail_threshold(false_alarm / live, standing.tested[response].noise)
            for id_, standing in found.standing.items()
            if response in standing.tested and id_ not in found.named
        }
        for one in _in_response(comparison, bench, numbers(found.named, response), thresholds):
            if one.id not in sizes or _relative(found, one) < _relative(found, sizes[one.id]):
                sizes[one.id] = one
    return tuple(sizes[id_] for id_ in sorted(sizes))


def _relative(found: Search, one: Detectable) -> float:
    bench = found.benches[one.channel]
    return one.size / float(np.nanstd(bench.target[bench.fitted]))


def _in_response(
    comparison: Comparison, bench: Bench, named: list[int], thresholds: Mapping[str, float]
) -> Iterator[Detectable]:
    sums = bench.moments(bench.base(named))
    a, cross = sums.base.sum(axis=0), sums.cross.sum(axis=0)
    carried = inverse_of(a) @ cross
    left = np.concatenate([part.sum(axis=0).diagonal(axis1=1, axis2=2).ravel() for part in sums.within])
    order = np.concatenate([group.ravel() for group in sums.groups])
    norm = np.empty(len(order))
    norm[order] = left
    norm -= np.einsum("pm,pm->m", cross, carried)
    unit = comparison.channel(bench.response).unit
    for id_, threshold in thresholds.items():
        d = np.sqrt(threshold) + stats.norm.ppf(_CHANCE)
        shapes = [
            (d / float(np.sqrt(norm[candidate.first])), candidate)
            for candidate in bench.candidates
            if candidate.effect.id == id_ and norm[candidate.first] > 1e-6 * max(left.max(), 1e-300)
        ]
        if not shapes:
            continue
        size, candidate = sorted(shapes, key=lambda shape: shape[0])[len(shapes) // 2]
        variant = candidate.variant
        coefficients = np.zeros(len(variant.names))
        coefficients[0] = size / bench.scales[candidate.first]
        course = variant.columns[bench.fitted, 0] * coefficients[0]
        fitted = Fitted(
            bench.response, unit, variant, coefficients, np.zeros(len(coefficients)), {}, size, float(np.ptp(course))
        )
        yield Detectable(
            id_, bench.response, size, unit, _CHANCE, _in_words(candidate.effect.reading(fitted, comparison).parameters)
        )


def _in_words(parameters: Mapping[str, Quantity]) -> str:
    return ", ".join(f"{name} {quantity.value:.3g} {quantity.unit}" for name, quantity in parameters.items())
