"""Which responses froze beyond doubt, and a diagnosis without those stretches."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from selector.diagnosis.answer import Diagnosis, NamedEffect, Place
from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.data.stuck import LEAP, frozen_stretches, leap_after
from selector.diagnosis.evidence.naming import input_fault_effect
from selector.diagnosis.evidence.search import Search
from selector.diagnosis.matching.usable import LEAST_SAMPLES, fit_of_copy, not_compared, rows_in_stretches
from selector.diagnosis.shapes.input_faults import InputFault
from selector.diagnosis.shown_units import unit_words
from selector.diagnosis.wording import headline
from selector.number_text import span_text
from selector.types import Mask

_AS_FAR_OFF = 0.5  #: Of the mean square elsewhere: less of a mismatch says nothing against the readings of a stretch.
_LARGEST_STEPS = 0.99  #: Quantile of the steps from one reading to the next: beyond it nothing just starts to move.


def frozen_responses(comparison: Comparison) -> tuple[InputFault, ...]:
    """Frozen stretches of responses, fitted and held-out runs; equal readings prove them, so no test is needed.

    They prove nothing where the simulation is no further off than elsewhere: what has arrived stands still, while a
    poor simulation of it creeps on. What leaps from there as the simulation does not has woken up; what moves on from
    where it stood was held, by friction or a brake.
    """
    faults = []
    for name in comparison.responses:
        expected, resolution = comparison.simulated_course(name), comparison.resolution.get(name, 0.0)
        difference = comparison.difference(name)
        stretches = frozen_stretches(comparison, name, surely=True)
        steps = np.abs(np.diff(comparison.recorded[name], append=np.nan))
        largest = np.nanquantile(steps, _LARGEST_STEPS) if stretches else np.nan
        elsewhere = np.isfinite(difference)
        for _, first, last in stretches:
            elsewhere[first : last + 1] = False
        usual = float(np.median(difference[elsewhere])) if elsewhere.any() else 0.0
        squares = (difference - usual) ** 2
        least = _AS_FAR_OFF * float(np.mean(squares[elsewhere])) if elsewhere.any() else 0.0
        for run, first, last in stretches:
            here = np.zeros(len(expected), dtype=bool)
            here[first : last + 1] = True
            leap = leap_after(comparison, difference, last, resolution)
            # what starts to move goes by a step that it usually takes
            wakes_up = leap > LEAP and bool(steps[last] > largest)
            goes_on = leap_after(comparison, comparison.recorded[name], last, resolution) <= LEAP
            if goes_on or (np.nanmean(squares[here]) < least and not wakes_up):
                continue
            from_s, to_s = float(comparison.time_s[first]), float(comparison.time_s[last])
            reading, samples = float(comparison.recorded[name][first]), last - first + 1
            statement = (
                f"{name} in run {run} stands at {reading:.6g} {unit_words(comparison.channel(name).unit)} for "
                f"{span_text(to_s - from_s)} from {span_text(from_s)} on: {samples} equal samples, silent nowhere else."
            )
            evidence, course = {"samples": samples, "value": reading}, np.where(here, reading - expected, 0.0)
            faults.append(InputFault("data.stuck", name, run, from_s, to_s, statement, True, evidence, course))
    return tuple(faults)


def frozen_and_unnamed(comparison: Comparison, found: Search) -> tuple[InputFault, ...]:
    """Frozen stretches of responses that the search has not named itself, and has therefore fitted."""
    named = {
        (name, found.benches[name].candidates[k].variant.run) for name, k in found.named.get("data.stuck", {}).items()
    }
    return tuple(fault for fault in frozen_responses(comparison) if (fault.channel, fault.run) not in named)


def without_frozen(comparison: Comparison, frozen: Sequence[InputFault]) -> Comparison:
    """The comparison without these stretches; a response of which too little is left is not looked at any further."""
    recorded = dict(comparison.recorded)
    for fault in frozen:
        name = str(fault.channel)
        recorded[name] = np.where(_rows(comparison, fault), np.nan, recorded[name])
    rest = replace(comparison, recorded=recorded)
    kept = tuple(name for name in comparison.responses if _is_enough(rest, name))
    lost = [name for name in comparison.responses if name not in kept]
    clause = f"has fewer than {LEAST_SAMPLES} samples left to fit to without its frozen stretches"
    told = (not_compared(name, clause, "record it again with a sensor that works") for name in lost)
    return replace(rest, responses=kept, findings=(*comparison.findings, *told))


def with_frozen(
    answer: Diagnosis, *, comparison: Comparison, rest: Comparison, frozen: Sequence[InputFault]
) -> Diagnosis:
    """The answer to the `rest` of a comparison, and its frozen stretches as frozen readings."""
    effects = [_effect(comparison, fault) for fault in frozen]
    places = (
        Place(effect.channel, effect.place, fault.run, fault.from_s, fault.to_s, None, effect.share)
        for effect, fault in zip(effects, frozen, strict=True)
    )
    answer = replace(
        answer,
        comparison=replace(comparison, findings=rest.findings),
        verdict="missing-physics" if answer.verdict == "missing-physics" else "data-fault",
        where=(*places, *answer.where),
        effects=tuple(sorted([*answer.effects, *effects], key=lambda effect: -effect.share)),
        fit={
            name: answer.fit[name] if name in answer.fit else fit_of_copy(rest, name) for name in comparison.responses
        },
    )
    return replace(answer, headline=headline(answer))


def _rows(comparison: Comparison, fault: InputFault) -> Mask:
    here = comparison.run_index == comparison.runs.index(fault.run)
    return np.asarray(here & (comparison.time_s >= fault.from_s) & (comparison.time_s <= fault.to_s), dtype=np.bool_)


def _is_enough(comparison: Comparison, name: str) -> bool:
    """Whether a response has rows enough to be fitted to, and moves in them."""
    compared = np.isfinite(comparison.difference(name))
    if rows_in_stretches(comparison, compared & ~comparison.held_out) < LEAST_SAMPLES:
        return False
    return float(np.ptp(comparison.recorded[name][compared])) > 0.0


def _effect(comparison: Comparison, fault: InputFault) -> NamedEffect:
    """The frozen reading, with the share of the squared difference that stands in its stretch."""
    effect = input_fault_effect(comparison, fault)
    squares = comparison.difference(effect.channel) ** 2
    here = _rows(comparison, fault)
    whole = float(np.nansum(squares))
    return replace(effect, share=float(np.nansum(squares[here])) / whole if whole > 0.0 else 0.0)
