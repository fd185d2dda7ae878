"""Two channels that have changed places."""

from collections.abc import Iterator
from itertools import combinations

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.data._places import single_runs, whole_runs
from selector.diagnosis.effects.effect import Effect, Fitted, Reading, Variant, equally_likely, words_of
from selector.diagnosis.shapes.input_faults import fault_variants, or_of_input
from selector.diagnosis.shapes.residual import exchanged, weights_of_readings
from selector.diagnosis.shapes.signals import excited

_AROUND_ONE = ((0.7, 1.3),)


def _variants(comparison: Comparison, response: str) -> Iterator[Variant]:
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


def _testable(comparison: Comparison, response: str) -> str | None:
    lacking = "no other channel of the same quantity was recorded and simulated, or read by the simulation"
    return lacking if next(_variants(comparison, response), None) is None else None


def _reading(fitted: Fitted, comparison: Comparison) -> Reading:
    one, other = fitted.variant.sources
    changed = f"have changed places{fitted.where}"
    text = (
        f"{one} and {other} {changed}: so read, the simulation of {fitted.response} is off by up to {fitted.up_to}."
        if one != fitted.response
        else f"What stands under {one} is what was simulated for {other}: the two channels {changed}."
    )
    return Reading(text, {"share": fitted.coefficient("1")})


EFFECT = Effect(**words_of("data.swapped"), variants=_variants, testable=_testable, reading=or_of_input(_reading))
