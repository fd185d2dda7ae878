"""Results on disk, read with suspicion: which kind they are, and their content."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError

from selector.controllers.strict_json import JSON_KINDS, json_path, parsed_json, shown
from selector.errors import InputError, ModelFileError, ResultError
from selector.text_file import shell_word, text_of

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
