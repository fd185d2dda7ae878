"""A text file that somebody names: opened only if it is one, read only as far as it may be long; TOML to write."""

import json
import os
import re
import shlex
import subprocess
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from selector.errors import InputError


def shell_word(text: str) -> str:
    """A word of a command as a person types it in the shell of this system: quoted where it has blanks."""
    return subprocess.list2cmdline([text]) if os.name == "nt" else shlex.quote(text)


def bytes_of(path: Path, most_bytes: int, refused: Callable[[str], InputError]) -> bytes:
    """The content of a file; `refused` makes the error.

    Raises InputError: there is no such file, it cannot be opened, is none (a folder, a pipe), or is too long.
    """
    if path.exists() and not path.is_file():
        # opening a pipe would wait for ever
        what = "a folder" if path.is_dir() else "not a regular file but a device, a pipe or a socket"
        raise refused(what)
    try:
        with path.open("rb") as file:
            content = file.read(most_bytes + 1)
    except (OSError, ValueError) as error:
        raise refused(f"a file that cannot be opened ({getattr(error, 'strerror', None) or error})") from error
    if len(content) > most_bytes:
        raise refused(f"a file of more than {most_bytes // 1_000_000} MB")
    return content


def text_of(path: Path, most_bytes: int, refused: Callable[[str], InputError]) -> str:
    """The text in a file: UTF-8, with or without a byte order mark, lines ended by LF; `refused` makes the error.

    Raises InputError: as `bytes_of`, or it is no UTF-8.
    """
    content = bytes_of(path, most_bytes, refused)
    try:
        return content.decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        raise refused(f"text that is not UTF-8 at byte {error.start} ({content[error.start]:#04x})") from None


def rows_by_kind(path: Path) -> dict[str, list[str]]:
    """First word of the rows of a table of ours → what follows it, row by row; a row of ``#`` is a remark."""
    found: dict[str, list[str]] = {}
    for row in path.read_text(encoding="utf-8").splitlines():
        kind, _, said = row.partition(" ")
        if kind != "#":
            found.setdefault(kind, []).append(said)
    return found


def toml_key(name: str) -> str:
    """A key as TOML has it, quoted where it has to be."""
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else toml_value(name)


def toml_value(value: Any) -> str:
    """A text, a number, a truth value, an array or a table of them as TOML has it; a table without its None."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int | float):
        return repr(float(value)) if isinstance(value, float) else str(value)
    if isinstance(value, Mapping):
        parts = ", ".join(f"{toml_key(key)} = {toml_value(one)}" for key, one in value.items() if one is not None)
        return "{ " + parts + " }" if parts else "{}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(toml_value(one) for one in value) + "]"
    # JSON's escapes are TOML's, but for the control characters that JSON lets through
    text = json.dumps(str(value), ensure_ascii=False)
    return "".join(c if c.isprintable() or ord(c) > 0x9F else f"\\u{ord(c):04x}" for c in text)
