"""Model files on disk: read with suspicion, written whole and always in the same bytes."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from selector.atomic_file import write_whole
from selector.controllers.model_file import SCHEMA, ContradictionError, ModelFile, Output, Sign
from selector.controllers.strict_json import json_path, json_text, parsed_json, shown
from selector.errors import ModelFileError
from selector.text_file import text_of

LARGEST_FILE_BYTES = 16_000_000
"""A model of 37 sensors with all pair products and 37 fallbacks takes half of it."""

_EXPECTED = {
    "model_type": "an object",
    "dict_type": "an object",
    "tuple_type": "an array",
    "float_type": "a number",
    "int_type": "an integer",
    "string_type": "a text",
    "string_unicode": "a text of whole characters",
}
# of the pattern of names; hashes and dates have others
_OF_NAMES = "^[^"

_EXPORT_AGAIN = "correct this place, or export the model again"


def read_model(path: str | Path) -> ModelFile:
    """The model in a file.

    Raises
    ------
    ModelFileError
        The file cannot be read, is too large, is cut off, is of another version or does not follow the schema; the
        message has the JSON path and the value.
    """
    place = Path(path)

    def refused(found: str) -> ModelFileError:
        return ModelFileError(
            found,
            expected=f"a model file ({SCHEMA}), JSON text of at most {LARGEST_FILE_BYTES // 1_000_000} MB in UTF-8",
            where=str(place),
            advice="check the path; `selector select --out DIR` writes DIR/model.json, and no editor may change its "
            "encoding",
        )

    text = text_of(place, LARGEST_FILE_BYTES, refused)
    return parsed_model(text, where=str(place))


def parsed_model(text: str, *, where: str = "model") -> ModelFile:
    """The model in a JSON text; `where` names the text in messages.

    Raises
    ------
    ModelFileError
        As `read_model`.
    """
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
        return ModelFile.model_validate(value)
    except ValidationError as error:
        raise _model_file_error(error, where) from None


def model_text(model: ModelFile) -> str:
    """The JSON text of a model: field order of the schema, shortest float text, the same for equal models."""
    return json_text(model.model_dump(by_alias=True)) + "\n"


def write_model(model: ModelFile, path: str | Path) -> None:
    """Write a model file, whole or not at all.

    Raises
    ------
    OptionError
        Nothing can be written at this path.
    """
    write_whole(Path(path), model_text(model).encode("utf-8"))


def model_sha256(model: ModelFile) -> str:
    """SHA-256 of the bytes that `write_model` writes, 64 hexadecimal digits."""
    return hashlib.sha256(model_text(model).encode("utf-8")).hexdigest()


def equations_sha256(model: ModelFile) -> str:
    """SHA-256 of what a control computes and keeps: inputs, memory, outputs, fallbacks.

    Limits, checks of readings, provenance, validation and test vectors are no part of it: start readings that a
    control kept are as good with another clamp.
    """
    left_out = {"schema_", "name", "guard", "provenance", "validation", "test_vectors"}
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
    against: Sign = "correction = -displacement"

    def unsigned(of: Sequence[Output]) -> tuple[Output, ...]:
        return tuple(output.model_copy(update={"sign": against}) for output in of)

    fallbacks = tuple(one.model_copy(update={"outputs": unsigned(one.outputs)}) for one in model.fallbacks)
    return equations_sha256(model.model_copy(update={"outputs": unsigned(model.outputs), "fallbacks": fallbacks}))


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
            _EXPECTED.get(first["type"], first["msg"].removeprefix("Input should be ")),
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
