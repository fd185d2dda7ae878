"""What `--help` says of arguments and options: names, metavars, panels and texts stand in `option_table.txt`."""

import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import typer

from selector.errors import OptionError


@dataclass(frozen=True)
class _Entry:
    names: tuple[str, ...]  #: Of an option; empty of an argument
    metavar: str
    panel: str | None
    help: str


@cache
def _entries() -> dict[str, _Entry]:
    """Command and first name of an option, or metavar of an argument → what the table has of it.

    A line at the margin begins a command, behind a colon its panel; options stand below it, their texts below them.
    """
    found: dict[str, _Entry] = {}
    command, panel = "", ""
    table = Path(__file__).with_suffix(".txt").read_text(encoding="utf-8")
    for block in re.split(r"\n(?= {0,4}\S)", table.strip("\n")):
        head, *text = (line.strip() for line in block.splitlines())
        if not block.startswith(" "):
            command, _, panel = (part.strip() for part in head.partition(":"))
            continue
        words = head.split()
        names = tuple(word for word in words if word.startswith("-"))
        metavar = " ".join(words[len(names) :])
        found[f"{command} {names[0] if names else metavar}"] = _Entry(names, metavar, panel or None, " ".join(text))
    return found


def option(key: str, **more: Any) -> Any:
    """An option of a command, e.g. ``fleet run --jobs``; `more` is what typer has to know beside its words."""
    told = _entries()[key]
    return typer.Option(*told.names, metavar=told.metavar, rich_help_panel=told.panel, help=told.help, **more)


def argument(key: str) -> Any:
    """An argument of a command, e.g. ``taps FILE...``."""
    told = _entries()[key]
    return typer.Argument(metavar=told.metavar, help=told.help)


def unusable_option(found: str, expected: str, advice: str) -> OptionError:
    """The error about an option and its value, with which `found` begins."""
    return OptionError(found, expected=expected, where=found.split(" ")[0], advice=advice)
