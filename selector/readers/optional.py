"""Modules that are installed only with ``pip install "selector[formats]"``."""

from __future__ import annotations

import gc
import importlib
import logging
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
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
    loggers = [logging.getLogger(name) for name in ("nptdms", "asammdf")]
    levels = [logger.level for logger in loggers]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for logger in loggers:
            logger.setLevel(logging.CRITICAL)
        try:
            yield
        finally:
            for logger, level in zip(loggers, levels, strict=True):
                logger.setLevel(level)


def collect_quietly() -> None:
    """Let go of half-made objects of other packages whose finalisers fail on damaged files."""
    hook = sys.unraisablehook
    sys.unraisablehook = lambda _: None
    try:
        gc.collect()
    finally:
        sys.unraisablehook = hook
