"""What a simulation left out that can be run again: refit, test effects through it, put them in."""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from selector.diagnosis.answer import Diagnosis, Errors, Evidence, Fit, NamedEffect, NextRun, Verdict
from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.catalogue import catalogue, effect_of
from selector.diagnosis.effects.effect import Quantity
from selector.diagnosis.evidence.confirmation import share_closed
from selector.diagnosis.finding_table import FINDINGS
from selector.diagnosis.matching.alignment import comparison_of
from selector.diagnosis.matching.usable import identical_responses, rms
from selector.diagnosis.mismatch.location import active_windows
from selector.diagnosis.open_model import switches
from selector.diagnosis.open_model.refitting import Refitted, Say, refitted, simulated_rows
from selector.diagnosis.open_model.runnable import OwnModel, Runnable
from selector.diagnosis.wording import headline, is_data
from selector.diagnosis.workflow import diagnosis
from selector.errors import InputError
from selector.findings import Finding
from selector.recording import Recording
from selector.types import Vector

_TELLS = 0.01  #: Share of the noise from sample to sample that an error of the steps stays below.
_DOUBLINGS = 8


def with_longest_steps(
    model: Runnable, recording: Recording, *, responses: Sequence[str] | None = None, holdout: str = "last"
) -> Runnable:
    """The model with the longest internal steps that give what those of its file give, to within a trifle of the noise.

    Other models than those of heat are given back as they are. `responses` and `holdout` are those of
    `alignment.comparison_of`.

    Raises InputError: the recordings cannot drive the model, or nothing can be compared.
    """
    if not isinstance(model, OwnModel) or model.kind != "thermal" or not hasattr(model.file.run, "step_s"):
        return model
    comparison = comparison_of(recording, model.simulated({}), responses=responses, holdout=holdout)
    # what changes from sample to sample, as of a course that does not go on
    noise = {name: rms(np.diff(comparison.difference(name))) / np.sqrt(2.0) for name in comparison.responses}
    chosen = model
    for doubled in range(1, _DOUBLINGS + 1):
        tried = replace(model, step_s=float(model.file.run.step_s) * 2.0**doubled)
        try:
            courses = simulated_rows(comparison, tried.simulated({}))
        except InputError:
            break
        if any(not rms(courses[name] - comparison.simulated[name]) <= _TELLS * noise[name] for name in noise):
            break
        chosen = tried
    return chosen


_FLOOR = 0.02  #: Share of the mean square that something has to take away to be worth a word.
_TRIED = 2
_MOST = 3  #: Effects that are put into a model one after the other.
_AT_NOISE, _NEAR = 1.1, 1.3  #: Times the noise: unseen errors up to which parameters may be all that was wrong.
_RUIN = 1.1  #: Times the unseen mean squares that an effect may leave which is borne out in one response.
_NEARLY_ALL = 0.8  #: Of the way from the simulation as given to the noise.
_CARRIES = 0.15  #: Of the unseen misfit: names that carry less are none where structure is left.
#: The same of physics beside the model, which has a coefficient for every response and imitates what is nobody's.
_BESIDE = 0.5
_AT_END = 1e-3  #: So near to a limit of an exponent or a share is at it.
_MOST_SURE = 0.85  #: Of 25 names that the blind proof had put into models, or beside them, 22 were right.
#: Of physics that the model file cannot take in: what rubs or gives way otherwise than in the model looks like it.
_MOST_SURE_BESIDE = 0.5
_MANY = 3  #: Names of physics beside the model from which on any smooth misfit may have been put together from them.
_SUSPECTED = 0.5  #: What is left of the confidence in a name that unseen rows could not bear out.
_SHRINKS = 0.5  #: Part of its size that an effect keeps beside the next one, if it does not only stand in for it.
#: Where the fit of an effect may begin, in parts of its linear estimate, which what stands in for it makes small.
_SIZES = (1.0, 2.0, 4.0, 8.0)


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
class _Put:
    """An effect that was put into the model: what was found, and model and fit with it."""

    alike: tuple[switches.Candidate, ...]  #: The effect, and the rivals that do as well
    is_borne_out: bool  #: Whether unseen rows gain by it
    model: OwnModel
    refit: Refitted
    start: Mapping[str, float]  #: Its parameters as they were put in

    @property
    def best(self) -> switches.Candidate:
        """What was put in."""
        return self.alike[0]

    @property
    def rivals(self) -> tuple[str, ...]:
        """Effects that do as well."""
        return tuple(one.switch.id for one in self.alike[1:])


@dataclass(frozen=True, eq=False)
class _Tried:
    """The way of a diagnosis through a model: fitted as given, and with one effect after the other."""

    first: Refitted
    through: switches.ThroughModel | None  #: Of the first fit
    put: tuple[_Put, ...]
    stood: tuple[switches.Candidate, ...]  #: Every effect in its best way, beside parameters alone
    answer: Diagnosis  #: To what the last fit leaves

    @property
    def last(self) -> Refitted:
        """The fit with everything that was put in."""
        return self.put[-1].refit if self.put else self.first


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

    `runnable` is a model of ours (mode C), a function or an FMU (mode B). `responses` and `holdout` are those of
    `alignment.comparison_of`, `seed` and `false_alarm` those of `workflow.diagnosis`; `progress` is told steps done,
    steps in all, and what is done.

    Raises InputError: the recordings cannot drive the model, or nothing can be compared.
    """
    say = progress or (lambda done, total, text: None)
    say(0, 1000, "steps of the simulation")
    model = with_longest_steps(runnable, recording, responses=responses, holdout=holdout)
    part = _part(say, 0.0, 0.4)
    first = refitted(model, recording, responses=responses, holdout=holdout, progress=part(0.0, 1.0))
    through, put, stood, refused = None, list[_Put](), list[switches.Candidate](), set[tuple[str, ...]]()
    while isinstance(model, OwnModel) and len(put) < _MOST:
        with_one = partial(_with, model, first, recording, responses, holdout)
        part = _part(say, 0.4 + 0.15 * len(put), 0.55 + 0.15 * len(put))
        now = put[-1].refit if put else first
        shown = switches.through_model(put[-1].model if put else model, now, progress=part(0.0, 0.5))
        left, mismatch = _squares(now.comparison), _squares(first.comparison)
        found = switches.candidates(now, shown, {name: left[name] / max(mismatch[name], 1e-300) for name in left})
        through, stood = (shown, found) if through is None else (through, stood)
        step = None
        there = {one.best.switch.parameters for one in put}
        for alike in switches.chosen(found, false_alarm, there | refused)[:_TRIED]:
            step = with_one(part(0.5, 1.0), put, alike)
            if step is not None:
                break
            refused.add(alike[0].switch.parameters)
        if step is None:
            break
        put = _settled([*put, step], partial(with_one, part(0.5, 1.0)))
    last = put[-1].refit if put else first
    answer = diagnosis(
        last.comparison,
        seed=seed,
        false_alarm=false_alarm,
        effects=catalogue() if through is None else through.effects(catalogue()),
        progress=_part(say, 0.85, 1.0)(0.0, 1.0),
    )
    return _answer(runnable, _Tried(first, through, tuple(put), tuple(stood), answer), seed)


def _settled(
    put: list[_Put], with_one: Callable[[Sequence[_Put], tuple[switches.Candidate, ...]], _Put | None]
) -> list[_Put]:
    """Without what only stood in for the last effect: what shrinks beside it, and without which all errors stay."""
    *earlier, last = put
    names = [one.best.switch.parameters[0] for one in earlier]
    kept = [
        one for one, name in zip(earlier, names, strict=True)
        if abs(last.refit.values.get(name, np.inf)) > _SHRINKS * abs(one.refit.values.get(name, 0.0))
    ]  # fmt: skip
    again: list[_Put] = []
    for alike in (*(one.alike for one in kept), last.alike):
        if len(kept) == len(earlier) or (step := with_one(again, alike)) is None:
            return put
        again.append(step)
    units = dict.fromkeys(last.refit.comparison.responses, 1.0)
    for squares in (_squares, partial(switches.unseen_squares, floor=units)):
        was, now = squares(last.refit.comparison), squares(again[-1].refit.comparison)
        if any(now[name] > _RUIN * max(was[name], 1e-300) for name in was):
            return put
    return again


def _with(
    given: OwnModel, first: Refitted, recording: Recording, responses: Sequence[str] | None, holdout: str,
    progress: Say, put: Sequence[_Put], alike: tuple[switches.Candidate, ...],
) -> _Put | None:  # fmt: skip
    """The model with an effect beside what was `put` into it, everything fitted again.

    None where unseen rows do not gain by it after all.
    """
    model, now, earlier = (put[-1].model, put[-1].refit, put[-1].start) if put else (given, first, {})
    best, switch = alike[0], alike[0].switch
    amounts = np.maximum(best.amounts, 1e-3 * np.array(switch.sizes)) if switch.is_amount else np.array(best.amounts)
    made: list[OwnModel] = []
    for factor in _SIZES:
        with suppress(InputError):  # larger than the file can have
            made.append(model.with_changes(switch.changes((factor * amounts).tolist())))
    if not made:
        return None
    names = [name for name in switch.parameters if name in made[0].parameters]
    kept = {name: now.values[name] for name in earlier if name in now.values}
    starts = [kept | {name: one.parameters[name].value for name in names} for one in made]
    again = refitted(
        made[0], recording, responses=responses, holdout=holdout, added=starts, start=now, progress=progress
    )
    # a law whose shape runs to an end of what it can be stands for another one
    ends = {name: made[0].parameters[name] for name in names if made[0].parameters[name].unit == "1"}
    if any(min(again.values[name] - one.low, one.high - again.values[name]) < _AT_END for name, one in ends.items()):
        return None
    floor = {name: switches.quick_noise(again.comparison, name) for name in again.comparison.responses}
    was, left = (switches.unseen_squares(one.comparison, floor) for one in (now, again))
    off = [name for name in was if was[name] > _NEAR**2]
    # where unseen rows are near the noise already they cannot bear anything out
    is_borne_out = any(left[name] <= (1.0 - switches.LEAST) * was[name] for name in off) and not best.is_idle
    if sum(left.values()) > (_RUIN if is_borne_out or not off else 1.0) * sum(was.values()):
        return None
    # nor does what is near the noise with one effect lack another one
    if not is_borne_out and (earlier or (off and not best.is_idle)):
        return None
    return _Put(alike, is_borne_out, made[0], again, {**dict.fromkeys(kept, 0.0), **starts[0]})


def _part(say: Say, start: float, end: float) -> Callable[[float, float], Say]:
    """A stretch of the whole progress, of which a stretch again."""

    def within(first: float, last: float) -> Say:
        low, high = start + (end - start) * first, start + (end - start) * last
        return lambda done, total, text: say(round(1000 * (low + (high - low) * done / max(total, 1))), 1000, text)

    return within


def _answer(runnable: Runnable, tried: _Tried, seed: int) -> Modelled:
    """What was put in, and what was found beside it in what the last fit leaves."""
    first, last, answer = tried.first, tried.last, tried.answer
    put, beside, also = _sorted_out(tried)
    effects = tuple(sorted([*put, *beside], key=lambda effect: -effect.share))
    lacking = [effect.id for effect in beside if not is_data(effect.id)]
    improved = None
    if put:
        improved = Improved(
            model=replace(tried.put[-1].model.with_values(last.values), step_s=None),
            added=tuple(effect.id for effect in put),
            not_in_it=tuple(lacking),
            refit=last,
        )
    findings = [*answer.findings, _mode(runnable, tried), *first.findings]
    if lacking and runnable.mode == "C":
        said = "the errors of the answer are those with a correction beside the model."
        said = f"The model file cannot express {', '.join(lacking)}: {said}"
        findings.append(FINDINGS.finding("not-in-model", said, evidence={"effects": lacking}))
    where = [
        replace(place, place=effect.place, share=place.share * effect.share)
        for effect in effects
        for channel in effect.channels
        for place in active_windows(answer.comparison, channel, effect.courses[channel])
    ]
    sets = [(one, (one.id, *one.cannot_be_told_from)) for one in put]
    if len(beside) < len(answer.effects):
        # what is told of offset, gain and delay stands beside what is told, and nothing else
        alone = diagnosis(last.comparison, seed=seed, effects=[effect_of(one.id) for one in beside])
        answer = replace(answer, recalibration=alone.recalibration)
    result = replace(
        answer,
        comparison=replace(answer.comparison, simulated=first.nominal.simulated, findings=tuple(findings)),
        verdict=_verdict(tried, effects),
        where=tuple(where) if effects else answer.where,
        effects=effects,
        also_seen=tuple(also),
        fit={name: _fit(name, tried, seed, any(name in e.channels for e in beside)) for name in answer.fit},
        evidence=tuple(_evidence(tried, {e.id for e in effects})),
        next_runs=(*(NextRun(one.experiment, ids, None, None) for one, ids in sets if len(ids) > 1), *answer.next_runs),
        recalibration={**answer.recalibration, "model": dict(last.quantities)},
        findings=tuple(findings),
    )
    # that of the rest knows nothing of what was put in
    return Modelled(replace(result, headline=headline(result)), first, improved)


def _sorted_out(tried: _Tried) -> tuple[list[NamedEffect], list[NamedEffect], list[NamedEffect]]:
    """(what was put into the model, what is named beside it, what is only suspected) of all that was found."""
    first, last, answer = tried.first, tried.last, tried.answer
    mismatch, left = _squares(first.comparison), _squares(last.comparison)
    floor = _floors(tried)
    put, beside, also = _named(tried), list[NamedEffect](), [*answer.also_seen]
    corrected = replace(last.comparison, simulated={name: answer.fit[name].after for name in answer.fit})
    carries_beside = _carried(last.comparison, corrected, floor)
    asked = None if tried.through is None else {one.id for one in tried.through.effects(catalogue())}
    off = {name for name, squares in switches.unseen_squares(last.comparison, floor).items() if squares > _NEAR**2}
    for effect in answer.effects:
        one = replace(
            effect, share=effect.share * min(1.0, left[effect.channel] / max(mismatch[effect.channel], 1e-300))
        )
        if one.id in {e.id for e in put} or one.share < _FLOOR or not (asked is None or one.id in asked):
            continue
        # nor is a recording at fault beyond doubt where the model is still wrong elsewhere
        if off - set(one.channels) if is_data(one.id) else asked is not None:
            one = replace(one, confidence=min(one.confidence, _MOST_SURE_BESIDE))
        is_sure = is_data(one.id) or carries_beside >= _BESIDE
        is_sure &= any(_is_borne_out(tried, name, floor[name]) for name in one.channels)
        (beside if is_sure else also).append(one)
    if len(physics := [one for one in beside if not is_data(one.id)]) >= _MANY:
        beside, also = [one for one in beside if is_data(one.id)], [*also, *physics]
    if answer.verdict == "unexplained" and put and _carried(first.comparison, last.comparison, floor) < _CARRIES:
        put, also = [], [*also, *put]
    return put, beside, also


def _verdict(tried: _Tried, effects: Sequence[NamedEffect]) -> Verdict:
    if effects:
        return "data-fault" if all(is_data(one.id) for one in effects) else "missing-physics"
    held = [fit.heldout for fit in tried.answer.fit.values()]
    is_noise = all(of.noise_floor is not None and of.rmse_after <= _AT_NOISE * of.noise_floor for of in held)
    is_near = _is_near(tried.first.nominal, tried.last.comparison, _floors(tried))
    if (tried.answer.verdict == "unexplained" and not is_noise) or not is_near:
        return "unexplained"
    return (
        "miscalibrated"
        if _is_recalibrated(tried.first) or tried.answer.verdict == "miscalibrated"
        else "nothing-missing"
    )


def _carried(before: Comparison, after: Comparison, floor: Mapping[str, float]) -> float:
    """Share of the way to the noise that unseen mean squares of all responses together went."""
    was, now = (switches.unseen_squares(one, floor) for one in (before, after))
    return float((sum(was.values()) - sum(now.values())) / max(sum(was.values()) - len(was), 1e-300))


def _floors(tried: _Tried) -> dict[str, float]:
    """Response → its noise: from sample to sample, and what the answer to the rest takes for it, if that is more."""
    comparison, fit = tried.last.comparison, tried.answer.fit
    told = {name: fit[name].heldout.noise_floor or 0.0 for name in comparison.responses if name in fit}
    return {name: max(switches.quick_noise(comparison, name), told.get(name, 0.0)) for name in comparison.responses}


def _squares(comparison: Comparison) -> dict[str, float]:
    """Response → mean square of its mismatch on fitted rows."""
    return {name: rms(comparison.difference(name)[~comparison.held_out]) ** 2 for name in comparison.responses}


def _named(tried: _Tried) -> list[NamedEffect]:
    """What was put in, as an answer has it: with the numbers of the last fit, everything together."""
    named, fits = [], [tried.first, *(one.refit for one in tried.put)]
    mismatch = _squares(tried.first.comparison)
    floor = _floors(tried)
    for one, before, after in zip(tried.put, fits, fits[1:], strict=False):
        known, switch = effect_of(one.best.switch.id), one.best.switch
        fitted = tried.last.quantities
        numbers = {name.rpartition(".")[2]: fitted[name] for name in switch.parameters if name in fitted}
        words = ", ".join(
            f"{key} {q.value:.4g} ({q.low:.4g} to {q.high:.4g}) {'' if q.unit == '1' else q.unit}".rstrip()
            for key, q in numbers.items()
            if q.low is not None
        )
        words += f", at {switch.at_rpm:.0f} rpm" if switch.at_rpm else ""
        was, now = (_squares(fit.comparison) for fit in (before, after))
        shares = {name: (was[name] - now[name]) / max(mismatch[name], 1e-300) for name in was}
        carried = _carried(before.comparison, after.comparison, floor)
        sure = float(np.clip(carried, 0.0, 1.0)) / (1.0 + 0.5 * len(one.rivals))
        channels = sorted((name for name in shares if shares[name] >= _FLOOR), key=lambda name: -shares[name])
        named.append(
            NamedEffect(
                id=known.id,
                channel=channels[0] if channels else one.best.main,
                place=switch.place,
                statement=f"Put into the model it has {words}.",
                parameters=numbers,
                confidence=float(np.clip(sure, 0.01, _MOST_SURE))
                if one.is_borne_out
                else _SUSPECTED * max(sure, _SUSPECTED),
                p_value=one.best.p_value,
                share=float(np.clip(max(shares.values()), 0.0, 1.0)),
                cannot_be_told_from=one.rivals,
                experiment=known.experiment,
                channels=tuple(channels) or (one.best.main,),
                suspected=not one.is_borne_out,
                courses=one.best.courses,
                is_fitted=True,
            )
        )
    return named


def _evidence(tried: _Tried, named: Collection[str]) -> Iterator[Evidence]:
    """Effects through the model, then those beside it."""
    seen = set[str]()
    for one in tried.stood:
        if one.switch.id not in seen:
            seen.add(one.switch.id)
            note = "" if one.carried > 0.0 or one.switch.id in named else "not borne out by unseen rows"
            yield Evidence(one.switch.id, one.main, one.gain, one.p_value, one.switch.id in named, note)
    for row in tried.answer.evidence:
        if row.id not in seen:
            yield replace(row, named=row.id in named)
    response = next(iter(tried.first.comparison.responses))
    for id_, parameter in ({} if tried.through is None else tried.through.own).items():
        yield Evidence(id_, response, 0.0, 1.0, False, f"not testable here: fitted as {parameter}")


def _fit(name: str, tried: _Tried, seed: int, has_more: bool) -> Fit:
    """Errors of the simulation as given, with its parameters fitted, and of the model with what was put in.

    What that model cannot express is in the last errors as a correction beside it.
    """
    comparison, one = tried.last.comparison, tried.answer.fit[name]
    recorded, held = comparison.recorded[name], comparison.held_out
    before, middle = tried.first.nominal.simulated[name], tried.first.comparison.simulated[name]
    after = one.after if has_more and _corrected(tried, name) else comparison.simulated[name]
    floor = one.heldout.noise_floor or 0.0
    return replace(
        one,
        train=Errors(rms((recorded - before)[~held]), rms((recorded - after)[~held])),
        heldout=Errors(rms((recorded - before)[held]), rms((recorded - after)[held]), one.heldout.noise_floor),
        recalibrated_heldout=rms((recorded - middle)[held]),
        gap_closed=_closed((recorded - middle)[held], (recorded - after)[held], floor, seed) if tried.put
        else one.gap_closed,
        before=before,
        recalibrated=middle,
        after=after,
    )  # fmt: skip


def _corrected(tried: _Tried, name: str) -> bool:
    """Whether the correction beside the model makes the error of the fitted rows smaller."""
    comparison, rows = tried.last.comparison, ~tried.last.comparison.held_out
    after = comparison.recorded[name] - tried.answer.fit[name].after
    return rms(after[rows]) < (1.0 - _FLOOR) * rms(comparison.difference(name)[rows])


def _is_borne_out(tried: _Tried, name: str, floor: float) -> bool:
    """Whether a response is off by more than its noise, and unseen rows gain by a correction beside the model."""
    comparison = tried.last.comparison
    rest, held = comparison.difference(name), comparison.held_out
    if rms(rest[~held]) <= _NEAR * floor:
        return False
    after = comparison.recorded[name] - tried.answer.fit[name].after
    return not held.any() or rms(after[held]) ** 2 <= (1.0 - switches.LEAST) * rms(rest[held]) ** 2


def _closed(middle: Vector, after: Vector, floor: float, seed: int) -> Quantity | None:
    """Share of the way from the refitted model to the noise that was gone, with a block bootstrap interval."""
    blocks = np.array_split(np.flatnonzero(np.isfinite(middle) & np.isfinite(after)), 20)
    return share_closed([block for block in blocks if len(block)], middle, after, floor, seed)


def _is_near(given: Comparison, fitted: Comparison, floor: Mapping[str, float]) -> bool:
    """Whether unseen errors are near the noise in every response, or parameters went nearly all of the way there."""
    copies = identical_responses(fitted)
    was, now = (switches.unseen_squares(one, floor) for one in (given, fitted))
    now = {name: squares for name, squares in now.items() if name not in copies}
    ways = {name: (np.sqrt(was[name]) - np.sqrt(now[name])) / max(np.sqrt(was[name]) - 1.0, 1e-300) for name in now}
    return all(now[name] <= _NEAR**2 or ways[name] >= _NEARLY_ALL for name in now)


def _is_recalibrated(refit: Refitted) -> bool:
    """Whether the parameters took away more than a trifle of the mismatch, on held-out rows too."""
    held = refit.nominal.held_out
    copies = identical_responses(refit.nominal)
    return any(
        all(
            rms(refit.comparison.difference(name)[rows]) ** 2
            < (1.0 - _FLOOR) * rms(refit.nominal.difference(name)[rows]) ** 2
            for rows in (held, ~held)
        )
        for name in refit.nominal.responses
        if name not in copies
    )


def _mode(runnable: Runnable, tried: _Tried) -> Finding:
    what = "own model" if runnable.mode == "C" else "a black box that can be run again"
    times = tried.first.runs + sum(one.refit.runs for one in tried.put)
    refitted = {name: dict(vars(one)) for name, one in tried.last.quantities.items()}
    said = f"Mode {runnable.mode}: {what}, {runnable.name!r}; {len(tried.first.values)} parameters refitted, "
    evidence = {"mode": runnable.mode, "refitted": refitted}
    return FINDINGS.finding("mode", f"{said}simulated {times} times.", evidence=evidence)
