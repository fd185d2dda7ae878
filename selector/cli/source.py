"""Which recordings does a command read, and what did the user say about them: options that many commands share."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from selector.errors import OptionError

if TYPE_CHECKING:
    from selector.readers import Reading

_PANEL = "How the files are read (what is not said is inferred and shown)"

Runs = Annotated[
    list[Path],
    typer.Argument(metavar="RUN...", help="Recordings, one file a run; a folder stands for the recordings in it."),
]
MachineFile = Annotated[
    Path | None,
    typer.Option("--machine", metavar="M.toml", help="Machine file: columns, roles and units of the channels."),
]
Encoding = Annotated[
    str | None, typer.Option("--encoding", metavar="NAME", help="Text encoding, e.g. cp1251.", rich_help_panel=_PANEL)
]
Separator = Annotated[
    str | None,
    typer.Option("--separator", metavar="CHAR", help="Column separator, or `tab`.", rich_help_panel=_PANEL),
]
Decimal = Annotated[
    str | None, typer.Option("--decimal", metavar="CHAR", help="Decimal mark: `.` or `,`.", rich_help_panel=_PANEL)
]
TimeColumn = Annotated[
    str | None, typer.Option("--time-column", metavar="NAME", help="Column of the time.", rich_help_panel=_PANEL)
]
TimeUnit = Annotated[
    str | None,
    typer.Option("--time-unit", metavar="UNIT", help="Unit of the time, or `datetime`.", rich_help_panel=_PANEL),
]
Sheet = Annotated[
    str | None, typer.Option("--sheet", metavar="NAME", help="Sheet of a workbook.", rich_help_panel=_PANEL)
]
Units = Annotated[
    list[str] | None,
    typer.Option("--unit", metavar="CHANNEL=UNIT", help="Unit of a channel; repeat.", rich_help_panel=_PANEL),
]
Roles = Annotated[
    list[str] | None,
    typer.Option("--role", metavar="CHANNEL=ROLE", help="Role of a channel; repeat.", rich_help_panel=_PANEL),
]


@dataclass(frozen=True)
class Source:
    """What the command line says about the recordings; one field an option."""

    runs: Runs
    machine: MachineFile = None
    encoding: Encoding = None
    separator: Separator = None
    decimal: Decimal = None
    time_column: TimeColumn = None
    time_unit: TimeUnit = None
    sheet: Sheet = None
    unit: Units = None
    role: Roles = None


def with_source(command: Callable[..., None]) -> Callable[..., None]:
    """A command whose first parameter is a `Source`, with one command-line parameter for each field of it.

    >>> @with_source
    ... def count(source, quiet: bool = False): ...
    >>> list(inspect.signature(count).parameters)[:2], list(inspect.signature(count).parameters)[-1]
    (['runs', 'machine'], 'quiet')
    """
    hints = inspect.get_annotations(Source, eval_str=True)
    own = list(inspect.signature(command, eval_str=True).parameters.values())[1:]
    shared = [
        inspect.Parameter(
            field.name,
            inspect.Parameter.KEYWORD_ONLY,
            annotation=hints[field.name],
            default=inspect.Parameter.empty if field.name == "runs" else field.default,
        )
        for field in fields(Source)
    ]

    @functools.wraps(command)
    def spread(**values: Any) -> None:
        command(Source(**{part.name: values.pop(part.name) for part in shared}), **values)

    parameters = [*shared, *(part.replace(kind=inspect.Parameter.KEYWORD_ONLY) for part in own)]
    spread.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    spread.__annotations__ = {part.name: part.annotation for part in parameters}
    return spread


def pairs(values: list[str] | None, option: str) -> dict[str, str]:
    """Values of a repeated ``--option NAME=VALUE``.

    Raises
    ------
    OptionError
        A value has no ``=``, nothing on one of its sides, or a name is given twice.
    """
    found: dict[str, str] = {}
    for value in values or ():
        # units hold no "=", channel names may
        name, mark, right = (part.strip() for part in value.rpartition("="))
        if not (mark and name and right):
            raise OptionError(
                f"{value!r}",
                expected="NAME=VALUE, e.g. T1=degC",
                where=option,
                advice=f"write it as {option} NAME=VALUE, in quotes if it has blanks, once for each channel",
            )
        if name in found:
            raise OptionError(
                f"{name!r} is given twice",
                expected="one value for each channel",
                where=option,
                advice=f"keep one {option} {name}=…",
            )
        found[name] = right
    return found
