"""Predict: a duty cycle that is drawn, heating tests, and what comes out: the course and the correction program."""

import dataclasses
from functools import partial
from pathlib import Path
from typing import Any

import dash
from dash import Input, Output, State, dcc, html
from dash.development.base_component import Component

from selector.controllers.timed_program import TARGETS
from selector.errors import OptionError
from selector.figures.duty_cycle import drawn_cycle
from selector.telling.predicted import prediction_account
from selector.telling.result_file import prediction_of
from selector.workbench import parts
from selector.workbench.bench import Bench
from selector.workbench.boxes import Box, Boxes, one_of, one_path, several, tick
from selector.workbench.commands import PREDICTION, prediction_command
from selector.workbench.cycle import Step, steps_text, typed_steps
from selector.workbench.typed import FIELDS

ID, TITLE = "prediction", "Predict"

_FILES = (
    ("report.html", "Report"),
    ("program.csv", "Program (CSV)"),
    ("program.txt", "Program as blocks"),
    ("prediction.json", "All results (JSON)"),
)


def _boxes(bench: Bench) -> Boxes:
    def tests(paths: list[str] | None) -> tuple[Path, ...]:
        return tuple(path for path in bench.used if str(path) in (paths or ()))

    of_role = partial(partial, bench.channels)
    day = "a recording of thermometers, not used as a test: finds stops that were not planned"
    about = "Recordings with a spindle speed. None: all that are used."
    chosen = several("tests", "Heating and cooling tests", about, bench.used_as_options)
    boxes = (
        dataclasses.replace(chosen, read=tests, shown=lambda paths: [str(path) for path in paths]),
        several("responses", FIELDS["--response"], "None: all that are there.", of_role("displacement", "temperature")),
        one_of("method", FIELDS["--method"], ["modal", "piecewise"]),
        Box("operations", FIELDS["--operations"], "minutes, e.g. 60,60,45; empty: no program"),
        Box("tolerance", FIELDS["--tolerance"], "µm, e.g. 10; one an operation: 10,5,10; empty: no program"),
        Box("warm_up", FIELDS["--warm-up"], "at most so many minutes, e.g. 60; empty: none is looked for"),
        tick("order", FIELDS["--order"]),
        one_of("nc", FIELDS["--nc"], ["", *TARGETS]),
        Box("invert", "Counted the other way", "responses whose axis the control turns round, for the NC program"),
        one_path("readings", FIELDS["--readings"], day, lambda: {str(one.path): one.path.name for one in bench.loaded}),
        several("observe", FIELDS["--observe"], "None: all that day and tests have.", of_role("temperature")),
    )
    return Boxes(ID, boxes, lambda: bench.prediction, bench.choose_prediction)


def layout(bench: Bench) -> Component:
    """The cycle as a picture and as text, what is asked, Start, and the answer."""
    boxes = _boxes(bench)
    graph = dcc.Graph(id=f"{ID}-cycle", responsive=True, config={"displayModeBar": False}, style={"height": 300})
    about = "Drag a handle up and down for the speed, its end to the sides for the time; or type the steps below."
    typed_steps_field = parts.field(
        "Steps", parts.typed_text(f"{ID}-steps", steps_text(bench.cycle.steps)), "minutes at r/min, apart by semicolons"
    )
    return parts.stacked(
        html.H1("A duty cycle: how far it drifts, and when to correct"),
        html.Figure([html.Figcaption([html.H3("The duty cycle"), html.P(about)]), html.Div(graph, className="plot")]),
        typed_steps_field,
        html.Div(boxes.fields(), className="fields wide"),
        parts.start_row(ID),
        *parts.answer_place(ID),
        boxes.followed(),
        *(dcc.Store(id=f"{ID}-{name}", data=None) for name in ("dragged", "drawn")),
    )


def command(bench: Bench) -> tuple[str, ...] | None:
    """`selector predict` with what is asked."""
    reading = bench.inspection.reading
    if reading is None or not bench.cycle.steps or not reading.recording.with_role("spindle_speed"):
        return None
    return prediction_command(bench.folder, bench.prediction, bench.used, bench.machine, bench.overrides)


def register(app: dash.Dash, bench: Bench) -> None:
    """What is typed, chosen or dragged goes to the bench at once."""

    @app.callback(
        Output(f"{ID}-cycle", "figure"),
        Output(f"{ID}-drawn", "data"),
        Input(parts.REVISION, "data"),
        State(f"{ID}-drawn", "data"),
        State(f"{ID}-steps", "value"),
    )
    def _draw(_: int, drawn: Any, shown: str | None) -> tuple[Any, Any]:
        text = steps_text(bench.cycle.steps)
        if text == drawn:
            raise dash.exceptions.PreventUpdate
        parts.follow([f"{ID}-steps"], [shown], [drawn], [text])
        picture = drawn_cycle(bench.cycle.steps)
        return picture.update_layout(title=None, width=None, autosize=True), text

    @app.callback(Input(f"{ID}-dragged", "data"), prevent_initial_call=True)
    def _dragged(steps: list[list[float]] | None) -> None:
        found = [Step(*one) for one in steps or () if len(one) == 2 and 0 < one[0] < 1e6 and 0 <= one[1] < 1e6]
        if found:
            bench.choose_cycle(found)
            parts.tell(bench)

    def take(text: str | None, drawn: str | None) -> None:
        if text == drawn:
            # a cycle that was dragged meanwhile is newer than what the page itself wrote there
            return
        with parts.typed_over([f"{ID}-steps"], [text], lambda: [steps_text(bench.cycle.steps)]) as read:
            if bench.choose_cycle(read(lambda: typed_steps(text), bench.cycle.steps)):
                parts.tell(bench)

    steps = parts.Form(((f"{ID}-steps", "value"),), take, ((f"{ID}-drawn", "data"),))
    steps.register(app)
    form = _boxes(bench).register(app, bench)
    missing = OptionError(
        "nothing to predict from",
        expected="recordings of heating and cooling tests with a spindle speed, and a duty cycle",
        where=TITLE,
        advice="load tests on the first page, and draw the cycle here",
    )
    how = (command, lambda _: PREDICTION, missing, [steps, form])
    # the file of a duty cycle that nobody has changed
    task = parts.Task(ID, TITLE, *how, answered=_answered, prepare=lambda _: bench.choose_cycle(bench.cycle.steps))
    parts.register_task(app, bench, task)


def _answered(bench: Bench, stamp: str, _: Any) -> Component | None:
    result = bench.result(f"{PREDICTION}/prediction.json")
    if result is None:
        return None
    told = parts.told(prediction_account(prediction_of(result), drawn=True), ("cycle", "program"))
    nc = result.get("nc")
    files = _FILES if nc is None else (*_FILES, (nc["file"], "NC subprogram"), ("nc_sheet.txt", "Its sheet"))
    return parts.answer(bench, PREDICTION, files, "Report of the prediction", stamp, *told)
