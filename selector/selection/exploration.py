"""A study to be explored: the recordings read once, then every λ and every set of sensors at once."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from selector.errors import OptionError
from selector.findings import Finding
from selector.models.design import Design, datum_of
from selector.models.least_squares import FaultGain
from selector.models.moments import LeaveOneOut, coefficients, squared_error
from selector.models.run_before import begun, in_parts
from selector.recording import RunSource
from selector.selection.candidates import LINEAR, Candidates, Grouping, Screening, candidates, snapped
from selector.selection.choice import Choice, tested
from selector.selection.library import Bench
from selector.selection.options import Options, Progress, Question, allowed_sensors, question_of
from selector.selection.proving import Folds, blocks_per_run
from selector.selection.survey import RunsOf, survey
from selector.sensors.groups import LambdaAxis, LambdaStep
from selector.types import Array

#: Of the largest eigenvalue of a correlation matrix: what is smaller is the rounding of sums of squares.
_DEPENDENT = 1e-12


@dataclass(frozen=True)
class Coefficient:
    """One coefficient of a linear model."""

    sensor: str
    per_kelvin_um: float
    vif: float  #: Variance inflation; infinite if the other sensors make this one up


@dataclass(frozen=True)
class HeldOutPart:
    """A run (condition, block) predicted by coefficients that were fitted without it; the sensors were fixed before."""

    name: str
    n_samples: int
    rmse_um: float
    before_rmse_um: float  #: Error without compensation


@dataclass(frozen=True)
class FixedModel:
    """A linear model of one response on a set of sensors that was fixed beforehand."""

    response: str
    coefficients: tuple[Coefficient, ...]
    r2: float
    adjusted_r2: float
    rmse_um: float  #: In sample
    parts: tuple[HeldOutPart, ...]
    #: Pooled over the samples of all parts. **With this set fixed**: the choice of the set has seen the parts, so that
    #: this is smaller than what a procedure reaches that chooses anew without each part (`Proof.rmse_um`)
    heldout_rmse_um: float


@dataclass(frozen=True)
class FixedSet:
    """A set of sensors, its models by response, and what a fault of a sensor does to them."""

    sensors: tuple[str, ...]
    models: Mapping[str, FixedModel]
    faults: tuple[FaultGain, ...]
    n_samples: int

    @property
    def largest_vif(self) -> float:
        """Of all sensors; 1 when there is only one."""
        model = next(iter(self.models.values()))
        return max((one.vif for one in model.coefficients), default=1.0)


def fixed_set(
    sensors: Sequence[str], folds: Folds, bench: Bench, ranges: Mapping[str, tuple[float, float]]
) -> FixedSet:
    """The linear models of a set of sensors; `ranges` has the smallest and largest value of every sensor.

    A stuck sensor reads zero of a rise, else its mean. Raises OptionError: fewer complete samples than coefficients.
    """
    library, scaling = bench.library, bench.library.scaling.only(sensors)
    n, k = bench.n_samples, 1 + len(sensors)
    if n <= k:
        raise OptionError(
            f"{n} complete samples for {k} coefficients",
            expected=f"more than {k} samples at which nothing is missing",
            where="fixed set " + ", ".join(sensors),
            advice="record longer, or take fewer sensors",
        )
    columns = library.columns(sensors, LINEAR)
    at, responses = [1 + column for column in columns], range(1 + library.moments.n_columns, len(bench.total))
    scale = np.array(scaling.scale)
    cross = bench.cross(sensors, LINEAR, 0)[:-1, :-1]
    vif = _vif(cross)
    outer = LeaveOneOut.of(library.moments, folds.outer)
    beta = coefficients(bench.total, at, responses)
    rss = squared_error(bench.total, at, responses, beta)
    sse = outer.errors(columns, len(library.responses)).sse
    models, faults = {}, []
    rest = np.zeros(len(sensors)) if folds.datum.reference == "rise" else np.array(scaling.centre)
    for j, (name, y) in enumerate(zip(library.responses, responses, strict=True)):
        slopes = beta[1:, j] / scale
        found = zip(sensors, slopes, vif, strict=True)
        samples, squares = outer.left_out(0, 0), outer.left_out(y, y)
        parts = tuple(
            HeldOutPart(folds.part(group).name, round(float(m)), float(np.sqrt(own / m)), float(np.sqrt(before / m)))
            for group, m, own, before in zip(folds.outer, samples, sse[:, j], squares, strict=True)
        )
        models[name] = FixedModel(
            name,
            tuple(Coefficient(sensor, *map(float, values)) for sensor, *values in found),
            *bench.r2(sensors, LINEAR)[j],
            float(np.sqrt(rss[j] / n)),
            parts,
            float(np.sqrt(sse[:, j].sum() / samples.sum())),
        )
        for sensor, slope, zero in zip(sensors, np.abs(slopes).tolist(), rest.tolist(), strict=True):
            # of a straight line the ends are enough
            low, high = ranges[sensor]
            stuck = slope * max(abs(high - zero), abs(low - zero))
            faults.append(FaultGain(sensor, name, slope, stuck, slope * (high - low)))
    return FixedSet(tuple(sensors), models, tuple(faults), n)


def _vif(cross: Array) -> Array:
    """Variance inflation, from centred cross-products; infinite where other sensors make one up."""
    size = np.sqrt(np.maximum(np.diag(cross), 1e-300))
    eigenvalues, axes = np.linalg.eigh(cross / size[:, None] / size)
    independent = eigenvalues > _DEPENDENT * eigenvalues.max()
    kept = axes[:, independent] ** 2
    return np.where(
        kept.sum(axis=1) < 1.0 - 1e-8, np.inf, np.maximum((kept / eigenvalues[independent]).sum(axis=1), 1.0)
    )


@dataclass(frozen=True)
class SensorGroup:
    """Sensors that one cut keeps together, those that stand for them, and why those."""

    sensors: tuple[str, ...]
    representatives: tuple[str, ...]
    because: str


@dataclass(frozen=True)
class Cut:
    """What one λ gives."""

    step: LambdaStep  #: All λ of this step cut alike
    level: float  #: A λ of the step with few digits, to be typed
    groups: tuple[SensorGroup, ...]  #: In the order of their first sensor
    representatives: tuple[str, ...]
    #: Of every size, the set of representatives that predicts left-out parts best
    best_sets: Mapping[int, tuple[str, ...]]
    taken: tuple[str, ...]  #: The set that `select` takes at this λ when it offers linear terms only


@dataclass(frozen=True)
class Exploration:
    """One pass over the samples, and all that follows from it without another.

    A constant sensor, a copy, and one that is missing too often are left out as `select` leaves them out. Samples at
    which any of the others is missing are not used, as where `select` compares sensors.
    """

    question: Question
    available: tuple[str, ...]  #: Sensors that can be used; `question.sensors` are those of them that --never leaves
    bench: Bench
    folds: Folds
    ranges: Mapping[str, tuple[float, float]]  #: Smallest and largest value of each sensor
    findings: tuple[Finding, ...]  #: Why sensors and runs were left out
    _cuts: dict[int, Cut] = field(default_factory=dict, init=False, repr=False, compare=False)
    _sets: dict[tuple[str, ...], FixedSet] = field(default_factory=dict, init=False, repr=False, compare=False)

    @classmethod
    def of(
        cls, source: RunSource, options: Options | None = None, *, progress: Progress | None = None
    ) -> "Exploration":
        """Read the recordings, sensors in `options.never`, too, so that they can be allowed later; only linear terms.

        Raises OptionError: the options do not fit the recordings, or the recordings cannot support a model.
        """
        say = progress or (lambda _what, _share: None)
        say("reading", 0.0)
        given = options or Options()
        linear = replace(given, degree=1, interactions=False, memory=False, ridge=False, formula=None)
        plain = replace(linear, never=(), level=None, rounds=1, grouping="closure")
        source = in_parts(source)
        asked = question_of(source, plain)
        source = source if plain.reference == "absolute" else begun(source, asked.responses)
        datum = datum_of(source, asked.sensors, asked.responses, plain.reference)
        surveyed = survey(source, asked, datum)
        runs = RunsOf(source, surveyed.runs)
        folds = Folds(surveyed.question, runs, datum, blocks_per_run(len(surveyed.runs), surveyed.n_samples))
        say("adding up", 0.5)
        sensors = surveyed.question.sensors
        ranges = _ranges(runs, Design(sensors, surveyed.question.responses, datum))
        say("done", 1.0)
        found = cls(surveyed.question, sensors, folds.linear_bench(None), folds, ranges, surveyed.findings)
        return found.asking(given) if given.never else found

    def asking(self, options: Options) -> "Exploration":
        """The same recordings with other wishes: sensors to be kept or left out, their cost, and how many.

        Raises OptionError: a sensor is unknown, in both lists, none is left, or more must be kept than a set may hold.
        """
        now = replace(
            self.question.options,
            must=options.must,
            never=options.never,
            cost=dict(options.cost),
            max_sensors=options.max_sensors,
        )
        unusable = [name for name in now.must if name not in self.available]
        if unusable:
            expected = "a sensor that can be used: " + ", ".join(self.available)
            raise OptionError(", ".join(unusable), expected=expected, where="--must", advice="take it out of --must")
        sensors = allowed_sensors(self.available, now)
        return replace(self, question=replace(self.question, options=now, sensors=sensors))

    @property
    def parts(self) -> str:
        """{"run", "condition", "block"}: What is left out in turn."""
        return self.folds.left_out

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

    def cut(self, level: float) -> Cut:
        """What this λ gives. Raises OptionError: λ is not within [0, 1]."""
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
            tuple(_groups(question, found.grouping, screening)),
            screening.representatives,
            {size: trial.set.sensors for size, trial in choice.by_size.items()},
            choice.trial.set.sensors,
        )

    def _chosen(self, found: Candidates) -> Choice:
        return tested(self.question, found, self.bench, [LINEAR], []).choice(
            ("linear", self.question.options.max_sensors)
        )

    def fixed(self, sensors: Sequence[str]) -> FixedSet:
        """The linear models of a set of sensors, which may hold those of --never too.

        Raises OptionError: a sensor cannot be used, or there are fewer complete samples than coefficients.
        """
        wanted = tuple(name for name in self.available if name in set(sensors))
        unknown = [name for name in sensors if name not in self.available]
        if unknown or not wanted:
            found = ", ".join(unknown) or "no sensor"
            expected = "sensors that can be used: " + ", ".join(self.available)
            raise OptionError(found, expected=expected, where="set of sensors", advice="take another set")
        if wanted not in self._sets:
            self._sets[wanted] = fixed_set(wanted, self.folds, self.bench, self.ranges)
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


def _groups(question: Question, grouping: Grouping, screening: Screening) -> Iterator[SensorGroup]:
    """The groups of the only round, each with the reason for its representatives."""
    (one,) = screening.rounds
    relevance = dict(zip(question.sensors, grouping.relevance, strict=True))
    taken = set(screening.representatives)
    for members in one.groups:
        names = tuple(question.sensors[i] for i in members)
        chosen = tuple(name for name in names if name in taken)
        yield SensorGroup(names, chosen, _because(question, names, chosen, relevance))


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


def _ranges(source: RunSource, design: Design) -> dict[str, tuple[float, float]]:
    low, high = np.full(len(design.variables), np.inf), np.full(len(design.variables), -np.inf)
    for run in source.runs:
        for piece in design.pieces(source, run):
            low, high = np.minimum(low, piece.variables.min(axis=0)), np.maximum(high, piece.variables.max(axis=0))
    return dict(zip(design.variables, zip(low.tolist(), high.tolist(), strict=True), strict=True))
