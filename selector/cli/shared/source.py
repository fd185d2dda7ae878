"""Which recordings does a command read, and what did the user say about them: options that many commands share."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from dataclasses import Field, dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_args

import typer

from selector.errors import OptionError

if TYPE_CHECKING:
    from selector.readers import Overrides, Reading

READING_PANEL = "How the files are read (what is not said is inferred and shown)"

Runs = Annotated[
    list[Path],
    typer.Argument(metavar="RUN...", help="Recordings, one file a run; a folder stands for the recordings in it."),
]
RunsOrStudy = Annotated[
    list[Path] | None,
    typer.Argument(
        metavar="RUN...", help="Recordings, one file a run; a folder stands for the recordings in it. Or --study."
    ),
]
MachineFile = Annotated[
    Path | None,
    typer.Option("--machine", metavar="M.toml", help="Machine file: columns, roles and units of the channels."),
]
Encoding = Annotated[
    str | None,
    typer.Option("--encoding", metavar="NAME", help="Text encoding, e.g. cp1251.", rich_help_panel=READING_PANEL),
]
Separator = Annotated[
    str | None,
    typer.Option("--separator", metavar="CHAR", help="Column separator, or `tab`.", rich_help_panel=READING_PANEL),
]
Decimal = Annotated[
    str | None,
    typer.Option("--decimal", metavar="CHAR", help="Decimal mark: `.` or `,`.", rich_help_panel=READING_PANEL),
]
TimeColumn = Annotated[
    str | None, typer.Option("--time-column", metavar="NAME", help="Column of the time.", rich_help_panel=READING_PANEL)
]
TimeUnit = Annotated[
    str | None,
    typer.Option("--time-unit", metavar="UNIT", help="Unit of the time, or `datetime`.", rich_help_panel=READING_PANEL),
]
HeaderRow = Annotated[
    int | None,
    typer.Option(
        "--header-row",
        metavar="N",
        min=0,
        help="Line with the channels' names, counted from 1; 0 if there is none.",
        rich_help_panel=READING_PANEL,
    ),
]
DateOrder = Annotated[
    str | None,
    typer.Option("--date-order", metavar="ORDER", help="`dmy`, `mdy` or `ymd`.", rich_help_panel=READING_PANEL),
]
Period = Annotated[
    float | None,
    typer.Option(
        "--period-s",
        metavar="SECONDS",
        help="Sampling period of recordings without a time.",
        rich_help_panel=READING_PANEL,
    ),
]
Sheet = Annotated[
    str | None,
    typer.Option(
        "--sheet", metavar="NAME", help="Excel sheet, TDMS group, MAT variable.", rich_help_panel=READING_PANEL
    ),
]
Units = Annotated[
    list[str] | None,
    typer.Option("--unit", metavar="CHANNEL=UNIT", help="Unit of a channel; repeat.", rich_help_panel=READING_PANEL),
]
Roles = Annotated[
    list[str] | None,
    typer.Option("--role", metavar="CHANNEL=ROLE", help="Role of a channel; repeat.", rich_help_panel=READING_PANEL),
]


@dataclass(frozen=True)
class Source:
    """What the command line says about the recordings; one field an option."""

    runs: Runs
    machine: MachineFile = None
    encoding: Encoding = None
    separator: Separator = None
    decimal: Decimal = None
    header_row: HeaderRow = None
    sheet: Sheet = None
    time_column: TimeColumn = None
    time_unit: TimeUnit = None
    date_order: DateOrder = None
    period: Period = None
    unit: Units = None
    role: Roles = None

    @property
    def machine_files(self) -> tuple[Path, ...]:
        """The machine file that was named, if one was."""
        return () if self.machine is None else (self.machine,)

    def reading(self) -> Reading:
        """The recordings, and how they were read.

        Raises
        ------
        InputError
            A file cannot be read, the machine file does not fit, or an option cannot be used.
        """
        from selector.readers import read

        return read(self.runs, machine=self.machine, overrides=self.overrides())

    def refuse_unread(self, option: str) -> None:
        """Ends with an error where something is said about recordings though none are named; `option` names them.

        Raises
        ------
        OptionError
            It is.
        """
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
        """What the user decides instead of the reader.

        Raises
        ------
        OptionError
            An option cannot be used.
        """
        from selector.readers import Overrides

        return Overrides(
            encoding=self.encoding,
            separator=self.separator,
            decimal=self.decimal,
            header_row=self.header_row,
            sheet=self.sheet,
            time_column=self.time_column,
            time_unit=self.time_unit,
            date_order=_one_of(self.date_order, ("dmy", "mdy", "ymd"), "--date-order"),
            period_s=_positive(self.period, "--period-s"),
            units=pairs(self.unit, "--unit"),
            roles=pairs(self.role, "--role"),
        )


def with_source(command: Callable[..., None], runs: Any = None) -> Callable[..., None]:
    """A command whose first parameter is a `Source`, with one command-line parameter for each field of it.

    A command that has a parameter `from_study`, or names its recordings by an option (`runs`, annotated as that), can
    do without them and may get a `Source` without runs.

    >>> @with_source
    ... def count(source, quiet: bool = False): ...
    >>> list(inspect.signature(count).parameters)[:3]
    ['runs', 'machine', 'quiet']
    """
    hints = inspect.get_annotations(Source, eval_str=True)
    own = [
        part.replace(kind=inspect.Parameter.KEYWORD_ONLY)
        for part in list(inspect.signature(command, eval_str=True).parameters.values())[1:]
    ]
    if any(part.name == "from_study" for part in own):
        hints["runs"] = RunsOrStudy
    elif runs is not None:
        hints["runs"] = runs
    shared = [
        inspect.Parameter(
            field.name,
            inspect.Parameter.KEYWORD_ONLY,
            annotation=hints[field.name],
            default=_default_of(field, hints["runs"]),
        )
        for field in fields(Source)
    ]

    @functools.wraps(command)
    def spread(**values: Any) -> None:
        said = {part.name: values.pop(part.name) for part in shared}
        command(Source(**{**said, "runs": said["runs"] or []}), **values)

    # RUN... takes all words that are left, so what a command itself takes by position stands before it;
    # how files are read comes last on the help page
    leading = [part for part in own if _is_argument(part.annotation) or (runs is not None and _is_needed(part))]
    parameters = [*leading, *shared[:2], *(part for part in own if part not in leading), *shared[2:]]
    spread.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    spread.__annotations__ = {part.name: part.annotation for part in parameters}
    return spread


def _default_of(field: Field[Any], runs: Any) -> Any:
    """The default of a command-line parameter; the recordings have none, unless a study may name them."""
    if field.name != "runs":
        return field.default
    return inspect.Parameter.empty if runs is Runs else None


def _is_argument(annotation: Any) -> bool:
    return any(isinstance(note, type(typer.Argument())) for note in get_args(annotation))


def _is_needed(part: inspect.Parameter) -> bool:
    return part.default is inspect.Parameter.empty


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


def _one_of(value: str | None, choices: tuple[str, ...], option: str) -> str | None:
    if value is not None and value not in choices:
        raise OptionError(
            f"{value!r}",
            expected="one of " + ", ".join(choices),
            where=option,
            advice=f"choose one, or leave {option} out",
        )
    return value


def _positive(value: float | None, option: str) -> float | None:
    if value is not None and not 0 < value < float("inf"):
        raise OptionError(
            f"{value}",
            expected="a positive number of seconds",
            where=option,
            advice="e.g. --period-s 60 for one a minute",
        )
    return value
