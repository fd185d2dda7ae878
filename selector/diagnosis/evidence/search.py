"""Which effects are supported: forward, one by one, all tested again after each, so that proxies collapse."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from selector.diagnosis.effects.effect import Quantity
from selector.diagnosis.evidence.misfit import misfit, tempered, with_pseudo_target
from selector.diagnosis.evidence.moments import solved
from selector.diagnosis.evidence.noise import NoiseModel
from selector.diagnosis.evidence.response import Bench
from selector.diagnosis.evidence.testing import Tested, of_all, tail_probability, tests_of, together
from selector.diagnosis.matching.usable import rms
from selector.diagnosis.shapes.machine_cycle import MachineCycle
from selector.diagnosis.shapes.residual import least_squares
from selector.types import Matrix, Vector

Benches = Mapping[str, Bench]
_ENOUGH = 0.65  #: Weight from which an effect, or a set, is told from all others.
Named = dict[str, dict[str, int]]  #: Effect id → response → number of the candidate.
_MOST = 5
_FINEST = 0.02  #: Steps of the reading: what never moves it as far cannot be read from it, but by the rounding itself.
_NEARLY = 0.6
_LEAP = 0.5  #: Of a fault's size: a reading that changes by as much from one sample to the next is not slow.
#: Canonical correlation of courses from which two effects stand together, where laws are all somewhat wrong.
_THE_SAME = 0.9
_TOLD_APART = 14.0  #: Score by which fitted rows tell an effect from another one: odds of a thousand.
_RIVAL = 0.2  #: An effect of less than this share of the weight of the named one is told from it.
#: Of the mismatch: what explains less is no name. What gains less than this share of the clearest named effect may be
#: what its shape does not fit exactly.
TENTH = 0.1
#: Share of the mismatch from which physics is named, if suspected only, that does not carry to unseen rows.
MOST_OF_IT = 0.75
_AS_GOOD = 0.6  #: Of the fall of the unseen error by the named effect: what another one makes of it is about as good.
_CLEARLY_BETTER = 1.1
_MOST_ALIKE = 3
_MOST_REFUSED = 8
_MOST_LIBERAL = 8
_SLOW = 0.3  #: Sum of the noise filter's coefficients from which it may have taken an effect for noise.
_CLEAR = 5.0
#: Of what comes back with the cycle: of a repeated course that is no effect, the catalogue leaves more.
_MOST_LEFT = 0.4
#: Shares by which the cycle that comes back may be longer than the one that was read off the simulation.
_LENGTHS = tuple(np.linspace(-1e-3, 1e-3, 21))


@dataclass(frozen=True, eq=False)
class Standing:
    """How one effect stands in all responses together, beside what is named already."""

    id: str
    #: Twice the logarithm of how much more likely the record is with the effect, which may or may not show in each of
    #: the responses
    score: float
    noise: Vector  #: (n_draws,): The largest score that noise alone gives to any of the effects
    responses: tuple[str, ...]  #: Those in which it shows rather than not
    tested: Mapping[str, Tested]

    @property
    def p_value(self) -> float:
        """Probability that noise makes as much of any of the effects: adjusted for all that are tested."""
        return tail_probability(self.score, self.noise)

    def shows_in(self, responses: Iterable[str], false_alarm: float = 0.02) -> bool:
        """Whether it makes more of these alone than noise does of any effect in all, but for `false_alarm`."""
        score = together([self.tested[name].evidence for name in responses])
        return tail_probability(float(score), self.noise) <= false_alarm

    @property
    def chosen(self) -> dict[str, int]:
        """Response → number of the candidate that fits best, where it shows."""
        return {name: self.tested[name].best for name in self.responses}

    @property
    def main(self) -> str:
        """The response that shows it most."""
        return max(self.responses, key=lambda name: self.tested[name].gain)

    @property
    def is_the_same_in_all_runs(self) -> bool:
        """Whether one size fits all runs."""
        return all(self.tested[name].is_the_same_in_all_runs for name in self.responses)


@dataclass(frozen=True, eq=False)
class Search:
    """Where the search ended."""

    benches: Benches  #: With the noise filter of the last fit
    named: Named  #: Effect id → response → number of the candidate, in the order in which they were found
    #: Of a named effect, how it stood beside the other named ones; of the others, beside all named ones
    standing: Mapping[str, Standing]
    rivals: Mapping[str, tuple[str, ...]]  #: Named effect → effects that explain what it explains about as well
    #: Named effect → weights of it and of its rivals against all others in its place, 0 to 1
    weights: Mapping[str, Mapping[str, float]]
    #: Response → times that the noise of `benches` is larger than that of the fit: what is left is no noise only
    misfit: Mapping[str, float] = field(default_factory=dict)
    #: Named effect → part of its fall of the unseen error that no effect outside of its set makes, where misfit is
    ahead: Mapping[str, float] = field(default_factory=dict)
    #: Named effect → share of the unseen gap between recalibration and noise that it closes with the other names
    closed: Mapping[str, Quantity] = field(default_factory=dict)
    #: Named effect that only unseen rows bear out → share of fitted and unseen rows that it explains, and the most that
    #: any shape at a wrong time does
    carried: Mapping[str, tuple[float, Vector]] = field(default_factory=dict)
    small: Named = field(default_factory=dict)  #: What is significant beside structure, but too small or not borne out
    wrong: frozenset[str] = frozenset()  #: Responses whose simulation is off as no effect is
    doubted: frozenset[str] = frozenset()  #: Named effects that a misfit of nobody's comes near, or stands beside

    def only(self, ids: set[str]) -> "Search":
        """The search with only some of the effects named."""
        return replace(self, named={id_: of for id_, of in self.named.items() if id_ in ids})


def numbers(named: Named, response: str) -> list[int]:
    """Candidates of a response among those named."""
    return [by_response[response] for by_response in named.values() if response in by_response]


def without(named: Named, id: str) -> Named:  # noqa: A002 - the word of the contract
    """All but one effect."""
    return {name: dict(of) for name, of in named.items() if name != id}


def standings(benches: Benches, named: Named, noise: Mapping[str, Vector], *, seed: int) -> dict[str, Standing]:
    """Every effect that is not named, beside those that are."""
    tested = {
        name: tests_of(bench, numbers(named, name), noise[name], seed=seed + 7919 * k)
        for k, (name, bench) in enumerate(benches.items())
    }
    own = {name for bench in benches.values() for name in bench.own}
    of_effect: dict[str, dict[str, Tested]] = {}
    for response, of in tested.items():
        for name, one in of.items():
            if name not in named and name not in own:
                of_effect.setdefault(name, {})[response] = one
    if not of_effect:
        return {}
    jointly = {name: of_all(list(of.values())) for name, of in of_effect.items()}
    by_noise = np.max([noise for _, noise in jointly.values()], axis=0)
    found = {}
    for name, of in of_effect.items():
        shown = tuple(response for response, one in of.items() if one.evidence > 0.0)
        shown = shown or (max(of, key=lambda response: of[response].evidence),)
        found[name] = Standing(name, jointly[name][0], by_noise, shown, of)
    return found


def search(benches: Benches, *, false_alarm: float, seed: int) -> Search:
    """Effects that the residuals support with family-wise `false_alarm`.

    The noise is what a fit of everything that looks like an effect leaves (`with_noise_of_full_fit`): a residual that
    still holds what is missing would make the noise too large and too slow.
    """
    fitted = {name: _beside_the_cycle(*with_noise_of_full_fit(bench)) for name, bench in benches.items()}
    fitted = {name: (with_pseudo_target(bench, chosen), chosen) for name, (bench, chosen) in fitted.items()}
    benches = {name: bench for name, (bench, _) in fitted.items()}
    noise = {name: _left(bench, chosen) for name, (bench, chosen) in fitted.items()}
    given = _Given(noise, dict.fromkeys(benches, 1.0), false_alarm, seed)
    named, small = _selected(benches, given), Named()
    times = {name: misfit(bench, numbers(named, name), seed=seed) for name, bench in benches.items()}
    given = replace(given, times=times)
    if given.is_misfit:
        benches = {name: tempered(bench, times[name]) for name, bench in benches.items()}
        named, small = _selected_by_size(benches, given)
    benches, named = _with_own(benches, named, given)
    named, small = _without_small(benches, named, small, times)
    named, alike, ahead = _by_transfer(benches, named, given)
    told = _told(benches, named, given)
    rivals = {id_: tuple(dict.fromkeys((*of, *alike.get(id_, ())))) for id_, of in told.rivals.items()}
    return replace(told, rivals=rivals, misfit=times, small=small, ahead=ahead)


@dataclass(frozen=True, eq=False)
class _Given:
    """What a search tests by: whitened noise of every response, times that misfit is more, family-wise level, seed."""

    noise: Mapping[str, Vector]
    times: Mapping[str, float]
    level: float
    seed: int

    @property
    def is_misfit(self) -> bool:
        """Whether more is left than noise."""
        return max(self.times.values()) > 1.0

    def standings(self, benches: Benches, named: Named) -> dict[str, Standing]:
        """Every effect that is not named, beside those that are."""
        return standings(benches, named, self.noise, seed=self.seed)

    def supports(self, one: Standing) -> bool:
        """Beyond what noise does and the gauge reads, and alike in all runs."""
        seen = max(one.tested[name].largest for name in one.responses)
        return one.p_value <= self.level and one.is_the_same_in_all_runs and seen > _FINEST


def _with_own(benches: Benches, named: Named, given: _Given) -> tuple[Benches, Named]:
    """Own parameters of the simulation that are missing themselves, and do not only make room for what is named.

    Beside other effects that is where the simulation has too little of them: too much is what they had absorbed.
    """
    for id_ in dict.fromkeys(id_ for bench in benches.values() for id_ in bench.own):
        freed = {name: bench.without_own(id_) for name, bench in benches.items()}
        if not named:
            # beside a parameter that is free to vary what resembles it may have gone unseen
            half = replace(given, level=0.5 * given.level)
            alone = _selected_by_size(freed, half)[0] if given.is_misfit else _selected(freed, half)
            if alone:
                benches, named = freed, alone
            continue
        one = given.standings(freed, named)[id_]
        if not given.supports(one):
            continue
        chosen = {name: freed[name].first_candidate(id_) for name in one.responses}
        main = one.main
        beside = [*numbers(named, main), chosen[main]]
        amount = freed[main].coefficients(beside)[0][freed[main].place(beside, chosen[main])][0]
        fewer = _with_fewer(freed, named | {id_: chosen}, given)
        if id_ not in fewer:
            named = fewer
        elif amount > 0.0:
            benches, named = freed, fewer
    return benches, named


def with_noise_of_full_fit(bench: Bench) -> tuple[Bench, list[int]]:
    """The bench with the noise that is left by candidates added while each gains clearly, and those candidates.

    What is clear: more than the largest of that many chances of pure noise gives in a hundred cases, and the price of
    its coefficients (Bayes' information criterion). Every addition sharpens the noise filter for the next one. A strong
    slow effect looks like slow noise, whose filter would take it away; so a candidate is proposed without the filter,
    too, and the one is added that leaves the likelier noise once the filter is fitted anew.
    """
    chosen: list[int] = []
    clear = 2.0 * np.log(max(len(bench.candidates), 1)) + 9.0
    bare = bench.with_noise(NoiseModel(np.zeros(0), bench.noise.sd))
    for _ in range(_MOST_LIBERAL):
        if not bench.candidates:
            break
        best, worth = _proposed(bench, chosen)
        added = bench.refitted_noise([*chosen, best]) if worth >= clear else bench
        likelier = _likelier(added, bench) if worth >= clear else 0.0
        if bench.noise.phi.sum() > _SLOW:
            other, _ = _proposed(bare, chosen)
            with_other = bare.refitted_noise([*chosen, other])
            price = np.log(len(bench.rows)) * (bench.counts[other] - 1.0)
            if _likelier(with_other, bench) > max(likelier, clear + price):
                best, added, worth = other, with_other, np.inf
        if worth < clear:
            break
        chosen.append(best)
        bench = added
    return bench, chosen


def _proposed(bench: Bench, chosen: list[int]) -> tuple[int, float]:
    """The candidate that gains most beside the `chosen`, and its gain less the price of its coefficients."""
    gains = solved(bench.moments(bench.base(chosen))).gain
    worth = gains - np.log(len(bench.rows)) * (np.array(bench.counts) - 1.0)
    best = int(np.argmax(worth))
    return best, float(worth[best])


def _likelier(new: Bench, old: Bench) -> float:
    """Twice the logarithm of how much likelier the rows are by the noise of one bench than by that of another."""
    return float(len(old.rows) * 2.0 * np.log(old.noise.sd / max(new.noise.sd, 1e-300)))


def _beside_the_cycle(bench: Bench, chosen: list[int]) -> tuple[Bench, list[int]]:
    """The same less what comes back with every cycle of the machine, if the effects leave most of it.

    A repeated course that nothing of the catalogue makes is as good as noise, but does not average out: each cycle says
    the same. What effects make on a machine that runs in cycles comes back as well; they leave less than they explain.
    """
    if bench.cycle is None:
        return bench, chosen
    before, _ = _repeated(bench, bench.cycle, bench.base([]))
    left, cycle = _repeated(bench, bench.cycle, bench.base(chosen))
    by_chance = cycle.samples
    if left - by_chance < max(_CLEAR * np.sqrt(2.0 * by_chance), _MOST_LEFT * (before - by_chance)):
        return bench, chosen
    return with_noise_of_full_fit(replace(bench, cycle=cycle, is_off_cycle=True).refitted_noise([]))


def _repeated(bench: Bench, cycle: MachineCycle, columns: Matrix) -> tuple[float, MachineCycle]:
    """Whitened squares beside `columns` that come back with a cycle, and the length of it at which they are most."""
    values = np.zeros((len(bench.target), 1))
    values[bench.rows, 0] = bench.white_target - columns @ least_squares(columns, bench.white_target)
    tried = [replace(cycle, period_s=cycle.period_s * (1.0 + share)) for share in _LENGTHS]
    squares = [float(np.sum(one.repeated(values, bench.rows)[bench.rows] ** 2)) for one in tried]
    best = int(np.argmax(squares))
    return squares[best], tried[best]


def _left(bench: Bench, chosen: list[int]) -> Vector:
    """Whitened residual beside the `chosen` candidates, made as large as it was before the fit."""
    base = bench.base(chosen)
    left = bench.white_target - base @ least_squares(base, bench.white_target)
    return np.asarray(left * np.sqrt(len(left) / max(len(left) - base.shape[1], 1)))


def _selected(benches: Benches, given: _Given) -> Named:
    named: Named = {}
    floor, clearest = dict.fromkeys(benches, 0.0), 0.0
    for _ in range(_MOST):
        supported = [
            one
            for one in given.standings(benches, named).values()
            if given.supports(one) and (one.score > clearest or _is_clear(one, floor, benches))
        ]
        if not supported:
            break
        best = max(supported, key=lambda one: one.score)
        clearest = max(clearest, TENTH * best.score)
        floor |= {name: max(floor[name], TENTH * best.tested[name].evidence) for name in best.responses}
        named[best.id] = best.chosen
        named = _retested(benches, named, given)
        if best.id not in named:
            break
    return named


def _is_clear(one: Standing, floor: Mapping[str, float], benches: Benches) -> bool:
    """Whether a fault is clear beside what its own channels show: not of those that a loop or a structure moves."""
    families = {candidate.effect.family for name in one.responses for candidate in benches[name].candidates}
    is_apart = one.id.startswith("data.") and families.isdisjoint(("drive", "vibration"))
    return is_apart and all(one.tested[name].evidence > floor[name] for name in one.responses)


def _selected_by_size(benches: Benches, given: _Given) -> tuple[Named, Named]:
    """The same where more is left than noise: what adds a part that matters, and what is refused.

    Shapes that are nearly alike share a mismatch among them until none has a part of its own. So one is taken after the
    other, and only if it adds a tenth of the mismatch and makes unseen rows better.
    """
    named: Named = {}
    refused: Named = {}
    tried = 0
    while len(named) < _MOST and tried < _MOST_REFUSED:
        standing = given.standings(benches, named)
        supported = [one for id_, one in standing.items() if id_ not in refused and given.supports(one)]
        if not supported:
            break
        best = max(supported, key=lambda one: one.score)
        worth = _worth(benches, named, best.chosen, best.main, given.times)
        named = {**named, best.id: worth} if worth else named
        # beside it what was refused may add enough
        refused = {} if worth else {**refused, best.id: best.chosen}
        tried += not worth
    return named, refused


def _without_small(benches: Benches, named: Named, small: Named, times: Mapping[str, float]) -> tuple[Named, Named]:
    """Without names that those found after them have taken the mismatch from."""
    for id_, of in list(named.items()):
        others, main = without(named, id_), max(of, key=lambda name: times[name])
        worth = _worth(benches, others, of, main, times)
        named, small = ({**others, id_: worth}, small) if worth else (others, {**small, id_: of})
    return named, small


def _worth(benches: Benches, named: Named, of: dict[str, int], main: str, times: Mapping[str, float]) -> dict[str, int]:
    """The responses of an effect, if it adds in its main one; else those of which it explains most all the same."""
    adding = {name: v for name, v in of.items() if times[name] == 1.0 or adds(benches[name], numbers(named, name), v)}
    if main in adding:
        return of
    return {name: v for name, v in adding.items() if benches[name].share(numbers(named, name), v) >= MOST_OF_IT}


def adds(bench: Bench, named: Sequence[int], v: int) -> bool:
    """Whether a candidate explains a tenth of what recalibration leaves beside the `named`, and unseen rows better.

    Physics that explains three quarters of it may be of another size there.
    """
    share = bench.share(named, v)
    if share < TENTH or (share >= MOST_OF_IT and bench.candidates[v].effect.family != "data"):
        return share >= TENTH
    return not bench.unseen.any() or unseen_rms(bench, [*named, v]) <= unseen_rms(bench, named)


def _retested(benches: Benches, named: Named, given: _Given) -> Named:
    """Every named effect tested beside the others: shapes chosen anew, proxies exchanged for what is better."""
    for name in list(named):
        if len(named) < 2:
            break
        others = without(named, name)
        standing = given.standings(benches, others)
        best = max(standing.values(), key=lambda one: one.score if given.supports(one) else -np.inf)
        if not given.supports(best):
            named = others
            continue
        own = standing[name]
        best = own if given.supports(own) and own.score > best.score - 1.0 else best
        named = others | {best.id: best.chosen}
    return named


def _with_fewer(benches: Benches, named: Named, given: _Given) -> Named:
    """Without names that another needs for its shape only: beside the shape that it has without them they add none."""
    for name in reversed(named):
        others = without(named, name)
        for other in others:
            rest = without(others, other)
            alone = given.standings(benches, rest)[other]
            fewer = rest | {other: alone.chosen}
            if alone.chosen != named[other] and not given.supports(given.standings(benches, fewer)[name]):
                return _with_fewer(benches, fewer, given)
    return named


def _told(benches: Benches, named: Named, given: _Given) -> Search:
    standing: dict[str, Standing] = {}
    rivals: dict[str, tuple[str, ...]] = {}
    weights: dict[str, Mapping[str, float]] = {}
    for name in list(named):
        beside, others = given.standings(benches, without(named, name)), without(named, name)
        is_noise = all(given.times[of] == 1.0 and benches[of].unseen.any() for of in beside[name].responses)
        fitted = _weights(beside, name)
        weighed = _weights(_by_all_rows(benches, beside, others, name), name) if is_noise else fitted
        # what one run alone has says nothing of unseen rows that could be wrong
        is_told = {one: _tells(benches[beside[one].main], beside[one].chosen[beside[one].main]) for one in weighed}
        may = {one for one in weighed if weighed[name] < _RIVAL * weighed[one] and is_told[one] >= is_told[name]}
        may = {one for one in may if given.supports(beside[one]) and _alike(benches, beside, named, name, one)}
        if is_noise and may:
            best = max(may, key=lambda one: weighed[one])
            named = {best if id_ == name else id_: of for id_, of in named.items()} | {best: beside[best].chosen}
            name = best
        standing[name] = beside[name]
        # what unseen rows do not tell from it either
        both = (one for by in (weighed, fitted) for one in _rivals(benches, beside, named, name, by))
        alike = (one for one in both if weighed.get(one, 0.0) >= _RIVAL * weighed[name])
        rivals[name] = tuple(dict.fromkeys(alike))
        weights[name] = {one: weighed[one] for one in (name, *rivals[name])}
    return Search(benches, named, given.standings(benches, named) | standing, rivals, weights)


def _tells(bench: Bench, v: int) -> bool:
    """Whether a candidate says anything of the unseen rows."""
    return bool(np.any(bench.candidates[v].variant.columns[bench.unseen]))


def _by_all_rows(benches: Benches, beside: Mapping[str, Standing], others: Named, id_: str) -> dict[str, Standing]:
    """An effect, and what fitted rows do not tell from it, with the score that the unseen rows leave to each.

    To it comes what the best shape of the fitted rows gains more where all are fitted, in noise as large as is left.
    """
    least = beside[id_].score - _TOLD_APART
    may = {name: one for name, one in beside.items() if name == id_ or one.score > least}
    evidence: dict[str, list[float]] = {name: [] for name in may}
    for response, bench in benches.items():
        named, tested = numbers(others, response), {name: one.tested.get(response) for name, one in may.items()}
        shapes = {name: one.best for name, one in tested.items() if one is not None}
        if not shapes:
            continue
        whole = bench.of_all_rows([*named, *shapes.values()])
        base, own = list(range(len(named))), list(shapes).index(id_) if id_ in shapes else None
        left = _left(whole, base if own is None else [*base, len(named) + own])
        whole = whole.with_noise(NoiseModel(bench.noise.phi, bench.noise.sd * rms(left)))
        whole = with_pseudo_target(whole, base) if bench.pseudo_target is not None else whole
        gains = solved(whole.moments(whole.base(base))).gain[len(named) :]
        for name, gain in zip(shapes, gains, strict=True):
            looks = 2.0 * np.log(bench.candidates[shapes[name]].variant.looked_at)
            evidence[name].append(may[name].tested[response].evidence + gain - looks - may[name].tested[response].gain)
    return {name: replace(one, score=float(together(evidence[name]))) for name, one in may.items()}


def _by_transfer(
    benches: Benches, named: Named, given: _Given
) -> tuple[Named, dict[str, tuple[str, ...]], dict[str, float]]:
    """Names that do best on unseen rows where more is left than noise, and for each what does about as well there.

    The likelihood of the fitted rows decides between laws that are all somewhat wrong; their transfer does not. The
    last is how far each name, or its set, is ahead of the next one: 1 where no other makes unseen errors fall.
    """
    alike: dict[str, tuple[str, ...]] = {}
    ahead: dict[str, float] = {}
    for id_, of in list(named.items()):
        others = without(named, id_)
        beside = given.standings(benches, others)
        main = max(of, key=lambda name: beside[id_].tested[name].gain)
        if given.times[main] == 1.0:
            continue
        falls, the_same = {}, set()
        # what unseen rows do not have they know by the recalibration alone, which any shape of those rows puts right
        is_elsewhere = benches[main].unseen.any() and not _tells(benches[main], of[main])
        for other, one in beside.items():
            is_rival = other != id_ and main in one.responses and one.p_value <= given.level
            if is_rival and is_elsewhere:
                is_rival = _explains_as_much(benches[main], others, beside, id_, other)
            if is_rival and adds(benches[main], numbers(others, main), one.tested[main].best):
                rival = {name: one.tested[name].best for name in of if name in one.tested}
                falls[other] = _unseen_share(benches, others, of, rival)
                if _alike(benches, beside, named, id_, other, _THE_SAME):
                    the_same.add(other)
        ranked = sorted(falls, key=lambda one: -falls[one])
        good = [other for other in ranked if falls[other] >= _AS_GOOD or other in the_same]
        is_slow = is_slow_in_one_run(benches[main], of[main])
        if is_slow:
            # a machine does so as well
            good = [other for other in good if not other.startswith("data.")]
        best = good[0] if good else id_
        is_better = best != id_ and (is_slow or falls[best] > _CLEARLY_BETTER)
        if (
            is_better
            and beside[best].is_the_same_in_all_runs
            and _explains_as_much(benches[main], others, beside, id_, best)
        ):
            chosen = beside[best].chosen
            named = {best if name == id_ else name: chosen if name == id_ else one for name, one in named.items()}
            good = [id_, *(other for other in good if other != best)]
        else:
            best = id_
        alike[best] = tuple(good[:_MOST_ALIKE])
        rest = [fall for other, fall in falls.items() if other not in (best, *alike[best])]
        ahead[best] = 1.0 - float(np.clip(max(rest, default=0.0), 0.0, 1.0))
    return named, alike, ahead


def _explains_as_much(bench: Bench, others: Named, beside: Mapping[str, Standing], own: str, other: str) -> bool:
    """Whether another effect explains about as much of the fitted rows: a part that carries is not the whole."""
    base, name = numbers(others, bench.response), bench.response
    shares = [bench.share(base, beside[id_].tested[name].best) for id_ in (own, other)]
    return shares[1] >= _AS_GOOD * shares[0]


def is_slow_in_one_run(bench: Bench, v: int) -> bool:
    """Whether a candidate is a slow fault of a channel in the only run: what the machine itself does looks like it.

    A reading that leaps from one sample to the next is not slow.
    """
    if bench.candidates[v].effect.id not in ("data.drift", "data.step") or np.ptp(bench.runs[bench.fitted]) > 0:
        return False
    size = rms(bench.course([v], v)[bench.fitted])
    return float(np.nanmax(np.abs(np.diff(bench.target[bench.fitted])))) < _LEAP * size


def _unseen_share(benches: Benches, others: Named, of: Mapping[str, int], rival: Mapping[str, int]) -> float:
    """How far a rival makes unseen errors fall, in parts of what an effect does: in the response that it does worst."""
    falls = []
    for name, v in of.items():
        base = numbers(others, name)
        without_it, own = unseen_rms(benches[name], base), unseen_rms(benches[name], [*base, v])
        left = unseen_rms(benches[name], [*base, rival[name]]) if name in rival else without_it
        falls.append((without_it - left, without_it - own, TENTH * without_it))
    counted = [(other, own) for other, own, least in falls if own > least]
    return min(other / own for other, own in counted or [(other, least) for other, _, least in falls])


def unseen_rms(bench: Bench, named: Sequence[int]) -> float:
    """Root mean square of the unseen rows beside candidates; of the fitted ones, where nothing is kept for that."""
    return rms(bench.residual(named)[bench.unseen if bench.unseen.any() else bench.fitted])


def _rivals(
    benches: Benches, beside: Mapping[str, Standing], named: Named, id_: str, weights: Mapping[str, float]
) -> tuple[str, ...]:
    """Effects with a like course that are needed until the set is sure (`_ENOUGH`), largest first."""
    found: list[str] = []
    sure = weights[id_]
    for other in sorted(weights, key=lambda name: -weights[name]):
        if sure >= _ENOUGH or weights[other] < _RIVAL * weights[id_]:
            break
        if other != id_ and _alike(benches, beside, named, id_, other):
            found.append(other)
            sure += weights[other]
    return tuple(found)


def _weights(beside: Mapping[str, Standing], id_: str) -> dict[str, float]:
    """Weights of the effects that may stand in the place of `id_`, summing to 1: how likely each makes the record."""
    scores = {name: one.score for name, one in beside.items() if name == id_ or one.is_the_same_in_all_runs}
    raw = {name: float(np.exp(0.5 * (value - max(scores.values())))) for name, value in scores.items()}
    return {name: value / sum(raw.values()) for name, value in raw.items()}


def _alike(
    benches: Benches, beside: Mapping[str, Standing], named: Named, id_: str, other: str, at_least: float = _NEARLY
) -> bool:
    """Whether two effects make nearly the same course in the response that shows the first one most."""
    first, second = beside[id_], beside[other]
    response = first.main
    if response not in second.tested:
        return False
    bench = benches[response]
    base = np.linalg.qr(bench.base(numbers(without(named, id_), response)))[0]
    spaces = []
    for one in (first, second):
        columns = bench.white_columns[:, bench.candidates[one.tested[response].best].columns]
        spaces.append(np.linalg.qr(columns - base @ (base.T @ columns))[0])
    return float(np.linalg.svd(spaces[0].T @ spaces[1], compute_uv=False).max()) > at_least
