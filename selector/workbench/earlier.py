"""Whether an answer in the study folder was asked as the form asks now: by the study file that lies beside it."""

from __future__ import annotations

from pathlib import Path

from selector.errors import InputError
from selector.readers import Overrides
from selector.selection import Options
from selector.study import STUDY_FILE, SelectSection, overrides_of, path_at, read_study, select_section
from selector.workbench.typed import FIELDS


def other_than_asked(answer: Path, options: Options, overrides: Overrides, runs: tuple[Path, ...]) -> tuple[str, ...]:
    """What is asked otherwise now than when the selection in the folder `answer` was made, in the words of the fields.

    Nothing where it was asked the same, or where no study file lies there.
    """
    try:
        study = read_study(answer / STUDY_FILE)
    except InputError:
        return ()
    then, now = study.select, select_section(options)
    if then is None:
        return ()
    fields = [name for name in SelectSection.model_fields if getattr(then, name) != getattr(now, name)]
    found = [_title(name) for name in fields]
    if {path_at(run, answer).resolve() for run in study.recordings.runs} != {run.resolve() for run in runs}:
        found.append("the recordings")
    if overrides_of(study) != overrides:
        found.append("how they are read")
    return tuple(found)


def _title(name: str) -> str:
    if name == "responses":
        return FIELDS["--response"]
    return FIELDS.get(f"--{name.strip('_').replace('_', '-')}", name)
