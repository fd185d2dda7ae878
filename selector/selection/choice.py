"""The choice of sensors and shape, on some folds only: the same function for the result and inside every fold."""

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from selector.models.design import Form, time_constant_grid
from selector.models.moments import (
    MOST_ABOVE_BEST,
    WORTH_OF_A_SENSOR,
    coefficients,
    squared_error,
    within_one_standard_error,
)
from selector.selection.candidates import Candidates, SensorSet, sets_with_terms, sparse_forms
from selector.selection.library import ROUNDING, Bench, Shape
from selector.selection.options import MAX_CANDIDATES, Question
from selector.types import Array

LEAST_TAU_RATIO = 4.0
#: Beyond this a lag says nothing that another term does not, and their difference explodes on another day.
MAX_VIF = 2e3
PROMISING = 40  #: Sets on which a second time constant is tried.
SAFER = 2.0  #: How many times the least risk among equal sets one may have and be taken because others agree with it.
ALIKE = 0.9  #: Correlation from which two sensors with coefficients of opposite signs work against each other.
#: How quickly a set loses weight with its error, for each group that was left out. Of four groups one with 1.2 times
#: the least error still counts a twentieth; of thirty hardly any but the best.
SHARPNESS = 4.0
LEAST_WEIGHT = 1e-3  #: Of that of the best; what weighs less is left out.
NEAR_NOISE = 2.0  #: Times the noise of the gauge up to which no set can be much better.
WORTH_SOME_TERMS = 10  #: Sets of which products and powers are chosen one by one.


@dataclass(frozen=True)
class Trial:
    """A set with a shape, and how it did."""

    set: SensorSet
    shape: Shape
    n_terms: int
    #: (n_groups,): Held-out mean squared error of each inner group, relative to the variance of the displacement; of
    #: several, see `_side_by_side`
    errors: Array
    error: float  #: The same over all groups, as a root
    rmse_um: Array  #: (n_responses,): Held-out error over all groups
    adjusted_r2: float  #: In sample, mean over the responses; NaN unless sets are ranked by it
    mean_squares: Array = field(default_factory=lambda: np.empty(0))  #: (n_groups, n_responses): Held-out [µm²]


@dataclass(frozen=True)
class Choice:
    """What was chosen among some trials, and the best of every size."""

    trial: Trial
    by_size: dict[int, Trial]
    trials: tuple[Trial, ...]
    eligible: tuple[Trial, ...]  #: Of these, what the plan allows

    @property
    def alike(self) -> tuple[Trial, ...]:
        """What the chosen trial is compared with: sets in its shape; where terms were chosen singly, each at best."""
        shape = self.trial.shape
        if isinstance(shape.form, Form):
            return tuple(trial for trial in self.trials if trial.shape == shape)
        found = {self.trial.set.sensors: self.trial}
        for trial in sorted(self.trials, key=lambda t: t.error):
            if (trial.shape.sensor_taus_s, trial.shape.speed_taus_s) == (shape.sensor_taus_s, shape.speed_taus_s):
                found.setdefault(trial.set.sensors, trial)
        return tuple(found.values())


Offer = Literal["linear", "polynomial", "memory"]  #: How rich a model may be; each offer holds all that come before it.
Plan = tuple[Offer, int]  #: An offer, and the most sensors that a set may have.


@dataclass(frozen=True)
class Agreement:
    """The mean of what many sets predict, each weighted by how well it does.

    A set that stays near it is chosen where several are as good (projection on a reference model, as in Piironen,
    Paasiniemi and Vehtari 2020).
    """

    bench: Bench
    cross: Array  #: (1 + n_columns, n_responses): Of [1, columns] with the mean predictions, over the rows of the bench
    own: Array  #: (n_responses, n_responses): Of these with each other

    @classmethod
    def of(cls, bench: Bench, sets: Sequence[tuple[tuple[str, ...], Shape]], errors: Array) -> "Agreement":
        """With weights (least error ÷ error)^(`SHARPNESS` · groups); the held-out `errors` have shape (n_sets,)."""
        errors = np.maximum(errors, np.sqrt(ROUNDING))
        weights = (errors.min() / errors) ** (SHARPNESS * len(bench.samples))
        weights[weights < LEAST_WEIGHT] = 0.0
        n = 1 + bench.library.moments.n_columns
        beta, responses = np.zeros((n, len(bench.power))), range(n, len(bench.total))
        for i in np.flatnonzero(weights).tolist():
            at = [1 + column for column in bench.library.columns(*sets[i])]
            beta[[0, *at]] += weights[i] / weights.sum() * coefficients(bench.total, at, responses)
        columns = bench.total[:n, :n]
        return cls(bench, columns @ beta, beta.T @ columns @ beta)

    def distance(self, sensors: Sequence[str], shape: Shape) -> float:
        """How near a set can come to it, as a root mean square, in spreads of the displacements."""
        index = np.array([0, *(1 + column for column in self.bench.library.columns(sensors, shape))])
        beside, n = self.cross[index], len(index)
        cross = np.block([[self.bench.total[index[:, None], index], beside], [beside.T, self.own]])
        at, of = range(1, n), range(n, len(cross))
        left = squared_error(cross, at, of, coefficients(cross, at, of)) / self.bench.n_samples
        return float(np.sqrt(np.maximum(left / self.bench.power, ROUNDING).mean()))


@dataclass(frozen=True)
class Tested:
    """All trials on some folds; a choice can be made for each offer."""

    question: Question
    trials: tuple[Trial, ...]
    bench: Bench
    #: Made when first asked for; other targets share them
    agreements: dict[Offer, Agreement] = field(default_factory=dict, repr=False, compare=False)

    def aimed_at(self, target_um: float | None) -> "Tested":
        """The same with another target."""
        return replace(self, question=replace(self.question, options=replace(self.question.options, target=target_um)))

    def choice(self, plan: Plan) -> Choice:
        """The cheapest of the good trials that a plan allows."""
        allowed, eligible = self._allowed((plan[0], self.question.max_sensors)), self._allowed(plan)
        return Choice(self._best(eligible, plan[0]), best_by_size(allowed), allowed, eligible)

    def _best(self, trials: Sequence[Trial], offer: Offer) -> Trial:
        """The cheapest of the good ones; of these, unless the patent's rule is asked for, the one others agree with."""
        options = self.question.options
        if options.tolerance is not None:
            top = max(trial.adjusted_r2 for trial in trials)
            good = [trial for trial in trials if trial.adjusted_r2 >= top - options.tolerance]
            # the patent ranks sensors, then fit; the shape is the richest on offer that the tolerance asks for
            return min(good, key=lambda t: (options.total_cost(t.set.sensors), t.n_terms, -t.adjusted_r2))
        good = _as_good(self.question, trials, self.bench.samples)

        def cost(trial: Trial) -> tuple[float, int]:
            return options.total_cost(trial.set.sensors), trial.n_terms

        def rank(trial: Trial) -> tuple[float, int, float]:
            from_groups = 0 if trial.set.origin == "representatives" else 1
            return self._agreed(offer).distance(trial.set.sensors, trial.shape), from_groups, trial.error

        cheapest = min(map(cost, good))
        alike = [trial for trial in good if cost(trial) == cheapest]
        best = min(alike, key=rank)
        equal = [trial for trial in alike if _is_equal(self.question, trial, best)]
        return min(_safest(equal, self.bench), key=rank)

    def _agreed(self, offer: Offer) -> Agreement:
        if offer not in self.agreements:
            trials = self._allowed((offer, self.question.max_sensors))
            sets = [(trial.set.sensors, trial.shape) for trial in trials]
            self.agreements[offer] = Agreement.of(self.bench, sets, np.array([trial.error for trial in trials]))
        return self.agreements[offer]

    def has(self, plan: Plan) -> bool:
        """Whether there is a trial that a plan allows."""
        return bool(self._allowed(plan))

    def _allowed(self, plan: Plan) -> tuple[Trial, ...]:
        offer, most = plan
        return tuple(one for one in self.trials if len(one.set.sensors) <= most and _allows(offer, one.shape))


def offers(question: Question) -> tuple[Offer, ...]:
    """The offers that the options make, the poorest first."""
    options = question.options
    if options.formula is not None:
        return ("polynomial",)
    found: list[Offer] = ["linear"]
    if options.degree > 1 or options.interactions:
        found.append("polynomial")
    if options.memory:
        found.append("memory")
    return tuple(found)


def plans(question: Question) -> tuple[Plan, ...]:
    """The offers with every largest number of sensors; where another rule is asked for, with all that are allowed."""
    options = question.options
    rules = (options.level, options.tolerance, options.within, options.target, options.formula)
    bounded = any(rule is not None for rule in rules)
    sizes = [question.max_sensors] if bounded else range(1, question.max_sensors + 1)
    return tuple((offer, most) for offer in offers(question) for most in sizes)


def _allows(offer: Offer, shape: Shape) -> bool:
    linear = shape.form.degree == 1 and not shape.form.interactions
    return offer == "memory" or (not shape.has_memory and (linear or offer == "polynomial"))


def shapes_on_offer(question: Question, period_s: float, duration_s: float) -> tuple[list[Shape], list[Shape]]:
    """(shapes without memory, shapes with one time constant); the second list is empty unless memory is offered."""
    static = [Shape(form) for form in question.options.forms]
    if not question.options.memory:
        return static, []
    taus = [float(f"{tau:.3g}") for tau in time_constant_grid(period_s, duration_s, 13)]
    lagged = [Shape(sensor_taus_s=(tau,)) for tau in taus]
    if question.speeds:
        lagged += [Shape(speed_taus_s=(tau,)) for tau in taus]
    return static, lagged


def library_requests(
    found: Sequence[Candidates], static: Sequence[Shape], lagged: Sequence[Shape]
) -> list[tuple[tuple[str, ...], Shape]]:
    """Every (sensors, shape) whose terms a choice on any of these candidates may ask for."""
    requests: dict[tuple[tuple[str, ...], Shape], None] = {}
    for one in found:
        pools = [one.grouping.chosen.representatives] if _searchable(one) else []
        for sensors in [*pools, *(s.sensors for s in one.sets)]:
            for shape in (*static, *lagged):
                requests[(sensors, shape)] = None
    return list(requests)


def tested(
    question: Question, found: Candidates, bench: Bench, static: Sequence[Shape], lagged: Sequence[Shape]
) -> Tested:
    """Try candidates × shapes on the inner groups of these folds.

    Lags are added one time constant at a time: the best single one is tried with every form, then a second one beside
    it. The bench must hold all of `library_requests`, for every set that any of these candidates leads to.
    """
    origin = {s.sensors: s for s in found.sets}
    pool = found.grouping.chosen.representatives
    trials: dict[tuple[tuple[str, ...], Shape], Trial] = {}

    def test(shape: Shape, *, search: bool = False, among: Sequence[tuple[str, ...]] = ()) -> None:
        if search and _searchable(found) and (shape.form.interactions or shape.form.degree > 1 or shape.has_memory):
            for sensors in sets_with_terms(question, bench, pool, shape):
                origin.setdefault(sensors, SensorSet(sensors, "representatives"))
        new = [sensors for sensors in among or origin if (sensors, shape) not in trials]
        for trial in _trials(question, bench, shape, new, origin):
            trials[(trial.set.sensors, trial.shape)] = trial

    for shape in static:
        test(shape, search=True)
    if len(static) > 1:
        for sensors in _promising(trials.values(), WORTH_SOME_TERMS):
            for form in sparse_forms(bench, sensors, static[-1]):
                test(Shape(form), among=[sensors])
    for shape in lagged:
        test(shape, search=True)
    with_memory = [trial for trial in trials.values() if trial.shape.has_memory]
    if with_memory:
        first = min(with_memory, key=lambda t: t.error).shape
        for shape in static[1:]:
            test(Shape(shape.form, first.sensor_taus_s, first.speed_taus_s))
        promising = _promising(trials.values(), PROMISING)
        for other in lagged:
            both = Shape(
                first.form,
                tuple(sorted({*first.sensor_taus_s, *other.sensor_taus_s})),
                tuple(sorted({*first.speed_taus_s, *other.speed_taus_s})),
            )
            if both not in (first, other) and _well_apart(both.sensor_taus_s) and _well_apart(both.speed_taus_s):
                test(both, among=promising)
    return Tested(question, _side_by_side(question, list(trials.values()), bench), bench)


def _side_by_side(question: Question, trials: Sequence[Trial], bench: Bench) -> tuple[Trial, ...]:
    """The trials with errors in which several responses count alike.

    Where the set that is best for all leaves hardly more of any than the noise of its gauge (`NEAR_NOISE`), errors
    count relative to what it leaves: in its spread a response that is mostly noise would be most of every error, and
    hide what another loses. Where more is left they count in the spread: what the best of few runs leaves is luck.
    """
    if len(bench.power) == 1 or not trials:
        return tuple(trials)
    unit = unit_um(question, min(trials, key=lambda t: t.error).rmse_um, np.sqrt(bench.power)) ** 2
    share = bench.samples / bench.samples.sum()
    errors = [np.maximum((trial.mean_squares / unit).mean(axis=1), ROUNDING) for trial in trials]
    return tuple(
        replace(trial, errors=one, error=float(np.sqrt(one @ share))) for trial, one in zip(trials, errors, strict=True)
    )


def unit_um(question: Question, least_um: Array, spread_um: Array) -> Array:
    """What errors of each response are relative to [µm]: the least ones where all are noise, else the spreads."""
    is_noise = (least_um <= NEAR_NOISE * np.asarray(question.noise_um)).all()
    return np.maximum(least_um, ROUNDING * spread_um) if is_noise else spread_um


def _promising(trials: Iterable[Trial], most: int) -> list[tuple[str, ...]]:
    """The sets that did best, each once."""
    return list(dict.fromkeys(trial.set.sensors for trial in sorted(trials, key=lambda t: t.error)))[:most]


def _well_apart(taus_s: Sequence[float]) -> bool:
    """Two lags of one reading with nearby time constants are each other's copies, and their difference explodes."""
    return all(later >= LEAST_TAU_RATIO * earlier for earlier, later in itertools.pairwise(sorted(taus_s)))


def best_by_size(trials: Sequence[Trial]) -> dict[int, Trial]:
    """The trial with the smallest held-out error for each number of sensors."""
    found: dict[int, Trial] = {}
    for trial in sorted(trials, key=lambda t: (len(t.set.sensors), t.error)):
        found.setdefault(len(trial.set.sensors), trial)
    return found


def _safest(equal: Sequence[Trial], bench: Bench) -> list[Trial]:
    """Of equal sets those with little risk: what the worst fault of a sensor moves, times the root of the largest VIF.

    It counts `SAFER` times where two alike sensors work against each other.
    """
    if len(equal) == 1:
        return list(equal)
    risks = []
    for trial in equal:
        sensors, shape = trial.set.sensors, trial.shape
        fault, opposed = bench.faults(sensors, shape, ALIKE)
        # what moves nothing risks nothing, however its terms make each other up
        together = np.sqrt(bench.largest_vif(sensors, shape)) if fault > 0.0 else 0.0
        risks.append((SAFER if opposed else 1.0) * fault * together)
    return [trial for trial, risk in zip(equal, risks, strict=True) if risk <= SAFER * min(risks)]


def _as_good(question: Question, trials: Sequence[Trial], samples: Array) -> list[Trial]:
    """The trials among which only the cost decides; where no one reaches the target, the best one alone."""
    options = question.options
    best = min(trials, key=lambda t: t.error)
    if options.target is not None:
        return [trial for trial in trials if (trial.rmse_um <= options.target).all()] or [best]
    if options.within is not None:
        return [trial for trial in trials if is_within_noise(question, trial, best)]
    as_good = within_one_standard_error(np.array([trial.errors for trial in trials]), samples)
    return [
        trial
        for trial, is_good in zip(trials, as_good, strict=True)
        if is_good or is_within_noise(question, trial, best)
    ]


def _margin_um(question: Question, best_um: Array) -> Array:
    """How much more than the best a set may err and count as equal [µm], one per response.

    What was asked for, or the measured noise of the gauge, but never more than `MOST_ABOVE_BEST` of the error.
    """
    within = question.options.within
    return np.minimum(question.noise_um, MOST_ABOVE_BEST * best_um) if within is None else np.full_like(best_um, within)


def is_within_noise(question: Question, trial: Trial, best: Trial) -> bool:
    """Whether a set errs more than the best by no more than the margin, for every response."""
    return bool((trial.rmse_um - best.rmse_um <= _margin_um(question, best.rmse_um)).all())


def _is_equal(question: Question, trial: Trial, best: Trial) -> bool:
    """Whether a set is within the margin of the best, or, unless one was asked for, within `WORTH_OF_A_SENSOR`.

    For every response: what one gains does not pay for what another loses.
    """
    near = bool((trial.rmse_um <= best.rmse_um * (1.0 + WORTH_OF_A_SENSOR)).all())
    return (near and question.options.within is None) or is_within_noise(question, trial, best)


def _trials(
    question: Question,
    bench: Bench,
    shape: Shape,
    sets: Sequence[tuple[str, ...]],
    origin: dict[tuple[str, ...], SensorSet],
) -> Iterator[Trial]:
    share = bench.samples / bench.samples.sum()
    for sensors, held_out in bench.held_out_of(sets, shape, MAX_VIF if shape.has_memory else np.inf).items():
        errors = bench.relative(held_out)
        yield Trial(
            origin[sensors],
            shape,
            len(bench.library.columns(sensors, shape)),
            errors,
            float(np.sqrt(errors @ share)),
            held_out.rmse_um,
            float("nan") if question.options.tolerance is None else bench.mean_adjusted_r2(sensors, shape),
            held_out.mse,
        )


def _searchable(found: Candidates) -> bool:
    """Whether sets are searched, and products of all representatives are few enough to hold."""
    named = any(one.origin == "formula" for one in found.sets)
    return not named and len(found.grouping.chosen.representatives) <= MAX_CANDIDATES
