"""Reasons in plain words: which combinations were compared, why these sensors, why not the others."""

from collections.abc import Mapping, Sequence

import numpy as np

from selector.models.least_squares import FittedModel
from selector.models.moments import MOST_ABOVE_BEST, WORTH_OF_A_SENSOR, coefficients, squared_error
from selector.number_text import listed
from selector.selection.candidates import Grouping
from selector.selection.choice import Choice, Trial, is_within_noise
from selector.selection.library import Bench, Library, Shape
from selector.selection.options import Question
from selector.selection.result import FIXED_SET, PROCEDURE, Combination, Proof

BOOTSTRAP_SAMPLES = 100
_ONE_ERROR = "one standard error of the differences run by run"


def combinations_of(question: Question, bench: Bench, choice: Choice) -> tuple[Combination, ...]:
    """Every set of sensors that was compared, in the chosen shape, best adjusted R² first within each response."""
    found: list[Combination] = []
    for trial in choice.alike:
        sensors, shape = trial.set.sensors, trial.shape
        r2 = bench.r2(sensors, shape)
        held_out = bench.held_out(sensors, shape).rmse_um
        found.extend(
            Combination(sensors, name, r2[j][0], r2[j][1], float(held_out[j]), trial.set.origin)
            for j, name in enumerate(question.responses)
        )
    order = {name: j for j, name in enumerate(question.responses)}
    return tuple(sorted(found, key=lambda c: (order[c.response], -c.adjusted_r2)))


def because_of(
    question: Question,
    choice: Choice,
    shape: Shape,
    proof: Proof,
    models: Mapping[str, FittedModel],
    combinations: Sequence[Combination],
    of_larger_sets: Mapping[int, float],
) -> str:
    """A few sentences: why these sensors, and the errors that were compared for it.

    `of_larger_sets`: what the error of the whole procedure is, relative to its own, if sets may be larger.
    """
    trial = choice.trial
    options = question.options
    sensors, compared = listed(trial.set.sensors), ""
    errors = ", ".join(
        f"{name} from {proof.baselines_um[name]['none']:.1f} to {proof.rmse_um(name):.1f} µm" for name in models
    )
    if options.tolerance is not None:
        top = max(choice.eligible, key=lambda t: t.adjusted_r2)
        rule = (
            f"the cheapest set whose adjusted R² ({trial.adjusted_r2:.5f}) is within {options.tolerance:g} of the best "
            f"({top.adjusted_r2:.5f}, {listed(top.set.sensors)})"
            if top.set.sensors != trial.set.sensors
            else f"the set with the best adjusted R², {trial.adjusted_r2:.5f}"
        )
    else:
        top = min(choice.eligible, key=lambda t: t.error)
        most = (
            f"of at most {options.max_sensors} sensor{'s' * (options.max_sensors > 1)}"
            if options.max_sensors < len(question.sensors)
            else ""
        )
        if options.target is not None and all(proof.rmse_um(name) <= options.target for name in models):
            rule = f"the cheapest set{most and f' {most}'} with which the {PROCEDURE} has at most {options.target:g} µm"
        elif top.set.sensors != trial.set.sensors:
            near = "as good as that of" if options.within is None else f"within {options.within:g} µm of"
            rule = (
                f"the cheapest set whose {FIXED_SET} error is {near} the best{most and f' {most}'} "
                f"({listed(top.set.sensors)})"
            )
        else:
            rule = f"the set{most and f' {most}'} with the smallest {FIXED_SET} error"
        compared = _compared(question, choice, combinations, models)
    if set(trial.set.sensors) <= set(options.must):
        rule, compared = "what --must asks for, not a choice", ""
    if options.formula is not None:
        rule, compared = "the model that was asked for, not a choice", ""
    source = {
        "representatives": "representatives of their groups",
        "all sensors": f"found by the exact search over all {len(question.sensors)} sensors",
        "formula": "named in --formula",
    }[trial.set.origin]
    larger = ", ".join(f"with up to {most} {share:.2f} times" for most, share in of_larger_sets.items())
    larger = larger and f"More sensors are no better for the {PROCEDURE} on unseen data: {larger} its error. "
    unit = {"run": "runs", "condition": "conditions", "block": "stretches of the only run"}[proof.left_out]
    return (
        f"{sensors} ({source}; {shape}) is {rule}. {compared}{larger}"
        f"On {unit} that the model has not seen, the root mean square error of the {PROCEDURE} goes: {errors}."
    )


def _compared(
    question: Question, choice: Choice, combinations: Sequence[Combination], models: Mapping[str, FittedModel]
) -> str:
    """The errors that the rule compared: of the best set, of the chosen one, and of the best with one sensor less."""
    trial, top = choice.trial, min(choice.eligible, key=lambda t: t.error)
    known = {(one.sensors, one.response): one.heldout_rmse_um for one in combinations}
    alike = {id(one) for one in choice.alike}

    def told(label: str, other: Trial, why: str = "") -> str:
        # µm are known in the chosen shape only
        errors = [f"{name} {known[other.set.sensors, name]:.3g} µm" for name in models if id(other) in alike]
        above = f"({100 * (other.error / max(top.error, 1e-300) - 1):.0f} % above the best: {why})" if why else ""
        return " ".join(filter(None, [label, ", ".join(errors), above]))

    found = [told("best", top)] if id(top) in alike else []
    if top is not trial:
        found.append(told("chosen", trial, _why_equal(question, trial, top)))
    fewer = choice.by_size.get(len(trial.set.sensors) - 1)
    if fewer is not None and fewer.error > trial.error and not (question.options.cost or question.options.target):
        far = fewer.error > top.error * (1.0 + MOST_ABOVE_BEST)
        why = f"more than {100 * MOST_ABOVE_BEST:.0f} %" if far else f"more than {_ONE_ERROR}"
        asked = question.options.within
        why = why if asked is None else f"more than the {asked:g} µm that were asked for"
        n = len(fewer.set.sensors)
        found.append(told(f"best with {n} sensor{'' if n == 1 else 's'}", fewer, why))
    return f"{FIXED_SET[0].upper()}{FIXED_SET[1:]} errors: {'; '.join(found)}. "


def _why_equal(question: Question, trial: Trial, top: Trial) -> str:
    """By which rule a chosen set is as good as the best one."""
    options = question.options
    if options.target is not None:
        return f"enough for the {PROCEDURE} to reach {options.target:g} µm"
    if options.within is not None:
        return f"within the {options.within:g} µm that were asked for"
    if trial.error <= top.error * (1.0 + WORTH_OF_A_SENSOR):
        return f"up to {100 * WORTH_OF_A_SENSOR:.0f} % count as equal"
    if is_within_noise(question, trial, top):
        return "less than the noise of the gauge"
    return f"less than {_ONE_ERROR}"


def reasons_of(grouping: Grouping, sensors: Sequence[str], chosen: Sequence[str], choice: Choice) -> dict[str, str]:
    """Why each sensor was kept or dropped."""
    reasons: dict[str, str] = {}
    for one in grouping.chosen.rounds:
        for dropped in one.dropped:
            reasons.setdefault(sensors[dropped.sensor], f"dropped: {dropped.reason}")
    best_error = choice.trial.error
    searched = choice.trial.set.origin != "formula"
    for name in sensors:
        if name in chosen:
            # with more sensors almost any one can be done without
            fewest = [t for t in choice.alike if len(t.set.sensors) <= len(chosen)]
            without = [t for t in fewest if name not in t.set.sensors]
            if without:
                best = min(without, key=lambda t: t.error)
                reasons[name] = (
                    f"kept: without it the best of the compared sets ({listed(best.set.sensors)}) has "
                    f"{best.error / max(best_error, 1e-300):.2f} times the error on unseen data"
                )
            else:
                reasons[name] = (
                    "kept: every set that is no larger contains it" if searched else "kept: the formula names it"
                )
        elif searched:
            reasons.setdefault(name, "dropped: a representative that the chosen set does not need")
        else:
            reasons[name] = "dropped: the formula does not name it"
    return {name: reasons[name] for name in sensors}


def stability_of(question: Question, library: Library, grouping: Grouping, choice: Choice) -> dict[str, float]:
    """How often each chosen sensor, or one of its group, is in the best set of the same size and shape.

    Bootstrap over the folds: `BOOTSTRAP_SAMPLES` resamples; in each, the compared set that predicts best what it leaves
    out.
    """
    trial = choice.trial
    same_size = [other for other in choice.alike if len(other.set.sensors) == len(trial.set.sensors)]
    group_of = {name: i for i, group in enumerate(grouping.chosen.rounds[0].partition.groups) for name in group}
    rng = np.random.default_rng(question.options.seed)
    # in the order of the names, so that the order in which the runs were given changes nothing
    order = sorted(range(len(library.moments.folds)), key=lambda i: library.moments.folds[i].name)
    products = library.moments.products[order]
    n = len(products)
    first = 1 + library.moments.n_columns
    responses = range(first, first + len(library.responses))
    unit = np.maximum(trial.rmse_um**2, 1e-300)
    columns = [[1 + column for column in library.columns(one.set.sensors, one.shape)] for one in same_size]
    hits = dict.fromkeys(trial.set.sensors, 0)
    done = 0
    for _ in range(BOOTSTRAP_SAMPLES):
        weights = np.bincount(rng.integers(0, n, n), minlength=n)
        if (weights > 0).all():
            continue
        bag = np.tensordot(weights.astype(np.float64), products, 1)
        rest = products[weights == 0].sum(axis=0)
        errors = [
            float((squared_error(rest, at, responses, coefficients(bag, at, responses)) / unit).sum()) for at in columns
        ]
        best = {group_of[name] for name in same_size[int(np.argmin(errors))].set.sensors}
        done += 1
        for name in hits:
            hits[name] += group_of[name] in best
    return {name: count / max(done, 1) for name, count in hits.items()}
