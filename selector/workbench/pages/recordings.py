"""Recordings: load them, see how they were read and what was guessed, and correct that by hand."""

from __future__ import annotations

from typing import Any

import dash
from dash import Input, Output, html
from dash.development.base_component import Component

from selector.workbench import parts
from selector.workbench.bench import Bench

ID, TITLE = "recordings", "Recordings"


def layout(bench: Bench) -> Component:
    """Files, how they were read, channels, findings."""
    return html.Div(
        [
            html.H1("Recordings"),
            html.Div(
                [
                    html.Button("Choose recordings …", **parts.marks(data_chooses="recordings")),
                    html.Span(" or drop them here."),
                    html.Div(className="uploads", role="status"),
                ],
                className="drop",
                **parts.marks(data_uploads="recordings"),
            ),
            html.Div(id=f"{ID}-runs"),
            html.Div(id=f"{ID}-channels"),
        ]
    )


def register(app: dash.Dash, bench: Bench) -> None:
    """The tables follow the bench."""

    @app.callback(Output(f"{ID}-runs", "children"), Output(f"{ID}-channels", "children"), Input(parts.REVISION, "data"))
    def _show(_: int) -> tuple[Any, Any]:
        return _runs(bench), _channels(bench)


def command(bench: Bench) -> tuple[str, ...] | None:
    """`selector describe` of what is loaded."""
    arguments = bench.source_arguments()
    return ("describe", *arguments) if bench.material.reading else None


def _runs(bench: Bench) -> Component:
    material = bench.material
    if material.reading is None:
        return html.Div() if material.problem is None else parts.problem(material.problem)
    runs = [(run.name, run.rows) for run in material.reading.runs]
    return parts.section("Runs", parts.table(["run", "rows"], runs, numeric=["rows"]), parts.remarks(material.findings))


def _channels(bench: Bench) -> Component:
    reading = bench.material.reading
    if reading is None:
        return html.Div()
    rows = [(one.name, one.role, one.unit_in_file, one.place or "", one.axis or "") for one in reading.channels]
    return parts.section("Channels", parts.table(["channel", "role", "unit", "place", "axis"], rows))
