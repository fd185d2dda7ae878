"""Diagnosis: recordings beside a simulation; what it left out, where, how sure that is, and what it is worth."""

from pathlib import Path
from typing import Any

import dash
from dash import Input, html
from dash.development.base_component import Component

from selector.errors import OptionError
from selector.study import DiagnoseSection
from selector.telling.diagnosed import diagnosis_account
from selector.telling.result_file import diagnosis_of
from selector.workbench import parts, typed
from selector.workbench.bench import BESIDE, Bench
from selector.workbench.boxes import Box, Boxes, several
from selector.workbench.commands import DIAGNOSIS, diagnosis_arguments
from selector.workbench.pages import simulation
from selector.workbench.study_folder import SIMULATION
from selector.workbench.typed import FIELDS

ID, TITLE = "diagnosis", "Diagnosis"

_FILES = (
    ("report.html", "Report"),
    ("diagnosis.json", "All results (JSON)"),
    ("correction.json", "Correction of the simulation"),
    ("improved.toml", "Improved model"),
    ("model.json", "Model for a control"),
    ("study.toml", "Study file"),
)
_LEAST, _MOST = 1e-9, 0.2


def _boxes(bench: Bench) -> Boxes:
    default, title = DiagnoseSection(), FIELDS["--false-alarm"]
    boxes = (
        several("responses", "Channels to compare", "None: all that are simulated.", bench.channels),
        Box(
            "holdout", FIELDS["--holdout"], "last, the name of a run, or a share such as 0.3",
            lambda text: (text or "").strip() or default.holdout,
        ),
        Box(
            "false_alarm", title, "probability of naming something where nothing is",
            lambda text: typed.number(text, title, _LEAST, _MOST) if text else default.false_alarm,
            lambda probability: f"{probability:.12g}",
        ),
    )  # fmt: skip
    return Boxes(ID, boxes, lambda: bench.diagnosis, bench.choose_diagnosis)


def layout(bench: Bench) -> Component:
    """Simulated runs, options, Start, and the answer."""
    boxes = _boxes(bench)
    drop = parts.drop_zone(
        "simulation",
        "Choose simulated runs …",
        "or drop them here: one file a run, named as the recorded one; or a model file (.toml, .fmu).",
    )
    return parts.stacked(
        html.H1("What the simulation left out"),
        drop,
        html.Div(id=f"{ID}-stored"),
        html.Div(boxes.fields(), className="fields"),
        parts.start_row(ID),
        *parts.answer_place(ID),
        boxes.followed(),
    )


def command(bench: Bench) -> tuple[str, ...] | None:
    """`selector diagnose` with what is asked."""
    asked = bench.diagnosis
    if bench.inspection.reading is None or not (asked.simulation or asked.model):
        return None
    return ("diagnose", *bench.source_arguments(), *diagnosis_arguments(asked), "--out", DIAGNOSIS)


def register(app: dash.Dash, bench: Bench) -> None:
    """Options go to the bench as soon as they are changed, so that the command shows them."""

    def beside(path: Path) -> str:
        reading = bench.inspection.reading
        runs = {run.name for run in reading.runs} if reading is not None else set()
        return path.stem if path.stem in runs else BESIDE.get(path.suffix.lower(), "no recording")

    def nothing() -> Component:
        note = html.P("No simulated runs yet. The page Simulate has machines, too.", className="about")
        take = html.Button(f"Compare with {Path(bench.simulation.model).stem} of the page Simulate", id=f"{ID}-machine")
        return html.Div([note, take] if simulation.command(bench) else note)

    parts.register_stored(app, bench, ID, lambda: bench.simulated, {"recorded run": beside}, nothing)

    @app.callback(Input(f"{ID}-machine", "n_clicks"), prevent_initial_call=True)
    def _take(clicks: int | None) -> None:
        if clicks and simulation.command(bench):
            asked = bench.simulation
            bench.write_model(f"{SIMULATION}/{Path(asked.model).name}", simulation.model_shown(asked))
            bench.changed()
            parts.tell(bench)

    form = _boxes(bench).register(app, bench)
    missing = OptionError(
        "nothing to compare",
        expected="recordings that can be read, and simulated runs of the same names",
        where=TITLE,
        advice="load recordings on the first page, and simulated runs here, or choose a machine on the page Simulate",
    )
    task = parts.Task(ID, TITLE, command, lambda _: DIAGNOSIS, missing, [form], answered=_answered)
    parts.register_task(app, bench, task)


def _answered(bench: Bench, stamp: str, _: Any) -> Component | None:
    result = bench.result(f"{DIAGNOSIS}/diagnosis.json")
    if result is None:
        return None
    about = (
        "Where they differ, how much better it gets and the evidence: the report. Drag across one of its pictures, and "
        "the same stretch of time is marked in all of them."
    )
    told = parts.told(diagnosis_account(diagnosis_of(result), is_alone=True), ["effects"])
    note = html.P(about, className="about")
    return parts.answer(bench, DIAGNOSIS, _FILES, "Report of the diagnosis", stamp, *told, note)
