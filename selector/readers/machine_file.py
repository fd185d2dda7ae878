"""machine.toml: what the user says about the machine, the time column and the channels."""

import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator

from selector.errors import ReadError, RecordingError, UnitError
from selector.physics.model_text import expected_text
from selector.readers.clock.stamps import time_unit
from selector.readers.roles.names import closest, one_of_words
from selector.text_file import text_of, toml_key, toml_value
from selector.units import ROLES, unit_for_role

_MAX_BYTES = 10_000_000


class _Entry(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class MachineSection(_Entry):
    """``[machine]``: the machine itself."""

    name: str | None = None


class TimeSection(_Entry):
    """``[time]``: which column is the time, and in which unit; date and time, or year to second, may be listed.

    Without a time column, `period_s` is the sampling period [s]. `date_order` says how dates such as 03/04/2026 are to
    be read.
    """

    column: str | Annotated[tuple[str, ...], Field(min_length=1, max_length=6, strict=False)] | None = None
    unit: str | None = None
    period_s: Annotated[float, Field(gt=0, allow_inf_nan=False, strict=False)] | None = None
    date_order: Literal["dmy", "mdy", "ymd"] | None = None

    @field_validator("unit")
    @classmethod
    def _unit_of_time(cls, value: str | None) -> str | None:
        if value is not None and value != "datetime" and time_unit(value) is None:
            raise ValueError(f"{value!r} is no unit of time; expected s, ms, min, h, d or 'datetime'")
        return value

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the time columns, possibly none."""
        return () if self.column is None else (self.column,) if isinstance(self.column, str) else self.column


class ChannelSection(_Entry):
    """``[channels.NAME]``: one channel; what is left out is inferred and shown as guessed."""

    column: str | None = None
    role: str | None = None
    unit: str | None = None
    place: str | None = None
    axis: str | None = None
    xyz: Annotated[tuple[float, float, float], Field(strict=False)] | None = None

    @field_validator("role")
    @classmethod
    def _known_role(cls, value: str | None) -> str | None:
        if value is not None and value not in ROLES:
            near = closest(value, ROLES)
            raise ValueError(
                f"role {value!r} is not known"
                + (f"; nearest: {near!r}" if near else "")
                + f"; roles: {', '.join(ROLES)}"
            )
        return value

    @field_validator("xyz")
    @classmethod
    def _finite(cls, value: tuple[float, float, float] | None) -> tuple[float, float, float] | None:
        if value is not None and not all(abs(v) < 1e6 for v in value):
            raise ValueError("xyz must be three finite numbers [m]")
        return value


_Second = Annotated[float, Field(ge=0.0, strict=False)]
Stretch = Annotated[tuple[_Second, _Second], Field(strict=False)]
WHOLE: tuple[Stretch, ...] = ((0.0, float("inf")),)  #: The stretch of a whole run; ``"all"`` in the file.


class RunChannelSection(_Entry):
    """``[runs.RUN.channels.NAME]``: unit in this run only, and stretches to leave out [s from the start of the run]."""

    unit: str | None = None
    leave_out: Annotated[tuple[Stretch, ...], Field(strict=False)] = ()

    @field_validator("leave_out", mode="before")
    @classmethod
    def _all(cls, value: Any) -> Any:
        if value == "all":
            return WHOLE
        if isinstance(value, str):
            raise ValueError('leave_out is a list of [from_s, to_s], or "all"')
        return value

    @field_validator("leave_out")
    @classmethod
    def _forward(cls, value: tuple[Stretch, ...]) -> tuple[Stretch, ...]:
        for first, last in value:
            if not first < last:
                raise ValueError(f"a stretch ends after it begins, not [{first:g}, {last:g}]")
        return value


class RunSection(_Entry):
    """``[runs.RUN]``: repairs of one run; the files are never edited."""

    use: bool = True
    beside: Annotated[tuple[str, ...], Field(strict=False)] = ()  #: Runs of the same time by other loggers
    #: How long after the run that it stands beside it begins [s]; None: as the dates or the clocks of both say
    late_s: Annotated[float | None, Field(strict=False)] = None
    swap: Annotated[tuple[Annotated[tuple[str, str], Field(strict=False)], ...], Field(strict=False)] = ()
    channels: Annotated[Mapping[str, RunChannelSection], Field(strict=False)] = Field(default_factory=dict)

    @field_validator("swap")
    @classmethod
    def _of_two(cls, value: tuple[tuple[str, str], ...]) -> tuple[tuple[str, str], ...]:
        for first, second in value:
            if first == second:
                raise ValueError(f"two channels change places, not {first!r} with itself")
        return value


class Machine(_Entry):
    """A machine file. Round trip: ``machine(path)`` of what ``write_machine_file`` wrote is equal."""

    machine: MachineSection = MachineSection()
    time: TimeSection = TimeSection()
    channels: Annotated[Mapping[str, ChannelSection], Field(strict=False)] = Field(default_factory=dict)
    runs: Annotated[Mapping[str, RunSection], Field(strict=False)] = Field(default_factory=dict)

    @field_validator("channels")
    @classmethod
    def _usable_names(cls, value: Mapping[str, ChannelSection]) -> Mapping[str, ChannelSection]:
        for name in value:
            if not name.strip() or not name.isprintable() or len(name) > 200:
                raise ValueError(f"channel name {name[:60]!r} is empty, too long or has control characters")
        return value


def machine(path: Path) -> Machine:
    """The machine file at `path`.

    Raises ReadError: The file cannot be read, is not TOML, has an unknown key, or a value of the wrong kind; the
    message names the line and, for a key, the nearest one that is valid. Raises UnitError: The unit of a channel is
    unknown or does not fit its role. Raises RecordingError: Two channels are read from the same column.
    """
    where = str(path)
    expected, advice = "a machine file (TOML text in UTF-8)", "check the path, and whether this is the machine file"
    text = text_of(path, _MAX_BYTES, lambda found: ReadError(found, expected=expected, where=where, advice=advice))
    if not text.strip():
        advice = "write it again (`selector describe FILE --write machine.toml`), or leave it out"
        raise ReadError("an empty file", expected=expected, where=where, advice=advice)
    return machine_from_text(text, where)


def machine_from_text(text: str, where: str) -> Machine:
    """The machine file with this content; see `machine`."""
    try:
        parsed = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError, ValueError) as error:
        raise ReadError(
            f"text that is not TOML ({error})",
            expected="a machine file: [machine], [time], [channels.NAME] with key = value lines",
            where=where,
            advice="correct this line; texts need quotation marks, numbers a decimal point",
        ) from error
    try:
        read = Machine.model_validate(parsed)
    except ValidationError as error:
        raise _invalid(error, text, where) from error
    used: dict[str, str] = {}
    for name, channel in read.channels.items():
        column = channel.column or name
        if column in used:
            raise RecordingError(
                f"channels {used[column]!r} and {name!r} are both read from column {column!r}",
                expected="one channel per column",
                where=_place(where, text, ("channels", name, "column")),
                advice="correct the column of one of them",
            )
        used[column] = name
        if channel.unit is not None and channel.role is not None:
            try:
                unit_for_role(channel.unit, channel.role, where=where)
            except UnitError as error:
                # the place is looked up in the whole text: only for a message
                raise error.at(_place(where, text, ("channels", name, "unit"))) from None
    return read


def machine_text(values: Machine, undeclared: Mapping[str, str] | None = None, guessed_clock: str | None = None) -> str:
    """The machine file as TOML text.

    Columns that are not channels, and why, are written as comments, to be completed by hand; so is the line of
    ``[time]`` that nobody said.
    """
    lines: list[str] = []

    def add(section: str, content: Mapping[str, Any]) -> None:
        lines.extend([f"[{section}]", *(f"{key} = {toml_value(value)}" for key, value in content.items()), ""])

    if values.machine.name is not None:
        add("machine", {"name": values.machine.name})
    time = values.time.model_dump(exclude_none=True)
    if time or guessed_clock is not None:
        lines.append("[time]")
        lines += [f"{key} = {toml_value(value)}" for key, value in time.items()]
        if guessed_clock is not None:
            lines.append(f"# {guessed_clock}  # a guess: correct it, and take the first # away")
        lines.append("")
    for name, channel in values.channels.items():
        add(f"channels.{toml_key(name)}", channel.model_dump(exclude_none=True))
    for run, section in values.runs.items():
        content = section.model_dump(exclude_defaults=True, exclude={"channels"})
        if content or not section.channels:
            add(f"runs.{toml_key(run)}", content)
        for name, repair in section.channels.items():
            content = repair.model_dump(exclude_defaults=True)
            if repair.leave_out == WHOLE:
                content["leave_out"] = "all"
            add(f"runs.{toml_key(run)}.channels.{toml_key(name)}", content)
    for name, reason in (undeclared or {}).items():
        shown = " ".join(reason.split())
        lines += [f"# not a channel: {shown}", f"# [channels.{toml_key(name)}]", "# role = ", "# unit = ", ""]
    return "\n".join(lines)


def _invalid(error: ValidationError, text: str, where: str) -> ReadError:
    """The first thing that is wrong, in words; the number of others is told."""
    problems = error.errors(include_url=False)
    first = problems[0]
    path = tuple(str(at) for at in first["loc"] if not str(at).startswith(("function-", "constrained-", "tuple[")))
    if path and path[-1] == "str":
        path = path[:-1]
    dotted = ".".join(path) or "the file"
    more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
    if first["type"] == "extra_forbidden":
        return ReadError(
            f"unknown key {path[-1]!r}{more}",
            expected=one_of_words(path[-1], _valid_keys(path[:-1])),
            where=_place(where, text, path),
            advice="correct the spelling, or remove the line",
        )
    found = first.get("input")
    return ReadError(
        f"{dotted} = {toml_value(found)[:80]}{more}" if not isinstance(found, dict) else f"{dotted}{more}",
        expected=expected_text(first) or "a valid value",
        where=_place(where, text, path),
        advice="correct this value in the machine file",
    )


def _valid_keys(path: tuple[str, ...]) -> list[str]:
    sections: dict[str, type[BaseModel]] = {"machine": MachineSection, "time": TimeSection, "channels": ChannelSection}
    sections["runs"] = RunChannelSection if path[2:3] == ("channels",) else RunSection
    return list(sections.get(path[0] if path else "", Machine).model_fields)


def _place(where: str, text: str, path: tuple[str, ...]) -> str:
    """The file and, as far as it can be told, the line of a key."""
    lines = text.split("\n")
    while path and path[-1].isdigit() and len(path) > 1:
        path = path[:-1]
    bare = [re.sub(r"[\s\"']", "", line.split("#")[0]) for line in lines]
    headers = [f"[{'.'.join(path[:depth]).replace(' ', '')}]" for depth in range(len(path), 0, -1)]
    section = next((bare.index(header) for header in headers if header in bare), -1)
    for number in range(section + 1, len(lines)):
        if number > section + 1 and lines[number].lstrip().startswith("["):
            break
        if path and re.match(rf"\s*[\"']?{re.escape(path[-1])}[\"']?\s*=", lines[number]):
            return f"{where}, line {number + 1}, key {'.'.join(path)}"
    return f"{where}, line {section + 1}, key {'.'.join(path)}" if section >= 0 else f"{where}, key {'.'.join(path)}"
