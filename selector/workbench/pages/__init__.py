"""The pages of the workbench: what each of them has, see `Page`; none knows another.

How a page hears of changes: ``Input(parts.REVISION, "data")`` fires after every change of the bench, whichever page
or job made it; render from `bench` then, what takes long only where ``Input(f"page-{ID}", "hidden")`` says no. A
callback that changed the bench calls ``parts.tell(bench)`` last.

How a page does long work: ``bench.start(title, command, out)`` puts a command into the queue; the frame shows progress
and Cancel; when it has ended REVISION fires, and ``bench.result("selection/selection.json")`` gives what it wrote.

How a page says that something cannot be done: it raises an `InputError` in the callback; the frame shows it.

Texts of users (names of channels, files, messages) are children of components, never Markdown, never HTML; in a figure
they go through `selector.figures.style.label`.
"""

from collections.abc import Sequence
from typing import Protocol

import dash
from dash.development.base_component import Component

from selector.workbench.bench import Bench


class Page(Protocol):
    """A module, or an object, with these names."""

    @property
    def ID(self) -> str:  # noqa: N802 - a module has it as a constant
        """Short name: the address ``#ID``, and the beginning of every id in its layout (``f"{ID}-run"``)."""

    @property
    def TITLE(self) -> str:  # noqa: N802
        """Its tab."""

    def layout(self, bench: Bench) -> Component:
        """What it looks like when the browser shows it first, made anew for every visit, from the bench."""

    def register(self, app: dash.Dash, bench: Bench) -> None:
        """Its callbacks. They read and change `bench` and keep nothing themselves."""

    def command(self, bench: Bench) -> Sequence[str] | None:
        """The words after ``selector`` that do by hand what it shows or would start; the frame shows them."""
