"""How is it shown how far long work has come: a bar for people, lines for programs, nothing elsewhere.

A program that runs `selector` sets ``SELECTOR_PROGRESS=lines`` and reads from stderr one JSON object a line,
``{"doing": "folds", "share": 0.42}``: what is being done, and the share that is done, null where nobody knows. Other
lines of stderr are messages for people. A line comes when `doing` changes, and else ten times a second at most.
"""

import json
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

Progress = Callable[[str, float | None], None]

VARIABLE = "SELECTOR_PROGRESS"
_LEAST_INTERVAL_S, _LONGEST_SILENCE_S = 0.1, 3.0


@contextmanager
def progress_bar(*, spoken: bool = False) -> Iterator[Progress]:
    """``say(doing, share)`` while the block runs; `spoken`: without a terminal a line every few seconds."""
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as Bar

    console = Console(stderr=True)
    if os.environ.get(VARIABLE) == "lines":
        yield _lines()
    elif console.is_terminal:
        columns = (BarColumn(), TimeElapsedColumn(), TextColumn("{task.description}"))
        with Bar(*columns, console=console, transient=True) as bar:
            task = bar.add_task("loading", total=None)

            def say(doing: str, share: float | None) -> None:
                bar.update(task, description=doing, completed=share or 0.0, total=None if share is None else 1.0)

            yield say
    elif spoken:
        with _spoken() as speak:
            yield speak
    else:
        yield lambda _doing, _share: None


@contextmanager
def counted_progress(title: str) -> Iterator[Callable[[float, float, str], None]]:
    """``report(done, total, text)`` while the block runs, to be called as often as one likes."""
    with progress_bar() as say:

        def report(done: float, total: float, text: str = "") -> None:
            say(f"{title}, {text}" if text else title, done / total if total > 0 else None)

        yield report


@contextmanager
def _spoken() -> Iterator[Progress]:
    """What is being done, on stderr, wherever nothing was said for some seconds."""
    begun, done = time.monotonic(), threading.Event()
    now: list[tuple[str, float | None]] = [("loading", None)]

    def keep_saying() -> None:
        while not done.wait(_LONGEST_SILENCE_S):
            doing, share = now[-1]
            known = f", {100.0 * share:.0f} %" if share else ""
            sys.stderr.write(f"  {time.monotonic() - begun:4.0f} s  {doing}{known}\n")
            sys.stderr.flush()

    speaker = threading.Thread(target=keep_saying, daemon=True)
    speaker.start()
    try:
        yield lambda doing, share: now.__setitem__(-1, (doing, share))
    finally:
        done.set()
        speaker.join()


def _lines() -> Progress:
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
    say = _lines() if os.environ.get(VARIABLE) == "lines" else None

    def tell(machine: str, answer: Any, ended: int, total: int) -> None:
        if say is not None:
            say(f"{machine} {answer.status}", ended / total)
            return
        line = f"[{ended}/{total}] {machine} {answer.in_short}"
        sys.stderr.write("".join(sign if sign.isprintable() else "?" for sign in line) + "\n")
        sys.stderr.flush()

    yield tell
