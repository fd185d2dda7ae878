"""Writes docs/reference/command-line.md from the program itself; `make reference` runs it, a test checks it."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import typer

from selector.cli import app
from selector.cli.shared.source import READING_PANEL

PAGE = Path(__file__).parent / "reference" / "command-line.md"

HEAD = """# Command line

Written by the program (`make reference`); do not edit. Rules that hold for every command, exit codes and the JSON that
`--json` prints: [contracts](contracts.md).
"""

READING = """What is not said is inferred and shown by `selector describe`. Every command with `RUN...` takes these
options; the machine file says the same things for good.
"""


def commands() -> Iterator[tuple[str, Any]]:
    """(name as typed, command) of every command that does something, in the order of the program."""
    yield from _leaves("selector", typer.main.get_command(app))


def page() -> str:
    """The page as Markdown."""
    found = list(commands())
    reading = next(_panels(_options(command))[READING_PANEL] for _, command in found if _reads(command))
    sections = [_section(name, command) for name, command in found]
    return HEAD + "".join(sections) + "\n".join(["\n## How files are read\n", READING, *_table("option", reading)])


def _options(command: Any) -> list[Any]:
    return [p for p in command.params if p.param_type_name == "option" and "--help" not in p.opts]


def _reads(command: Any) -> bool:
    return READING_PANEL in _panels(_options(command))


def _table(title: str, options: list[Any]) -> list[str]:
    return [f"| {title} | |", "|---|---|", *(f"| {_option(p)} | {_help(p)} |" for p in options), ""]


def _leaves(name: str, command: Any) -> Iterator[tuple[str, Any]]:
    below = getattr(command, "commands", None)
    if below is None:
        yield name, command
        return
    for word, sub in below.items():
        if not sub.hidden:
            yield from _leaves(f"{name} {word}", sub)


def _section(name: str, command: Any) -> str:
    arguments = [p for p in command.params if p.param_type_name == "argument"]
    options = _options(command)
    words = [name, *(_argument(p) for p in arguments), *(["[options]"] if options else [])]
    text = inspect.cleandoc(command.help or "").replace("\b\n", "")
    lines = [f"\n## `{name}`\n", "```", " ".join(words), "```\n", text, ""]
    if arguments:
        lines += ["| argument | |", "|---|---|", *(f"| `{_argument(p)}` | {_help(p)} |" for p in arguments), ""]
    for panel, members in _panels(options).items():
        if panel != READING_PANEL:
            lines += _table(panel, members)
    if _reads(command):
        lines += ["Also: [how files are read](#how-files-are-read).", ""]
    return "\n".join(lines).rstrip() + "\n"


def _panels(options: list[Any]) -> dict[str, list[Any]]:
    found: dict[str, list[Any]] = {}
    for option in options:
        found.setdefault(getattr(option, "rich_help_panel", None) or "option", []).append(option)
    return found


def _argument(parameter: Any) -> str:
    word = parameter.metavar or parameter.name.upper()
    return word if parameter.required else f"[{word}]"


def _option(parameter: Any) -> str:
    names = [*parameter.opts, *parameter.secondary_opts]
    value = (parameter.metavar or parameter.name.upper()).replace("|", "\\|")
    return ", ".join(f"`{name}`" if parameter.is_flag else f"`{name} {value}`" for name in names)


def _help(parameter: Any) -> str:
    text = " ".join((parameter.help or "").split()).replace("|", "\\|")
    default = parameter.default
    if callable(default) or default in (None, False, (), []) or getattr(parameter, "show_default", True) is False:
        return text + (" Required." if parameter.required and parameter.param_type_name == "option" else "")
    return f"{text} Default: `{getattr(default, 'value', default)}`."


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8", newline="\n")
    print(f"wrote {PAGE.relative_to(PAGE.parents[2])}")
