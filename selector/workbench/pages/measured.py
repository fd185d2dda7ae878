"""Pages of measured files, a ball-bar's circles and a tap test: files in, a few fields, Start, and the answer."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import dash
from dash import html
from dash.development.base_component import Component

from selector.errors import OptionError
from selector.workbench import parts
from selector.workbench.bench import Bench
from selector.workbench.boxes import Box, Boxes, one_of, one_path, several
from selector.workbench.commands import ball_bar_command, taps_command
from selector.workbench.study_folder import CIRCLES, TAP_TESTS, files_in
from selector.workbench.typed import FIELDS, above_zero


@dataclass(frozen=True)
class MeasuredPage:
    """A page, see `selector.workbench.pages`; its answer is in the folder that is called as the page."""

    ID: str
    TITLE: str
    heading: str
    zone: str  #: Kind of upload
    what: str  #: What is measured
    note: str  #: Which files that are
    which: str  #: Which of them are taken together
    asked: str  #: What is asked, of the bench; ``choose_`` before it takes changes
    boxes: Callable[[Bench], tuple[Box, ...]]
    #: Files → the words after ``selector``; None: something lacks
    words: Callable[[Bench, Sequence[Path]], tuple[str, ...] | None]
    #: lacking and expected: What a message says then
    lacking: str
    expected: str
    more: tuple[tuple[str, str], ...] = ()  #: (name, title) of what can be saved beside report and JSON

    def layout(self, bench: Bench) -> Component:
        """Where files are dropped, what is asked, Start, and the answer."""
        boxes = self._boxes(bench)
        return parts.stacked(
            html.H1(self.heading),
            parts.drop_zone(self.zone, f"Choose {self.what} …", f"or drop them here: {self.note}"),
            html.Div(id=f"{self.ID}-stored"),
            html.Div(boxes.fields(), className="fields wide"),
            parts.start_row(self.ID),
            *parts.answer_place(self.ID),
            boxes.followed(),
        )

    def command(self, bench: Bench) -> tuple[str, ...] | None:
        """What is asked of the chosen files, or of all."""
        there = files_in(bench.folder / self.zone)
        chosen = [path for path in there if path.name in getattr(bench, self.asked).files] or there
        return self.words(bench, chosen) if chosen else None

    def register(self, app: dash.Dash, bench: Bench) -> None:
        """What is typed or chosen goes to the bench at once."""
        parts.register_stored(app, bench, self.ID, lambda: files_in(bench.folder / self.zone), {})
        form = self._boxes(bench).register(app, bench)
        missing = OptionError(self.lacking, expected=self.expected, where=self.TITLE, advice="choose it above")
        how = (self.command, lambda _: self.ID, missing, [form])
        parts.register_task(app, bench, parts.Task(self.ID, self.TITLE, *how, answered=self._answered))

    def _boxes(self, bench: Bench) -> Boxes:
        def offered() -> list[Any]:
            return [path.name for path in files_in(bench.folder / self.zone)]

        files = several("files", self.what.capitalize(), f"{self.which}None: all that are here.", offered)
        choose = getattr(bench, f"choose_{self.asked}")
        return Boxes(self.ID, (files, *self.boxes(bench)), lambda: getattr(bench, self.asked), choose)

    def _answered(self, bench: Bench, stamp: str, _: Any) -> Component | None:
        files = (("report.html", "Report"), (f"{self.ID}.json", "All results (JSON)"), *self.more)
        return None if stamp == "0" else parts.answer(bench, self.ID, files, f"Report: {self.TITLE}", stamp)


def _of_circles(_: Bench) -> tuple[Box, ...]:
    def size(name: str, note: str) -> Box:
        title = FIELDS[f"--{name}"]
        return Box(name, title, note, lambda text: above_zero(text, title), lambda size: f"{size:g}" if size else "")

    return (
        size("radius", "mm; empty: as the files say"),
        size("feed", "mm/min, of all circles; empty: as the files say"),
        Box("axes", FIELDS["--axes"], "that at 0° and that at 90°, e.g. X,Y"),
        Box("lead", FIELDS["--lead"], "mm, e.g. X=10 Y=10; empty: the wavelength of the pitch is searched"),
        Box("reset_time", FIELDS["--reset-time"], "ms, e.g. X=20 Y=20: how strong pulses at the reversals have to be"),
    )


def _of_taps(bench: Bench) -> tuple[Box, ...]:
    about = "masses and joints, where the fit begins; drop a model file of your own on the page Simulate"
    return (
        one_path("model", "Machine", about, partial(bench.models, "vibration")),
        Box("point", FIELDS["--point"], "node=member, e.g. 1=tool 2=headstock; 3= leaves node 3 out"),
        one_of("axis", FIELDS["--axis"], ["", "X", "Y", "Z"]),
        Box("unit", "Units", "motion/force, e.g. m/s^2/N; empty: as the files say"),
    )


def _tap_words(bench: Bench, files: Sequence[Path]) -> tuple[str, ...] | None:
    asked = bench.taps
    is_whole = asked.point and asked.model in bench.models("vibration")
    return taps_command(bench.folder, asked, files) if is_whole else None


BALL_BAR_PAGE = MeasuredPage(
    "ballbar",
    "Ball-bar",
    "A ball-bar test: how round, and why not",
    CIRCLES,
    "measured circles",
    "tables with the angle of the bar and its deviation, or with two positions over time.",
    "Both directions, at one feed or several. ",
    "ball_bar",
    _of_circles,
    lambda bench, files: ball_bar_command(bench.folder, bench.ball_bar, files),
    "no circles",
    "a measured file",
)
TAPS_PAGE = MeasuredPage(
    "taps",
    "Taps",
    "A tap test: what the joints are like",
    TAP_TESTS,
    "measured taps",
    "UFF files with frequency responses, or with hammer and motion over time.",
    "",
    "taps",
    _of_taps,
    _tap_words,
    "no taps, no machine, or no node",
    "UFF files, the model file of the machine, and which member each node is on",
    (("model.toml", "Fitted model file"),),
)
