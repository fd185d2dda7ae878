"""What a study asks, as the values that the reader, the selection and the diagnosis take, and back."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError

from selector import __version__
from selector.errors import InputError, OptionError, StudyError
from selector.readers import Overrides
from selector.selection.options import Options
from selector.study import study_file
from selector.study.inputs import listed_files, reference_to

_READING = tuple(study_file.ReadingSection.model_fields)
Section = TypeVar("Section")


def study_of(
    folder: str | Path,
    runs: Sequence[str | Path],
    *,
    machine: str | Path | None = None,
    overrides: Overrides | None = None,
    select: Options | study_file.SelectSection | None = None,
    diagnose: study_file.DiagnoseSection | None = None,
    export: study_file.ExportSection | None = None,
    files: Sequence[study_file.InputFile] = (),
    date: str | None = None,
    results: Mapping[str, str] | None = None,
) -> study_file.Study:
    """The study of some recordings, for a study file in `folder`; paths become relative to it.

    `runs` are files and folders, as the user named them, `files` what was read of them; `date` (YYYY-MM-DD) is that of
    the results, which are given as name of a file beside the study file → its SHA-256.
    """
    named = tuple(reference_to(run, folder) for run in runs)
    return study_file.Study(
        version=__version__,
        date=date,
        recordings=study_file.Recordings(
            runs=named, machine=None if machine is None else reference_to(machine, folder)
        ),
        reading=_made(study_file.ReadingSection, {name: getattr(overrides or Overrides(), name) for name in _READING}),
        select=select_section(select) if isinstance(select, Options) else select,
        diagnose=diagnose,
        export=export,
        files=listed_files(files),
        results=dict(results or {}),
    )


def select_section(options: Options) -> study_file.SelectSection:
    """``[select]`` of some options, every one of them written out: defaults may change, a study does not.

    Raises OptionError: an option cannot stand in a study file.
    """
    level: Any = "auto" if options.level is None else options.level
    return _made(
        study_file.SelectSection,
        {name: getattr(options, name) for name in study_file.SelectSection.model_fields if name != "lambda_"}
        | {"lambda": level},
    )


def options_of(study: study_file.Study, *, where: str = "study file") -> Options:
    """The options of ``[select]``; `where` names the study file in messages.

    Raises StudyError: there is no such table, or two options contradict each other.
    """
    if study.select is None:
        raise _without("select", study, where)
    asked = study.select
    values = {name: getattr(asked, name) for name in study_file.SelectSection.model_fields if name != "lambda_"}
    values |= {name: dict(values[name]) for name in ("cost", "conditions")}
    try:
        return Options(level=None if asked.lambda_ == "auto" else asked.lambda_, **values)
    except InputError as error:
        raise error.at(f"{where}, [select], {error.where}", StudyError) from error


def diagnose_section(
    folder: str | Path, *, simulation: Sequence[str | Path] = (), model: str | Path | None = None, **values: Any
) -> study_file.DiagnoseSection:
    """``[diagnose]`` for a study file in `folder`; further values under the names of `DiagnoseSection`.

    Raises OptionError: a value cannot stand in a study file.
    """
    paths = {
        "simulation": tuple(reference_to(path, folder) for path in simulation),
        "model": None if model is None else reference_to(model, folder),
    }
    return _made(study_file.DiagnoseSection, {**paths, **values})


def export_section(
    folder: str | Path, *, model: str | Path | None, replay: Sequence[str | Path] = (), **values: Any
) -> study_file.ExportSection:
    """``[export]`` for a study file in `folder`; further values under the names of `ExportSection`.

    Raises OptionError: a value cannot stand in a study file.
    """
    paths = {
        "model": None if model is None else reference_to(model, folder),
        "replay": tuple(reference_to(path, folder) for path in replay),
    }
    return _made(study_file.ExportSection, {**paths, **values})


def require_diagnose(study: study_file.Study, *, where: str = "study file") -> study_file.DiagnoseSection:
    """``[diagnose]``. Raises StudyError: there is no such table, or it names nothing to compare with."""
    if study.diagnose is None:
        raise _without("diagnose", study, where)
    return study.diagnose


def overrides_of(study: study_file.Study) -> Overrides:
    """What the user decides instead of the reader."""
    values = {name: getattr(study.reading, name) for name in _READING}
    return Overrides(**{**values, "units": dict(values["units"]), "roles": dict(values["roles"])})


def _made(section: Callable[..., Section], values: Mapping[str, Any]) -> Section:
    try:
        return section(**values)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        name = ".".join(map(str, first["loc"]))
        raise OptionError(
            f"{name} = {str(first['input'])[:80]!r}",
            expected=first["msg"].removeprefix("Input should be "),
            where="what is asked",
            advice="correct the value: a study file holds every option",
        ) from error


def _without(table: str, study: study_file.Study, where: str) -> StudyError:
    others = [name for name in ("select", "diagnose") if getattr(study, name) is not None]
    return StudyError(
        f"no table [{table}]" + (f"; there is [{others[0]}]" if others else ""),
        expected=f"a study of `selector {table}`",
        where=where,
        advice=f"use `selector {others[0]} --study`, or add a table [{table}]"
        if others
        else f"add a table [{table}]; it may be empty",
    )
