"""The workflow of a prediction: tests and a duty cycle → displacement and correction program."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from selector.errors import InputError, OptionError
from selector.findings import Finding, Where
from selector.physics.thermal.finding_table import FINDINGS, ONE_TESTED_SPEED
from selector.physics.thermal.modes.cyclogram import Cyclogram, cyclogram_kind
from selector.physics.thermal.modes.thermal_test import ThermalTest
from selector.physics.thermal.prediction.characteristics import characteristics
from selector.physics.thermal.prediction.correction_program import CorrectionProgram, correction_program, notation
from selector.physics.thermal.prediction.piecewise import piecewise_displacement_um
from selector.physics.thermal.prediction.tests_judged import (
    RepeatedTest,
    contradiction_findings,
    modal_repeats,
    movement_findings,
    piecewise_repeats,
    speed_findings,
    warm_start_findings,
)
from selector.types import Vector

Method = Literal["modal", "piecewise"]

USUAL_TOLERANCE_UM = 10.0
"""Tolerance of the printed example (C eq. 6), taken when operations are given without one."""
LONGEST_S = 31 * 86_400.0
"""A duty cycle that lasts longer is a mistake in a unit."""
LARGE_ERROR = 0.3
"""Share of the tolerance beyond which the error on tests that were left out is a warning."""
_FEWEST_READINGS = 10
_STEP_S = 60.0
_STEPS_S = (30.0, 20.0, 15.0, 10.0, 5.0, 2.0, 1.0, 0.5, 0.2, 0.1)
_FEWEST_STEPS = 240
_HALVINGS = 6


@dataclass(frozen=True)
class Mode:
    """A time constant [s] with the ends of its 95 % interval, None where the tests do not bound it."""

    tau_s: float
    low: float | None
    high: float | None


@dataclass(frozen=True)
class Prediction:
    """What a machine will do in a duty cycle."""

    responses: tuple[str, ...]  #: The displacements
    method: Method  #: {"modal", "piecewise"}: How they were predicted
    cyclogram: Cyclogram | None  #: The duty cycle; None for a prediction from its JSON form, which does not hold it
    #: (n_times,): Times [s] from the start of the duty cycle, so close that between them the course is a straight line
    time_s: Vector
    displacement_um: Vector  #: (n_times, n_responses): Predicted displacement [µm]
    modes: tuple[Mode, ...]  #: Time constants of the modal method; empty for the piecewise one, which has none
    programs: Mapping[str, CorrectionProgram]  #: Correction program of every response; empty if none was asked for
    #: residual_um and heldout_um: (n_responses,): RMS error on the tests that were fitted, and on tests that were left
    #: out [µm]
    residual_um: Vector | None
    heldout_um: Vector | None
    findings: tuple[Finding, ...]  #: What to know about it
    repeats: tuple[RepeatedTest, ...] = ()  #: The tests beside what the method makes of them
    #: (n_times, n_modes, n_responses): What each mode contributes to the displacement [µm]; None for the piecewise
    #: method
    mode_um: Vector | None = None

    def as_dict(self) -> dict[str, Any]:
        """JSON form, `selector.prediction/1`."""
        return {
            "schema": "selector.prediction/1",
            "method": self.method,
            "kind": None if self.cyclogram is None else cyclogram_kind(self.cyclogram),
            "time_s": self.time_s.tolist(),
            "displacement_um": {name: self.displacement_um[:, r].tolist() for r, name in enumerate(self.responses)},
            "modes": [{"tau_s": mode.tau_s, "low": mode.low, "high": mode.high} for mode in self.modes],
            "program": [
                {"operation": number, **operation.as_dict(), "response": name, "notation": notation(operation)}
                for name, program in self.programs.items()
                for number, operation in enumerate(program.operations, start=1)
            ],
            "tolerance_um": next((program.tolerance_um for program in self.programs.values()), None),
            "accuracy": {
                name: {"residual_um": _at(self.residual_um, r), "heldout_um": _at(self.heldout_um, r)}
                for r, name in enumerate(self.responses)
            },
            "findings": [finding.as_dict() for finding in self.findings],
        }


def cyclogram_of_rows(
    time_s: Vector, speed_rpm: Vector, operations_s: Sequence[float] | None = None
) -> tuple[Cyclogram, tuple[Finding, ...]]:
    """The duty cycle that rows of (time, speed) mean, and what was assumed about its end.

    The last row is the end; if the operations reach further, its speed is held to their end.

    Raises
    ------
    InputError
        If the rows make no duty cycle, there is one row without operations, or it lasts longer than `LONGEST_S`.
    """
    time, speed = np.asarray(time_s, dtype=np.float64), np.asarray(speed_rpm, dtype=np.float64)
    wanted = 0.0 if operations_s is None else float(np.sum(operations_s))
    last = float(time[-1]) if len(time) else 0.0
    end = max(last, wanted)
    if end > LONGEST_S:
        raise InputError(
            f"a duty cycle of {end / 86_400:.3g} days",
            expected=f"at most {LONGEST_S / 86_400:g} days",
            where="duty cycle",
            advice="check the unit of the times, and that the operations are in minutes",
        )
    if len(time) == 1 and end <= last:
        raise InputError(
            "one row and no operations, so no end",
            expected="a last row with the time at which the duty cycle ends, or --operations",
            where="duty cycle",
            advice="add a row with the end, e.g. 3600,0, or say how long the operations are",
        )
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
    tests: Sequence[ThermalTest],
    responses: Sequence[str],
    cyclogram: Cyclogram,
    *,
    method: Method = "modal",
    operations_s: Sequence[float] | None = None,
    tolerance_um: float | None = None,
    resolution_s: float | None = None,
    told: Sequence[Finding] = (),
) -> Prediction:
    """Predict the displacement in a duty cycle from heating and cooling tests, and how to correct it.

    A correction program is made if `operations_s` or `tolerance_um` is given: without operations the whole duty cycle
    is one, without a tolerance it is `USUAL_TOLERANCE_UM`. `resolution_s` rounds its times, see `correction_program`.
    What was `told` before stands first among the findings.

    Raises
    ------
    InputError
        If the tests are too few or too short, a speed is outside of them, or the program's options cannot be used.
    """
    usable, findings = _usable(tests, responses)
    findings += movement_findings(usable, responses)
    findings += warm_start_findings(usable, responses)
    findings += speed_findings(usable, cyclogram)
    modes: tuple[Mode, ...] = ()
    residual: Vector | None = None
    heldout: Vector | None = None
    mode_um: Vector | None = None
    if method == "modal":
        from selector.physics.thermal.modes.choice import choose_modes

        fit = choose_modes(usable, responses)
        modes = tuple(
            Mode(float(tau), _finite(low), _finite(high))
            for tau, low, high in zip(fit.model.tau_s, fit.tau_low_s, fit.tau_high_s, strict=True)
        )
        residual, heldout = fit.residual_um, fit.heldout_um
        # said above, about the speeds of this duty cycle
        findings += [one for one in fit.findings if one.id != ONE_TESTED_SPEED]
        findings += _longer_than_tests(usable, cyclogram)
        time = _times(lambda t: fit.model.displacement_um(cyclogram, t), cyclogram, operations_s)
        displacement = fit.model.displacement_um(cyclogram, time)
        mode_um = fit.model.mode_displacement_um(cyclogram, time)
        repeats = modal_repeats(usable, fit.model, warm=fit.warm, with_hall=fit.with_hall)
    else:
        curves = characteristics(usable, responses)
        time = _times(lambda t: piecewise_displacement_um(curves, cyclogram, t)[0], cyclogram, operations_s)
        displacement, assumed = piecewise_displacement_um(curves, cyclogram, time)
        findings += assumed
        repeats = piecewise_repeats(usable, curves)
    findings += contradiction_findings(usable, repeats, responses)
    programs: dict[str, CorrectionProgram] = {}
    if operations_s is not None or tolerance_um is not None:
        lengths = [cyclogram.end_s] if operations_s is None else list(operations_s)
        tolerance = USUAL_TOLERANCE_UM if tolerance_um is None else tolerance_um
        for r, name in enumerate(responses):
            programs[name] = correction_program(time, displacement[:, r], lengths, tolerance, resolution_s)
        findings += _of_program(cyclogram, operations_s, tolerance_um, responses, heldout)
    elif resolution_s is not None:
        raise OptionError(
            "a resolution without a program", expected="--operations or --tolerance beside it", where="resolution",
            advice="give --operations or --tolerance, or leave the resolution out",
        )  # fmt: skip
    findings = [*told, *findings]
    return Prediction(
        tuple(responses),
        method,
        cyclogram,
        time,
        displacement,
        modes,
        programs,
        residual,
        heldout,
        tuple(findings),
        repeats,
        mode_um,
    )


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
            "no run with readings of " + " and ".join(responses),
            expected=f"at least {_FEWEST_READINGS} readings of every displacement in a run",
            where="the tests",
            advice="record heating and cooling for some hours, at least one reading a minute",
        )
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


def _longer_than_tests(tests: Sequence[ThermalTest], cyclogram: Cyclogram) -> Iterator[Finding]:
    longest = max(float(test.time_s[-1] - test.time_s[0]) for test in tests)
    if cyclogram.end_s > 1.5 * longest:
        yield FINDINGS.finding(
            "longer-than-tests",
            f"The duty cycle lasts {cyclogram.end_s / 3600:.3g} h, the longest test {longest / 3600:.3g} h: slower "
            "parts of the warming than the tests could show are not in the prediction.",
            Where(), {"cycle_s": cyclogram.end_s, "longest_test_s": longest},
        )  # fmt: skip


def _of_program(
    cyclogram: Cyclogram,
    operations_s: Sequence[float] | None,
    tolerance_um: float | None,
    responses: Sequence[str],
    heldout: Vector | None,
) -> Iterator[Finding]:
    if tolerance_um is None:
        yield FINDINGS.finding(
            "usual-tolerance", f"No tolerance was given; {USUAL_TOLERANCE_UM:g} µm was taken.",
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
    allowed_um = USUAL_TOLERANCE_UM if tolerance_um is None else tolerance_um
    for r, name in enumerate(responses):
        error = _at(heldout, r)
        known = (
            "pieces of characteristics give no error of their own"
            if error is None
            else f"what was left out of the fit was predicted to {error:.2g} µm (RMS)"
        )
        yield FINDINGS.finding(
            "drift-beyond-tolerance",
            f"The program keeps the predicted {name} within the tolerance; the true one leaves it by as much as "
            f"the prediction is wrong: {known}. Largest errors are larger, most of all in pauses that no test has.",
            Where(channel=name), {"heldout_um": error},
            "record one run like the duty cycle and compare" + ("" if error else "; try --method modal as well"),
            level="warning" if error is None or error > LARGE_ERROR * allowed_um else "info",
        )  # fmt: skip


def _at(values: Vector | None, r: int) -> float | None:
    return None if values is None else _finite(values[r])


def _finite(value: Any) -> float | None:
    return float(value) if value is not None and np.isfinite(value) else None
