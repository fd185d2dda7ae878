"""Modules that are installed only with the extra ``formats``."""

import gc
import importlib
import io
import logging
import sys
import threading
import warnings
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, redirect_stdout
from typing import Any, TypeVar

from selector.errors import InputError, ReadError

_Read = TypeVar("_Read")


def optional_module(name: str, what: str, where: str) -> Any:
    """The module, or a ReadError that says how to install it."""
    try:
        with quiet():
            return importlib.import_module(name)
    except ImportError as error:
        raise ReadError(
            f"{what}, and the package {name} that reads it is not installed",
            expected=f"the optional package {name}",
            where=where,
            advice='in the folder of selector: pip install ".[formats]"; or export the recording as CSV',
        ) from error


class _Quiet:
    """What is switched off belongs to the whole process: of threads that read at once the last switches it on again."""

    def __init__(self) -> None:
        self._lock, self._inside, self._undone = threading.Lock(), 0, ExitStack()

    def enter(self) -> None:
        with self._lock:
            self._inside += 1
            if self._inside == 1:
                self._undone.enter_context(warnings.catch_warnings())
                warnings.simplefilter("ignore")
                self._undone.callback(logging.disable, logging.root.manager.disable)
                logging.disable(logging.CRITICAL)

    def leave(self) -> None:
        with self._lock:
            self._inside -= 1
            if self._inside == 0:
                self._undone.close()


_QUIET = _Quiet()


@contextmanager
def quiet() -> Iterator[None]:
    """Other packages' warnings (deprecations, odd but harmless files) are no concern of the user here."""
    _QUIET.enter()
    try:
        yield
    finally:
        _QUIET.leave()


@contextmanager
def silent() -> Iterator[None]:
    """Nothing that another package prints reaches standard output, which belongs to ``--json``."""
    with redirect_stdout(io.StringIO()):
        yield


def read_whole(read: Callable[[], _Read], what: str, where: str, expected: str, advice: str) -> _Read:
    """What `read` gives; whatever another package raises of a damaged file is a ReadError."""
    try:
        with quiet():
            return read()
    except (InputError, MemoryError):
        raise
    except Exception as error:
        said = f"{type(error).__name__}: {str(error)[:120]}"
    raise ReadError(f"{what} that cannot be read ({said})", expected=expected, where=where, advice=advice)


def collect_quietly() -> None:
    """Let go of half-made objects of other packages whose finalisers fail on damaged files.

    This visits all objects of the process, so only a reader whose package has such finalisers calls it.
    """
    hook = sys.unraisablehook
    sys.unraisablehook = lambda _: None
    try:
        gc.collect()
    finally:
        sys.unraisablehook = hook
