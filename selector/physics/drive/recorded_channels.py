"""Which channels of a recording belong to which axis of a feed drive, and which are left that look as if they act."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from selector.errors import OptionError
from selector.findings import Finding, Where
from selector.physics.drive.drive_channels import INPUTS, KINDS, axis_channels
from selector.physics.drive.drive_model import DriveModel
from selector.physics.drive.model_axes import FileAxis
from selector.recording import Channel, Recording

_ACTING = ("force", "voltage", "current")
"""Roles of what may move an axis."""


@dataclass(frozen=True)
class RecordedChannels:
    """What a recording has of one axis.

    Attributes
    ----------
    found : mapping of str to str
        Kind, of `drive_channels.KINDS`, → channel.
    undecided : mapping of str to tuple of str
        Kind → channels that could each be it, so that none is.
    factor : float
        What one of the channel `added` adds to the output of the control [actuator unit].
    lacking : str or None
        Channel that the file names as `added` and the recording has not.
    """

    found: Mapping[str, str]
    undecided: Mapping[str, tuple[str, ...]]
    factor: float = 1.0
    lacking: str | None = None

    def has(self, kind: str) -> bool:
        """Whether this kind was recorded; output and what is added are as good together as apart."""
        return kind in self.found or (kind == "output" and "total" in self.found)


def recorded_channels(name: str, axis: FileAxis, model: DriveModel, recording: Recording) -> RecordedChannels:
    """The channels of this axis.

    The one that ``[axes.NAME.recorded]`` names; else the one that is called as in a simulation; else the only one of
    its role that belongs to this axis, or to no axis where the model has one only. Where something is added to the
    output of the control, a channel of its role is both together (``total``) unless the file names it ``output``.

    Raises
    ------
    OptionError
        The recording has no channel of a name that the file gives, but for what is added, which not every run needs; or
        the file gives one name twice.
    """
    by_name = {channel.name: channel for channel in recording.channels}
    said = axis.section.recorded
    named = {kind: getattr(said, kind, None) for kind in KINDS}
    named["added"] = None if said.added is None else said.added.channel
    lacking = named["added"] if named["added"] not in by_name else None
    if lacking is not None:
        named["added"] = None
    found = _named(name, named, by_name)
    own = axis_channels(name, axis, loaded=True, added=True)
    for kind, channel in own.items():
        same = by_name.get(channel.name)
        if kind not in found and same is not None and same.role == channel.role and same.name not in found.values():
            found[kind] = same.name
    if "added" not in found and "output" not in found and "total" in found:
        found["output"] = found.pop("total")
    undecided: dict[str, tuple[str, ...]] = {}
    for kind in ("command", "position", "total" if "added" in found else "output"):
        role = own[kind].role
        if kind in found or role == "state" or (kind == "total" and "output" in found):
            continue
        alike = [c for c in recording.channels if c.role == role and c.name not in found.values()]
        here = [c.name for c in alike if c.axis == name] or [
            c.name for c in alike if c.axis is None and len(model.file_axes) == 1
        ]
        if len(here) == 1:
            found[kind] = here[0]
        elif here:
            undecided[kind] = tuple(here)
    is_named = said.added is not None and found.get("added") == said.added.channel
    return RecordedChannels(found, undecided, said.added.factor if said.added and is_named else 1.0, lacking)


def channel_findings(channels: Mapping[str, RecordedChannels], recording: Recording) -> Iterator[Finding]:
    """Channels that could each be one thing, that lack, and that look as if they act and were left."""
    told: set[str] = set()
    for name, one in channels.items():
        told |= set(one.found.values())
        for kind, which in one.undecided.items():
            told |= set(which)
            yield Finding(
                "channel-undecided",
                "warning",
                f"{', '.join(which)}: each of them could be {_WHAT[kind]} of {name}, so none of them was taken.",
                Where(channel=name),
                {"axis": name, "kind": kind, "channels": list(which)},
                f'say which it is, {kind} = "…" under [axes.{name}.recorded]'
                + ("; what is added to it, added" if kind == "output" else ""),
            )
        if one.lacking is not None:
            yield Finding(
                "nothing-added",
                "info",
                f"The recording has no channel {one.lacking}, which the model file names as added to the output of the "
                f"control of {name}: nothing was added.",
                Where(channel=name),
                {"axis": name, "channel": one.lacking},
                "nothing, if this recording was made without it; else let the machine file name it",
            )
    idle = [c for c in recording.channels if c.role in _ACTING and c.name not in told and _acts(recording, c)]
    if idle:
        names = ", ".join(f"{c.name} ({c.role})" for c in idle)
        first = next(iter(channels))
        yield Finding(
            "channel-not-used",
            "warning",
            f"Nothing was done with {names}: if it acts on an axis, the simulation is without it.",
            Where(channel=idle[0].name),
            {"channels": [c.name for c in idle]},
            f"name it under [axes.{first}.recorded]: load for a force on the table, added for what is added to the "
            "output of the control",
        )


def lacking_findings(
    channels: Mapping[str, RecordedChannels], driven: list[str], needed: tuple[str, ...]
) -> Iterator[Finding]:
    """Axes that nothing drives, and those of which nothing can be compared."""
    for name, one in channels.items():
        lacks = [kind for kind in needed if not one.has(kind)]
        if name not in driven:
            what = " and no ".join(lacks)
            said, evidence = f"Axis {name} was not simulated: the recording has no {what} of it.", {"lacking": lacks}
        elif not any(kind not in INPUTS for kind in one.found):
            said = f"Nothing that the simulation says of axis {name} was recorded, so nothing can be compared."
            evidence = {}
        else:
            continue
        yield Finding(
            "axis-not-driven" if name not in driven else "output-not-recorded",
            "warning",
            said,
            Where(channel=name),
            {"axis": name, **evidence},
            f"name its channels under [axes.{name}.recorded]",
        )


def _named(name: str, named: Mapping[str, str | None], by_name: Mapping[str, Channel]) -> dict[str, str]:
    found: dict[str, str] = {}
    for kind, said in named.items():
        if said is None:
            continue
        if said not in by_name:
            raise OptionError(
                f"no channel {said!r} in the recording",
                expected="one of " + ", ".join(list(by_name)[:20]),
                where=f"key axes.{name}.recorded.{kind}",
                advice="correct the name, or leave it out",
            )
        if said in found.values():
            raise OptionError(
                f"{said!r} twice",
                expected="a channel for one thing",
                where=f"key axes.{name}.recorded.{kind}",
                advice="leave one of the two out",
            )
        found[kind] = said
    return found


def _acts(recording: Recording, channel: Channel) -> bool:
    values = recording.frame[channel.name].to_numpy()
    return bool(np.any(np.nan_to_num(values) != 0.0))


_WHAT = {
    "command": "the commanded position",
    "position": "the position that the control sees",
    "output": "the output of the control",
    "total": "the output of the control with what is added",
}
