"""A study to be explored: the recordings read once, then every λ and every set of sensors at once."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from selector.errors import OptionError
from selector.findings import Finding
from selector.models.batches import Batches, batches
from selector.models.design import Design, datum_of
from selector.models.moments import scaling_of
from selector.recording import RunSource
from selector.selection.candidates import LINEAR, Candidates, Grouping, Screening, candidates, snapped
from selector.selection.choice import Choice, tested
from selector.selection.fitting import MAX_ROWS
from selector.selection.fixed_sets import FixedSet, LeftOut, fixed_set
from selector.selection.folds import Folds, blocks_per_run
from selector.selection.library import Bench
from selector.selection.options import Options, Progress, Question, question_of
from selector.selection.survey import RunsOf, survey
from selector.sensors.groups import LambdaAxis, LambdaStep


@dataclass(frozen=True)
class SensorGroup:
    """Sensors that one cut keeps together, those that stand for them, and why those."""

    sensors: tuple[str, ...]
    representatives: tuple[str, ...]
    because: str


@dataclass(frozen=True)
class Cut:
    """What one λ gives.

    Attributes
    ----------
    step : LambdaStep
        All λ of this step cut alike.
    level : float
        A λ of the step with few digits, to be typed.
    groups : tuple of SensorGroup
        In the order of their first sensor.
    representatives : tuple of str
    best_sets : mapping of int to tuple of str
        Of every size, the set of representatives that predicts left-out parts best.
    taken : tuple of str
        The set that `select` takes at this λ when it offers linear terms only.
    """

    step: LambdaStep
    level: float
    groups: tuple[SensorGroup, ...]
    representatives: tuple[str, ...]
    best_sets: Mapping[int, tuple[str, ...]]
    taken: tuple[str, ...]


@dataclass(frozen=True)
class Exploration:
    """One pass over the samples, and all that follows from it without another.

    A constant sensor, a copy, and one that is missing too often are left out as `select` leaves them out. Samples at
    which any of the others is missing are not used, as where `select` compares sensors.

    Attributes
    ----------
    question : Question
    available : tuple of str
        Sensors that can be used; `question.sensors` are those of them that --never leaves.
    bench : Bench
    sums : Batches
    left_out : LeftOut
    parts : {"run", "condition", "block"}
        What is left out in turn.
    findings : tuple of Finding
        Why sensors and runs were left out.
    """

    question: Question
    available: tuple[str, ...]
    bench: Bench
    sums: Batches
    left_out: LeftOut
    parts: str
    findings: tuple[Finding, ...]

    @classmethod
    def of(cls, source: RunSource, options: Options | None = None, *, progress: Progress | None = None) -> Exploration:
        """Read the recordings.

        Sensors in `options.never` are read too, so that they can be allowed later; terms other than linear ones are
        not explored.

        Raises
        ------
        OptionError
            The options do not fit the recordings, or the recordings cannot support a model.
        """
        say = progress or (lambda _what, _share: None)
        say("reading", 0.0)
        given = options or Options()
        plain = replace(given, never=(), level=None, rounds=1, degree=1, interactions=False, memory=False, ridge=False)
        asked = question_of(source, plain)
        datum = datum_of(source, asked.sensors, asked.responses, plain.reference)
        surveyed = survey(source, asked, datum)
        runs = RunsOf(source, surveyed.runs)
        folds = Folds(surveyed.question, runs, datum, blocks_per_run(len(surveyed.runs), surveyed.n_samples))
        say("adding up", 0.5)
        sensors, responses = surveyed.question.sensors, surveyed.question.responses
        design = Design(sensors, responses, datum)
        whole = folds.linear.moments.whole
        middle = whole[0, -len(responses) :] / max(float(whole[0, 0]), 1.0)
        sums = batches(runs, design, scaling_of(runs, design), middle, most_rows=MAX_ROWS)
        say("done", 1.0)
        found = cls(
            surveyed.question,
            sensors,
            folds.linear_bench(None),
            sums,
            _left_out(folds, sums),
            folds.left_out,
            surveyed.findings,
        )
        return found.asking(never=given.never) if given.never else found

    def asking(
        self,
        *,
        must: Sequence[str] | None = None,
        never: Sequence[str] | None = None,
        cost: Mapping[str, float] | None = None,
        max_sensors: int | None = None,
    ) -> Exploration:
        """The same recordings with other wishes; what is None stays.

        Raises
        ------
        OptionError
            A sensor is unknown, in both lists, none is left, or more must be kept than a set may hold.
        """
        before = self.question.options
        options = replace(
            before,
            must=before.must if must is None else tuple(must),
            never=before.never if never is None else tuple(never),
            cost=before.cost if cost is None else dict(cost),
            max_sensors=before.max_sensors if max_sensors is None else max_sensors,
        )
        unusable = [name for name in options.must if name not in self.available]
        if unusable:
            raise OptionError(
                ", ".join(unusable),
                expected="a sensor that can be used: " + ", ".join(self.available),
                where="--must",
                advice="take it out of --must",
            )
        sensors = tuple(name for name in self.available if name not in options.never)
        if not sensors:
            raise OptionError(
                "every sensor is excluded",
                expected="at least one sensor left",
                where="--never",
                advice="take a sensor out of --never",
            )
        return replace(self, question=replace(self.question, options=options, sensors=sensors))

    @cached_property
    def automatic(self) -> Candidates:
        """Groups and sets that `select` looks at when no λ is given."""
        return candidates(self.question, self.bench)

    @property
    def grouping(self) -> Grouping:
        """All ways of grouping, and the one that `select` chooses on all parts."""
        return self.automatic.grouping

    @property
    def axis(self) -> LambdaAxis:
        """Every distinct λ-cut."""
        return self.grouping.axis

    @cached_property
    def steps(self) -> tuple[LambdaStep, ...]:
        """The steps that a λ from 0 to 1 reaches, from the finest groups to the coarsest."""
        return tuple(step for step in self.axis if step.high >= 0.0)

    def level_of(self, number: int) -> float:
        """A λ with few digits that gives step `number` of `steps`."""
        return plain_level(self.steps[number])

    @cached_property
    def best_sets(self) -> Mapping[int, tuple[str, ...]]:
        """Of every size, the set of all usable sensors that predicts left-out parts best."""
        choice = self._chosen(self.automatic)
        return {size: trial.set.sensors for size, trial in choice.by_size.items()}

    @cached_property
    def _cuts(self) -> dict[int, Cut]:
        return {}

    @cached_property
    def _sets(self) -> dict[tuple[str, ...], FixedSet]:
        return {}

    def cut(self, level: float) -> Cut:
        """What this λ gives.

        Raises
        ------
        OptionError
            λ is not within [0, 1].
        """
        options = replace(self.question.options, level=level)
        meant = snapped(level, self.axis)
        number = max(i for i, high in enumerate(self.axis.highs) if meant <= high or i == 0)
        if number not in self._cuts:
            self._cuts[number] = self._cut(self.axis[number], options)
        return self._cuts[number]

    def _cut(self, step: LambdaStep, options: Options) -> Cut:
        # the top of the step is a closure level, which a number typed with few digits misses by its rounding
        question = replace(self.question, options=replace(options, level=max(step.high, 0.0)))
        found = candidates(question, self.bench)
        choice = self._chosen(found)
        screening = found.grouping.chosen
        return Cut(
            step,
            plain_level(step),
            _groups(question, found.grouping, screening),
            screening.representatives,
            {size: trial.set.sensors for size, trial in choice.by_size.items()},
            choice.trial.set.sensors,
        )

    def _chosen(self, found: Candidates) -> Choice:
        return tested(self.question, found, self.bench, [LINEAR], []).choice("linear")

    def fixed(self, sensors: Sequence[str]) -> FixedSet:
        """The linear models of a set of sensors, which may hold those of --never too.

        Raises
        ------
        OptionError
            A sensor is unknown or cannot be used, or there are fewer complete samples than coefficients.
        """
        wanted = tuple(name for name in self.available if name in set(sensors))
        unknown = [name for name in sensors if name not in self.available]
        if unknown or not wanted:
            raise OptionError(
                ", ".join(unknown) or "no sensor",
                expected="sensors that can be used: " + ", ".join(self.available),
                where="set of sensors",
                advice="take another set",
            )
        if wanted not in self._sets:
            rise = self.question.options.reference == "rise"
            self._sets[wanted] = fixed_set(wanted, self.question.responses, self.sums, self.left_out, rise=rise)
        return self._sets[wanted]


def plain_level(step: LambdaStep) -> float:
    """The λ of a step with the fewest digits, nearest to its top; 0 for what reaches below it."""
    if step.high <= 0.0:
        return 0.0
    for digits in range(1, 17):
        level = math.floor(step.high * 10**digits) / 10**digits
        if max(step.low, 0.0) < level <= step.high:
            return level
    return step.high


def _groups(question: Question, grouping: Grouping, screening: Screening) -> tuple[SensorGroup, ...]:
    """The groups of the only round, each with the reason for its representatives."""
    (one,) = screening.rounds
    relevance = dict(zip(question.sensors, grouping.relevance, strict=True))
    taken = set(screening.representatives)
    found = []
    for members in one.groups:
        names = tuple(question.sensors[i] for i in members)
        chosen = tuple(name for name in names if name in taken)
        found.append(SensorGroup(names, chosen, _because(question, names, chosen, relevance)))
    return tuple(found)


def _because(question: Question, names: Sequence[str], chosen: Sequence[str], relevance: Mapping[str, float]) -> str:
    if not chosen:
        return "none moves in these recordings"
    with_displacement = f"r² with the displacement {relevance[chosen[0]]:.3f}"
    if set(chosen) <= set(question.options.must):
        return "must be kept"
    if len(names) == 1:
        return f"alone in its group; {with_displacement}"
    best = max(relevance[name] for name in names)
    if relevance[chosen[0]] >= best:
        return f"largest {with_displacement}"
    return f"cheaper; {with_displacement}, within a hundredth of the largest, {best:.3f}"


def _left_out(folds: Folds, sums: Batches) -> LeftOut:
    """What is left out in turn, with responses about their means: whole runs, or the blocks of a single run."""
    parts = [folds.part(group) for group in folds.outer]
    if folds.left_out == "block":
        unseen = np.array([sums.about_means(product) for product in folds.linear.moments.products])
    else:
        unseen = np.array([sum(sums.of_run(run) for run in part.runs) for part in parts])
    # the others are added and not subtracted: one long run must not drown the short ones
    training = np.array([unseen[np.arange(len(unseen)) != i].sum(axis=0) for i in range(len(unseen))])
    return LeftOut(tuple(part.name for part in parts), unseen, training)
