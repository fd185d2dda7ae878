"""How is it shown how far long work has come: a bar for people, lines for programs, nothing elsewhere.

A program that runs `selector` sets ``SELECTOR_PROGRESS=lines`` and reads from stderr one JSON object a line,
``{"doing": "folds", "share": 0.42}``: what is being done, and the share that is done, null where nobody knows. Other
lines of stderr are messages for people. A line comes when `doing` changes, and else ten times a second at most.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

Progress = Callable[[str, float], None]

VARIABLE = "SELECTOR_PROGRESS"
_LEAST_INTERVAL_S = 0.1


@contextmanager
def progress_bar() -> Iterator[Progress]:
    """``say(doing, share)`` while the block runs."""
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as Bar

    console = Console(stderr=True)
    if _wants_lines():
        yield _lines()
    elif not console.is_terminal:
        yield lambda _doing, _share: None
    else:
        columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
        with Bar(*columns, console=console, transient=True) as bar:
            task = bar.add_task("", total=1.0)
            yield lambda doing, share: bar.update(task, description=doing, completed=share)


@contextmanager
def counted_progress(title: str) -> Iterator[Callable[[float, float, str], None]]:
    """``report(done, total, text)`` while the block runs, to be called as often as one likes."""
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as Bar

    if _wants_lines():
        say = _lines()

        def tell(done: float, total: float, text: str = "") -> None:
            say(f"{title}, {text}" if text else title, done / total if total > 0 else None)

        yield tell
        return
    console = Console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn(), TextColumn("{task.fields[now]}"))
    with Bar(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(title, total=None, now="")

        def report(done: float, total: float, text: str = "") -> None:
            bar.update(task, completed=done, total=total, now=text)

        yield report


def _wants_lines() -> bool:
    return os.environ.get(VARIABLE) == "lines"


def _lines() -> Callable[[str, float | None], None]:
    last: tuple[str, float] = ("", -1.0)

    def say(doing: str, share: float | None) -> None:
        nonlocal last
        now = time.monotonic()
        if doing == last[0] and now - last[1] < _LEAST_INTERVAL_S:
            return
        last = (doing, now)
        known = None if share is None else min(1.0, max(0.0, float(share)))
        sys.stderr.write(json.dumps({"doing": doing, "share": known}) + "\n")
        sys.stderr.flush()

    return say


@contextmanager
def fleet_progress() -> Iterator[Callable[[str, Any, int, int], None]]:
    """``tell(machine, answer, ended, all)`` while the block runs: a line a machine."""
    say = _lines() if _wants_lines() else None

    def tell(machine: str, answer: Any, ended: int, total: int) -> None:
        if say is not None:
            say(f"{machine} {answer.status}", ended / total)
            return
        line = f"[{ended}/{total}] {machine} {answer.in_short}"
        sys.stderr.write("".join(sign if sign.isprintable() else "?" for sign in line) + "\n")
        sys.stderr.flush()

    yield tell
