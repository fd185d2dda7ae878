"""Sensors: how many, which, and what they reach; groups, model, errors and faults move with the dials.

A move of the slider must be seen at once. So it does not go through Dash, whose renderer takes longer than the
numbers and the pictures together: the browser asks the server for what changes and puts it into the pictures itself
(``assets/sensors.js``). What the bench changes comes through Dash as on any other page.
"""

from contextlib import suppress
from typing import Any

import dash
import flask
from dash import ClientsideFunction, Input, Output, State, dcc, html, no_update
from dash.development.base_component import Component

from selector.errors import InputError, OptionError
from selector.workbench import parts
from selector.workbench.bench import Bench
from selector.workbench.commands import SELECTION, command_text, option_arguments
from selector.workbench.live import View
from selector.workbench.pages.sensors import machine, pictures, wishes
from selector.workbench.pages.sensors.machine import ID
from selector.workbench.study_folder import no_recordings
from selector.workbench.typed import FIELDS, above_zero, in_words_of_fields, number

__all__ = ["ID", "TITLE", "command", "layout", "register"]

TITLE = "Sensors"

_NOTE = (
    "The error on left-out runs is here that of sets as they are: coefficients are fitted anew without each run, but "
    "the choice of the set has seen them all, so it flatters. “Run this selection” at a λ chooses anew without each "
    "run; of a set that was taken it proves this set and no other."
)
LAMBDA = (
    "λ says how alike two sensors must move to be in one group, of which one sensor is offered. Near 1 every sensor is "
    "alone and all are compared; lower, groups are fewer and larger, and sensors that say the same are out."
)
_LINEAR = "Numbers and pictures are of linear models without memory; the command asks for all that Selection asks for."
_WAITS = "Adding up the samples … For the first time after an installation it takes a minute: the search is compiled."
_GRAPH: Any = {**parts.GRAPH, "displayModeBar": False}


def layout(bench: Bench) -> Component:
    """The dials, pictures in two columns, groups, wishes."""
    return parts.stacked(
        html.H1("Sensors: how many, and which"),
        html.Div("Load recordings that can be read first.", id=f"{ID}-wait", className="about", role="status"),
        html.Div(
            [
                # filled by sensors.js
                html.Div(id=f"{ID}-bar", className="lambda"),
                html.P(LAMBDA, id=f"{ID}-lambda", className="about"),
                html.P(_LINEAR, className="about"),
                html.Div([_picture(name) for name in pictures.NAMES], className="pictures"),
                html.P(_NOTE, className="about"),
                parts.section(
                    "Groups", html.Div(id=f"{ID}-groups", className="scroll"), parts.table_download("groups")
                ),
                wishes.table(bench),
                machine.controls(),
                parts.start_row(ID, "Run this selection"),
            ],
            id=f"{ID}-body",
            hidden=True,
        ),
        dcc.Store(id=f"{ID}-shown", data=None),
        dcc.Store(id=f"{ID}-now", data=None),
        # a λ that was typed and is not looked at, or not yet: kept by sensors.js
        dcc.Store(id=f"{ID}-typed", data=None),
    )


def command(bench: Bench) -> tuple[str, ...] | None:
    """`selector select` that looks only at the λ or the set that is shown."""
    view = _seen(bench)
    if view is None:
        return None
    return ("select", *bench.source_arguments(), *option_arguments(view.options(bench.options)), "--out", SELECTION)


def register(app: dash.Dash, bench: Bench) -> None:
    """The whole page after a change of the bench; what changed in it after a move."""
    machine.register(app, bench)

    def take_level(text: str | None) -> None:
        if text is not None and _view(bench) is not None:
            _moved(bench, {"level": text})

    forms = (wishes.register(app, bench), parts.Form((), take_level, ((f"{ID}-typed", "data"),)))
    parts.register_table(app, "groups", pictures.GROUP_COLUMNS, lambda: pictures.group_rows(_seen(bench)))

    @app.callback(
        Output(f"{ID}-body", "hidden"),
        Output(f"{ID}-wait", "children"),
        Output(f"{ID}-shown", "data"),
        Output(f"{ID}-now", "data"),
        *(Output(f"{ID}-{name}", "figure") for name in pictures.NAMES),
        Input(parts.REVISION, "data"),
        Input(f"page-{ID}", "hidden"),
        State(f"{ID}-shown", "data"),
    )
    def _show(_: int, is_hidden: bool, shown: Any) -> tuple[Any, ...]:
        if is_hidden:
            # the samples are added up when somebody wants to see it
            raise dash.exceptions.PreventUpdate
        nothing = (None, no_update, *(no_update for _ in pictures.NAMES))
        try:
            view = _view(bench)
        except InputError as refused:
            return (True, parts.problem(refused), *nothing)
        if view is None:
            return (True, _WAITS if bench.inspection.reading else "Load recordings that can be read first.", *nothing)
        now = _signature(bench, view)
        if now == shown:
            raise dash.exceptions.PreventUpdate
        drawn = pictures.frames(view, machine.pins(bench), machine.photos(bench))
        found = view.exploration.findings
        return (False, parts.remarks(found) if found else "", now, _told(bench, view), *drawn.values())

    app.clientside_callback(
        ClientsideFunction("sensors", "show"), Output(f"{ID}-bar", "title"), Input(f"{ID}-now", "data")
    )

    server: flask.Flask = app.server

    @server.post(f"/{ID}/move")
    def _move() -> flask.Response:
        """What a move of the slider, a number, a click on a point changes."""
        try:
            return flask.jsonify(_moved(bench, flask.request.get_json()))
        except InputError as refused:
            return flask.jsonify({"refused": in_words_of_fields(str(refused))})
        except (TypeError, ValueError, OverflowError) as wrong:
            return flask.jsonify({"refused": f"this move cannot be understood: {wrong}"})

    task = parts.Task("selection", "Selection", command, lambda _: SELECTION, no_recordings(TITLE), forms)
    parts.register_start(app, bench, ID, task)


def _seen(bench: Bench) -> View | None:
    with suppress(InputError):
        return _view(bench)
    return None


def _moved(bench: Bench, asked: Any) -> dict[str, Any]:
    """Looks where the browser asks to look; what is different then.

    `asked` holds nothing, or one of ``step`` (number of the step of λ, the coarsest 0), ``level`` and ``target`` (as
    they were typed), ``size`` (of the best set of so many sensors), ``take`` (sensors; none: the set of λ) and
    ``response``.
    """
    view = _view(bench)
    if view is None or not isinstance(asked, dict):
        raise OptionError("nothing to move", expected="recordings", where=TITLE, advice="load some first")
    exploration = view.exploration
    if "step" in asked:
        last = len(exploration.steps) - 1
        bench.live.look_at(level=exploration.level_of(last - min(max(int(asked["step"]), 0), last)))
    elif "level" in asked:
        level = number(str(asked["level"]), FIELDS["--lambda"], 0.0, 1.0)
        exploration.cut(level)
        bench.live.look_at(level=level)
    elif "target" in asked:
        bench.choose(target=above_zero(str(asked["target"]), FIELDS["--target"], "µm"))
        bench.live.look_at(taken=_reaching(bench, view) or None)
    elif "size" in asked or "take" in asked:
        sets, size = exploration.best_sets, int(asked.get("size", 0))
        chosen = asked["take"] if "take" in asked else sets[min(sets, key=lambda one: abs(one - size))]
        sensors = tuple(map(str, chosen))
        if sensors:
            exploration.fixed(sensors)
        bench.live.look_at(taken=sensors)
    elif "response" in asked:
        bench.live.look_at(response=str(asked["response"]))
    view = bench.live.view(exploration, bench.options)
    return {**_told(bench, view), "changes": pictures.moved(view, machine.pins(bench))}


def _reaching(bench: Bench, view: View) -> tuple[str, ...]:
    """The smallest of the best sets that is within the target; none if there is none, or no target."""
    target, sets = bench.options.target, view.exploration.best_sets
    errors = {size: view.exploration.fixed(sets[size]).models[view.response].heldout_rmse_um for size in sorted(sets)}
    return next((sets[size] for size, error in errors.items() if target is not None and error <= target), ())


def _told(bench: Bench, view: View) -> dict[str, Any]:
    """What the page says, pictures excepted."""
    asked = command(bench)
    return {
        "looks": view.looks,
        "step": view.step,
        "last": len(view.exploration.steps) - 1,
        "level": view.level,
        "size": len(view.fixed.sensors),
        "sizes": sorted(view.exploration.best_sets),
        "target": "" if view.target_um is None else f"{view.target_um:g}",
        "is_taken": view.is_taken,
        "responses": list(view.exploration.question.responses),
        "response": view.response,
        "facts": pictures.facts(view),
        "groups": pictures.groups(view),
        "titles": pictures.titles(view),
        "command": "" if asked is None else command_text(asked),
    }


def _view(bench: Bench) -> View | None:
    found = bench.live.exploration(bench.inspection, bench.options)
    return None if found is None else bench.live.view(found, bench.options)


def _signature(bench: Bench, view: View) -> str:
    """What the whole page must be drawn anew for; text, since numbers and lists come back from a browser as others."""
    asked = bench.options
    places = [one.xyz_m for one in machine.sensors_of(bench)]
    return repr((
        bench.inspection.number, asked.must, asked.never, asked.cost, asked.max_sensors, asked.reference,
        asked.responses, asked.absolute_similarity, asked.conditions, places,
        [hash(address) for address in machine.photos(bench).values()],
        view.level, view.fixed.sensors, view.response, view.target_um,
    ))  # fmt: skip


def _picture(name: str) -> Component:
    caption = html.Figcaption([html.H3(id=f"{ID}-{name}-title"), html.P(pictures.NOTES[name])])
    graph = dcc.Graph(id=f"{ID}-{name}", responsive=True, config=_GRAPH, style={"height": "100%"})
    return html.Figure([caption, html.Div(graph, className=f"plot {name}")])
