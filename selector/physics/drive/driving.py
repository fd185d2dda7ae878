"""What would the model have done in recorded runs: which channels are its axes', in closed loop or opened."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial

import numpy as np

from selector.errors import OptionError
from selector.findings import Finding, Where
from selector.physics.channel_differences import ChannelDifference, as_recorded, require_named
from selector.physics.checks import errors_name, require_within
from selector.physics.drive.drive_model import INPUTS, KINDS, DriveModel, DriveSimulation, axis_channels
from selector.physics.drive.finding_table import FINDINGS
from selector.physics.drive.model_schema import MOST_ACTING, MOST_POSITION_M, FileAxis
from selector.physics.drive.parts.axis import Axis, AxisState, RigidMechanics, unloaded_state
from selector.physics.drive.simulation import AxisRun
from selector.physics.drive.trajectory import Reference, clock_findings, recorded
from selector.physics.model_text import MOST_SAMPLES
from selector.physics.simulation_kind import Progress, unheard
from selector.recording import Channel, Recording
from selector.types import Vector

_MICRO = 1e6
_ACTING = ("force", "voltage", "current")  #: Roles of what may move an axis.


@dataclass(frozen=True)
class RecordedChannels:
    """What a recording has of one axis."""

    found: Mapping[str, str]  #: Kind, of `drive_channels.KINDS`, → channel
    undecided: Mapping[str, tuple[str, ...]]  #: Kind → channels that could each be it, so that none is
    factor: float = 1.0  #: What one of the channel `added` adds to the output of the control [actuator unit]
    lacking: str | None = None  #: Channel that the file names as `added` and the recording has not

    def has(self, kind: str) -> bool:
        """Whether this kind was recorded; output and what is added are as good together as apart."""
        return kind in self.found or (kind == "output" and "total" in self.found)


def recorded_channels(name: str, axis: FileAxis, model: DriveModel, recording: Recording) -> RecordedChannels:
    """The channels of this axis.

    The one that ``[axes.NAME.recorded]`` names; else the one that is called as in a simulation; else the only one of
    its role that belongs to this axis, or to no axis where the model has one only. Where something is added to the
    output of the control, a channel of its role is both together (``total``) unless the file names it ``output``.

    Raises OptionError: the recording has no channel of a name that the file gives, but for what is added, which not
    every run needs; or the file gives one name twice.
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
            yield FINDINGS.finding(
                "channel-undecided",
                f"{', '.join(which)}: each of them could be {_WHAT[kind]} of {name}, so none of them was taken.",
                Where(channel=name),
                {"axis": name, "kind": kind, "channels": list(which)},
                f'say which it is, {kind} = "…" under [axes.{name}.recorded]'
                + ("; what is added to it, added" if kind == "output" else ""),
            )
        if one.lacking is not None:
            yield FINDINGS.finding(
                "nothing-added",
                f"The recording has no channel {one.lacking}, which the model file names as added to the output of the "
                f"control of {name}: nothing was added.",
                Where(channel=name),
                {"axis": name, "channel": one.lacking},
            )
    acts = recording.frame.fillna(0.0).ne(0.0).any()
    idle = [c for c in recording.channels if c.role in _ACTING and c.name not in told and acts[c.name]]
    if idle:
        names = ", ".join(f"{c.name} ({c.role})" for c in idle)
        first = next(iter(channels))
        yield FINDINGS.finding(
            "channel-not-used",
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
        yield FINDINGS.finding(
            "axis-not-driven" if name not in driven else "output-not-recorded",
            said,
            Where(channel=name),
            {"axis": name, **evidence},
            f"name its channels under [axes.{name}.recorded]",
            level="warning",
        )


def _named(name: str, named: Mapping[str, str | None], by_name: Mapping[str, Channel]) -> dict[str, str]:
    found: dict[str, str] = {}
    for kind, said in named.items():
        if said is None:
            continue
        require_named(said, by_name, found.values(), f"key axes.{name}.recorded.{kind}")
        found[kind] = said
    return found


_WHAT = {
    "command": "the commanded position",
    "position": "the position that the control sees",
    "output": "the output of the control",
    "total": "the output of the control with what is added",
}

#: Share of the largest speed below which a recording begins at rest: what rounding and smoothing make of standing.
_AT_REST = 0.01
#: Samples of a control in one of the recording, or the other way round, that clocks of the two may differ by.
_FINEST_SHARE = 20
#: Relative difference of two clocks that count as one: that of crystals, and of times written with few digits.
_SAME_CLOCK = 1e-6


def driven_runs(
    model: DriveModel,
    recording: Recording,
    *,
    opened: bool = False,
    seed: int | None = None,
    progress: Progress = unheard,
) -> DriveSimulation:
    """A simulation of every run of a recording: each axis of the model whose command was recorded follows it.

    Samples at the time stamps of the recording; its channels are called as the recorded ones that they belong to.
    An axis begins where, and as fast as, its position was recorded; else at rest at its first command.

    Of the motion of the model's file nothing counts; how channels are found: `recorded_channels`. With `opened` the
    recorded output of the control acts instead of the model's own control. Without a `seed` of the noise, that of the
    file counts; `progress` is told how many runs of how many are done.

    InputError: the recording cannot drive this model: no command, missing values, gaps, an axis that runs away.
    """
    noise = model.file.run.seed if seed is None else seed
    channels = {name: recorded_channels(name, axis, model, recording) for name, axis in model.file_axes.items()}
    needed = ("command", "output") if opened else ("command",)
    driven = [name for name, one in channels.items() if all(one.has(kind) for kind in needed)]
    if not driven:
        raise _nothing_drives(model, recording, channels, needed)
    runs: dict[str, dict[str, AxisRun]] = {}
    times: dict[str, Vector] = {}
    findings: list[Finding] = []
    for number, run in enumerate(recording.runs):
        progress(number, len(recording.runs), run)
        times[run] = recording.time_s(run)
        findings += [replace(one, where=replace(one.where, run=run)) for one in clock_findings(times[run])]
        with errors_name(f"run {run}", of_keys=True):
            runs[run] = {
                name: _axis_run(model, name, recording, run, channels[name], opened=opened, seed=noise)
                for name in driven
            }
    gathered = model.gathered(runs, times, noise)
    apart = {name for done in runs.values() for name, one in done.items() if one.added is not None}
    names = {name: channels[name].found if name in apart else _together(channels[name].found) for name in driven}
    own = {name: axis_channels(name, model.file_axes[name], loaded=True, added=True) for name in driven}
    renamed = {own[name][kind].name: there for name in driven for kind, there in names[name].items() if kind != "added"}
    findings += [*lacking_findings(channels, driven, needed), *channel_findings(channels, recording)]
    made = as_recorded(gathered.recording, recording, renamed)
    return replace(gathered, recording=made, matched=names, findings=tuple(findings), opened=opened)


def _together(found: Mapping[str, str]) -> dict[str, str]:
    """Where nothing was added apart, both together are the output."""
    kept = {kind: name for kind, name in found.items() if kind != "added"}
    if "total" in kept:
        kept["output"] = kept.pop("total")
    return kept


def _axis_run(
    model: DriveModel, name: str, recording: Recording, run: str, channels: RecordedChannels, *, opened: bool, seed: int
) -> AxisRun:
    found, time_s = channels.found, recording.time_s(run)
    with errors_name(f"channel {found['command']}"):
        commanded = _values(recording, run, found["command"])
        reference = recorded(time_s - time_s[0], commanded, _period_s(model, name, time_s))
    if "load" in found:
        reference = replace(reference, force_n=_on_grid(recording, run, found["load"], reference))
    axis = model.file_axes[name].axis
    added: Vector | None = None
    if "added" in found and np.isfinite(_values(recording, run, found["added"])).any():
        added = channels.factor * _on_grid(recording, run, found["added"], reference)
    commands: Vector | None = None
    if opened:
        commands = _on_grid(recording, run, found["total" if "total" in found else "output"], reference)
        if added is not None and "total" in found:
            commands = commands - added
    start = None
    if "position" in found:
        with errors_name(f"channel {found['position']}"):
            start = _recorded_start(axis, time_s, _values(recording, run, found["position"]))
    if added is not None and commands is not None and not _takes_force(axis):
        commands, added = np.add(commands, added), None
    run_along = partial(model.axis_run, name, commands=commands, start=start, seed=seed)
    if added is None:
        return run_along(reference)
    if not _takes_force(axis):
        raise OptionError(
            f"{found['added']!r}, added to the output of the control of {name}: it has a screw, or ripple by the "
            "current",
            expected="one mass without ripple by the current, on which more output is the same as a force",
            where=f"key axes.{name}.recorded.added",
            advice="simulate it with --open-loop, where output and addition act together, or describe the axis as one "
            "mass",
        )
    return _with_added(run_along, axis, reference, added)


def _takes_force(axis: Axis) -> bool:
    """Whether a force on the table is the same as more output of the control."""
    return isinstance(axis.mechanics, RigidMechanics) and not any(ripple.share for ripple in axis.ripple)


def _with_added(run_along: Callable[[Reference], AxisRun], axis: Axis, reference: Reference, added: Vector) -> AxisRun:
    """A run in which this acts besides the control, behind its limit and its delay [actuator unit]."""
    pushed_n = (1.0 if axis.servo is None else axis.servo.actuator_gain) * added
    load_n = pushed_n if reference.force_n is None else reference.force_n + pushed_n
    done = run_along(replace(reference, force_n=load_n))
    motion = replace(
        done.motion,
        actuator_force=done.motion.actuator_force + pushed_n,
        axial_force_n=done.motion.axial_force_n + pushed_n,
    )
    return replace(done, reference=reference, motion=motion, added=added)


def _recorded_start(axis: Axis, time_s: Vector, position_m: Vector) -> AxisState | None:
    """All masses in step where the axis was, and as fast as it was; None where the recording does not say."""
    if not np.isfinite(position_m).all():
        return None
    seen = recorded(time_s - time_s[0], position_m)
    speed = float(seen.speed_m_per_s[0])
    at_rest = abs(speed) <= _AT_REST * np.abs(seen.speed_m_per_s).max()
    return unloaded_state(axis, float(position_m[0]), 0.0 if at_rest else speed)


def _period_s(model: DriveModel, name: str, time_s: Vector) -> float | None:
    """Period of the file; left out, that of the recording, rounded to one that fits the samples of the control."""
    said, servo = model.file.run.period_s, model.file_axes[name].axis.servo
    if len(time_s) < 2 or (said is not None and (time_s[-1] - time_s[0]) / said <= MOST_SAMPLES):
        return said
    if servo is None or servo.sample_s == 0:
        return None
    ratio = float(time_s[-1] - time_s[0]) / (len(time_s) - 1) / servo.sample_s
    share = float(Fraction(ratio).limit_denominator(_FINEST_SHARE))
    return share * servo.sample_s if share > 0 and abs(ratio / share - 1.0) < _SAME_CLOCK else None


def _values(recording: Recording, run: str, channel: str) -> Vector:
    values = np.asarray(recording.values(run, [channel])[:, 0], dtype=np.float64)
    of = next(one for one in recording.channels if one.name == channel)
    most = MOST_POSITION_M if of.role in ("position_command", "position") else MOST_ACTING
    require_within(values, recording.time_s(run), most, of.unit)
    return values


def _on_grid(recording: Recording, run: str, channel: str, reference: Reference) -> Vector:
    """A recorded course at the samples of a reference, each value held until the next."""
    with errors_name(f"channel {channel}"):
        time_s, values = recording.time_s(run), _values(recording, run, channel)
    if not np.isfinite(values).all():
        raise OptionError(
            f"missing values of {channel!r} in {run}",
            expected="a value at every sample: it acts on the axis",
            where=f"channel {channel}",
            advice="cut the recording to the stretch that is complete",
        )
    # clocks jitter, controls do not; and a time of the grid that falls on a sample up to rounding belongs to it
    period_s = (time_s[-1] - time_s[0]) / (len(time_s) - 1)
    at = np.floor(reference.time_s / period_s + min(_SAME_CLOCK * len(time_s), 0.25)).astype(np.int64)
    return np.asarray(values[np.minimum(at, len(values) - 1)], dtype=np.float64)


def _nothing_drives(
    model: DriveModel, recording: Recording, channels: Mapping[str, RecordedChannels], needed: tuple[str, ...]
) -> OptionError:
    name = next(iter(channels))
    lacks = next(kind for kind in needed if not channels[name].has(kind))
    what = "commanded position" if lacks == "command" else "output of the control"
    here = ", ".join(f"{c.name} ({c.role})" for c in recording.channels[:12])
    several = channels[name].undecided.get(lacks, ())
    if several:
        return OptionError(
            f"{', '.join(several)}: each of them could be the {what} of {name}",
            expected="one channel that is it",
            where=f"model {model.name!r}",
            advice=f'say which: {lacks} = "{several[0]}" under [axes.{name}.recorded]',
        )
    return OptionError(
        f"no channel with the {what} of {', '.join(channels)}: {here}",
        expected=f"a channel with the role position_command, or a name under [axes.{name}.recorded]"
        if lacks == "command"
        else f"one channel of its role, or a name as {lacks} under [axes.{name}.recorded]",
        where=f"model {model.name!r}",
        advice=f'give the channel its role in the machine file, or add {lacks} = "CHANNEL" to [axes.{name}.recorded]',
    )


def recorded_differences(
    model: DriveModel, driven: DriveSimulation, recording: Recording
) -> tuple[ChannelDifference, ...]:
    """Every channel that was both recorded and simulated, run by run; what acts on the axes is left out."""
    acting = (*INPUTS, "output", "total") if driven.opened else INPUTS
    found = []
    for run in recording.runs:
        time_s = recording.time_s(run)
        for axis, channels in driven.matched.items():
            for kind in (one for one in KINDS if one in channels and one not in acting):
                name = channels[kind]
                there = recording.values(run, [name])[:, 0]
                seen = np.isfinite(there)
                if not seen.any():
                    continue
                unit, times = recording.channel(name).unit, _MICRO if kind in ("position", "table") else 1.0
                if kind in ("position", "table", "error"):
                    unit = "urad" if model.file_axes[axis].rotary else "um"
                elif kind == "force" and model.file_axes[axis].rotary:
                    unit = "N·m"
                courses = there[seen] * times, driven.recording.values(run, [name])[seen, 0] * times
                found.append(ChannelDifference(run, name, unit, time_s[seen] - time_s[0], *courses, axis, kind))
    return tuple(found)
