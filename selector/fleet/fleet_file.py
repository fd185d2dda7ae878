"""FLEET.toml: which machines, what is asked of them, and where the answers lie."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from selector.errors import StudyError
from selector.fleet import places
from selector.study.asked import options_of
from selector.study.inputs import path_at
from selector.study.study_file import (
    LARGEST_FILE_BYTES,
    KeyPath,
    Name,
    Paths,
    ReadingSection,
    Recordings,
    SelectSection,
    Study,
    Table,
    checked,
    study_sections,
)
from selector.text_file import text_of

SCHEMA = "selector.fleet-file/1"
MOST_MACHINES = 100_000
_PAGE = "docs/reference/fleet.md"
Above0 = Annotated[float, Field(gt=0, allow_inf_nan=False)]


def _of_runs(value: Any) -> Any:
    """A machine of which only the recordings are said."""
    if isinstance(value, dict) and isinstance(value.get("runs"), str):
        return value | {"runs": [value["runs"]]}
    return {"runs": [value]} if isinstance(value, str) else {"runs": value} if isinstance(value, list) else value


class MachineSection(Table):
    """A machine: its recordings, and what is asked of it otherwise than of the others."""

    runs: Paths
    machine: KeyPath | None = None
    reading: ReadingSection = ReadingSection()
    select: SelectSection = SelectSection()


class FleetFile(Table):
    """A fleet file as it is written; `Fleet` is what it means."""

    schema_: Annotated[Literal["selector.fleet-file/1"], Field(alias="schema")] = "selector.fleet-file/1"
    results: KeyPath = "results"
    time_limit_s: Above0 = 3600.0
    memory_limit_gb: Above0 | None = None
    folders: Annotated[tuple[KeyPath, ...], Field(strict=False, max_length=MOST_MACHINES)] = ()
    machine: KeyPath | None = None
    reading: ReadingSection = ReadingSection()
    select: SelectSection = SelectSection()
    machines: Annotated[
        Mapping[Name, Annotated[MachineSection, BeforeValidator(_of_runs)]], Field(max_length=MOST_MACHINES)
    ] = Field(default_factory=dict)


@dataclass(frozen=True)
class Fleet:
    """Many machines and the question that each is asked."""

    place: Path  #: The fleet file
    results: Path  #: Folder of the answers, or what does as one behind a URL
    time_limit_s: float  #: Of one study [s]
    memory_limit_gb: float | None  #: Of a process of this computer [GB]
    studies: Mapping[str, Study]  #: Machine → what is asked of which recordings; paths are absolute, or URLs


def read_fleet(path: str | Path) -> Fleet:
    """The fleet of a file; its paths are relative to the folder of the file.

    Raises StudyError: the file cannot be read, has an unknown key or a value that cannot be, or names no machine.
    """
    place = Path(path)
    text = text_of(place, LARGEST_FILE_BYTES, lambda found: _unusable(found, str(place), "check the path"))
    where = str(place)
    said = checked(FleetFile, study_sections(text, "[machines] and [select]", where), where, _PAGE)
    # what is wrong for all is told before the start, what is wrong for one is told of that one
    options_of(Study(recordings=Recordings(runs=(".",)), select=said.select), where=where)
    studies: dict[str, Study] = {}
    for name, section in _machines(said, place):
        if name in studies:
            raise _unusable(f"two machines called {name!r}", where, "name them apart under [machines]")
        studies[name] = _study(said, section, place, f"{where}, machine {name}")
    if not studies:
        raise _unusable("no machine", where, 'add folders = ["plant/*"], or a table [machines] with name = "folder"')
    return Fleet(place, places.results_at(said.results, place.parent), said.time_limit_s, said.memory_limit_gb, studies)


def _machines(said: FleetFile, place: Path) -> Iterator[tuple[str, MachineSection]]:
    for pattern in said.folders:
        found = [_at(pattern, place)]
        if places.is_pattern(found[0]):
            own = _at(said.results, place).rstrip("/")
            found = [
                one for one in places.found_by(found[0]) if places.may_hold_recordings(one) and one.rstrip("/") != own
            ]
        if not found:
            raise _unusable(
                f"nothing that {places.without_password(pattern)!r} fits",
                f"{place}, key folders",
                "correct the pattern",
            )
        for one in found:  # may be called anything
            name = places.last_part(one)
            yield name, checked(MachineSection, {"runs": (one,)}, f"{place}, key folders, found {name!r}", _PAGE)
    yield from said.machines.items()


def _study(said: FleetFile, section: MachineSection, place: Path, where: str) -> Study:
    machine = section.machine or said.machine
    return Study(
        recordings=Recordings(
            runs=tuple(_at(run, place) for run in section.runs),
            machine=None if machine is None else _at(machine, place),
        ),
        reading=checked(ReadingSection, _said(said.reading) | _said(section.reading), f"{where}, [reading]", _PAGE),
        select=checked(SelectSection, _said(said.select) | _said(section.select), f"{where}, [select]", _PAGE),
    )


def _said(section: Table) -> dict[str, Any]:
    return section.model_dump(exclude_unset=True, by_alias=True)


def _at(reference: str, place: Path) -> str:
    return reference if places.is_url(reference) else str(path_at(reference, place.parent))


def _unusable(found: str, where: str, advice: str) -> StudyError:
    return StudyError(
        found,
        expected=f"a fleet file ({SCHEMA}): machines, [select], results",
        where=where,
        advice=f"{advice}; {_PAGE} explains every key",
    )
