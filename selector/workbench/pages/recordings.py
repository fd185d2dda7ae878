"""Recordings: load them, see what is wrong with them and how they were read, and correct that by hand."""

import math
from dataclasses import asdict, dataclass, replace
from typing import Any

import dash
from dash import ALL, ClientsideFunction, Input, Output, State, dcc, html, no_update
from dash.development.base_component import Component

from selector.figures.simulated.thermal import courses
from selector.findings import Finding
from selector.number_text import span_text
from selector.quality import stretches
from selector.readers import Overrides
from selector.readers.finding_table import ROLES_GUESSED, RUN_REPAIRED, TWO_LOGGERS
from selector.shipped import shipped
from selector.units import ROLES
from selector.workbench import parts, typed
from selector.workbench.bench import Bench
from selector.workbench.commands import option_of, told_path
from selector.workbench.cycle import cycle_in
from selector.workbench.readable import CELLS, NO_CHANNEL, Row, corrected, excerpt, is_fault, repaired, rows_of
from selector.workbench.study_folder import SIMULATION
from selector.workbench.typed import FIELDS

ID, TITLE = "recordings", "Recordings"

_NOTES = {
    "encoding": "e.g. cp1252, gb18030", "separator": "a sign, or tab", "decimal": ". or ,",
    "header_row": "counted from 1; 0: none", "sheet": "Excel sheet, TDMS group, MAT variable",
    "time_column": "its name", "time_unit": "s, ms, min, h, d or datetime", "date_order": "dmy, mdy or ymd",
    "period_s": "without a time column",
}  # fmt: skip
_READING = tuple((name, FIELDS[option_of(name)], note) for name, note in _NOTES.items())
_REPAIRS = (RUN_REPAIRED, TWO_LOGGERS)
_ELSEWHERE = (*_REPAIRS, ROLES_GUESSED)  #: The table of channels marks what was guessed, and is where it is corrected
_CHANNELS = (
    "* guessed. Correct what is wrong, then use the corrections: machine.toml is written, and the files read again."
)


@dataclass(frozen=True)
class Example:
    """A folder of shipped recordings, and which of its files are which."""

    folder: str
    title: str
    runs: str
    simulated: str = ""
    cycle: str = ""


EXAMPLES = (
    Example("spindle46", "Measured: a spindle, 46 hours, 16 thermometers", "*.parquet", cycle="staircase.csv"),
    Example("vmc37", "Simulated: a machining centre, 8 runs, 37 thermometers", "*.csv"),
    Example("diagnosis", "Simulated: 3 runs, and a simulation that leaves something out", "r*.csv", "sim/*.csv"),
)


def open_example(bench: Bench, name: str) -> None:
    """Takes the recordings of an example up where they are, and copies what a study folder holds of it."""
    one = next(example for example in EXAMPLES if example.folder == name)
    place = shipped(one.folder)
    for path in sorted(place.glob(one.simulated)) if one.simulated else ():
        target = bench.folder / SIMULATION / path.name
        target.parent.mkdir(exist_ok=True)
        target.write_bytes(path.read_bytes())
    if one.cycle:
        cycle = cycle_in(place / one.cycle)
        bench.choose_cycle(cycle.steps, cycle.hall)
    bench.add(*sorted(place.glob(one.runs)), machine=place / "machine.toml")


def layout(bench: Bench) -> Component:
    """Files, what is wrong with them, how they were read, channels, courses, what else was found."""
    drop = parts.drop_zone(
        "recordings",
        "Choose recordings …",
        "or drop them here: text tables, Excel, Parquet, MAT, TDMS, MDF; one file a run.",
    )
    correct = html.Button("Use these corrections", id=f"{ID}-correct", className="main")
    run = parts.field("Run", parts.choice([], f"{ID}-run", None))
    skip = html.Button("Go past the channels", className="skip", **parts.marks(data_skips=f"{ID}-correct"))
    read = [
        skip,
        parts.section("Channels", html.Div(id=f"{ID}-channels", className="scroll"), note=_CHANNELS),
        html.Div([correct, html.Span(id=f"{ID}-corrected", className="about", role="status")], className="row"),
        parts.section("What was recorded", run, html.Div(id=f"{ID}-courses")),
        html.Div(id=f"{ID}-findings"),
    ]
    return parts.stacked(
        html.H1("Recordings"),
        drop,
        html.Div(id=f"{ID}-listed", className="scroll", hidden=True),
        html.Div(id=f"{ID}-files"),
        html.Div(id=f"{ID}-faults"),
        html.Div(id=f"{ID}-reading"),
        html.Div(read, id=f"{ID}-read", hidden=True),
        *(dcc.Store(id=f"{ID}-{name}", data=None) for name in ("shown", "list", "used", "removed", "rows", "edited")),
    )


def command(bench: Bench) -> tuple[str, ...] | None:
    """`selector describe` of what is loaded."""
    return ("describe", *bench.source_arguments()) if bench.inspection.reading else None


def register(app: dash.Dash, bench: Bench) -> None:
    """What is shown follows the bench; files, decisions about reading and corrections go to it."""
    _register_files(app, bench)
    _register_corrections(app, bench)

    @app.callback(
        Output(f"{ID}-read", "hidden"),
        Output(f"{ID}-faults", "children"),
        Output(f"{ID}-reading", "children"),
        Output(f"{ID}-rows", "data"),
        Output(f"{ID}-findings", "children"),
        Output(f"{ID}-run", "options"),
        Output(f"{ID}-run", "value"),
        Output(f"{ID}-shown", "data"),
        Input(parts.REVISION, "data"),
        State(f"{ID}-shown", "data"),
        State(f"{ID}-run", "value"),
    )
    def _show(_: int, shown: int | None, run: str | None) -> tuple[Any, ...]:
        inspection = bench.inspection
        if inspection.number == shown:
            raise dash.exceptions.PreventUpdate
        reading = inspection.reading
        if reading is None:
            return (True, None, _way(bench) if bench.loaded else None, None, None, [], None, inspection.number)
        runs = [one.name for one in reading.runs]
        others = [one for one in inspection.findings if not is_fault(one) and one.id not in _ELSEWHERE]
        faulty = [one.where.run for one in inspection.findings if is_fault(one) and one.where.run in runs]
        return (
            False,
            _faults(bench),
            _way(bench),
            _table_of_channels(rows_of(reading)),
            parts.section("What else was found", parts.remarks(others)) if others else None,
            runs,
            run if run in runs else [*faulty, *runs][0],
            inspection.number,
        )

    @app.callback(Output(f"{ID}-courses", "children"), Input(f"{ID}-run", "value"), Input(f"{ID}-shown", "data"))
    def _draw(run: str | None, _: int | None) -> Any:
        reading = bench.inspection.reading
        if reading is None or run not in reading.recording.runs:
            return None
        file = next(one.file for one in reading.runs if one.name == run)
        lines = excerpt(file, reading.reading)
        first = [html.H3("The first lines of the file"), html.Pre(lines, tabIndex=0)] if lines else []
        faults: dict[str | None, list[tuple[float, float]]] = {}
        for one in filter(is_fault, bench.inspection.findings):
            if one.where.run in (None, run):
                ends = (one.where.from_s, one.where.to_s)
                whole = (0.0 if ends[0] is None else ends[0], math.inf if ends[1] is None else ends[1])
                faults.setdefault(one.where.channel, []).extend(stretches(one) or [whole])
        return [parts.graph(courses(reading.recording, run, faults)), *first]


def _register_files(app: dash.Dash, bench: Bench) -> None:
    for place, store in (("listed", "list"), ("channels", "rows")):
        drawn = ClientsideFunction(ID, place)
        app.clientside_callback(drawn, Output(f"{ID}-{place}", "title"), Input(f"{ID}-{store}", "data"))

    @app.callback(Output(f"{ID}-files", "children"), Output(f"{ID}-list", "data"), Input(parts.REVISION, "data"))
    def _files(_: int) -> tuple[Any, Any]:
        inspection = bench.inspection
        problems = [inspection.problem, *(one.problem for one in bench.loaded)]
        below = [parts.problem(problem) for problem in problems if problem is not None]
        if bench.loaded:
            return below, _table_of_files(bench)
        none = "No recordings yet. The preview will say what was inferred: encoding, separator, clock, units, roles."
        opens = [html.Button(one.title, id={"type": f"{ID}-example", "folder": one.folder}) for one in EXAMPLES]
        said = [html.P(none, className="about"), html.H2("Or open an example"), html.Div(opens, className="row")]
        return said, None

    @app.callback(Input({"type": f"{ID}-example", "folder": ALL}, "n_clicks"), prevent_initial_call=True)
    def _example(clicks: list[int | None]) -> None:
        name = str(dash.ctx.triggered_id["folder"]) if any(clicks) else ""
        if name in {one.folder for one in EXAMPLES}:
            open_example(bench, name)
            parts.tell(bench)

    @app.callback(Input(f"{ID}-used", "data"), prevent_initial_call=True)
    def _use(ticks: list[list[Any]] | None) -> None:
        loaded = bench.loaded
        # the rows may be those of other files
        if ticks is not None and [name for name, _ in ticks] == [one.path.name for one in loaded]:
            bench.use([one.path for one, (_, tick) in zip(loaded, ticks, strict=True) if tick])
            parts.tell(bench)

    @app.callback(Input(f"{ID}-removed", "data"), prevent_initial_call=True)
    def _remove(asked: list[Any] | None) -> None:
        # the rows may be those of other files
        for path in [one.path for k, one in enumerate(bench.loaded) if asked == [k, one.path.name]]:
            bench.remove(path)
            parts.tell(bench)


def _register_corrections(app: dash.Dash, bench: Bench) -> None:
    @app.callback(Input({"type": f"{ID}-repair", "finding": ALL, "of": ALL}, "n_clicks"), prevent_initial_call=True)
    def _repair(clicks: list[int | None]) -> None:
        inspection = bench.inspection
        asked = dash.ctx.triggered_id if any(clicks) else {}
        number = asked.get("finding")
        # what was clicked may be of a reading before
        if inspection.reading is None or asked.get("of") != inspection.number or not isinstance(number, int):
            return
        found = inspection.findings
        chosen = found[number : number + 1] if number >= 0 else tuple(filter(is_fault, found))
        machine = repaired(inspection.reading, *chosen)
        if machine is not None:
            bench.correct(machine)
        parts.tell(bench)

    @app.callback(Output(f"{ID}-corrected", "children"), Input(f"{ID}-edited", "data"), prevent_initial_call=True)
    def _correct(edited: list[dict[str, str]] | None) -> Any:
        reading = bench.inspection.reading
        old = [] if reading is None else rows_of(reading)
        # the rows may be those of a reading before
        if reading is None or edited is None or [cells.get("name") for cells in edited] != [row.name for row in old]:
            return no_update
        texts: Any = ({name: cells.get(name, "").strip() for name in CELLS} for cells in edited)
        bench.correct(corrected(reading, [replace(row, **said) for row, said in zip(old, texts, strict=True)]))
        parts.tell(bench)
        return f"Written to machine.toml in the study folder; {len(bench.used)} file(s) read with it."

    @app.callback(
        Input(f"{ID}-again", "n_clicks"),
        *(State(f"{ID}-as-{name}", "value") for name, _, _ in _READING),
        prevent_initial_call=True,
    )
    def _again(clicks: int | None, *values: str | None) -> None:
        if clicks:
            said: dict[str, Any] = {name: value for (name, *_), value in zip(_READING, values, strict=True) if value}
            if "header_row" in said:
                said["header_row"] = typed.whole(said["header_row"], FIELDS["--header-row"], 0)
            if "period_s" in said:
                said["period_s"] = typed.number(said["period_s"], FIELDS["--period-s"], 1e-9, unit="s")
            bench.read_as(Overrides(**said))
            parts.tell(bench)


def _faults(bench: Bench) -> Component | None:
    """What is wrong with the data, and a button for each repair that is proposed, or was made."""
    inspection = bench.inspection
    reading = inspection.reading
    positions = {id(one): k for k, one in enumerate(inspection.findings)}
    shown = [one for one in inspection.findings if is_fault(one) or one.id in _REPAIRS]
    if reading is None or not shown:
        return None

    def button(text: str, number: int) -> Component:
        return html.Button(text, id={"type": f"{ID}-repair", "finding": number, "of": inspection.number})

    def beside(finding: Finding) -> list[Any]:
        text = _repair_text(finding)
        is_repair = text and repaired(reading, finding) is not None
        return [html.P(button(text, positions[id(finding)]))] if is_repair else []

    repairs = [one for one in shown if is_fault(one) and beside(one)]
    every = [html.Div(button("Make all of these repairs", -1), className="row")] if len(repairs) > 1 else []
    note = "Shaded in the curves below. What a selection leaves out is said; the files themselves are never changed."
    return parts.section("What is wrong with the data", *every, parts.remarks(shown, beside), note=note)


def _repair_text(finding: Finding) -> str:
    """What a click repairs, or takes back; nothing where there is no such repair."""
    where, evidence = finding.where, finding.evidence
    if finding.id == RUN_REPAIRED:
        return f"Take the repair of {where.run} back"
    if finding.id == TWO_LOGGERS:
        n = len(evidence["beside"])
        return f"Read these pairs as {n} runs" if n > 1 else "Read both as one"
    if "other" in evidence:
        return f"Repair: exchange {where.channel} and {evidence['other']} in {where.run}"
    return f"Repair: read {where.channel} in {where.run} as {evidence['unit']}" if "unit" in evidence else ""


def _table_of_files(bench: Bench) -> dict[str, Any]:
    """What `recordings.js` draws."""
    reading = bench.inspection.reading
    runs: dict[str, list[Any]] = {}
    for run in reading.runs if reading is not None else ():
        for file in (run.file, *(one.file for one in run.beside)):
            runs.setdefault(file, []).append(run)
    rows = []
    for one in bench.loaded:
        own = runs.get(str(one.path), []) if one.is_used else []
        facts: list[Any] = ["", "", "", ""]
        if own:
            facts = [sum(run.rows for run in own), span_text(sum(run.duration_s for run in own))]
            facts += [span_text(own[0].period_s), (own[0].start or "").replace("T", " ")]
        names = {run.name for run in own}
        faults = sum(is_fault(finding) and finding.where.run in names for finding in bench.inspection.findings)
        cells = [one.path.name, *map(str, facts)]
        rows.append({"used": one.is_used, "cells": cells, "faults": faults, "refused": one.problem is not None})
    return {"rows": rows, "reading": bench.is_reading}


def _way(bench: Bench) -> Component:
    """How the files were read, and a form to decide otherwise."""
    reading = bench.inspection.reading
    told = reading.reading if reading is not None else {}
    signs = {",": "comma", ".": "point", ";": "semicolon", "\t": "tab", " ": "blank", "|": "bar"}
    time = told.get("time", {})
    facts = [
        ("format", told.get("format")),
        ("encoding", told.get("encoding")),
        ("separator", signs.get(told.get("separator") or "", told.get("separator"))),
        ("decimal mark", signs.get(told.get("decimal") or "", told.get("decimal"))),
        ("sheet", told.get("sheet")),
        ("names in row", told.get("header_row")),
        ("rows skipped above", told.get("skipped_rows") or None),
        ("row of units", "yes" if told.get("unit_row") else None),
        ("time", _clock(time)),
        ("read otherwise", ", ".join(told.get("per_run", {}))),
        ("machine file", told_path(bench.folder, bench.machine) if bench.machine is not None else None),
    ]
    shown = [html.Div([html.Dt(name), html.Dd(str(value))]) for name, value in facts if value not in (None, "")]
    now = {name: getattr(bench.overrides, name) for name, _, _ in _READING}
    texts = {name: "" if v is None else f"{v:g}" if isinstance(v, float) else str(v) for name, v in now.items()}
    fields = [
        parts.field(title, parts.typed_text(f"{ID}-as-{name}", texts[name], placeholder=note))
        for name, title, note in _READING
    ]
    about = html.P("What is left empty is inferred. It holds for all files.", className="about")
    again = [html.Div(fields, className="fields"), html.Button("Read again", id=f"{ID}-again")]
    form = html.Details([html.Summary("Read them otherwise"), about, *again])
    return parts.section("How they were read", html.Dl(shown, className="facts"), form)


def _clock(time: dict[str, Any]) -> str | None:
    if not time:
        return None
    columns = " and ".join(time["columns"]) or "no column"
    guessed = f"; guessed: {', '.join(time['guessed'])}" if time["guessed"] else ""
    return f"{columns} [{time['unit']}]{guessed}"


def _table_of_channels(rows: tuple[Row, ...]) -> dict[str, Any]:
    """What `recordings.js` draws: roles, units, places and axes to be corrected."""
    facts = [{"marks": ", ".join(f"{what} *" for what in row.guessed) or row.reason, **asdict(row)} for row in rows]
    return {"rows": facts, "roles": [*ROLES, NO_CHANNEL], "cells": CELLS}
