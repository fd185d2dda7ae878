"""A prediction again from its JSON form, `selector.prediction/1`."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from selector.findings import Finding
from selector.json_text import fields_of
from selector.physics.thermal.prediction.answer import Mode, Start
from selector.physics.thermal.prediction.correction_program import BestOrder, BestWarmUp, CorrectionProgram, Operation
from selector.physics.thermal.prediction.observer import Observed, Stop
from selector.physics.thermal.prediction.prediction import Method, Prediction
from selector.selection.result_file import Number, Part
from selector.types import Vector

Perhaps = Number | None


class _Operation(Part):
    operation: int
    durations_min: Annotated[tuple[Number, ...], Field(min_length=1)]
    corrections_um: tuple[Number, ...]
    response: str
    tolerance_um: Perhaps = None


class _Accuracy(Part):
    residual_um: Perhaps
    heldout_um: Perhaps
    claimed_um: Perhaps = None


class _Stop(Part):
    from_s: Number
    to_s: Perhaps
    delays_plan: bool


class _Errors(Part):
    plan: Number
    observed: Number


class _Observed(Part):
    thermometers: tuple[str, ...]
    read_until_s: Number
    time_s: tuple[Number, ...]
    displacement_um: dict[str, tuple[Number, ...]]
    stops: tuple[_Stop, ...]
    misfit: Number
    errors_um: dict[str, _Errors]

    def again(self, names: Sequence[str]) -> Observed:
        """The day again, its courses in the order of these responses."""
        return Observed(
            self.thermometers,
            self.read_until_s,
            np.array(self.time_s),
            np.array([self.displacement_um[name] for name in names]).T,
            tuple(Stop(one.from_s, one.to_s, one.delays_plan) for one in self.stops),
            self.misfit,
            {name: (one.plan, one.observed) for name, one in self.errors_um.items()},
        )


class PredictionDocument(Part):
    """The fields of a prediction's JSON."""

    method: Method
    time_s: Annotated[tuple[Number, ...], Field(min_length=1)]
    displacement_um: dict[str, tuple[Number, ...]]
    temperature_k: dict[str, tuple[Number, ...]] = Field(default_factory=dict)
    modes: tuple[Mode, ...] = ()
    program: tuple[_Operation, ...] = ()
    tolerance_um: Perhaps = None
    accuracy: dict[str, _Accuracy] = Field(default_factory=dict)
    claim_factor: Perhaps = None
    left_out: dict[str, dict[str, Perhaps]] = Field(default_factory=dict)
    start: Start = "cold"
    warm_up: BestWarmUp | None = None
    order: BestOrder | None = None
    observed: _Observed | None = None
    findings: tuple[Finding, ...] = ()


def prediction_of(document: Mapping[str, Any]) -> Prediction:
    """The prediction whose JSON form this is, without its duty cycle, its tests and the courses of its modes.

    Raises pydantic.ValidationError: a field is missing, or of the wrong kind. Raises ValueError: a course has another
    length than its times, or a program lacks its tolerance.
    """
    told = PredictionDocument.model_validate(document)
    courses = {**told.displacement_um, **told.temperature_k}
    names = tuple(courses)
    if not names:
        raise ValueError("no course of a displacement or temperature")
    for name, course in courses.items():
        if len(course) != len(told.time_s):
            raise ValueError(f"{len(course)} values of {name} at {len(told.time_s)} times")
    of_response = {name: [one for one in told.program if one.response == name] for name in names}
    accuracy = [told.accuracy[name] for name in names if name in told.accuracy]
    return Prediction(
        responses=names,
        cyclogram=None,
        time_s=np.array(told.time_s),
        displacement_um=np.array([courses[name] for name in names]).T,
        programs={name: _program(lines, told.tolerance_um) for name, lines in of_response.items() if lines},
        residual_um=_errors([one.residual_um for one in accuracy], len(names)),
        heldout_um=_errors([one.heldout_um for one in accuracy], len(names)),
        claimed_um=_errors([one.claimed_um for one in accuracy], len(names)),
        left_out_um={
            test: np.array([np.nan if errors.get(name) is None else errors[name] for name in names], dtype=np.float64)
            for test, errors in told.left_out.items()
        },
        temperatures=tuple(told.temperature_k),
        observed=None if told.observed is None else told.observed.again(names),
        **fields_of(told, "method", "modes", "findings", "start", "warm_up", "order", "claim_factor"),
    )


def _program(lines: Sequence[_Operation], tolerance_um: float | None) -> CorrectionProgram:
    operations, start_s = [], 0.0
    for line in lines:
        allowed = tolerance_um if line.tolerance_um is None else line.tolerance_um
        if allowed is None:
            raise ValueError("a program without a tolerance")
        ends_s = start_s + 60.0 * np.cumsum(line.durations_min)
        times_s = np.r_[start_s, ends_s[:-1]]
        if len(times_s) != len(line.corrections_um):
            raise ValueError(f"{len(line.corrections_um)} corrections of {len(times_s)} durations")
        operations.append(Operation(start_s, float(ends_s[-1]), times_s, np.array(line.corrections_um), allowed))
        start_s = float(ends_s[-1])
    return CorrectionProgram(tuple(operations))


def _errors(told: Sequence[float | None], count: int) -> Vector | None:
    """Errors of all responses; None if they are not known."""
    known = [np.nan if value is None else value for value in told]
    return np.array(known) if len(known) == count and any(value is not None for value in told) else None
