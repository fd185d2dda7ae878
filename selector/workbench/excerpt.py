"""How does a file look: its first lines as text."""

from __future__ import annotations

import codecs
from collections.abc import Mapping
from pathlib import Path
from typing import Any

_BYTES = 16_384
_LINES, _SIGNS = 8, 240


def excerpt(file: str | Path, reading: Mapping[str, Any]) -> str:
    """The first lines of a text table as they stand there; empty for other formats, or when it cannot be opened.

    Parameters
    ----------
    file : path
    reading : mapping
        How it was read, see `selector.readers.Reading`; its encoding is used.
    """
    encoding = reading.get("encoding")
    if reading.get("format") != "delimited" or not encoding:
        return ""
    try:
        with Path(file).open("rb") as stream:
            beginning = stream.read(_BYTES)
        text = codecs.getincrementaldecoder(encoding)(errors="replace").decode(beginning)
    except (OSError, LookupError):
        return ""
    lines = text.removeprefix("\ufeff").splitlines()[:_LINES]
    return "\n".join(line if len(line) <= _SIGNS else line[: _SIGNS - 1] + "…" for line in lines)
