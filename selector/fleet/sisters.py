"""A model for a new machine from one to three runs: what its sisters share, and whether that carries over."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Literal

import numpy as np
import pandas as pd
from pydantic import Field

from selector.controllers.from_selection import model_file_of
from selector.controllers.model_file import ModelFile
from selector.errors import InputError, OptionError
from selector.fleet.fleet_file import Fleet
from selector.fleet.machine_study import Document
from selector.fleet.places import local_recordings
from selector.fleet.refitting import least_fall, runs_by_age
from selector.models import moments as sums
from selector.models.best_subsets.results import adjusted_r2
from selector.models.design import Columns, Datum, Design, Rows, datum_of, rows_of
from selector.models.least_squares import FittedModel, fit
from selector.models.population import FEWEST, Evidence, Population, parted
from selector.models.run_before import begun, runs_before
from selector.recording import Recording, RunSource, thinned
from selector.selection import Options, select
from selector.selection.candidates import LINEAR, candidates
from selector.selection.choice import Trial, library_requests, shapes_on_offer, tested
from selector.selection.fitting import Fallback, Recipe, evenly, recipe_without
from selector.selection.library import Bench, Library, Shape, library_of
from selector.selection.options import Question, question_of
from selector.selection.result import Proof, ProvenModel, RunProof
from selector.selection.survey import RunsOf, survey
from selector.selection.workflow import fit_per_run
from selector.study.asked import options_of, overrides_of
from selector.study.data import study_data
from selector.study.study_file import Study
from selector.types import Array

MOST_SAMPLES = 20_000  #: Of a machine; more are thinned to these.
MOST_PROVED = 30  #: Machines that are left out in turn.
#: No compensation, what `select` makes of a machine's own runs, one regression on all runs, or sisters.
WAYS = ("none", "own", "pooled", "sisters")
Say = Callable[[str, float], None]


@dataclass(frozen=True)
class Pool:
    """The recordings of some machines as one; a run is called ``machine/run``."""

    source: Recording
    question: Question
    datum: Datum
    runs: Mapping[str, tuple[str, ...]]  #: Machine → its runs with all sensors and displacements, oldest first
    left_out: Mapping[str, str]  #: Machine → what it lacks of the new one
    #: Median sampling period and longest run [s]
    period_s: float
    duration_s: float

    @classmethod
    def of(cls, machines: Mapping[str, Recording], new: str, options: Options) -> "Pool":
        """The machines that have the sensors of the new one; where another has them in part, it is left out.

        Raises OptionError: the options do not fit the new machine, or nothing usable is left.
        """
        channels = machines[new].channels
        tables, origins, runs, has = {}, {}, {}, {}
        for name, source in machines.items():
            roles = {one.name: one.role for one in source.channels}
            has[name] = same = [one.name for one in channels if roles.get(one.name) == one.role]
            runs[name] = runs_by_age(source)
            for run in runs[name]:
                tables[f"{name}/{run}"] = pd.DataFrame(source.values(run, same), source.time_s(run), same)
                origins[f"{name}/{run}"] = source.provenance.get("runs", {}).get(run, {})
        pooled = Recording.from_runs(tables, channels, {"runs": origins})
        asked = question_of(pooled, replace(options, conditions={}))
        if options.reference == "rise":
            pooled = thinned(begun(pooled, asked.responses), 1)
        named = {name: [f"{name}/{run}" for run in of] for name, of in runs.items()}
        datum = datum_of(pooled, asked.sensors, asked.responses, options.reference)
        asked = survey(RunsOf(pooled, named[new]), asked, datum).question
        needed = dict.fromkeys((*asked.sensors, *asked.speeds, *asked.responses))
        lacks = {name: [one for one in needed if one not in of] for name, of in has.items()}
        left_out = {name: f"without {', '.join(of)}, or with another role of it" for name, of in lacks.items() if of}
        named = {name: of for name, of in named.items() if name not in left_out}
        found = survey(RunsOf(pooled, [run for of in named.values() for run in of]), asked, datum)
        if options.memory:
            before = (runs_before(pooled, of) for of in named.values())
            datum = replace(datum, follows={run: one for of in before for run, one in of.items()})
        design = Design((*found.question.sensors, *found.question.speeds), found.question.responses, datum)
        whole = {run for run in pooled.runs if any(True for _ in design.pieces(pooled, run))}
        known = {name: tuple(run for run in of if run in whole) for name, of in named.items()}
        return cls(pooled, found.question, datum, known, left_out, found.period_s, found.duration_s)

    def library(self, requests: Iterable[tuple[tuple[str, ...], Shape]]) -> Library:
        """Cross-products of all that these sets and shapes need."""
        question = self.question
        return library_of(
            self.source, requests, responses=question.responses, speeds=question.speeds, datum=self.datum, n_blocks=1
        )

    def folds(self, library: Library, machine: str) -> list[int]:
        """Positions of the runs of a machine among the folds of a library."""
        at = {fold.name: i for i, fold in enumerate(library.moments.folds)}
        return [at[run] for run in self.runs[machine]]


@dataclass(frozen=True)
class Choices:
    """Sets and shapes, tried on every machine with coefficients of its own."""

    pool: Pool
    machines: tuple[str, ...]
    trials: tuple[Trial, ...]
    errors: Array  #: (n_trials, n_machines): Mean squared error on unseen runs, relative to the machine's displacement

    @classmethod
    def of(cls, pool: Pool, machines: Sequence[str]) -> "Choices":
        """All sets worth a closer look in all shapes that the options offer."""
        question = pool.question
        found = candidates(question, _own_bench(pool, pool.library([(question.sensors, LINEAR)]), machines)[0])
        static, lagged = shapes_on_offer(question, pool.period_s, pool.duration_s)
        library = pool.library(library_requests([found], static, lagged))
        bench, machine = _own_bench(pool, library, machines)
        trials = tested(question, found, bench, static, lagged).trials
        weights = np.equal.outer(np.arange(len(machines)), machine) * bench.samples
        errors = np.array([one.errors for one in trials]) @ (weights / weights.sum(axis=1, keepdims=True)).T
        return cls(pool, tuple(machines), trials, errors)

    def recipe(self, machines: Sequence[str]) -> Recipe:
        """The cheapest of those that are as good as the best on these machines, as far as so many machines tell."""
        errors = self.errors[:, [self.machines.index(name) for name in machines]]
        good = np.flatnonzero(sums.within_one_standard_error(errors, np.ones(len(machines)))).tolist()
        cost = self.pool.question.options.total_cost

        def rank(i: int) -> tuple[float, int, float]:
            return cost(self.trials[i].set.sensors), self.trials[i].n_terms, float(errors[i].mean())

        taken = self.trials[min(good, key=rank)]
        return Recipe.of(self.pool.question, self.pool.datum, taken.set.sensors, taken.shape)


def _own_bench(pool: Pool, library: Library, machines: Sequence[str]) -> tuple[Bench, Array]:
    """A bench on which every run is predicted by the other runs of its machine, and the number of that machine.

    The displacement of a machine has its own spread for unit: a wrong unit of one must not drown the others.
    """
    found, parts = library.moments, []
    total = np.zeros_like(found.whole)
    for name in machines:
        own = found.only(pool.folds(library, name))
        unit = np.r_[np.ones(1 + found.n_columns), 1.0 / np.sqrt(sums.response_power(own))]
        parts.append(own.products * unit * unit[:, None])
        cross, n_samples = sums.centred(parts[-1].sum(axis=0))
        total[1:, 1:] += cross
        total[0, 0] += n_samples
    totals = np.concatenate([np.broadcast_to(one.sum(axis=0), one.shape) for one in parts])
    products = np.concatenate(parts)
    apart = sums.LeaveOneOut(products, tuple((i,) for i in range(len(products))), totals, found.n_columns)
    bench = Bench(library, total, apart, apart.left_out(0, 0), np.ones(len(library.responses)))
    return bench, np.repeat(np.arange(len(machines)), [len(one) for one in parts])


@dataclass(frozen=True)
class Shared:
    """What some machines share: the columns of their models, and for each response a population of coefficients."""

    pool: Pool
    recipe: Recipe
    columns: Columns
    products: Mapping[str, Array]  #: Run → cross-products of [1, columns, responses], of all machines of the pool
    machines: tuple[str, ...]
    #: Response → the population of these machines, and the types that they fall into
    populations: Mapping[str, tuple[Population, tuple[tuple[int, ...], ...]]]

    @classmethod
    def of(cls, pool: Pool, recipe: Recipe, machines: Sequence[str]) -> "Shared":
        """What these machines share in the columns of a recipe."""
        scaling = sums.scaling_of(pool.source, recipe.design)
        # where nothing has risen nothing has moved: about zero, the constant does not hang on the slopes
        columns = Columns(scaling.about_zero() if pool.datum.reference == "rise" else scaling, recipe.terms)
        found = sums.moments(pool.source, recipe.design, columns)
        products = {fold.name: product for fold, product in zip(found.folds, found.products, strict=True)}
        shared = cls(pool, recipe, columns, products, tuple(machines), {})
        each = {name: [shared.evidence(pool.runs[one], name) for one in machines] for name in shared.names}
        return replace(shared, populations={name: parted(of) for name, of in each.items()})

    @property
    def names(self) -> tuple[str, ...]:
        """Of the responses."""
        return self.recipe.design.responses

    def evidence(self, runs: Iterable[str], response: str) -> Evidence:
        """What some runs of one machine say of its coefficients."""
        n_columns = 1 + len(self.recipe.terms)
        at = [*range(n_columns), n_columns + self.names.index(response)]
        return Evidence.of(np.array([self.products[run] for run in runs])[:, at][:, :, at])

    def is_like(self, runs: Iterable[str]) -> bool:
        """Whether a machine of which some runs are known is like the others."""
        return all(of.distance(self.evidence(runs, name)) <= of.limit for name, (of, _) in self.populations.items())

    def predicted(self, runs: Sequence[str], variables: Array) -> dict[str, Array]:
        """Displacements of a machine of which some runs are known, shape (n_samples, n_responses)."""
        columns = np.column_stack([np.ones(len(variables)), self.columns.matrix(variables)])
        everything = [*runs, *(run for name in self.machines for run in self.pool.runs[name])]
        total, n_columns = np.sum([self.products[run] for run in everything], axis=0), columns.shape[1]
        pooled = sums.coefficients(total, range(1, n_columns), range(n_columns, len(total)))
        shared = [of.posterior(self.evidence(runs, name))[0] for name, (of, _) in self.populations.items()]
        return {"pooled": columns @ pooled, "sisters": columns @ np.array(shared).T}


#: Machine → way → error in its later runs, one an output.
Errors = dict[str, dict[str, tuple[RunProof, ...]]]


def left_out_errors(pool: Pool, choices: Choices, count: int, say: Say) -> Errors:
    """Every machine predicted from its first runs and its sisters; all is chosen and learnt anew without it.

    One that is then found to be unlike the others is not there, as it would get no model.
    """
    found: Errors = {}
    judged = [choices.machines[k] for k in evenly(len(choices.machines), MOST_PROVED)]
    for i, name in enumerate(judged):
        say(f"predicting {name} by its sisters", 0.1 + 0.9 * i / len(judged))
        others = [one for one in choices.machines if one != name]
        shared = Shared.of(pool, choices.recipe(others), others)
        first, later = pool.runs[name][:count], pool.runs[name][count:]
        if later and shared.is_like(first):
            rows = rows_of(pool.source, shared.recipe.design, later)
            told = {"none": np.zeros_like(rows.responses), **shared.predicted(first, rows.variables)}
            proofs = {way: _proofs(name, rows, one, shared.recipe) for way, one in told.items()}
            found[name] = {**proofs, "own": _own(pool, name, first, later) or proofs["none"]}
    return found


def _own(pool: Pool, name: str, first: Sequence[str], later: Sequence[str]) -> tuple[RunProof, ...] | None:
    """What `select` makes of a machine's first runs alone leaves in the later ones; None where there is no model."""
    try:
        own = select(RunsOf(pool.source, first), pool.question.options)
    except OptionError:
        return None
    rows = rows_of(pool.source, replace(own.recipe.design, datum=pool.datum), later)
    predicted = np.column_stack([model.predicted(rows.variables) for model in own.models.values()])
    return _proofs(name, rows, predicted, own.recipe)


def _proofs(name: str, rows: Rows, predicted: Array, recipe: Recipe) -> tuple[RunProof, ...]:
    each = zip(rows.responses.T, predicted.T, strict=True)
    return tuple(RunProof.of(name, recipe.sensors, y, y - p) for y, p in each)


class SharedResponse(Document):
    """What is known of a response."""

    types: tuple[tuple[str, ...], ...]  #: One, or two where the machines fall into two groups
    alone: tuple[str, ...]  #: Machines unlike all others, from which nothing is learnt
    distance: float  #: Of the new machine from the others: about 1, or less, of a machine like them
    limit: float  #: Beyond which it is unlike them
    #: Number of `machines` that were left out in turn and are like the others, root mean square errors in their later
    #: runs (`none_um` …), the share of `own_um` that sisters take away at least (`least_fall`); empty where none was
    errors: dict[str, float]


class SistersAnswer(Document):
    """What `selector fleet sisters --json` prints."""

    schema_: Annotated[Literal["selector.fleet-sisters/1"], Field(alias="schema")] = "selector.fleet-sisters/1"
    machine: str
    runs: tuple[str, ...]  #: Of the new machine, that were used
    verdict: Literal["sisters", "none"]
    because: str
    sensors: tuple[str, ...] = ()
    shape: str | None = None
    left_out: dict[str, str]  #: Machine → why it is no sister
    responses: dict[str, SharedResponse]


@dataclass(frozen=True)
class Sisters:
    """What machines share, and how well that did for each of them when it was left out."""

    pool: Pool
    machines: tuple[str, ...]
    shared: Shared | None  #: None: there are too few
    count: int  #: Runs of a machine that is left out, or is new, that are known
    errors: Errors

    @classmethod
    def of(cls, pool: Pool, new: Iterable[str], count: int, say: Say) -> "Sisters":
        """All machines of a pool but new ones, proved with so many runs of each that is left out."""
        machines = tuple(name for name, runs in pool.runs.items() if name not in new and len(runs) > 1)
        if len(machines) < FEWEST:
            return cls(pool, machines, None, count, {})
        say("comparing sets", 0.0)
        choices = Choices.of(pool, machines)
        errors = left_out_errors(pool, choices, count, say)
        return cls(pool, machines, Shared.of(pool, choices.recipe(machines), machines), count, errors)

    def answer(self, new: str, left_out: Mapping[str, str]) -> SistersAnswer:
        """Whether they are sisters to a machine of which the first runs are known."""
        runs, shared = self.pool.runs[new][: self.count], self.shared
        responses = {} if shared is None else {name: self._response(shared, runs, name) for name in shared.names}
        none, known = self._none_because(responses), _runs(self.count)
        few = [name for name, of in self.pool.runs.items() if len(of) < 2 and name != new]
        return SistersAnswer(
            machine=new,
            runs=tuple(run.removeprefix(f"{new}/") for run in runs),
            verdict="none" if none else "sisters",
            because=none or f"left out in turn, its sisters are predicted better than by {known} of their own",
            sensors=() if shared is None else shared.recipe.sensors,
            shape=None if shared is None else str(shared.recipe.shape),
            left_out={**dict.fromkeys(few, "fewer than two runs with all sensors and displacements"), **left_out},
            responses=responses,
        )

    def _response(self, shared: Shared, runs: Sequence[str], name: str) -> SharedResponse:
        (population, types), j = shared.populations[name], shared.names.index(name)
        errors: dict[str, float] = {}
        if len(self.errors) > 1:
            squares = {way: of[j] for way, of in self._squares().items()}
            rms = {f"{way}_um": float(np.sqrt(of.mean())) for way, of in squares.items()}
            errors = {"machines": len(self.errors), **rms, "least_fall": least_fall(squares["own"], squares["sisters"])}
        return SharedResponse(
            types=tuple(tuple(self.machines[i] for i in one) for one in types),
            alone=tuple(one for i, one in enumerate(self.machines) if i not in population.members),
            distance=population.distance(shared.evidence(runs, name)),
            limit=population.limit,
            errors=errors,
        )

    def _squares(self) -> dict[str, Array]:
        """Mean squared errors [µm²] of each way, shape (n_responses, n_machines)."""
        return {way: np.array([[part.rmse_um**2 for part in of[way]] for of in self.errors.values()]).T for way in WAYS}

    def _none_because(self, responses: Mapping[str, SharedResponse]) -> str | None:
        judged, known = len(self.errors), _runs(self.count)
        if self.shared is None:
            return f"{len(self.machines)} other machines have two usable runs or more, and {FEWEST} are needed"
        if judged < FEWEST:
            return f"{judged} others have more than {known} and are alike, and {FEWEST} are needed for the proof"
        squares = self._squares()
        for way, words in (("own", f"{known} of their own"), ("none", "no correction at all")):
            other, sisters = squares[way], squares["sisters"]
            worse = any(least_fall(of, own) > 0.0 for own, of in zip(other, sisters, strict=True))
            if worse or least_fall(other.sum(axis=0), sisters.sum(axis=0)) <= 0.0:
                return f"{judged} machines, left out in turn, are not predicted better, beyond chance, than by {words}"
        far = [name for name, one in responses.items() if one.distance > one.limit]
        return f"in {known}, {' and '.join(far)} is not like that of any of the others" if far else None

    def model(self, answer: SistersAnswer) -> ModelFile:
        """The model file of the new machine, from all that is known of machines of its type."""
        pool, shared = self.pool, self.shared
        assert shared is not None
        recipe, runs = shared.recipe, pool.runs[answer.machine][: self.count]
        like = dict.fromkeys(name for one in answer.responses.values() for type_ in one.types for name in type_)
        source = RunsOf(pool.source, [*runs, *(run for name in like for run in pool.runs[name])])
        models, rows = _models(shared, runs, source), rows_of(source, recipe.design, runs)
        proofs = zip(*(of["sisters"] for of in self.errors.values()), strict=True)
        origins, rests = pool.source.provenance["runs"], []
        for one in recipe.design.inputs:
            if (rest := recipe_without(pool.question, recipe, one)) is not None:
                rests.append(Fallback(one, rest, _models(Shared.of(pool, rest, self.machines), runs, source), {}))
        model = ProvenModel(
            options=pool.question.options,
            because=f"{answer.because}; its sisters: {', '.join(like)}"[:4000],
            recipe=recipe,
            models=models,
            fit_per_run=fit_per_run(shared.names, models, rows),
            proof=Proof("machine", dict(zip(shared.names, proofs, strict=True)), (), (), {}),
            provenance={"machine": answer.machine, "runs": {run[-100:]: origins[run] for run in source.runs}},
            fallbacks=tuple(rests),
            largest_um=dict(zip(shared.names, np.abs(rows.responses).max(axis=0).tolist(), strict=True)),
        )
        return model_file_of(model, pool.source.channels, source=source)


def _models(shared: Shared, runs: Sequence[str], source: RunSource) -> dict[str, FittedModel]:
    """The models of a machine of which some runs are known; their range is that of all runs of the source."""
    rows, everything = (rows_of(source, shared.recipe.design, some) for some in (runs, source.runs))
    low, high = (edge(everything.variables, axis=0).tolist() for edge in (np.min, np.max))
    found = {}
    for j, name in enumerate(shared.names):
        evidence, y, terms = shared.evidence(runs, name), rows.responses[:, j], shared.recipe.terms
        plain = fit(rows.variables, y, scaling=shared.columns.scaling, terms=terms, name=name, runs=rows.run)
        beta, covariance = shared.populations[name][0].posterior(evidence)
        model = replace(plain, coefficients=beta, covariance=covariance, classical_covariance=covariance)
        mean_square = float(np.mean((y - model.predicted(rows.variables)) ** 2))
        r2 = 1.0 - mean_square / max(float(y.var()), 1e-300)
        found[name] = replace(
            model,
            valid_range=tuple(zip(low, high, strict=True)),
            r2=r2,
            adjusted_r2=adjusted_r2(r2, len(y), len(terms)),
            rmse_um=mean_square**0.5,
        )
    return found


def _runs(count: int) -> str:
    return f"{count} run{'s' * (count != 1)}"


def sisters_in(
    fleet: Fleet, machine: str, n_runs: int | None = None, say: Say = lambda _doing, _share: None
) -> tuple[SistersAnswer, ModelFile | None]:
    """What the other machines of a fleet tell of one with few runs, and its model; None where sisters are none.

    The first `n_runs` of its runs are used, by default all; what is asked is what the fleet file asks of it.

    Raises InputError: the machine is not in the fleet, its recordings cannot be used, or the options do not fit them.
    """
    if machine not in fleet.studies:
        raise OptionError(
            f"{machine!r}",
            expected=f"a machine of {fleet.place}: {', '.join(fleet.studies)}"[:1000],
            where="--machine",
            advice="correct the name, or add its folder of recordings to the fleet file",
        )
    sources: dict[str, Recording] = {}
    left_out: dict[str, str] = {}
    for i, (name, study) in enumerate(fleet.studies.items()):
        say(f"reading {name}", i / len(fleet.studies))
        try:
            sources[name] = _recording(study)
        except InputError as error:
            if name == machine:
                raise
            left_out[name] = str(error)
    pool = Pool.of(sources, machine, options_of(fleet.studies[machine], where=f"machine {machine}"))
    usable = len(pool.runs[machine])
    if not usable or (n_runs or 0) > usable:
        raise OptionError(
            f"{_runs(usable)} of {machine} in which the sensors and the displacement are there",
            expected=_runs(n_runs or 1),
            where=f"machine {machine}",
            advice="record more, or look with `selector describe` why a run cannot be used",
        )
    found = Sisters.of(pool, [machine], n_runs or usable, say)
    answer = found.answer(machine, {**left_out, **pool.left_out})
    return answer, None if answer.verdict == "none" else found.model(answer)


def _recording(study: Study) -> Recording:
    """The recordings of a machine without their faults; very long ones thinned."""
    with local_recordings(study.recordings) as (runs, machine):
        source = study_data(list(runs), machine, overrides_of(study)).source
        first = source.channels[0].name
        n_samples = sum(len(time_s) for run in source.runs for time_s, _ in source.chunks(run, [first]))
        return thinned(source, -(-n_samples // MOST_SAMPLES))
