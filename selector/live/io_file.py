"""IO.toml: which servers there are, what is read and written where, and how the control shows that it lives."""

import math
import os
import re
import stat
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field

from selector.controllers.evaluator import axes_of
from selector.controllers.model_file import ModelFile
from selector.errors import StudyError
from selector.study.inputs import path_at
from selector.study.study_file import LARGEST_FILE_BYTES, FolderName, Name, Table, checked, study_sections
from selector.text_file import text_of
from selector.units import CANONICAL_UNITS, unit_for_role

SCHEMA = "selector.io/1"
PAGE = "docs/reference/io.md"
UM_IN = {"um": 1.0, "mm": 1e-3, "m": 1e-6}
_NODE_ID = re.compile(r"(\w+=[^;]+;)*(i=\d+|[sgb]=.+)")

Seconds = Annotated[float, Field(ge=1e-3, le=3600, allow_inf_nan=False, strict=False)]


def _known_role(role: str) -> str:
    if role not in CANONICAL_UNITS:
        raise ValueError("one of " + ", ".join(CANONICAL_UNITS))
    return role


class Connection(Table):
    """``[connections.NAME]``: a server, or a file; where a password is needed, its place and never itself."""

    kind: Literal["file", "opcua", "mqtt", "mtconnect", "hal"]
    url: Name
    timeout_s: Seconds = 0.4
    user: Name | None = None
    password_env: Name | None = None
    password_file: Name | None = None
    security: Name | None = None

    def password(self) -> str | None:
        """From the environment, or from a file that nobody else may read. Raises StudyError: there is none."""
        where = f"connection {self.url}"
        if self.password_env is not None:
            if (said := os.environ.get(self.password_env)) is None:
                raise _unusable(f"no variable {self.password_env}", where, "set it before the start")
            return said
        if self.password_file is None:
            return None
        path = Path(self.password_file)
        text = text_of(path, 10_000, lambda found: _unusable(found, str(path), "correct password_file"))
        if os.name == "posix" and stat.S_IMODE(path.stat().st_mode) & 0o077:
            raise _unusable("a password that others may read", str(path), f"chmod 600 {path}")
        return text.strip()


class Place(Table):
    """Where something stands: a connection, and its address there."""

    at: Name
    address: Name


TIMES = ("time", "source_time", "received")  #: Columns of the lake, which are no names for channels.


class LiveChannel(Place):
    """``[channels.NAME]``: what is read; `oldest_s`: a value older than that by the server's own clock is none."""

    role: Annotated[str, AfterValidator(_known_role)] = "temperature"
    unit: Name | None = None
    place: Name | None = None
    axis: Name | None = None
    oldest_s: Seconds | None = None


class LiveOutput(Place):
    """``[outputs.NAME]``: where a correction goes, in which unit, and where the control shows what arrived.

    `touch` is the channel with what a probe shows of an adapted output; at `touch_code` stands what became of it.
    """

    unit: Literal["um", "mm", "m"] = "um"
    read_back: Name | None = None
    touch: Name | None = None
    touch_code: Name | None = None


class Control(Table):
    """``[control]``: channels by which the control says that it is ready, wants the correction, lives, has probed."""

    ready: Name | None = None
    wanted: Name | None = None
    alive: Name | None = None
    touch_valid: Name | None = None
    heartbeat: Place | None = None


class IoFile(Table):
    """An IO file as it is written."""

    schema_: Annotated[Literal["selector.io/1"], Field(alias="schema")] = "selector.io/1"
    machine: FolderName = "machine"
    period_s: Seconds = 1.0
    stale_after_s: Annotated[float, Field(gt=0, le=10, allow_inf_nan=False, strict=False)] = 5.0
    mistrust_s: Annotated[float, Field(gt=0, le=1e6, allow_inf_nan=False, strict=False)] = 60.0
    connections: Annotated[Mapping[Name, Connection], Field(min_length=1, max_length=100)]
    channels: Annotated[Mapping[Name, LiveChannel], Field(min_length=1, max_length=10_000)]
    outputs: Annotated[Mapping[Name, LiveOutput], Field(max_length=32)] = Field(default_factory=dict)
    positions: Mapping[Name, Name] = Field(default_factory=dict)
    control: Control = Control()

    def reads(self, connection: str) -> tuple[str, ...]:
        """Addresses of the channels that are read from a connection."""
        return tuple(dict.fromkeys(one.address for one in self.channels.values() if one.at == connection))

    def writes(self, connection: str) -> tuple[str, ...]:
        """Addresses that are written there: outputs and `counts`."""
        return tuple(place.address for place in self._written() if place.at == connection)

    def counts(self, connection: str) -> tuple[str, ...]:
        """Those of them that are whole numbers: heartbeat and codes of touch-offs."""
        return tuple(one.address for one in self._written() if one.at == connection and not isinstance(one, LiveOutput))

    def oldest_s(self, place: Place) -> float:
        """A value older than that is none [s]. A broker hands on what is said, and nothing when nobody says it."""
        said = place.oldest_s if isinstance(place, LiveChannel) else None
        return said or (self.stale_after_s if self.connections[place.at].kind == "mqtt" else math.inf)

    def _written(self) -> Iterator[Place]:
        yield from self.outputs.values()
        yield from (Place(at=of.at, address=of.touch_code) for of in self.outputs.values() if of.touch_code is not None)
        if self.control.heartbeat is not None:
            yield self.control.heartbeat


def read_io(path: str | Path, model: ModelFile | None = None) -> IoFile:
    """The IO file at `path`; with a model, one that has every input, output and position of it.

    Raises StudyError: it cannot be read, contradicts itself or does not fit the model.
    """
    where = str(path)
    text = text_of(Path(path), LARGEST_FILE_BYTES, lambda found: _unusable(found, where, "check the path"))
    said = checked(IoFile, study_sections(text, "[connections] and [channels]", where), where, PAGE)
    _fits_itself(said, where)
    if model is not None:
        _fits(said, model, where)
    folder = Path(path).parent
    connections = {name: _beside(one, folder) for name, one in said.connections.items()}
    for connection in connections.values():
        # told now, and not at three in the morning
        connection.password()
    return said.model_copy(update={"connections": connections})


def _beside(connection: Connection, folder: Path) -> Connection:
    """Its paths, which are relative to the IO file."""
    paths = {"password_file": connection.password_file, "url": connection.url if connection.kind == "file" else None}
    found = {name: str(path_at(path, folder)) for name, path in paths.items() if path is not None}
    return connection.model_copy(update=found)


def _fits_itself(said: IoFile, where: str) -> None:
    for name, connection in said.connections.items():
        if "@" in connection.url.partition("://")[2].partition("/")[0]:
            advice = "say user, and password_env or password_file; take the password out of this file"
            raise _unusable("an address with credentials", f"{where}, key connections.{name}.url", advice)
    for name, channel in said.channels.items():
        if name in TIMES:
            raise _unusable(f"a channel called {name!r}", where, "call it otherwise: the lake has a clock of this name")
        _placed(channel, said, f"{where}, key channels.{name}")
        if channel.unit is not None:
            unit_for_role(channel.unit, channel.role, where=f"{where}, key channels.{name}.unit")
    taken: set[tuple[str, str]] = set()
    for place in said._written():
        _placed(place, said, f"{where}, key outputs")
        if said.connections[place.at].kind == "mtconnect":
            raise _unusable("an output at an MTConnect agent", where, "write it elsewhere: MTConnect is read only")
        if (place.at, place.address) in taken:
            raise _unusable(f"two outputs at {place.address!r}", where, "give each an address of its own")
        taken.add((place.at, place.address))
    control = said.control
    watching = {f"control.{key}": getattr(control, key) for key in ("ready", "wanted", "alive", "touch_valid")}
    watching |= {f"positions.{axis}": name for axis, name in said.positions.items()}
    watching |= {f"outputs.{name}.touch": output.touch for name, output in said.outputs.items()}
    for key, watched in watching.items():
        if watched is not None:
            _known(watched, said.channels, f"{where}, key {key}", "channel")


def _placed(place: Place, said: IoFile, where: str) -> None:
    _known(place.at, said.connections, f"{where}.at", "connection")
    if said.connections[place.at].kind == "opcua" and not _NODE_ID.fullmatch(place.address):
        raise _unusable(f"{place.address!r}, which is no NodeId", where, "write it as in ns=2;s=Spindle.T1")


def _fits(said: IoFile, model: ModelFile, where: str) -> None:
    if said.period_s > said.stale_after_s:
        found = f"period_s = {said.period_s:g} with stale_after_s = {said.stale_after_s:g}"
        advice = "write at least as often as a confirmation holds, at most every 10 s; collect may be slower"
        raise _unusable(found, where, advice)
    read: dict[tuple[str, str], str] = {}
    for item in model.inputs:
        _known(item.name, said.channels, f"{where}, key channels", "channel of this name, which the model reads,")
        place = said.channels[item.name]
        if place.role != item.role:
            raise _unusable(f"role {place.role!r} of {item.name!r}", where, f"say role = {item.role!r}")
        if (first := read.setdefault((place.at, place.address), item.name)) != item.name:
            raise _unusable(f"{place.address!r} for both {first} and {item.name}", where, "give each its own address")
    for output in model.outputs:
        _known(output.name, said.outputs, f"{where}, key outputs", "output of this name, which the model has,")
    for name in said.outputs:
        _known(name, {output.name: None for output in model.outputs}, f"{where}, key outputs", "output of the model")
    adapted = () if model.adaptation is None else tuple(of.output for of in model.adaptation.outputs)
    touched = {name: one for name, one in said.outputs.items() if one.touch is not None or one.touch_code is not None}
    for name, one in touched.items():
        _known(name, dict.fromkeys(adapted), f"{where}, key outputs.{name}.touch", "output that touch-offs adapt")
        if one.touch is None or said.channels[one.touch].role != "displacement":
            found = f"{one.touch!r} as the touch-off of {name}"
            raise _unusable(found, f"{where}, key outputs.{name}.touch", 'name a channel of role = "displacement"')
    if bool(touched) != (said.control.touch_valid is not None):
        found = "touch-offs without touch_valid" if touched else "touch_valid without a touch-off"
        raise _unusable(found, f"{where}, key control.touch_valid", "say both, or none of them")
    for axis in axes_of(model):
        _known(axis, said.positions, f"{where}, key positions", "axis, whose position the model needs,")


def _known(name: str, names: Mapping[str, Any], where: str, what: str) -> None:
    if name not in names:
        among = ", ".join(list(names)[:20]) or "none"
        raise _unusable(f"{name!r}, but no {what} among {among}", where, "add it, or correct it")


def _unusable(found: str, where: str, advice: str) -> StudyError:
    return StudyError(
        found, expected=f"an IO file ({SCHEMA}) and what it names", where=where, advice=f"{advice}; {PAGE} explains it"
    )
