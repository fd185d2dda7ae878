"""What would the model have done in these recorded runs: simulations at their time stamps, under their names."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd

from selector.findings import Finding, Where
from selector.physics.simulation_kind import Progress
from selector.physics.thermal.file.model_file import InputsSection
from selector.physics.thermal.finding_table import FINDINGS
from selector.physics.thermal.network.laws import Conditions
from selector.physics.thermal.schedule import driven, held_at, seed_of_run
from selector.physics.thermal.thermal_model import FileModel, input_channel, simulation_findings
from selector.recording import Channel, Recording

_START_K = 1.0
"""What a machine that stood for a night may differ from its hall."""

_START_SAMPLES = 5


def driven_runs(
    model: FileModel,
    recording: Recording,
    *,
    inputs: InputsSection,
    otherwise: Conditions,
    seed: int | None = None,
    progress: Progress | None = None,
) -> tuple[Recording, tuple[Finding, ...]]:
    """A simulation of every run of a recording, driven by what was recorded, and what is to be said about it.

    Samples stand at the time stamps of the recording. An output has the name, place and axis of the recorded channel
    with the same name; a displacement else those of the only one along its axis. `inputs` and `otherwise` are those of
    `schedule.driven`. Without a `seed` thermometers and gauges are free of noise and rounding.

    Raises InputError: the recording cannot drive this model.
    """
    matched = _matched(model.outputs, recording)
    findings: list[Finding] = []
    runs: dict[str, pd.DataFrame] = {}
    told: dict[str, Any] = {}
    provenance: dict[str, Any] = {}
    used: dict[str, str] = {}
    missing: dict[str, list[str]] = {}
    for number, run in enumerate(recording.runs):
        if progress is not None:
            progress(number, len(recording.runs), run)
        drive = driven(recording, run, inputs, otherwise)
        names = {channel: name for channel, name in drive.channels.items() if name in model.inputs}
        used |= names
        for name in drive.not_recorded:
            if name in model.inputs:
                missing.setdefault(name, []).append(run)
        time_s = recording.time_s(run)
        simulated = model.simulate(
            drive.conditions,
            time_s=time_s,
            run=run,
            seed=None if seed is None else seed_of_run(seed, run),
            instruments=seed is not None,
        )
        outputs = [channel.name for channel in model.outputs]
        index = pd.Index(time_s, name="time_s")
        table = pd.DataFrame(simulated.values(run, outputs), index, columns=[matched[n].name for n in outputs])
        for channel, name in names.items():
            table[channel] = held_at(drive.conditions, name, time_s)
        runs[run] = table
        told[run] = simulated.provenance.get("runs", {}).get(run, {})
        provenance = {**simulated.provenance, "runs": told}
    findings += [_not_recorded(name, lacking, recording, otherwise) for name, lacking in missing.items()]
    inputs_as_recorded = [_as_recorded(recording.channel(channel), name) for channel, name in used.items()]
    channels = (*inputs_as_recorded, *(matched[channel.name] for channel in model.outputs))
    answer = Recording.from_runs(runs, channels, provenance)
    findings += [*_not_compared(model, matched, recording), *_other_start(answer, recording)]
    return answer, (*findings, *simulation_findings(answer))


def _as_recorded(channel: Channel, name: str) -> Channel:
    """The recorded channel; where it has no place, that of the condition."""
    place = channel.place or input_channel(name).place
    return Channel(channel.name, channel.role, channel.unit, place, channel.axis, channel.xyz_m)


def _matched(outputs: tuple[Channel, ...], recording: Recording) -> dict[str, Channel]:
    """Output → the channel of the recording that it is compared with, or itself."""
    recorded = {channel.name: channel for channel in recording.channels}
    matched = {
        output.name: recorded[output.name]
        for output in outputs
        if output.name in recorded and recorded[output.name].role == output.role
    }
    for output in outputs:
        if output.name in matched or output.role != "displacement" or output.axis is None:
            continue
        alike = [c for c in recording.channels if c.role == "displacement" and c.axis == output.axis]
        rivals = [o for o in outputs if o.role == "displacement" and o.axis == output.axis]
        if len(alike) == 1 and len(rivals) == 1 and alike[0] not in matched.values():
            matched[output.name] = alike[0]
    taken = set(recorded)
    for output in outputs:
        if output.name not in matched:
            name = output.name
            while name in taken:  # a name that the recording uses for something else
                name += " (simulated)"
            taken.add(name)
            matched[output.name] = Channel(name, output.role, output.unit, output.place, output.axis, output.xyz_m)
    return matched


def _not_recorded(name: str, runs: list[str], recording: Recording, otherwise: Conditions) -> Finding:
    course = held_at(otherwise, name, otherwise.time_s)
    moves = float(course.max()) > float(course.min())
    value = (
        f"{course.min():g} to {course.max():g}, a course that says nothing of these runs" if moves else f"{course[0]:g}"
    )
    which = "any run" if len(runs) == len(recording.runs) else ", ".join(runs[:6])
    return FINDINGS.finding(
        "input-not-recorded",
        f"{name} was not recorded in {which}; the value of the model file was used ({value}).",
        Where(run=runs[0] if len(runs) == 1 else None),
        {"input": name, "runs": runs},
        f"record it, or name its channel under [inputs]: {name} = \"CHANNEL\"", level="warning" if moves else "info",
    )  # fmt: skip


def _other_start(answer: Recording, recording: Recording) -> Iterator[Finding]:
    """Runs whose recorded thermometers began elsewhere than the model, which starts with one temperature."""
    shared = [name for name in answer.with_role("temperature") if name in recording.with_role("temperature")]
    off_k: dict[str, float] = {}
    for run in answer.runs:
        first = recording.values(run, shared)[:_START_SAMPLES] - answer.values(run, shared)[:_START_SAMPLES]
        there = first[:, np.isfinite(first).any(axis=0)]
        if there.size:
            gaps = np.nanmedian(there, axis=0)
            worst = float(gaps[np.argmax(np.abs(gaps))])
            if abs(worst) > _START_K:
                off_k[run] = worst
    if off_k:
        worst_run = max(off_k, key=lambda run: abs(off_k[run]))
        yield FINDINGS.finding(
            "start-differs",
            f"{len(off_k)} of {len(answer.runs)} runs did not begin at the temperature at which the model starts: in "
            f"{worst_run} a thermometer read {off_k[worst_run]:+.1f} K against it.",
            Where(run=worst_run if len(off_k) == 1 else None),
            {"largest_difference_k": off_k},
        )


def _not_compared(model: FileModel, matched: dict[str, Channel], recording: Recording) -> Iterator[Finding]:
    """What of the simulation has no recorded counterpart, if anything."""
    recorded = set(recording.channels)
    alone = [output.name for output in model.outputs if matched[output.name] not in recorded]
    if alone:
        none = len(alone) == len(model.outputs)
        yield FINDINGS.finding(
            "output-not-recorded",
            ("None" if none else f"{len(alone)}") + f" of the {len(model.outputs)} outputs of the model "
            + ("has a recorded channel of its name or axis." if none else "have no recorded channel: ")
            + ("" if none else ", ".join(alone[:8]) + ("…" if len(alone) > 8 else "") + "."),
            evidence={"outputs": alone},
            suggestion="call sensors and gauges of the model file as the channels of the recording are called",
            level="warning" if none else "info",
        )  # fmt: skip
