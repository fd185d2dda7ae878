"""What a method is asked of a duty cycle, what it answers, and that of modes driven by speed and hall."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from selector.findings import Finding, Where
from selector.physics.thermal.finding_table import FINDINGS
from selector.physics.thermal.modes.choice import loose_findings, start_finding
from selector.physics.thermal.modes.driven_model import ENOUGH, LOOSE, DrivenModel
from selector.physics.thermal.modes.heldout import AT_MOST
from selector.physics.thermal.modes.modes import AmbientCourse, Cyclogram
from selector.physics.thermal.modes.thermal_test import ThermalTest
from selector.physics.thermal.prediction.tests_judged import RepeatedTest, fitted_um, longer_than_tests, samples
from selector.types import Vector

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
