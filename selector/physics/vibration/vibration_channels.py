"""Which channels of a recording belong to the shafts, the sources, and the tool and workpiece of a model."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass

from selector.findings import Finding, Where
from selector.physics.model_text import key_text
from selector.physics.vibration.finding_table import FINDINGS
from selector.physics.vibration.vibration_model import FINALS, RELATIVE, VibrationModel, force_name, speed_name
from selector.recording import Channel, Recording


@dataclass(frozen=True)
class RecordedChannels:
    """What was recorded of a model."""

    #: speeds, forces and motions: Shaft, source, and output of the model → name of the recorded channel
    speeds: Mapping[str, str]
    forces: Mapping[str, str]
    motions: Mapping[str, str]
    findings: tuple[Finding, ...]  #: Channels that belong to nothing, or could be of several


def recorded_channels(model: VibrationModel, recording: Recording) -> RecordedChannels:
    """The channels of a recording that belong to this model: by name, else by place or axis, else by being alone."""
    file = model.file
    speeds = _matched({name: (name, speed_name(name)) for name in file.shafts}, _of_role(recording, "spindle_speed"))
    forces = _matched({name: (name, force_name(name)) for name in file.sources}, _of_role(recording, "force"))
    finals = {name: (name, member) for name, member in model.finals.items()} | {RELATIVE: (RELATIVE,)}
    motions = _matched(finals, _of_role(recording, "displacement"))
    alone = {role: _of_role(recording, role) for role in ("spindle_speed", "force", "displacement")}
    leading = [name for name, shaft in file.shafts.items() if shaft.of is None]
    if file.cutting is not None and file.cutting.shaft in leading:
        leading = [file.cutting.shaft]
    if not speeds and len(alone["spindle_speed"]) == len(leading) == 1:
        speeds = {leading[0]: alone["spindle_speed"][0].name}
    if not forces and len(alone["force"]) == len(file.sources) == 1:
        forces = {next(iter(file.sources)): alone["force"][0].name}
    if not motions and len(alone["displacement"]) == 1:
        motions = {RELATIVE: alone["displacement"][0].name}
    unused = (
        *_unused(alone["spindle_speed"], speeds.values(), "shaft", file.shafts),
        *_unused(alone["force"], forces.values(), "source", file.sources),
        *_not_compared(alone["displacement"], motions),
    )
    return RecordedChannels(speeds, forces, motions, unused)


def _of_role(recording: Recording, role: str) -> list[Channel]:
    return [channel for channel in recording.channels if channel.role == role]


def _matched(wanted: Mapping[str, tuple[str, ...]], channels: Iterable[Channel]) -> dict[str, str]:
    """Key → channel that is called as one of its names, or else the only one whose place or axis is."""
    found: dict[str, str] = {}
    there = list(channels)
    for key, names in wanted.items():
        called = {name.casefold() for name in names}
        by_name = [one.name for one in there if one.name.casefold() in called]
        by_place = [one.name for one in there if called & {(one.place or "").casefold(), (one.axis or "").casefold()}]
        if by_name or len(by_place) == 1:
            found[key] = (by_name or by_place)[0]
    # a channel whose place fits two keys is that of neither, unless one of them has its name
    several = {name for name in found.values() if list(found.values()).count(name) > 1}
    return {
        key: name
        for key, name in found.items()
        if name not in several or name.casefold() in {one.casefold() for one in wanted[key]}
    }


def _not_compared(channels: Iterable[Channel], motions: Mapping[str, str]) -> Iterator[Finding]:
    """One finding of all displacements that are neither of the tool nor of the workpiece."""
    names = [one.name for one in channels if one.name not in motions.values()]
    free = [key for key in (*FINALS, RELATIVE) if key not in motions]
    if not names or not free:
        return
    listed = ", ".join(map(repr, names[:6])) + (" …" if len(names) > 6 else "")
    are = "(displacements) are" if len(names) > 1 else "(displacement) is"
    places = " or ".join(f'"{key}"' for key in free)
    yield FINDINGS.finding(
        "motion-not-compared",
        f"{listed} {are} not known to be of tool or workpiece, and not compared.",
        Where(channel=names[0]),
        {"channels": names, "places": free},
        f"say in the machine file what it moved, e.g. [channels.{key_text((names[0],))}] place = {places}",
        level="info" if motions else "warning",
    )


def _unused(
    channels: Iterable[Channel], used: Collection[str], what: str, known: Collection[str]
) -> tuple[Finding, ...]:
    return tuple(
        FINDINGS.finding(
            "channel-of-nothing",
            f"{one.name!r} ({one.role}) belongs to no {what} of the model, or could be of several, and does not act.",
            Where(channel=one.name),
            {"known": list(known)[:20]},
            f'give it the place of its {what} in the machine file: place = "{next(iter(known), "…")}"',
        )
        for one in channels
        if one.name not in used
    )
