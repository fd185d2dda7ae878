"""Ball-bar: measured circles in, how round they are and which causes are behind them out."""

from typing import Any

import dash
from dash import html
from dash.development.base_component import Component

from selector.errors import OptionError
from selector.workbench import parts
from selector.workbench.bench import Bench
from selector.workbench.boxes import Box, Boxes, several
from selector.workbench.commands import BALL_BAR, ball_bar_command
from selector.workbench.study_folder import CIRCLES, files_in
from selector.workbench.typed import FIELDS, above_zero

ID, TITLE = "ballbar", "Ball-bar"

_FILES = (("report.html", "Report"), ("ballbar.json", "All results (JSON)"))


def _boxes(bench: Bench) -> Boxes:
    def offered() -> list[Any]:
        return [path.name for path in files_in(bench.folder / CIRCLES)]

    def size(name: str, note: str) -> Box:
        title = FIELDS[f"--{name}"]
        return Box(
            name, title, note, lambda text: above_zero(text, title), lambda size: "" if size is None else f"{size:g}"
        )

    boxes = (
        several(
            "files", "Measured circles", "Both directions, at one feed or several. None: all that are here.", offered
        ),
        size("radius", "mm; empty: as the files say"),
        size("feed", "mm/min, of all circles; empty: as the files say"),
        Box("axes", FIELDS["--axes"], "that at 0° and that at 90°, e.g. X,Y"),
        Box("lead", FIELDS["--lead"], "mm, e.g. X=10 Y=10; empty: the wavelength of the pitch is searched"),
        Box("reset_time", FIELDS["--reset-time"], "ms, e.g. X=20 Y=20: how strong pulses at the reversals have to be"),
    )
    return Boxes(ID, boxes, lambda: bench.ball_bar, bench.choose_ball_bar)


def layout(bench: Bench) -> Component:
    """Where files are dropped, what is asked, Start, and the answer."""
    boxes = _boxes(bench)
    note = "or drop them here: tables with the angle of the bar and its deviation, or with two positions over time."
    return html.Div(
        [
            html.H1("A ball-bar test: how round, and why not"),
            parts.drop_zone(CIRCLES, "Choose measured circles …", note),
            html.Div(boxes.fields(), className="fields wide"),
            parts.start_row(ID),
            *parts.answer_place(ID),
            boxes.followed(),
        ]
    )


def command(bench: Bench) -> tuple[str, ...] | None:
    """`selector ballbar` of the files."""
    there = files_in(bench.folder / CIRCLES)
    asked = [path for path in there if path.name in bench.ball_bar.files] or there
    return ball_bar_command(bench.folder, bench.ball_bar, asked) if asked else None


def register(app: dash.Dash, bench: Bench) -> None:
    """What is typed or chosen goes to the bench at once."""
    form = _boxes(bench).register(app, bench)
    missing = OptionError(
        "no circles", expected="a measured file", where=TITLE, advice="choose the files of a test above"
    )
    task = parts.Task(ID, TITLE, command, lambda _: BALL_BAR, missing, [form], answered=_answered)
    parts.register_task(app, bench, task)


def _answered(bench: Bench, stamp: str, _: Any) -> Component | None:
    return None if stamp == "0" else parts.answer(bench, BALL_BAR, _FILES, "Report of the ball-bar test", stamp)
