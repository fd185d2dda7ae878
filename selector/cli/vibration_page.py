"""What stands on the page of a simulated vibration: answers over frequency, stretches of the runs, numbers' origin."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from selector.cli.parameter_origin import facts_of, parameters_with_origin
from selector.errors import InputError
from selector.figures.vibration import Answer
from selector.physics.vibration.final_motion import final_receptance
from selector.physics.vibration.modes import receptance_by_modes
from selector.physics.vibration.resonance import CarryingMode, carrying_mode
from selector.physics.vibration.vibration_model import FINALS, RELATIVE
from selector.report.vibration_report import Course, VibrationPage

if TYPE_CHECKING:
    from selector.findings import Finding
    from selector.physics.channel_differences import ChannelDifference
    from selector.physics.vibration.modes import StructureModes
    from selector.physics.vibration.source import Source
    from selector.physics.vibration.vibration_model import VibrationModel, VibrationSimulation
    from selector.physics.vibration.vibration_summary import VibrationSummary
    from selector.recording import Recording

Vector = NDArray[np.float64]

_MOST_RUNS = 3
_FREQUENCIES = 600
_LOWEST_HZ = 1.0
_BEYOND, _FAR = 2.0, 10.0
"""Answers are drawn up to so many times the highest line or mode, but of modes only up to the other times the line."""

_AROUND = np.linspace(-3.0, 3.0, 13)
"""Frequencies about a mode, in widths of its resonance, that a sharp one needs."""

_PERIODS = 6.0
"""Of the largest line, that a stretch of time shows."""

_NOTHING = 1e-9
"""Share of the largest answer below which there is none, but for rounding."""

_MICRO = 1e6


def page_of(
    model: VibrationModel,
    simulation: VibrationSimulation,
    summary: VibrationSummary,
    findings: tuple[Finding, ...],
    path: Path,
    differences: tuple[ChannelDifference, ...] = (),
) -> VibrationPage:
    """Everything that the page shows; `path` is the model file, `differences` are those from recordings."""
    frequency_hz, answers = _answers(model, summary)
    recording = simulation.recording
    return VibrationPage(
        recording=recording,
        model=model.name,
        structure=model.structure,
        sources=model.sources,
        chains=model.chains,
        method=model.file.run.method,
        summary=summary,
        cutting=model.cutting(summary.shaft_rpm),
        surface=model.surface,
        carried=_carried(model, summary),
        frequency_hz=frequency_hz,
        answers=answers,
        courses=tuple(
            course for run in recording.runs[:_MOST_RUNS] for course in _courses(model, recording, run, summary)
        ),
        inputs=tuple(channel.name for channel in recording.channels if channel.role in ("force", "spindle_speed")),
        differences=differences,
        findings=findings,
        parameters=parameters_with_origin(model.file, model.parameters),
        told={
            **facts_of(path, model.file.model.note),
            "method": model.file.run.method,
            "speeds of lines and errors [r/min]": dict(summary.shaft_rpm),
            "phases of the sources [rad]": {
                run: dict(phases) for run, phases in list(simulation.phases_rad.items())[:1]
            },
            "seed": recording.provenance["simulated"]["seed"],
        },
    )


def _carried(model: VibrationModel, summary: VibrationSummary) -> CarryingMode | None:
    """The mode that carries what the page begins with: the highest error, or the largest line."""
    if summary.errors:
        worst = max(summary.errors, key=lambda one: one.kinematic_um)
        names, frequency_hz = worst.sources, worst.frequency_hz
    elif summary.lines:
        line = max(summary.lines, key=lambda one: one.motion_um[RELATIVE])
        names, frequency_hz = (line.source,), line.frequency_hz
    else:
        return None
    source = next(one for one in model.sources if one.name == names[0])
    tool, workpiece = (model.finals[name] for name in FINALS)
    return carrying_mode(model.structure, summary.modes, source, frequency_hz, tool=tool, workpiece=workpiece)


def _answers(model: VibrationModel, summary: VibrationSummary) -> tuple[Vector, Mapping[str, tuple[Answer, ...]]]:
    """Motion per newton of every source over frequency; nothing where a frequency meets an undamped resonance."""
    modes = summary.modes
    slowest, fastest = float(modes.frequency_hz[0]), float(modes.frequency_hz[-1])
    last = max((one.frequency_hz for one in summary.lines), default=slowest)
    highest = max(_BEYOND * last, min(_BEYOND * fastest, _FAR * last))
    lowest = min([_LOWEST_HZ, highest / 100.0, *(0.7 * one.frequency_hz for one in summary.lines)])
    near = modes.frequency_hz[:, None] * (1.0 + modes.loss_factor[:, None] / 2.0 * _AROUND)
    frequency_hz = np.unique(np.concatenate([np.geomspace(lowest, highest, _FREQUENCIES), near.ravel()]))
    frequency_hz = frequency_hz[(frequency_hz >= lowest) & (frequency_hz <= highest)]
    coupled = {
        (source.name, final): answer
        for source in model.sources
        for final in FINALS
        if (answer := _coupled_um(model, modes, source, final, frequency_hz)) is not None
    }
    largest = max((float(answer.max()) for answer in coupled.values()), default=0.0)
    found: dict[str, list[Answer]] = {final: [] for final in FINALS}
    for source in model.sources:
        chains = _chains_um(model, source, frequency_hz, summary.split_hz) if model.chains else None
        lines_hz = np.array([one.frequency_hz for one in summary.lines if one.source == source.name])
        for row, final in enumerate(FINALS):
            answer = coupled.get((source.name, final))
            if answer is None or answer.max() <= _NOTHING * largest:
                continue
            by_chains = None if chains is None or np.isnan(chains[row]).all() else chains[row]
            found[final].append(Answer(source.name, np.maximum(answer, _NOTHING * largest), by_chains, lines_hz))
    return frequency_hz, {final: tuple(answers) for final, answers in found.items()}


def _coupled_um(
    model: VibrationModel, modes: StructureModes, source: Source, final: str, frequency_hz: Vector
) -> Vector | None:
    """|X/F| of a final [µm/N], from the modes: there are many frequencies."""
    try:
        found = receptance_by_modes(
            model.structure, frequency_hz, of=model.finals[final], at=source.member, against=source.against, modes=modes
        )
    except InputError:
        return None
    return _MICRO * np.abs(found)


def _chains_um(model: VibrationModel, source: Source, frequency_hz: Vector, split_hz: float | None) -> Vector | None:
    """|X/F| of the finals [µm/N] by the chains; NaN where none leads there from the source."""
    try:
        found = final_receptance(
            model.structure, source, frequency_hz, model.finals, method="chains", chains=model.chains, split_hz=split_hz
        )
    except InputError:
        return None
    return np.where(found.carried, _MICRO * np.abs(found.motion_m_per_n), np.nan)


def _courses(model: VibrationModel, recording: Recording, run: str, summary: VibrationSummary) -> list[Course]:
    """Some periods about the largest motion, and the whole run where a speed changes in it."""
    time_s = recording.time_s(run)
    # channels stand as the model gives them, also where they are called as the recorded ones
    names = (*FINALS, RELATIVE), tuple(source.name for source in model.sources), tuple(model.file.shafts)
    columns = iter(recording.values(run, list(recording.names)).T)
    motions, forces, speeds = ({name: next(columns) for name in group} for group in names)
    largest = max(summary.lines, key=lambda one: one.motion_um[RELATIVE], default=None)
    whole = slice(0, len(time_s))
    part = whole if largest is None else _stretch(time_s, motions[RELATIVE], _PERIODS / largest.frequency_hz)
    parts = [whole, part] if part != whole and any(np.ptp(rpm) > 0 for rpm in speeds.values()) else [part]
    return [
        Course(
            run=run,
            from_s=float(time_s[one.start] - time_s[0]),
            time_s=time_s[one] - time_s[one.start],
            motions_um={name: values[one] for name, values in motions.items()},
            forces_n={name: values[one] for name, values in forces.items()},
            speeds_rpm={name: values[one] for name, values in speeds.items()} if one == whole else {},
            is_whole=one == whole,
        )
        for one in parts
    ]


def _stretch(time_s: Vector, motion: Vector, duration_s: float) -> slice:
    """Samples of so long about the largest motion; all where that is most of the run."""
    k = int(np.nanargmax(np.abs(motion)))
    if duration_s > 0.6 * float(time_s[-1] - time_s[0]):
        return slice(0, len(time_s))
    start = max(float(time_s[0]), min(float(time_s[k]) - duration_s / 2.0, float(time_s[-1]) - duration_s))
    first, last = np.searchsorted(time_s, [start, start + duration_s]).tolist()
    return slice(first, min(max(last, first + 2) + 1, len(time_s)))
