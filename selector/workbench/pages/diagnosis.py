"""Diagnosis: recordings beside a simulation; what it left out, where, how sure that is, and what it is worth."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

import dash
from dash import ALL, Input, Output, dcc, html
from dash.development.base_component import Component

from selector.errors import OptionError
from selector.study import DiagnoseSection
from selector.workbench import parts, typed
from selector.workbench.bench import Bench
from selector.workbench.commands import DIAGNOSIS, diagnosis_arguments
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
_BOXES = (f"{ID}-holdout", f"{ID}-false_alarm")
_LEAST, _MOST = 1e-9, 0.2
_GOOD = ("missing-physics", "nothing-missing")


def layout(bench: Bench) -> Component:
    """Simulated runs, options, Start, and the answer."""
    asked = bench.diagnosis
    channels = dcc.Dropdown(id=f"{ID}-responses", options=[], value=list(asked.responses), multi=True)
    notes = ("last, the name of a run, or a share such as 0.3", "probability of naming something where nothing is")
    boxes = (parts.typed_text(box, text) for box, text in zip(_BOXES, _texts(bench), strict=True))
    titles = (FIELDS["--holdout"], FIELDS["--false-alarm"])
    fields = [
        parts.field("Channels to compare", channels, "None: all that are simulated."),
        *map(parts.field, titles, boxes, notes),
    ]
    drop = parts.drop_zone(
        "simulation",
        "Choose simulated runs …",
        "or drop them here: one file a run, named as the recorded one; or a model file (.toml, .fmu).",
    )
    return html.Div(
        [
            html.H1("What the simulation left out"),
            drop,
            html.Div(id=f"{ID}-files"),
            html.Div(fields, className="fields"),
            parts.start_row(ID),
            *parts.answer_place(ID),
        ]
    )


def command(bench: Bench) -> tuple[str, ...] | None:
    """`selector diagnose` with what is asked."""
    asked = bench.diagnosis
    if bench.material.reading is None or not (asked.simulation or asked.model):
        return None
    return ("diagnose", *bench.source_arguments(), *diagnosis_arguments(asked), "--out", DIAGNOSIS)


def register(app: dash.Dash, bench: Bench) -> None:
    """Options go to the bench as soon as they are changed, so that the command shows them."""

    @app.callback(
        Output(f"{ID}-files", "children"), Output(f"{ID}-responses", "options"), Input(parts.REVISION, "data")
    )
    def _show(_: int) -> tuple[Any, list[str]]:
        reading = bench.material.reading
        names = list(reading.recording.names) if reading is not None else []
        return _files(bench), names

    @app.callback(Input({"type": f"{ID}-remove", "file": ALL}, "n_clicks"), prevent_initial_call=True)
    def _remove(clicks: list[int | None]) -> None:
        if any(clicks):
            files = {path.name: path for path in bench.simulated}
            name = str(dash.ctx.triggered_id["file"])
            if name in files:
                bench.drop_simulated(files[name])
            parts.tell(bench)

    def take(responses: list[str] | None, holdout: str | None, false_alarm: str | None) -> None:
        with parts.typed_over(_BOXES, [holdout, false_alarm], lambda: _texts(bench)) as read:
            default = DiagnoseSection()
            probability = default.false_alarm
            if false_alarm:
                typed_one = partial(typed.number, false_alarm, FIELDS["--false-alarm"], _LEAST, _MOST)
                probability = read(typed_one, bench.diagnosis.false_alarm)
            said = (holdout or "").strip() or default.holdout
            if bench.choose_diagnosis(responses=tuple(responses or ()), holdout=said, false_alarm=probability):
                parts.tell(bench)

    fields = tuple((f"{ID}-{name}", "value") for name in ("responses", "holdout", "false_alarm"))
    form = parts.Form(fields, take)
    form.register(app)
    missing = OptionError(
        "nothing to compare",
        expected="recordings that can be read, and simulated runs of the same names",
        where=TITLE,
        advice="load recordings on the first page, and simulated runs here",
    )
    task = parts.Task(
        ID, TITLE, lambda: command(bench), lambda: DIAGNOSIS, missing, [form],
        answered=lambda stamp, _: _answered(bench, stamp),
    )  # fmt: skip
    parts.register_task(app, bench, task)


def _texts(bench: Bench) -> list[str]:
    """What stands in `_BOXES` when they say what counts."""
    return [bench.diagnosis.holdout, f"{bench.diagnosis.false_alarm:.12g}"]


def _files(bench: Bench) -> Component:
    reading = bench.material.reading
    runs = {run.name for run in reading.runs} if reading is not None else set()
    rows = []
    for path in bench.simulated:
        is_model = path.suffix.lower() in (".toml", ".fmu")
        beside = "a model, run by the diagnosis" if is_model else path.stem if path.stem in runs else "no recording"
        name = {"type": f"{ID}-remove", "file": path.name}
        rows.append(
            [path.name, beside, html.Button("Remove", id=name, title=f"Remove {path.name} from the study folder")]
        )
    if not rows:
        return html.P("No simulated runs yet.", className="about")
    return parts.table(["simulated", "recorded run", ""], rows, name="files")


def _answered(bench: Bench, stamp: str) -> Component | None:
    result = bench.result(f"{DIAGNOSIS}/diagnosis.json")
    if result is None:
        return None
    look = "advice" if result["verdict"] in _GOOD else "advice bad"
    effects = [_effect(effect) for effect in result["effects"]]
    about = (
        "Where they differ, how much better it gets and the evidence: the report. Drag across one of its pictures, and "
        "the same stretch of time is marked in all of them."
    )
    return parts.section(
        "The answer",
        html.Div([html.P(result.get("headline") or result["verdict"], className="first"), *effects], className=look),
        parts.saved(bench, DIAGNOSIS, _FILES),
        html.P(about, className="about"),
        parts.framed(f"{DIAGNOSIS}/report.html", "Report of the diagnosis", stamp),
    )


def _effect(effect: Mapping[str, Any]) -> Component:
    sure = f"{effect['confidence']:.0%} sure" + (", suspected only" if effect.get("suspected") else "")
    lines = [
        html.P([html.Code(effect["id"]), f" {effect['statement']} ({sure}; {effect['share']:.0%} of the difference)"])
    ]
    if effect["cannot_be_told_from"]:
        others = ", ".join(effect["cannot_be_told_from"])
        lines.append(html.P(f"It cannot be told from {others}. What would tell: {effect['experiment']}"))
    return html.Div(lines)
