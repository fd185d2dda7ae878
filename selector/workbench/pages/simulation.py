"""Simulate: a machine from a model file, its parameters as fields, and pictures that follow them."""

import functools
from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from typing import Any

import dash
from dash import Input, Output, State, dcc, html
from dash.development.base_component import Component

from selector.errors import InputError, OptionError
from selector.physics.model_fields import Parameter
from selector.physics.simulation_kind import RunSettings, simulation_kinds
from selector.telling.account import Account
from selector.telling.simulated import account_of
from selector.telling.simulated.result import SimulationResult
from selector.workbench import parts, typed
from selector.workbench.bench import Bench, model_bytes
from selector.workbench.boxes import Column, Rows
from selector.workbench.commands import SIMULATED, Simulation, told_path
from selector.workbench.study_folder import MODELS

ID, TITLE = "simulation", "Simulate"

_FILES = (("report.html", "Report"), ("run.csv", "Recording"), ("run.machine.toml", "Machine file of the recording"))


def layout(bench: Bench) -> Component:
    """Kind, machine, parameters beside the pictures, Start."""
    asked = bench.simulation
    machine = dcc.Dropdown(bench.models(asked.kind), asked.model or None, id=f"{ID}-model", clearable=False)
    fields = [
        parts.field("What is simulated", parts.choice(list(simulation_kinds()), f"{ID}-kind", asked.kind)),
        parts.field("Machine", machine),
    ]
    drop = parts.drop_zone(
        MODELS,
        "Choose a model file …",
        "or drop it here (.toml, with the mesh that it names); it stands below Machine then.",
    )
    return parts.stacked(
        html.H1("A simulated machine"),
        drop,
        html.Div(fields, className="fields wide"),
        html.Div(id=f"{ID}-parameters"),
        parts.start_row(ID, "Write the recording"),
        *parts.answer_place(ID),
        html.Div("Choose a machine.", id=f"{ID}-pictures", role="status"),
        *(dcc.Store(id=f"{ID}-{name}", data=None) for name in ("shown", "drawn")),
        _rows(bench).followed(),
    )


def command(bench: Bench) -> tuple[str, ...] | None:
    """`selector simulate` of the machine, its changed parameters in a file of the study folder."""
    asked = bench.simulation
    if asked.model not in bench.models(asked.kind):
        return None
    path = bench.folder / _changed(asked) if asked.values else Path(asked.model)
    return (
        "simulate", asked.kind, told_path(bench.folder, path), "--out", f"{SIMULATED}/run.csv",
        "--report", f"{SIMULATED}/report.html",
    )  # fmt: skip


def register(app: dash.Dash, bench: Bench) -> None:
    """What is chosen and typed goes to the bench; the pictures follow in a thread."""

    @app.callback(Output(f"{ID}-model", "options"), Output(f"{ID}-model", "value"), Input(parts.REVISION, "data"))
    def _show(_: int) -> tuple[Any, str | None]:
        models = bench.models(bench.simulation.kind)
        chosen = bench.simulation.model
        return models, chosen if chosen in models else None

    @app.callback(
        Output(f"{ID}-parameters", "children"),
        Output(f"{ID}-pictures", "children"),
        Output(f"{ID}-shown", "data"),
        Output(f"{ID}-drawn", "data"),
        Input(parts.REVISION, "data"),
        Input(f"page-{ID}", "hidden"),
        State(f"{ID}-shown", "data"),
        State(f"{ID}-drawn", "data"),
    )
    def _draw(_: int, is_hidden: bool, shown: Any, drawn: Any) -> tuple[Any, ...]:
        """Simulated when somebody wants to see it."""
        asked = bench.simulation
        if is_hidden or asked.model not in bench.models(asked.kind):
            raise dash.exceptions.PreventUpdate
        # what the browser keeps is text: its numbers and lists come back as others
        wanted = repr((asked.kind, asked.model, Path(asked.model).stat().st_mtime_ns))
        now = repr((wanted, sorted(asked.values.items())))
        try:
            account = bench.simulated_live.of(now, lambda: _simulated(asked))
            pictures: Any = html.P("Simulating …") if account is None else parts.told(account)
        except InputError as refused:
            account, pictures = None, parts.problem(refused)
        state = repr((now, account is not None))
        if state == drawn:
            raise dash.exceptions.PreventUpdate
        # fields stay as they are while somebody types in them
        fields = dash.no_update if wanted == shown else list(_fields(asked))
        # the pictures of before stay until there are new ones
        is_waiting = account is None and wanted == shown and not isinstance(pictures, html.Div)
        return fields, dash.no_update if is_waiting else pictures, wanted, state

    def choose(kind: str, model: str | None) -> None:
        # nobody can choose none: the page is behind, or has no machine of this kind
        chosen = {"kind": kind} if model is None else {"kind": kind, "model": model}
        if kind in simulation_kinds() and bench.choose_simulation(**chosen):
            parts.tell(bench)

    choices = parts.Form(((f"{ID}-kind", "value"), (f"{ID}-model", "value")), choose)

    values = _rows(bench).register(app, bench)
    choices.register(app)

    missing = OptionError("no machine", expected="a model file", where=TITLE, advice="choose one")
    how = (command, lambda _: SIMULATED, missing, [choices, values])
    task = parts.Task(ID, TITLE, *how, answered=_answered, prepare=_prepare, unwritten=_unwritten)
    parts.register_task(app, bench, task)


def _prepare(bench: Bench) -> None:
    """The folder of the recording, and the changed machine."""
    (bench.folder / SIMULATED).mkdir(exist_ok=True)
    if bench.simulation.values:
        bench.write_model(_changed(bench.simulation), model_shown(bench.simulation))


def _unwritten(bench: Bench) -> list[str]:
    """The changed machine, where its file says other values."""
    asked = bench.simulation
    path = bench.folder / _changed(asked)
    if not asked.values or not path.is_file():
        return []
    return [path.name] if path.read_bytes() != model_bytes(model_shown(asked)) else []


def _changed(asked: Simulation) -> str:
    return f"{MODELS}/changed-{Path(asked.model).name}"


def _answered(bench: Bench, stamp: str, _: Any) -> Component | None:
    further = html.P(["Next: ", html.A("what it leaves out of your recordings", href="#diagnosis"), "."])
    return None if stamp == "0" else parts.section("Written", parts.saved(bench, SIMULATED, _FILES), further)


def _rows(bench: Bench) -> Rows:
    def parameters() -> Mapping[str, Parameter]:
        asked = bench.simulation
        return _parameters(asked) if asked.model in bench.models(asked.kind) else {}

    # to read a file takes seconds, in which another machine may be chosen: what it does not have is nothing
    def read(text: str | None, name: str) -> float:
        return typed.number(text, name, unit=getattr(parameters().get(name), "unit", ""))

    def choose(columns: dict[str, dict[str, Any]]) -> bool:
        own = {name: one.value for name, one in parameters().items()}
        changed = {name: v for name, v in columns["value"].items() if f"{v:.9g}" != f"{own.get(name, v):.9g}"}
        model_shown(replace(bench.simulation, values=changed))
        return bench.choose_simulation(values=changed)

    def now(name: str) -> float:
        return bench.simulation.values.get(name, getattr(parameters().get(name), "value", float("nan")))

    return Rows(ID, (Column("value", read, now, lambda value: f"{value:.9g}"),), lambda: [*parameters()], choose)


def _parameters(asked: Simulation) -> Mapping[str, Parameter]:
    return _parameters_of(asked.kind, Path(asked.model), Path(asked.model).stat().st_mtime_ns)


@functools.lru_cache(maxsize=4)
def _parameters_of(name: str, path: Path, _: int) -> Mapping[str, Parameter]:
    kind = simulation_kinds()[name]
    found: Mapping[str, Parameter] = kind.model(kind.read(path), {}).parameters
    return found


def model_shown(asked: Simulation) -> Any:
    """The content of the model file with the values of the fields. Raises InputError: it cannot have them."""
    kind = simulation_kinds()[asked.kind]
    model = kind.model(kind.read(Path(asked.model)), {})
    return (model.with_parameters(asked.values) if asked.values else model).file


def _simulated(asked: Simulation) -> Account:
    kind = simulation_kinds()[asked.kind]
    file = model_shown(asked)
    if kind.columns_needed(file):
        raise OptionError(
            "a model that reads columns of recordings beside it", expected="one that says its run itself",
            where=asked.model, advice="write the recording below: the command reads them",
        )  # fmt: skip
    model = kind.model(file, {})
    options = {one.name: False if one.kind is bool else None for one in kind.options}
    done = kind.planned(model, kind.runs(model)[0] or "run", RunSettings(asked=options))
    summary = kind.summary(done, lambda *_: None)
    findings = (*kind.findings_before(model), *done.findings, *kind.findings_after(done, summary))
    return account_of(SimulationResult(kind.name, done, summary, findings, Path(asked.model), options), drawn=True)


def _fields(asked: Simulation) -> Iterator[Component]:
    """The parameters, a part of the machine each to be unfolded."""
    for part, inside in groupby(_parameters(asked).items(), lambda one: ".".join(one[0].split(".")[:2][:-1] or [""])):
        fields = [
            parts.field(
                name.removeprefix(f"{part}.").replace("_", " "),
                parts.typed_text({"type": f"{ID}-value", "name": name}, f"{asked.values.get(name, one.value):.9g}"),
                f"{one.unit.removeprefix('1')} usually {one.low:.4g} to {one.high:.4g}",
            )
            for name, one in inside
        ]
        title = html.Summary(f"{part.replace('_', ' ') or 'machine'} ({len(fields)})")
        yield html.Details([title, html.Div(fields, className="fields")])
