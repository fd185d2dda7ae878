"""From a comparison to an answer: recalibrate, estimate the noise, search, decide, show."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, partial
from itertools import compress

import numpy as np

from selector.diagnosis.answer import Diagnosis, Fit, NamedEffect, Verdict
from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.catalogue import catalogue
from selector.diagnosis.effects.effect import Effect, Quantity
from selector.diagnosis.evidence import naming, size
from selector.diagnosis.evidence.confirmation import (
    HARM,
    LEAST,
    SUSPECTED,
    TRIFLE,
    as_unseen_rows_have_it,
    carries_little,
    confirmed,
    doubted,
    fit_of,
    gap_closed,
    held_out_faults,
    left_unseen,
    not_ruinous,
    only_cancels,
    only_where_carried,
    surely_refuted,
    worth_naming,
)
from selector.diagnosis.evidence.discrepancy import beside_discrepancy
from selector.diagnosis.evidence.frozen import frozen_and_unnamed, with_frozen, without_frozen
from selector.diagnosis.evidence.recalibration import Recalibrated, contradicted, recalibrated, whole_record_names
from selector.diagnosis.evidence.response import Bench, bench_of
from selector.diagnosis.evidence.search import TENTH, Search, numbers, search
from selector.diagnosis.evidence.size import detectability
from selector.diagnosis.evidence.transfer import borne_out, leaves_far_less, told_of_carried
from selector.diagnosis.matching import usable
from selector.diagnosis.mismatch.omnibus import Structure, comes_again, of_whole_record, told_of_wandering, unexplained
from selector.diagnosis.mismatch.switching import Switched, gain_beside, places, switched, told_of_switches
from selector.diagnosis.next_run.experiments import next_runs
from selector.diagnosis.shapes.input_faults import InputFault, input_faults, told_of_inputs
from selector.diagnosis.shapes.linear_response import with_moved_resonances
from selector.diagnosis.shapes.residual import least_squares
from selector.diagnosis.wording import headline, is_data
from selector.types import Vector

_MOST = 0.5
#: Confidence below which a name is a guess, but for what explains as much and is carried: transfer may have chosen it.
_LEAST_SURE, _QUARTER = 0.1, 0.25
#: Names from which on any smooth misfit may have been put together from them; the same where there is one.
_MANY, _MANY_BESIDE_MISFIT = 3, 2
_TOLD_BESIDE = 12.0  #: Nats that a name has to gain beside a switch.
_NEARLY_ALL = 0.9  #: Of the mean square: all but a third of the error.
_FARTHER = 1.5  #: Times the error of fitted rows: unseen ones that are farther off are not explained.
#: What resonances of the simulation that are a little off look like.
_LIKE_RESONANCES = ("vibration.mode", "vibration.back_reaction", "vibration.hardening", "vibration.hysteresis")
_DOUBTFUL = 0.45  #: Weight below which an effect is no name where structure is left that nothing explains.

Progress = Callable[[int, int, str], None]  #: Told how far the work is: steps done, steps in all, what is done now.


def diagnosis(
    comparison: Comparison,
    *,
    seed: int = 0,
    false_alarm: float = 0.02,
    effects: Sequence[Effect] | None = None,
    progress: Progress | None = None,
) -> Diagnosis:
    """What the simulation left out, where, how sure that is, and what putting it in gains.

    The same `seed` of the draws of noise gives the same answer, bit for bit. `false_alarm` is the family-wise
    probability of naming an effect where there is none; `effects` are by default the whole catalogue.

    Raises InputError if the comparison is no basis for an answer.
    """
    known = catalogue() if effects is None else effects
    asked = _Asked(seed, false_alarm, tuple(known), progress or (lambda done, total, text: None))
    answer = _staged(_State(usable.with_enough_samples(comparison), asked))
    if answer.verdict == "unexplained" or any(effect.id in _LIKE_RESONANCES for effect in answer.effects):
        return _recalibrated_resonances(answer, asked) or answer
    return answer


def _recalibrated_resonances(answer: Diagnosis, asked: "_Asked") -> Diagnosis | None:
    """The answer where the simulation's own resonances, moved, explain the mismatch and little is left; else None.

    What a resonance that is a little off leaves looks like another one, or like nothing that is known.
    """
    moved = with_moved_resonances(answer.comparison)
    if moved is None:
        return None
    comparison, resonances, share = moved
    beside = _staged(_State(comparison, asked))
    if beside.verdict == "unexplained" or any(one.share > _MOST * share for one in beside.effects):
        return None
    alone = _staged(_State(comparison, replace(asked, effects=())))
    if any(_is_farther_off(comparison, one, name) for name, one in alone.fit.items() if name in comparison.tangents):
        return None
    found = replace(
        beside,
        verdict="miscalibrated",
        effects=(),
        where=(),
        also_seen=(*beside.also_seen, *naming.seen_only(beside.effects)),
        fit=alone.fit,
        recalibration={**alone.recalibration, "model": resonances},
    )
    return replace(found, headline=headline(found))


def _is_farther_off(comparison: Comparison, fit: Fit, name: str) -> bool:
    """Whether unseen rows are much farther off than the fitted ones, in parts of how far the response moves in each."""
    recorded, held = comparison.recorded[name], comparison.held_out
    here, there = (float(np.nanstd(recorded[rows])) for rows in (~held, held))
    return fit.heldout.rmse_after * here > _FARTHER * fit.train.rmse_after * there


def _staged(state: "_State") -> Diagnosis:
    """The answer of all stages, one after the other."""
    for stage in _STAGES:
        if state.answer is None:
            state = stage(state)
    answer = state.answer or _answered(state)
    # what was left out last was left out of a comparison that lacked the rest already
    for put_back in reversed(state.left_out):
        answer = put_back(answer)
    return answer


@dataclass(frozen=True, eq=False)
class _Asked:
    """What a diagnosis is asked, as of `diagnosis`."""

    seed: int
    false_alarm: float
    effects: tuple[Effect, ...]
    say: Progress


@dataclass(frozen=True, eq=False)
class _State:
    """What is known after a stage."""

    comparison: Comparison  #: What is left to be looked at
    asked: _Asked
    #: Of what was left out, how it comes back into an answer to the rest
    left_out: tuple[Callable[[Diagnosis], Diagnosis], ...] = ()
    untested: Mapping[str, Mapping[str, str]] = field(default_factory=dict)  #: Response → effect id → why
    search: Search = field(default_factory=lambda: Search({}, {}, {}, {}, {}))  #: What it named is in the fit
    switches: Mapping[str, Switched] = field(default_factory=dict)  #: Response → what a switch nobody recorded does
    again: Mapping[str, Recalibrated] = field(default_factory=dict)  #: Response → recalibration
    late: tuple[NamedEffect, ...] = ()  #: Faults in held-out rows alone
    residuals: Mapping[str, Vector] = field(default_factory=dict)  #: Response → what is left [unit], (n_rows,)
    white: Mapping[str, Vector] = field(default_factory=dict)  #: The same behind the noise filter
    structures: Sequence[Structure] = ()  #: What nothing explains
    refuted: Sequence[Structure] = ()  #: What is sure in the fitted rows, whatever is named
    small: frozenset[str] = frozenset()  #: Responses in which that is too little to matter
    effects: tuple[NamedEffect, ...] = ()
    also: tuple[NamedEffect, ...] = ()  #: Too small, or not borne out, beside structure that is nobody's
    verdict: Verdict = "nothing-missing"
    fit: Mapping[str, Fit] = field(default_factory=dict)
    answer: Diagnosis | None = None  #: To what is left, where no later stage has to look at it

    def say(self, done: int, text: str) -> None:
        """Tells the progress; negative numbers count from the end."""
        steps = len(self.comparison.responses) + 3
        self.asked.say(done % steps, steps, text)

    def narrowed(self, rest: Comparison, put_back: Callable[[Diagnosis], Diagnosis]) -> "_State":
        """Only a rest of the comparison is looked at from here on."""
        return replace(self, comparison=rest, left_out=(*self.left_out, put_back))


def _searched(state: _State) -> _State:
    """Effects that the fitted rows name, in what is left without copies and without frozen stretches.

    What stands still says nothing about the machine, and would be fitted as if it did: the rest is searched anew.
    """
    while True:
        state = _without_copies(state)
        if state.answer is not None:
            return state
        state = _tested(state)
        frozen = frozen_and_unnamed(state.comparison, state.search)
        if not frozen:
            return state
        state = _without_frozen(state, frozen)
        if state.answer is not None:
            return state


def _without_copies(state: _State) -> _State:
    """Only responses with a difference: without one there is no noise that a gain could be measured by."""
    copies = usable.without_fitted_difference(state.comparison)
    comparison = usable.told_of_copies(state.comparison, copies)
    if set(copies) == set(comparison.responses):
        return replace(state, answer=usable.diagnosis_of_copy(comparison, seed=state.asked.seed))
    if not copies:
        return replace(state, comparison=comparison)
    rest = replace(comparison, responses=tuple(name for name in comparison.responses if name not in copies))
    return state.narrowed(rest, partial(usable.with_copies, comparison=comparison, names=copies))


def _without_frozen(state: _State, frozen: Sequence[InputFault]) -> _State:
    rest = without_frozen(state.comparison, frozen)
    narrowed = state.narrowed(rest, partial(with_frozen, comparison=state.comparison, rest=rest, frozen=frozen))
    if rest.responses:
        return narrowed
    nothing = Diagnosis(rest, "data-fault", findings=rest.findings, seed=state.asked.seed)
    return replace(narrowed, answer=nothing)


def _tested(state: _State) -> _State:
    """Every effect beside all others, in every response; what is a trifle or ruins unseen rows is no name."""
    asked, comparison = state.asked, state.comparison
    benches: dict[str, Bench] = {}
    untested: dict[str, dict[str, str]] = {}
    for k, name in enumerate(comparison.responses):
        state.say(k, f"shapes of all effects in {name}")
        benches[name], untested[name] = bench_of(comparison, name, asked.effects)
    state.say(-3, "testing effects")
    found = search(benches, false_alarm=asked.false_alarm, seed=asked.seed)
    found = as_unseen_rows_have_it(found)
    found = beside_discrepancy(comparison, found)
    refuted, worth = surely_refuted(comparison, found), worth_naming(comparison, found)
    found = not_ruinous(comparison, worth)
    lost = [naming.named_effect(comparison, worth, id_) for id_ in worth.named if id_ not in found.named]
    found, also = size.of_practical_size(comparison, found)
    also = (*also, *naming.seen_only(map(doubted, lost)))
    found = replace(found, closed=_closed(state, found))
    return replace(state, untested=untested, search=found, refuted=refuted, also=also)


def _closed(state: _State, found: Search) -> dict[str, Quantity]:
    """How much of the unseen gap the names of a response close together; of each effect where that is most."""
    closed: dict[str, Quantity] = {}
    for name, bench in found.benches.items():
        of, is_noise = numbers(found.named, name), found.misfit[name] == 1.0
        gap = gap_closed(state.comparison, bench, of, seed=state.asked.seed, is_noise=is_noise) if of else None
        if gap is not None:
            closed[name] = gap
    return {
        id_: max((closed[name] for name in of), key=lambda gap: gap.value)
        for id_, of in found.named.items()
        if all(name in closed for name in of)
    }


def _beside_switches(state: _State) -> _State:
    """What a switch that nobody recorded does beside the names; names that only stand in for it are none."""
    comparison, found, switches = state.comparison, state.search, dict[str, Switched]()

    @cache
    def asked(name: str, of: tuple[int, ...]) -> Switched | None:
        bench = found.benches[name]
        return switched(comparison, name, bench.target, bench.raw_base(of), bench.resolution)

    for name in found.benches:
        alone = asked(name, ()) if asked(name, tuple(numbers(found.named, name))) else None
        if alone is not None and not size.is_small(comparison, found, name, float(np.std(alone.course))):
            switches[name] = alone
    if not switches:
        return state
    surest = max(switches.values(), key=lambda one: one.gain)

    def adds(name: str, v: int) -> bool:
        bench, course = found.benches[name], switches.get(name, surest).course
        beside = np.column_stack([bench.nuisance, course])
        return gain_beside(comparison, bench.target, beside, bench.raw(v)) >= _TOLD_BESIDE

    kept = {
        id_ for id_, of in found.named.items() if id_ == "data.stuck" or any(adds(name, v) for name, v in of.items())
    }
    found = found.only(kept)
    if kept:
        # what a name explains is no switch's
        again = {name: asked(name, tuple(numbers(found.named, name))) for name in switches}
        switches = {name: one for name, one in again.items() if one is not None}
    return replace(state, switches=switches, search=found, also=state.also if kept else ())


def _recalibrated(state: _State) -> _State:
    """What offset, gain and delay of the simulation gain beside the named effects."""
    state.say(-2, "errors on held-out rows")
    again = {}
    for name, bench in state.search.benches.items():
        named, unit = numbers(state.search.named, name), state.comparison.channel(name).unit
        base = bench.base(named)
        noise = np.asarray(bench.white_target - base @ least_squares(base, bench.white_target))
        again[name] = recalibrated(bench, named, noise, unit, seed=state.asked.seed)
    return replace(state, again=again)


def _looked_at_what_is_left(state: _State) -> _State:
    """Faults that stand in held-out rows alone, and structure that nothing explains."""
    state.say(-1, "what nothing explains")
    asked, comparison, found = state.asked, state.comparison, state.search
    late = held_out_faults(comparison, found, asked.effects, false_alarm=asked.false_alarm, seed=asked.seed)
    switches = dict(state.switches)
    for fault in late:
        # a change that stays is a step of its reading; where more than that comes and goes it is a switch's
        bench, course = found.benches[fault.channel], fault.courses[fault.channel]
        if not switched(comparison, bench.response, bench.target - course, bench.raw_base(()), bench.resolution):
            switches.pop(fault.channel, None)
    only_fitted = bool(found.named) or bool(late) or any(bench.is_off_cycle for bench in found.benches.values())
    residuals, white = _left(comparison, found, only_fitted=only_fitted)
    seen = unexplained(comparison, residuals, white, seed=asked.seed, false_alarm=asked.false_alarm)
    little = {name for name in found.benches if size.is_little_in_one_run(comparison, found, name)}
    left = {name: bench.residual(numbers(found.named, name)) for name, bench in found.benches.items()}
    of_size = [one for one in seen if one.channel not in little and comes_again(comparison, left[one.channel], one)]
    structures = [one for one in of_size if not size.is_small(comparison, found, one.channel, one.size)]
    small = {one.channel for one in seen} - {one.channel for one in structures}
    if not found.named:
        structures = [*(one.structure(comparison) for one in switches.values()), *structures]
    state = replace(state, late=late, switches=switches, residuals=residuals, white=white)
    return replace(state, structures=structures, small=frozenset(small))


def _named(state: _State) -> _State:
    """What the rows that were not fitted bear out, and faults that stand in them alone."""
    told = [confirmed(state.comparison, state.search, id_) for id_ in state.search.named]
    largest = max((effect.share for effect in told), default=0.0)
    kept = [naming.as_carried(effect, state.search) for effect in told if _is_sure(effect, state, largest)]
    # beside structure that is nobody's, a second name is as often a part of that as it is right; one run does not tell
    is_misfit = any(state.search.misfit.get(effect.channel, 1.0) > 1.0 for effect in kept)
    is_misfit |= len(state.comparison.runs) == 1 and sum(not is_data(effect.id) for effect in kept) > 1
    if len(kept) >= (_MANY_BESIDE_MISFIT if is_misfit else _MANY):
        kept = [replace(effect, confidence=min(effect.confidence, SUSPECTED)) for effect in kept]
    ids = {effect.id for effect in kept}
    left = [effect for effect in told if effect.id not in ids]
    return replace(state, effects=(*kept, *state.late), also=(*state.also, *naming.seen_only(left)))


def _is_sure(effect: NamedEffect, state: _State, largest: float) -> bool:
    """Whether a name is more than a guess and no trifle.

    That is what unseen rows lose by beside a name that is none, what they speak against and is little beside one, and
    next to nothing beside much that is left. In a record of one run, noise and what wanders look like any little part.
    """
    found = state.search
    is_trifle = effect.share < TRIFLE * min(largest, _MOST) and left_unseen(effect, found) >= 1.0 - TRIFLE
    is_trifle |= effect.share < LEAST and naming.is_far_above_noise(found, effect.channel)
    little = max(TENTH * largest, TRIFLE if is_data(effect.id) else 0.0)
    is_trifle |= effect.share < little and effect.suspected and effect.id != "data.stuck"
    is_trifle |= effect.share < TENTH and effect.acts is None and np.ptp(found.benches[effect.channel].runs) == 0
    gap = found.closed.get(effect.id)
    # a fault of one run has no other rows that it could carry to
    is_carried = effect.acts is None and effect.share >= _QUARTER
    is_carried &= gap is None or gap.low is None or gap.low >= _LEAST_SURE
    return (effect.confidence >= _LEAST_SURE or is_carried) and not (is_trifle or only_cancels(effect, found))


def _named_clearly(state: _State) -> _State:
    """Names only where they are clearer than the structure that is left.

    A fault of the data explains all that it concerns, or it is a proxy of what nothing explains. What carries little on
    unseen rows is no name where structure is left, nor what surely makes them worse; nor what was found beside that and
    is little and suspected.
    """
    doubts = _doubts(state)
    is_none = [
        carries_little(state.comparison, state.search, effect, is_doubted=bool(doubts)) for effect in state.effects
    ]
    beside = {name for effect in compress(state.effects, is_none) for name in effect.courses}
    is_little = [
        none or (one.suspected and one.share < TENTH and one.id != "data.stuck" and one.channel in beside)
        for one, none in zip(state.effects, is_none, strict=True)
    ]
    state = replace(
        state,
        effects=tuple(effect for effect, little in zip(state.effects, is_little, strict=True) if not little),
        also=(*state.also, *naming.seen_only(compress(state.effects, is_little))),
    )
    if not doubts or any(_stands(effect, state.search, doubts) for effect in state.effects):
        return state
    stuck = tuple(effect for effect in state.effects if effect.id == "data.stuck")
    rest = [effect for effect in state.effects if effect not in stuck]
    # what unseen rows bear out is something, whatever it is
    gaps = {effect.channel: state.search.closed.get(effect.id) for effect in sorted(rest, key=lambda one: one.share)}
    borne = [name for name, gap in gaps.items() if gap is not None and gap.low is not None and gap.low >= _QUARTER]
    large = {name for name in borne if not size.is_small(state.comparison, state.search, name)}
    left = [one for one in doubts if one.channel in large]
    also = (*state.also, *naming.seen_only(rest))
    return replace(state, effects=stuck, structures=state.structures or left, also=also)


def _doubts(state: _State) -> Sequence[Structure]:
    """Structure that is left; beside names that explain little also what wanders, which otherwise may be noise.

    What wanders in fitted rows says nothing of a fault in others.
    """
    is_clear = not state.effects or bool(state.late) or max(effect.share for effect in state.effects) >= _MOST
    if state.structures or is_clear:
        return state.structures
    asked = state.asked
    return unexplained(
        state.comparison, state.residuals, state.white, seed=asked.seed, false_alarm=asked.false_alarm, wanders=False
    )


def _named_by_transfer(state: _State) -> _State:
    """Where structure is left: what unseen rows bear out, looked at like any other name.

    Beside names only what leaves far less of fitted and of unseen rows than they do together, in plain squares.
    """
    if not state.structures:
        return state
    found = borne_out(state.comparison, state.search, seed=state.asked.seed)
    if found is state.search or (state.effects and not leaves_far_less(found, state.search)):
        return state
    named = replace(state, search=replace(found, closed=_closed(state, found)), switches={})
    for stage in (_recalibrated, _looked_at_what_is_left, _named, _named_clearly):
        named = stage(named)
    gone = [effect for effect in state.effects if effect.id not in {one.id for one in named.effects}]
    return replace(named, also=(*named.also, *naming.seen_only(gone))) if named.effects else state


def _named_by_whole_record(state: _State) -> _State:
    """Where nothing else is found: faults of the recording that recalibration hides, and faults of the inputs."""
    if state.effects or state.structures:
        return state
    comparison, benches = state.comparison, dict(state.search.benches)
    right = [
        name
        for name, one in state.again.items()
        if _recalibration_holds(benches[name])
        and name not in state.search.wrong
        # what leaves a third of an error that is no noise is not the fault
        and (one.share >= _NEARLY_ALL or not naming.is_far_above_noise(state.search, name))
    ]
    again = {name: state.again[name] for name in right}
    whole = whole_record_names(comparison, again)
    effects = [naming.whole_record_effect(comparison, benches, state.again, id_, shown) for id_, shown in whole.items()]
    effects += [naming.input_fault_effect(comparison, fault) for fault in input_faults(comparison) if fault.sure]
    return replace(state, effects=tuple(effects))


def _off_in_unseen(state: _State) -> _State:
    """Where nothing else is found: what unseen rows speak against is structure that nothing explains."""
    if state.effects or state.structures:
        return state
    found = state.search.only(set())
    if state.search.named:
        state = _recalibrated(replace(state, search=found))
    off = {name: contradicted(bench, state.again[name]) for name, bench in found.benches.items()}
    unlike = (of_whole_record("unlike", state.comparison, name, off[name], 0.0) for name in off if off[name])
    of_size = [
        one for one in (*state.refuted, *unlike) if not size.is_small(state.comparison, found, one.channel, one.size)
    ]
    return _named_by_transfer(replace(state, structures=of_size))


def _recalibration_holds(bench: Bench) -> bool:
    """Whether recalibration makes no unseen row worse on average."""
    left, given = (one[bench.unseen] for one in (bench.residual([]), bench.given))
    return bool(np.sum(left**2) <= np.sum(given**2))


def _judged(state: _State) -> _State:
    """The largest effect first, nothing else in the fit, and the verdict."""
    told = size.or_parameters(state.comparison, state.search, state.effects)
    told = (only_where_carried(effect, state.search) if effect.id in state.search.named else effect for effect in told)
    effects = tuple(sorted(told, key=lambda effect: -effect.share))
    shown = {effect.id: effect.courses for effect in effects}
    found = state.search.only(set(shown))
    named = {id_: {name: v for name, v in of.items() if name in shown[id_]} for id_, of in found.named.items()}
    found = replace(found, named=named)
    if found.named != state.search.named:
        # beside what is no name after all an offset may have come out anywhere
        state = _recalibrated(replace(state, search=found))
    gains = any(
        (one.matters or size.is_recalibrated(found, name)) and _recalibration_holds(found.benches[name])
        for name, one in state.again.items()
    )
    return replace(state, effects=effects, search=found, verdict=_verdict(effects, state.structures, gains))


def _fitted(state: _State) -> _State:
    """What the improved model gains in every response; effects that make the unseen error larger are doubted."""
    found, is_improved = state.search, state.verdict not in ("nothing-missing", "unexplained")
    beside = {} if state.effects else {one.channel: one.noise for one in state.structures}
    fit = {
        name: fit_of(
            state.comparison,
            bench,
            numbers(found.named, name),
            recalibrate=is_improved or state.again[name].matters,
            seed=state.asked.seed,
            is_noise=found.misfit[name] == 1.0 and name not in state.switches,
            most_noise=beside.get(name, np.inf),
        )
        for name, bench in found.benches.items()
    }
    # clearly larger than without, recalibrated or as given
    harmed = {
        name
        for name, one in fit.items()
        if one.heldout.rmse_after > HARM * min(one.recalibrated_heldout, one.heldout.rmse_before) > 0.0
    }
    effects = tuple(doubted(effect) if effect.channel in harmed else effect for effect in state.effects)
    return replace(state, effects=effects, fit=fit)


def _answered(state: _State) -> Diagnosis:
    comparison, found, effects = state.comparison, state.search, state.effects
    structured = state.small.union(one.channel for one in state.structures)
    answer = Diagnosis(
        comparison=comparison,
        verdict=state.verdict,
        headline="",
        where=places(comparison, effects, state.structures, state.switches, state.residuals),
        effects=effects,
        also_seen=state.also,
        fit=state.fit,
        evidence=naming.evidence_rows(found, state.untested),
        detectable=detectability(comparison, found, false_alarm=state.asked.false_alarm),
        next_runs=next_runs(comparison, found, effects),
        recalibration={name: one.quantities for name, one in state.again.items()},
        findings=(
            *comparison.findings,
            *told_of_inputs(comparison, {channel for one in effects if is_data(one.id) for channel in one.channels}),
            *told_of_switches(comparison, state.switches),
            *told_of_wandering(comparison, state.residuals, structured),
            *told_of_carried(effects, found),
            *(() if effects else size.told_of_small(comparison, found, state.small)),
        ),
        seed=state.asked.seed,
    )
    return replace(answer, headline=headline(answer))


_STAGES: tuple[Callable[[_State], _State], ...] = (
    _searched,
    _beside_switches,
    _recalibrated,
    _looked_at_what_is_left,
    _named,
    _named_clearly,
    _named_by_transfer,
    _named_by_whole_record,
    _off_in_unseen,
    _judged,
    _fitted,
)


def _left(comparison: Comparison, found: Search, *, only_fitted: bool) -> tuple[dict[str, Vector], dict[str, Vector]]:
    """What the names of a search leave of every response, (n_rows,), and the same behind the noise filter.

    With `only_fitted` NaN in the other rows: what a named effect does on another programme may differ a little from its
    fit, and is no other effect; so is what comes back with a cycle.
    """
    looked = ~comparison.held_out if only_fitted else np.ones(len(comparison.time_s), dtype=bool)
    residuals, white = {}, {}
    for name, bench in found.benches.items():
        of = numbers(found.named, name)
        residuals[name] = np.where(looked, bench.residual(of), np.nan)
        of_noise = bench.white_residual(of) * np.sqrt(found.misfit.get(name, 1.0))
        white[name] = np.where(looked, of_noise, np.nan)
    return residuals, white


def _stands(effect: NamedEffect, found: Search, structures: Sequence[Structure]) -> bool:
    """Whether an effect is a name although structure is left: sure, borne out, and clearer than what is left.

    What explains most of the mismatch is a name all the same.
    """
    if effect.share >= _MOST:
        return True
    gap = found.closed.get(effect.id)
    if found.misfit.get(effect.channel, 1.0) > 1.0 and (not effect.suspected or (gap and gap.value >= _QUARTER)):
        # structure is expected to be left there; the name has borne the marks of its size
        return True
    if effect.suspected or found.weights.get(effect.id, {effect.id: 1.0})[effect.id] < _DOUBTFUL:
        return False
    return effect.id not in found.standing or found.standing[effect.id].score >= -2.0 * np.log(structures[0].p_value)


def _verdict(named: Sequence[NamedEffect], structures: Sequence[Structure], is_recalibrated: bool) -> Verdict:
    if any(not is_data(effect.id) for effect in named):
        return "missing-physics"
    if named:
        return "data-fault"
    if structures:
        return "unexplained"
    return "miscalibrated" if is_recalibrated else "nothing-missing"
