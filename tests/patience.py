"""Waiting for a condition instead of for a time, and for another process that does the same."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

if sys.platform != "win32":
    import fcntl

PATIENCE_S = 300.0
"""After which a test gives up: long beyond what a busy machine needs, so that a hang is told apart from a delay."""


def wait_for(is_so: Callable[[], object], *, patience_s: float = PATIENCE_S) -> None:
    """Returns as soon as a condition holds; AssertionError if it does not within `patience_s`."""
    end = time.monotonic() + patience_s
    while not is_so():
        assert time.monotonic() < end, f"not so after {patience_s:g} s"
        time.sleep(0.01)


def shared_folder(factory: pytest.TempPathFactory) -> Path:
    """A folder of this run of the suite that all of its processes have."""
    own = factory.getbasetemp()
    return own.parent if "PYTEST_XDIST_WORKER" in os.environ else own


_held: set[Path] = set()  #: By this process


@contextmanager
def alone(sign: Path) -> Iterator[None]:
    """One process at a time: others that come to the same file wait; Windows has no such lock, there all go on."""
    if sign in _held:
        yield  # what is made needs itself: a lock of the same process would wait for ever
        return
    with sign.open("w") as file:
        if sys.platform != "win32":
            fcntl.flock(file, fcntl.LOCK_EX)
        _held.add(sign)
        try:
            yield
        finally:
            _held.remove(sign)
