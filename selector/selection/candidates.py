"""Which sets of sensors deserve a closer look: groups, representatives, and exact best subsets."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from selector.models.best_subsets.subsets import best_sensor_sets, best_subsets
from selector.models.design import ListedTerms, Term, hierarchical
from selector.models.moments import within_one_standard_error
from selector.selection.library import Bench, Shape
from selector.selection.options import MAX_CANDIDATES, Question
from selector.sensors.groups import (
    FStatistic,
    FuzzyGroups,
    LambdaAxis,
    Partition,
    cut_beside,
    fuzzy_groups,
    lambda_axis,
)
from selector.sensors.screening import ScreeningRound, fuzzy_round, screen
from selector.sensors.similarity import Similarity, similarity_from_cross_products
from selector.types import Array, Indices

Origin = Literal["representatives", "all sensors", "formula"]
PER_SIZE = 3
CORRELATION_ROUNDING = 1e-9
AS_RELEVANT = 0.01
#: Terms up to which products and powers are chosen one by one; the search for more takes seconds a set.
MOST_TERMS = 12
LINEAR = Shape()
MOST_TOGETHER = 100_000
"""Sets of the largest size up to which all are compared for several responses at once: a tenth of a second."""


@dataclass(frozen=True)
class SensorSet:
    """A set of sensors under test, and where it comes from."""

    sensors: tuple[str, ...]
    origin: Origin


@dataclass(frozen=True)
class Screening:
    """One way of grouping, carried through to representatives."""

    level: float  #: λ of the first round; of fuzzy groups that of the cut beside them, see `cut_beside`
    rounds: tuple[ScreeningRound, ...]
    representatives: tuple[str, ...]  #: Those of the last round
    f: FStatistic | None  #: Of the first round's partition
    #: Held-out error of the best linear set of representatives, relative to the spread of the displacement; NaN until
    #: it is known
    error: float = float("nan")
    fpc: float | None = None  #: Fuzzy partition coefficient, if the groups are fuzzy
    fuzzy: FuzzyGroups | None = None  #: Those groups; of a result that was read again only the chosen ones are known


@dataclass(frozen=True)
class Grouping:
    """What the correlation of the sensors says: all ways of grouping, and the one chosen."""

    similarity: Similarity
    axis: LambdaAxis
    relevance: tuple[float, ...]
    screenings: tuple[Screening, ...]
    chosen: Screening
    because: str


@dataclass(frozen=True)
class Candidates:
    """Sets worth testing with every shape, on some folds."""

    grouping: Grouping
    sets: tuple[SensorSet, ...]


def candidates(question: Question, bench: Bench) -> Candidates:
    """Group, screen and search on some folds only.

    The bench holds the linear terms of all sensors. With a given λ only subsets of the representatives are searched,
    as the patent does; otherwise every distinct λ-cut competes, and the exact best subsets of all sensors too.
    """
    options = question.options
    sensors = question.sensors
    cross = bench.cross(sensors, LINEAR, 0)[:-1, :-1]
    similarity = similarity_from_cross_products(cross, absolute=options.absolute_similarity)
    relevance = _relevance(bench, sensors)
    standing = _by_cost(question, relevance)
    axis = lambda_axis(similarity.matrix, sensors)
    screenings = _screenings(question, similarity, axis, standing)
    pools = list(dict.fromkeys(screening.representatives for screening in screenings))
    found = {pool: _linear_sets(question, bench, pool) for pool in pools}
    everything: list[tuple[str, ...]] = []
    if options.level is None and options.formula is None:
        everything = _linear_sets(question, bench, sensors)
        cheap = _cheapest(question, sensors)
        if len(cheap) < len(sensors):
            # the best sets may all hold a dear sensor whose neighbour would do
            everything += _linear_sets(question, bench, cheap)
    tested = list(dict.fromkeys(s for sets in (*found.values(), everything) for s in sets))
    row = {s: bench.relative(held_out) for s, held_out in bench.held_out_of(tested, LINEAR).items()}
    share = bench.samples / bench.samples.sum()
    mean = {s: float(errors @ share) for s, errors in row.items()}
    scored = []
    for screening in screenings:
        best = min(found[screening.representatives], key=lambda s: mean[s])
        scored.append((screening, row[best], mean[best]))
    chosen, because = _chosen_screening(question, scored, bench.samples)
    sets = {s: SensorSet(s, "representatives") for s in found[chosen.representatives]}
    for s in everything:
        sets.setdefault(s, SensorSet(s, "all sensors"))
    if options.asked_formula is not None:
        sets = {question.needed: SensorSet(question.needed, "formula")}
    screened = tuple(replace(s, error=float(np.sqrt(error))) for s, _, error in scored)
    number = screenings.index(chosen)
    grouping = Grouping(similarity, axis, tuple(relevance), screened, screened[number], because)
    return Candidates(grouping, tuple(sets.values()))


def sets_with_terms(
    question: Question, bench: Bench, pool: Sequence[str], shape: Shape, most: int | None = None, alone: bool = True
) -> list[tuple[str, ...]]:
    """Exact best sets of every size, up to `most`, by all terms of a shape: for each response `alone`, and for all."""
    options = question.options
    owners = bench.library.owners(pool, shape)
    moving = _moving_responses(bench)
    sets: dict[tuple[str, ...], None] = {}
    for together in [*([j] for j in moving if alone), *([moving] if len(moving) > 1 else [])]:
        cross, of_all = _side_by_side(bench, pool, shape, together), owners * len(together)
        # the search wants terms that belong to no sensor last
        order = sorted(range(len(of_all)), key=lambda i: not of_all[i])
        search = best_sensor_sets(
            cross[np.ix_([*order, len(order)], [*order, len(order)])],
            bench.n_samples,
            [of_all[i] for i in order],
            n_sensors=len(pool),
            max_sensors=min(most or options.max_sensors, len(pool)),
            n_best=_per_size(pool),
            must=tuple(pool.index(name) for name in options.must if name in pool),
            always=tuple(range(sum(bool(owner) for owner in of_all), len(order))),
        )
        for found in search.by_size.values():
            sets.update(dict.fromkeys(tuple(pool[i] for i in best.sensors) for best in found if best.sensors))
    return list(sets)


def _side_by_side(bench: Bench, pool: Sequence[str], shape: Shape, responses: Sequence[int]) -> Array:
    """Cross-products of a regression of all responses at once: each has the terms for itself, and its spread for unit.

    Its residual sum of squares is the sum over the responses of the share that each leaves.
    """
    alone = [bench.cross(pool, shape, j) for j in responses]
    if len(alone) == 1:
        return alone[0]
    n = len(alone[0]) - 1
    joint = np.zeros((n * len(alone) + 1, n * len(alone) + 1))
    for k, cross in enumerate(alone):
        at = slice(k * n, (k + 1) * n)
        joint[at, at] = cross[:-1, :-1]
        joint[at, -1] = joint[-1, at] = cross[:-1, -1] / np.sqrt(cross[-1, -1])
    joint[-1, -1] = len(alone)
    return joint


def sparse_forms(bench: Bench, sensors: Sequence[str], shape: Shape) -> list[ListedTerms]:
    """For every number of products and powers, the exact best ones of a shape beside the sensors themselves."""
    terms = shape.terms(sensors, ())
    linear = tuple(i for i, term in enumerate(terms) if term.degree == 1)
    found: dict[tuple[Term, ...], None] = {}
    for j in _moving_responses(bench):
        search = best_subsets(
            bench.cross(sensors, shape, j),
            bench.n_samples,
            max_size=min(max(MOST_TERMS, len(linear)), len(terms)),
            n_best=PER_SIZE,
            must=linear,
        )
        for size, best in search.by_size.items():
            if len(linear) < size < len(terms):
                found.update((hierarchical(terms[i] for i in one.columns), None) for one in best)
    return [ListedTerms(terms) for terms in found]


def _relevance(bench: Bench, sensors: Sequence[str]) -> Array:
    """Mean over the responses of the squared correlation of each sensor with the displacement."""
    total = np.zeros(len(sensors))
    for j in range(len(bench.library.responses)):
        cross = bench.cross(sensors, LINEAR, j)
        spread = np.diag(cross)[:-1] * cross[-1, -1]
        total += np.divide(cross[:-1, -1] ** 2, spread, out=np.zeros(len(sensors)), where=spread > 0)
    return total / len(bench.library.responses)


def _by_cost(question: Question, relevance: Array) -> Array:
    """Relevance by which representatives are taken: of those within a hundredth in r², the cheapest comes first."""
    cost = np.array([question.options.cost.get(name, 1.0) for name in question.sensors])
    if np.ptp(cost) == 0:
        return relevance
    steps = np.floor(relevance / AS_RELEVANT)
    return np.asarray(steps - 0.5 * cost / cost.max() + 0.4 * (relevance / AS_RELEVANT - steps) / len(cost))


def _screenings(question: Question, similarity: Similarity, axis: LambdaAxis, relevance: Array) -> list[Screening]:
    options = question.options
    must = tuple(question.sensors.index(name) for name in options.must)
    if options.grouping == "cmeans":
        return _fuzzy_screenings(question, similarity, axis, relevance, must)
    if options.levels is not None:
        levels: Iterable[tuple[float, ...]] = [tuple(snapped(level, axis) for level in options.levels)]
    else:
        counts = 1 + np.searchsorted(np.sort(axis.levels), axis.highs)
        few = np.flatnonzero(counts <= MAX_CANDIDATES).tolist()
        levels = [_round_levels(axis, counts, k, options.rounds) for k in few]
    screenings = []
    for level in levels:
        rounds = screen(
            similarity.matrix, relevance, level, must=must, constant=similarity.constant, names=question.sensors
        )
        # where every sensor rests (in a short fold) none can stand for another
        kept = tuple(question.sensors[i] for i in sorted(rounds[-1].representatives)) or question.sensors
        told = options.levels[0] if options.levels else level[0]
        screenings.append(Screening(told, tuple(rounds), kept, axis.at(level[0]).f))
    return screenings


def _fuzzy_screenings(
    question: Question, similarity: Similarity, axis: LambdaAxis, relevance: Array, must: tuple[int, ...]
) -> list[Screening]:
    """Fuzzy groups of every number from two to √n (Pal & Bezdek): towards n the coefficient says nothing any more."""
    n = len(question.sensors)
    found: dict[Partition, Screening] = {}
    for wanted in range(min(2, n), min(max(2, math.ceil(math.sqrt(n))), MAX_CANDIDATES, n) + 1):
        fuzzy = fuzzy_groups(similarity.matrix, wanted, question.sensors, cut_beside(axis, wanted))
        done = fuzzy_round(
            similarity.matrix, relevance, fuzzy, must, constant=similarity.constant, names=question.sensors
        )
        kept = tuple(question.sensors[i] for i in sorted(done.representatives)) or question.sensors
        found.setdefault(
            fuzzy.partition, Screening(fuzzy.partition.level, (done,), kept, None, fpc=fuzzy.fpc, fuzzy=fuzzy)
        )
    return list(found.values())


def _cheapest(question: Question, sensors: Sequence[str]) -> tuple[str, ...]:
    """The sensors that cost least, and those that must be kept."""
    options = question.options
    least = min(options.cost.get(name, 1.0) for name in sensors)
    return tuple(name for name in sensors if options.cost.get(name, 1.0) <= least or name in options.must)


def _per_size(pool: Sequence[str]) -> int:
    """Sets of each size that are looked at: all of them where there are few sensors, as the patent does."""
    return 20 if len(pool) <= 6 else PER_SIZE


def snapped(level: float, axis: LambdaAxis) -> float:
    """The closure level that a given λ means, where the two differ by the rounding of correlations only.

    A correlation of 0.9970 comes out of samples as 0.99699999999983; a cut "at 0.9970" is a cut at this level.
    """
    nearest = min(axis.levels, key=lambda known: abs(known - level), default=level)
    return nearest if abs(nearest - level) <= CORRELATION_ROUNDING else level


def _round_levels(axis: LambdaAxis, counts: Indices, final: int, rounds: int) -> tuple[float, ...]:
    """λ of each round: the number of groups shrinks by about the same factor in each, down to step `final`.

    With one λ for all rounds only the first would have any effect (see `screen`).
    """
    n = len(axis.order)
    wanted = [n ** (1 - i / rounds) * counts[final] ** (i / rounds) for i in range(1, rounds)]
    steps = [min(int(np.argmin(np.abs(np.log(counts / count)))), final) for count in wanted]
    return tuple(axis.highs[k] for k in (*steps, final))


def _linear_sets(question: Question, bench: Bench, pool: Sequence[str]) -> list[tuple[str, ...]]:
    options = question.options
    sets: dict[tuple[str, ...], None] = {}
    for j in _moving_responses(bench):
        search = best_subsets(
            bench.cross(pool, LINEAR, j),
            bench.n_samples,
            max_size=min(options.max_sensors, len(pool)),
            n_best=_per_size(pool),
            must=tuple(pool.index(name) for name in options.must if name in pool),
        )
        for found in search.by_size.values():
            sets.update(dict.fromkeys(tuple(pool[i] for i in best.columns) for best in found if best.columns))
    if len(_moving_responses(bench)) > 1:
        # the best for each response need not be the best for all: of all sensors, and larger sets of those found so far
        for several in (list(pool), [name for name in pool if any(name in one for one in sets)]):
            sizes = range(1, min(options.max_sensors, len(several)) + 1)
            most = max(size for size in sizes if size == 1 or math.comb(len(several), size) <= MOST_TOGETHER)
            alone = _per_size(several) > _per_size(pool)  # else those of each response are known by now
            sets.update(dict.fromkeys(sets_with_terms(question, bench, several, LINEAR, most, alone)))
    # where no displacement moves in these folds nothing can be ranked
    must = tuple(name for name in pool if name in options.must)
    return list(sets) or ([must] if must else [(name,) for name in pool])


def _moving_responses(bench: Bench) -> list[int]:
    """Responses that are not constant in these folds."""
    return [j for j in range(len(bench.library.responses)) if bench.cross((), LINEAR, j)[0, 0] > 0]


def _chosen_screening(
    question: Question, scored: Sequence[tuple[Screening, Array, float]], weights: Array
) -> tuple[Screening, str]:
    if len(scored) == 1:
        given = question.options.level is not None
        return scored[0][0], "λ was given" if given else "there is only one way to group these sensors"
    as_good = within_one_standard_error(np.array([errors for _, errors, _ in scored]), weights)
    eligible = [entry for entry, good in zip(scored, as_good, strict=True) if good]

    def rank(entry: tuple[Screening, Array, float]) -> tuple[float, float]:
        screening, _, error = entry
        # groups of exact duplicates have no scatter, and an infinite F says nothing about the rest
        f = screening.f.value if screening.f is not None and math.isfinite(screening.f.value) else -1.0
        return (f if screening.fuzzy is None else screening.fuzzy.crispness, -error)

    best = max(eligible, key=rank)[0]
    groups = len(best.rounds[0].partition.members)
    equally = (
        f"of the {len(scored)} ways to group, {len(eligible)} lead{'s' * (len(eligible) == 1)} to "
        "sensors that predict unseen runs equally well within one standard error, and this one "
    )
    if best.fuzzy is not None:
        return best, (
            f"fuzzy c-means makes {groups} groups with a partition coefficient of {best.fuzzy.fpc:.3g}; {equally}is "
            "the crispest of them"
        )
    f = (
        f"the largest F-statistic, {best.f.value:.3g},"
        if best.f is not None and math.isfinite(best.f.value)
        else "the smallest held-out error"
    )
    because = f"λ = {best.level:.6g} makes {groups} groups; {equally}has {f} among them"
    return best, because
