"""study.toml as values: the recordings by reference, how they are read, what is asked of them, and what came out."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from selector.selection.options import MAX_ROUNDS

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


Path = Annotated[str, Field(min_length=1, max_length=4096), AfterValidator(_usable_path)]
FileName = Annotated[str, Field(min_length=1, max_length=255), AfterValidator(_file_name)]
Sha256 = Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
Name = Annotated[str, Field(min_length=1, max_length=1000)]
Names = Annotated[tuple[Name, ...], Field(strict=False, max_length=MOST_FILES)]
Paths = Annotated[tuple[Path, ...], Field(strict=False, min_length=1, max_length=MOST_FILES)]
Share = Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)]
Shares = Annotated[tuple[Share, ...], Field(strict=False, min_length=1, max_length=MAX_ROUNDS)]
NonNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Limit = Annotated[float, Field(gt=0, lt=1e6, allow_inf_nan=False)]
Seed = Annotated[int, Field(ge=0, lt=_LARGEST_INTEGER)]
Kind = Literal["recording", "machine", "simulation", "model"]


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, populate_by_name=True)


class Recordings(_Section):
    """``[recordings]``: what was named, files and folders; a folder stands for the recordings in it."""

    runs: Paths
    machine: Path | None = None


class ReadingSection(_Section):
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
    units: Mapping[Name, Name] = Field(default_factory=dict)
    roles: Mapping[Name, Name] = Field(default_factory=dict)


class SelectSection(_Section):
    """``[select]``: the options of `selector.selection.Options` under the same names."""

    responses: Names = ()
    lambda_: Annotated[
        Literal["auto"]
        | Share
        | Annotated[tuple[Share, ...], Field(strict=False, min_length=1, max_length=MAX_ROUNDS)],
        Field(alias="lambda"),
    ] = "auto"
    rounds: Annotated[int, Field(ge=1, le=MAX_ROUNDS)] = 1
    max_sensors: Annotated[int, Field(ge=1, le=MOST_FILES)] = 5
    degree: Annotated[int, Field(ge=1, le=3)] = 1
    interactions: bool = False
    memory: bool = False
    reference: Literal["rise", "absolute"] = "rise"
    absolute_similarity: bool = False
    must: Names = ()
    never: Names = ()
    cost: Mapping[Name, NonNegative] = Field(default_factory=dict)
    tolerance: NonNegative | None = None
    ridge: bool = False
    conditions: Mapping[Name, Name] = Field(default_factory=dict)
    seed: Seed = 0


class DiagnoseSection(_Section):
    """``[diagnose]``: what the recordings are compared with, and the options of `selector diagnose`."""

    simulation: Annotated[tuple[Path, ...], Field(strict=False, max_length=MOST_FILES)] = ()
    model: Path | None = None
    simulation_time_unit: Name | None = None
    responses: Names = ()
    holdout: Name = "last"
    seed: Seed = 0
    false_alarm: Annotated[float, Field(gt=0, le=0.2, allow_inf_nan=False)] = 0.02


class ExportSection(_Section):
    """``[export]``: the model, the control, and the options of `selector export`, which the workbench takes up again.

    That a sign test was passed is not kept: it is said anew for every program.
    """

    model: Path | None = None
    target: Name = "c"
    replay: Annotated[tuple[Path, ...], Field(strict=False, max_length=MOST_FILES)] = ()
    clamp: Mapping[Name, Limit] = Field(default_factory=dict)
    slew: Mapping[Name, Limit] = Field(default_factory=dict)
    invert: Names = ()


class InputFile(_Section):
    """``[[files]]``: one file that was read, and what it held then.

    Attributes
    ----------
    path : str
        Relative to the folder of the study file where that is possible, with ``/`` between folders.
    sha256 : str
        Of its bytes, 64 hexadecimal digits.
    kind : {"recording", "machine", "simulation", "model"}
    """

    path: Path
    sha256: Sha256
    kind: Kind = "recording"


class Study(_Section):
    """A study file.

    Attributes
    ----------
    schema_ : str
        ``"selector.study/1"``; the key is `schema`.
    version : str
        Of the program that wrote the file; another one may give other bytes.
    date : str or None
        As it stands in the results; the clock is never read.
    recordings : Recordings
    reading : ReadingSection
    select : SelectSection or None
    diagnose : DiagnoseSection or None
    export : ExportSection or None
    files : tuple of InputFile
        In the order in which they were read.
    results : mapping of str to str
        Name of a file beside the study file → SHA-256 of what was written there.
    """

    schema_: Annotated[Literal["selector.study/1"], Field(alias="schema")] = "selector.study/1"
    version: Annotated[str, Field(max_length=100)] = ""
    date: Annotated[str, Field(pattern=r"^\d{4}-\d{2}-\d{2}$")] | None = None
    recordings: Recordings
    reading: ReadingSection = ReadingSection()
    select: SelectSection | None = None
    diagnose: DiagnoseSection | None = None
    export: ExportSection | None = None
    files: Annotated[tuple[InputFile, ...], Field(strict=False, max_length=MOST_FILES)] = ()
    results: Mapping[FileName, Sha256] = Field(default_factory=dict)


def study_json_schema() -> dict[str, Any]:
    """The closed JSON Schema (draft 2020-12) of the study file, as shipped in ``schema/selector.study-1.json``."""
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "$id": "urn:selector:study:1"}
    return head | Study.model_json_schema(by_alias=True)
