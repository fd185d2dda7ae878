"""`selector.model/1`: everything that a control needs to know about a model, as closed, checked values, and on disk."""

import hashlib
import json
import math
from collections.abc import Callable, Iterable, Mapping
from operator import not_
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field, ValidationError, model_validator

from selector.atomic_file import write_whole
from selector.controllers.closed_values import (
    Adaptation,
    CheckVector,
    Closed,
    ContradictionError,
    Date,
    GuardVector,
    KeyPath,
    Name,
    NonNegative,
    Number,
    Positive,
    Power,
    Role,
    Sha256,
    Sign,
    Text,
    refuse,
)
from selector.controllers.strict_json import JSON_KINDS, LARGEST_COLLECTION, json_path, json_text, parsed_json, shown
from selector.errors import ModelFileError
from selector.text_file import text_of
from selector.units import CANONICAL_UNITS

SCHEMA = "selector.model/1"


class Input(Closed):
    """One sensor: x = reading − start reading (rise) or x = reading (absolute); z = (x − centre) / scale."""

    name: Name
    role: Role = "temperature"
    unit: Name = Field(default="degC", description="canonical unit of the role; of readings, rises, ranges and rates")
    reference: Literal["rise", "absolute"] = "rise"
    centre: Number = Field(default=0.0, description="of x")
    scale: Positive = Field(default=1.0, description="of x")
    valid_min: Number = Field(description="smallest x that the model has seen")
    valid_max: Number = Field(description="largest x that the model has seen")
    rate_limit_per_min: Positive | None = Field(default=None, description="a faster change of the reading is a fault")
    reading_min: Number | None = Field(
        default=None, description="a reading below it is a fault, whatever the reference"
    )
    reading_max: Number | None = Field(
        default=None, description="a reading above it is a fault, whatever the reference"
    )
    place: Text | None = None

    @property
    def reading_limits(self) -> tuple[float, float]:
        """Readings beyond these are a fault; infinite where nothing limits them."""
        low, high = self.reading_min, self.reading_max
        return -math.inf if low is None else low, math.inf if high is None else high


class State(Closed):
    """Memory: first-order lag of the x of a sensor, started at its first x; z = (lagged x − centre) / scale."""

    name: Name
    source: Name = Field(description="name of an input")
    tau_s: Positive = Field(description="time constant [s]")
    centre: Number = 0.0
    scale: Positive = 1.0


class Term(Closed):
    """coefficient · Π z^power; the keys of `powers` are names of inputs or states."""

    powers: dict[Name, Power] = Field(min_length=1, max_length=8)
    coefficient: Number
    standard_error: NonNegative | None = None


Terms = Annotated[tuple[Term, ...], Field(max_length=5000, fail_fast=True)]


class PositionPart(Closed):
    """Position-dependent part: slope · (P − reference), slope = intercept + Σ terms [µm/m], P = axis position [m]."""

    axis: Name = Field(description="machine axis whose position P is meant")
    reference_m: Number = Field(description="P0 [m]: there the position-dependent part is zero")
    valid_min_m: Number
    valid_max_m: Number
    intercept: Number = Field(description="[um/m]")
    terms: Terms = ()

    @property
    def reach_m(self) -> float:
        """Largest distance of a valid position from the reference."""
        return max(abs(self.valid_min_m - self.reference_m), abs(self.valid_max_m - self.reference_m))


class Output(Closed):
    """One displacement: intercept + Σ terms [µm] (+ the position-dependent part)."""

    name: Name = Field(description="name of the displacement channel that was learnt")
    axis: Name | None = None
    unit: Literal["um"] = "um"
    sign: Sign = Field(
        default="correction = -displacement",
        description="the output is the displacement of the tool against the workpiece, positive towards + of the axis; "
        "the correction of the axis is its negative, or the displacement itself where the control counts the other way",
    )
    reference: Literal["rise", "absolute"] = Field(
        default="absolute",
        description="rise: displacement since the start of the run; absolute: displacement as recorded",
    )
    intercept: Number
    intercept_standard_error: NonNegative | None = None
    terms: Terms = ()
    position: PositionPart | None = None

    @property
    def axis_or_name(self) -> str:
        """An output without an axis is taken for that of its name."""
        return self.axis or self.name

    @property
    def all_terms(self) -> tuple[Term, ...]:
        """Those of the position-dependent part, too."""
        return self.terms if self.position is None else (*self.terms, *self.position.terms)


class OutputLimits(Closed):
    """Limits of the correction of one output on the control; null = not decided, an export asks for it."""

    output: Name
    clamp_um: Positive | None = Field(default=None, description="largest magnitude of the correction")
    slew_um_per_s: Positive | None = Field(default=None, description="largest change of the correction")
    dead_band_um: NonNegative = Field(default=0.0, description="smaller changes of the correction are not passed on")
    slope_clamp_um_per_m: Positive | None = Field(default=None, description="largest magnitude of the position slope")


class Guard(Closed):
    """What the control does with bad readings and after a restart."""

    limits: tuple[OutputLimits, ...] = Field(default=(), max_length=32, fail_fast=True)
    on_fault: Literal["hold", "ramp-to-zero", "fallback"] = "hold"
    without_fallback: Literal["hold", "ramp-to-zero"] = Field(
        default="ramp-to-zero", description="with on_fault = fallback, when no fallback lacks the broken sensors"
    )
    hold_at_most_s: Positive | None = Field(default=None, description="after holding so long, ramp to zero")
    recover_after_s: NonNegative = Field(default=60.0, description="good readings for so long end a fault")
    stuck_after_s: Positive | None = Field(
        default=None, description="a reading that does not change for so long is a fault"
    )
    break_codes: tuple[Number, ...] = Field(
        default=(850.0, -9999.0, 9999.0, -999.0, 32767.0, -32768.0, 3276.7, -3276.8),
        max_length=32,
        fail_fast=True,
        description="readings of inputs in degC that mean a broken sensor",
    )
    outside_valid_range: Literal["limit-input", "fault"] = Field(
        default="limit-input", description="an x outside its valid range is limited to it, or treated as a fault"
    )
    restart: Literal["keep-start", "new-start"] = Field(
        default="keep-start",
        description="after a restart of the control, keep the stored start readings or take new ones",
    )
    new_start_after_s: Positive | None = Field(
        default=None, description="with keep-start: a standstill longer than this takes new start readings"
    )

    @property
    def last_resort(self) -> Literal["hold", "ramp-to-zero"]:
        """What a bad sensor leads to where there is no fallback for it."""
        return self.without_fallback if self.on_fault == "fallback" else self.on_fault


class Fallback(Closed):
    """A complete model for the time when some sensors are broken."""

    without: tuple[Name, ...] = Field(min_length=1, max_length=500, fail_fast=True)
    inputs: tuple[Input, ...] = Field(min_length=1, max_length=500, fail_fast=True)
    states: tuple[State, ...] = Field(default=(), max_length=500, fail_fast=True)
    outputs: tuple[Output, ...] = Field(min_length=1, max_length=32, fail_fast=True)

    @model_validator(mode="after")
    def _hangs_together(self) -> "Fallback":
        _check_equations(self.inputs, self.states, self.outputs)
        for i, item in enumerate(self.inputs):
            if item.name in self.without:
                refuse(("inputs", i, "name"), item.name, "an input that this fallback is not without")
        return self


class Provenance(Closed):
    """Where the model comes from; nothing here is read from the clock or the machine."""

    machine: Text | None = None
    data_sha256: dict[Name, Sha256] = Field(
        default_factory=dict, max_length=LARGEST_COLLECTION, description="run → hash of its data"
    )
    period_s: Positive | None = Field(default=None, description="median time between two samples of the data [s]")
    version: Text | None = Field(default=None, description="version of selector that made the model")
    date: Date | None = None
    seed: Annotated[int, Field(strict=True, ge=0, le=2**53)] | None = None
    method: Text | None = None
    note: Text | None = None


class Validation(Closed):
    """How good one output was, on its own data and on data that it had not seen."""

    method: Text | None = Field(default=None, description="e.g. leave-one-run-out")
    rmse_um: NonNegative | None = None
    heldout_rmse_um: NonNegative | None = None
    heldout_max_um: NonNegative | None = None
    heldout_baseline_um: NonNegative | None = Field(
        default=None, description="error (rms) of no compensation or of a constant on the same data, the smaller one"
    )
    r2: Number | None = None
    adjusted_r2: Number | None = None
    n_runs: Annotated[int, Field(strict=True, ge=0)] | None = None
    n_samples: Annotated[int, Field(strict=True, ge=0)] | None = None


def _schema_is_required(schema: dict[str, Any]) -> None:
    schema["required"] = ["schema", *schema["required"]]


class ModelFile(Closed):
    """A model of the thermal displacement of a machine tool, for its control (selector.model/1)."""

    model_config = ConfigDict(validate_by_name=True, validate_by_alias=True, json_schema_extra=_schema_is_required)

    schema_: Literal["selector.model/1"] = Field(default="selector.model/1", alias="schema")
    name: Name
    inputs: tuple[Input, ...] = Field(min_length=1, max_length=500, fail_fast=True)
    states: tuple[State, ...] = Field(default=(), max_length=500, fail_fast=True)
    outputs: tuple[Output, ...] = Field(min_length=1, max_length=32, fail_fast=True)
    guard: Guard = Guard()
    fallbacks: tuple[Fallback, ...] = Field(default=(), max_length=500, fail_fast=True)
    adaptation: Adaptation | None = Field(default=None, exclude_if=not_)
    provenance: Provenance = Provenance()
    validation: dict[Name, Validation] = Field(default_factory=dict, max_length=32, description="output → figures")
    test_vectors: tuple[CheckVector, ...] = Field(default=(), max_length=100, fail_fast=True)
    guard_vectors: tuple[GuardVector, ...] = Field(default=(), max_length=100, fail_fast=True, exclude_if=not_)
    digest: Sha256 | None = Field(
        default=None, exclude_if=not_, description="SHA-256 of the other fields: JSON with sorted keys"
    )

    @model_validator(mode="after")
    def _hangs_together(self) -> "ModelFile":
        _check_equations(self.inputs, self.states, self.outputs)
        outputs = [item.name for item in self.outputs]
        _check_guard(self, outputs)
        _check_fallbacks(self, outputs)
        for name in self.validation:
            if name not in outputs:
                refuse(("validation", name), name, _one_of(outputs))
        _check_vectors(self, outputs)
        if self.adaptation is not None:
            named = self.adaptation.outputs
            _check_unique((("adaptation", "outputs", i, "output"), of.output) for i, of in enumerate(named))
            for i, of in enumerate(named):
                if of.output not in outputs:
                    refuse(("adaptation", "outputs", i, "output"), repr(of.output), _one_of(outputs))
        return self


def model_json_schema() -> dict[str, Any]:
    """The closed JSON Schema (draft 2020-12) of the model file, as shipped in ``schema/selector.model-1.json``."""
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "$id": "urn:selector:model:1"}
    return head | ModelFile.model_json_schema(by_alias=True)


def _one_of(names: Iterable[str]) -> str:
    return "one of " + ", ".join(names)


def _check_unique(names: Iterable[tuple[KeyPath, str]]) -> None:
    seen: set[str] = set()
    for path, name in names:
        if name in seen:
            refuse(path, f"{name!r} a second time", "unique names")
        seen.add(name)


def _check_range(low: float | None, high: float | None, path: KeyPath) -> None:
    if low is not None and high is not None and low > high:
        refuse(path, f"minimum {low!r} above maximum {high!r}", "minimum ≤ maximum")


def _check_equations(inputs: tuple[Input, ...], states: tuple[State, ...], outputs: tuple[Output, ...]) -> None:
    named = [(("inputs", i, "name"), item.name) for i, item in enumerate(inputs)]
    _check_unique([*named, *((("states", i, "name"), item.name) for i, item in enumerate(states))])
    _check_unique((("outputs", i, "name"), item.name) for i, item in enumerate(outputs))
    for i, item in enumerate(inputs):
        _check_range(item.valid_min, item.valid_max, ("inputs", i, "valid_min"))
        _check_range(item.reading_min, item.reading_max, ("inputs", i, "reading_min"))
        if item.unit != CANONICAL_UNITS[item.role]:
            refuse(("inputs", i, "unit"), repr(item.unit), f"{CANONICAL_UNITS[item.role]!r}, the unit of {item.role!r}")
    sources = [item.name for item in inputs]
    for i, state in enumerate(states):
        if state.source not in sources:
            refuse(("states", i, "source"), repr(state.source), _one_of(sources))
    known = {*sources, *(state.name for state in states)}
    for i, output in enumerate(outputs):
        if output.name in ("run", "time_s"):
            refuse(("outputs", i, "name"), repr(output.name), "a name that is not taken in a table of predictions")
        _check_terms(output.terms, known, ("outputs", i, "terms"))
        if output.position is not None:
            _check_terms(output.position.terms, known, ("outputs", i, "position", "terms"))
            _check_range(
                output.position.valid_min_m, output.position.valid_max_m, ("outputs", i, "position", "valid_min_m")
            )


def _check_terms(terms: tuple[Term, ...], known: set[str], path: KeyPath) -> None:
    seen: set[frozenset[tuple[str, int]]] = set()
    for i, term in enumerate(terms):
        for name in term.powers:
            if name not in known:
                refuse((*path, i, "powers", name), repr(name), "the name of an input or a state")
        product = frozenset(term.powers.items())
        if product in seen:
            refuse((*path, i, "powers"), "the same product a second time", "every product once in an output")
        seen.add(product)


def _check_guard(model: ModelFile, outputs: list[str]) -> None:
    _check_unique((("guard", "limits", i, "output"), item.output) for i, item in enumerate(model.guard.limits))
    for i, limits in enumerate(model.guard.limits):
        if limits.output not in outputs:
            refuse(("guard", "limits", i, "output"), repr(limits.output), _one_of(outputs))
    if model.guard.on_fault == "fallback" and not model.fallbacks:
        refuse(("guard", "on_fault"), "'fallback' without any fallback", "at least one entry in fallbacks")


def _check_fallbacks(model: ModelFile, outputs: list[str]) -> None:
    inputs = {item.name: (item.role, item.unit, item.reference) for item in model.inputs}
    seen: set[frozenset[str]] = set()
    for i, fallback in enumerate(model.fallbacks):
        for j, name in enumerate(fallback.without):
            if name not in inputs:
                refuse(("fallbacks", i, "without", j), repr(name), _one_of(inputs))
        if frozenset(fallback.without) in seen:
            refuse(("fallbacks", i, "without"), "the same sensors a second time", "one fallback for a set of sensors")
        seen.add(frozenset(fallback.without))
        for j, item in enumerate(fallback.inputs):
            if inputs.get(item.name) != (item.role, item.unit, item.reference):
                expected = "an input of the model with the same role, unit and reference"
                refuse(("fallbacks", i, "inputs", j), repr(item.name), expected)
        if [item.name for item in fallback.outputs] != outputs:
            refuse(("fallbacks", i, "outputs"), "other outputs", "the outputs of the model in the same order")
        for j, (own, output) in enumerate(zip(fallback.outputs, model.outputs, strict=True)):
            if own.sign != output.sign:
                refuse(("fallbacks", i, "outputs", j, "sign"), repr(own.sign), f"{output.sign!r}, as the model has")
            if _place(own) != _place(output):
                where = ("fallbacks", i, "outputs", j, "position")
                refuse(where, _place(own), f"{_place(output)}, as the model has")


def _place(output: Output) -> str:
    part = output.position
    if part is None:
        return "no position-dependent part"
    return f"axis {part.axis} about {part.reference_m} m, from {part.valid_min_m} to {part.valid_max_m} m"


def _check_vectors(model: ModelFile, outputs: list[str]) -> None:
    inputs = [item.name for item in model.inputs]
    axes = [item.position.axis for item in model.outputs if item.position is not None]
    for i, vector in enumerate(model.test_vectors):
        where: KeyPath = ("test_vectors", i)
        _check_names((*where, "readings"), vector.readings, inputs)
        _check_names((*where, "expected"), vector.expected, outputs)
        _check_names((*where, "positions_m"), axes if vector.positions_m is None else vector.positions_m, axes)
        for name in vector.start_readings or {}:
            if name not in inputs:
                refuse((*where, "start_readings", name), repr(name), _one_of(inputs))
        if vector.fallbacks and len(vector.fallbacks) != len(model.fallbacks):
            refuse((*where, "fallbacks"), f"{len(vector.fallbacks)} entries", f"{len(model.fallbacks)}, one a fallback")
        for k, found in enumerate(vector.fallbacks):
            _check_names((*where, "fallbacks", k), found, outputs)
    for i, path in enumerate(model.guard_vectors):
        for field, wanted in (("readings", inputs), ("sensors", inputs), ("expected", outputs), ("positions_m", axes)):
            _check_names(("guard_vectors", i, field), getattr(path, field), wanted)
        _check_names(("guard_vectors", i, "test_um"), path.test_um, outputs if path.test_um else ())


def _check_names(path: KeyPath, found: Iterable[str], expected: Iterable[str]) -> None:
    given, wanted = set(found), set(expected)
    if given != wanted:
        told = "no " + ", ".join(sorted(wanted - given)) if wanted - given else ", ".join(sorted(given - wanted))
        refuse(path, told, "exactly " + (", ".join(sorted(wanted)) or "no entry"))


LARGEST_FILE_BYTES = 16_000_000  #: A model of 37 sensors with all pair products and 37 fallbacks takes half of it.

# of the pattern of names; hashes and dates have others
_OF_NAMES = "^[^"

_EXPORT_AGAIN = "correct this place, or export the model again"


def read_model(path: str | Path, *, is_changed: bool = False) -> ModelFile:
    """The model in a file; `is_changed`: somebody changed it on purpose, and its digest is not looked at.

    Raises ModelFileError: the file cannot be read, is too large, is cut off, is of another version, does not follow the
    schema or is not what its digest says; the message has the JSON path and the value.
    """
    place = Path(path) if isinstance(path, str) else path

    def refused(found: str) -> ModelFileError:
        return ModelFileError(
            found,
            expected=f"a model file ({SCHEMA}), JSON text of at most {LARGEST_FILE_BYTES // 1_000_000} MB in UTF-8",
            where=str(place),
            advice="check the path; `selector select --out DIR` writes DIR/model.json, and no editor may change its "
            "encoding",
        )

    text = text_of(place, LARGEST_FILE_BYTES, refused)
    return parsed_model(text, where=str(place), is_changed=is_changed)


def parsed_model(text: str, *, where: str = "model", is_changed: bool = False) -> ModelFile:
    """The model in a JSON text; `where` names the text in messages. Raises ModelFileError: as `read_model`."""
    value = parsed_json(text, where=where)
    if not isinstance(value, dict):
        raise ModelFileError(
            shown(value),
            expected=f'an object with "schema": "{SCHEMA}"',
            where=f"{where}, $",
            advice="give a model file; `selector select --out DIR` writes DIR/model.json",
        )
    if value.get("schema") != SCHEMA:
        raise ModelFileError(
            f"schema {shown(value['schema'])}" if "schema" in value else "no field 'schema'",
            expected=f'"{SCHEMA}"',
            where=f"{where}, $.schema",
            advice="give a model file of this version, or use the version of selector that wrote the file",
        )
    try:
        model = ModelFile.model_validate(value)
    except ValidationError as error:
        raise _model_file_error(error, where) from None
    if model.digest is not None and not is_changed and _digest(value) != model.digest:
        raise ChangedFileError(
            f"a file whose contents have the SHA-256 {_digest(value)[:16]}…",
            expected=f"{model.digest[:16]}…, as it had when selector wrote it",
            where=f"{where}, $.digest",
            advice="take an intact copy; if somebody changed it on purpose, selector model check --accept tests what "
            "it can and writes vectors and digest anew",
        )
    return model


class ChangedFileError(ModelFileError):
    """The contents of a file are not what its digest says."""


def model_text(model: ModelFile) -> str:
    """The JSON text of a model: field order of the schema, shortest float text, the same for equal models.

    Where the model has a digest, that of its contents.
    """
    written = model if model.digest is None else with_digest(model)
    return json_text(written.model_dump(by_alias=True)) + "\n"


def with_digest(model: ModelFile) -> ModelFile:
    """The model with the digest of its contents."""
    return model.model_copy(update={"digest": _digest(model.model_dump(by_alias=True))})


def _digest(content: Mapping[str, Any]) -> str:
    others = {key: value for key, value in content.items() if key != "digest"}
    return hashlib.sha256(json.dumps(others, ensure_ascii=False, sort_keys=True).encode("utf-8")).hexdigest()


def write_model(model: ModelFile, path: str | Path) -> None:
    """Write a model file, whole or not at all. Raises OptionError: nothing can be written at this path."""
    write_whole(Path(path) if isinstance(path, str) else path, model_text(model).encode("utf-8"))


def model_sha256(model: ModelFile) -> str:
    """SHA-256 of the bytes that `write_model` writes, 64 hexadecimal digits."""
    return hashlib.sha256(model_text(model).encode("utf-8")).hexdigest()


def equations_sha256(model: ModelFile) -> str:
    """SHA-256 of what a control computes and keeps: inputs, memory, outputs, fallbacks, adaptation.

    Limits, checks of readings, provenance, validation and test vectors are no part of it: start readings that a
    control kept are as good with another clamp.
    """
    left_out = {"schema_", "name", "guard", "provenance", "validation", "test_vectors", "guard_vectors", "digest"}
    content = model.model_dump(by_alias=True, exclude=left_out)
    for of in (content, *content["fallbacks"]):
        for item in of["inputs"]:
            for key in ("rate_limit_per_min", "reading_min", "reading_max", "place"):
                del item[key]
    return hashlib.sha256(json_text(content).encode("utf-8")).hexdigest()


def kept_sha256(model: ModelFile) -> str:
    """SHA-256 of what decides whether kept start readings and memory are still good: `equations_sha256` without signs.

    A correction that is turned round is that of the same displacement.
    """
    return equations_sha256(with_signs(model, lambda _: "correction = -displacement"))


def with_signs(model: ModelFile, sign: Callable[[Output], Sign]) -> ModelFile:
    """The model, and its fallbacks, with other signs of their corrections."""

    def signed(of: ModelFile | Fallback) -> tuple[Output, ...]:
        return tuple(output.model_copy(update={"sign": sign(output)}) for output in of.outputs)

    fallbacks = tuple(one.model_copy(update={"outputs": signed(one)}) for one in model.fallbacks)
    return model.model_copy(update={"outputs": signed(model), "fallbacks": fallbacks})


def _model_file_error(error: ValidationError, where: str) -> ModelFileError:
    errors = error.errors(include_url=False)
    # pydantic also counts an array as too short when one of its entries is bad
    errors = [
        one for one in errors if not (one["type"] == "too_short" and one["ctx"]["actual_length"] != len(one["input"]))
    ]
    first: dict[str, Any] = dict(errors[0])
    cause = first.get("ctx", {}).get("error")
    inner = cause.path if isinstance(cause, ContradictionError) else ()
    path = json_path([part for part in (*first["loc"], *inner) if part != "[key]"])
    if first["type"] == "missing":
        found, expected = f"no field {first['loc'][-1]!r}", "this field"
    elif first["type"] == "extra_forbidden":
        found, expected = f"unknown field with value {shown(first['input'])}", "only the fields of the schema"
    elif isinstance(cause, ContradictionError):
        found, expected = cause.found, cause.expected
    else:
        found, expected = (
            shown(first["input"]),
            JSON_KINDS.get(first["type"], first["msg"].removeprefix("Input should be ")),
        )
        if first["type"] == "string_pattern_mismatch":
            pattern = first["ctx"]["pattern"]
            is_name = pattern.startswith(_OF_NAMES)
            expected = "text without line ends and control characters" if is_name else f"text of the form {pattern}"
        for bound, word in (("min_length", "at least"), ("max_length", "at most")):
            if first["type"].endswith(("too_short", "too_long")) and bound in first["ctx"]:
                what = "characters" if first["type"].startswith("string") else "entries"
                expected = f"{word} {first['ctx'][bound]} {what}"
    more = "" if len(errors) == 1 else f" (and {len(errors) - 1} more)"
    return ModelFileError(f"{found}{more}", expected=expected, where=f"{where}, {path}", advice=_EXPORT_AGAIN)
