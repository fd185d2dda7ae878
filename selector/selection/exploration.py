"""A study to be explored: the recordings read once, then every λ and every set of sensors at once."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from selector.errors import OptionError
from selector.findings import Finding
from selector.models.best_subsets.results import adjusted_r2
from selector.models.design import Design, Scaling, Term, datum_of, physical_transform
from selector.models.least_squares import FaultGain
from selector.models.moments import Batches, batches, centred, coefficients, scaling_of, squared_error
from selector.recording import RunSource
from selector.selection.candidates import LINEAR, Candidates, Grouping, Screening, candidates, snapped
from selector.selection.choice import Choice, tested
from selector.selection.fitting import MAX_ROWS
from selector.selection.library import Bench
from selector.selection.options import Options, Progress, Question, allowed_sensors, question_of
from selector.selection.proving import Folds, blocks_per_run
from selector.selection.survey import RunsOf, survey
from selector.sensors.groups import LambdaAxis, LambdaStep

NORMAL_95 = 1.96
#: Of the largest eigenvalue of a correlation matrix: what is smaller is the rounding of sums of squares.
_DEPENDENT = 1e-12


@dataclass(frozen=True)
class Coefficient:
    """One coefficient of a linear model."""

    sensor: str
    #: per_kelvin_um and standard_error: [µm/K]; the error allows for autocorrelation within runs
    per_kelvin_um: float
    standard_error: float
    per_deviation_um: float  #: Change of the displacement per standard deviation of the reading [µm]
    vif: float  #: Variance inflation; infinite if the other sensors make this one up

    @property
    def per_deviation_error_um(self) -> float:
        """Standard error of `per_deviation_um`."""
        return self.standard_error * abs(self.per_deviation_um / self.per_kelvin_um) if self.per_kelvin_um else 0.0


@dataclass(frozen=True)
class HeldOutPart:
    """A run (condition, block) predicted by coefficients that were fitted without it; the sensors were fixed before.

    `before_rmse_um` is the error without compensation, `mean_um` the mean of measured minus predicted.
    """

    name: str
    n_samples: int
    rmse_um: float
    mean_um: float
    before_rmse_um: float


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


@dataclass(frozen=True)
class LeftOut:
    """Cross-products of what is left out in turn, and of what is learnt from meanwhile."""

    names: tuple[str, ...]
    #: unseen and training: (n_parts, k, k): W'W of [1, scaled sensors, responses about their means], as in `Batches`
    unseen: NDArray[np.float64]
    training: NDArray[np.float64]


def fixed_set(
    sensors: Sequence[str], responses: Sequence[str], sums: Batches, left_out: LeftOut, *, rise: bool
) -> FixedSet:
    """The linear models of a set of sensors; the variables of `sums` are all sensors that there are.

    A stuck sensor reads zero of a `rise`, else its mean: absolute readings have no natural start.

    Raises OptionError: fewer complete samples than coefficients.
    """
    total = sums.whole
    n, k = round(float(total[0, 0])), 1 + len(sensors)
    if n <= k:
        raise OptionError(
            f"{n} complete samples for {k} coefficients",
            expected=f"more than {k} samples at which nothing is missing",
            where="fixed set " + ", ".join(sensors),
            advice="record longer, or take fewer sensors",
        )
    position = {name: j for j, name in enumerate(sums.scaling.variables)}
    own = [position[name] for name in sensors]
    at = [1 + j for j in own]
    first = 1 + len(sums.scaling.variables)
    at_responses = list(range(first, first + len(responses)))
    scaling = sums.scaling.only(sensors)
    cross, _ = centred(total)
    within = cross[np.ix_(own, own)]
    deviation = np.sqrt(np.maximum(np.diag(within), 0.0) / n)
    inverse, vif = _inverse(within)
    slopes = inverse @ cross[np.ix_(own, [one - 1 for one in at_responses])]
    mean = total[0, at] / n
    bread = np.zeros((k, k))
    bread[1:, 1:] = inverse
    bread[0, 1:] = bread[1:, 0] = -inverse @ mean
    bread[0, 0] = 1.0 / n + mean @ inverse @ mean
    beta_unseen = coefficients(left_out.training, at, at_responses)
    sse = squared_error(left_out.unseen, at, at_responses, beta_unseen)
    models, faults = {}, []
    for j, name in enumerate(responses):
        y = at_responses[j]
        beta = np.r_[total[0, y] / n - mean @ slopes[:, j], slopes[:, j]]
        rss = float(squared_error(total, at, [y], beta[:, None])[0])
        sst = float(cross[y - 1, y - 1])
        r2 = 1.0 - rss / sst if sst > 0 else float("nan")
        covariance = bread @ sums.meat([0, *at], y, beta) @ bread * n / max(n - k, 1)
        found = _coefficients(sensors, scaling, beta, covariance, deviation, vif)
        parts = _parts(left_out, at, y, beta_unseen[..., j], sse[:, j], float(sums.responses_at_um[j]))
        seen = sum(part.n_samples for part in parts)
        pooled = float(np.sqrt(sse[:, j].sum() / seen)) if seen else float("nan")
        adjusted, rmse = adjusted_r2(r2, n, len(sensors)), float(np.sqrt(rss / n))
        models[name] = FixedModel(name, found, r2, adjusted, rmse, parts, pooled)
        centre = np.asarray(scaling.centre) + np.asarray(scaling.scale) * mean
        rest = np.zeros(len(own)) if rise else centre
        faults += [
            _fault(one, name, float(sums.low[c]), float(sums.high[c]), float(zero))
            for one, c, zero in zip(found, own, rest, strict=True)
        ]
    return FixedSet(tuple(sensors), models, tuple(faults), n)


def _inverse(within: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(inverse, variance inflation) of centred cross-products; minimum norm where sensors make each other up."""
    spread = np.sqrt(np.maximum(np.diag(within), 0.0))
    rests = spread <= 0.0
    scale = np.where(rests, 1.0, spread)
    eigenvalues, axes = np.linalg.eigh(within / scale[:, None] / scale)
    independent = eigenvalues > _DEPENDENT * eigenvalues.max(initial=0.0)
    kept = axes[:, independent]
    inverse = (kept / eigenvalues[independent]) @ kept.T
    made_up = 1.0 - (kept**2).sum(axis=1) > 1e-8
    vif = np.where(made_up | rests, np.inf, np.maximum(np.diag(inverse), 1.0))
    return inverse / scale[:, None] / scale, vif


def _coefficients(
    sensors: Sequence[str],
    scaling: Scaling,
    beta: NDArray[np.float64],
    covariance: NDArray[np.float64],
    deviation: NDArray[np.float64],
    vif: NDArray[np.float64],
) -> tuple[Coefficient, ...]:
    """Coefficients in the units of the readings."""
    _, matrix = physical_transform([Term(((name, 1),)) for name in sensors], scaling)
    physical = matrix @ beta
    errors = np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", matrix, covariance, matrix), 0.0))
    return tuple(
        Coefficient(
            name, float(physical[1 + i]), float(errors[1 + i]), float(beta[1 + i] * deviation[i]), float(vif[i])
        )
        for i, name in enumerate(sensors)
    )


def _parts(
    left_out: LeftOut,
    at: Sequence[int],
    response: int,
    beta: NDArray[np.float64],
    sse: NDArray[np.float64],
    response_at_um: float,
) -> tuple[HeldOutPart, ...]:
    unseen = left_out.unseen
    n = unseen[:, 0, 0]
    mean = (unseen[:, 0, response] - (unseen[:, 0, [0, *at]] * beta).sum(axis=1)) / np.maximum(n, 1.0)
    # the error without compensation counts from the gauge's zero, not from the mean
    power = unseen[:, response, response] + response_at_um * (2.0 * unseen[:, 0, response] + n * response_at_um)
    return tuple(
        HeldOutPart(
            name,
            round(float(n[i])),
            *(float(v) for v in (np.sqrt(sse[i] / n[i]), mean[i], np.sqrt(max(power[i], 0.0) / n[i]))),
        )
        for i, name in enumerate(left_out.names)
        if n[i] > 0
    )


def _fault(one: Coefficient, response: str, low: float, high: float, rest: float) -> FaultGain:
    """What `fault_gains` finds over all samples; of a straight line the ends are enough."""
    slope = abs(one.per_kelvin_um)
    return FaultGain(one.sensor, response, slope, slope * max(abs(high - rest), abs(low - rest)), slope * (high - low))


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
    sums: Batches
    left_out: LeftOut
    parts: str  #: {"run", "condition", "block"}: What is left out in turn
    findings: tuple[Finding, ...]  #: Why sensors and runs were left out

    @classmethod
    def of(
        cls, source: RunSource, options: Options | None = None, *, progress: Progress | None = None
    ) -> "Exploration":
        """Read the recordings.

        Sensors in `options.never` are read too, so that they can be allowed later; terms other than linear ones are
        not explored.

        Raises OptionError: the options do not fit the recordings, or the recordings cannot support a model.
        """
        say = progress or (lambda _what, _share: None)
        say("reading", 0.0)
        given = options or Options()
        plain = replace(
            given,
            never=(),
            level=None,
            rounds=1,
            grouping="closure",
            degree=1,
            interactions=False,
            memory=False,
            ridge=False,
            formula=None,
        )
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
        bench, left_out = folds.linear_bench(None), _left_out(folds, sums)
        found = cls(surveyed.question, sensors, bench, sums, left_out, folds.left_out, surveyed.findings)
        return found.asking(never=given.never) if given.never else found

    def asking(
        self,
        *,
        must: Sequence[str] | None = None,
        never: Sequence[str] | None = None,
        cost: Mapping[str, float] | None = None,
        max_sensors: int | None = None,
    ) -> "Exploration":
        """The same recordings with other wishes; what is None stays.

        Raises OptionError: a sensor is unknown, in both lists, none is left, or more must be kept than a set may hold.
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
        sensors = allowed_sensors(self.available, options)
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

        Raises OptionError: λ is not within [0, 1].
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
        return tested(self.question, found, self.bench, [LINEAR], []).choice(
            ("linear", self.question.options.max_sensors)
        )

    def fixed(self, sensors: Sequence[str]) -> FixedSet:
        """The linear models of a set of sensors, which may hold those of --never too.

        Raises OptionError: a sensor is unknown or cannot be used, or there are fewer complete samples than
        coefficients.
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
