"""study.toml on disk: read with suspicion, written whole and always in the same bytes."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from selector.atomic_file import write_whole
from selector.errors import ModelFileError, StudyError
from selector.physics.model_mistakes import expected_text
from selector.physics.model_text import key_text, sections_of_text, shown
from selector.readers.names import closest
from selector.study.study_file import SCHEMA, Study
from selector.text_file import text_of

STUDY_FILE = "study.toml"
LARGEST_FILE_BYTES = 16_000_000
"""Ten thousand recordings with long paths take half of it."""

_HEAD = (
    "# What was asked of which recordings; `selector select --study` or `selector diagnose --study` does it again.\n"
    "# Paths are relative to this file: move it together with the recordings.\n"
)
_ASKED = ("select", "diagnose", "export")
_LEVEL = '"auto", a number from 0 to 1, or an array of one a round'
_ESCAPES = {'"': '\\"', "\\": "\\\\", "\n": "\\n", "\t": "\\t", "\r": "\\r", "\b": "\\b", "\f": "\\f"}


def study_place(path: str | Path) -> Path:
    """The study file that a path means: itself, or ``study.toml`` in a folder."""
    place = Path(path)
    return place / STUDY_FILE if place.is_dir() else place


def read_study(path: str | Path) -> Study:
    """The study in a file, or in the ``study.toml`` of a folder.

    Its paths are relative to that folder; `path_at` finds them.

    Raises
    ------
    StudyError
        The file cannot be read, is not TOML, is of another version, has an unknown key or a value that cannot be; the
        message has the key and the nearest known name.
    """
    place = study_place(path)
    text = text_of(place, LARGEST_FILE_BYTES, lambda found: _unreadable(found, place))
    return parsed_study(text, where=str(place))


def parsed_study(text: str, *, where: str = "study file") -> Study:
    """The study in a TOML text; `where` names it in messages. Errors as `read_study`."""
    try:
        values = sections_of_text(text, where=where, is_array=lambda name: name == "files")
    except ModelFileError as error:
        raise StudyError(
            error.found,
            expected=f'schema = "{SCHEMA}", then tables such as [recordings] and [select] with key = value lines',
            where=error.where,
            advice=error.advice,
        ) from None
    if values.get("schema") != SCHEMA:
        raise StudyError(
            f"schema {shown(values['schema'])}" if "schema" in values else "no key 'schema'",
            expected=f'schema = "{SCHEMA}"',
            where=f"{where}, key schema",
            advice="give a study file of this version, or use the version of selector that wrote it",
        )
    try:
        return Study.model_validate(values)
    except ValidationError as error:
        raise _invalid(error, where) from None


def study_text(study: Study) -> str:
    """The TOML text of a study: keys in the order of the schema, the same for equal studies."""
    values = study.model_dump(mode="python", by_alias=True, exclude_none=True)
    files = values.pop("files")
    # what came out stands last but for the files, which may be many
    lines = [_HEAD, *_lines_of((), values)]
    for file in files:
        lines += ["", "[[files]]", *(f"{key} = {_toml(value)}" for key, value in file.items())]
    return "\n".join(lines) + "\n"


def write_study(study: Study, path: str | Path) -> None:
    """Write a study file, whole or not at all.

    Raises
    ------
    OptionError
        Nothing can be written at this path.
    """
    write_whole(Path(path), study_text(study).encode("utf-8"))


def _lines_of(key: tuple[str, ...], values: Mapping[str, Any]) -> Iterator[str]:
    """The lines of a table and of those inside; what is empty and inside of another is left out."""
    for name, value in values.items():
        if not isinstance(value, Mapping):
            yield f"{_key(name)} = {_toml(value)}"
    for name, value in values.items():
        if isinstance(value, Mapping) and (name in _ASKED or any(one != {} for one in value.values())):
            inner = (*key, _key(name))
            yield ""
            yield f"[{'.'.join(inner)}]"
            yield from _lines_of(inner, value)


def _key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else _toml(name)


def _toml(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_toml(one) for one in value) + "]"
    if isinstance(value, int | float):
        return repr(value)
    signs = (_ESCAPES.get(c) or (c if c.isprintable() or ord(c) > 0x9F else f"\\u{ord(c):04x}") for c in str(value))
    return f'"{"".join(signs)}"'


def _unreadable(found: str, place: Path) -> StudyError:
    return StudyError(
        found,
        expected=f"a study file ({SCHEMA}), or a folder with {STUDY_FILE} in it",
        where=str(place),
        advice=f"check the path; `selector select RUN... --out DIR` writes DIR/{STUDY_FILE}",
    )


def _invalid(error: ValidationError, where: str) -> StudyError:
    """The first thing that is wrong, unknown keys before others."""
    problems: list[Any] = error.errors(include_url=False)
    rank = {"extra_forbidden": 0, "missing": 2}
    first, *others = sorted(problems, key=lambda one: rank.get(one["type"], 1))
    key = _key_of(first["loc"])
    elsewhere = list(dict.fromkeys(key_text(_key_of(one["loc"])) for one in others if _key_of(one["loc"]) != key))
    more = f" (also wrong: {', '.join(elsewhere[:8])})" if elsewhere else ""
    place = f"{where}, key {key_text(key)}"
    if first["type"] == "extra_forbidden":
        known = _known_keys(key[:-1])
        near = closest(str(key[-1]), known)
        return StudyError(
            f"unknown key {shown(key[-1])}{more}",
            expected=(f"{near!r} perhaps; " if near else "") + "one of " + ", ".join(known),
            where=place,
            advice="correct the spelling, or remove it; docs/reference/study.md explains every key",
        )
    if first["type"] == "missing":
        return StudyError(
            f"no {shown(key[-1])}{more}",
            expected="this key",
            where=place,
            advice="add it; docs/reference/study.md explains every key",
        )
    return StudyError(
        f"{key_text(key[-1:]) or key_text(key)} = {shown(first['input'])}{more}",
        expected=_expected(key, first),
        where=place,
        advice="correct this value; docs/reference/study.md explains it",
    )


def _expected(key: tuple[str | int, ...], problem: Mapping[str, Any]) -> str:
    if key[-1] == "lambda":
        return _LEVEL
    if problem["type"] == "string_pattern_mismatch":
        return "a date as YYYY-MM-DD" if key[-1] == "date" else "a SHA-256: 64 hexadecimal digits, 0-9 and a-f"
    return expected_text(problem)


def _key_of(location: tuple[str | int, ...]) -> tuple[str | int, ...]:
    """The key of a problem: what follows ``lambda`` are the forms that were tried."""
    parts = list(location)
    if "lambda" in parts:
        del parts[parts.index("lambda") + 1 :]
    return tuple(part for part in parts if part != "[key]")


def _known_keys(key: tuple[str | int, ...]) -> list[str]:
    section: type[BaseModel] = Study
    for part in key:
        if isinstance(part, int):
            continue
        kinds = [section.model_fields[part].annotation] if part in section.model_fields else []
        section = next(_sections_in(kinds), section)
    return [field.alias or name for name, field in section.model_fields.items()]


def _sections_in(annotations: list[Any]) -> Iterator[type[BaseModel]]:
    for annotation in annotations:
        if isinstance(annotation, type) and issubclass(annotation, BaseModel):
            yield annotation
        else:
            yield from _sections_in(list(get_args(annotation)))
