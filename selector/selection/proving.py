"""The proof: every part of the recording predicted by a procedure that has not seen it, and which parts those are."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from selector.errors import OptionError
from selector.models.design import Datum, Design, rows_of
from selector.models.moments import (
    ErrorCurvePoint,
    Grouping,
    HeldOut,
    LeaveOneOut,
    error_curve_point,
    grouping_by_condition,
    grouping_by_run,
)
from selector.recording import RunSource
from selector.selection.candidates import LINEAR, Candidates
from selector.selection.choice import Choice, Offer, Trial, library_requests
from selector.selection.fitting import Part, predictions, refined
from selector.selection.library import Bench, Library, Shape, key_of, library_of
from selector.selection.options import Question
from selector.selection.result import Proof, RunProof, Trace
from selector.types import Indices

#: Of one part that was left out; with many parts fewer, so that all have `MOST_TRACE_POINTS` at most.
TRACE_POINTS = 1500
MOST_TRACE_POINTS = 120_000
TRACE_DIGITS = 4  #: Decimals of traces [µm, s]: they are for pictures, and results hold them as text.


def left_out_errors(
    question: Question, source: RunSource, datum: Datum, choices: Sequence[Choice], parts: Sequence[Part], ridge: float
) -> tuple[dict[str, tuple[RunProof, ...]], tuple[Trace, ...]]:
    """Errors on each part, from the sensors, terms, time constants and coefficients that the others chose."""
    proofs: dict[str, list[RunProof]] = {name: [] for name in question.responses}
    traces: list[Trace] = []
    points = max(2, min(TRACE_POINTS, MOST_TRACE_POINTS // max(sum(len(part.runs) for part in parts), 1)))
    for choice, part in zip(choices, parts, strict=True):
        recipe = refined(question, source, datum, choice.trial, part.training)
        rows = rows_of(source, recipe.design, source.runs)
        unseen = rows.only(part.unseen(rows))
        if not len(unseen.run):
            continue
        predicted = predictions(recipe, rows.only(part.training(rows)), unseen, ridge=ridge)
        left_out = unseen.responses - predicted
        told: list[tuple[str, slice | Indices]] = [(part.name, slice(None))]
        if part.told_by_run:
            told = [(unseen.runs[r], np.flatnonzero(unseen.run == r)) for r in np.unique(unseen.run)]
        for label, mine in told:
            for j, name in enumerate(question.responses):
                proofs[name].append(RunProof.of(label, recipe.sensors, unseen.responses[mine, j], left_out[mine, j]))
        for r in np.unique(unseen.run):
            at = np.flatnonzero(unseen.run == r)
            at = at[:: max(1, -(-len(at) // points))]
            courses = (unseen.time_s[at], unseen.responses[at], predicted[at])
            traces.append(Trace(unseen.runs[r], *(np.round(course, TRACE_DIGITS) for course in courses)))
    order = {run: i for i, run in enumerate(source.runs)}
    if any(part.told_by_run for part in parts):
        # of groups of runs: in the order in which they were recorded, as runs that are left out one by one
        traces.sort(key=lambda trace: order[trace.run])
        for several in proofs.values():
            several.sort(key=lambda one: order[one.name])
    return {name: tuple(found) for name, found in proofs.items()}, tuple(traces)


def beside_the_comparison(
    folds: "Folds", surveyed: Sequence[str], design: Design
) -> tuple[list[Part], dict[str, tuple[str, ...]]]:
    """(runs that prove the model though the choice never saw them, runs that cannot and what they lack).

    A run in which any sensor is missing takes no part in comparing sensors. Where those of the chosen set are good it
    is as unseen as a run can be: left out of the coefficients, too, it is predicted.
    """
    compared = {run for fold in folds.linear.moments.folds for run in fold.runs}
    parts, lacking = [], {}
    for run in surveyed:
        if run in compared or folds.left_out != "run":
            continue
        pieces = list(design.pieces(folds.runs, run, complete=False))
        known = np.isfinite(np.concatenate([piece.variables for piece in pieces])).any(axis=0)
        missing = [name for name, is_known in zip(design.variables, known, strict=True) if not is_known]
        if missing:
            lacking[run] = tuple(missing)
        elif any(True for _ in design.pieces(folds.runs, run)):
            parts.append(Part(run, (run,)))
        else:
            lacking[run] = ("samples at which all are there",)
    return parts, lacking


def with_own_baseline(proof: Proof) -> Proof:
    """The proof with the error without compensation over its own parts, where these are more than were compared."""
    ways = proof.baselines_um.items()
    return replace(proof, baselines_um={name: {**of, "none": proof.rmse_um(name, before=True)} for name, of in ways})


def error_curve(library: Library, outer: Grouping, choices: Sequence[Choice]) -> tuple[ErrorCurvePoint, ...]:
    """Held-out error against the number of sensors, the set of every size chosen anew inside each fold.

    A fold whose groups allow no set of a size takes its largest smaller one.
    """
    by_size = [choice.by_size for choice in choices]
    sizes = sorted(set().union(*by_size))
    loo = LeaveOneOut.of(library.moments, outer)
    return tuple(
        error_curve_point(size, _held_out(library, loo, [of[max(k for k in of if k <= size)] for of in by_size]))
        for size in sizes
        if all(min(of) <= size for of in by_size)
    )


def baselines(
    linear: Library, library: Library, outer: Grouping, others: Mapping[Offer, Sequence[Choice]]
) -> dict[str, dict[str, float]]:
    """What other ways reach on the same unseen parts [µm rmse], per response; `others` are offers not taken."""
    loo = LeaveOneOut.of(linear.moments, outer)
    n = len(linear.responses)
    samples = loo.left_out(0, 0)
    at = 1 + linear.moments.n_columns + np.arange(n)
    ways = {
        "none": HeldOut(loo.left_out(at, at), samples).rmse_um,
        "mean": loo.errors([], n).rmse_um,
        "all sensors": loo.errors(list(range(linear.moments.n_columns)), n).rmse_um,
    }
    rest = LeaveOneOut.of(library.moments, outer)
    for offer, choices in others.items():
        ways[f"chosen, {offer}"] = _held_out(library, rest, [choice.trial for choice in choices]).rmse_um
    return {name: {way: float(rmse[j]) for way, rmse in ways.items()} for j, name in enumerate(linear.responses)}


def held_out(library: Library, outer: Grouping, choices: Sequence[Choice]) -> HeldOut:
    """Errors when each group is predicted by what was chosen without it."""
    return _held_out(library, LeaveOneOut.of(library.moments, outer), [choice.trial for choice in choices])


def _held_out(library: Library, loo: LeaveOneOut, trials: Sequence[Trial]) -> HeldOut:
    """Errors when each group is predicted by its own trial."""
    n = len(library.responses)
    rows = []
    for group, trial in zip(loo.groups, trials, strict=True):
        one = replace(loo, groups=(group,))
        rows.append(one.errors(library.columns(trial.set.sensors, trial.shape), n).sse[0])
    return HeldOut(np.array(rows), loo.left_out(0, 0))


#: Beyond so many runs, whole runs are left out in groups: a choice is made without each group, and again inside.
MOST_FOLDS = 30
BLOCKS_OF_A_SINGLE_RUN = 8
BLOCKS_OF_FEW_RUNS = 5
#: Samples that a choice needs to tell any two sensors apart: two coefficients, an error, and one to spare.
FEWEST_SAMPLES = 4


class Folds:
    """The parts that are left out in turn.

    `linear` has the cross-products of the sensors themselves on every fold; the folds in each of `outer` are left out
    together: a ``"run"``, a ``"condition"`` or a ``"block"``, as `left_out` says.

    Raises OptionError: too few samples are complete.
    """

    def __init__(self, question: Question, runs: RunSource, datum: Datum, n_blocks: int) -> None:
        self.question, self.runs, self.datum, self.n_blocks = question, runs, datum, n_blocks
        self._fold_of = fold_of_run(runs.runs, question.options.conditions)
        self.linear = self._library([(question.sensors, LINEAR)])
        conditions = question.options.conditions
        by_run = grouping_by_run(self.linear.moments)
        self.outer: Grouping
        if conditions and len(set(conditions.values()) | (set(runs.runs) - set(conditions))) > 1:
            self.outer = grouping_by_condition(self.linear.moments, dict(conditions))
            self.left_out = "condition"
        elif len(by_run) > 1:
            self.outer, self.left_out = by_run, "run"
        else:
            self.outer, self.left_out = tuple((i,) for i in self.all), "block"
        samples = self.linear.moments.n_samples
        fewest = min((samples[list(self.without(group))].sum() for group in self.outer), default=0.0)
        if fewest < FEWEST_SAMPLES:
            raise OptionError(
                f"{int(fewest)} complete samples to learn from when the longest part is left out to prove the model",
                expected=f"at least {FEWEST_SAMPLES} samples at which no sensor and no displacement is missing",
                where="recordings",
                advice="record longer, or leave out sensors that are often missing (--never)",
            )

    @property
    def all(self) -> tuple[int, ...]:
        """Every fold."""
        return tuple(range(len(self.linear.moments.folds)))

    def without(self, group: Sequence[int]) -> tuple[int, ...]:
        """The other folds."""
        return tuple(i for i in self.all if i not in group)

    def part(self, group: Sequence[int]) -> Part:
        """The samples that these folds are made of, with the name under which they are reported."""
        folds = [self.linear.moments.folds[i] for i in group]
        runs = tuple(dict.fromkeys(run for fold in folds for run in fold.runs))
        if self.left_out == "block":
            return Part(folds[0].name, runs, folds[0].block, self.n_blocks)
        if len(runs) == 1:
            return Part(runs[0], runs)
        if self.left_out == "run":
            return Part(f"{runs[0]} and {len(runs) - 1} more", runs, told_by_run=True)
        return Part(self.question.options.conditions.get(runs[0], runs[0]), runs)

    def linear_bench(self, group: Sequence[int] | None) -> Bench:
        """The sensors themselves on all folds but these."""
        return Bench.of(self.linear, self.all if group is None else self.without(group))

    def library(self, found: Sequence[Candidates], static: Sequence[Shape], lagged: Sequence[Shape]) -> Library:
        """Cross-products of every term that these candidates may need."""
        if list(static) == [LINEAR] and not lagged:
            return self.linear
        return self._compared(library_requests(found, static, lagged))

    def memory_gb(self, found: Sequence[Candidates], static: Sequence[Shape], lagged: Sequence[Shape]) -> float:
        """About what a choice among these terms takes [10⁹ bytes], as measured (docs/decisions/0014-fleets.md)."""
        asked, speeds = library_requests(found, static, lagged), self.question.speeds
        terms = {key_of(term) for sensors, shape in asked for term in shape.terms(sensors, speeds)}
        return 0.05 + 32e-9 * len(self.all) * len(terms) ** 2

    def bench_of_all_sensors(self, shape: Shape) -> Bench:
        """The terms that all sensors bring in a shape, on all folds."""
        asked = [(self.question.sensors, shape)]
        return Bench.of(self.linear if shape == LINEAR else self._compared(asked), self.all)

    def _compared(self, requests: Sequence[tuple[tuple[str, ...], Shape]]) -> Library:
        """A library on the folds in which all sensors are compared."""
        full = self._library(requests)
        # fewer sensors leave more complete samples, and perhaps a fold that the comparison of all sensors had lost
        at = {fold: i for i, fold in enumerate(full.moments.folds)}
        kept = full.moments.only([at[fold] for fold in self.linear.moments.folds])
        return replace(full, moments=kept)

    def _library(self, requests: Sequence[tuple[tuple[str, ...], Shape]]) -> Library:
        return library_of(
            self.runs,
            requests,
            responses=self.question.responses,
            speeds=self.question.speeds,
            datum=self.datum,
            n_blocks=self.n_blocks,
            fold_of=self._fold_of,
        )


def fold_of_run(runs: Sequence[str], conditions: Mapping[str, str]) -> dict[str, tuple[str, int]] | None:
    """Fold of each run where there are more than `MOST_FOLDS`; None where each run is a fold of its own.

    A fold takes every nth run by name, so that each day that is left out has neighbours to learn from, as when runs are
    left out one by one, and it holds no two conditions. A condition has folds in the measure of its runs.
    """
    if len(runs) <= MOST_FOLDS:
        return None
    of: dict[str, list[str]] = {}
    for run in sorted(runs):
        of.setdefault(conditions.get(run, ""), []).append(run)
    return {
        run: (condition, i % max(1, round(MOST_FOLDS * len(members) / len(runs))))
        for condition, members in of.items()
        for i, run in enumerate(members)
    }


def blocks_per_run(n_runs: int, n_samples: int) -> int:
    """Blocks per run: with four runs or more a choice inside a fold still has three whole runs to leave out."""
    if n_runs >= 4:
        return 1
    wanted = BLOCKS_OF_A_SINGLE_RUN if n_runs == 1 else BLOCKS_OF_FEW_RUNS
    return max(2, min(wanted, n_samples // (10 * n_runs)))
