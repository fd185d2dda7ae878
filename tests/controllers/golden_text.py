"""Golden files of the writers: the text of an export as it was, whatever version of selector writes it."""

from __future__ import annotations

import re
from pathlib import Path

GOLDEN = Path(__file__).with_name("golden")


def golden(name: str) -> str:
    """The text that was kept; `name` is relative to ``golden/``."""
    return (GOLDEN / name).read_text(encoding="ascii")


def without_version(text: str) -> str:
    """The text of an export without the version of selector, also where a control knows capital letters only."""
    return re.sub(r'(?i)(written by selector|productversion="|generationtool="selector) ?\d[\w.+]*', r"\1", text)
