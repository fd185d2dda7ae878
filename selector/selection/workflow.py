"""The main job: recordings in, sensors, models and proof out."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from selector.findings import Finding
from selector.models.best_subsets.subsets import side_by_side
from selector.models.design import Form, Rows, datum_of, rows_of
from selector.models.least_squares import FittedModel, fault_gains, validity_hull
from selector.models.moments import WORTH_OF_A_SENSOR, HeldOut, more_than_its_error, response_power
from selector.models.run_before import begun, in_parts, runs_before
from selector.quality.finding_table import CONSTANT_CHANNEL, DUPLICATE_CHANNEL
from selector.recording import RunSource, thinned
from selector.selection import fitting, proving
from selector.selection.candidates import Grouping, candidates
from selector.selection.choice import Choice, Offer, Plan, Tested, plans, shapes_on_offer, tested, unit_um
from selector.selection.doubts import LONGEST_PAUSE, doubts, known
from selector.selection.equal_sets import equal_sets
from selector.selection.library import Bench, Library
from selector.selection.options import Options, Progress, Question, question_of
from selector.selection.reasons import because_of, combinations_of, reasons_of, stability_of
from selector.selection.result import Proof, Selection
from selector.selection.survey import RunsOf, Survey, survey
from selector.sensors.finding_table import CONSTANT_SENSOR
from selector.types import Array

#: Richer terms must lower the error on unseen parts by more than this; a hundredth is luck of the days.
WORTH_A_RICHER_MODEL = 1.02
#: Parts from which on number of sensors and offer are decided without the part that is predicted; of three, the other
#: two decide worse than all of them do.
FEWEST_TO_DECIDE = 4
LEVELS = {"error": 0, "warning": 1, "info": 2}
AIMS = (1.0, 0.95, 0.9, 0.85, 0.8, 0.75, 0.7, 0.65, 0.6, 0.5, 0.4)  #: Shares of a target, see `_aimed`.
NO_RIDGE = (0.0, float("nan"), float("nan"))


def select(
    source: RunSource,
    options: Options | None = None,
    *,
    findings: Sequence[Finding] = (),
    provenance: Mapping[str, Any] | None = None,
    progress: Progress | None = None,
) -> Selection:
    """Choose sensors, fit one model per response, and prove it on parts of the recording that it has not seen.

    Everything that is chosen (groups, sensors, terms, time constants) is chosen again inside every fold, from the
    other folds only; the error that is reported is the error of that whole procedure.

    What was found so far (reading, quality) leads the findings of the result.

    Raises OptionError: the options do not fit the recording, or the recording cannot support a model.
    """
    say = progress or (lambda _what, _share: None)
    say("reading", 0.0)
    source = in_parts(source)
    asked = question_of(source, options or Options())
    source = source if asked.options.reference == "absolute" else begun(source, asked.responses)
    datum = datum_of(source, asked.sensors, asked.responses, asked.options.reference)
    surveyed = survey(source, asked, datum, findings)
    question = surveyed.question
    if question.options.memory:
        datum = replace(datum, follows=runs_before(source, surveyed.runs))
    n_blocks = proving.blocks_per_run(len(surveyed.runs), surveyed.n_samples)
    folds = proving.Folds(question, RunsOf(source, surveyed.runs), datum, n_blocks)

    chosen = _chosen(folds, surveyed, say)
    say("fitting", 0.75)
    fitted = _fitted(folds, source, surveyed, chosen)
    say("proving on unseen runs", 0.85)
    proof = _proof(folds, chosen, fitted)
    selection = _selection(folds, chosen, fitted, proof, provenance or {})
    say("looking for doubts", 0.95)
    starts = datum_of(source, question.sensors, (), "rise") if datum.reference == "absolute" else datum
    starts = replace(starts, follows=runs_before(source, surveyed.runs, LONGEST_PAUSE))
    selection = replace(selection, known=known(selection, surveyed, starts, fitted.rows))
    told = {offer: _rms(chosen.unseen[best].rmse_um / chosen.spread) for offer, best in chosen.best_of_offer.items()}
    doubted = doubts(selection, surveyed, datum, fitted.rows, fitted.ridge, told, chosen.plan[0], fitted.stride)
    say("done", 1.0)
    everything = (*_worth_telling(findings, question, surveyed), *surveyed.findings, *doubted)
    return replace(selection, findings=tuple(sorted(everything, key=lambda finding: LEVELS[finding.level])))


@dataclass(frozen=True)
class _Chosen:
    """What is chosen on all parts, and again without each of them."""

    library: Library
    grouping: Grouping
    without_each: Sequence[Tested]
    unseen: Mapping[Plan, HeldOut]  #: Of the whole procedure
    best_of_offer: Mapping[Offer, Plan]
    plan: Plan  #: That is taken
    choice: Choice  #: Sensors and terms of the model
    provers: Sequence[Choice]  #: What predicts each part, which was chosen and decided without it

    @property
    def spread(self) -> Array:
        """Root mean square of each response [µm], shape (n_responses,)."""
        return np.sqrt(response_power(self.library.moments))


def _chosen(folds: proving.Folds, surveyed: Survey, say: Progress) -> _Chosen:
    question = folds.question
    say("grouping sensors", 0.1)
    with side_by_side() as threads:
        found_all, *found = threads.map(lambda out: candidates(question, folds.linear_bench(out)), (None, *folds.outer))
    static, lagged = shapes_on_offer(question, surveyed.period_s, surveyed.duration_s)
    memory_gb = folds.memory_gb([found_all, *found], static, lagged)
    say("forming terms" + f", which take about {memory_gb:.1f} GB of memory" * (memory_gb >= 1.0), 0.3)
    library = folds.library([found_all, *found], static, lagged)
    say("choosing sensors", 0.4)
    on_all = tested(question, found_all, Bench.of(library, folds.all), static, lagged)
    without_each: list[Tested] = []
    for i, (group, one) in enumerate(zip(folds.outer, found, strict=True)):
        without_each.append(tested(question, one, Bench.of(library, folds.without(group)), static, lagged))
        say("choosing sensors without each run", 0.4 + 0.3 * (i + 1) / len(found))
    possible = [plan for plan in plans(question) if all(one.has(plan) for one in (on_all, *without_each))]
    unseen = {
        plan: proving.held_out(library, folds.outer, [one.choice(plan) for one in without_each]) for plan in possible
    }
    spread = np.sqrt(response_power(library.moments))
    best_of_offer, plan = _best_plan(question, unseen, spread)
    aimed = _aimed(question, library, folds, without_each, plan)
    # the least of several errors is lucky: what a part proves was decided without it
    decided = [_best_plan(question, _without(unseen, i), spread)[1] for i in range(len(without_each))]
    if len(decided) < FEWEST_TO_DECIDE:
        decided = [plan] * len(decided)
    provers = [one.aimed_at(aimed).choice(other) for one, other in zip(without_each, decided, strict=True)]
    choice = on_all.aimed_at(aimed).choice(plan)
    return _Chosen(library, found_all.grouping, without_each, unseen, best_of_offer, plan, choice, provers)


@dataclass(frozen=True)
class _Fitted:
    """The models of what is chosen, and the parts that prove them."""

    runs: RunSource
    rows: Rows
    stride: int  #: Every so many samples are fitted
    recipe: fitting.Recipe
    ridge: tuple[float, float, float]
    models: dict[str, FittedModel]
    fallbacks: tuple[fitting.Fallback, ...]
    parts: Sequence[fitting.Part]
    beside: Sequence[fitting.Part]  #: Further ones, which the choice never saw
    lacking: Mapping[str, tuple[str, ...]]  #: Run that proves nothing → what it lacks


def _fitted(folds: proving.Folds, source: RunSource, surveyed: Survey, chosen: _Chosen) -> _Fitted:
    question, stride = folds.question, max(1, -(-surveyed.n_samples // fitting.MAX_ROWS))
    runs = folds.runs if stride == 1 else RunsOf(thinned(source, stride), surveyed.runs)
    recipe = fitting.refined(question, runs, folds.datum, chosen.choice.trial)
    rows = rows_of(runs, recipe.design, surveyed.runs)
    beside, lacking = proving.beside_the_comparison(folds, surveyed.runs, recipe.design)
    parts = [*(folds.part(group) for group in folds.outer), *beside]
    ridge = fitting.ridge_penalty(recipe, rows, parts) if question.options.ridge else NO_RIDGE
    models = fitting.final_models(recipe, rows, ridge=ridge[0])
    fallbacks = tuple(fitting.fallbacks_of(question, recipe, runs, surveyed.runs, parts, ridge[0]))
    return _Fitted(runs, rows, stride, recipe, ridge, models, fallbacks, parts, beside, lacking)


def _proof(folds: proving.Folds, chosen: _Chosen, fitted: _Fitted) -> Proof:
    choices = [*chosen.provers, *(chosen.choice for _ in fitted.beside)]
    not_taken = {offer: plan for offer, plan in chosen.best_of_offer.items() if offer != chosen.plan[0]}
    others = {offer: [one.choice(plan) for one in chosen.without_each] for offer, plan in not_taken.items()}
    proof = Proof(
        folds.left_out,
        *proving.left_out_errors(folds.question, fitted.runs, folds.datum, choices, fitted.parts, fitted.ridge[0]),
        proving.error_curve(chosen.library, folds.outer, [one.choice(chosen.plan) for one in chosen.without_each]),
        proving.baselines(folds.linear, chosen.library, folds.outer, others),
        fitted.lacking,
    )
    return proving.with_own_baseline(proof) if fitted.beside else proof


def _selection(
    folds: proving.Folds, chosen: _Chosen, fitted: _Fitted, proof: Proof, provenance: Mapping[str, Any]
) -> Selection:
    question, choice, recipe, rows = folds.question, chosen.choice, fitted.recipe, fitted.rows
    options, shape = question.options, choice.trial.shape
    lag_source = {lag.name: lag.source for lag in recipe.design.lags}
    gains = (
        fault_gains(model, rows.variables, recipe.sensors, lag_source, rise=options.reference == "rise")
        for model in fitted.models.values()
    )
    combinations = combinations_of(question, Bench.of(chosen.library, folds.all), choice)
    equal = None
    if isinstance(shape.form, Form) and not shape.form.interactions:
        equal = equal_sets(question, folds.bench_of_all_sensors, choice.trial.set.sensors, shape)
    unit = _unit(question, chosen.unseen, chosen.spread)
    return Selection(
        options=options,
        sensors=question.sensors,
        grouping=chosen.grouping,
        combinations=combinations,
        chosen=recipe.sensors,
        because=because_of(
            replace(question, options=replace(options, max_sensors=chosen.plan[1])),
            choice,
            recipe.shape,
            proof,
            fitted.models,
            combinations,
            _of_larger_sets(chosen.plan, {plan: one.rmse_um / unit for plan, one in chosen.unseen.items()}),
        ),
        reasons=reasons_of(chosen.grouping, question.sensors, recipe.sensors, choice),
        recipe=recipe,
        models=fitted.models,
        fit_per_run=fit_per_run(recipe.design.responses, fitted.models, rows),
        proof=proof,
        faults=tuple(gain for of_model in gains for gain in of_model),
        hull=validity_hull(rows.variables),
        stability=stability_of(question, chosen.library, chosen.grouping, choice),
        findings=(),
        provenance=dict(provenance),
        fallbacks=fitted.fallbacks,
        equal=equal,
    )


def _worth_telling(findings: Iterable[Finding], question: Question, surveyed: Survey) -> Iterator[Finding]:
    """A dead sensor is told once, and of those that are left out by --never nothing needs to be known."""
    constant = {one.where.channel for one in surveyed.findings if one.id == CONSTANT_SENSOR}
    never = question.options.never
    for one in findings:
        is_told = one.id == CONSTANT_CHANNEL and one.where.channel in constant
        is_twin_of_never = one.id == DUPLICATE_CHANNEL and one.evidence["other"] in never
        if not is_told and not is_twin_of_never and one.where.channel not in never:
            yield one


#: Error of the whole procedure on unseen parts by plan, relative to a unit of each response: (n_responses,).
Errors = Mapping[Plan, Array]


def _best_plan(question: Question, unseen: Mapping[Plan, HeldOut], spread: Array) -> tuple[dict[Offer, Plan], Plan]:
    """The best plan of each offer, and of these the poorest that predicts unseen parts about as well as the best does.

    A richer offer has to be as good for every response, and better over all; with fewer sensors it need not be clearly
    better. With the patent's rule, which knows no unseen data, and with a target the richest offer stands.
    """
    unit = _unit(question, unseen, spread)
    errors = {plan: one.rmse_um / unit for plan, one in unseen.items()}
    offers = dict.fromkeys(offer for offer, _ in errors)
    best_of_offer = {offer: _poorest_of(errors, offer, question.noise_um / unit) for offer in offers}
    if question.options.tolerance is not None or question.options.target is not None:
        return best_of_offer, list(errors)[-1]
    taken, *richer = best_of_offer.values()
    for plan in richer:
        loses = more_than_its_error(unseen[plan].mse - unseen[taken].mse, unseen[taken].n_samples)
        loses &= errors[plan] > WORTH_A_RICHER_MODEL * errors[taken]
        better = WORTH_A_RICHER_MODEL * _rms(errors[plan]) < _rms(errors[taken])
        gain = ((unseen[taken].mse - unseen[plan].mse) / unit**2).mean(axis=1)
        # what is won with fewer sensors need not be clear: these are what costs
        is_clear = plan[1] < taken[1] or more_than_its_error(gain, unseen[taken].n_samples)
        if better and is_clear and not loses.any():
            taken = plan
    return best_of_offer, taken


def _unit(question: Question, unseen: Mapping[Plan, HeldOut], spread: Array) -> Array:
    return unit_um(question, np.array([one.rmse_um for one in unseen.values()]).min(axis=0), spread)


def _without(unseen: Mapping[Plan, HeldOut], part: int) -> dict[Plan, HeldOut]:
    """The errors on all other parts."""
    return {
        plan: HeldOut(np.delete(one.sse, part, axis=0), np.delete(one.n_samples, part)) for plan, one in unseen.items()
    }


def _poorest_of(errors: Errors, offer: Offer, noise: Array) -> Plan:
    """The plan of an offer with the fewest sensors that is about as good as the best of them.

    A sensor that gains less than the noise of the gauge, and less than `WORTH_OF_A_SENSOR`, is not worth having.
    """
    of_offer = {plan: error for plan, error in errors.items() if plan[0] == offer}
    best = min(of_offer.values(), key=_rms)
    near = np.minimum(noise, WORTH_OF_A_SENSOR * best)
    return next(
        plan
        for plan, error in of_offer.items()
        if _rms(error) <= WORTH_A_RICHER_MODEL * _rms(best) or (error - best <= near).all()
    )


def _of_larger_sets(plan: Plan, errors: Errors) -> dict[int, float]:
    """Largest number of sensors → error of the whole procedure, relative to that of the plan, for larger sets."""
    larger = (other for other in errors if other[0] == plan[0] and other[1] > plan[1])
    least = np.finfo(np.float64).tiny
    return {other[1]: (_rms(errors[other]) + least) / (_rms(errors[plan]) + least) for other in larger}


def _rms(errors: Array) -> float:
    return float(np.sqrt((errors**2).mean()))


def _aimed(
    question: Question, library: Library, folds: proving.Folds, fold_trials: Sequence[Tested], plan: Plan
) -> float | None:
    """What fixed sets have to reach so that the whole procedure, which chooses anew, reaches the target."""
    target = question.options.target
    if target is None:
        return None
    for share in AIMS:
        choices = [trials.aimed_at(share * target).choice(plan) for trials in fold_trials]
        if (proving.held_out(library, folds.outer, choices).rmse_um <= target).all():
            return share * target
    return AIMS[-1] * target


def fit_per_run(
    responses: Sequence[str], models: Mapping[str, Any], rows: Rows
) -> dict[str, dict[str, tuple[float, float]]]:
    """Response → run → root mean square and largest error [µm] of its model in these samples."""
    of_run = {run: at for r, run in enumerate(rows.runs) if (at := rows.run == r).any()}
    errors = {name: rows.responses[:, j] - models[name].predicted(rows.variables) for j, name in enumerate(responses)}
    return {
        name: {run: (float(np.sqrt(np.mean(one[at] ** 2))), float(np.abs(one[at]).max())) for run, at in of_run.items()}
        for name, one in errors.items()
    }
