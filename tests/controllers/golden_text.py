"""Golden files of the writers: the text of an export as it was, whatever version of selector writes it."""

from __future__ import annotations

import io
import re
import zipfile
from pathlib import Path

GOLDEN = Path(__file__).with_name("golden")


def golden(name: str) -> str:
    """The text that was kept; `name` is relative to ``golden/``."""
    return (GOLDEN / name).read_text(encoding="ascii")


def without_version(text: str) -> str:
    """The text of an export without the version of selector, also where a control knows capital letters only."""
    return re.sub(r'(?i)(written by selector|productversion="|generationtool="selector) ?\d[\w.+]*', r"\1", text)


def members_of(archive: bytes) -> dict[str, bytes]:
    """Name in an archive → content."""
    with zipfile.ZipFile(io.BytesIO(archive)) as opened:
        return {name: opened.read(name) for name in opened.namelist()}


def texts_of(files) -> dict[str, str]:
    """The texts of an export, as text or as bytes, also those inside of a unit; no binaries."""
    found = {}
    for name, content in files.items():
        if name.endswith(".fmu"):
            inside = {f"{name}/{one}": of for one, of in members_of(content).items() if not one.startswith("binaries/")}
            found |= {one: of.decode("utf-8") for one, of in inside.items()}
        else:
            found[name] = content if isinstance(content, str) else content.decode("utf-8")
    return found
