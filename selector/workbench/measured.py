"""Pages of measured files: files in, a few fields, Start, and the report of the answer."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import dash
from dash import html
from dash.development.base_component import Component

from selector.errors import OptionError
from selector.workbench import parts
from selector.workbench.bench import Bench
from selector.workbench.boxes import Boxes


@dataclass(frozen=True)
class MeasuredPage:
    """One page; see `selector.workbench.pages`."""

    page: str  #: ID
    title: str
    heading: str
    zone: str  #: Kind of upload
    button: str
    note: str  #: Beside the button: which files
    boxes: Callable[[Bench], Boxes]
    command: Callable[[Bench], Sequence[str] | None]
    folder: str  #: Of the answer, in the study folder
    files: tuple[tuple[str, str], ...]  #: (name, title) of what can be saved
    report: str
    missing: OptionError

    def layout(self, bench: Bench) -> Component:
        """Where files are dropped, what is asked, Start, and the answer."""
        boxes = self.boxes(bench)
        return html.Div(
            [
                html.H1(self.heading),
                parts.drop_zone(self.zone, self.button, f"or drop them here: {self.note}"),
                html.Div(boxes.fields(), className="fields wide"),
                parts.start_row(self.page),
                *parts.answer_place(self.page),
                boxes.followed(),
            ]
        )

    def register(self, app: dash.Dash, bench: Bench) -> None:
        """What is typed or chosen goes to the bench at once."""
        form = self.boxes(bench).register(app, bench)
        task = parts.Task(
            self.page, self.title, self.command, lambda _: self.folder, self.missing, [form], answered=self._answered
        )
        parts.register_task(app, bench, task)

    def _answered(self, bench: Bench, stamp: str, _: Any) -> Component | None:
        return None if stamp == "0" else parts.answer(bench, self.folder, self.files, self.report, stamp)
