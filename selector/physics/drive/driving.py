"""What would the model have done in these recorded runs: in closed loop after the recorded command, or opened.

In *closed loop* the model follows the recorded command with its own control. *Opened*, the control is left out and the
recorded output of the real one acts on the axis: small errors of the force then add up over time.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from selector.errors import OptionError
from selector.findings import Finding, Where
from selector.physics.drive.axis import Axis
from selector.physics.drive.drive_channels import KINDS, axis_channels
from selector.physics.drive.drive_model import AxisRun, DriveModel, DriveSimulation, Progress
from selector.physics.drive.model_axes import FileAxis
from selector.physics.drive.model_schema import MOST_SAMPLES
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
        Axis → kind, of `drive_channels.KINDS` → name of the recorded channel.
    findings : tuple of Finding
        What is to be said about the clock, and what could not be compared.
    """

    simulation: DriveSimulation
    matched: Mapping[str, Mapping[str, str]]
    findings: tuple[Finding, ...]


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
        Runs with the commanded position of at least one axis; how channels are found: `matched_channels`.
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
    matched = {name: matched_channels(name, axis, model, recording) for name, axis in model.file_axes.items()}
    needed = ("command", "output") if opened else ("command",)
    driven = [name for name, found in matched.items() if all(kind in found for kind in needed)]
    if not driven:
        raise _nothing_drives(model, recording, matched, needed)
    runs: dict[str, dict[str, AxisRun]] = {}
    times: dict[str, Vector] = {}
    findings: list[Finding] = []
    for number, run in enumerate(recording.runs):
        if progress is not None:
            progress(number, len(recording.runs), run)
        times[run] = recording.time_s(run)
        findings += [replace(one, where=replace(one.where, run=run)) for one in clock_findings(times[run])]
        runs[run] = {
            name: _axis_run(model, name, recording, run, matched[name], opened=opened, seed=noise) for name in driven
        }
    gathered = model.gathered(runs, times, noise)
    names = {name: matched[name] for name in driven}
    simulation = replace(gathered, recording=_as_recorded(gathered.recording, model, recording, names))
    return DrivenSimulation(simulation, names, (*findings, *_not_driven(matched, driven, needed)))


def matched_channels(name: str, axis: FileAxis, model: DriveModel, recording: Recording) -> dict[str, str]:
    """Kind, of `drive_channels.KINDS`, → recorded channel of this axis.

    The one that ``[axes.NAME.recorded]`` names; else the one that is called as in a simulation; else the only one of
    its role that belongs to this axis, or to no axis where the model has one only.

    Raises
    ------
    OptionError
        The recording has no channel of a name that the file gives, or the file gives one name twice.
    """
    own = axis_channels(name, axis, loaded=True)
    by_name = {channel.name: channel for channel in recording.channels}
    found: dict[str, str] = {}
    for kind in KINDS:
        said = getattr(axis.section.recorded, kind, None)
        if said is not None and said not in by_name:
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
        if said is not None:
            found[kind] = said
    for kind, channel in own.items():
        same = by_name.get(channel.name)
        if kind not in found and same is not None and same.role == channel.role and same.name not in found.values():
            found[kind] = same.name
    for kind in ("command", "position", "output"):
        if kind in found or own[kind].role == "state":
            continue
        alike = [c for c in recording.channels if c.role == own[kind].role and c.name not in found.values()]
        here = [c for c in alike if c.axis == name] or [
            c for c in alike if c.axis is None and len(model.file_axes) == 1
        ]
        if len(here) == 1:
            found[kind] = here[0].name
    return found


def _axis_run(
    model: DriveModel,
    name: str,
    recording: Recording,
    run: str,
    channels: Mapping[str, str],
    *,
    opened: bool,
    seed: int,
) -> AxisRun:
    time_s = recording.time_s(run)
    reference = recorded(
        time_s - time_s[0], _values(recording, run, channels["command"]), _period_s(model, name, time_s)
    )
    if "load" in channels:
        reference = replace(reference, force_n=_on_grid(recording, run, channels["load"], reference))
    commands = _on_grid(recording, run, channels["output"], reference) if opened else None
    start = None
    if "position" in channels:
        start = _recorded_start(model.file_axes[name].axis, time_s, _values(recording, run, channels["position"]))
    return model.axis_run(name, reference, commands=commands, start=start, seed=seed)


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
    return np.asarray(recording.values(run, [channel])[:, 0], dtype=np.float64)


def _on_grid(recording: Recording, run: str, channel: str, reference: Reference) -> Vector:
    """A recorded course at the samples of a reference, each value held until the next."""
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
    return values[np.minimum(at, len(values) - 1)]


def _as_recorded(
    simulated: Recording, model: DriveModel, recording: Recording, matched: Mapping[str, Mapping[str, str]]
) -> Recording:
    """The simulation with the names, places and axes of the recorded channels; others keep theirs."""
    recorded_by_name = {channel.name: channel for channel in recording.channels}
    other: dict[str, Channel] = {}
    for name, channels in matched.items():
        for kind, own in axis_channels(name, model.file_axes[name], loaded=True).items():
            if kind in channels and own.name in simulated.names:
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
    model: DriveModel, recording: Recording, matched: Mapping[str, Mapping[str, str]], needed: tuple[str, ...]
) -> OptionError:
    name = next(iter(matched))
    lacks = next(kind for kind in needed if kind not in matched[name])
    what = "commanded position" if lacks == "command" else "output of the control"
    here = ", ".join(f"{c.name} ({c.role})" for c in recording.channels[:12])
    return OptionError(
        f"no channel with the {what} of {', '.join(matched)}: {here}",
        expected=f"a channel with the role position_command, or a name under [axes.{name}.recorded]"
        if lacks == "command"
        else f"a channel that {lacks} under [axes.{name}.recorded] names",
        where=f"model {model.name!r}",
        advice=f'give the channel its role in the machine file, or add {lacks} = "CHANNEL" to [axes.{name}.recorded]',
    )


def _not_driven(matched: Mapping[str, Mapping[str, str]], driven: list[str], needed: tuple[str, ...]) -> list[Finding]:
    found = []
    for name, channels in matched.items():
        if name not in driven:
            lacks = [kind for kind in needed if kind not in channels]
            found.append(
                Finding(
                    "axis-not-driven",
                    "warning",
                    f"Axis {name} was not simulated: the recording has no {' and no '.join(lacks)} of it.",
                    Where(channel=name),
                    {"axis": name, "lacking": lacks},
                    f"name its channels under [axes.{name}.recorded]",
                )
            )
        elif not any(kind in channels for kind in KINDS if kind not in ("command", "load")):
            found.append(
                Finding(
                    "output-not-recorded",
                    "warning",
                    f"Nothing that the simulation says of axis {name} was recorded, so nothing can be compared.",
                    Where(channel=name),
                    {"axis": name},
                    f"name its channels under [axes.{name}.recorded]",
                )
            )
    return found
