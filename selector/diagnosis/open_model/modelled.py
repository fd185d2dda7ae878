"""What a simulation left out that can be run again: refit, test effects through it, put them in."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from selector.diagnosis.answer import Diagnosis, Errors, Evidence, Fit, NamedEffect, Verdict
from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.catalogue import catalogue, effect_of
from selector.diagnosis.effects.effect import Quantity
from selector.diagnosis.evidence.gain import share_closed
from selector.diagnosis.finding_table import FINDINGS
from selector.diagnosis.matching.alignment import comparison_of
from selector.diagnosis.matching.usable import identical_responses
from selector.diagnosis.mismatch.location import active_windows
from selector.diagnosis.open_model.refitting import Refitted, Say, refitted, simulated_rows
from selector.diagnosis.open_model.runnable import OwnModel, Runnable
from selector.diagnosis.open_model.switches import Switch, ThroughModel, through_model
from selector.diagnosis.wording import headline
from selector.diagnosis.workflow import diagnosis
from selector.errors import InputError
from selector.findings import Finding
from selector.recording import Recording
from selector.types import Vector

_TELLS = 0.01
"""Share of the noise from sample to sample that an error of the steps stays below."""
_DOUBLINGS = 8


def with_longest_steps(
    model: Runnable, recording: Recording, *, responses: Sequence[str] | None = None, holdout: str = "last"
) -> Runnable:
    """The model with the longest internal steps that give what those of its file give, to within a trifle of the noise.

    A search simulates some hundred times. Steps are doubled until it is told; other models than those of heat are
    given back as they are.

    Parameters
    ----------
    model
        What is searched.
    recording, responses, holdout
        As of `alignment.comparison_of`.

    Raises InputError: the recordings cannot drive the model, or nothing can be compared.
    """
    if not isinstance(model, OwnModel) or model.kind != "thermal" or not hasattr(model.file.run, "step_s"):
        return model
    comparison = comparison_of(recording, model.simulated({}), responses=responses, holdout=holdout)
    # what changes from sample to sample, as of a course that does not go on
    noise = {name: _rms(np.diff(comparison.difference(name))) / np.sqrt(2.0) for name in comparison.responses}
    chosen = model
    for doubled in range(1, _DOUBLINGS + 1):
        tried = replace(model, step_s=float(model.file.run.step_s) * 2.0**doubled)
        try:
            courses = simulated_rows(comparison, tried.simulated({}))
        except InputError:
            break
        if any(not _rms(courses[name] - comparison.simulated[name]) <= _TELLS * noise[name] for name in noise):
            break
        chosen = tried
    return chosen


_FLOOR = 0.02
"""Share of the mean square that something has to take away to be worth a word."""
_MOST = 4
_NEAR = 1.1
_SUSPECTED = 0.5
"""Confidence in a name whose correction makes no error smaller."""
_SIZES = (1.0, 2.0, 4.0, 8.0)
"""Where the fit of an effect may begin, in parts of its linear estimate, which what stands in for it makes small."""


@dataclass(frozen=True, eq=False)
class Improved:
    """The model with what it left out."""

    model: OwnModel
    added: tuple[str, ...]  #: Effects that are in it now
    not_in_it: tuple[str, ...]  #: Named effects that its file cannot express
    refit: Refitted  #: Everything fitted together


@dataclass(frozen=True, eq=False)
class Modelled:
    """A diagnosis in mode B or C."""

    answer: Diagnosis
    refit: Refitted  #: The simulation with its own parameters fitted, nothing added
    improved: Improved | None  #: In mode C, if something was put into the model


@dataclass(frozen=True, eq=False)
class _Found:
    """What one turn has found: the effect, how the model has it, and where the mismatch stood before."""

    effect: NamedEffect
    switch: Switch
    mismatch: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class _Turn:
    """Model, fit and answer of one turn."""

    model: Runnable
    refit: Refitted
    through: ThroughModel | None
    answer: Diagnosis


def diagnosis_of_model(
    runnable: Runnable,
    recording: Recording,
    *,
    responses: Sequence[str] | None = None,
    holdout: str = "last",
    seed: int = 0,
    false_alarm: float = 0.02,
    progress: Say | None = None,
) -> Modelled:
    """What a simulation left out that can be run again with other parameters.

    In mode C the effect that explains most is put into the model, everything is fitted again, and what is left is
    looked at anew, until nothing is found that the file can express.

    Parameters
    ----------
    runnable
        A model of ours (mode C), a function or an FMU (mode B).
    recording, responses, holdout
        As of `alignment.comparison_of`.
    seed, false_alarm
        As of `workflow.diagnosis`.
    progress : callable, optional
        Told steps done, steps in all, and what is done.

    Raises InputError: the recordings cannot drive the model, or nothing can be compared.
    """
    say = progress or (lambda done, total, text: None)
    say(0, 1000, "steps of the simulation")
    model = with_longest_steps(runnable, recording, responses=responses, holdout=holdout)
    found, starts = list[_Found](), list[dict[str, float]]()
    start: Refitted | None = None
    turns: list[_Turn] = []
    for number in range(_MOST):
        part = _part(say, number / _MOST, (number + 1) / _MOST)
        again = refitted(
            model, recording, responses=responses, holdout=holdout, added=starts, start=start, progress=part(0.0, 0.5)
        )
        through = through_model(model, again, progress=part(0.5, 0.7)) if isinstance(model, OwnModel) else None
        known = catalogue()
        answer = diagnosis(
            again.comparison,
            seed=seed,
            false_alarm=false_alarm,
            effects=known if through is None else through.effects(known),
            through_model=None if through is None else through.shapes(known, again.comparison),
            progress=part(0.7, 1.0),
        )
        turns.append(_Turn(model, again, through, answer))
        first = turns[0].refit
        switched = None if through is None else _largest(answer, through, first, [one.effect.id for one in found])
        if switched is None or not isinstance(model, OwnModel) or number == _MOST - 1:
            break
        effect, switch, amounts = switched
        found.append(_Found(effect, switch, _squares(again.comparison)))
        earlier = {name: again.values[name] for name in (starts[0] if starts else {})}
        made = [model.with_changes(switch.changes([factor * a for a in amounts])) for factor in _SIZES]
        model = made[0]
        names = [name for name in switch.parameters if name in model.parameters]
        starts = [earlier | {name: one.parameters[name].value for name in names} for one in made]
        start = again
    return _answer(runnable, turns, found, seed)


def _part(say: Say, start: float, end: float) -> Callable[[float, float], Say]:
    """A stretch of the whole progress, of which a stretch again."""

    def within(first: float, last: float) -> Say:
        low, high = start + (end - start) * first, start + (end - start) * last
        return lambda done, total, text: say(round(1000 * (low + (high - low) * done / max(total, 1))), 1000, text)

    return within


def _largest(
    answer: Diagnosis, through: ThroughModel, first: Refitted, known: Sequence[str]
) -> tuple[NamedEffect, Switch, tuple[float, ...]] | None:
    """The largest named effect that the file can express and has not yet, with its amounts."""
    for effect in answer.effects:
        if effect.id in known or _share(effect, _squares(answer.comparison), _squares(first.comparison)) < _FLOOR:
            continue
        course = effect.courses[effect.channel]
        for variant in through.variants[effect.channel].get(effect.id, ()):
            switch = through.switch(variant)
            beta = np.linalg.lstsq(variant.columns, course, rcond=None)[0]
            left = float(np.abs(variant.columns @ beta - course).max())
            if switch is not None and left <= 1e-6 * float(np.abs(course).max()):
                amounts = np.maximum(beta, 1e-3 * np.array(switch.sizes)) if switch.is_amount else beta
                return effect, switch, tuple(amounts.tolist())
    return None


def _squares(comparison: Comparison) -> dict[str, float]:
    """Response → mean square of its mismatch on fitted rows."""
    return {name: _rms(comparison.difference(name)[~comparison.held_out]) ** 2 for name in comparison.responses}


def _share(effect: NamedEffect, now: Mapping[str, float], first: Mapping[str, float]) -> float:
    """Share of the mismatch of the refitted simulation that goes with an effect found when `now` was left of it."""
    return float(effect.share * min(1.0, now[effect.channel] / max(first[effect.channel], 1e-300)))


def _answer(runnable: Runnable, turns: Sequence[_Turn], found: Sequence[_Found], seed: int) -> Modelled:
    """What was put in, and what the last turn has found beside it."""
    first, last = turns[0], turns[-1]
    mismatch = _squares(first.refit.comparison)
    put = [replace(one.effect, share=_share(one.effect, one.mismatch, mismatch)) for one in found]
    left = _squares(last.refit.comparison)
    beside = [replace(e, share=_share(e, left, mismatch)) for e in last.answer.effects if e.share >= _FLOOR]
    beside = [
        e
        if any(_corrected(last, name) for name in e.channels)
        else replace(e, suspected=True, confidence=min(e.confidence, _SUSPECTED))
        for e in beside
        if e.share >= _FLOOR and e.id not in {one.id for one in put}
    ]
    effects = tuple(sorted([*_with_fitted(put, found, last), *beside], key=lambda effect: -effect.share))
    verdict: Verdict = "missing-physics" if any(not e.id.startswith("data.") for e in effects) else "data-fault"
    if not effects:
        # structure that nothing explains stands, however much the parameters took away
        if last.answer.verdict == "unexplained" and not _is_near_noise(last.answer):
            verdict = "unexplained"
        elif _is_recalibrated(first.refit) or last.answer.verdict == "miscalibrated":
            verdict = "miscalibrated"
        else:
            verdict = "unexplained" if last.answer.verdict == "unexplained" else "nothing-missing"
    lacking = [effect.id for effect in beside if not effect.id.startswith("data.")]
    improved = None
    if found and isinstance(last.model, OwnModel):
        improved = Improved(
            model=replace(last.model.with_values(last.refit.values), step_s=None),
            added=tuple(one.effect.id for one in found),
            not_in_it=tuple(lacking),
            refit=last.refit,
        )
    own = {} if first.through is None else first.through.own
    evidence = [replace(one, named=one.id in {e.id for e in effects}) for one in first.answer.evidence]
    evidence += [Evidence(id_, mismatch_of, 0.0, 1.0, False, f"not testable here: fitted as {name}")
                 for id_, name in own.items() for mismatch_of in list(mismatch)[:1]]  # fmt: skip
    findings = [*last.answer.findings, _mode(runnable, turns), *first.refit.findings]
    if lacking and runnable.mode == "C":
        findings.append(
            FINDINGS.finding(
                "not-in-model",
                f"The model file cannot express {', '.join(lacking)}: the errors of the answer are those with a "
                "correction beside the model.",
                evidence={"effects": lacking},
            )
        )
    where = [
        replace(place, place=effect.place, share=place.share * effect.share)
        for effect in effects
        for channel in effect.channels
        for place in active_windows(last.answer.comparison, channel, effect.courses[channel])
    ]
    answer = replace(
        last.answer,
        comparison=replace(last.answer.comparison, simulated=first.refit.nominal.simulated, findings=tuple(findings)),
        verdict=verdict,
        where=tuple(where) if effects else last.answer.where,
        effects=effects,
        fit={name: _fit(name, turns, seed, any(name in e.channels for e in beside)) for name in last.answer.fit},
        evidence=tuple(evidence),
        recalibration={**last.answer.recalibration, "model": dict(last.refit.quantities)},
        findings=tuple(findings),
    )
    if found:
        # that of the last turn knows nothing of what was put in
        answer = replace(answer, headline=headline(answer))
    return Modelled(answer, first.refit, improved)


def _with_fitted(put: Sequence[NamedEffect], found: Sequence[_Found], last: _Turn) -> list[NamedEffect]:
    """The effects with the numbers of the last fit, everything together, in the place of those they were found with."""
    result = []
    for effect, one in zip(put, found, strict=True):
        fitted = last.refit.quantities
        numbers = {name.rpartition(".")[2]: fitted[name] for name in one.switch.parameters if name in fitted}
        words = ", ".join(
            f"{key} {q.value:.4g} ({q.low:.4g} to {q.high:.4g}) {'' if q.unit == '1' else q.unit}".rstrip()
            for key, q in numbers.items()
            if q.low is not None
        )
        statement = f"{effect_of(effect.id).title} at {one.switch.place} is not in the model: {words}."
        told = {"parameters": numbers, "statement": statement} if numbers else {}
        result.append(replace(effect, **told))  # type: ignore[arg-type]
    return result


def _fit(name: str, turns: Sequence[_Turn], seed: int, has_more: bool) -> Fit:
    """Errors of the simulation as given, with its parameters fitted, and of the model that the last turn left.

    What that model cannot express is in the last errors as a correction beside it.
    """
    first, last = turns[0], turns[-1]
    comparison, one = last.refit.comparison, last.answer.fit[name]
    recorded, held = comparison.recorded[name], comparison.held_out
    before, middle = first.refit.nominal.simulated[name], first.refit.comparison.simulated[name]
    after = one.after if has_more and _corrected(last, name) else comparison.simulated[name]
    floor = one.heldout.noise_floor or 0.0
    return replace(
        one,
        train=Errors(_rms((recorded - before)[~held]), _rms((recorded - after)[~held])),
        heldout=Errors(_rms((recorded - before)[held]), _rms((recorded - after)[held]), one.heldout.noise_floor),
        recalibrated_heldout=_rms((recorded - middle)[held]),
        gap_closed=_closed((recorded - middle)[held], (recorded - after)[held], floor, seed) if len(turns) > 1
        else one.gap_closed,
        placebo_gain=first.answer.fit[name].placebo_gain,
        before=before,
        recalibrated=middle,
        after=after,
    )  # fmt: skip


def _corrected(last: _Turn, name: str) -> bool:
    """Whether the correction beside the model makes the error of the fitted rows smaller."""
    comparison, rows = last.refit.comparison, ~last.refit.comparison.held_out
    after = comparison.recorded[name] - last.answer.fit[name].after
    return _rms(after[rows]) < (1.0 - _FLOOR) * _rms(comparison.difference(name)[rows])


def _closed(middle: Vector, after: Vector, floor: float, seed: int) -> Quantity | None:
    """Share of the way from the refitted model to the noise that was gone, with a block bootstrap interval."""
    blocks = np.array_split(np.flatnonzero(np.isfinite(middle) & np.isfinite(after)), 20)
    return share_closed([block for block in blocks if len(block)], middle, after, floor, seed)


def _is_recalibrated(refit: Refitted) -> bool:
    """Whether the parameters took away more than a trifle of the mismatch, on held-out rows too."""
    held = refit.nominal.held_out
    copies = identical_responses(refit.nominal)
    return any(
        all(
            _rms(refit.comparison.difference(name)[rows]) ** 2
            < (1.0 - _FLOOR) * _rms(refit.nominal.difference(name)[rows]) ** 2
            for rows in (held, ~held)
        )
        for name in refit.nominal.responses
        if name not in copies
    )


def _is_near_noise(answer: Diagnosis) -> bool:
    """Whether no response is further off in unseen rows than its noise makes it."""
    held = [fit.heldout for fit in answer.fit.values()]
    return all(of.noise_floor is not None and of.rmse_after <= _NEAR * of.noise_floor for of in held)


def _mode(runnable: Runnable, turns: Sequence[_Turn]) -> Finding:
    what = "own model" if runnable.mode == "C" else "a black box that can be run again"
    refit, times = turns[0].refit, sum(turn.refit.runs for turn in turns)
    refitted = {name: dict(vars(one)) for name, one in turns[-1].refit.quantities.items()}
    return FINDINGS.finding(
        "mode",
        f"Mode {runnable.mode}: {what}, {runnable.name!r}; {len(refit.values)} parameters refitted, simulated {times} "
        "times.",
        evidence={"mode": runnable.mode, "refitted": refitted},
    )


def _rms(values: Vector) -> float:
    values = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(values**2))) if len(values) else 0.0
