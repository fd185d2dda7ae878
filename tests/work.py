"""How much work something is, counted: the same number on a quiet and on a busy machine."""

from __future__ import annotations

import sys
from collections.abc import Callable
from contextlib import contextmanager
from types import FrameType
from typing import Any


class Calls:
    """Calls that were counted."""

    def __init__(self) -> None:
        self.count = 0

    def __call__(self, frame: FrameType, event: str, argument: Any) -> None:
        if event in ("call", "c_call"):
            self.count += 1


@contextmanager
def counted_calls():
    """Counts calls of functions, those written in Python and those written in C, made in this thread."""
    calls, before = Calls(), sys.getprofile()
    sys.setprofile(calls)
    try:
        yield calls
    finally:
        sys.setprofile(before)


def calls_of(work: Callable[[], object]) -> int:
    """Number of calls that a piece of work makes."""
    with counted_calls() as calls:
        work()
    return calls.count
