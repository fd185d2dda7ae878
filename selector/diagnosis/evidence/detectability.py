"""Which size of an effect would this record have shown? What is smaller may be there."""

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np
from scipy import stats
from scipy.optimize import brentq

from selector.diagnosis.answer import Detectable
from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.effect import Fitted
from selector.diagnosis.evidence.moments import solved
from selector.diagnosis.evidence.response import Bench
from selector.diagnosis.evidence.search import Search, numbers
from selector.diagnosis.evidence.testing import evidence_of, members_of, prices_of, tail_threshold, together
from selector.diagnosis.wording import amount
from selector.types import Vector

_LEFT = 1e-3  #: Of the norm of a course: what recalibration leaves less of is not seen.
_CHANCE = 0.9


def detectability(comparison: Comparison, found: Search, *, false_alarm: float) -> tuple[Detectable, ...]:
    """Per effect that was tested and not named, the size that would have been found in 9 of 10 such records.

    The size is the root mean square of the effect's course in the response that shows it best, of its median shape.
    An effect whose whitened course, recalibration and named effects projected off, has the norm d gains χ² about d²,
    and as much of it by every other shape of the effect as that has in common with the course.
    """
    sizes: dict[str, Detectable] = {}
    spread = {name: float(np.nanstd(bench.target[bench.fitted])) for name, bench in found.benches.items()}
    for response, bench in found.benches.items():
        thresholds = {
            id_: tail_threshold(false_alarm, standing.noise)
            for id_, standing in found.standing.items()
            if response in standing.tested and id_ not in found.named
        }
        for one in _in_response(comparison, bench, numbers(found.named, response), thresholds):
            if one.id not in sizes or one.size / spread[response] < sizes[one.id].size / spread[sizes[one.id].channel]:
                sizes[one.id] = one
    return tuple(sizes[id_] for id_ in sorted(sizes))


def _in_response(
    comparison: Comparison, bench: Bench, named: list[int], thresholds: Mapping[str, float]
) -> Iterator[Detectable]:
    base = bench.base(named)
    sums = bench.moments(base)
    kept = np.linalg.qr(base)[0]
    prices, members = prices_of(bench), members_of(bench)
    unit = comparison.channel(bench.response).unit
    for id_, threshold in thresholds.items():
        shapes = []
        for v in members[id_]:
            first = bench.candidates[v].columns.start
            course = bench.white_columns[:, first] - kept @ (kept.T @ bench.white_columns[:, first])
            norm = float(np.linalg.norm(course))
            if norm > _LEFT * float(np.linalg.norm(bench.white_columns[:, first])):
                shapes.append((1.0 / norm, first, course / norm, bench.candidates[v]))
        if not shapes:
            continue
        per_d, first, course, candidate = sorted(shapes, key=lambda shape: shape[0])[len(shapes) // 2]
        of_course = replace(
            sums,
            base_target=np.zeros_like(sums.base_target),
            target=np.array([bench.white_columns[rows].T @ course[rows] for rows in bench.blocks]),
        )
        shared = solved(of_course).gain[members[id_]]
        size = per_d * (_weakest(shared, prices[members[id_]], threshold) + float(stats.norm.ppf(_CHANCE)))
        variant = candidate.variant
        coefficients = np.zeros(len(variant.names))
        coefficients[0] = size / bench.scales[first]
        course = variant.columns[bench.fitted, 0] * coefficients[0]
        fitted = Fitted(
            bench.response, unit, variant, coefficients, 0.0 * coefficients, {}, size, float(np.ptp(course))
        )
        parameters = candidate.effect.reading(fitted, comparison).parameters
        told = [(one.meaning, parameters[one.name]) for one in candidate.effect.parameters if one.name in parameters]
        note = "; ".join(f"{meaning}: {amount(value.value, value.unit)}" for meaning, value in told)
        yield Detectable(id_, bench.response, size, unit, _CHANCE, note)


def _weakest(shared: Vector, prices: Vector, threshold: float) -> float:
    """The norm d of a course at which d²·`shared`, as gains of all shapes, makes evidence of the `threshold`."""
    highest = np.sqrt((max(threshold, 0.0) + prices.max() + 2.0 * np.log(len(prices)) + 4.0) / max(shared.max(), 1e-3))

    def missing(d: float) -> float:
        return float(together([evidence_of(d**2 * shared, prices)])) - threshold

    return float(brentq(missing, 0.0, highest, xtol=1e-3)) if missing(0.0) < 0.0 < missing(highest) else float(highest)
