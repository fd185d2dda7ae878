"""What a diagnosis is asked, from the command line or from a study file, and the study file that it leaves."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from selector.cli.studying import OpenedStudy, recording_entries, write_study_beside

if TYPE_CHECKING:
    from selector.cli.source import Source
    from selector.readers import Reading


@dataclass(frozen=True)
class Asked:
    """The options of `diagnose`, one field an option."""

    simulation: list[Path] | None
    model: Path | None
    time_unit: str | None
    responses: list[str] | None
    holdout: str
    seed: int
    false_alarm: float


def asked_of(opened: OpenedStudy) -> Asked:
    """What the ``[diagnose]`` of a study asks.

    Raises
    ------
    StudyError
        It has none.
    """
    from selector.study import path_at
    from selector.study.asked import require_diagnose

    section = require_diagnose(opened.study, where=str(opened.place))
    return Asked(
        simulation=[path_at(path, opened.folder) for path in section.simulation] or None,
        model=None if section.model is None else path_at(section.model, opened.folder),
        time_unit=section.simulation_time_unit,
        responses=list(section.responses) or None,
        holdout=section.holdout,
        seed=section.seed,
        false_alarm=section.false_alarm,
    )


def write_diagnosis_study(
    folder: Path,
    out: Path,
    source: Source,
    asked: Asked,
    recorded: Reading,
    simulated: Reading | None,
    opened: OpenedStudy | None,
) -> list[str]:
    """study.toml of a diagnosis into a `folder` that holds its results and becomes `out`; the names written."""
    from selector.readers.files import recording_files
    from selector.study import diagnose_section, input_file

    files = recording_entries(out, source, [(run.file, run.sha256) for run in recorded.runs], recorded.machine_file)
    if simulated is not None and asked.simulation:
        known = {run.file: run.sha256 for run in simulated.runs}
        read = recording_files(asked.simulation).files
        files += [input_file(file, out, "simulation", known.get(str(file))) for file in read]
    if asked.model is not None:
        files.append(input_file(asked.model, out, "model"))
    section = diagnose_section(
        out,
        simulation=asked.simulation or (),
        model=asked.model,
        simulation_time_unit=asked.time_unit,
        responses=tuple(asked.responses or ()),
        holdout=asked.holdout,
        seed=asked.seed,
        false_alarm=asked.false_alarm,
    )
    return write_study_beside(folder, out, source, files, opened=opened, diagnose=section)
