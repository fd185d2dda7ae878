"""`select`: recordings in, sensors, a proven model, a model file and a report out."""

from __future__ import annotations

import datetime
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from selector.cli import showing
from selector.cli.files import folder_written_whole, require_writable_folder
from selector.cli.progress import progress_bar
from selector.cli.showing import AsJson
from selector.cli.source import Source, pairs, with_source
from selector.cli.studying import (
    AcceptChanges,
    OpenedStudy,
    StudyPath,
    hashes,
    opened_study,
    recording_entries,
    repeated_words,
    told_if_no_text,
    write_study_beside,
)
from selector.errors import OptionError

if TYPE_CHECKING:
    from rich.console import Console

    from selector.cli.material import Material
    from selector.selection import Selection
    from selector.selection.options import Options, Progress

_RESULTS = ("selection.json", "model.json", "report.html")
_SENSORS = "Which sensors"
_MODEL = "Which model"

Responses = Annotated[
    list[str] | None,
    typer.Option("--response", metavar="NAME", help="Displacement to predict; repeat. Default: all there are."),
]
Levels = Annotated[
    list[str] | None,
    typer.Option(
        "--lambda",
        metavar="λ|auto",
        help="Level of the cut, 0 to 1; repeat for one a round. Default: auto.",
        rich_help_panel=_SENSORS,
    ),
]
Rounds = Annotated[
    int, typer.Option("--rounds", metavar="N", help="Rounds of screening.", rich_help_panel=_SENSORS, show_default=True)
]
MaxSensors = Annotated[
    int, typer.Option("--max-sensors", metavar="K", help="Most sensors in a set.", rich_help_panel=_SENSORS)
]
Absolute = Annotated[
    bool,
    typer.Option(
        "--absolute-similarity",
        help="Group by |r|: a sensor and its mirror image stand together.",
        metavar="",
        rich_help_panel=_SENSORS,
    ),
]
Must = Annotated[
    list[str] | None,
    typer.Option("--must", metavar="SENSOR", help="A sensor that must be kept; repeat.", rich_help_panel=_SENSORS),
]
Never = Annotated[
    list[str] | None,
    typer.Option("--never", metavar="SENSOR", help="A sensor that must not be used; repeat.", rich_help_panel=_SENSORS),
]
Cost = Annotated[
    list[str] | None,
    typer.Option(
        "--cost", metavar="SENSOR=COST", help="Cost of a sensor (default 1); repeat.", rich_help_panel=_SENSORS
    ),
]
Tolerance = Annotated[
    float | None,
    typer.Option(
        "--tolerance",
        metavar="ΔR²",
        help="Take the cheapest set whose adjusted R² is within this distance of the best. Default: the cheapest that "
        "predicts unseen runs as well as the best, within one standard error.",
        rich_help_panel=_SENSORS,
    ),
]
Degree = Annotated[
    int, typer.Option("--degree", metavar="1|2|3", help="Highest power offered to the model.", rich_help_panel=_MODEL)
]
Interactions = Annotated[
    bool, typer.Option("--interactions", help="Offer products of sensors.", metavar="", rich_help_panel=_MODEL)
]
Memory = Annotated[
    bool,
    typer.Option(
        "--memory", help="Offer lagged temperatures and lagged spindle speed.", metavar="", rich_help_panel=_MODEL
    ),
]
Reference = Annotated[
    str,
    typer.Option(
        "--reference",
        metavar="rise|absolute",
        help="Readings as differences to the start of the run, or as they are.",
        rich_help_panel=_MODEL,
    ),
]
Ridge = Annotated[
    bool,
    typer.Option(
        "--ridge",
        help="Shrink coefficients as far as unseen runs profit; shows the cost.",
        metavar="",
        rich_help_panel=_MODEL,
    ),
]
Conditions = Annotated[
    list[str] | None,
    typer.Option(
        "--condition", metavar="RUN=NAME", help="Condition of a run; whole conditions are left out in turn. Repeat."
    ),
]
Seed = Annotated[int, typer.Option("--seed", metavar="N", help="Of the bootstrap over runs.")]
Out = Annotated[
    Path | None,
    typer.Option(
        "--out", metavar="DIR", help="Write selection.json, model.json, report.html and study.toml, all or none."
    ),
]
Date = Annotated[
    str | None,
    typer.Option("--date", metavar="YYYY-MM-DD", help="Date to write into the files; the clock is not read."),
]


@with_source
def select(
    source: Source,
    context: typer.Context,
    from_study: StudyPath = None,
    accept_changes: AcceptChanges = False,
    response: Responses = None,
    level: Levels = None,
    rounds: Rounds = 1,
    max_sensors: MaxSensors = 5,
    absolute_similarity: Absolute = False,
    must: Must = None,
    never: Never = None,
    cost: Cost = None,
    tolerance: Tolerance = None,
    degree: Degree = 1,
    interactions: Interactions = False,
    memory: Memory = False,
    reference: Reference = "rise",
    ridge: Ridge = False,
    condition: Conditions = None,
    seed: Seed = 0,
    out: Out = None,
    date: Date = None,
    as_json: AsJson = False,
) -> None:
    """Chooses the sensors to keep, fits one model per displacement and proves it on runs that it has not seen.

    Sensors are grouped by the correlation of their readings, one stands for each group, and sets of them are compared.
    Everything is chosen anew inside every fold, so that the error which is reported is that of a day the model does
    not know.
    """
    console = showing.screen(as_json)
    asked = opened_study(from_study, source, context, accept_changes=accept_changes, console=console)
    if asked is not None:
        from selector.study import options_of

        source, date = asked.source, asked.study.date
        options = options_of(asked.study, where=str(asked.place))
    else:
        options = _options(
            responses=tuple(response or ()),
            level=_levels(level, rounds),
            rounds=rounds if rounds < 1 else max(rounds, len(level or ())),
            max_sensors=max_sensors,
            degree=degree,
            interactions=interactions,
            memory=memory,
            reference=reference,
            absolute_similarity=absolute_similarity,
            must=tuple(must or ()),
            never=tuple(never or ()),
            cost={name: _number(text, f"--cost {name}") for name, text in pairs(cost, "--cost").items()},
            tolerance=tolerance,
            ridge=ridge,
            conditions=pairs(condition, "--condition"),
            seed=_seed(seed),
        )
        date = _date(date)
    if out is not None:
        require_writable_folder(out, "--out")
    written: list[str] = []
    with progress_bar() as progress:
        selection, material = study(source, options, progress)
        with _results_folder(out, asked) as folder:
            if folder is not None:
                progress("writing", 1.0)
                write_results(selection, material, folder, date=date)
                write_selection_report(selection, material, folder, date=date)
                found = hashes(folder)
            if folder is not None and out is not None:
                written = [*_RESULTS]
                with told_if_no_text(console):
                    files = recording_entries(out, source, material.files, material.machine_file)
                    written += write_study_beside(folder, out, source, files, opened=asked, select=options, date=date)
    if as_json:
        showing.print_json(selection.as_dict())
    else:
        show_selection(console, selection)
    showing.show_findings(console, material.beside)
    if out is not None:
        console.print(f"wrote {out}: {', '.join(written)}", markup=False)
    if asked is not None and asked.study.results:
        console.print(repeated_words(asked.study, found), markup=False)


@contextmanager
def _results_folder(out: Path | None, asked: OpenedStudy | None) -> Iterator[Path | None]:
    """Where results are written: what becomes `out`, or a folder that goes again if they are only to be compared."""
    if out is not None:
        with folder_written_whole(out) as folder:
            yield folder
    elif asked is not None and asked.study.results:
        with tempfile.TemporaryDirectory() as temporary:
            yield Path(temporary)
    else:
        yield None


def _options(*, reference: str, **values: Any) -> Options:
    from selector.selection import Options

    if reference not in ("rise", "absolute"):
        raise OptionError(
            repr(reference), expected="rise or absolute", where="--reference", advice="leave it out for rise"
        )
    return Options(reference="absolute" if reference == "absolute" else "rise", **values)


def study(source: Source, options: Options, progress: Progress | None = None) -> tuple[Selection, Material]:
    """Read, inspect and select; the result, and what it was made from."""
    from selector.cli.material import material_of
    from selector.selection import select as selected

    say = progress or (lambda _what, _share: None)
    if _first_time():
        typer.echo("the first study compiles the search, which takes about half a minute, once", err=True)
    say("reading", 0.0)
    material = material_of(source)
    selection = selected(
        material.source, options, findings=material.findings, provenance=material.provenance, progress=progress
    )
    return selection, material


def _first_time() -> bool:
    """Whether the compiled search is not in its cache yet."""
    from selector.models import subsets

    places = [
        Path(subsets.__file__).parent / "__pycache__",
        *map(Path, filter(None, [os.environ.get("NUMBA_CACHE_DIR")])),
    ]
    return not any(next(place.rglob("*.nbi"), None) for place in places)


def write_results(selection: Selection, material: Material, folder: Path, *, date: str | None = None) -> None:
    """selection.json and model.json, into a folder that exists."""
    from selector.controllers.from_selection import model_file_of
    from selector.controllers.model_io import write_model

    model = model_file_of(selection, material.source.channels, source=material.source, date=date)
    (folder / "selection.json").write_text(
        showing.json_text(selection.as_dict()) + "\n", encoding="utf-8", newline="\n"
    )
    write_model(model, folder / "model.json")


def write_selection_report(selection: Selection, material: Material, folder: Path, *, date: str | None = None) -> None:
    """report.html, into a folder that exists."""
    from selector.report import write_report

    write_report(selection, folder / "report.html", description=material.description, date=date)


def show_selection(console: Console, selection: Selection) -> None:
    """The answer for people: what to keep, how good it is, and what to doubt."""
    from selector.selection.unseen_words import BEST_OF_SIZE, FIXED_SET, PROCEDURE, told_apart

    console.print(f"Keep {', '.join(selection.chosen)}.", style="bold", markup=False)
    console.print(selection.because, markup=False)
    rows = []
    for name, model in selection.models.items():
        baseline = selection.proof.baselines_um[name]
        worst = max((gain.worst_um for gain in selection.faults if gain.response == name), default=None)
        rows.append(
            (
                name,
                baseline["none"],
                selection.proof.rmse_um(name),
                selection.proof.max_um(name),
                model.rmse_um,
                f"{model.adjusted_r2:.5f}",
                worst,
            )
        )
    columns = ["response", "as it is", "unseen RMS", "unseen largest", "in-sample RMS", "adjusted R²", "worst fault"]
    console.print(showing.table(f"Error of the model [µm]; unseen: {PROCEDURE}", columns, rows, numeric=columns[1:]))
    for name, model in selection.models.items():
        terms, coefficients, errors = model.physical()
        lines: list[tuple[str, float, float, float | None]] = [("1", coefficients[0], errors[0], None)]
        vif = {tuple(sorted(t.powers)): float(v) for t, v in zip(model.terms, model.vif, strict=True)}
        lines += [
            (str(term), coefficients[1 + i], errors[1 + i], vif.get(tuple(sorted(term.powers))))
            for i, term in enumerate(terms)
        ]
        columns = ["term", "coefficient", "standard error", "VIF"]
        console.print(showing.table(f"{name} [µm per unit of the term: K, rpm]", columns, lines, numeric=columns[1:]))
    groups = selection.grouping.chosen.rounds[0]
    rows_of_groups = [
        (
            ", ".join(selection.sensors[groups.kept[i]] for i in members),
            ", ".join(selection.sensors[i] for i in groups.representatives if i in [groups.kept[k] for k in members]),
        )
        for members in groups.partition.members
    ]
    console.print(showing.table(f"Groups at λ = {groups.level:.6g}", ["sensors", "representative"], rows_of_groups))
    fixed = [selection.fixed_set_errors_um(name) for name in selection.models]
    points = [
        (
            point.n_sensors,
            *(
                text
                for rmse, error, of in zip(point.rmse_um, point.standard_error_um, fixed, strict=True)
                for text in (
                    f"{rmse:.3g} ± {error:.2g}",
                    f"{of[point.n_sensors]:.3g}" if point.n_sensors in of else "–",
                )
            ),
        )
        for point in selection.proof.curve
    ]
    columns = ["sensors", *(f"{name}, {what}" for name in selection.models for what in (BEST_OF_SIZE, FIXED_SET))]
    console.print(showing.table("Unseen RMS error against number of sensors [µm]", columns, points, numeric=columns))
    console.print(told_apart(selection.proof.left_out), markup=False)
    showing.show_findings(console, selection.findings)


def _levels(given: list[str] | None, rounds: int) -> float | tuple[float, ...] | None:
    given = [text.strip().lower() for text in given or ()]
    if not given or given == ["auto"]:
        return None
    if "auto" in given:
        raise OptionError(
            ", ".join(given), expected="auto alone, or numbers", where="--lambda", advice="use one or the other"
        )
    levels = tuple(_number(text, "--lambda") for text in given)
    return levels[0] if len(levels) == 1 else levels


def _number(text: str, where: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise OptionError(
            repr(text), expected="a number with a decimal point", where=where, advice="e.g. 0.995 or 2"
        ) from None


def _date(text: str | None) -> str | None:
    if text is None:
        return None
    try:
        return datetime.date.fromisoformat(text).isoformat()
    except ValueError:
        raise OptionError(
            repr(text), expected="a date as YYYY-MM-DD", where="--date", advice="e.g. --date 2026-11-20"
        ) from None


def _seed(seed: int) -> int:
    if not 0 <= seed < 2**53:
        raise OptionError(str(seed), expected="a whole number from 0", where="--seed", advice="e.g. --seed 0")
    return seed
