"""The first thing on the page of a prediction: which corrections to make when, and how far to trust them."""

from __future__ import annotations

import math
from itertools import groupby

import numpy as np

from selector.physics.thermal.correction_program import CorrectionProgram, Operation
from selector.physics.thermal.prediction import Prediction
from selector.report.numbers import listed, number_text, span_text
from selector.report.wording import Advice

MOST_TOLD = 8
"""Corrections that a sentence can hold; more are in the table."""


def prediction_advice(prediction: Prediction) -> Advice:
    """What to correct when.

    A program is not to be used where twice the error on unseen tests exceeds the tolerance: with errors that are
    normally distributed, one drift in twenty would be off by more than all that was allowed.
    """
    if not prediction.programs:
        moves = [_moves(prediction, r) for r in range(len(prediction.responses))]
        first = f"Expect {listed(moves)}."
        return Advice("use", first, (_trust(prediction), _ASK))
    doubtful = [
        name
        for name in prediction.programs
        if 2.0 * _error_um(prediction, name) > prediction.programs[name].tolerance_um
    ]
    useful = [name for name in prediction.programs if name not in doubtful]
    tolerance = next(iter(prediction.programs.values())).tolerance_um
    instructions = [_instruction(prediction, name) for name in useful]
    if not useful:
        first = (
            f"Do not use this program: the prediction of {listed(doubtful)} is not good enough for {tolerance:g} µm."
        )
        return Advice("do not use", first, (_trust(prediction), _SIGN))
    ends = f"; the drift then stays within {tolerance:g} µm" if _any_correction(prediction, useful) else ""
    first = "; ".join(instructions) + ends + "."
    first = first[0].upper() + first[1:] if first.startswith("correct ") else first
    if doubtful:
        warning = f"Do not correct {listed(doubtful)}: the prediction is not good enough for {tolerance:g} µm. "
        return Advice("part", warning + first, (_trust(prediction), _SIGN))
    return Advice("use", first, (_trust(prediction), _SIGN))


def _instruction(prediction: Prediction, name: str) -> str:
    program = prediction.programs[name]
    counts = [len(operation.times_s) - 1 for operation in program.operations]
    total = sum(counts)
    if total == 0:
        _, left = program.drift_left_um(prediction.time_s, prediction.displacement_um[:, _index(prediction, name)])
        largest = number_text(float(np.abs(left).max()), 2)
        within = " within an operation" if len(program.operations) > 1 else ""
        return f"{name} needs no correction, it drifts by at most {largest} µm{within}"
    if total > MOST_TOLD:
        return f"correct {name} {total} times as the program says, {_beginning(program)}"
    parts = [
        f"{_times(count)} in operation {number} ({_amounts(operation)})"
        if len(counts) > 1
        else f"{_times(count)}: {_amounts(operation)}"
        for number, (count, operation) in enumerate(zip(counts, program.operations, strict=True), start=1)
        if count
    ]
    return f"correct {name} {listed(parts)}"


def _beginning(program: CorrectionProgram) -> str:
    number, operation = next((k, one) for k, one in enumerate(program.operations, start=1) if len(one.times_s) > 1)
    after = (float(operation.times_s[1]) - operation.start_s) / 60
    where = f" of operation {number}" if len(program.operations) > 1 else ""
    return f"first by {number_text(float(operation.corrections_um[1]))} µm after {_minutes(after)} min{where}"


def _amounts(operation: Operation) -> str:
    """By 10 µm after 18 and 45 min; amounts that are the same once."""
    steps = zip(
        operation.corrections_um[1:].tolist(), (operation.times_s[1:] - operation.start_s).tolist(), strict=True
    )
    told = [
        f"{amount} µm after {listed([_minutes(time_s / 60) for _, time_s in group])} min"
        for amount, group in groupby(steps, key=lambda step: f"{step[0]:.3g}".replace("-", "−"))
    ]
    return "by " + ", ".join(told)


def _moves(prediction: Prediction, r: int) -> str:
    course = prediction.displacement_um[:, r]
    k = int(np.argmax(np.abs(course)))
    return (
        f"{prediction.responses[r]} to move by up to {number_text(float(course[k]))} µm, "
        f"after {span_text(float(prediction.time_s[k]))}"
    )


def _trust(prediction: Prediction) -> str:
    """How good the prediction was where that could be seen."""
    errors = [f"{number_text(_error_um(prediction, name), 2)} µm in {name}" for name in prediction.responses]
    if prediction.heldout_um is not None:
        seen = f"On tests that were left out, the modes were off by {listed(errors)} (root mean square)"
    elif prediction.repeats:
        seen = f"The pieces of the measured characteristics repeat the tests to {listed(errors)} (root mean square)"
    else:
        return "There is no test on which the error of this prediction could be seen."
    return seen + (
        "; the true drift exceeds the tolerance by the error of the prediction." if prediction.programs else "."
    )


def _error_um(prediction: Prediction, name: str) -> float:
    """Error on what was left out; without it the worst on a test; 0 if nothing is known."""
    r = _index(prediction, name)
    if prediction.heldout_um is not None and np.isfinite(prediction.heldout_um[r]):
        return float(prediction.heldout_um[r])
    return max((float(one.rmse_um[r]) for one in prediction.repeats), default=0.0)


def _any_correction(prediction: Prediction, names: list[str]) -> bool:
    return any(len(operation.times_s) > 1 for name in names for operation in prediction.programs[name].operations)


def _index(prediction: Prediction, name: str) -> int:
    return prediction.responses.index(name)


def _times(count: int) -> str:
    return {1: "once", 2: "twice"}.get(count, f"{count} times")


def _minutes(minutes: float) -> str:
    # down, so that a correction read from here is never late
    return f"{math.floor(minutes * 10 + 1e-6) / 10:g}"


_ASK = (
    "For a correction program, say how long the operations are and which drift is allowed: --operations, --tolerance."
)
_SIGN = (
    "A correction is the displacement to be subtracted, counted as the gauge counted in the tests: verify the sign on "
    "the machine before the first part. Each operation begins with a new zero. The times hold for this duty cycle; "
    "after a stop, predict again."
)
