"""Export: a model becomes the program of a control, with its commissioning sheet and the replay of recordings."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import dash
from dash import Input, Output, State, dcc, html
from dash.development.base_component import Component

from selector.controllers.writers.targets import TARGETS
from selector.errors import OptionError
from selector.workbench import parts
from selector.workbench.bench import Bench
from selector.workbench.commands import DIAGNOSIS, SELECTION, export_command

ID, TITLE = "export", "Export"

_SHEET = "commissioning.html"
_LONGEST_SHOWN = 60_000
_SIGN = (
    "Tick this only after the sign test of the commissioning sheet was passed at the machine: a correction with the "
    "wrong sign doubles the error. Without it the program says SIGN UNVERIFIED."
)


def layout(bench: Bench) -> Component:
    """Model, control, replay, sign, Start, and the files."""
    asked = bench.export
    targets = [{"label": target.title, "value": name} for name, target in TARGETS.items()]
    fields = [
        parts.field("Model", dcc.Dropdown(id=f"{ID}-model", options=[], value=asked.model or None, clearable=False)),
        parts.field("Control", dcc.Dropdown(id=f"{ID}-target", options=targets, value=asked.target, clearable=False)),
        parts.field(
            "Recordings to run through the program",
            dcc.Dropdown(id=f"{ID}-replayed", options=[], value=[], multi=True),
            "The program is executed on them and compared with the model, sample by sample.",
        ),
    ]
    sign = dcc.Checklist(
        id=f"{ID}-sign",
        options=[{"label": "The sign test was passed", "value": "verified"}],
        value=["verified"] if asked.is_sign_verified else [],
    )
    return html.Div(
        [
            html.H1("Program for a control"),
            html.Div(fields, className="fields wide"),
            html.Div([sign, html.P(_SIGN, className="about")]),
            html.Div([html.Button("Export", id=f"{ID}-start", className="main")], className="row"),
            html.Div(id=f"{ID}-answer"),
            dcc.Store(id=f"{ID}-answered", data=None),
        ]
    )


def command(bench: Bench) -> tuple[str, ...] | None:
    """`selector export` with what is asked."""
    asked = bench.export
    return (
        export_command(bench.folder, asked, bench.machine, bench.overrides) if asked.model in _models(bench) else None
    )


def register(app: dash.Dash, bench: Bench) -> None:
    """What is asked goes to the bench as soon as it is changed, so that the command shows it."""

    @app.callback(
        Output(f"{ID}-model", "options"),
        Output(f"{ID}-model", "value"),
        Output(f"{ID}-replayed", "options"),
        Input(parts.REVISION, "data"),
        State(f"{ID}-model", "value"),
    )
    def _show(_: int, model: str | None) -> tuple[Any, ...]:
        models = _models(bench)
        runs = [{"label": path.name, "value": str(number)} for number, path in enumerate(bench.used)]
        return models, model if model in models else next(iter(models), None), runs

    @app.callback(
        Input(f"{ID}-model", "value"),
        Input(f"{ID}-target", "value"),
        Input(f"{ID}-replayed", "value"),
        Input(f"{ID}-sign", "value"),
        prevent_initial_call=True,
    )
    def _choose(model: str | None, target: str, replayed: list[str], sign: list[str]) -> None:
        runs = {str(number): path for number, path in enumerate(bench.used)}
        if bench.choose_export(
            model=model or "",
            target=target if target in TARGETS else "c",
            replayed=tuple(runs[number] for number in replayed if number in runs),
            is_sign_verified=bool(sign),
        ):
            parts.tell(bench)

    parts.register_start(app, bench, ID, TITLE, lambda: command(bench), lambda: bench.export.folder, _missing)
    parts.register_answer(
        app,
        bench,
        ID,
        TITLE,
        lambda: f"{bench.export.folder}/{_SHEET}",
        lambda stamp: _files(bench.folder / bench.export.folder, stamp),
        is_open=True,
    )


def _missing() -> OptionError:
    return OptionError(
        "no model in the study folder",
        expected="a model.json of a selection or of a diagnosis",
        where=TITLE,
        advice="run a selection first",
    )


def _models(bench: Bench) -> list[str]:
    places = (f"{SELECTION}/model.json", f"{DIAGNOSIS}/model.json")
    return [place for place in places if (bench.folder / place).is_file()]


def _files(folder: Path, stamp: str) -> Component | None:
    """Every file as text, and the sheet in a frame; None: nothing was exported."""
    if not (folder / _SHEET).is_file():
        return None
    texts = [path for path in sorted(folder.iterdir()) if path.is_file() and path.suffix not in (".html", ".json")]
    links = [
        parts.download(f"{folder.name}/{path.name}", path.name)
        for path in sorted(folder.iterdir())
        if path.is_file() and not path.name.startswith(".")
    ]
    return parts.section(
        f"Files in {folder.name}",
        html.Div([html.Span("Save: "), *links], className="row"),
        *(_text(path, number) for number, path in enumerate(texts)),
        html.H3("Commissioning sheet"),
        parts.framed(f"{folder.name}/{_SHEET}", "Commissioning sheet", stamp),
    )


def _text(path: Path, number: int) -> Component:
    text = path.read_text(encoding="utf-8", errors="replace")
    cut = (
        []
        if len(text) <= _LONGEST_SHOWN
        else [html.P("Only the beginning is shown; save the file.", className="about")]
    )
    name = f"{ID}-text-{number}"
    button = html.Button("Copy", **parts.marks(data_copies=name)) if not cut else None
    return html.Details(
        [
            html.Summary(path.name),
            html.Div([button], className="row"),
            *cut,
            html.Pre(text[:_LONGEST_SHOWN], id=name, tabIndex=0),
        ]
    )
