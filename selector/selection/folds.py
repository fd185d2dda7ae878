"""Which parts of the recordings are left out together, and the cross-products that every choice starts from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from selector.errors import OptionError
from selector.models.design import Datum
from selector.models.validation import Grouping, grouping_by_condition, grouping_by_run
from selector.recording import RunSource
from selector.selection.candidates import LINEAR, Candidates
from selector.selection.choice import library_requests
from selector.selection.fitting import Part
from selector.selection.library import Bench, Library, Shape, library_of
from selector.selection.options import Question

BLOCKS_OF_A_SINGLE_RUN = 8
BLOCKS_OF_FEW_RUNS = 5
FEWEST_SAMPLES = 4
"""Samples that a choice needs to tell any two sensors apart: two coefficients, an error, and one to spare."""


class Folds:
    """The parts that are left out in turn.

    Attributes
    ----------
    linear : Library
        Cross-products of the sensors themselves, on every fold.
    outer : tuple of tuple of int
        Folds that are left out together.
    left_out : {"run", "condition", "block"}

    Raises
    ------
    OptionError
        Too few samples are complete.
    """

    def __init__(self, question: Question, runs: RunSource, datum: Datum, n_blocks: int) -> None:
        self.question, self.runs, self.datum, self.n_blocks = question, runs, datum, n_blocks
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
        runs = tuple(dict.fromkeys(fold.runs[0] for fold in folds))
        if self.left_out == "block":
            return Part(folds[0].name, runs, folds[0].block, self.n_blocks)
        return Part(self.question.options.conditions.get(runs[0], runs[0]) if len(runs) > 1 else runs[0], runs)

    def linear_bench(self, group: Sequence[int] | None) -> Bench:
        """The sensors themselves on all folds but these."""
        return Bench.of(self.linear, self.all if group is None else self.without(group))

    def library(self, found: Sequence[Candidates], static: Sequence[Shape], lagged: Sequence[Shape]) -> Library:
        """Cross-products of every term that these candidates may need."""
        if list(static) == [LINEAR] and not lagged:
            return self.linear
        full = self._library(library_requests(self.question, found, static, lagged))
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
        )


def blocks_per_run(n_runs: int, n_samples: int) -> int:
    """Blocks per run: with four runs or more a choice inside a fold still has three whole runs to leave out."""
    if n_runs >= 4:
        return 1
    wanted = BLOCKS_OF_A_SINGLE_RUN if n_runs == 1 else BLOCKS_OF_FEW_RUNS
    return max(2, min(wanted, n_samples // (10 * n_runs)))
