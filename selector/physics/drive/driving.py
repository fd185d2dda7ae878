"""What would the model have done in these recorded runs: in closed loop after the recorded command, or opened.

In *closed loop* the model follows the recorded command with its own control. *Opened*, the control is left out and the
recorded output of the real one acts on the axis: small errors of the force then add up over time. What was added to the
output of the control, as experiments do, acts in both.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from selector.errors import OptionError
from selector.findings import Finding
from selector.physics.checks import require_within, told_of
from selector.physics.drive.axis import Axis
from selector.physics.drive.drive_channels import axis_channels
from selector.physics.drive.drive_model import AxisRun, DriveModel, DriveSimulation, Progress
from selector.physics.drive.mechanics import RigidMechanics
from selector.physics.drive.model_limits import MOST_ACTING, MOST_POSITION_M
from selector.physics.drive.model_schema import MOST_SAMPLES
from selector.physics.drive.recorded_channels import (
    RecordedChannels,
    channel_findings,
    lacking_findings,
    recorded_channels,
)
from selector.physics.drive.reference import Reference
from selector.physics.drive.state import AxisState, unloaded_state
from selector.physics.drive.trajectory import clock_findings, recorded
from selector.recording import Channel, Recording

Vector = NDArray[np.float64]
_AT_REST = 0.01
"""Share of the largest speed below which a recording begins at rest: what rounding and smoothing make of standing."""

_FINEST_SHARE = 20
"""Samples of a control in one of the recording, or the other way round, that clocks of the two may differ by."""

_SAME_CLOCK = 1e-6
"""Relative difference of two clocks that count as one: that of crystals, and of times written with few digits."""


@dataclass(frozen=True)
class DrivenSimulation:
    """A simulation of recorded runs.

    Attributes
    ----------
    simulation : DriveSimulation
        Samples at the time stamps of the recording; its channels are called as the recorded ones that they belong to.
    matched : mapping of str to mapping of str to str
        Axis → kind, of `drive_channels.KINDS` → name of the recorded channel; for the axes that were simulated.
    findings : tuple of Finding
        What is to be said about the clock, and what could not be compared.
    opened : bool
        Whether the recorded output of the control acted, so that it is no result.
    """

    simulation: DriveSimulation
    matched: Mapping[str, Mapping[str, str]]
    findings: tuple[Finding, ...]
    opened: bool = False


def driven_runs(
    model: DriveModel,
    recording: Recording,
    *,
    opened: bool = False,
    seed: int | None = None,
    progress: Progress | None = None,
) -> DrivenSimulation:
    """A simulation of every run of a recording: each axis of the model whose command was recorded follows it.

    An axis begins where, and as fast as, its position was recorded; else at rest at its first command.

    Parameters
    ----------
    model : DriveModel
        What is driven. Of its motion nothing counts.
    recording : Recording
        Runs with the commanded position of at least one axis; how channels are found: `recorded_channels`.
    opened : bool
        Let the recorded output of the control act instead of the model's own control.
    seed : int, optional
        Of the noise; default: that of the file.
    progress : callable, optional
        Told how many runs of how many are done.

    Raises
    ------
    InputError
        The recording cannot drive this model: no command, missing values, gaps, an axis that runs away.
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
        if progress is not None:
            progress(number, len(recording.runs), run)
        times[run] = recording.time_s(run)
        findings += [replace(one, where=replace(one.where, run=run)) for one in clock_findings(times[run])]
        with told_of(f"run {run}", of_keys=True):
            runs[run] = {
                name: _axis_run(model, name, recording, run, channels[name], opened=opened, seed=noise)
                for name in driven
            }
    gathered = model.gathered(runs, times, noise)
    apart = {name for done in runs.values() for name, one in done.items() if one.added is not None}
    names = {name: channels[name].found if name in apart else _together(channels[name].found) for name in driven}
    simulation = replace(gathered, recording=_as_recorded(gathered.recording, model, recording, names))
    findings += [*lacking_findings(channels, driven, needed), *channel_findings(channels, recording)]
    return DrivenSimulation(simulation, names, tuple(findings), opened)


def _together(found: Mapping[str, str]) -> dict[str, str]:
    """Where nothing was added apart, both together are the output."""
    kept = {kind: name for kind, name in found.items() if kind != "added"}
    if "total" in kept:
        kept["output"] = kept.pop("total")
    return kept


def _axis_run(
    model: DriveModel,
    name: str,
    recording: Recording,
    run: str,
    channels: RecordedChannels,
    *,
    opened: bool,
    seed: int,
) -> AxisRun:
    found, time_s = channels.found, recording.time_s(run)
    with told_of(f"channel {found['command']}"):
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
        with told_of(f"channel {found['position']}"):
            start = _recorded_start(axis, time_s, _values(recording, run, found["position"]))
    if added is not None and commands is not None and not _takes_force(axis):
        commands, added = np.add(commands, added), None
    if added is None:
        return model.axis_run(name, reference, commands=commands, start=start, seed=seed)
    if not _takes_force(axis):
        raise _cannot_be_added(name, found["added"])
    return _with_added(model, name, reference, added, commands, start, seed)


def _takes_force(axis: Axis) -> bool:
    """Whether a force on the table is the same as more output of the control."""
    return isinstance(axis.mechanics, RigidMechanics) and not any(ripple.share for ripple in axis.ripple)


def _with_added(
    model: DriveModel,
    name: str,
    reference: Reference,
    added: Vector,
    commands: Vector | None,
    start: AxisState | None,
    seed: int,
) -> AxisRun:
    """A run in which this acts besides the control, behind its limit and its delay [actuator unit]."""
    servo = model.file_axes[name].axis.servo
    pushed_n = (1.0 if servo is None else servo.actuator_gain) * added
    load_n = pushed_n if reference.force_n is None else reference.force_n + pushed_n
    done = model.axis_run(name, replace(reference, force_n=load_n), commands=commands, start=start, seed=seed)
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
    with told_of(f"channel {channel}"):
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


def _as_recorded(
    simulated: Recording, model: DriveModel, recording: Recording, matched: Mapping[str, Mapping[str, str]]
) -> Recording:
    """The simulation with the names, places and axes of the recorded channels; others keep theirs."""
    recorded_by_name = {channel.name: channel for channel in recording.channels}
    other: dict[str, Channel] = {}
    for name, channels in matched.items():
        for kind, own in axis_channels(name, model.file_axes[name], loaded=True, added=True).items():
            if kind in channels and kind != "added" and own.name in simulated.names:
                there = recorded_by_name[channels[kind]]
                other[own.name] = Channel(there.name, own.role, own.unit, there.place or own.place, name, there.xyz_m)
    taken = {channel.name for channel in other.values()}
    channels_out = []
    for channel in simulated.channels:
        new = other.get(channel.name, channel)
        called = new.name
        while channel.name not in other and called in recorded_by_name.keys() | taken:
            called += " (simulated)"  # a name that the recording uses for something else
        taken.add(called)
        channels_out.append(replace(new, name=called))
    names = dict(zip(simulated.names, (channel.name for channel in channels_out), strict=True))
    return Recording(simulated.frame.rename(columns=names), tuple(channels_out), simulated.provenance)


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


def _cannot_be_added(name: str, channel: str) -> OptionError:
    return OptionError(
        f"{channel!r}, added to the output of the control of {name}: it has a screw, or ripple by the current",
        expected="one mass without ripple by the current, on which more output is the same as a force",
        where=f"key axes.{name}.recorded.added",
        advice="simulate it with --open-loop, where output and addition act together, or describe the axis as one mass",
    )
