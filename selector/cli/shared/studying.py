"""How does a command take its question from a study file, and leave one beside its answer."""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from selector.cli.shared.option_table import option
from selector.cli.shared.source import Source
from selector.errors import Misfit, OptionError, refuse

if TYPE_CHECKING:
    from rich.console import Console

    from selector.selection.options import Options
    from selector.study import DiagnoseSection, InputFile, Study

STUDY = "--study"
#: What may be said together with a study; all else is in it.
BESIDE_STUDY = frozenset({"from_study", "accept_changes", "out", "everything", "as_json"})

StudyPath = Annotated[Path | None, option("study --study")]
AcceptChanges = Annotated[bool, option("study --accept-changes")]


@dataclass(frozen=True)
class OpenedStudy:
    """A study that was read and whose files were looked at."""

    study: Study
    place: Path
    source: Source

    @property
    def folder(self) -> Path:
        """The folder of the study file."""
        return self.place.parent


def opened_study(
    path: Path | None, source: Source, context: typer.Context, *, accept_changes: bool, console: Console
) -> OpenedStudy | None:
    """The study that a command line names; None if it names recordings.

    Raises InputError: it names neither or both, the study file cannot be used, or its files have changed and that is
    not accepted.
    """
    if path is None:
        refuse(_lacking(source, context, accept_changes), OptionError)
        return None
    _refuse_beside_study(context, BESIDE_STUDY)
    from selector.study import change_words, changes, read_study, require_unchanged, study_place

    place = study_place(path)
    study = read_study(place)
    if not accept_changes:
        require_unchanged(study, place)
    found = changes(study, place.parent) if accept_changes else ()
    if found:
        console.print(f"accepted: {change_words(found)}", markup=False)
    return OpenedStudy(study, place, source_of_study(study, place.parent))


def write_study_beside(
    folder: Path,
    out: Path,
    source: Source,
    files: Sequence[InputFile],
    *,
    opened: OpenedStudy | None,
    select: Options | None = None,
    diagnose: DiagnoseSection | None = None,
    date: str | None = None,
) -> list[str]:
    """study.toml into a `folder` that holds results and becomes `out`; the names of what was written.

    In the place of the study that was done again its other question stays.
    """
    from selector.study import STUDY_FILE, study_of, write_study

    asked = study_of(
        out,
        source.runs,
        machine=source.machine,
        overrides=source.overrides(),
        select=select,
        diagnose=diagnose,
        files=files,
        date=date,
        results=hashes(folder),
    )
    if opened is not None and out.exists() and out.samefile(opened.folder):
        asked = _with_other_question(asked, opened.study)
    write_study(asked, folder / STUDY_FILE)
    return [STUDY_FILE]


@contextmanager
def told_if_no_text(console: Console) -> Iterator[None]:
    """A study file that cannot be written because a file is named so that TOML cannot say it is told and left out."""
    try:
        yield
    except UnicodeEncodeError:
        console.print("no study.toml: the name of a file or folder is no text, and TOML holds only text")


def recording_entries(
    out: Path, source: Source, read: Iterable[tuple[str, str]], machine_file: str | None
) -> list[InputFile]:
    """The machine file and the recordings as the study file of `out` lists them; `read` are path and SHA-256."""
    from selector.readers.files import recording_files
    from selector.study import input_file

    known = dict(read)
    first = [] if machine_file is None else [input_file(machine_file, out, "machine")]
    found = recording_files(source.runs).files
    return [*first, *(input_file(file, out, "recording", known.get(str(file))) for file in found)]


def _with_other_question(asked: Study, before: Study) -> Study:
    kinds = {file.kind for file in asked.files}
    return asked.model_copy(
        update={
            "select": asked.select or before.select,
            "diagnose": asked.diagnose or before.diagnose,
            "files": (*asked.files, *(file for file in before.files if file.kind not in kinds)),
            "results": {**before.results, **asked.results},
        }
    )


def hashes(folder: Path) -> dict[str, str]:
    """Name → SHA-256 of the files in a folder."""
    return {
        path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in sorted(folder.iterdir()) if path.is_file()
    }


def repeated_words(study: Study, found: Mapping[str, str]) -> str:
    """Whether the results are again what the study recorded, in a sentence; empty if it recorded none."""
    from selector import __version__

    known = {name: sha256 for name, sha256 in study.results.items() if name in found}
    if not known:
        return ""
    others = [name for name, sha256 in known.items() if found[name] != sha256]
    same = [name for name in known if name not in others]
    told = f"the same bytes as the study recorded: {', '.join(same)}" if same else ""
    if others:
        by = f" (written by selector {study.version}, this is {__version__})" if study.version != __version__ else ""
        told += f"{'; ' if told else ''}other bytes than the study recorded: {', '.join(others)}{by}"
    return told


def _lacking(source: Source, context: typer.Context, accept_changes: bool) -> Iterator[Misfit]:
    if accept_changes:
        found, advice = "--accept-changes without --study", f"add {STUDY} STUDY, or leave --accept-changes out"
        yield found, "a study whose recordings may have changed", "command line", advice
    if not source.runs:
        expected = f"{context.command_path} [OPTIONS] RUN..., or {STUDY} STUDY"
        advice = f"correct the command; `{context.command_path} --help` lists its options"
        yield "Missing argument 'RUN...'.", expected, "command line", advice


def _refuse_beside_study(context: typer.Context, allowed: Collection[str]) -> None:
    """Ends with an error when an option stands beside --study that the study itself answers."""
    asked = [part for part in context.command.params if part.name not in allowed]
    # typer brings its own click, so the enumeration has no stable place
    sources = [getattr(context.get_parameter_source(part.name or ""), "name", "DEFAULT") for part in asked]
    given = [part for part, one in zip(asked, sources, strict=True) if one not in ("DEFAULT", "DEFAULT_MAP")]
    if given:
        first = given[0]
        name = "RUN..." if first.param_type_name == "argument" else first.opts[0]
        more = f" (and {len(given) - 1} more)" if len(given) > 1 else ""
        raise OptionError(
            f"{name} beside {STUDY}{more}",
            expected=f"{STUDY} alone, or with --out, --json and --accept-changes: the study says the rest",
            where="command line",
            advice=f"change it in the study file, or leave {STUDY} out and say everything here",
        )


def source_of_study(study: Study, folder: Path) -> Source:
    """What the command line would say about the recordings of a study in `folder`."""
    from selector.study import path_at
    from selector.study.inputs import present

    named = study.recordings.machine
    return Source(
        runs=list(present(study, folder)),
        machine=None if named is None else path_at(named, folder),
        **study.reading.model_dump(exclude={"units", "roles"}),
        units=_as_options(study.reading.units),
        roles=_as_options(study.reading.roles),
    )


def _as_options(values: Mapping[str, Any]) -> list[str] | None:
    return [f"{name}={value}" for name, value in values.items()] or None
