"""Selection: what is asked, which sensors must or must not be used, the command, and its report."""

from collections.abc import Sequence
from functools import partial
from typing import Any

import dash
from dash import html
from dash.development.base_component import Component

from selector.selection import Options
from selector.telling.selected.advice import USELESS
from selector.workbench import parts, typed
from selector.workbench.bench import Bench
from selector.workbench.boxes import Box, Boxes, one_of, several, tick
from selector.workbench.commands import SELECTION, option_arguments, option_of
from selector.workbench.study_folder import no_recordings
from selector.workbench.typed import FIELDS

ID, TITLE = "selection", "Selection"

_ABOUT = (
    "Sensors are grouped, one stands for each group, and sets of them are compared; the error that is reported is that "
    "of runs the model has not seen."
)
_TICKS = ("interactions", "memory", "ridge", "absolute_similarity")
_FILES = (
    ("report.html", "Report"),
    ("model.json", "Model"),
    ("selection.json", "All results (JSON)"),
    ("study.toml", "Study file"),
)


def _boxes(bench: Bench) -> Boxes:
    default = Options()

    def whole(name: str, option: str) -> Box:
        title = FIELDS[option]
        return Box(name, title, read=lambda text: typed.whole(text, title) if text else getattr(default, name))

    def choose(**changes: Any) -> bool:
        """Several λ raise the rounds, and give them back when they go."""
        before, levels = bench.options, changes["level"]
        if isinstance(before.level, tuple) and changes["rounds"] == before.rounds == len(before.level):
            changes["rounds"] = 1
        if isinstance(levels, tuple):
            changes["rounds"] = max(changes["rounds"], len(levels))
        return bench.choose(**changes)

    displacements = partial(bench.channels, "displacement")
    boxes = (
        several("responses", FIELDS["--response"], "None: all that are there.", displacements),
        Box(
            "target", FIELDS["--target"], "the fewest sensors that reach it on unseen runs; empty: as good as any",
            lambda text: typed.above_zero(text, FIELDS["--target"], "µm"),
            lambda target: "" if target is None else f"{target:.12g}",
        ),
        Box(
            "level", FIELDS["--lambda"], "auto, a number from 0 to 1, or one for each round: 0.99, 0.95", _levels,
            _level_text,
        ),
        whole("max_sensors", "--max-sensors"),
        whole("rounds", "--rounds"),
        one_of("grouping", FIELDS["--grouping"], ["closure", "cmeans"]),
        one_of("degree", FIELDS["--degree"], ["1", "2", "3"], int),
        one_of("reference", FIELDS["--reference"], ["rise", "absolute"]),
        *(tick(name, FIELDS[option_of(name)]) for name in _TICKS),
    )  # fmt: skip
    return Boxes(ID, boxes, lambda: bench.options, choose)


def layout(bench: Bench) -> Component:
    """Options, Start, and the answer."""
    boxes = _boxes(bench)
    typed_ones = [box.name for box in boxes.boxes if box.name not in _TICKS]
    sensors: list[Any] = ["Sensors that must or must not be used: ", html.A("Sensors", href="#sensors"), "."]
    return parts.stacked(
        html.H1("Selection of sensors, and the model"),
        html.P(_ABOUT, className="about"),
        html.Div(boxes.fields(typed_ones), className="fields"),
        html.Div(boxes.fields(_TICKS), className="ticks"),
        html.P(sensors, className="about"),
        parts.start_row(ID),
        *parts.answer_place(ID),
        boxes.followed(),
    )


def command(bench: Bench) -> tuple[str, ...] | None:
    """`selector select` with what is asked."""
    return _command(bench, bench.options)


def _command(bench: Bench, options: Options) -> tuple[str, ...] | None:
    if bench.inspection.reading is None:
        return None
    return ("select", *bench.source_arguments(), *option_arguments(options), "--out", SELECTION)


def register(app: dash.Dash, bench: Bench) -> None:
    """Options go to the bench as soon as they are changed, so that the command shows them."""
    form = _boxes(bench).register(app, bench)

    # the Sensors page starts it, too, with what is looked at there
    def elsewhere(_: Bench) -> tuple[str, ...] | None:
        return _command(bench, bench.live.asked(bench.options))

    how = (command, lambda _: SELECTION, no_recordings(TITLE), [form])
    parts.register_task(app, bench, parts.Task(ID, TITLE, *how, answered=_answered, elsewhere=elsewhere))


def _answered(bench: Bench, stamp: str, _: Any) -> Component | None:
    result = bench.result(f"{SELECTION}/selection.json")
    if result is None:
        return None
    # the report begins with what to keep, or with that the model is not to be used
    is_of_use = all(finding["id"] != USELESS for finding in result["findings"])
    then = [html.P(["Next: ", html.A("the program for your control", href="#export"), "."])] if is_of_use else []
    return parts.answer(bench, SELECTION, _FILES, "Report of the selection", stamp, *then)


def _level_text(level: float | tuple[float, ...] | None) -> str:
    levels: Sequence[float] = () if level is None else level if isinstance(level, tuple) else (level,)
    return ", ".join(f"{one:.12g}" for one in levels) or "auto"


def _levels(text: str | None) -> float | tuple[float, ...] | None:
    if (text or "").strip().lower() in ("", "auto"):
        return None
    levels = typed.numbers(text, FIELDS["--lambda"], 0.0, 1.0)
    return levels[0] if len(levels) == 1 else levels
