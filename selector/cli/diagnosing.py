"""`diagnose`: recordings and a simulation in; where they differ, which physics was left out, and the fit with it."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from selector.cli import showing
from selector.cli.diagnosis_study import Asked, asked_of, write_diagnosis_study
from selector.cli.files import folder_written_whole, require_writable_folder, written_folder
from selector.cli.progress import progress_bar
from selector.cli.showing import AsJson
from selector.cli.source import Source, with_source
from selector.cli.studying import AcceptChanges, StudyPath, hashes, opened_study, repeated_words, told_if_no_text
from selector.errors import OptionError

if TYPE_CHECKING:
    from rich.console import Console

    from selector.controllers.model_file import ModelFile
    from selector.diagnosis.answer import Diagnosis, Fit, NamedEffect, Place
    from selector.diagnosis.comparison import Comparison
    from selector.diagnosis.open_model.modelled import Improved
    from selector.readers import Reading

_SIMULATION = "What it is compared with"

Simulation = Annotated[
    list[Path] | None,
    typer.Option(
        "--simulation",
        metavar="PATH",
        help="Simulated runs, named as the recorded ones: a folder, or a file; repeat.",
        rich_help_panel=_SIMULATION,
    ),
]
Model = Annotated[
    Path | None,
    typer.Option(
        "--model",
        metavar="MODEL.toml|UNIT.fmu",
        help="Instead: a model file of `selector simulate`, or an FMU; the recordings drive it, and it is refitted.",
        rich_help_panel=_SIMULATION,
    ),
]
SimulationTimeUnit = Annotated[
    str | None,
    typer.Option(
        "--simulation-time-unit",
        metavar="UNIT",
        help="Unit of the time in the simulated files, if it is another one and not written there.",
        rich_help_panel=_SIMULATION,
    ),
]
Responses = Annotated[
    list[str] | None,
    typer.Option("--response", metavar="NAME", help="Channel to compare; repeat. Default: all that are simulated."),
]
HoldOut = Annotated[
    str,
    typer.Option(
        "--holdout",
        metavar="last|RUN|SHARE",
        help="What nothing is fitted to: the last run (of a single one its last 30 %), a run, or a share of every run.",
    ),
]
Seed = Annotated[int, typer.Option("--seed", metavar="N", help="Of the draws of noise.")]
FalseAlarm = Annotated[
    float,
    typer.Option("--false-alarm", metavar="P", help="Allowed probability of naming something where nothing is."),
]
Out = Annotated[
    Path | None,
    typer.Option(
        "--out",
        metavar="DIR",
        help="Write diagnosis.json, report.html and study.toml; with --model improved.toml; where physics is named "
        "that is not in that, correction.json, and model.json if it is thermal. Those of an earlier answer there are "
        "replaced or removed.",
        parser=written_folder,
    ),
]


@with_source
def diagnose(
    source: Source,
    context: typer.Context,
    from_study: StudyPath = None,
    accept_changes: AcceptChanges = False,
    simulation: Simulation = None,
    model: Model = None,
    simulation_time_unit: SimulationTimeUnit = None,
    response: Responses = None,
    holdout: HoldOut = "last",
    seed: Seed = 0,
    false_alarm: FalseAlarm = 0.02,
    out: Out = None,
    as_json: AsJson = False,
) -> None:
    """Says what a simulation left out: where it differs from the recordings, which physics or fault of the data
    explains it, how sure that is, and how much closer the simulation comes with it.

    What is named was tested against noise on rows that it was not fitted to. Where nothing of the catalogue explains
    a difference, that is said, and nothing is named.
    """
    console = showing.screen(as_json)
    opened = opened_study(from_study, source, context, accept_changes=accept_changes, console=console)
    asked = Asked(simulation, model, simulation_time_unit, response, holdout, seed, false_alarm)
    if opened is not None:
        source, asked = opened.source, asked_of(opened)
    _require_usable(asked)
    if out is not None:
        require_writable_folder(out, "--out")
    from selector.cli.diagnosis_files import earlier_answer, require_replaceable
    from selector.cli.material import beside_recordings

    if out is not None:
        require_replaceable(out, with_model=asked.model is not None)
    with progress_bar() as progress:
        answer = answered(source, asked, progress)
        found = answer.found
        if out is not None:
            progress("writing", 1.0)
            require_replaceable(out, with_model=asked.model is not None)
            with folder_written_whole(out, earlier_answer(out)) as folder:
                description = answer.recorded.description()
                written = write_results(found, folder, answer.improved, answer.correction, answer.told, description)
                results = hashes(folder)
                with told_if_no_text(console):
                    read = (answer.recorded, answer.simulated)
                    written += write_diagnosis_study(folder, out, source, asked, *read, opened)
    if as_json:
        showing.print_json(found.as_dict())
    else:
        show_diagnosis(console, found)
    showing.show_findings(console, beside_recordings(answer.recorded.findings))
    if out is not None:
        console.print(f"wrote {out}: {', '.join(written)}", markup=False)
        if opened is not None and opened.study.results:
            console.print(repeated_words(opened.study, results), markup=False)


@dataclasses.dataclass(frozen=True)
class Answer:
    """A diagnosis, what is written beside it, and what it was made from; `told` is its provenance."""

    found: Diagnosis
    improved: Improved | None
    correction: ModelFile | None
    recorded: Reading
    simulated: Reading | None
    told: dict[str, Any]


def answered(source: Source, asked: Asked, progress: Callable[[str, float], None]) -> Answer:
    """Read, compare and diagnose.

    Raises
    ------
    InputError
        A file cannot be read, or what is asked cannot be answered.
    """
    from selector.cli.diagnosis_files import correction_told, provenance

    progress("reading", 0.0)
    say = _in_steps(progress)
    improved, simulated = None, None
    recorded = source.reading()
    if asked.model is not None:
        found, improved = _of_model(recorded, asked.model, asked, say)
    else:
        from selector.diagnosis.workflow import diagnosis

        comparison, simulated = compared(
            source, recorded, asked.simulation, asked.time_unit, asked.responses, asked.holdout
        )
        found = diagnosis(comparison, seed=asked.seed, false_alarm=asked.false_alarm, progress=say)
    found, correction = correction_told(found, improved)
    options = {"holdout": asked.holdout, "false alarm": f"{asked.false_alarm:g}", "response": asked.responses}
    told = provenance(recorded, simulated, asked.model, options)
    return Answer(found, improved, correction, recorded, simulated, told)


def _require_usable(asked: Asked) -> None:
    """Ends with an error when options contradict each other or are out of their limits."""
    both = asked.simulation and asked.model
    _require(not both, "--simulation and --model", "one of them", "command line", "leave one out")
    _require(0 <= asked.seed < 2**53, str(asked.seed), "a whole number from 0", "--seed", "e.g. --seed 0")
    _require(
        0.0 < asked.false_alarm <= 0.2,
        str(asked.false_alarm),
        "a probability above 0 and up to 0.2",
        "--false-alarm",
        "e.g. 0.02",
    )


def compared(
    source: Source,
    recorded: Reading,
    simulation: list[Path] | None,
    time_unit: str | None = None,
    responses: list[str] | None = None,
    holdout: str = "last",
) -> tuple[Comparison, Reading]:
    """The recordings of a command line beside their simulation, and how that was read.

    Raises
    ------
    InputError
        A file cannot be read, or the two cannot be compared.
    """
    from selector.cli.material import without_folders
    from selector.cli.simulated_runs import not_simulated, simulated_reading
    from selector.diagnosis.entrance.alignment import comparison_of

    if not simulation:
        raise OptionError(
            "nothing to compare the recordings with",
            expected="simulated runs, named as the recorded ones",
            where="--simulation",
            advice="add --simulation PATH with a folder, or once for each file; or --model MODEL.toml",
        )
    simulated = simulated_reading(simulation, recorded, source.overrides(), time_unit)
    comparison = comparison_of(recorded.recording, simulated.recording, responses=responses or None, holdout=holdout)
    told = [dataclasses.replace(f, statement=f"Simulation: {f.statement}") for f in simulated.findings]
    said = [finding for finding in told if finding.id not in ("columns-ignored", "channels-lacking")]
    if not responses:
        said += not_simulated(recorded.recording, simulated.recording, comparison.responses)
    findings = without_folders((*recorded.findings, *said, *comparison.findings))
    return dataclasses.replace(comparison, findings=findings), simulated


def write_results(
    found: Diagnosis,
    folder: Path,
    improved: Improved | None = None,
    correction: ModelFile | None = None,
    provenance: dict[str, Any] | None = None,
    description: dict[str, Any] | None = None,
) -> list[str]:
    """diagnosis.json, report.html, and the improved model or a correction, into a folder; their names."""
    from selector.cli.diagnosed_model import write_improved
    from selector.cli.diagnosis_files import write_correction
    from selector.report.diagnosis_report import write_diagnosis_report

    written = ["diagnosis.json", "report.html"]
    if improved is not None:
        written.append(write_improved(improved, folder).name)
    written += write_correction(found, improved, correction, folder)
    text = showing.json_text(found.as_dict()) + "\n"
    (folder / "diagnosis.json").write_text(text, encoding="utf-8", newline="\n")
    write_diagnosis_report(found, folder / "report.html", provenance=provenance, description=description)
    return written


def _of_model(
    reading: Reading, model: Path, asked: Asked, say: Callable[[int, int, str], None]
) -> tuple[Diagnosis, Improved | None]:
    """The diagnosis of a model that can be run again, and the improved one."""
    from selector.cli.diagnosed_model import diagnosed_model
    from selector.cli.material import without_folders

    done = diagnosed_model(model, reading.recording, asked.responses, asked.holdout, asked.seed, asked.false_alarm, say)
    answer = dataclasses.replace(done.answer, findings=without_folders((*reading.findings, *done.answer.findings)))
    return answer, done.improved


def show_diagnosis(console: Console, found: Diagnosis) -> None:
    """The answer for people: what was left out, where, how sure, and what it is worth."""
    from selector.diagnosis.wording import suspicion_words

    console.print(found.headline or _HEADLINES[found.verdict], style="bold", markup=False)
    for effect in found.effects:
        sure = f"{effect.confidence:.0%} sure" + (f", {suspicion_words(found, effect)}" if effect.suspected else "")
        console.print(f"{effect.id}: {effect.statement} ({sure}; {effect.share:.0%} of the difference)", markup=False)
        if effect.cannot_be_told_from:
            console.print(f"    cannot be told from {', '.join(effect.cannot_be_told_from)}", markup=False)
            console.print(f"    what would tell: {_telling_run(found, effect)}", markup=False)
    if found.where:
        columns = ["channel", "place", "run", "from", "to", "when", "share"]
        console.print(showing.table("Where", columns, map(_place_row, found.where), numeric=columns[-1:]))
    if found.fit:
        columns = ["response", "unit", "as it is", "recalibrated", "with what was found", "noise", "fitted part"]
        rows = [_fit_row(name, fit) for name, fit in found.fit.items()]
        console.print(showing.table("RMS error on what was held out", columns, rows, numeric=columns[2:]))
    showing.show_findings(console, found.findings)


def _telling_run(found: Diagnosis, effect: NamedEffect) -> str:
    """The first weighed run that tells the effect, with its chance; else the one that shows it best."""
    ids = {effect.id, *effect.cannot_be_told_from}
    for run in found.next_runs:
        if run.power is not None and set(run.separates) <= ids:
            return f"{run.description} ({run.power:.0%} likely to tell)"
    return effect.experiment


_HEADLINES = {
    "missing-physics": "The simulation left out physics.",
    "data-fault": "The recording is at fault, not the simulation.",
    "miscalibrated": "Offset, gain or delay of the simulation explain the difference.",
    "nothing-missing": "Nothing is missing: what is left is noise.",
    "unexplained": "Something is missing that nothing in the catalogue explains.",
}


def _place_row(place: Place) -> tuple[object, ...]:
    times = ("" if t is None else showing.duration_text(t) for t in (place.from_s, place.to_s))
    return place.channel, place.place or "", place.run or "all", *times, place.regime or "", f"{place.share:.0%}"


def _fit_row(name: str, fit: Fit) -> tuple[object, ...]:
    held = fit.heldout
    fitted = f"{showing.cell_text(fit.train.rmse_before)} → {showing.cell_text(fit.train.rmse_after)}"
    return name, fit.unit, held.rmse_before, fit.recalibrated_heldout, held.rmse_after, held.noise_floor, fitted


def _in_steps(progress: Callable[[str, float], None]) -> Callable[[int, int, str], None]:
    return lambda done, total, text: progress(text, 0.05 + 0.95 * done / max(total, 1))


def _require(holds: bool, found: str, expected: str, where: str, advice: str) -> None:
    if not holds:
        raise OptionError(found, expected=expected, where=where, advice=advice)
