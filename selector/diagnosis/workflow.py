"""From a comparison to an answer: recalibrate, estimate the noise, search, decide, show."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from selector.diagnosis.answer import Diagnosis, Evidence, Fit, NamedEffect, Place, Verdict
from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.catalogue import catalogue
from selector.diagnosis.effects.effect import Effect, Variant
from selector.diagnosis.entrance.copied import diagnosis_of_copy, fit_of_copy
from selector.diagnosis.entrance.unusable import identical_responses
from selector.diagnosis.evidence.bench import Bench, bench_of
from selector.diagnosis.evidence.confirmation import confirmation, not_ruinous
from selector.diagnosis.evidence.detectability import detectability
from selector.diagnosis.evidence.held_out_faults import held_out_faults
from selector.diagnosis.evidence.naming import input_fault_effect, named_effect, unit_of, whole_record_effect
from selector.diagnosis.evidence.recalibration import recalibrated
from selector.diagnosis.evidence.search import Search, Standing, numbers, search
from selector.diagnosis.evidence.showing import fit_of
from selector.diagnosis.evidence.whole_record import whole_record_names
from selector.diagnosis.evidence.without_frozen import diagnosis_without_frozen, frozen_and_unnamed
from selector.diagnosis.mismatch.location import active_windows
from selector.diagnosis.mismatch.omnibus import Structure, unexplained
from selector.diagnosis.mismatch.wanders import told_of_wandering
from selector.diagnosis.next_run.experiments import next_runs
from selector.diagnosis.shapes.input_faults import input_faults, told_of_inputs
from selector.diagnosis.shapes.leftover import least_squares
from selector.diagnosis.wording import headline

Vector = NDArray[np.float64]
_TRIFLE = 0.02
"""Of the share of the mismatch that the largest effect explains: what explains less is not named beside it."""
_LEAST = 0.005
"""Of the mismatch: what is smaller is not named unless held-out rows bear it out."""
_MOST = 0.5
_HARM = 1.05
_SUSPECTED = 0.8
"""What is left of a confidence that another programme does not bear out."""
_DOUBTFUL = 0.45
"""Weight below which an effect is no name where structure is left that nothing explains."""


class Progress(Protocol):
    """Told how far the work is: steps done, steps in all, what is done now."""

    def __call__(self, done: int, total: int, text: str, /) -> None:
        """Takes the news."""


def diagnosis(
    comparison: Comparison,
    *,
    seed: int = 0,
    false_alarm: float = 0.02,
    effects: Sequence[Effect] | None = None,
    through_model: Mapping[str, Mapping[str, Sequence[Variant]]] | None = None,
    progress: Progress | None = None,
) -> Diagnosis:
    """What the simulation left out, where, how sure that is, and what putting it in gains.

    Parameters
    ----------
    comparison
        Recordings and simulation on one clock.
    seed : int
        Of the draws of noise. The same seed gives the same answer, bit for bit.
    false_alarm : float
        Family-wise probability of naming an effect where there is none.
    effects : sequence of Effect, optional
        Default: the whole catalogue.
    through_model : mapping, optional
        Response → effect id → shapes that a runnable model gave.
    progress : callable, optional
        Told step by step.

    Raises
    ------
    InputError
        If the comparison is no basis for an answer.
    """
    copied = diagnosis_of_copy(comparison, seed=seed)
    if copied is not None:
        return copied
    copies = identical_responses(comparison)
    if copies:
        # without a difference there is no noise that a gain could be measured by
        rest = replace(comparison, responses=tuple(name for name in comparison.responses if name not in copies))
        found_in_rest = diagnosis(
            rest, seed=seed, false_alarm=false_alarm, effects=effects, through_model=through_model, progress=progress
        )
        return replace(
            found_in_rest, fit={**found_in_rest.fit, **{name: fit_of_copy(comparison, name) for name in copies}}
        )
    say = progress or (lambda done, total, text: None)
    known = tuple(effects if effects is not None else catalogue())
    benches: dict[str, Bench] = {}
    untested: dict[str, dict[str, str]] = {}
    steps = len(comparison.responses) + 3
    for k, name in enumerate(comparison.responses):
        say(k, steps, f"shapes of all effects in {name}")
        benches[name], untested[name] = bench_of(comparison, name, known, (through_model or {}).get(name))
    say(steps - 3, steps, "testing effects")
    found = search(benches, false_alarm=false_alarm, seed=seed)
    found = not_ruinous(comparison, _worth_naming(comparison, found))
    frozen = frozen_and_unnamed(comparison, found)
    if frozen:
        # what stands still says nothing about the machine, and would be fitted as if it did
        return diagnosis_without_frozen(
            comparison,
            frozen,
            lambda rest: diagnosis(
                rest, seed=seed, false_alarm=false_alarm, effects=effects, through_model=through_model,
                progress=progress,
            ),
            seed=seed,
        )  # fmt: skip
    benches = dict(found.benches)
    say(steps - 2, steps, "errors on held-out rows")
    again = {
        name: recalibrated(
            bench, numbers(found.named, name), _noise(bench, found, name), unit_of(comparison, name), seed=seed
        )
        for name, bench in benches.items()
    }
    say(steps - 1, steps, "what nothing explains")
    late = held_out_faults(comparison, found, known, false_alarm=false_alarm, seed=seed)
    only_fitted = bool(found.named) or bool(late) or any(bench.is_off_cycle for bench in benches.values())
    left = _left(comparison, found, only_fitted=only_fitted)
    structures = unexplained(comparison, *left, seed=seed, false_alarm=false_alarm)
    effects_found = [*(_confirmed(comparison, found, id_) for id_ in found.named), *late]
    doubts = structures
    if effects_found and not structures and max(effect.share for effect in effects_found) < _MOST:
        # what wanders may be noise, but a name must be clearer than it, or explain most
        doubts = unexplained(comparison, *left, seed=seed, false_alarm=false_alarm, wanders=False)
    if doubts and not any(_stands(effect, found, doubts) for effect in effects_found):
        # a fault of the data explains all that it concerns, or it is a proxy of what nothing explains
        effects_found = [effect for effect in effects_found if effect.id == "data.stuck"]
    if not effects_found and not structures:
        whole = whole_record_names(comparison, again)
        effects_found = [whole_record_effect(comparison, benches, again, id_, shown) for id_, shown in whole.items()]
        effects_found += [input_fault_effect(comparison, fault) for fault in input_faults(comparison) if fault.sure]
    named = tuple(sorted(effects_found, key=lambda effect: -effect.share))
    found = _only(found, {effect.id for effect in named})
    verdict = _verdict(named, structures, any(one.matters for one in again.values()))
    fit = {
        name: fit_of(
            comparison, bench, numbers(found.named, name), unit_of(comparison, name),
            recalibrate=verdict not in ("nothing-missing", "unexplained") or again[name].matters, seed=seed,
        )
        for name, bench in benches.items()
    }  # fmt: skip
    named = tuple(
        _doubted(effect) if effect.channel in fit and _harms(fit[effect.channel]) else effect for effect in named
    )
    answer = Diagnosis(
        comparison=comparison,
        verdict=verdict,
        headline="",
        where=_where(comparison, named, structures, left[0]),
        effects=named,
        fit=fit,
        evidence=tuple(_evidence(found, untested)),
        detectable=detectability(comparison, found, false_alarm=false_alarm),
        next_runs=next_runs(comparison, found, named),
        recalibration={name: one.quantities for name, one in again.items()},
        findings=(
            *comparison.findings,
            *told_of_inputs(comparison, _channels_at_fault(named)),
            *told_of_wandering(comparison, left[0], structures),
        ),
        seed=seed,
    )
    return replace(answer, headline=headline(answer))


def _worth_naming(comparison: Comparison, found: Search) -> Search:
    """Without effects that are a trifle beside the largest: shapes are not exact to the last percent.

    In noise that wanders, the mean square hardly falls by what is quick and sure; how large its course is counts, too.
    Nor what is a trifle beside the mismatch and gains nothing on held-out rows, where it ought to.
    """
    named = {id_: named_effect(comparison, found, id_) for id_ in found.named}
    least = _TRIFLE * max((effect.share for effect in named.values()), default=0.0)
    sizes = {id_: max(effect.share, _part(found, effect)) for id_, effect in named.items()}
    worth = {id_ for id_, size in sizes.items() if size >= least}
    return _only(
        found,
        {id_ for id_ in worth if sizes[id_] >= _LEAST or not confirmation(comparison, found, id_).refutes},
    )


def _part(found: Search, effect: NamedEffect) -> float:
    """Mean square of an effect's course in parts of that of the mismatch beside recalibration, fitted rows."""
    parts = []
    for name, course in effect.courses.items():
        rows = found.benches[name].fitted
        alone = float(np.mean(found.benches[name].residual([])[rows] ** 2))
        parts.append(float(np.var(course[rows])) / alone if alone > 0.0 else 0.0)
    return max(parts)


def _only(found: Search, ids: set[str]) -> Search:
    """The search with only some of the effects named."""
    return replace(found, named={id_: of for id_, of in found.named.items() if id_ in ids})


def _left(comparison: Comparison, found: Search, *, only_fitted: bool) -> tuple[dict[str, Vector], dict[str, Vector]]:
    """Residuals, and the same behind the noise filter; of named effects on the fitted rows alone.

    What a named effect does on another programme may differ a little from its fit, and is no other effect; so is what
    comes back with a cycle.
    """
    looked = ~comparison.held_out if only_fitted else np.ones(len(comparison.time_s), dtype=bool)
    residuals, white = {}, {}
    for name, bench in found.benches.items():
        of = numbers(found.named, name)
        residuals[name] = np.where(looked, bench.residual(of), np.nan)
        white[name] = np.where(looked, bench.white_residual(of), np.nan)
    return residuals, white


def _channels_at_fault(named: Sequence[NamedEffect]) -> set[str]:
    return {channel for effect in named if not _is_physics(effect) for channel in effect.channels}


def _is_physics(effect: NamedEffect) -> bool:
    return not effect.id.startswith("data.")


def _stands(effect: NamedEffect, found: Search, structures: Sequence[Structure]) -> bool:
    """Whether an effect is a name although structure is left: sure, borne out, and clearer than what is left.

    What explains most of the mismatch is a name all the same.
    """
    if effect.share >= _MOST:
        return True
    if effect.suspected or found.weights.get(effect.id, {effect.id: 1.0})[effect.id] < _DOUBTFUL:
        return False
    return effect.id not in found.standing or found.standing[effect.id].score >= -2.0 * np.log(structures[0].p_value)


def _confirmed(comparison: Comparison, found: Search, id_: str) -> NamedEffect:
    """The named effect; suspected only, where it ought to show on held-out rows and gains nothing there."""
    effect = named_effect(comparison, found, id_)
    return _doubted(effect) if confirmation(comparison, found, id_).refutes else effect


def _doubted(effect: NamedEffect) -> NamedEffect:
    return effect if effect.suspected else replace(effect, suspected=True, confidence=_SUSPECTED * effect.confidence)


def _harms(fit: Fit) -> bool:
    """Whether the held-out error is clearly larger with what was found than with recalibration alone."""
    return fit.heldout.rmse_after > _HARM * fit.recalibrated_heldout > 0.0


def _verdict(named: Sequence[NamedEffect], structures: Sequence[Structure], is_recalibrated: bool) -> Verdict:
    if any(_is_physics(effect) for effect in named):
        return "missing-physics"
    if named:
        return "data-fault"
    if structures:
        return "unexplained"
    return "miscalibrated" if is_recalibrated else "nothing-missing"


def _noise(bench: Bench, found: Search, name: str) -> Vector:
    base = bench.base(numbers(found.named, name))
    return np.asarray(bench.white_target - base @ least_squares(base, bench.white_target))


def _where(
    comparison: Comparison,
    named: Sequence[NamedEffect],
    structures: Sequence[Structure],
    residuals: Mapping[str, Vector],
) -> tuple[Place, ...]:
    """Windows in which the named effects act, or in which what nothing explains is large."""
    found: list[Place] = []
    for effect in named:
        if effect.acts is not None:
            run, first, last = effect.acts
            rows = comparison.time_s[comparison.run_index == comparison.runs.index(run)]
            first, last = rows[0] if first is None else first, rows[-1] if last is None else last
            found += [
                Place(channel, effect.place, run, float(first), float(last), None, effect.share)
                for channel in effect.channels
            ]
            continue
        for channel in effect.channels:
            windows = active_windows(comparison, channel, effect.courses[channel])
            found += [replace(place, place=effect.place, share=place.share * effect.share) for place in windows]
    if not named and structures:
        surest = structures[0]
        regime = surest.regime or _band(surest)
        windows = active_windows(comparison, surest.channel, residuals[surest.channel])
        found += [replace(place, regime=place.regime or regime, p_value=surest.p_value) for place in windows]
    return tuple(found)


def _band(structure: Structure) -> str | None:
    if structure.frequency_hz is None:
        return None
    low, high = structure.frequency_hz
    return f"{low:.3g} to {high:.3g} Hz" if low < high else f"{low:.3g} Hz"


def _evidence(found: Search, untested: Mapping[str, Mapping[str, str]]) -> list[Evidence]:
    rows = []
    for id_, standing in sorted(found.standing.items(), key=lambda item: -item[1].score):
        rows.append(
            Evidence(id_, standing.responses[0], standing.score, standing.p_value, id_ in found.named, _note(standing))
        )
    tested = set(found.standing)
    for response, reasons in untested.items():
        rows += [
            Evidence(id_, response, 0.0, 1.0, False, f"not testable here: {why}")
            for id_, why in reasons.items()
            if id_ not in tested
        ]
    return rows


def _note(standing: Standing) -> str:
    return "" if standing.is_the_same_in_all_runs else "differs from run to run"
