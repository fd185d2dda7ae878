"""study.toml as values and on disk: the recordings by reference, how they are read, what is asked."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from selector.atomic_file import write_whole
from selector.errors import ModelFileError, StudyError
from selector.physics.model_text import invalid, sections_of_text, shown
from selector.selection.options import MAX_ROUNDS, MAX_SENSORS
from selector.text_file import text_of, toml_key, toml_value

SCHEMA = "selector.study/1"
MOST_FILES = 10_000
_LARGEST_INTEGER = 2**53


def _usable_path(text: str) -> str:
    if not text.strip() or "\0" in text:
        raise ValueError("a path such as recordings/r1.csv")
    return text


def _file_name(text: str) -> str:
    if text in (".", "..") or not text.isprintable() or set(text) & set('/\\:*?"<>|'):
        raise ValueError("the name of a file beside the study file")
    return text


KeyPath = Annotated[str, Field(min_length=1, max_length=4096), AfterValidator(_usable_path)]
FileName = Annotated[str, Field(min_length=1, max_length=255), AfterValidator(_file_name)]
_SHA256, _DATE, FOLDER = "^[0-9a-f]{64}$", r"^\d{4}-\d{2}-\d{2}$", r"^[\w][\w.-]{0,99}$"
_FORMS = {
    _SHA256: "a SHA-256: 64 hexadecimal digits, 0-9 and a-f",
    _DATE: "a date as YYYY-MM-DD",
    FOLDER: "letters, digits, . _ and - without blanks, as of a folder, 100 at most",
}
Sha256 = Annotated[str, Field(pattern=_SHA256)]
FolderName = Annotated[str, Field(pattern=FOLDER)]
Name = Annotated[str, Field(min_length=1, max_length=1000)]
Names = Annotated[tuple[Name, ...], Field(strict=False, max_length=MOST_FILES)]
Paths = Annotated[tuple[KeyPath, ...], Field(strict=False, min_length=1, max_length=MOST_FILES)]
Share = Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)]
NonNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Limit = Annotated[float, Field(gt=0, lt=1e6, allow_inf_nan=False)]
Seed = Annotated[int, Field(ge=0, lt=_LARGEST_INTEGER)]
Kind = Literal["recording", "machine", "simulation", "model"]

Checked = TypeVar("Checked", bound=BaseModel)


class Table(BaseModel):
    """A table of a file that a person writes: closed, and as strict as TOML is."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, populate_by_name=True)


class Recordings(Table):
    """``[recordings]``: what was named, files and folders; a folder stands for the recordings in it."""

    runs: Paths
    machine: KeyPath | None = None


class ReadingSection(Table):
    """``[reading]``: what the user decides instead of the reader; the same as the options of that name."""

    encoding: Name | None = None
    separator: Name | None = None
    decimal: Name | None = None
    header_row: Annotated[int, Field(ge=0, lt=_LARGEST_INTEGER)] | None = None
    sheet: Name | None = None
    time_column: Name | None = None
    time_unit: Name | None = None
    date_order: Literal["dmy", "mdy", "ymd"] | None = None
    period_s: Annotated[float, Field(gt=0, allow_inf_nan=False)] | None = None
    since: Name | None = None
    until: Name | None = None
    mean_s: Annotated[float, Field(gt=0, allow_inf_nan=False)] | None = None
    units: Mapping[Name, Name] = Field(default_factory=dict)
    roles: Mapping[Name, Name] = Field(default_factory=dict)


class SelectSection(Table):
    """``[select]``: the options of `selector.selection.Options` under the same names."""

    responses: Names = ()
    lambda_: Annotated[
        Literal["auto"]
        | Share
        | Annotated[tuple[Share, ...], Field(strict=False, min_length=1, max_length=MAX_ROUNDS)],
        Field(alias="lambda"),
    ] = "auto"
    rounds: Annotated[int, Field(ge=1, le=MAX_ROUNDS)] = 1
    max_sensors: Annotated[int, Field(ge=1, le=MAX_SENSORS)] = 5
    degree: Annotated[int, Field(ge=1, le=3)] = 1
    interactions: bool = False
    memory: bool = False
    reference: Literal["rise", "absolute"] = "rise"
    grouping: Literal["closure", "cmeans"] = "closure"
    absolute_similarity: bool = False
    must: Names = ()
    never: Names = ()
    cost: Mapping[Name, NonNegative] = Field(default_factory=dict)
    tolerance: NonNegative | None = None
    ridge: bool = False
    conditions: Mapping[Name, Name] = Field(default_factory=dict)
    seed: Seed = 0
    formula: Annotated[str, Field(min_length=1, max_length=4000)] | None = None
    within: NonNegative | None = None
    target: Annotated[float, Field(gt=0, allow_inf_nan=False)] | None = None


class DiagnoseSection(Table):
    """``[diagnose]``: what the recordings are compared with, and the options of `selector diagnose`."""

    simulation: Annotated[tuple[KeyPath, ...], Field(strict=False, max_length=MOST_FILES)] = ()
    model: KeyPath | None = None
    simulation_time_unit: Name | None = None
    responses: Names = ()
    holdout: Name = "last"
    seed: Seed = 0
    false_alarm: Annotated[float, Field(gt=0, le=0.2, allow_inf_nan=False)] = 0.02


class ExportSection(Table):
    """``[export]``: the model, the control, and the options of `selector export`, which the workbench takes up again.

    That a sign test was passed is not kept: it is said anew for every program.
    """

    model: KeyPath | None = None
    target: Name = "c"
    replay: Annotated[tuple[KeyPath, ...], Field(strict=False, max_length=MOST_FILES)] = ()
    clamp: Mapping[Name, Limit] = Field(default_factory=dict)
    slew: Mapping[Name, Limit] = Field(default_factory=dict)
    margin: Annotated[float, Field(ge=0, le=100, allow_inf_nan=False)] | None = None
    invert: Names = ()


class InputFile(Table):
    """``[[files]]``: one file that was read, and what it held then.

    `path` is relative to the folder of the study file where that is possible, with ``/`` between folders.
    """

    path: KeyPath
    sha256: Sha256
    kind: Kind = "recording"


class Study(Table):
    """A study file.

    `version` is that of the program that wrote it; another one may give other bytes. `date` is as it stands in the
    results; the clock is never read. `files` are in the order in which they were read; `results`: name of a file beside
    the study file → SHA-256 of what was written there.
    """

    schema_: Annotated[Literal["selector.study/1"], Field(alias="schema")] = "selector.study/1"
    version: Annotated[str, Field(max_length=100)] = ""
    date: Annotated[str, Field(pattern=_DATE)] | None = None
    recordings: Recordings
    reading: ReadingSection = ReadingSection()
    select: SelectSection | None = None
    diagnose: DiagnoseSection | None = None
    export: ExportSection | None = None
    files: Annotated[tuple[InputFile, ...], Field(strict=False, max_length=MOST_FILES)] = ()
    results: Mapping[FileName, Sha256] = Field(default_factory=dict)


STUDY_FILE = "study.toml"
LARGEST_FILE_BYTES = 16_000_000  #: Ten thousand recordings with long paths take half of it.

_HEAD = (
    "# What was asked of which recordings; `selector select --study` or `selector diagnose --study` does it again.\n"
    "# Paths are relative to this file: move it together with the recordings.\n"
)
_ASKED = ("select", "diagnose", "export")
_LEVEL = '"auto", a number from 0 to 1, or an array of one a round'


def study_place(path: str | Path) -> Path:
    """The study file that a path means: itself, or ``study.toml`` in a folder."""
    place = Path(path)
    return place / STUDY_FILE if place.is_dir() else place


def read_study(path: str | Path) -> Study:
    """The study in a file, or in the ``study.toml`` of a folder.

    Its paths are relative to that folder; `path_at` finds them.

    Raises StudyError: the file cannot be read, is not TOML, is of another version, has an unknown key or a value that
    cannot be; the message has the key and the nearest known name.
    """
    place = study_place(path)
    where, expected = str(place), f"a study file ({SCHEMA}), or a folder with {STUDY_FILE} in it"
    advice = f"check the path; `selector select RUN... --out DIR` writes DIR/{STUDY_FILE}"

    def refused(found: str) -> StudyError:
        return StudyError(found, expected=expected, where=where, advice=advice)

    return parsed_study(text_of(place, LARGEST_FILE_BYTES, refused), where=where)


def parsed_study(text: str, *, where: str = "study file") -> Study:
    """The study in a TOML text; `where` names it in messages. Errors as `read_study`."""
    values = study_sections(text, "[recordings] and [select]", where)
    if values.get("schema") != SCHEMA:
        raise StudyError(
            f"schema {shown(values['schema'])}" if "schema" in values else "no key 'schema'",
            expected=f'schema = "{SCHEMA}"',
            where=f"{where}, key schema",
            advice="give a study file of this version, or use the version of selector that wrote it",
        )
    return checked(Study, values, where, "docs/reference/study.md")


def study_sections(text: str, tables: str, where: str) -> dict[str, Any]:
    """The tables of a TOML text; `tables` names some of those that are expected. Raises StudyError: it is not TOML."""
    try:
        return sections_of_text(text, where=where)
    except ModelFileError as error:
        raise StudyError(
            error.found,
            expected=f"tables such as {tables} with key = value lines",
            where=error.where,
            advice=error.advice,
        ) from None


def checked(kind: type[Checked], values: Mapping[str, Any], where: str, page: str) -> Checked:
    """The values of a file as its kind; `page` explains its keys.

    Raises StudyError: an unknown key, a missing one, or a value that cannot be.
    """
    try:
        return kind.model_validate(values)
    except ValidationError as error:
        refused = invalid(_problems(error), kind, where, page)
        raise refused.at(refused.where, StudyError) from None


def study_text(study: Study) -> str:
    """The TOML text of a study: keys in the order of the schema, the same for equal studies."""
    values = study.model_dump(mode="python", by_alias=True, exclude_none=True)
    files = values.pop("files")
    # what came out stands last but for the files, which may be many
    lines = [_HEAD, *_lines_of((), values)]
    for file in files:
        lines += ["", "[[files]]", *(f"{key} = {toml_value(value)}" for key, value in file.items())]
    return "\n".join(lines) + "\n"


def write_study(study: Study, path: str | Path) -> None:
    """Write a study file, whole or not at all. Raises OptionError: nothing can be written at this path."""
    write_whole(Path(path), study_text(study).encode("utf-8"))


def _lines_of(key: tuple[str, ...], values: Mapping[str, Any]) -> Iterator[str]:
    """The lines of a table and of those inside; what is empty and inside of another is left out."""
    for name, value in values.items():
        if not isinstance(value, Mapping):
            yield f"{toml_key(name)} = {toml_value(value)}"
    for name, value in values.items():
        if isinstance(value, Mapping) and (name in _ASKED or any(one != {} for one in value.values())):
            inner = (*key, toml_key(name))
            yield ""
            yield f"[{'.'.join(inner)}]"
            yield from _lines_of(inner, value)


def _problems(error: ValidationError) -> Iterator[dict[str, Any]]:
    """What pydantic found, in the words of such a file; forms that were tried of one value are one problem."""
    told: set[tuple[Any, ...]] = set()
    for one in error.errors(include_url=False):
        problem: dict[str, Any] = {**one}
        place = problem["loc"]
        pattern = problem.get("ctx", {}).get("pattern")
        if "lambda" in place:
            problem |= {"loc": place[: place.index("lambda") + 1], "type": "no_level", "msg": _LEVEL}
        elif pattern in _FORMS:
            problem |= {"type": "no_form", "msg": _FORMS[pattern]}
        if problem["loc"] not in told:
            told.add(problem["loc"])
            yield problem
