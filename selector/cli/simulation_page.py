"""What stands on the page of a simulation: the model, its time constants, and the field at a chosen moment."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from selector.cli.simulation_files import require_page_place
from selector.errors import OptionError
from selector.findings import Finding

if TYPE_CHECKING:
    from selector.physics.thermal.laws import Conditions
    from selector.physics.thermal.model_file import ModelFile
    from selector.physics.thermal.thermal_model import FileModel
    from selector.recording import Recording
    from selector.report.simulation_report import SimulationPage

Report = Annotated[
    Path | None,
    typer.Option(
        "--report", metavar="REPORT.html", help="Also write a page: courses, heat balance, the field machine's picture."
    ),
]
PictureAt = Annotated[
    float | None,
    typer.Option(
        "--picture-at-min",
        metavar="MIN",
        help="When the picture of a field machine is taken. Default: at the largest displacement.",
    ),
]


def require_page_options(file: ModelFile, report: Path | None, picture_at_min: float | None) -> None:
    """Find out before long work whether the page can be written and has a picture.

    Raises
    ------
    OptionError
        The name does not end in .html, its place cannot be written to, or a time is given and no picture will be made.
    """
    if report is not None:
        require_page_place(report)
    if picture_at_min is None:
        return
    if report is None or file.model.kind != "field":
        what = "without --report" if report is None else f"for a model of the kind {file.model.kind}"
        raise OptionError(
            f"--picture-at-min {what}",
            expected="a field machine and a report that shows it",
            where="--picture-at-min",
            advice="add --report REPORT.html" if report is None else "leave --picture-at-min out",
        )
    if not (math.isfinite(picture_at_min) and picture_at_min >= 0):
        raise OptionError(
            f"{picture_at_min:g}", expected="minutes from the start of the run, 0 or more", where="--picture-at-min",
            advice="e.g. --picture-at-min 120",
        )  # fmt: skip


def page_of(
    machine: FileModel,
    simulated: Recording,
    findings: tuple[Finding, ...],
    conditions: Callable[[str], Conditions],
    model: Path,
    picture_at_min: float | None,
) -> SimulationPage:
    """Everything that the page shows; of a field machine the picture at this minute, or at the largest displacement.

    Raises
    ------
    OptionError
        The run is over before that minute.
    """
    from selector.physics.thermal.model_file import FieldFile
    from selector.physics.thermal.time_constants import slowest_time_constants
    from selector.report.simulation_report import SimulationPage, largest_of

    run, at_s = largest_of(simulated)
    if picture_at_min is not None:
        run, at_s = _run_with(simulated, run, 60.0 * picture_at_min), 60.0 * picture_at_min
    moment = None
    if isinstance(machine.file, FieldFile):
        from selector.physics.thermal.field_moment import field_moment

        moment = field_moment(machine.file, conditions(run), at_s)
    return SimulationPage(
        recording=simulated,
        model=machine.name,
        # the outputs of the model stand last
        inputs=simulated.names[: len(simulated.names) - len(machine.outputs)],
        findings=findings,
        time_constants=slowest_time_constants(machine.machine, conditions(run)),
        parameters=machine.parameters,
        moment=moment,
        moment_run=run,
        told={
            "model file": model.name,
            "SHA-256 of the model file": hashlib.sha256(model.read_bytes()).hexdigest(),
            "kind of the model": machine.file.model.kind,
            "note": machine.file.model.note,
            "noise of the instruments": simulated.provenance["simulated"]["instruments"],
            "seed": simulated.provenance["simulated"]["seed"],
        },
    )


def write_page(page: SimulationPage, report: Path) -> None:
    """Write the page; its folder is made.

    Raises
    ------
    OptionError
        It cannot be written; an old file of that name is untouched.
    """
    from selector.report.simulation_report import write_simulation_report

    report.parent.mkdir(parents=True, exist_ok=True)
    write_simulation_report(page, report)


def _run_with(simulated: Recording, first: str, at_s: float) -> str:
    """The first of the runs that lasts until then, `first` before the others."""
    ends = {run: float(simulated.time_s(run)[-1]) for run in (first, *simulated.runs)}
    for run, end in ends.items():
        if at_s <= end * (1.0 + 1e-9):
            return run
    raise OptionError(
        f"{at_s / 60:g} min", expected=f"at most {max(ends.values()) / 60:g} min, when the run ends",
        where="--picture-at-min", advice="choose an earlier time, or leave it out",
    )  # fmt: skip
