"""Which recordings does a command read, and what did the user say about them: options that many commands share."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from dataclasses import MISSING, dataclass, fields, is_dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_args

import typer

from selector.cli.shared.option_table import argument, option
from selector.errors import OptionError

if TYPE_CHECKING:
    from selector.readers import Overrides, Reading

READING_PANEL = option("recordings --encoding").rich_help_panel

RunsOrStudy = Annotated[list[Path] | None, argument("study RUN...")]
MachineFile = Annotated[Path | None, option("recordings --machine")]


@dataclass(frozen=True)
class Source:
    """What the command line says about the recordings; one field an option."""

    runs: Annotated[list[Path], argument("recordings RUN...")]
    machine: MachineFile = None
    encoding: Annotated[str | None, option("recordings --encoding")] = None
    separator: Annotated[str | None, option("recordings --separator")] = None
    decimal: Annotated[str | None, option("recordings --decimal")] = None
    header_row: Annotated[int | None, option("recordings --header-row", min=0)] = None
    sheet: Annotated[str | None, option("recordings --sheet")] = None
    time_column: Annotated[str | None, option("recordings --time-column")] = None
    time_unit: Annotated[str | None, option("recordings --time-unit")] = None
    date_order: Annotated[str | None, option("recordings --date-order")] = None
    period_s: Annotated[float | None, option("recordings --period-s")] = None
    since: Annotated[str | None, option("recordings --since")] = None
    until: Annotated[str | None, option("recordings --until")] = None
    mean_s: Annotated[float | None, option("recordings --mean-s")] = None
    units: Annotated[list[str] | None, option("recordings --unit")] = None
    roles: Annotated[list[str] | None, option("recordings --role")] = None

    @property
    def machine_files(self) -> tuple[Path, ...]:
        """The machine file that was named, if one was."""
        return () if self.machine is None else (self.machine,)

    def reading(self, needed: tuple[str, ...] | None = None) -> Reading:
        """The recordings, and how they were read; of the machine file only `needed` channels must be there.

        Raises InputError: a file cannot be read, the machine file does not fit, or an option cannot be used.
        """
        from selector.readers import read

        return read(self.runs, machine=self.machine, overrides=replace(self.overrides(), needed=needed))

    def refuse_unread(self, option: str) -> None:
        """Raises OptionError: something is said about recordings, and none are named; `option` names them."""
        for name, annotation in inspect.get_annotations(Source, eval_str=True).items():
            value = getattr(self, name)
            if name == "runs" or value is None or value == []:
                continue
            # typer keeps the first name of an annotated option in the place of its default
            said = get_args(annotation)[1].default
            raise OptionError(
                f"{said} {value[0] if isinstance(value, list) else value} without {option}",
                expected=f"{option} beside it: {said} says how recordings are read",
                where=said,
                advice=f"name recordings with {option}, or leave {said} out",
            )

    def overrides(self) -> Overrides:
        """What the user decides instead of the reader. Raises OptionError: an option cannot be used."""
        from selector.readers import Overrides

        said = {name: value for name, value in vars(self).items() if name not in ("runs", "machine")}
        return Overrides(**said | {"units": pairs(self.units, "--unit"), "roles": pairs(self.roles, "--role")})


def with_source(command: Callable[..., None], runs: Any = None) -> Callable[..., None]:
    """A command whose first parameter is a `Source`, with one command-line parameter for each field of it.

    So has every further parameter that is annotated as a dataclass of options. A command that has a parameter
    `from_study`, or names its recordings by an option (`runs`, annotated as that), can do without them and may get a
    `Source` without runs.

    >>> @with_source
    ... def count(source, quiet: bool = False): ...
    >>> list(inspect.signature(count).parameters)[:3]
    ['runs', 'machine', 'quiet']
    """
    own: list[inspect.Parameter] = []
    together: dict[str, type] = {}
    for part in list(inspect.signature(command, eval_str=True).parameters.values())[1:]:
        if isinstance(part.annotation, type) and is_dataclass(part.annotation):
            together[part.name] = part.annotation
            own += _one_by_one(part.annotation)
        else:
            own.append(part.replace(kind=inspect.Parameter.KEYWORD_ONLY))
    # the recordings have no default, unless a study may name them
    named, *shared = _one_by_one(Source)
    if any(part.name == "from_study" for part in own):
        named = named.replace(annotation=RunsOrStudy, default=None)
    elif runs is not None:
        named = named.replace(annotation=runs, default=None)

    @functools.wraps(command)
    def spread(**values: Any) -> None:
        for name, kind in together.items():
            values[name] = kind(**{field.name: values.pop(field.name) for field in fields(kind)})
        said = {part.name: values.pop(part.name) for part in shared}
        command(Source(values.pop("runs") or [], **said), **values)

    # RUN... takes all words that are left, so what a command itself takes by position stands before it;
    # how files are read comes last on the help page
    needed = [part for part in own if runs is not None and part.default is inspect.Parameter.empty]
    argument = type(typer.Argument())
    leading = [
        part for part in own if part in needed or any(isinstance(note, argument) for note in get_args(part.annotation))
    ]
    parameters = [*leading, named, shared[0], *(part for part in own if part not in leading), *shared[1:]]
    spread.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    spread.__annotations__ = {part.name: part.annotation for part in parameters}
    return spread


def _one_by_one(kind: Any) -> list[inspect.Parameter]:
    """A parameter for each field of a dataclass."""
    hints = inspect.get_annotations(kind, eval_str=True)
    return [
        inspect.Parameter(
            field.name,
            inspect.Parameter.KEYWORD_ONLY,
            annotation=hints[field.name],
            default=inspect.Parameter.empty if field.default is MISSING else field.default,
        )
        for field in fields(kind)
    ]


def pairs(values: list[str] | None, option: str) -> dict[str, str]:
    """Values of a repeated ``--option NAME=VALUE``.

    Raises OptionError: a value has no ``=``, nothing on one of its sides, or a name is given twice.
    """
    found: dict[str, str] = {}
    for value in values or ():
        # units hold no "=", channel names may
        name, mark, right = (part.strip() for part in value.rpartition("="))
        if not (mark and name and right):
            advice = f"write it as {option} NAME=VALUE, in quotes if it has blanks, once for each name"
            raise OptionError(f"{value!r}", expected="NAME=VALUE", where=option, advice=advice)
        if name in found:
            expected, advice = "one value for each name", f"keep one {option} {name}=…"
            raise OptionError(f"{name!r} is given twice", expected=expected, where=option, advice=advice)
        found[name] = right
    return found
