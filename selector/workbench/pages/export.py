"""Export: a model becomes the program of a control, with its commissioning sheet and the replay of recordings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import dash
from dash import ALL, Input, Output, State, dcc, html
from dash.development.base_component import Component

from selector.controllers import decided_limits
from selector.controllers.writers.targets import TARGETS
from selector.errors import OptionError
from selector.number_text import number_text
from selector.selection.result_file import FindingPart
from selector.workbench import parts, typed
from selector.workbench.bench import Bench
from selector.workbench.commands import DIAGNOSIS, SELECTION, export_command
from selector.workbench.saved_study import MODEL, SHEET, model_at, other_than_exported
from selector.workbench.typed import FIELDS

ID, TITLE = "export", "Export"

_KINDS = ("clamp", "slew")
_WHAT = {
    SHEET: "commissioning sheet: print it, and follow it at the machine",
    MODEL: "the model, as exported",
}
_LONGEST_SHOWN = 60_000
_LEAST_LIMIT, _LARGEST_LIMIT = 1e-6, 999_999.0
_LIMITS = (
    "Empty: the number in grey, from the model, or, where nobody has decided it, a cautious one. Turned round: the "
    "control counts the axis the other way, and its correction is the displacement itself."
)
_NO_LIMITS = (
    "This control has neither limit: limit the temperature that it passes on. Turned round: it counts the axis the "
    "other way, and its correction is the displacement itself."
)
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
        options=[{"label": FIELDS["--sign-verified"], "value": "verified"}],
        value=["verified"] if asked.is_sign_verified else [],
    )
    tested = parts.field(
        FIELDS["--tested"],
        parts.typed_text(f"{ID}-tested", asked.tested),
        "8 digits or more, from its head; another program, or the other sign, is then not called verified.",
    )
    return html.Div(
        [
            html.H1("Program for a control"),
            html.Div(fields, className="fields wide"),
            html.Div(id=f"{ID}-outputs"),
            html.Div([sign, html.P(_SIGN, className="about"), html.Div(tested, className="fields wide")]),
            parts.start_row(ID, "Export"),
            html.Div(id=f"{ID}-earlier", role="status"),
            *parts.answer_place(ID),
            dcc.Store(id=f"{ID}-shown", data=None),
        ]
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

    @app.callback(
        Output(f"{ID}-model", "options"),
        Output(f"{ID}-model", "value"),
        Output(f"{ID}-replayed", "options"),
        Output(f"{ID}-replayed", "value"),
        Input(parts.REVISION, "data"),
        State(f"{ID}-model", "value"),
    )
    def _show(_: int, model: str | None) -> tuple[Any, ...]:
        models = _models(bench)
        runs = [{"label": path.name, "value": str(path)} for path in bench.used]
        return models, model if model in models else next(iter(models), None), runs, [*map(str, _replayed(bench))]

    @app.callback(
        Output(f"{ID}-outputs", "children"),
        Output(f"{ID}-shown", "data"),
        Input(parts.REVISION, "data"),
        State(f"{ID}-shown", "data"),
        *(State({"type": f"{ID}-{kind}", "output": ALL}, "value") for kind in _KINDS),
        State({"type": f"{ID}-invert", "output": ALL}, "id"),
    )
    def _show_outputs(
        _: int, shown: Any, clamps: list[str | None], slews: list[str | None], ids: list[dict[str, str]]
    ) -> tuple[Any, Any]:
        asked = bench.export
        outputs = _outputs(bench, asked.model)
        now = [asked.model, TARGETS[asked.target].has_guard, outputs]
        if now == shown:
            raise dash.exceptions.PreventUpdate
        # what was refused stays in the fields of the other control
        typed_texts = {
            (kind, one["output"]): text or ""
            for kind, texts in zip(_KINDS, (clamps, slews), strict=True)
            for one, text in zip(ids, texts, strict=True)
        }
        return _limits(bench, outputs, typed_texts) if outputs else None, now

    @app.callback(Output(f"{ID}-earlier", "children"), Input(parts.REVISION, "data"))
    def _earlier(_: int) -> Component | None:
        """What was chosen, or made, since the files below were written."""
        now = command(bench)
        files = bench.folder / bench.export.folder
        if now is None or not (files / SHEET).is_file():
            return None
        jobs = [job for job in bench.jobs.all if job.state == "done" and job.out == files]
        then = jobs[-1].command if jobs else None
        return parts.asked_otherwise(
            other_than_exported(files, bench.folder / bench.export.model, bench.export, now, then),
            "files below were written",
            "Export",
        )

    forms = (_limits_form(bench), _form(bench))
    for form in forms:
        form.register(app)
    missing = OptionError(
        "no model in the study folder",
        expected="a model.json of a selection or of a diagnosis",
        where=TITLE,
        advice="run a selection first",
    )
    task = parts.Task(
        ID, TITLE, lambda: command(bench), lambda: bench.export.folder, missing, forms, SHEET,
        lambda stamp, said: _files(bench, bench.export.folder, stamp, said), is_asked_as_data=True,
    )  # fmt: skip
    parts.register_task(app, bench, task)


def _form(bench: Bench) -> parts.Form:
    def take(model: str | None, target: str, replayed: list[str] | None, sign: list[str], tested: str | None) -> None:
        chosen = tuple(path for path in bench.used if str(path) in (replayed or ()))
        if bench.choose_export(
            model=model or "",
            target=target if target in TARGETS else "c",
            replayed=None if chosen == bench.used else chosen,
            is_sign_verified=bool(sign),
            tested=(tested or "").strip(),
        ):
            parts.tell(bench)

    names = ("model", "target", "replayed", "sign", "tested")
    return parts.Form(tuple((f"{ID}-{name}", "value") for name in names), take)


def _limits_form(bench: Bench) -> parts.Form:
    def take(
        clamps: list[str | None],
        slews: list[str | None],
        inverts: list[list[str]],
        ids: list[dict[str, str]],
        target: str,
    ) -> None:
        names = [one["output"] for one in ids]
        boxes = [{"type": f"{ID}-{kind}", "output": name} for kind in _KINDS for name in names]
        inverted = tuple(name for name, ticks in zip(names, inverts, strict=True) if ticks)
        if target in TARGETS and not TARGETS[target].has_guard:
            # what stands in fields that cannot be typed into is not judged
            if bench.choose_export(inverted=inverted):
                parts.tell(bench)
            return
        asked = bench.export
        with parts.typed_over(boxes, [*clamps, *slews], lambda: _texts(bench, names)) as read:

            def limits(texts: list[str | None], title: str, unit: str, now: Mapping[str, float]) -> dict[str, float]:
                found = {
                    name: read(partial(_limit, text, f"{title} of {name}", unit), now.get(name))
                    for name, text in zip(names, texts, strict=True)
                }
                return {name: limit for name, limit in found.items() if limit is not None}

            if bench.choose_export(
                clamp_um=limits(clamps, FIELDS["--clamp"], "µm", asked.clamp_um),
                slew_um_per_s=limits(slews, FIELDS["--slew"], "µm/s", asked.slew_um_per_s),
                inverted=inverted,
            ):
                parts.tell(bench)

    fields = tuple(({"type": f"{ID}-{kind}", "output": ALL}, "value") for kind in (*_KINDS, "invert"))
    return parts.Form(fields, take, (({"type": f"{ID}-invert", "output": ALL}, "id"), (f"{ID}-target", "value")))


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


def _limits(
    bench: Bench, outputs: Sequence[Mapping[str, Any]], typed_texts: Mapping[tuple[str, str], str]
) -> Component:
    """A row for each output: its limits as they were typed, or as they count; and whether it is turned round."""
    has_guard = TARGETS[bench.export.target].has_guard
    names = [output["name"] for output in outputs]
    texts = _texts(bench, names)
    rows = []
    for number, output in enumerate(outputs):
        name = output["name"]
        clamp, slew = (
            parts.typed_text(
                {"type": f"{ID}-{kind}", "output": name}, typed_texts.get((kind, name), text),
                disabled=not has_guard, placeholder=output[key],
            )
            for kind, key, text in (
                ("clamp", "clamp_um", texts[number]), ("slew", "slew_um_per_s", texts[len(names) + number])
            )
        )  # fmt: skip
        tick = dcc.Checklist(
            id={"type": f"{ID}-invert", "output": name},
            options=[{"label": "", "value": "invert"}],
            value=["invert"] if name in bench.export.inverted else [],
        )
        rows.append([html.Span(name, className="name"), clamp, slew, tick])
    columns = ["output", f"{FIELDS['--clamp']} [µm]", f"{FIELDS['--slew']} [µm/s]", FIELDS["--invert"]]
    note = _LIMITS if has_guard else _NO_LIMITS
    return html.Div([parts.table(columns, rows, name="channels sensors"), html.P(note, className="about")])


def _texts(bench: Bench, names: Sequence[str]) -> list[str]:
    """What stands in the fields of the limits: all largest corrections, then all fastest changes."""
    asked = bench.export
    return [
        f"{values[name]:.12g}" if name in values else ""
        for values in (asked.clamp_um, asked.slew_um_per_s)
        for name in names
    ]


def _limit(text: str | None, where: str, unit: str) -> float | None:
    """The limit that was typed; none where nothing was."""
    return typed.number(text, where, _LEAST_LIMIT, _LARGEST_LIMIT, unit) if text else None


def _replayed(bench: Bench) -> tuple[Path, ...]:
    """The recordings that are run through the program, of those that are used."""
    asked = bench.export.replayed
    return tuple(path for path in bench.used if asked is None or path in asked)


def _models(bench: Bench) -> list[str]:
    places = (f"{SELECTION}/model.json", f"{DIAGNOSIS}/model.json")
    return [place for place in places if (bench.folder / place).is_file()]


def _files(bench: Bench, name: str, stamp: str, said: Mapping[str, Any] | None) -> Component | None:
    """A table of the files, how the replay went, every program as text, and the sheet; None: nothing was exported."""
    folder = bench.folder / name
    if not (folder / SHEET).is_file():
        return None
    files = [path for path in sorted(folder.iterdir()) if path.is_file() and not path.name.startswith(".")]
    texts = [path for path in files if path.suffix not in (".html", ".json")]
    rows = [
        [
            parts.download(f"{name}/{path.name}", path.name),
            _WHAT.get(path.name, "program"),
            path.stat().st_size,
        ]
        for path in files
    ]
    findings = [] if said is None else [FindingPart.model_validate(one).finding() for one in said["findings"]]
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
    """How far the program is from the model, in a sentence."""
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
