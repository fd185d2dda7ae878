"""Results on disk, read with suspicion: which kind they are; diagnoses and predictions, made again from their JSON."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, TypeVar

import numpy as np
from pydantic import Field, ValidationError

from selector.controllers.strict_json import JSON_KINDS, json_path, parsed_json, shown
from selector.diagnosis.answer import Diagnosis, Errors, Fit, NamedEffect, NextRun, Place, Verdict, recalibration_of
from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.effect import Quantity
from selector.errors import InputError, ModelFileError, ResultError
from selector.findings import Finding
from selector.json_text import fields_of
from selector.physics.thermal.prediction.answer import Mode, Start
from selector.physics.thermal.prediction.correction_program import BestOrder, BestWarmUp, CorrectionProgram, Operation
from selector.physics.thermal.prediction.observer import Observed, Stop
from selector.physics.thermal.prediction.prediction import Method, Prediction
from selector.selection.result_file import Number, Part
from selector.text_file import shell_word, text_of
from selector.types import Vector

LARGEST_FILE_BYTES = 128_000_000
MOST_VALUES = 5_000_000
#: Results that a folder may hold, the one that is shown first.
NAMES = ("selection.json", "diagnosis.json", "prediction.json", "model.json")

SCHEMAS = {
    "selector.selection/1": "selection",
    "selector.diagnosis/1": "diagnosis",
    "selector.prediction/1": "prediction",
    "selector.model/1": "model",
}
Made = TypeVar("Made")
Perhaps = Number | None


@dataclass(frozen=True)
class Result:
    """A result: its kind (the word in its schema), its content as plain values, and where it was read."""

    kind: str
    document: dict[str, Any]
    path: Path


def result_place(path: str | Path) -> Path:
    """The file that a path means: itself, or the first result that a folder holds.

    Raises ResultError: the folder holds none.
    """
    place = Path(path)
    if not place.is_dir():
        return place
    for name in NAMES:
        if (place / name).is_file():
            return place / name
    study = (place / "study.toml").is_file()
    raise ResultError(
        "a study without results" if study else "a folder without results",
        expected="a folder with one of " + ", ".join(NAMES),
        where=str(place),
        advice="make them first: `selector select --study {0} --out {0}`".format(shell_word(str(place)))
        if study
        else "give a folder that `--out` of select, diagnose, predict or export wrote, or one of these files",
    )


def read_result(path: str | Path) -> Result:
    """The result in a file, or the first one in a folder.

    Raises ResultError: it cannot be read, is cut off, nested too deep or too large, holds a number that is none, or is
    not one of `SCHEMAS`.
    """
    place = result_place(path)
    text = text_of(place, LARGEST_FILE_BYTES, lambda found: _unreadable(found, place))
    try:
        document = parsed_json(text, where=str(place), most_entries=MOST_VALUES, most_values=MOST_VALUES)
    except ModelFileError as error:
        raise error.at(error.where, ResultError, advice="make the result again, or take an intact copy") from None
    schema = document.get("schema") if isinstance(document, dict) else None
    if not isinstance(schema, str) or schema not in SCHEMAS:
        raise ResultError(
            f"schema {shown(schema)}" if schema is not None else "no field 'schema'",
            expected="one of " + ", ".join(SCHEMAS),
            where=f"{place}, $.schema",
            advice="give a result of this version of selector, or use the version that wrote it",
        )
    return Result(SCHEMAS[schema], document, place)


def made_of(result: Result, make: Callable[[dict[str, Any]], Made]) -> Made:
    """What `make` makes of a result; what is wrong in it is told with its place.

    Raises ResultError: a field is missing, of the wrong kind, or contradicts another one.
    """
    try:
        return make(result.document)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        missing = first["type"] == "missing"
        raise ResultError(
            f"no field {str(first['loc'][-1])!r}" if missing else shown(first["input"]),
            expected="this field: an earlier version of selector did not write it"
            if missing
            else JSON_KINDS.get(first["type"], first["msg"].removeprefix("Input should be ")),
            where=f"{result.path}, {json_path(first['loc'])}",
            advice="make the result again",
        ) from None
    except InputError as error:
        raise error.at(f"{result.path}, {error.where}", ResultError, advice="make the result again") from None
    except (ValueError, KeyError, IndexError, TypeError, AttributeError, ArithmeticError) as error:
        raise ResultError(
            f"fields that contradict each other ({type(error).__name__}: {str(error)[:160]})",
            expected=f"a document as `selector` writes it ({result.kind})",
            where=str(result.path),
            advice="make the result again: this one was changed by hand or cut together",
        ) from None


_EXPECTED = "one complete JSON document: " + ", ".join(NAMES)


def _unreadable(found: str, place: Path) -> ResultError:
    return ResultError(
        found,
        expected=f"{_EXPECTED}, or a folder with one of them",
        where=str(place),
        advice="check the path; `--out DIR` of select, diagnose, predict and export writes them",
    )


class _Quantity(Part):
    value: Perhaps
    unit: str = ""
    low: Perhaps = None
    high: Perhaps = None

    def quantity(self) -> Quantity:
        return Quantity(_known(self.value), self.unit, self.low, self.high)


class _Effect(Part):
    id: str
    channel: str
    channels: tuple[str, ...] = ()
    place: str | None = None
    statement: str
    parameters: dict[str, _Quantity]
    confidence: Number
    p_value: Number = float("nan")
    share: Number
    suspected: bool = False
    cannot_be_told_from: tuple[str, ...] = ()
    experiment: str = ""

    def effect(self) -> NamedEffect:
        return NamedEffect(**{**dict(self), "parameters": {name: q.quantity() for name, q in self.parameters.items()}})


class _Errors(Part):
    rmse_before: Perhaps
    rmse_after: Perhaps
    noise_floor: Perhaps = None

    def errors(self) -> Errors:
        return Errors(_known(self.rmse_before), _known(self.rmse_after), self.noise_floor)


class _Fit(Part):
    train: _Errors
    heldout: _Errors
    unit: str
    recalibrated_heldout_rmse: Perhaps = None
    gap_closed: _Quantity | None = None
    placebo_gain: _Quantity | None = None

    def fit(self) -> Fit:
        gap, placebo = (None if one is None else one.quantity() for one in (self.gap_closed, self.placebo_gain))
        errors = self.train.errors(), self.heldout.errors(), _known(self.recalibrated_heldout_rmse)
        return Fit(self.unit, *errors, gap, placebo, _NOTHING, _NOTHING, _NOTHING)


class _Document(Part):
    verdict: Verdict
    headline: str = ""
    where: tuple[Place, ...] = ()
    effects: tuple[_Effect, ...] = ()
    also_seen: tuple[_Effect, ...] = ()
    fit: dict[str, _Fit] = Field(default_factory=dict)
    recalibration: dict[str, dict[str, _Quantity]] = Field(default_factory=dict)
    next_runs: tuple[NextRun, ...] = ()
    findings: tuple[Finding, ...] = ()


_NOTHING = np.zeros(0)


def diagnosis_of(document: Mapping[str, Any]) -> Diagnosis:
    """The diagnosis of a `selector.diagnosis/1` document, its comparison without rows.

    Raises pydantic.ValidationError: a field is missing, or of the wrong kind.
    """
    told = _Document.model_validate(document)
    courses = dict.fromkeys(told.fit, _NOTHING)
    rows = np.zeros(0, dtype=np.bool_)
    return Diagnosis(
        comparison=Comparison((), (0,), _NOTHING, (), courses, courses, tuple(told.fit), rows),
        headline=told.headline or told.verdict,
        effects=tuple(one.effect() for one in told.effects),
        also_seen=tuple(one.effect() for one in told.also_seen),
        fit={name: one.fit() for name, one in told.fit.items()},
        recalibration={
            name: _as_fitted({key: one.quantity() for key, one in of.items()})
            for name, of in told.recalibration.items()
        },
        **fields_of(told, "verdict", "where", "next_runs", "findings"),
    )


def _as_fitted(quantities: Mapping[str, Quantity]) -> dict[str, Quantity]:
    """Offset, gain and delay as the fit has them, of which the document has what `recalibration_of` makes of them."""
    gain = quantities.get("gain")
    if gain is None or gain.value == 0.0:
        return dict(quantities)
    turned = recalibration_of({**quantities, "gain": replace(gain, value=1.0 / gain.value)})
    return {**turned, "gain": gain}


def _known(value: float | None) -> float:
    return float("nan") if value is None else value


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


class _OfDay(Part):
    plan: Number
    observed: Number


class _Observed(Part):
    thermometers: tuple[str, ...]
    read_until_s: Number
    time_s: tuple[Number, ...]
    displacement_um: dict[str, tuple[Number, ...]]
    stops: tuple[_Stop, ...]
    misfit: Number
    errors_um: dict[str, _OfDay]

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
