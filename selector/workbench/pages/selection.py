"""Selection: what is asked, which sensors must or must not be used, the command, and its report."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any, Literal

import dash
from dash import Input, Output, State, dcc, html, set_props
from dash.development.base_component import Component

from selector.number_text import number_text
from selector.selection import Options
from selector.workbench import parts, typed
from selector.workbench.bench import Bench
from selector.workbench.commands import SELECTION, option_arguments
from selector.workbench.saved_study import other_than_asked
from selector.workbench.typed import FIELDS, in_words_of_fields

ID, TITLE = "selection", "Selection"

_ABOUT = (
    "Sensors are grouped, one stands for each group, and sets of them are compared; the error that is reported is that "
    "of runs the model has not seen."
)
_DEFAULT = Options()
_NUMBERS = (("max_sensors", FIELDS["--max-sensors"]), ("rounds", FIELDS["--rounds"]))
_RAISED = f"{ID}-raised"  #: Store: the rounds that several λ ask for, and those that were asked before.

_BOXES = (f"{ID}-level", f"{ID}-target", *(f"{ID}-{name}" for name, _ in _NUMBERS))
_TICKS = tuple(
    (name, FIELDS[f"--{name.replace('_', '-')}"]) for name in ("interactions", "memory", "ridge", "absolute_similarity")
)
_FILES = (
    ("report.html", "Report"),
    ("model.json", "Model"),
    ("selection.json", "All results (JSON)"),
    ("study.toml", "Study file"),
)


def layout(bench: Bench) -> Component:
    """Options, sensors, Start, and the answer."""
    asked = bench.options
    fields = [
        parts.field(
            FIELDS["--response"],
            dcc.Dropdown(id=f"{ID}-responses", options=[], value=list(asked.responses), multi=True),
            "None: all that are there.",
        ),
        parts.field(
            FIELDS["--lambda"],
            parts.typed_text(f"{ID}-level", _level_text(bench)),
            "auto, a number from 0 to 1, or one for each round: 0.99, 0.95",
        ),
        parts.field(
            FIELDS["--target"],
            parts.typed_text(f"{ID}-target", _target_text(bench)),
            "the fewest sensors that reach it on unseen runs; empty: as good as any",
        ),
        *(parts.field(title, parts.typed_text(f"{ID}-{name}", str(getattr(asked, name)))) for name, title in _NUMBERS),
        parts.field(FIELDS["--degree"], parts.choice(f"{ID}-degree", ["1", "2", "3"], str(asked.degree))),
        parts.field(FIELDS["--reference"], parts.choice(f"{ID}-reference", ["rise", "absolute"], asked.reference)),
    ]
    ticks = [{"label": title, "value": name} for name, title in _TICKS]
    ticked = [name for name, _ in _TICKS if getattr(asked, name)]
    return html.Div(
        [
            html.H1("Selection of sensors, and the model"),
            html.P(_ABOUT, className="about"),
            html.Div(fields, className="fields"),
            dcc.Checklist(id=f"{ID}-ticks", options=ticks, value=ticked, className="ticks"),
            html.P(
                ["Sensors that must or must not be used: ", html.A("Sensors", href="#sensors"), "."], className="about"
            ),
            parts.start_row(ID),
            html.Div(id=f"{ID}-earlier", role="status"),
            *parts.answer_place(ID),
            dcc.Store(id=f"{ID}-followed", data=[list(asked.responses), *_texts(bench)]),
            dcc.Store(id=_RAISED, data=None),
        ]
    )


def command(bench: Bench) -> tuple[str, ...] | None:
    """`selector select` with what is asked."""
    if bench.material.reading is None:
        return None
    return ("select", *bench.source_arguments(), *option_arguments(bench.options), "--out", SELECTION)


def register(app: dash.Dash, bench: Bench) -> None:
    """Options go to the bench as soon as they are changed, so that the command shows them."""
    form = _form(bench)
    form.register(app)
    boxes = [f"{ID}-responses", *_BOXES]

    @app.callback(
        Output(f"{ID}-followed", "data"),
        Output(f"{ID}-responses", "options"),
        Input(parts.REVISION, "data"),
        State(f"{ID}-followed", "data"),
        *(State(box, "value") for box in boxes),
    )
    def _show(_: int, before: list[Any], *shown: Any) -> tuple[list[Any], list[str]]:
        """Other pages choose options, too."""
        reading = bench.material.reading
        now = [list(bench.options.responses), *_texts(bench)]
        parts.follow(boxes, shown, before, now)
        return now, [] if reading is None else list(reading.recording.with_role("displacement"))

    @app.callback(Output(f"{ID}-earlier", "children"), Input(parts.REVISION, "data"))
    def _earlier(_: int) -> Component | None:
        """What was chosen since the answer below was made."""
        if bench.result(f"{SELECTION}/selection.json") is None:
            return None
        ways = (bench.options, bench.live.asked(bench.options))
        found = (other_than_asked(bench.folder / SELECTION, one, bench.overrides, bench.used) for one in ways)
        others = min(found, key=len)
        return parts.asked_otherwise(others, "answer below was asked", "Start")

    task = parts.Task(
        ID, TITLE, lambda: command(bench), lambda: SELECTION, parts.no_recordings(TITLE), [form],
        answered=lambda stamp, _: _answered(bench, stamp),
    )  # fmt: skip
    parts.register_task(app, bench, task)


def _form(bench: Bench) -> parts.Form:
    def take(
        responses: list[str] | None,
        level: str | None,
        target: str | None,
        degree: Literal["1", "2", "3"],
        reference: Literal["rise", "absolute"],
        ticks: list[str],
        max_sensors: str | None,
        rounds: str | None,
        raised: list[int] | None,
    ) -> None:
        numbers = (max_sensors, rounds)
        asked = bench.options
        with parts.typed_over(_BOXES, [level, target, *numbers], lambda: _texts(bench)) as read:
            counts = {
                name: read(partial(typed.whole, text, title), getattr(asked, name)) if text else getattr(_DEFAULT, name)
                for text, (name, title) in zip(numbers, _NUMBERS, strict=True)
            }
            levels = read(partial(_levels, level), asked.level)
            target_um = read(lambda: typed.above_zero(target, FIELDS["--target"], "µm"), asked.target)
            # several λ raise the rounds, and give them back when they go
            if raised and raised[0] == counts["rounds"]:
                counts["rounds"] = raised[-1]
            own = counts["rounds"]
            if isinstance(levels, tuple) and len(levels) > own:
                counts["rounds"] = len(levels)
            set_props(_RAISED, {"data": [counts["rounds"], own] if counts["rounds"] > own else None})
            flags = {name: name in ticks for name, _ in _TICKS}
            if bench.choose(
                responses=tuple(responses or ()),
                level=levels,
                target=target_um,
                degree=int(degree),
                reference=reference,
                **counts,
                **flags,
            ):
                parts.tell(bench)

    names = ("responses", "level", "target", "degree", "reference", "ticks", *(name for name, _ in _NUMBERS))
    return parts.Form(tuple((f"{ID}-{name}", "value") for name in names), take, ((_RAISED, "data"),))


def _answered(bench: Bench, stamp: str) -> Component | None:
    result = bench.result(f"{SELECTION}/selection.json")
    if result is None:
        return None
    chosen = result["chosen"]
    errors = [f"{name} {number_text(model['heldout_rmse_um'])} µm" for name, model in result["models"].items()]
    kept = [
        html.P(f"Keep {', '.join(chosen['sensors'])}.", className="first"),
        html.P(f"Error on runs that the model has not seen, rms: {', '.join(errors)}."),
        html.P(in_words_of_fields(chosen["because"])),
        html.P(["Next: ", html.A("the program for your control", href="#export"), "."]),
    ]
    return parts.section(
        "The answer",
        html.Div(kept, className="advice"),
        parts.saved(bench, SELECTION, _FILES),
        parts.framed(f"{SELECTION}/report.html", "Report of the selection", stamp),
    )


def _texts(bench: Bench) -> list[str]:
    """What stands in `_BOXES` when they say what counts."""
    return [_level_text(bench), _target_text(bench), *(str(getattr(bench.options, name)) for name, _ in _NUMBERS)]


def _target_text(bench: Bench) -> str:
    return "" if bench.options.target is None else f"{bench.options.target:.12g}"


def _level_text(bench: Bench) -> str:
    level = bench.options.level
    levels: Sequence[float] = () if level is None else level if isinstance(level, tuple) else (level,)
    return ", ".join(f"{one:.12g}" for one in levels) or "auto"


def _levels(text: str | None) -> float | tuple[float, ...] | None:
    if (text or "").strip().lower() in ("", "auto"):
        return None
    levels = typed.numbers(text, FIELDS["--lambda"], 0.0, 1.0)
    return levels[0] if len(levels) == 1 else levels
