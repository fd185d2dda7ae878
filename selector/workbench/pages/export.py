"""Export: a model becomes the program of a control, with its commissioning sheet and the replay of recordings."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import dash
from dash import Input, Output, State, dcc, html
from dash.development.base_component import Component
from pydantic import TypeAdapter

from selector.controllers import decided_limits
from selector.controllers.writers.targets import LARGEST_MARGIN_PERCENT, TARGETS
from selector.errors import OptionError
from selector.findings import Finding
from selector.number_text import number_text
from selector.workbench import parts, typed
from selector.workbench.bench import Bench
from selector.workbench.boxes import Box, Boxes, Column, Rows, one_of, several, tick
from selector.workbench.commands import DIAGNOSIS, SELECTION, export_command
from selector.workbench.saved_study import MODEL, SHEET, model_at
from selector.workbench.typed import FIELDS

ID, TITLE = "export", "Export"

_KINDS = ("clamp", "slew")
_WHAT = {SHEET: "commissioning sheet: print it, and follow it at the machine", MODEL: "the model, as exported"}
_LONGEST_SHOWN = 60_000
_LEAST_LIMIT, _LARGEST_LIMIT = 1e-6, 999_999.0
_LIMITS = "Empty: the number in grey, from the model, or, where nobody has decided it, a cautious one. "
_NO_LIMITS = "This control has neither limit: limit the temperature that it passes on. "
_TURNED = "Turned round: the control counts the axis the other way, and its correction is the displacement itself."
_SIGN = (
    "Tick this only after the sign test of the commissioning sheet was passed at the machine: a correction with the "
    "wrong sign doubles the error. Without it the program says SIGN UNVERIFIED."
)


def _boxes(bench: Bench) -> Boxes:
    def replayed(paths: list[str] | None) -> tuple[Path, ...] | None:
        chosen = tuple(path for path in bench.used if str(path) in (paths or ()))
        return None if chosen == bench.used else chosen

    def shown(_: Any) -> list[str]:
        return [str(path) for path in _replayed(bench)]

    offered = partial(_models, bench)
    menu = partial(parts.choice, offered())
    models = Box("model", "Model", "", lambda of: of or "", lambda of: of or None, control=menu, offered=offered)
    note = "The program is executed on them and compared with the model, sample by sample."
    replays = several("replayed", "Recordings to run through the program", note, bench.used_as_options)
    targets = [{"label": target.title, "value": name} for name, target in TARGETS.items()]
    target = one_of("target", "Control", list(TARGETS))
    tested = "As st:1a2b3c4d, 8 digits or more from its head; no other program or sign is then called verified."
    boxes = (
        models,
        replace(target, control=partial(parts.choice, targets)),
        replace(replays, read=replayed, shown=shown),
        tick("is_sign_verified", FIELDS["--sign-verified"]),
        Box("tested", FIELDS["--tested"], tested),
        Box(
            "margin", FIELDS["--margin"], "of the width of each range, in programs with a guard; nobody has seen that",
            lambda text: typed.number(text or "0", FIELDS["--margin"], 0.0, LARGEST_MARGIN_PERCENT, unit="%"),
            lambda share: f"{share:.12g}",
        ),
    )  # fmt: skip
    return Boxes(ID, boxes, lambda: bench.export, bench.choose_export)


def layout(bench: Bench) -> Component:
    """Model, control, replay, sign, Start, and the files."""
    boxes = _boxes(bench)
    sign, tested = boxes.fields(["is_sign_verified", "tested"])
    return parts.stacked(
        html.H1("Program for a control"),
        html.Div(boxes.fields(["model", "target", "replayed", "margin"]), className="fields wide"),
        html.Div(id=f"{ID}-outputs"),
        html.Div([sign, html.P(_SIGN, className="about"), html.Div(tested, className="fields wide")]),
        parts.start_row(ID, "Export"),
        *parts.answer_place(ID),
        boxes.followed(),
        _rows(bench).followed(),
        dcc.Store(id=f"{ID}-shown", data=None),
    )


def command(bench: Bench) -> tuple[str, ...] | None:
    """`selector export` with what is asked."""
    asked = bench.export
    if asked.model not in _models(bench):
        return None
    asked = asked.of([output["name"] for output in _outputs(bench, asked.model)])
    asked = replace(asked, replayed=_replayed(bench))
    return export_command(bench.folder, asked, bench.machine, bench.overrides)


def register(app: dash.Dash, bench: Bench) -> None:
    """What is asked goes to the bench as soon as it is changed, so that the command shows it."""

    @app.callback(Input(parts.REVISION, "data"))
    def _choose(_: int) -> None:
        models = _models(bench)
        if models and bench.export.model not in models and bench.choose_export(model=models[0]):
            parts.tell(bench)

    @app.callback(
        Output(f"{ID}-outputs", "children"),
        Output(f"{ID}-shown", "data"),
        Input(parts.REVISION, "data"),
        State(f"{ID}-shown", "data"),
    )
    def _show_outputs(_: int, shown: Any) -> tuple[Any, Any]:
        asked = bench.export
        outputs = _outputs(bench, asked.model)
        now = [asked.model, TARGETS[asked.target].has_guard, outputs]
        if now == shown:
            raise dash.exceptions.PreventUpdate
        return _limits(bench, outputs) if outputs else None, now

    forms = (_rows(bench).register(app, bench), _boxes(bench).register(app, bench))
    missing = OptionError(
        "no model in the study folder",
        expected="a model.json of a selection or of a diagnosis",
        where=TITLE,
        advice="run a selection first",
    )
    task = parts.Task(ID, TITLE, command, lambda _: bench.export.folder, missing, forms, SHEET, _answered, True)
    parts.register_task(app, bench, task)


def _rows(bench: Bench) -> Rows:
    def limit(kind: str, key: str, option: str, unit: str) -> Column:
        def now(name: str) -> float | None:
            return getattr(bench.export, key).get(name)

        def read(text: str | None, name: str) -> float | None:
            # what stands in fields that cannot be typed into is not judged
            if not TARGETS[bench.export.target].has_guard:
                return now(name)
            title = f"{FIELDS[option]} of {name}"
            return typed.number(text, title, _LEAST_LIMIT, _LARGEST_LIMIT, unit) if text else None

        return Column(kind, read, now, lambda value: "" if value is None else f"{value:.12g}")

    def choose(columns: dict[str, dict[str, Any]]) -> bool:
        clamps, slews = ({name: one for name, one in columns[kind].items() if one is not None} for kind in _KINDS)
        turned = tuple(name for name, is_turned in columns["invert"].items() if is_turned)
        return bench.choose_export(clamp_um=clamps, slew_um_per_s=slews, inverted=turned)

    columns = (
        limit("clamp", "clamp_um", "--clamp", "µm"),
        limit("slew", "slew_um_per_s", "--slew", "µm/s"),
        Column(
            "invert", lambda ticks, _: bool(ticks), lambda name: name in bench.export.inverted,
            lambda is_turned: ["invert"] * is_turned, list[str],
        ),
    )  # fmt: skip
    return Rows(ID, columns, lambda: [one["name"] for one in _outputs(bench, bench.export.model)], choose)


def _outputs(bench: Bench, model: str) -> list[dict[str, Any]]:
    """Name of every output of a model, and what counts where no limit is typed."""
    read = model_at(bench.folder / model) if model in _models(bench) else None
    if read is None:
        return []
    given = {limits.output: limits for limits in read.guard.limits}
    decided, _ = decided_limits(read)

    def said(name: str, key: str) -> str:
        is_decided = getattr(given.get(name), key, None) is not None
        return f"{getattr(decided[name], key):g}{'' if is_decided else ' (cautious)'}"

    return [
        {"name": name, **{key: said(name, key) for key in ("clamp_um", "slew_um_per_s")}}
        for name in (output.name for output in read.outputs)
    ]


def _limits(bench: Bench, outputs: Sequence[Mapping[str, Any]]) -> Component:
    """A row for each output: its limits as they count; and whether it is turned round."""
    has_guard = TARGETS[bench.export.target].has_guard
    shown, rows = [], _rows(bench)
    counting = rows.counting()
    for output in outputs:
        name = output["name"]
        boxes = zip(rows.boxes(name), counting[name], ("clamp_um", "slew_um_per_s", ""), strict=True)
        *limits, (box, value, _) = boxes
        cells = [
            parts.typed_text(box, text, disabled=not has_guard, placeholder=output[key]) for box, text, key in limits
        ]
        ticked = dcc.Checklist(id=box, options=[{"label": "", "value": "invert"}], value=value)
        shown.append([html.Span(name, className="name"), *cells, ticked])
    columns = ["output", f"{FIELDS['--clamp']} [µm]", f"{FIELDS['--slew']} [µm/s]", FIELDS["--invert"]]
    note = (_LIMITS if has_guard else _NO_LIMITS) + _TURNED
    return html.Div([parts.table(columns, shown, name="channels sensors"), html.P(note, className="about")])


def _replayed(bench: Bench) -> tuple[Path, ...]:
    """The recordings that are run through the program, of those that are used."""
    asked = bench.export.replayed
    return tuple(path for path in bench.used if asked is None or path in asked)


def _models(bench: Bench) -> list[str]:
    places = (f"{SELECTION}/model.json", f"{DIAGNOSIS}/model.json")
    return [place for place in places if (bench.folder / place).is_file()]


def _answered(bench: Bench, stamp: str, said: Mapping[str, Any] | None) -> Component | None:
    """A table of the files, how the replay went, every program as text, and the sheet; None: nothing was exported."""
    name = bench.export.folder
    folder = bench.folder / name
    if not (folder / SHEET).is_file():
        return None
    files = [path for path in sorted(folder.iterdir()) if path.is_file() and not path.name.startswith(".")]
    texts = [path for path in files if path.suffix not in (".html", ".json", ".fmu")]
    rows = [
        [parts.download(f"{name}/{path.name}", path.name), _WHAT.get(path.name, "for the control"), path.stat().st_size]
        for path in files
    ]
    findings = () if said is None else TypeAdapter(tuple[Finding, ...]).validate_python(said["findings"])
    return parts.section(
        f"Files in {name}",
        parts.table(["file", "what it is", "bytes"], rows, numeric=["bytes"], name="files"),
        html.H3("Replay"),
        html.P(_replay_text(said)),
        *([html.H3("Before you use it"), parts.remarks(findings)] if findings else []),
        *(_text(path, number) for number, path in enumerate(texts)),
        html.H3("Commissioning sheet"),
        parts.framed(f"{name}/{SHEET}", "Commissioning sheet", stamp),
    )


def _replay_text(said: Mapping[str, Any] | None) -> str:
    if said is None:
        return "What the replay said stands in the commissioning sheet below."
    replay = said["replay"]
    if replay is None:
        return "Nothing was replayed: choose recordings above, or see the findings."
    apart = number_text(replay["max_abs_difference_um"])
    return (
        f"The program was run on {replay['rows']} samples by {replay['executed_by']}; it differs from the model by at "
        f"most {apart} µm."
    )


def _text(path: Path, number: int) -> Component:
    text = path.read_text(encoding="utf-8", errors="replace")
    note = html.P("Only the beginning is shown; save the file.", className="about")
    cut = [note] if len(text) > _LONGEST_SHOWN else []
    name = f"{ID}-text-{number}"
    button = html.Button("Copy", **parts.marks(data_copies=name)) if not cut else None
    shown = html.Pre(text[:_LONGEST_SHOWN], id=name, tabIndex=0)
    return html.Details([html.Summary(path.name), html.Div([button], className="row"), *cut, shown])
