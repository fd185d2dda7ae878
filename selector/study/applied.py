"""A model applied to recordings as they were read: what is compared, and what is told of it."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from selector.controllers import application as applying
from selector.controllers.finding_table import SENSOR_LOOKS_BROKEN
from selector.controllers.from_selection import model_file_of
from selector.controllers.guard.decided import with_decided_limits
from selector.controllers.model_file import ModelFile
from selector.controllers.replay.parts import reference_answers
from selector.controllers.replay.replayed import SEEN_MORE, SEEN_MORE_UM, rows_of_run
from selector.findings import Finding, Where
from selector.number_text import listed
from selector.readers import Reading
from selector.recording import PARTS, Recording
from selector.selection import Selection
from selector.study.data import StudyData
from selector.study.finding_table import FINDINGS

MOST_ROWS = 200_000  #: Of more the program is not run for a study: it takes a tenth of a millisecond a row.


def applied(model: ModelFile, reading: Reading) -> tuple[applying.Application, Recording]:
    """Predictions of a model for the recordings that were read, with all findings; and the recording without the faults
    of its displacement.
    """
    compared, quality = applying.without_displacement_faults(model, reading.recording)
    starts = applying.sensor_starts(model, compared)
    application = applying.apply_model(model, compared, start_readings=applying.known_starts(starts))
    run_of = {part: run for part, (run, _) in compared.provenance.get(PARTS, {}).items()}
    told = [one for one in quality if not any(_says_the_same(other, one, run_of) for other in application.findings)]
    of_starts = (*_without_start(starts), *_not_zeroed(applying.displacement_starts(model, compared)))
    findings = (*reading.findings, *told, *of_starts, *application.findings)
    return replace(application, findings=findings), compared


def proven_on_control(selection: Selection, data: StudyData) -> Selection:
    """The selection, and what a control leaves that loses the readings which were filled in for the study."""
    lost, filled = data.lost, data.source
    if lost is None or not isinstance(filled, Recording) or len(lost.frame) > MOST_ROWS:
        return selection
    model = with_decided_limits(model_file_of(selection, filled.channels, source=filled))
    left_um, filled_um = _left_um(model, lost), _left_um(model, filled)
    more = [name for name, um in filled_um.items() if left_um[name] > um + max(SEEN_MORE_UM, SEEN_MORE * um)]
    if not more:
        return selection
    of = listed([f"{left_um[name]:.2g} µm rms of {name} ({filled_um[name]:.2g} if it has them all)" for name in more])
    says = f"A control that loses readings as these recordings do leaves {of}: each time it leaves the model."
    evidence = {"program_rmse_um": left_um, "filled_rmse_um": filled_um}
    return replace(
        selection, findings=(*selection.findings, FINDINGS.finding("lost-readings-cost", says, evidence=evidence))
    )


def _left_um(model: ModelFile, recording: Recording) -> dict[str, float]:
    """What the guarded program of a model leaves of each output over all runs [µm rms]."""
    starts = applying.displacement_starts(model, recording)
    errors = {output.name: [np.zeros(0)] for output in model.outputs}
    for run in recording.runs:
        correction_um = reference_answers(model, rows_of_run(model, recording, run)).correction_um
        for k, output in enumerate(model.outputs):
            recorded_um = applying.displacement_of(output, recording, run) - starts[run].get(output.name, 0.0)
            before = len(correction_um) - len(recorded_um)
            zero_um = correction_um[before, k] if before else 0.0
            errors[output.name].append(recorded_um + correction_um[before:, k] - zero_um)
    return {name: float(np.sqrt(np.nanmean(np.concatenate(parts) ** 2))) for name, parts in errors.items()}


def _says_the_same(said: Finding, finding: Finding, run_of: Mapping[str, str]) -> bool:
    """Whether the model's own look at a sensor covers what the quality check found there."""
    a, b = said.where, finding.where
    run = run_of.get(a.run or "", a.run)
    if said.id != SENSOR_LOOKS_BROKEN or (a.channel, run) != (b.channel, b.run):
        return False
    if run != a.run or a.from_s is None or a.to_s is None or b.from_s is None or b.to_s is None:
        return True
    return a.from_s <= b.to_s and b.from_s <= a.to_s


def _without_start(starts: Mapping[str, Mapping[str, float]]) -> Iterator[Finding]:
    """Sensors that have no reading at the start of a run: their rise counts from a later time."""
    for run, found in starts.items():
        for name, level in found.items():
            if not math.isfinite(level):
                yield FINDINGS.finding(
                    "start-missing",
                    f"{name} has no reading at the start of run {run}; its rise counts from its first reading, and the "
                    "prediction is too small by what happened before.",
                    Where(channel=name, run=run),
                    {},
                )


def _not_zeroed(starts: Mapping[str, Mapping[str, float]]) -> Iterator[Finding]:
    """Displacements whose start was taken as their zero, which the predictions then count from too."""
    for run, found in starts.items():
        for name, start_um in found.items():
            if start_um:
                yield FINDINGS.finding(
                    "gauge-not-zeroed",
                    f"{name} starts run {run} at {start_um:.4g} µm: errors count from there, and the predictions "
                    "that are written have this start added, so that they lie over the recording.",
                    Where(channel=name, run=run),
                    {"start_um": start_um},
                    "zero the gauge before a run",
                )
