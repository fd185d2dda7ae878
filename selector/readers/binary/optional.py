"""Modules that are installed only with ``pip install "selector[formats]"``."""

from __future__ import annotations

import gc
import importlib
import io
import logging
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from typing import Any

from selector.errors import ReadError


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
            advice='pip install "selector[formats]", or export the recording as CSV',
        ) from error


@contextmanager
def quiet() -> Iterator[None]:
    """Other packages' warnings (deprecations, odd but harmless files) are no concern of the user here."""
    before = logging.root.manager.disable
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        logging.disable(logging.CRITICAL)
        try:
            yield
        finally:
            logging.disable(before)


@contextmanager
def silent() -> Iterator[None]:
    """Nothing that another package prints reaches standard output, which belongs to ``--json``."""
    with redirect_stdout(io.StringIO()):
        yield


def collect_quietly() -> None:
    """Let go of half-made objects of other packages whose finalisers fail on damaged files."""
    hook = sys.unraisablehook
    sys.unraisablehook = lambda _: None
    try:
        gc.collect()
    finally:
        sys.unraisablehook = hook
