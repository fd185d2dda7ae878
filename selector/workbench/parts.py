"""What pages are made of: small components that look alike everywhere, and the names that the frame gives them."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice, pairwise, takewhile
from pathlib import Path
from typing import Any, TypeVar, get_args
from urllib.parse import quote

import dash
import flask
import plotly.graph_objects as go
from dash import ALL, Input, Output, State, dcc, html, set_props
from dash.development.base_component import Component
from dash.exceptions import PreventUpdate

from selector.csv_text import csv_text
from selector.errors import InputError, OptionError
from selector.figures import style
from selector.findings import Finding, Level
from selector.telling.account import Account, Captioned, Drawing, Listing
from selector.workbench.access import checked
from selector.workbench.bench import Bench
from selector.workbench.jobs import Job
from selector.workbench.study_folder import REMOVED, put_away
from selector.workbench.typed import FIELDS, in_words_of_fields

#: Store of the frame: `Bench.revision` as the page shows it. ``Input(REVISION, "data")`` hears of every change.
REVISION = "revision"

#: How figures behave.
GRAPH: Any = {
    "displaylogo": False,
    "modeBarButtonsToRemove": ["lasso2d", "select2d"],
    "toImageButtonOptions": {"scale": 2},
}

_MOST_SEEN = 6
_Read = TypeVar("_Read")

NOTICE = "notice"  #: Place of the frame for what a callback could not do.
AWAITED = "awaited"  #: Store of the frame: the page whose answer is awaited; the browser goes there when it comes.


def tell(bench: Bench) -> None:
    """At the end of a callback that changed the bench: shows it at once, not when the frame looks the next time."""
    set_props(REVISION, {"data": bench.revision})


def marks(**attributes: str) -> dict[str, Any]:
    """Attributes of HTML whose names have hyphens: ``marks(aria_label="Pages")`` is ``{"aria-label": "Pages"}``."""
    return {name.replace("_", "-"): value for name, value in attributes.items()}


def problem(error: InputError) -> Component:
    """What the reader, or an option, says about unusable input."""
    rows = (("Where", error.where), ("Expected", error.expected), ("What to do", error.advice))
    lines = [html.P([html.Strong(f"{name}: "), in_words_of_fields(text)]) for name, text in rows if text]
    found = in_words_of_fields(error.found[:1].upper() + error.found[1:])
    return html.Div([html.P(found, className="first"), *lines], className="advice bad", role="alert")


def remarks(findings: Iterable[Finding], beside: Callable[[Finding], list[Any]] = lambda _: []) -> Component:
    """Findings as the report shows them, the worst first; a kind and level once; `beside`: what else stands there."""
    kinds: dict[tuple[str, str], list[Finding]] = {}
    for finding in sorted(findings, key=lambda one: get_args(Level).index(one.level), reverse=True):
        kinds.setdefault((finding.level, finding.id), []).append(finding)
    return html.Ul([_kind(alike, beside) for alike in kinds.values()], className="remarks")


def _kind(alike: Sequence[Finding], beside: Callable[[Finding], list[Any]]) -> Component:
    """The first finding of a kind, where else there are such ones, and all of them to be unfolded."""
    first, *others = alike
    if not others:
        return _remark(first, beside)
    places = list(dict.fromkeys(place for one in others if (place := _place(one)) and place != _place(first)))
    more = f"{len(others)} more like it" + (f": {'; '.join(places)}" if places else "")
    every = html.Ul([_remark(one, beside) for one in others])
    entry = _remark(first, beside)
    entry.children = [*entry.children, html.Details([html.Summary(more), every])]
    return entry


def _place(finding: Finding) -> str:
    return ", ".join(part for part in (finding.where.run, finding.where.channel) if part)


def _remark(finding: Finding, beside: Callable[[Finding], list[Any]]) -> Component:
    place = _place(finding)
    first: list[Any] = [html.Span(finding.level, className="level"), f" {place}: " if place else " ", finding.statement]
    advice = in_words_of_fields(finding.suggestion)
    more = [html.P(f"→ {advice}", className="about")] if advice else []
    return html.Li([html.P(first), *more, *beside(finding)], className=finding.level)


def table(
    columns: Sequence[str], rows: Iterable[Sequence[Any]], numeric: Sequence[str] = (), name: str = ""
) -> Component:
    """A table of texts and components in a frame that scrolls sideways; columns in `numeric` stand to the right."""
    classes = ["number" if column in numeric else "" for column in columns]
    head = html.Tr(
        [html.Th(column, className=kind, scope="col") for column, kind in zip(columns, classes, strict=True)]
    )
    body = [html.Tr([html.Td(cell, className=kind) for cell, kind in zip(row, classes, strict=True)]) for row in rows]
    return html.Div(html.Table([html.Thead(head), html.Tbody(body)], className=name), className="scroll")


def graph(drawn: go.Figure, title: str = "", note: str = "") -> Component:
    """A figure with its title, or another one, as a heading, as wide as the page."""
    title = title or style.title_text(drawn)
    top = drawn.layout.margin.t or 0
    lifted = max(0, int(top) - style.TITLE_MARGIN)
    drawn.update_layout(title=None, width=None, height=drawn.layout.height - lifted, margin={"t": top - lifted})
    shown = dcc.Graph(figure=drawn, responsive=True, config=GRAPH, style={"height": drawn.layout.height})
    return html.Figure([html.Figcaption([html.H3(title), html.P(note)]), html.Div(shown, className="plot")])


def told(account: Account, kept: Sequence[str] = ()) -> list[Component]:
    """Sentences, pictures and tables of an account, of the sections with these ids, if any; the rest is in its page."""
    look = "advice" if account.verdict == "good" else f"advice {account.verdict}"
    said = [html.P(text, className="" if k else "first") for k, text in enumerate(account.sentences)]
    found: list[Component] = [html.Div(said, className=look)] if said else []
    parts = (part for part in account.sections if not kept or part.id in kept)
    for one, title in ((block, part.title) for part in parts for block in part.blocks):
        if isinstance(one, Drawing):
            found.append(graph(one.figure, one.title, one.text))
        elif isinstance(one, Captioned):
            columns = [column.name for column in one.table.columns]
            numeric = [column.name for column in one.table.columns if column.numeric]
            shown = table(columns, one.table.rows, numeric, name="told")
            found.append(html.Details([html.Summary(one.caption or title), shown]))
        elif isinstance(one, Listing):
            found.append(html.Pre(one.text, tabIndex=0))
    return found


def choice(options: Sequence[Any], name: Any, value: str | None) -> Component:
    """One of a few words, or of what stands for them."""
    of = list(options)
    return dcc.Dropdown(id=name, options=of, value=value, clearable=False, searchable=len(of) > _MOST_SEEN)


def typed_text(name: Any, value: str | None, **more: Any) -> Component:
    """A text that is heard of when its field is left, or with Enter."""
    return dcc.Input(id=name, value=value, type="text", debounce=True, **more)


def field(title: str, control: Component, note: str = "") -> Component:
    """A control with its title, and a note below it."""
    below = [html.Span(note, className="about")] if note else []
    return html.Label([html.Span(title, className="title"), control, *below], className="field")


def drop_zone(kind: str, button: str, note: str) -> Component:
    """Where files of a kind of upload are chosen or dropped."""
    return html.Div(
        [
            html.Button(button, className="main", **marks(data_chooses=kind)),
            html.Span(f" {note}"),
            html.Div(className="uploads", role="status"),
        ],
        className="drop",
        **marks(data_uploads=kind),
    )


def stacked(*children: Any) -> Component:
    """Parts of a page, one below the other."""
    return html.Div(list(children))


def section(title: str, *children: Any, note: str = "") -> Component:
    """A part of a page with a heading."""
    below = [html.P(note, className="about")] if note else []
    return html.Section([html.H2(title), *below, *children])


def framed(relative: str, title: str, stamp: str = "") -> Component:
    """A page that a command wrote, e.g. ``"selection/report.html"``: shown in an origin of its own.

    It is loaded again when `stamp` is another one.
    """
    address = f"/results/{quote(relative)}?{stamp}"
    return html.Iframe(src=address, title=title, sandbox="allow-scripts allow-downloads", className="sheet")


def download(relative: str, text: str) -> Component:
    """A link that saves a file of the study folder."""
    return html.A(text, href=f"/results/{quote(relative)}?download=1", download=relative.rpartition("/")[2])


@contextmanager
def typed_over(
    boxes: Sequence[Any], sent: Sequence[str | None], counts: Callable[[], Sequence[str]]
) -> Iterator[Callable[[Callable[[], _Read], _Read], _Read]]:
    """Around what takes typed texts over: afterwards the fields show what counts; what was refused stays there.

    Gives a function that reads a field, or gives its second argument where the field is refused. Raises OptionError at
    the end, the first refusal: what stands in the other fields could be taken.
    """
    refused: list[OptionError] = []

    def read(reading: Callable[[], _Read], otherwise: _Read) -> _Read:
        try:
            return reading()
        except OptionError as error:
            refused.append(error)
            return otherwise

    yield read
    if refused:
        raise refused[0]
    follow(boxes, sent, [None] * len(boxes), counts())


def follow(boxes: Sequence[Any], shown: Sequence[Any], before: Sequence[Any], now: Sequence[Any]) -> None:
    """Fields show what counts now where it is other than before: elsewhere somebody may be typing, or was refused."""
    for box, text, was, counts in zip(boxes, shown, before, now, strict=True):
        if counts not in (was, text):
            set_props(box, {"value": counts})


Place = tuple[Any, str]  #: Id of a component, and one of its properties.


@dataclass(frozen=True)
class Form:
    """Fields of a page, and what takes over what stands in them."""

    fields: tuple[Place, ...]  #: What is taken over as soon as it is changed
    #: Takes what stands in `fields` and `beside`, in this order, to the bench and tells it, or raises `InputError`
    take: Callable[..., None]
    beside: tuple[Place, ...] = ()  #: What `take` must know, too

    def register(self, app: dash.Dash) -> None:
        """What is changed goes to the bench at once, so that the command shows it."""
        heard = (Input(*place) for place in self.fields)

        @app.callback(*heard, *(State(*place) for place in self.beside), prevent_initial_call=True)
        def _take(*sent: Any) -> None:
            self.taken(sent)

    def taken(self, sent: Iterable[Any]) -> None:
        """Takes over what a browser sent. What was refused before is no longer told, be it that nothing is changed."""
        checked(self.take)(*sent)
        set_props(NOTICE, {"children": None})


@dataclass(frozen=True)
class Task:
    """What a page has done: its command, which writes a folder, and how the answer in there is shown."""

    page: str  #: Ids: button ``{page}-start``, place ``{page}-answer``, store ``{page}-answered``
    title: str
    command: Callable[[Bench], Sequence[str] | None]  #: Changes nothing
    folder: Callable[[Bench], str]  #: In the study folder
    missing: InputError  #: What is missing where there is no command
    forms: Sequence[Form] = ()
    sheet: str = "report.html"  #: The file in the folder that tells one answer from another
    #: The results, from a stamp that tells this sheet from another one and what the command said to programs
    answered: Callable[[Bench, str, dict[str, Any] | None], Any] = lambda bench, stamp, said: None
    is_asked_as_data: bool = False  #: Whether the command is asked what it says to programs
    prepare: Callable[[Bench], object] = lambda bench: None  #: Writes what the command needs, when it is started
    elsewhere: Callable[[Bench], Sequence[str] | None] = lambda bench: None  #: As `command`, of another page
    unwritten: Callable[[Bench], Iterable[str]] = lambda bench: ()  #: What `prepare` would write otherwise than it is


def register_start(app: dash.Dash, bench: Bench, page: str, task: Task) -> None:
    """The button ``{page}-start`` puts the command of a task into the queue; the browser goes on to the answer.

    It first takes over what stands in the page's fields: the browser sends the end of typing and the click together,
    and what was refused is refused again instead of what counted before being started.
    """
    places = [place for form in task.forms for place in (*form.fields, *form.beside)]

    @app.callback(Input(f"{page}-start", "n_clicks"), *(State(*place) for place in places), prevent_initial_call=True)
    def _start(_: int, *shown: Any) -> None:
        stands = iter(shown)
        for form in task.forms:
            form.taken(islice(stands, len(form.fields) + len(form.beside)))
        asked = task.command(bench)
        if asked is None:
            raise task.missing.with_traceback(None)
        task.prepare(bench)
        data = ["--json"] if task.is_asked_as_data else []
        job = bench.start(task.title, [*asked, *data], bench.folder / task.folder(bench))
        set_props(AWAITED, {"data": [task.page, job.number]})
        tell(bench)


def register_task(app: dash.Dash, bench: Bench, task: Task) -> None:
    """The button of a page, and its place of the answer: what the last job with this title said and wrote.

    Above it stands what was chosen or made since. What is shown stays as it is, opened details too, where nothing of it
    is different.
    """
    register_start(app, bench, task.page, task)

    @app.callback(
        Output(f"{task.page}-answer", "children"),
        Output(f"{task.page}-answered", "data"),
        Input(REVISION, "data"),
        State(f"{task.page}-answered", "data"),
    )
    def _answer(_: int, was: Any) -> tuple[Any, Any]:
        job = next((job for job in reversed(bench.jobs.all) if job.title == task.title), None)
        path = bench.folder / task.folder(bench) / task.sheet
        stamp = str(path.stat().st_mtime_ns if path.is_file() else 0)
        now = [None if job is None else [job.number, job.state], stamp]
        if now == was:
            raise PreventUpdate
        said = None if job is None or job.out != path.parent else job.data
        shown = [None if job is None else job_answer(job), task.answered(bench, stamp, said)]
        # what a command printed says the answer again, folded; trouble and patience come before an earlier answer
        return shown[::-1] if job is not None and job.state == "done" else shown, now

    @app.callback(Output(f"{task.page}-earlier", "children"), Input(REVISION, "data"))
    def _earlier(_: int) -> Component | None:
        sheet = bench.folder / task.folder(bench) / task.sheet
        then = [job.command for job in bench.jobs.all if job.state == "done" and job.out == sheet.parent]
        ways = [command for command in (task.command(bench), task.elsewhere(bench)) if command is not None]
        if not then or not ways or not sheet.is_file():
            return None
        others = min((differing_fields(command, then[-1]) for command in ways), key=len)
        newer = made_since(bench, task, then[-1])
        if others or newer:
            said = f"The answer was made before this changed: {', '.join([*others, *newer])}. Start again."
            return html.P(said, className="advice first bad")
        elsewhere = differing_fields(ways[0], then[-1])
        said = f"The answer was started on another page. Started here, these would be others: {', '.join(elsewhere)}."
        return html.P(said, className="about") if elsewhere else None


def made_since(bench: Bench, task: Task, command: Sequence[str]) -> list[str]:
    """What the command of an answer read, and was changed since; what it wrote itself may be later than its sheet."""
    sheet = bench.folder / task.folder(bench) / task.sheet
    read = [bench.folder / word for word in command if not word.startswith("-")]
    made = [path for path in read if path.exists() and sheet.parent not in (path, *path.parents)]
    newer = [path.name for path in made if _changed_ns(path) > sheet.stat().st_mtime_ns]
    return list(dict.fromkeys([*newer, *task.unwritten(bench)]))


def _changed_ns(path: Path) -> int:
    """When a file, or what is in a folder, was last changed; that one was taken away, too."""
    return max(one.stat().st_mtime_ns for one in (path, *(path.iterdir() if path.is_dir() else ())))


def differing_fields(one: Sequence[str], other: Sequence[str]) -> list[str]:
    """The fields that decide what two commands ask differently; last, that they are about other files."""
    files = [list(takewhile(lambda word: not word.startswith("--"), command)) for command in (one, other)]
    differing = {
        f"{FIELDS.get(option, option)} of {value.partition('=')[0]}" if "=" in value else FIELDS.get(option, option)
        for option, value in _options(one) ^ _options(other)
    }
    return [*sorted(differing), *(["the files"] if files[0] != files[1] else [])]


def _options(command: Sequence[str]) -> set[tuple[str, str]]:
    """(option, value) of a command; a flag has the next word, or none, for its value."""
    return {(word, value) for word, value in pairwise((*command, "")) if word.startswith("--") and word != "--json"}


def answer_place(page: str) -> list[Component]:
    """Where the answer of a page's `Task` is shown, below what was chosen or made since."""
    earlier = html.Div(id=f"{page}-earlier", role="status")
    return [earlier, html.Div(id=f"{page}-answer"), dcc.Store(id=f"{page}-answered", data=None)]


def start_row(page: str, text: str = "Start") -> Component:
    """The button of a page's `Task`."""
    return html.Div([html.Button(text, id=f"{page}-start", className="main")], className="row")


def saved(bench: Bench, folder: str, files: Iterable[tuple[str, str]]) -> Component:
    """Links that save those files of an answer that there are: name, and what it is called."""
    there = [(name, text) for name, text in files if (bench.folder / folder / name).is_file()]
    links = [download(f"{folder}/{name}", text) for name, text in there]
    return html.Div([html.Span("Save: "), *links], className="row")


def answer(
    bench: Bench, folder: str, files: Iterable[tuple[str, str]], title: str, stamp: str, *first: Component
) -> Component:
    """What a command answered: first what is told of it, then its files to be saved, and its report."""
    report = framed(f"{folder}/report.html", title, stamp)
    return section("The answer", *first, saved(bench, folder, files), report)


def register_stored(
    app: dash.Dash,
    bench: Bench,
    page: str,
    files: Callable[[], Iterable[Path]],
    more: dict[str, Callable[[Path], str]],
    nothing: Callable[[], Component | None] = lambda: None,
) -> None:
    """In ``{page}-stored``: files of the study folder, `more` columns, and a button that removes each of them."""

    def row(path: Path) -> list[Any]:
        about: dict[str, Any] = {"title": f"It goes to the folder {REMOVED}", "aria-label": f"Remove {path.name}"}
        remove = html.Button("Remove", id={"type": f"{page}-remove", "file": path.name}, **about)
        return [path.name, *(text(path) for text in more.values()), remove]

    @app.callback(Output(f"{page}-stored", "children"), Input(REVISION, "data"))
    def _show(_: int) -> Component | None:
        rows = [row(path) for path in files()]
        return table(["file", *more, ""], rows, name="files") if rows else nothing()

    @app.callback(Input({"type": f"{page}-remove", "file": ALL}, "n_clicks"), prevent_initial_call=True)
    def _remove(clicks: list[int | None]) -> None:
        for path in files() if any(clicks) else ():
            if path.name == dash.ctx.triggered_id["file"]:
                put_away(bench.folder, path)
                bench.changed()
        tell(bench)


def table_download(name: str) -> Component:
    """A link that saves a table as CSV; `register_table` answers it."""
    return html.A("Download as CSV", href=f"/tables/{name}.csv", download=f"{name}.csv")


def register_table(
    app: dash.Dash, name: str, columns: Sequence[str], rows: Callable[[], Iterable[Sequence[object]]]
) -> None:
    """The address of `table_download` gives the table as it is then, with nothing in it that a spreadsheet runs."""

    def given() -> flask.Response:
        # a spreadsheet takes a text without the mark for one of its own country
        content = csv_text(columns, rows()).encode("utf-8-sig")
        headers = {"Content-Disposition": f"attachment; filename={name}.csv"}
        return flask.Response(content, mimetype="text/csv", headers=headers)

    server: flask.Flask = app.server
    server.add_url_rule(f"/tables/{name}.csv", name, given)


def job_answer(job: Job) -> Component:
    """What a job said; while it runs, that it does."""
    if job.state == "cancelled":
        return html.P(f"{job.title}: cancelled; nothing was written.", className="about")
    if not job.is_over:
        return html.P(f"{job.title}: running; the bar below says how far it is.", className="about", role="status")
    if job.problem is not None:
        # the command itself only met a file that is not there
        return problem(job.problem)
    if job.state == "failed":
        said = html.Pre(in_words_of_fields(job.said.removeprefix("selector: ")))
        return html.Div(
            [html.P(f"{job.title}: not done", className="first"), said], className="advice bad", role="alert"
        )
    if job.data is not None:
        return html.Div()
    return html.Details([html.Summary("What the command said"), html.Pre(job.said, className="said", tabIndex=0)])
