"""The choice of sensors and shape, on some folds only: the same function for the result and inside every fold."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from selector.models.design import time_constant_grid
from selector.models.moments import within_one_standard_error
from selector.selection.candidates import Candidates, SensorSet, sets_with_terms
from selector.selection.library import Bench, Shape
from selector.selection.options import MAX_CANDIDATES, Question

LEAST_TAU_RATIO = 4.0
MAX_VIF = 2e3
"""Beyond this a lag says nothing that another term does not, and their difference explodes on another day."""

PROMISING = 40
"""Sets on which a second time constant is tried."""


@dataclass(frozen=True)
class Trial:
    """A set with a shape, and how it did."""

    set: SensorSet
    shape: Shape
    n_terms: int
    #: (n_groups,): Held-out mean squared error of each inner group, relative to the variance of the displacement
    errors: NDArray[np.float64]
    error: float  #: The same over all groups, as a root
    adjusted_r2: float  #: In sample, mean over the responses; NaN unless sets are ranked by it


@dataclass(frozen=True)
class Choice:
    """What was chosen among some trials, and the best of every size."""

    trial: Trial
    by_size: dict[int, Trial]
    trials: tuple[Trial, ...]


Offer = Literal["linear", "polynomial", "memory"]
"""How rich a model may be; each offer holds all that come before it."""


@dataclass(frozen=True)
class Tested:
    """All trials on some folds; a choice can be made for each offer."""

    question: Question
    trials: tuple[Trial, ...]
    samples: NDArray[np.float64]

    def choice(self, offer: Offer) -> Choice:
        """The cheapest of the good trials that an offer allows."""
        allowed = tuple(trial for trial in self.trials if _allows(offer, trial.shape))
        return Choice(_best(self.question, allowed, self.samples), best_by_size(allowed), allowed)


def offers(question: Question) -> tuple[Offer, ...]:
    """The offers that the options make, the poorest first."""
    options = question.options
    found: list[Offer] = ["linear"]
    if options.degree > 1 or options.interactions:
        found.append("polynomial")
    if options.memory:
        found.append("memory")
    return tuple(found)


def _allows(offer: Offer, shape: Shape) -> bool:
    linear = shape.form.degree == 1 and not shape.form.interactions
    return offer == "memory" or (not shape.has_memory and (linear or offer == "polynomial"))


def shapes_on_offer(question: Question, period_s: float, duration_s: float) -> tuple[list[Shape], list[Shape]]:
    """(shapes without memory, shapes with one time constant); the second list is empty unless memory is offered."""
    static = [Shape(form) for form in question.options.form.simpler()]
    if not question.options.memory:
        return static, []
    taus = [float(f"{tau:.3g}") for tau in time_constant_grid(period_s, duration_s, 13)]
    lagged = [Shape(sensor_taus_s=(tau,)) for tau in taus]
    if question.speeds:
        lagged += [Shape(speed_taus_s=(tau,)) for tau in taus]
    return static, lagged


def library_requests(
    question: Question, found: Sequence[Candidates], static: Sequence[Shape], lagged: Sequence[Shape]
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
    question: Question,
    found: Candidates,
    bench: Bench,
    static: Sequence[Shape],
    lagged: Sequence[Shape],
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
        new = [(sensors, shape) for sensors in (among or origin) if (sensors, shape) not in trials]
        for trial in _trials(question, bench, new, origin):
            trials[(trial.set.sensors, trial.shape)] = trial

    for shape in static:
        test(shape, search=True)
    for shape in lagged:
        test(shape, search=True)
    with_memory = [trial for trial in trials.values() if trial.shape.has_memory]
    if with_memory:
        first = min(with_memory, key=lambda t: t.error).shape
        for shape in static[1:]:
            test(Shape(shape.form, first.sensor_taus_s, first.speed_taus_s))
        promising = list(dict.fromkeys(t.set.sensors for t in sorted(trials.values(), key=lambda t: t.error)))[
            :PROMISING
        ]
        for other in lagged:
            both = Shape(
                first.form,
                tuple(sorted({*first.sensor_taus_s, *other.sensor_taus_s})),
                tuple(sorted({*first.speed_taus_s, *other.speed_taus_s})),
            )
            if both not in (first, other) and _well_apart(both.sensor_taus_s) and _well_apart(both.speed_taus_s):
                test(both, among=promising)
    return Tested(question, tuple(trials.values()), bench.samples)


def _well_apart(taus_s: Sequence[float]) -> bool:
    """Two lags of one reading with nearby time constants are each other's copies, and their difference explodes."""
    return all(later >= LEAST_TAU_RATIO * earlier for earlier, later in itertools.pairwise(sorted(taus_s)))


def best_by_size(trials: Sequence[Trial]) -> dict[int, Trial]:
    """The trial with the smallest held-out error for each number of sensors."""
    found: dict[int, Trial] = {}
    for trial in sorted(trials, key=lambda t: (len(t.set.sensors), t.error)):
        found.setdefault(len(trial.set.sensors), trial)
    return found


def _best(question: Question, trials: Sequence[Trial], samples: NDArray[np.float64]) -> Trial:
    options = question.options
    if options.tolerance is not None:
        top = max(trial.adjusted_r2 for trial in trials)
        good = [trial for trial in trials if trial.adjusted_r2 >= top - options.tolerance]
    else:
        as_good = within_one_standard_error(np.array([trial.errors for trial in trials]), samples)
        good = [trial for trial, is_good in zip(trials, as_good, strict=True) if is_good]

    def rank(trial: Trial) -> tuple[float, int, int, float]:
        from_groups = 0 if trial.set.origin == "representatives" else 1
        return (options.total_cost(trial.set.sensors), trial.n_terms, from_groups, trial.error)

    if options.tolerance is not None:
        # the patent ranks sensors, then fit; the shape is the richest on offer that the tolerance asks for
        return min(good, key=lambda t: (options.total_cost(t.set.sensors), t.n_terms, -t.adjusted_r2))
    # among sets of the same cost and size the better predictor, not the first
    cheapest = min(rank(trial)[:2] for trial in good)
    return min((trial for trial in good if rank(trial)[:2] == cheapest), key=lambda t: (t.error, rank(t)))


def _trials(
    question: Question,
    bench: Bench,
    tests: Sequence[tuple[tuple[str, ...], Shape]],
    origin: dict[tuple[str, ...], SensorSet],
) -> list[Trial]:
    share = bench.samples / bench.samples.sum()
    trials = []
    for sensors, shape in tests:
        if shape.has_memory and bench.largest_vif(sensors, shape) > MAX_VIF:
            continue
        errors = bench.errors(sensors, shape)
        trials.append(
            Trial(
                origin[sensors],
                shape,
                len(bench.library.columns(sensors, shape)),
                errors,
                float(np.sqrt(errors @ share)),
                float("nan") if question.options.tolerance is None else bench.mean_adjusted_r2(sensors, shape),
            )
        )
    return trials


def _searchable(found: Candidates) -> bool:
    """Whether products of all representatives are few enough to hold."""
    return len(found.grouping.chosen.representatives) <= MAX_CANDIDATES
