"""What a method answers of a duty cycle, that of driven modes; what makes tests doubtful, and how they are repeated."""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from scipy.special import chdtri

from selector.errors import InputError
from selector.findings import Finding, Where
from selector.physics.thermal.finding_table import FINDINGS
from selector.physics.thermal.modes.choice import loose_findings, start_finding
from selector.physics.thermal.modes.driven_model import ENOUGH, LOOSE, DrivenModel
from selector.physics.thermal.modes.heldout import AT_MOST, runs_by_level
from selector.physics.thermal.modes.modes import AmbientCourse, Cyclogram, ModalModel
from selector.physics.thermal.modes.thermal_test import SAME_SPEED, ModeData, ThermalTest, mode_data
from selector.physics.thermal.prediction.piecewise import Characteristics, piecewise_displacement_um
from selector.types import Vector

MOST_SAMPLES = 20_000  #: A longer test is repeated at evenly spaced samples.


@dataclass(frozen=True)
class RepeatedTest:
    """A test and what the prediction makes of it."""

    run: str  #: Name of the run
    time_s: Vector  #: (n_times,): Times [s] from the start of the run
    speed_rpm: Vector  #: (n_times,): Spindle speed [r/min]
    #: measured_um and predicted_um: (n_times, n_responses): Displacements [µm]; what was not measured is NaN. The zero
    #: of the gauge is part of the prediction.
    measured_um: Vector
    predicted_um: Vector

    @property
    def rmse_um(self) -> Vector:
        """Root mean square of measured minus predicted [µm], shape (n_responses,)."""
        error = self.measured_um - self.predicted_um
        return np.asarray(np.sqrt(np.nansum(error**2, axis=0) / np.maximum(np.isfinite(error).sum(axis=0), 1)))


def modal_repeats(
    tests: Sequence[ThermalTest], model: ModalModel, *, warm: Collection[str] = ()
) -> tuple[RepeatedTest, ...]:
    """The tests as thermal modes repeat them: from rest and cold, each with a zero of its own.

    The state at the start of runs that were `warm` (their names) is fitted here again, with the modes as they are.
    """
    data = mode_data(tests)
    cyclograms = [data.cyclogram(run) for run in range(len(tests))]
    taken = [samples(test) for test in tests]
    within = [cyclogram.within(model.fastest_rpm) for cyclogram in cyclograms]
    plain = [model.displacement_um(cyclogram, time) for cyclogram, (time, _) in zip(within, taken, strict=True)]
    columns = []
    for test, cyclogram, (time, _) in zip(tests, within, taken, strict=True):
        fading = [_fading(model, cyclogram, time)] if test.run in warm else []
        columns.append(np.hstack([np.ones((len(time), 1)), *fading]))
    fitted = [fitted_um(m - p, own) for (_, m), p, own in zip(taken, plain, columns, strict=True)]
    return tuple(
        RepeatedTest(test.run, time, cyclogram.speed_at(time), measured, first + rest)
        for test, cyclogram, (time, measured), first, rest in zip(tests, cyclograms, taken, plain, fitted, strict=True)
    )


def piecewise_repeats(tests: Sequence[ThermalTest], curves: Sequence[Characteristics]) -> Iterator[RepeatedTest]:
    """The tests as pieces of the characteristics repeat them, each with a zero of its own.

    Runs in which the spindle never turns, or turns faster than the characteristics reach, are not repeated.
    """
    data = mode_data(tests)
    for run, test in enumerate(tests):
        cyclogram = _at_levels(data.cyclogram(run), data)
        time, measured = samples(test)
        if not (cyclogram.speed_rpm > 0).any():
            continue
        try:
            first = piecewise_displacement_um(curves, cyclogram, time)[0]
        except InputError:
            continue
        rest = fitted_um(measured - first, np.ones((len(time), 1)))
        yield RepeatedTest(test.run, time, cyclogram.speed_at(time), measured, first + rest)


def samples(test: ThermalTest) -> tuple[Vector, Vector]:
    """Times from the start and displacements where anything was read, thinned where there are very many."""
    read = np.flatnonzero(np.isfinite(test.displacement_um).any(axis=1))
    read = read[:: max(1, -(-len(read) // MOST_SAMPLES))]
    return test.time_s[read] - test.time_s[0], test.displacement_um[read]


def _at_levels(cyclogram: Cyclogram, data: ModeData) -> Cyclogram:
    """The duty cycle with speeds that are a level up to jitter taken for it, one segment a level."""
    levels = np.array(data.levels_rpm)
    nearest = levels[np.abs(cyclogram.speed_rpm[:, None] - levels).argmin(axis=1)]
    near = np.abs(cyclogram.speed_rpm - nearest) < SAME_SPEED * data.fastest_rpm
    speed = np.where(near & (cyclogram.speed_rpm > 0), nearest, cyclogram.speed_rpm)
    first = np.r_[True, np.diff(speed) != 0]
    return Cyclogram(cyclogram.start_s[first], speed[first], cyclogram.end_s)


def _fading(model: ModalModel, cyclogram: Cyclogram, time_s: Vector) -> Vector:
    """What is left of a unit of each mode that is there at the start, shape (n_times, n_modes²).

    Mode by mode, because convection may couple them; where it does not, only n_modes of the columns are not zero.
    """
    modes = len(model.tau_s)
    none = model.states_at(cyclogram, time_s)

    def left(k: int) -> Vector:
        start = np.zeros(none.shape[1:])
        start[k, 0] = 1.0
        return np.asarray(model.states_at(cyclogram, time_s, start)[:, :, 0] - none[:, :, 0])

    return np.hstack([left(k) for k in range(modes)])


def fitted_um(rest_um: Vector, columns: Vector) -> Vector:
    """What columns (n_times, n_columns) describe of the rest (n_times, n_responses) [µm], the smallest solution."""
    answer = np.zeros(rest_um.shape)
    for r, rest in enumerate(rest_um.T):
        there = np.isfinite(rest)
        answer[:, r] = columns @ np.linalg.lstsq(columns[there], rest[there], rcond=1e-8)[0]
    return answer


def longer_than_tests(tests: Sequence[ThermalTest], cyclogram: Cyclogram) -> Iterator[Finding]:
    """A warning if the duty cycle is much longer than the longest test."""
    longest = max(float(test.time_s[-1] - test.time_s[0]) for test in tests)
    if cyclogram.end_s > 1.5 * longest:
        yield FINDINGS.finding(
            "longer-than-tests",
            f"The duty cycle lasts {cyclogram.end_s / 3600:.3g} h, the longest test {longest / 3600:.3g} h: slower "
            "parts of the warming than the tests could show are not in the prediction.",
            Where(), {"cycle_s": cyclogram.end_s, "longest_test_s": longest},
        )  # fmt: skip


LEAST_UM = 1e-3  #: A displacement that moves by less in every test is no reading of a gauge.
STRETCHES = 8  #: So many means of a run tell slow movement from noise.
CERTAIN = 0.999  #: Probability with which noise alone shows less than what counts as a movement.
WARM = 0.1  #: Share of a run's range by which cooling has to end beyond its start, for the start to be called warm.
IN_NOISE = 3.0
OPPOSITE = -0.5  #: Heating curves whose cosine is below this go the other way.
FAR_BEYOND = 4.0  #: A run whose residual is this many times the median of the others' contradicts them.


def movement_findings(tests: Sequence[ThermalTest], responses: Sequence[str]) -> Iterator[Finding]:
    """A warning for every response in which slow movement cannot be told from the noise.

    Raises InputError if a response does not move at all in any of the tests.
    """
    for r, name in enumerate(responses):
        courses = [_read(test, r)[1] for test in tests]
        largest = max(float(np.ptp(course)) for course in courses)
        if largest < LEAST_UM:
            raise InputError(
                f"{name} does not move in the tests (by {largest:.2g} µm at most)",
                where="the tests", expected="a displacement that follows the heating and cooling of the machine",
                advice=f"check the gauge of {name} and its unit, or predict other displacements only",
            )  # fmt: skip
        moved, free = np.sum([_slow_part(course) for course in courses], axis=0)
        if moved <= float(chdtri(max(free, 1.0), 1.0 - CERTAIN)):
            noise = float(np.median([_noise_um(course) for course in courses]))
            yield FINDINGS.finding(
                "no-thermal-movement",
                f"In {name} no thermal movement was found above the noise of {noise:.2g} µm: what is predicted for "
                "it is noise.",
                Where(channel=name), {"noise_um": noise},
            )  # fmt: skip


def warm_start_findings(tests: Sequence[ThermalTest], responses: Sequence[str]) -> Iterator[Finding]:
    """A warning for every run that cools to the other side of where it started: it did not begin cold.

    Judged by the response that moves most; other axes may turn back beyond their start by themselves.
    """
    for test in tests:
        r = int(np.argmax([float(np.ptp(_read(test, k)[1])) for k in range(len(responses))]))
        time, course, speed = _read(test, r)
        turning = np.flatnonzero(speed > 0.01 * max(float(speed.max()), 1e-9))
        last = int(turning[-1]) + 1 if len(turning) else len(course)
        few = max(1, min(10, len(course) // 50))
        unseen = np.count_nonzero(test.speed_rpm[test.time_s < time[0]])
        # a gauge that began long after the spindle saw no start
        if not len(turning) or len(course) - last < 3 * few or unseen > few:
            continue
        # where the spindle turns from the first sample on, only that one is the start
        start, end = float(np.mean(course[: max(1, min(few, int(turning[0])))])), float(np.mean(course[-few:]))
        top = float(np.mean(course[max(0, last - few) : last]))
        fallen = (start - end) * np.sign(top - start)
        if fallen > max(IN_NOISE * _noise_um(course), WARM * float(np.ptp(course))):
            yield FINDINGS.finding(
                "run-begins-warm",
                f"Run {test.run} cools to {fallen:.3g} µm beyond where {responses[r]} started: it did not begin "
                "cold, or something else moves it. Predictions take starts to be cold, so they are too small.",
                Where(channel=responses[r], run=test.run, from_s=float(time[0]), to_s=float(time[-1])),
                {"beyond_start_um": float(fallen)},
            )  # fmt: skip


def speed_findings(tests: Sequence[ThermalTest], cyclogram: Cyclogram) -> Iterator[Finding]:
    """What the tested speeds do not say about those of the duty cycle.

    Raises InputError if the tests cannot be used.
    """
    data = mode_data(tests)
    levels = np.array(data.levels_rpm)
    runs = runs_by_level(data)
    if len(tests) > 1 and max(map(len, runs.values()), default=2) == 1:
        yield FINDINGS.finding(
            "no-speed-tested-twice",
            "No speed was tested twice: how far one day is from another is not known, and in the claimed error only as "
            "far as the tests happen to show it.",
        )
    speeds = np.unique(cyclogram.speed_rpm[cyclogram.speed_rpm > 0])
    others = speeds[np.abs(speeds - levels[-1]) > SAME_SPEED * levels[-1]]
    if len(levels) == 1 and len(others):
        yield FINDINGS.finding(
            "one-speed-tested",
            f"Only {levels[0]:.6g} r/min was tested; the duty cycle has {others[0]:.6g} r/min too. How heat grows "
            "with the speed is then an assumption: errors up to half of the displacement were seen.",
            Where(), {"levels_rpm": levels.tolist(), "speeds_rpm": others.tolist()},
        )  # fmt: skip
    slow = speeds[speeds < 0.5 * levels[0]]
    if len(slow):
        yield FINDINGS.finding(
            "slower-than-tests",
            f"The duty cycle has {slow[0]:.6g} r/min, less than half of the slowest tested speed, {levels[0]:.6g} "
            "r/min: what is predicted there rests on the law of the speed. Were the speeds written as meant?",
            Where(), {"speeds_rpm": slow.tolist(), "slowest_tested_rpm": float(levels[0])},
        )  # fmt: skip


def contradiction_findings(
    tests: Sequence[ThermalTest], repeats: Sequence[RepeatedTest], responses: Sequence[str]
) -> Iterator[Finding]:
    """A warning for every run that heats the other way than most, or is repeated far worse than the others."""
    for r, name in enumerate(responses):
        opposite = list(_opposite(tests, r))
        worse = {} if opposite else _worse(repeats, r)
        for run in opposite:
            yield FINDINGS.finding(
                "run-contradicts-others",
                f"In run {run} heating moves {name} the other way than in "
                + ("the other run." if len(opposite) == len(tests) == 2 else "most of the other runs."),
                Where(channel=name, run=run),
            )  # fmt: skip
        for run, (error, usual) in worse.items():
            yield FINDINGS.finding(
                "run-contradicts-others",
                f"Run {run} is repeated with an error of {error:.2g} µm RMS in {name}, the others with "
                f"{usual:.2g} µm: it contradicts them.",
                Where(channel=name, run=run), {"residual_um": error, "others_um": usual},
                "look at that run (gauge, speed, start from cold), or leave it out",
            )  # fmt: skip


def _opposite(tests: Sequence[ThermalTest], r: int) -> Iterator[str]:
    """Names of the runs whose first heating goes against that of at least half of the others."""
    curves = []
    for test in tests:
        time, course, speed = _read(test, r)
        turning = speed > 0.01 * max(float(speed.max()), 1e-9)
        if not turning.any():
            continue
        first = int(np.argmax(turning))
        after = first + int(np.argmin(turning[first:])) if not turning[first:].all() else len(course)
        if after - first < 3:
            continue
        heated = course[first:after] - float(np.mean(course[: max(1, first)]))
        if float(np.ptp(heated)) > 2.0 * IN_NOISE * _noise_um(course):
            curves.append((test.run, time[first:after] - time[first], heated))
    for run, time, heated in curves:
        signs = []
        for other, other_time, other_heated in curves:
            if other != run:
                grid = np.linspace(0.0, min(time[-1], other_time[-1]), 50)
                one, two = np.interp(grid, time, heated), np.interp(grid, other_time, other_heated)
                size = float(np.linalg.norm(one) * np.linalg.norm(two))
                signs.append(size > 0.0 and float(one @ two) < OPPOSITE * size)
        if signs and np.mean(signs) > 0.5:
            yield run


def _worse(repeats: Sequence[RepeatedTest], r: int) -> dict[str, tuple[float, float]]:
    errors = np.array([float(one.rmse_um[r]) for one in repeats])
    found = {}
    for k, one in enumerate(repeats if len(repeats) > 2 else ()):
        usual = float(np.median(np.delete(errors, k)))
        course = one.measured_um[np.isfinite(one.measured_um[:, r]), r]
        # a tenth of what it moves: smaller differences are those of speeds and methods
        if errors[k] > max(FAR_BEYOND * usual, IN_NOISE * _noise_um(course), WARM * float(np.ptp(course))):
            found[one.run] = (float(errors[k]), usual)
    return found


def _read(test: ThermalTest, r: int) -> tuple[Vector, Vector, Vector]:
    """Times, displacement and speed where the displacement was read."""
    there = np.isfinite(test.displacement_um[:, r])
    return test.time_s[there], test.displacement_um[there, r], test.speed_rpm[there]


def _noise_um(course: Vector) -> float:
    return float(np.std(np.diff(course))) / np.sqrt(2.0) if len(course) > 2 else 0.0


def _slow_part(course: Vector) -> tuple[float, float]:
    """Sum of squares of the means of stretches in units of their noise, and its degrees of freedom."""
    if float(np.ptp(course)) < LEAST_UM:
        return 0.0, 0.0
    parts = np.array_split(course, min(STRETCHES, len(course) // 2))
    means, sizes = np.array([float(part.mean()) for part in parts]), np.array([len(part) for part in parts])
    noise = max(_noise_um(course), 1e-3 * LEAST_UM)
    return float((sizes * (means - course.mean()) ** 2).sum()) / noise**2, float(len(parts) - 1)


Start = Literal["cold", "tests"]


@dataclass(frozen=True)
class Asked:
    """The tests, and the duty cycle that is to be predicted from them."""

    tests: tuple[ThermalTest, ...]
    responses: tuple[str, ...]
    cyclogram: Cyclogram
    hall: AmbientCourse | None  #: Temperatures around the machine during the duty cycle, by name; None: not known
    start: Start | None  #: {"cold", "tests"}: How it begins; None: as is usual for such tests
    units: tuple[str, ...]  #: (n_responses,): µm, or K for a temperature

    def listed(self, values: Vector) -> str:
        """Numbers (n_responses,) with unit and response, for a sentence."""
        told = zip(values, self.units, self.responses, strict=True)
        return ", ".join(f"{value:.2g} {unit} in {name}" for value, unit, name in told)


@dataclass(frozen=True)
class Mode:
    """A time constant [s] with the ends of its 95 % interval, None where the tests do not bound it."""

    tau_s: float
    low: float | None
    high: float | None


def modes_of(tau_s: Vector, low_s: Vector, high_s: Vector) -> tuple[Mode, ...]:
    """Time constants (n_modes,) [s] with their intervals; NaN where the tests do not bound them."""
    ends = [[float(end) if np.isfinite(end) else None for end in ends] for ends in (low_s, high_s)]
    return tuple(Mode(float(tau), low, high) for tau, low, high in zip(tau_s, *ends, strict=True))


@dataclass(frozen=True)
class Answer:
    """What a method says of the duty cycle."""

    #: Duty cycle, times (n_times,) [s] → displacements (n_times, n_responses) [µm]
    course: Callable[[Cyclogram, Vector], Vector]
    findings: tuple[Finding, ...]
    repeats: tuple[RepeatedTest, ...]
    modes: tuple[Mode, ...] = ()
    #: residual_um and heldout_um: (n_responses,): RMS error on the tests that were fitted, and that were left out [µm]
    residual_um: Vector | None = None
    heldout_um: Vector | None = None
    #: Times → standard deviations of the error (n_times, n_responses) [µm]; None: what was left out says all
    error_um: Callable[[Vector], Vector] | None = None
    left_out_um: Mapping[str, Vector] = field(default_factory=dict)
    judged: int = 0  #: Tests that were left out as a whole and predicted by the others
    claim_factor: float = AT_MOST  #: How many times the claimed error it is at most, 19 times in 20
    start: Start = "cold"
    ambients: tuple[str, ...] = ()  #: Temperatures around the machine that drive it


WORTH_TELLING = 0.3  #: Share of the claimed error from which on a difference is worth a warning.


def driven_answer(model: DrivenModel, ask: Asked) -> Answer:
    """What the model says of the duty cycle that is asked."""
    usual: Start = "tests" if len(model.tests) == 1 and len(model.parts) > 1 else "cold"
    start = ask.start or usual
    follows, cycle, hall = start == "tests", ask.cyclogram, _hall(model, ask)
    heldout = model.heldout_um
    names = model.part_names
    return Answer(
        course=lambda of, time: model.displacement_um(of, time, hall, follows=follows),
        findings=tuple(_findings(model, ask, hall, start)),
        repeats=tuple(_repeats(model)),
        modes=modes_of(np.sort(model.fit.tau_s), model.tau_low_s, model.tau_high_s),
        residual_um=model.residual_um,
        heldout_um=heldout,
        error_um=lambda time: (
            (np.nan if heldout is None else 1.0)
            * model.error_um(cycle, time, hall, follows=follows, told=ask.start is not None)
        ),
        left_out_um={
            name: errors for name, errors in zip(names, model.unseen.error_um, strict=True) if np.isfinite(errors).any()
        },
        judged=model.judged,
        claim_factor=model.claim_factor,
        start=start,
        ambients=model.ambients,
    )


def _hall(model: DrivenModel, ask: Asked) -> AmbientCourse | None:
    """The temperatures that drive the modes, each from the duty cycle, or as it was at the end of the tests."""
    if not model.ambients or ask.hall is None or not set(ask.hall.names) & set(model.ambients):
        return None
    last = model.last_ambient_degc()
    courses = [
        ask.hall.ambient_degc[:, ask.hall.names.index(name)]
        if name in ask.hall.names
        else np.full(len(ask.hall.time_s), last[k])
        for k, name in enumerate(model.ambients)
    ]
    return AmbientCourse(ask.hall.time_s, np.column_stack(courses), ask.hall.names)


def _repeats(model: DrivenModel) -> Iterator[RepeatedTest]:
    """Every test from the state in which it began, with a zero of its own."""
    for part, name in zip(model.parts, model.part_names, strict=True):
        time, measured = samples(model.tests[part.run])
        rows = (time >= part.from_s) & (time < part.to_s)
        course = model.course_of(part, time[rows])
        zero = fitted_um(measured[rows] - course, np.ones((int(rows.sum()), 1)))
        speed = model.cyclogram_of(part.run).speed_at(time[rows])
        yield RepeatedTest(name, time[rows] - part.from_s, speed, measured[rows], course + zero)


def _findings(model: DrivenModel, ask: Asked, hall: AmbientCourse | None, start: Start) -> Iterator[Finding]:
    cycle, fit = ask.cyclogram, model.fit
    yield from _of_tests(model)
    yield from loose_findings(np.sort(fit.tau_s), model.data, model.tau_low_s, model.tau_high_s)
    yield from longer_than_tests(ask.tests, cycle)
    time = np.linspace(0.0, cycle.end_s, 200)
    known = ask.start is not None
    claims = model.error_um(cycle, time, hall, follows=start == "tests", told=known)
    course = model.displacement_um(cycle, time, hall, follows=start == "tests")
    differs = _rms(model.displacement_um(cycle, time, hall, follows=start != "tests") - course)
    unsure = not known and model.is_separate and bool(model.begins_warm.any())
    begins = {"tests": "where the tests end", "cold": "at rest and in equilibrium with the hall"}
    told = ask.listed(differs)
    yield FINDINGS.finding(
        "start-of-the-duty-cycle",
        f"The duty cycle is taken to begin {begins[start]}. If it began "
        f"{begins['cold' if start == 'tests' else 'tests']}, the course would differ by {told} (root mean square)."
        + " Since tests began warm and nothing was said, that is part of the claimed error."
        * unsure,
        evidence={"start": start, "difference_um": differs.tolist()},
        suggestion=f"If that is wrong, give --start {'cold' if start == 'tests' else 'tests'}.",
        level="warning" if not known and (differs > WORTH_TELLING * _rms(claims)).any() else "info",
    )
    if model.ambients:
        yield from _of_hall(model, ask, hall)
    if fit.spec.film == "growing":
        growth = float(np.trace(np.diag(fit.tau_s) @ fit.spec.films(fit.theta)[0]))
        yield FINDINGS.finding(
            "cooling-grows-with-speed",
            "The machine cools better while the spindle turns; the time constants given are of the standing spindle.",
            evidence={"growth_at_fastest": round(growth, 3), "exponent": round(fit.spec.films(fit.theta)[2], 2)},
            suggestion="",
        )
    drift = model.walk_um(cycle.end_s)
    yield FINDINGS.finding(
        "unmeasured-drift",
        "Something that nobody measured moves the displacements slowly: by "
        + ask.listed(model.walk_um(3600.0))
        + f" in an hour, and by {ask.listed(drift)} over the duty cycle (standard deviation of a random walk). "
        "No time constant was made of it, and no prediction can contain it"
        + ("." if model.heldout_um is None else "; it is part of the claimed error."),
        evidence={"um_in_an_hour": model.walk_um(3600.0).tolist(), "um_over_the_cycle": drift.tolist()},
        level="warning" if (drift > WORTH_TELLING * _rms(claims)).any() else "info",
    )
    if model.heldout_um is None:
        yield FINDINGS.finding(
            "claimed-error-unknown",
            f"{len(model.parts)} test{'s' * (len(model.parts) > 1)}: none can be left out and predicted by the others, "
            "so no error is claimed. That needs tests whose speed others surround: separate ones, or some that follow "
            "others in the same record.",
        )
        return
    yield from gain_findings(ask, _rms(course), _rms(claims), model.claim_factor)
    times = model.times_expected(cycle, hall, follows=start == "tests")
    few = model.judged < ENOUGH
    if model.is_separate and (few or np.exp(np.sqrt(np.mean(np.log(times) ** 2))) > LOOSE):
        yield FINDINGS.finding(
            "claim-loose",
            f"How far below its claim the error lies cannot be told, down to a fifth was seen: {model.judged} "
            f"test{'s' * (model.judged > 1)} left out and predicted by the others were off "
            + ask.listed(model.heldout_um)
            + ", where the fit expects of itself " + ask.listed(model.heldout_um / times) + " in this duty cycle.",
            evidence={"left_out_um": model.heldout_um.tolist(), "times_expected": times.tolist()},
            level="warning" if few else "info",
        )  # fmt: skip


def gain_findings(ask: Asked, moves: Vector, claims: Vector, factor: float) -> Iterator[Finding]:
    """Of responses whose error may be as large as what they are predicted to move."""
    for name, unit, moved, claimed in zip(ask.responses, ask.units, moves, claims, strict=True):
        if claimed * factor >= moved:
            yield FINDINGS.finding(
                "gain-uncertain",
                f"{name} is predicted to move by {moved:.2g} {unit}; the error, {claimed:.2g} {unit}, may be up to "
                f"{claimed * factor:.2g} {unit} (root mean square): a correction may leave more than none.",
                Where(channel=name),
                {"moves_um": float(moved), "claimed_um": float(claimed), "factor": factor},
            )


def _of_tests(model: DrivenModel) -> Iterator[Finding]:
    for run in np.flatnonzero(model.begins_warm if model.is_separate else ()).tolist():
        yield start_finding(model.tests[run].run, "what is left of its start moves it")
    for run, test in enumerate(model.tests):
        cuts = [part.from_s for part in model.parts if part.run == run]
        if len(cuts) > 1:
            hours = ", ".join(f"{cut / 3600:.3g}" for cut in cuts)
            yield FINDINGS.finding(
                "record-cut-into-tests",
                f"Run {test.run} is {len(cuts)} tests, which begin at {hours} h: where the spindle turned again after "
                "a rest. The state of the machine is carried from one to the next.",
                Where(run=test.run), {"from_s": cuts},
            )  # fmt: skip


def _of_hall(model: DrivenModel, ask: Asked, hall: AmbientCourse | None) -> Iterator[Finding]:
    terms = model.law.size * model.fit.spec.n_modes
    gains = model.fit.coefficients[terms:].reshape(-1, len(model.responses))
    for k, name in enumerate(model.ambients):
        here = gains[k : len(model.ambients) * model.fit.spec.n_modes : len(model.ambients)].sum(axis=0)
        known = hall is not None and name in hall.names
        yield FINDINGS.finding(
            "hall-temperature-drives-displacement",
            f"{name} moved during the tests and moves the displacements, in the end by "
            + ask.listed(here)
            + " for every kelvin"
            + (". The duty cycle says how it moves." if known else ". The duty cycle does not say how it moves: it was "
               "taken to stay as it is at the beginning. The error told is that of one that moves as in the tests."),
            Where(channel=name), {"um_per_k": here.tolist()},
            "" if known else f"add a column {name} with the temperature that is foreseen to the duty cycle",
            level="info" if known else "warning",
        )  # fmt: skip


def _rms(values: Vector) -> Vector:
    return np.asarray(np.sqrt(np.mean(values**2, axis=0)))
