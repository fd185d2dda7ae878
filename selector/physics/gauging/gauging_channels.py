"""Which channels has the recording of a gauged part, and which of a recording from elsewhere are the same."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from selector.errors import OptionError
from selector.findings import Finding, Where
from selector.physics.gauging.file.model_file import GaugingFile
from selector.physics.gauging.finding_table import FINDINGS
from selector.recording import Channel, Recording
from selector.units import CANONICAL_UNITS

UM_PER_S = 1000.0 / 60.0
"""1 mm/min, the unit of a feed in a recording, in µm/s."""


def _channel(name: str, role: str, place: str) -> Channel:
    return Channel(name, role, CANONICAL_UNITS[role], place)


ALLOWANCE = _channel("allowance", "size", "workpiece (true)")
GAUGE = _channel("gauge", "voltage", "filter")
MEASURED = _channel("measured", "size", "gauge")
FEED = _channel("feed", "feed_rate", "wheel")
STAGE = _channel("stage", "state", "relay")
PART_CHANNELS = (ALLOWANCE, GAUGE, MEASURED, FEED, STAGE)
"""Of a part: true allowance, smoothed voltage, size as the gauge shows it, infeed of the wheel, number of the stage,
the first being 1, and 0 when the feed has stopped."""

CURRENT = _channel("current", "current", "electromagnet")
PROBE = _channel("probe", "displacement", "probe")
CONTACT = _channel("contact", "force", "contact")
GENERATOR = _channel("generator", "voltage", "generator")
WAVEFORM_CHANNELS = (CURRENT, PROBE, CONTACT, GENERATOR)
"""What else is known of the whole chain near the stop."""

KINDS: Mapping[str, Channel] = {"allowance": ALLOWANCE, "feed": FEED, "gauge": GAUGE, "measured": MEASURED}
"""What a recording from elsewhere may have, under any name."""


def recorded_channels(file: GaugingFile, recording: Recording) -> dict[str, str]:
    """Kind, of `KINDS`, → channel: the one that ``[recorded]`` names, else the one of this name, else the only one left
    of its role; of several of a role none is. What is named may have any role of the same unit, which may be guessed.

    Raises OptionError: the recording has no channel of a name that the file gives, or the file gives one name twice, or
    the channel is held in another unit.
    """
    by_name = {channel.name: channel for channel in recording.channels}
    found: dict[str, str] = {}
    for kind, own in KINDS.items():
        said = getattr(file.recorded, kind)
        if said is not None:
            _require_channel(kind, said, own, by_name, found)
            found[kind] = said
    for kind, own in KINDS.items():
        same = by_name.get(own.name)
        if kind not in found and same is not None and same.unit == own.unit and own.name not in found.values():
            found[kind] = own.name
    for kind, own in KINDS.items():
        alike = [c.name for c in recording.channels if c.role == own.role and c.name not in found.values()]
        if kind not in found and len(alike) == 1:
            found[kind] = alike[0]
    return found


def roles_asked(file: GaugingFile, recording: Recording, unread: Sequence[str]) -> dict[str, str]:
    """Column → role that it has to be read with, where a guess says otherwise; of `unread` ones nothing else says it.

    Columns that ``[recorded]`` names, and unread ones that are called as in a simulation.
    """
    units = {channel.name: channel.unit for channel in recording.channels}
    said = {
        getattr(file.recorded, kind): own for kind, own in KINDS.items() if getattr(file.recorded, kind) is not None
    }
    asked = {own.name: own.role for own in KINDS.values() if own.name in unread and own.name not in said}
    wrong = [name for name, own in said.items() if name in unread or units.get(name, own.unit) != own.unit]
    if asked or wrong:
        # all of them: what was guessed of one column may hang on another
        asked |= {name: own.role for name, own in said.items() if name in unread or name in units}
    return asked


def undecided_findings(recording: Recording, found: Mapping[str, str]) -> Iterator[Finding]:
    """Channels of which each could be one thing, so that none of them was taken."""
    told: set[str] = set()
    for kind, own in KINDS.items():
        alike = [c.name for c in recording.channels if c.role == own.role and c.name not in found.values()]
        if kind not in found and len(alike) > 1 and own.role not in told:
            told.add(own.role)
            yield FINDINGS.finding(
                "channel-undecided",
                f"{', '.join(alike)}: each of them could be the {kind}, so none of them was taken.",
                Where(channel=alike[0]),
                {"kind": kind, "channels": alike},
                f'say which it is: {kind} = "…" under [recorded]',
            )


def _require_channel(
    kind: str, said: str, own: Channel, by_name: Mapping[str, Channel], found: Mapping[str, str]
) -> None:
    where = f"key recorded.{kind}"
    if said not in by_name:
        raise OptionError(
            f"no channel {said!r} in the recording",
            expected="one of " + ", ".join(list(by_name)[:20]),
            where=where,
            advice="correct the name, or leave it out",
        )
    if said in found.values():
        raise OptionError(
            f"{said!r} twice", expected="a channel for one thing", where=where, advice="leave one of the two out"
        )
    if by_name[said].unit != own.unit:
        raise OptionError(
            f"{said!r} with the role {by_name[said].role}, in {by_name[said].unit}",
            expected=f"a channel in {own.unit}, as of the role {own.role}",
            where=where,
            advice=f'name another channel, or say what it is in the machine file: [channels."{said}"] with '
            f'role = "{own.role}" and its unit, and give it with --machine',
        )
