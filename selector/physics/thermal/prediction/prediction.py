"""The workflow of a prediction: tests and a duty cycle → displacement and correction program."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Literal

import numpy as np

from selector.errors import InputError, OptionError
from selector.findings import Finding, Where
from selector.physics.thermal.finding_table import FINDINGS
from selector.physics.thermal.modes.heldout import AT_MOST, LeftOutTests
from selector.physics.thermal.modes.modes import AmbientCourse, Cyclogram, ModalModel, cyclogram_kind
from selector.physics.thermal.modes.thermal_test import ThermalTest
from selector.physics.thermal.prediction import answer as answers
from selector.physics.thermal.prediction.correction_program import (
    BestOrder,
    BestWarmUp,
    CorrectionProgram,
    best_order,
    best_warm_up,
    correction_program,
    notation,
)
from selector.physics.thermal.prediction.observer import DayReadings, Observed, observed
from selector.physics.thermal.prediction.piecewise import characteristics, piecewise_displacement_um
from selector.types import Vector

Method = Literal["modal", "piecewise"]
Tolerance = float | Sequence[float] | Mapping[str, float | Sequence[float]]

USUAL_TOLERANCE_UM = 10.0  #: Tolerance of the printed example (C eq. 6), taken when operations are given without one.
LONGEST_S = 31 * 86_400.0  #: A duty cycle that lasts longer is a mistake in a unit.
LARGE_ERROR = 0.3  #: Share of the tolerance beyond which the error on tests that were left out is a warning.
_FEWEST_READINGS = 10
_STEP_S = 60.0
_STEPS_S = (30.0, 20.0, 15.0, 10.0, 5.0, 2.0, 1.0, 0.5, 0.2, 0.1)
_FEWEST_STEPS = 240
_HALVINGS = 6


@dataclass(frozen=True)
class Prediction:
    """What a machine will do in a duty cycle."""

    responses: tuple[str, ...]  #: The displacements
    method: Method  #: {"modal", "piecewise"}: How they were predicted
    cyclogram: Cyclogram | None  #: The duty cycle; None for a prediction from its JSON form, which does not hold it
    #: (n_times,): Times [s] from the start of the duty cycle, so close that between them the course is a straight line
    time_s: Vector
    displacement_um: Vector  #: (n_times, n_responses): Predicted displacement [µm]
    modes: tuple[answers.Mode, ...]  #: Time constants of the modal method; empty for the piecewise one, which has none
    programs: Mapping[str, CorrectionProgram]  #: Correction program of every response; empty if none was asked for
    #: residual_um and heldout_um: (n_responses,): RMS error on the tests that were fitted, and on tests that were left
    #: out [µm]
    residual_um: Vector | None
    heldout_um: Vector | None
    findings: tuple[Finding, ...]  #: What to know about it
    repeats: tuple[answers.RepeatedTest, ...] = ()  #: The tests beside what the method makes of them
    #: (n_responses,): RMS error that is expected in this duty cycle [µm]; None if it cannot be told
    claimed_um: Vector | None = None
    #: Test → (n_responses,): RMS error from its start when it was left out [µm]; those alone that could be judged
    left_out_um: Mapping[str, Vector] = field(default_factory=dict)
    start: answers.Start = "cold"  #: {"cold", "tests"}: Whether it begins cold and at rest, or where the tests end
    temperatures: tuple[str, ...] = ()  #: Responses that are temperatures: for them all µm are K
    warm_up: BestWarmUp | None = None  #: The warm-up that leaves the fewest corrections, if it was asked for
    order: BestOrder | None = None  #: The order of operations that needs the fewest corrections, if it was asked for
    observed: Observed | None = None  #: What readings of the day make of it, if there were some
    #: How many times the claimed error it is at most, 19 times in 20; None where no whole test was left out
    claim_factor: float | None = None

    def unit(self, response: str) -> str:
        """µm, or K for a temperature."""
        return "K" if response in self.temperatures else "µm"

    def error_um(self, response: str) -> float:
        """Error on what was left out [µm]; without it the worst on a test; 0 if nothing is known."""
        r = self.responses.index(response)
        for errors in (self.claimed_um, self.heldout_um):
            if errors is not None and np.isfinite(errors[r]):
                return float(errors[r])
        return max((float(one.rmse_um[r]) for one in self.repeats), default=0.0)

    @property
    def doubtful(self) -> list[str]:
        """Responses whose program is not to be used: twice the error on unseen tests exceeds the tolerance.

        With errors that are normally distributed, one drift in twenty would be off by more than all that was allowed.
        """
        return [name for name, of in self.programs.items() if 2.0 * self.error_um(name) > of.tolerance_um]

    def as_dict(self) -> dict[str, Any]:
        """JSON form, `selector.prediction/1`; numbers of temperatures are in K, whatever their key."""
        tolerances = {one for program in self.programs.values() for one in program.tolerances_um}
        return {
            "schema": "selector.prediction/1",
            "method": self.method,
            "kind": None if self.cyclogram is None else cyclogram_kind(self.cyclogram),
            "time_s": self.time_s.tolist(),
            "start": self.start,
            "displacement_um": self._courses(temperatures=False),
            **({"temperature_k": self._courses(temperatures=True)} if self.temperatures else {}),
            "modes": [{"tau_s": mode.tau_s, "low": mode.low, "high": mode.high} for mode in self.modes],
            "program": [
                {"operation": number, **operation.as_dict(), "response": name, "notation": notation(operation)}
                for name, program in self.programs.items()
                for number, operation in enumerate(program.operations, start=1)
            ],
            **({} if self.warm_up is None else {"warm_up": dict(vars(self.warm_up))}),
            **({} if self.order is None else {"order": dict(vars(self.order))}),
            **({} if self.observed is None else {"observed": self.observed.as_dict(self.responses)}),
            "tolerance_um": tolerances.pop() if len(tolerances) == 1 else None,
            "accuracy": {
                name: {
                    "residual_um": _at(self.residual_um, r),
                    "heldout_um": _at(self.heldout_um, r),
                    "claimed_um": _at(self.claimed_um, r),
                }
                for r, name in enumerate(self.responses)
            },
            "claim_factor": self.claim_factor,
            "left_out": {
                test: {name: _at(errors, r) for r, name in enumerate(self.responses)}
                for test, errors in self.left_out_um.items()
            },
            "findings": [finding.as_dict() for finding in self.findings],
        }

    def _courses(self, *, temperatures: bool) -> dict[str, list[float]]:
        return {
            name: self.displacement_um[:, r].tolist()
            for r, name in enumerate(self.responses)
            if (name in self.temperatures) is temperatures
        }


def cyclogram_of_rows(
    time_s: Vector, speed_rpm: Vector, operations_s: Sequence[float] | None = None
) -> tuple[Cyclogram, tuple[Finding, ...]]:
    """The duty cycle that rows of (time, speed) mean, and what was assumed about its end.

    The last row is the end; if the operations reach further, its speed is held to their end.

    Raises InputError if the rows make no duty cycle, there is one row without operations, or it lasts longer than
    `LONGEST_S`.
    """
    time, speed = np.asarray(time_s, dtype=np.float64), np.asarray(speed_rpm, dtype=np.float64)
    wanted = 0.0 if operations_s is None else float(np.sum(operations_s))
    last = float(time[-1]) if len(time) else 0.0
    end = max(last, wanted)
    if end > LONGEST_S:
        raise InputError(
            f"a duty cycle of {end / 86_400:.3g} days", expected=f"at most {LONGEST_S / 86_400:g} days",
            where="duty cycle", advice="check the unit of the times, and that the operations are in minutes",
        )  # fmt: skip
    if len(time) == 1 and end <= last:
        raise InputError(
            "one row and no operations, so no end", where="duty cycle",
            expected="a last row with the time at which the duty cycle ends, or --operations",
            advice="add a row with the end, e.g. 3600,0, or say how long the operations are",
        )  # fmt: skip
    if end > last * (1.0 + 1e-12):
        held = FINDINGS.finding(
            "last-speed-held",
            f"The operations reach to {end / 60:g} min, the duty cycle to {last / 60:g} min: its last speed, "
            f"{speed[-1]:g} r/min, is held to their end.",
            Where(from_s=last, to_s=end),
        )  # fmt: skip
        return Cyclogram(time, speed, end), (held,)
    findings: list[Finding] = []
    if len(time) > 1 and speed[-1] not in (0.0, speed[-2]):
        findings.append(
            FINDINGS.finding(
                "last-row-is-the-end",
                f"The last row, at {last / 60:g} min, is the end of the duty cycle; its speed, {speed[-1]:g} r/min, is "
                "not reached.",
                Where(from_s=last),
            )
        )  # fmt: skip
    return Cyclogram(time[:-1], speed[:-1], last), tuple(findings)


def predict(
    tests: Sequence[ThermalTest], responses: Sequence[str], cyclogram: Cyclogram, *,
    method: Method = "modal", hall: AmbientCourse | None = None, start: answers.Start | None = None,
    operations_s: Sequence[float] | None = None, tolerance_um: Tolerance | None = None,
    resolution_s: float | None = None, find_order: bool = False, warm_up_s: float = 0.0,
    temperatures: Sequence[str] = (), readings: DayReadings | None = None, told: Sequence[Finding] = (),
) -> Prediction:  # fmt: skip
    """Predict the displacement in a duty cycle from heating and cooling tests, and how to correct it.

    `hall` are temperatures around the machine during the duty cycle, named as in the tests. It begins cold or where the
    tests end (`start`; None: where the tests end if they are one long run, else cold). Responses may be `temperatures`.
    A correction program is made for displacements if `operations_s` or `tolerance_um` is given: without operations the
    whole duty cycle is one, without a tolerance it is `USUAL_TOLERANCE_UM`; a tolerance is for all, or by response, one
    for all operations or for each. `resolution_s` rounds its times, see `correction_program`. With `find_order` the
    order of the operations that needs the fewest corrections is found, too, and with `warm_up_s` the best warm-up of
    up to so long before them. With `readings` of the day, whose
    thermometers are among the responses, it is followed beside the plan. What was `told` before stands first among the
    findings.

    Raises InputError if the tests are too few or too short, a speed is outside of them, or the program's options cannot
    be used.
    """
    if isinstance(tolerance_um, Mapping) and (unknown := sorted(set(tolerance_um) - set(responses))):
        raise OptionError(
            f"a tolerance of {unknown[0]!r}", expected="one of " + ", ".join(responses), where="--tolerance",
            advice="name a response that is predicted",
        )  # fmt: skip
    usable, findings = _usable(tests, responses)
    findings += answers.movement_findings(usable, responses)
    findings += answers.speed_findings(usable, cyclogram)
    units = tuple("K" if name in temperatures else "µm" for name in responses)
    ask = answers.Asked(tuple(usable), tuple(responses), cyclogram, hall, start, units)
    answer = _modal(ask) if method == "modal" else _piecewise(ask)
    findings += answer.findings
    findings += _halls_not_used(ask, answer)
    time = _times(partial(answer.course, cyclogram), cyclogram, operations_s)
    displacement = answer.course(cyclogram, time)
    claims = answer.heldout_um if answer.error_um is None else _rms(answer.error_um(time), time)
    factor = answer.claim_factor if answer.judged else None
    programs: dict[str, CorrectionProgram] = {}
    order: BestOrder | None = None
    warm_up: BestWarmUp | None = None
    if operations_s is not None or tolerance_um is not None:
        lengths = [cyclogram.end_s] if operations_s is None else list(operations_s)
        moving = {r: name for r, name in enumerate(responses) if name not in temperatures}
        tolerances = {r: _tolerances_of(tolerance_um, name, len(lengths)) for r, name in moving.items()}
        for r, name in moving.items():
            programs[name] = correction_program(time, displacement[:, r], lengths, tolerances[r], resolution_s)
        if find_order and operations_s is not None:
            order = best_order(answer.course, cyclogram, lengths, tolerances, resolution_s)
        if warm_up_s > 0:
            warm_up = best_warm_up(answer.course, cyclogram, lengths, tolerances, resolution_s, warm_up_s)
        named = tolerance_um if isinstance(tolerance_um, Mapping) else dict.fromkeys(responses, tolerance_um)
        usual = [name for name in programs if named.get(name) is None]
        findings += _of_program(cyclogram, operations_s, usual, programs, responses, claims)
        if claims is not None and factor is not None:
            findings += _few_tests(responses, claims, answer.judged, factor, programs)
    elif resolution_s is not None:
        raise OptionError(
            "a resolution without a program", expected="--operations or --tolerance beside it", where="resolution",
            advice="give --operations or --tolerance, or leave the resolution out",
        )  # fmt: skip
    seen = None if readings is None else _observed(ask, answer, readings)
    findings += () if seen is None else _of_day(seen)
    return Prediction(
        tuple(responses), method, cyclogram, time, displacement, answer.modes, programs, answer.residual_um,
        answer.heldout_um, (*told, *findings), answer.repeats, claims, answer.left_out_um, answer.start,
        tuple(temperatures), warm_up, order, seen, factor,
    )  # fmt: skip


def _modal(ask: answers.Asked) -> answers.Answer:
    """By modes that the hall drives too, or that run on through a long record; else by those of cold tests."""
    from selector.physics.thermal.modes.driven_model import driven_model

    driven = driven_model(ask.tests, ask.responses, whatever=ask.start == "tests")
    if driven is not None:
        return answers.driven_answer(driven, ask)
    from selector.physics.thermal.modes.choice import choose_modes

    fit, cycle = choose_modes(ask.tests, ask.responses), ask.cyclogram
    repeats = answers.modal_repeats(ask.tests, fit.model, warm=fit.warm)
    findings = [
        *answers.warm_start_findings(ask.tests, ask.responses),
        *fit.findings,
        *answers.longer_than_tests(ask.tests, cycle),
        *answers.contradiction_findings(ask.tests, repeats, ask.responses),
    ]
    left_out = fit.left_out
    if left_out is not None:
        time = np.linspace(0.0, cycle.end_s, 200)
        moves = _rms(fit.model.displacement_um(cycle, time), time)
        findings += answers.gain_findings(ask, moves, left_out.claimed_um(moves), AT_MOST)
    return answers.Answer(
        course=fit.model.displacement_um,
        findings=tuple(findings),
        modes=answers.modes_of(fit.model.tau_s, fit.tau_low_s, fit.tau_high_s),
        residual_um=fit.residual_um,
        heldout_um=fit.heldout_um,
        error_um=None if left_out is None else partial(_expected_um, left_out, fit.model, cycle),
        judged=0 if left_out is None else len(left_out.runs),
        repeats=repeats,
    )


def _expected_um(left_out: LeftOutTests, model: ModalModel, cycle: Cyclogram, time_s: Vector) -> Vector:
    """The error that left-out tests let expect in a duty cycle, the same all over it; (n_times, n_responses) [µm]."""
    course = model.displacement_um(cycle, time_s)
    return np.broadcast_to(left_out.claimed_um(_rms(course, time_s)), course.shape)


def _piecewise(ask: answers.Asked) -> answers.Answer:
    if ask.start == "tests":
        raise OptionError(
            "pieces of characteristics that begin warm", expected="a duty cycle that begins cold", where="--start",
            advice="take the modal method, or leave --start out",
        )  # fmt: skip
    curves = characteristics(ask.tests, ask.responses)
    repeats = tuple(answers.piecewise_repeats(ask.tests, curves))
    findings = [
        *answers.warm_start_findings(ask.tests, ask.responses),
        *piecewise_displacement_um(curves, ask.cyclogram, np.array([ask.cyclogram.end_s]))[1],
        *answers.contradiction_findings(ask.tests, repeats, ask.responses),
    ]
    return answers.Answer(
        course=lambda cycle, time: piecewise_displacement_um(curves, cycle, time)[0],
        findings=tuple(findings),
        repeats=repeats,
    )


def _halls_not_used(ask: answers.Asked, answer: answers.Answer) -> Iterator[Finding]:
    for name in () if ask.hall is None else ask.hall.names:
        if name not in answer.ambients:
            yield FINDINGS.finding(
                "ambient-not-used",
                f"The duty cycle says how {name} moves; the tests do not show that it drives a displacement.",
                Where(channel=name),
            )  # fmt: skip


def _observed(ask: answers.Asked, answer: answers.Answer, readings: DayReadings) -> Observed:
    """The day as its thermometers have it, weighed by how well the tests' readings of them are repeated."""
    if not answer.modes:
        raise OptionError(
            "readings of the day for pieces of characteristics", expected="modes, which carry on through a stop",
            where="--readings", advice="take the modal method, or leave the readings out",
        )  # fmt: skip
    columns = [ask.responses.index(name) for name in readings.thermometers]
    noise = np.sqrt(np.mean([one.rmse_um[columns] ** 2 for one in answer.repeats], axis=0))
    drift = noise if answer.heldout_um is None else answer.heldout_um[columns]
    return observed(answer.course, ask.cyclogram, ask.responses, readings, noise, drift)


def _of_day(seen: Observed) -> Iterator[Finding]:
    """Stops that the plan does not have, and readings that no stop explains."""
    for stop in () if seen.explains_nothing else seen.stops:
        to_s = seen.read_until_s if stop.to_s is None else stop.to_s
        end = f"to {to_s / 60:.3g} min" if stop.to_s is not None else "on, and stands still"
        yield FINDINGS.finding(
            "unplanned-stop",
            f"By the readings of {' and '.join(seen.thermometers)} the spindle stood from {stop.from_s / 60:.3g} min "
            f"{end}, as was not planned"
            + (": the plan then went on from where it was left." if stop.delays else "."),
            Where(from_s=stop.from_s, to_s=to_s), {"delays_plan": stop.delays},
        )  # fmt: skip
    if seen.explains_nothing:
        yield FINDINGS.finding(
            "readings-off-plan",
            f"The readings of {' and '.join(seen.thermometers)} are {np.sqrt(seen.misfit):.2g} times as far from the "
            "plan, whatever stops it had, as in the tests: something else was different on the day.",
            Where(from_s=0.0, to_s=seen.read_until_s), {"misfit": seen.misfit},
        )  # fmt: skip


def _rms(error_um: Vector, time_s: Vector) -> Vector:
    """(n_responses,): Root of the mean over time of squares."""
    return np.asarray(np.sqrt(np.trapezoid(error_um**2, time_s, axis=0) / (time_s[-1] - time_s[0])))


def _tolerances_of(asked: Tolerance | None, response: str, operations: int) -> list[float]:
    """The tolerance of one response in each operation [µm]."""
    told = asked.get(response, USUAL_TOLERANCE_UM) if isinstance(asked, Mapping) else asked
    values = [*told] if isinstance(told, Sequence) else [USUAL_TOLERANCE_UM if told is None else float(told)]
    if len(values) not in (1, operations):
        raise OptionError(
            f"{len(values)} tolerances of {response}", expected=f"one, or {operations}: one an operation",
            where="--tolerance", advice="give as many tolerances as --operations has lengths, or a single one",
        )  # fmt: skip
    return values if len(values) == operations else values * operations


def _usable(tests: Sequence[ThermalTest], responses: Sequence[str]) -> tuple[list[ThermalTest], list[Finding]]:
    """The tests in which every response was read, and a finding for each of the others."""
    usable: list[ThermalTest] = []
    findings: list[Finding] = []
    for test in tests:
        readings = np.isfinite(test.displacement_um).sum(axis=0)
        if len(readings) and readings.min() >= _FEWEST_READINGS:
            usable.append(test)
            continue
        least = responses[int(np.argmin(readings))]
        findings.append(
            FINDINGS.finding(
                "test-left-out",
                f"Run {test.run} has {int(readings.min())} readings of {least}; it is left out.",
                Where(channel=least, run=test.run), {"readings": int(readings.min())}, action="leave-out-run",
            )
        )  # fmt: skip
    if not usable:
        raise InputError(
            "no run with readings of " + " and ".join(responses), where="the tests",
            expected=f"at least {_FEWEST_READINGS} readings of every displacement in a run",
            advice="record heating and cooling for some hours, at least one reading a minute",
        )  # fmt: skip
    return usable, findings


def _times(course: Callable[[Vector], Vector], cyclogram: Cyclogram, operations_s: Sequence[float] | None) -> Vector:
    """A regular grid, the changes of speed, the ends of the operations, and more where the course bends."""
    end = cyclogram.end_s
    step = next((s for s in (_STEP_S, *_STEPS_S) if end / s >= _FEWEST_STEPS), _STEPS_S[-1])
    regular = step * np.arange(int(np.ceil(end / step * (1.0 - 1e-12))))
    ends = np.cumsum(operations_s if operations_s is not None else [])
    time = np.unique(np.r_[regular, cyclogram.start_s, ends[ends < end], end])
    # sums of decimal minutes beside multiples of the step
    time = time[np.r_[True, np.diff(time) > 1e-9 * end]]
    time[-1] = end
    values = course(time)
    bend_um = max(2e-5 * float(np.abs(values).max()), 1e-6)
    for _ in range(_HALVINGS):
        middle = (time[:-1] + time[1:]) / 2.0
        between = course(middle)
        wanted = (np.abs(between - (values[:-1] + values[1:]) / 2.0) > bend_um).any(axis=1)
        if not wanted.any():
            break
        order = np.argsort(np.r_[time, middle[wanted]], kind="stable")
        values = np.vstack([values, between[wanted]])[order]
        time = np.r_[time, middle[wanted]][order]
    return np.asarray(time)


def _of_program(
    cyclogram: Cyclogram, operations_s: Sequence[float] | None, usual: Sequence[str],
    programs: Mapping[str, CorrectionProgram], responses: Sequence[str], claims: Vector | None,
) -> Iterator[Finding]:  # fmt: skip
    if usual:
        yield FINDINGS.finding(
            "usual-tolerance",
            f"No tolerance of {', '.join(usual)} was given; {USUAL_TOLERANCE_UM:g} µm was taken.",
        )  # fmt: skip
    if operations_s is None:
        yield FINDINGS.finding(
            "one-operation", "No operations were given; the whole duty cycle is one, with one zero.",
        )  # fmt: skip
    elif float(np.sum(operations_s)) < cyclogram.end_s * (1.0 - 1e-12):
        end = float(np.sum(operations_s))
        yield FINDINGS.finding(
            "operations-end-early",
            f"The operations end at {end / 60:g} min, the duty cycle at {cyclogram.end_s / 60:g} min: there are no "
            "corrections after them.",
            Where(from_s=end, to_s=cyclogram.end_s),
        )  # fmt: skip
    yield FINDINGS.finding(
        "sign-not-verified",
        "Corrections are counted as the gauge counted in the tests: each is a displacement to be subtracted.",
    )  # fmt: skip
    for name, program in programs.items():
        error = _at(claims, responses.index(name))
        known = (
            "it gives no error of its own, and no test could be left out to see one"
            if error is None
            else f"what was left out of the fit says {error:.2g} µm (RMS)"
        )
        yield FINDINGS.finding(
            "drift-beyond-tolerance",
            f"The program keeps the predicted {name} within the tolerance; the true one leaves it by as much as "
            f"the prediction is wrong: {known}. Largest errors are larger, most of all in pauses that no test has.",
            Where(channel=name), {"heldout_um": error},
            "record one run like the duty cycle and compare" + ("" if error else "; try --method modal as well"),
            level="warning" if error is None or error > LARGE_ERROR * program.tolerance_um else "info",
        )  # fmt: skip


def _few_tests(
    responses: Sequence[str], claims: Vector, judged: int, factor: float, programs: Mapping[str, CorrectionProgram]
) -> Iterator[Finding]:
    """Of tolerances that are kept by the claimed error and not by what it may be: there more tests would decide."""
    for name, program in programs.items():
        claimed = float(claims[responses.index(name)])
        if claimed <= program.tolerance_um < claimed * factor:
            yield FINDINGS.finding(
                "few-tests",
                f"{name}: an error of {claimed:.2g} µm is claimed, within the tolerance of {program.tolerance_um:.3g} "
                f"µm. By {judged} test{'s' * (judged > 1)} left out and predicted by the others it may be up to "
                f"{claimed * factor:.2g} µm (root mean square, 19 times in 20).",
                Where(channel=name),
                {"tests": judged, "factor": factor, "claimed_um": claimed, "tolerance_um": program.tolerance_um},
            )


def _at(values: Vector | None, r: int) -> float | None:
    return None if values is None or not np.isfinite(values[r]) else float(values[r])
