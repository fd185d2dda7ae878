"""The page as a whole: its frame with tabs, status line and command, and the routes beside it."""

import datetime
import mimetypes
from pathlib import Path
from typing import Any

import dash
import flask
from dash import ClientsideFunction, Input, Output, State, dcc, html
from dash.development.base_component import Component

from selector import __version__
from selector.errors import InputError, ReadError
from selector.telling.page import TEMPLATES
from selector.workbench import parts
from selector.workbench.access import RESULT_POLICY, UPLOAD, Access, CheckedDash, answer_refusals, defect, guard
from selector.workbench.bench import Bench
from selector.workbench.commands import command_words
from selector.workbench.live import Latest
from selector.workbench.pages import Page, diagnosis, export, prediction, recordings, selection, sensors, simulation
from selector.workbench.pages.measured import BALL_BAR_PAGE, TAPS_PAGE
from selector.workbench.study_folder import RECORDINGS, UPLOADS, inside, stored, trouble_with

#: The tabs, from left to right. What a page is: see `selector.workbench.pages`.
PAGES: tuple[Page, ...] = (
    *(recordings, sensors, selection, export, prediction, simulation, diagnosis),
    *(BALL_BAR_PAGE, TAPS_PAGE),
)
_LOOK = "/look.css"  #: The style sheet of the reports, which the page begins with.

_NOTICED = "noticed"  #: Store: the revision of the bench at which the notice was said; a later one takes it away.

_SHOWN_RESULTS = (".html", ".json", ".toml", ".csv", ".txt")


def page(bench: Bench, access: Access) -> dash.Dash:
    """The application: ``page(…).server`` answers requests that `access` lets in."""
    app = CheckedDash(
        "selector.workbench",
        assets_folder=str(Path(__file__).with_name("assets")),
        serve_locally=True,
        title="selector workbench",
        update_title=None,  # type: ignore[arg-type]
        on_error=lambda error: _said(bench, error),
        external_stylesheets=[_LOOK],
        # parts of pages appear with what they show
        suppress_callback_exceptions=True,
        enable_mcp=False,
    )
    icon = '<link rel="icon" href="data:,">'  # none, not Dash's own
    app.index_string = app.index_string.replace("<html>", '<html lang="en">').replace("{%favicon%}", icon)
    app.layout = lambda: _frame(bench)
    _register(app, bench)
    for one in PAGES:
        one.register(app, bench)
    _add_routes(app.server, bench)
    guard(app.server, access, app.csp_hashes())
    answer_refusals(app.server, app)
    return app


def _frame(bench: Bench) -> Component:
    tabs = [html.A(one.TITLE, href=f"#{one.ID}", id=f"to-{one.ID}", className="tab") for one in PAGES]
    sheets = [
        html.Div(None if k else one.layout(bench), id=f"page-{one.ID}", hidden=k > 0) for k, one in enumerate(PAGES)
    ]
    unseen = [
        dcc.Store(id=parts.REVISION, data=bench.revision),
        *(dcc.Store(id=name, data=-1) for name in ("look", _NOTICED)),
        *(dcc.Store(id=name, data="") for name in (parts.AWAITED, "lacking")),
    ]
    head = [
        html.Div([html.Strong("selector"), " workbench"], title=f"selector {__version__}"),
        html.Nav(tabs, **parts.marks(aria_label="Pages")),
        html.Div(["Study folder ", html.Code(str(bench.folder))], className="about folder", title=str(bench.folder)),
        html.Div(id=parts.NOTICE),
    ]
    by_hand = [
        html.Span("The same by hand", className="title"),
        html.Code(id="command", tabIndex=0),
        html.Button("Copy", **parts.marks(data_copies="command")),
        html.Button("Write study.toml", id="save"),
        html.Span(id="saved", className="about", role="status"),
    ]
    status = html.Div(id="status", role="status", **parts.marks(aria_live="polite"))
    foot = html.Footer([status, html.Div(by_hand, id="by-hand")])
    return html.Div([*unseen, html.Header(head), html.Main(sheets), foot], id="workbench")


def _register(app: dash.Dash, bench: Bench) -> None:
    app.clientside_callback(
        ClientsideFunction("workbench", "changed"), Input(parts.REVISION, "data"), State(_NOTICED, "data")
    )

    places = [Output(f"page-{one.ID}", "children") for one in PAGES[1:]]

    @app.callback(places, Input("lacking", "data"), prevent_initial_call=True)
    def _make(lacking: str) -> list[Any]:
        return [one.layout(bench) if lacking == one.ID else dash.no_update for one in PAGES[1:]]

    app.clientside_callback(ClientsideFunction("workbench", "awaits"), Input(parts.AWAITED, "data"))

    # no Outputs: what hears of the revision would wait for this call, and be dropped where it changes nothing
    @app.callback(Input("look", "data"), State(parts.REVISION, "data"), prevent_initial_call=True)
    def _look(_: int | None, revision: int) -> None:
        if bench.revision != revision:
            parts.tell(bench)

    @app.callback(Output("saved", "children"), Input("save", "n_clicks"), prevent_initial_call=True)
    def _save(_: int) -> str:
        return f"{bench.save().name} written {datetime.datetime.now():%H:%M:%S}"


def _status(bench: Bench) -> dict[str, Any]:
    """What is being done now, how far it is, the number of its job, and what waits."""
    if bench.is_reading:
        return {"said": "Reading recordings …", "is_working": True}
    job = bench.jobs.current
    if job is None:
        lives: dict[str, Latest[Any]] = {
            "Adding up the samples …": bench.live.latest,
            "Simulating …": bench.simulated_live,
        }
        if doing := [said for said, live in lives.items() if live.is_working]:
            return {"said": doing[0], "is_working": True}
        last = bench.jobs.all[-1] if bench.jobs.all else None
        return {"said": "Ready." if last is None else f"{last.title}: {last.state}."}
    waiting = sum(not one.is_over for one in bench.jobs.all) - 1
    more = {"job": job.number, "waiting": f"{waiting} waiting" if waiting else ""}
    return {"said": f"{job.title}: {job.doing or job.state}", "is_working": True, "share": job.share, **more}


def _said(bench: Bench, error: Exception) -> None:
    """Shows what a callback could not do; a study folder that cannot be used comes first, a defect of ours says so."""
    error = trouble_with(bench.folder) or error
    if not isinstance(error, InputError):
        error = defect("a callback of the page", error)
    dash.set_props(parts.NOTICE, {"children": parts.problem(error)})
    dash.set_props(_NOTICED, {"data": bench.revision})


def _add_routes(server: flask.Flask, bench: Bench) -> None:
    server.add_url_rule("/beat", "beat", lambda: {"revision": bench.revision, "status": _status(bench)})

    @server.post("/cancel/<int:number>")
    def _cancel(number: int) -> flask.Response:
        bench.jobs.cancel(number)
        return flask.Response(status=204)

    @server.get("/command/<name>")
    def _command(name: str) -> flask.Response:
        """The words of the command that the frame shows with a page."""
        command = next((one for one in PAGES if name == one.ID), PAGES[0]).command(bench)
        return flask.jsonify([] if command is None else command_words(command))

    @server.get(_LOOK)
    def _look() -> flask.Response:
        return flask.send_file(TEMPLATES / "page.css", mimetype="text/css")

    @server.post(f"{UPLOAD}<kind>")
    def _upload(kind: str) -> flask.Response:
        """Stores the body of the request; the answer says the name, or why it is refused."""
        if kind not in UPLOADS:
            return flask.Response("no such folder\n", 404)
        said = flask.request.args.get("name", "")
        length = flask.request.content_length
        try:
            path = stored(bench.folder / kind, said, flask.request.stream.read, length)
        except InputError as refused:
            status = 413 if isinstance(refused, ReadError) else 507
            return flask.Response(f"{trouble_with(bench.folder) or refused}\n", status, mimetype="text/plain")
        if kind == RECORDINGS:
            bench.add(path)
        else:
            bench.changed()
        return flask.Response(f"{path.name}\n", 201, mimetype="text/plain")

    @server.get("/results/<path:relative>")
    def _result(relative: str) -> flask.Response:
        """A file of the study folder that a command wrote; pages run in an origin of their own."""
        path = inside(bench.folder, relative)
        if path is None or path.relative_to(bench.folder).parts[0] in UPLOADS:
            return flask.Response("There is no such result.\n", 404, mimetype="text/plain")
        is_shown = path.suffix in _SHOWN_RESULTS and "download" not in flask.request.args
        kind = mimetypes.types_map.get(path.suffix, "text/plain") if path.suffix == ".html" else "text/plain"
        answer = flask.send_file(path, mimetype=kind, as_attachment=not is_shown, download_name=path.name)
        answer.headers["Content-Security-Policy"] = RESULT_POLICY
        answer.headers["X-Frame-Options"] = "SAMEORIGIN"
        return answer
