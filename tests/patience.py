"""Waiting for a condition instead of for a time: a busy machine takes longer and is not wrong."""

from __future__ import annotations

import time
from collections.abc import Callable

PATIENCE_S = 300.0
"""After which a test gives up: long beyond what a busy machine needs, so that a hang is told apart from a delay."""


def wait_for(is_so: Callable[[], object], *, patience_s: float = PATIENCE_S) -> None:
    """Returns as soon as a condition holds; AssertionError if it does not within `patience_s`."""
    end = time.monotonic() + patience_s
    while not is_so():
        assert time.monotonic() < end, f"not so after {patience_s:g} s"
        time.sleep(0.01)
