"""A model applied to recordings as they were read: what is compared, and what is told of it."""

import dataclasses
import math
from collections.abc import Iterator, Mapping

from selector.controllers.application import (
    Application,
    apply_model,
    displacement_starts,
    known_starts,
    sensor_starts,
    without_displacement_faults,
)
from selector.controllers.finding_table import SENSOR_LOOKS_BROKEN
from selector.controllers.model_file import ModelFile
from selector.findings import Finding, Where
from selector.readers import Reading
from selector.recording import Recording
from selector.study.finding_table import FINDINGS


def applied(model: ModelFile, reading: Reading) -> tuple[Application, Recording]:
    """Predictions of a model for the recordings that were read, with all findings; and the recording without the faults
    of its displacement.
    """
    compared, quality = without_displacement_faults(model, reading.recording)
    starts = sensor_starts(model, compared)
    application = apply_model(model, compared, start_readings=known_starts(starts))
    told = [finding for finding in quality if not any(_says_the_same(other, finding) for other in application.findings)]
    of_starts = (*_without_start(starts), *_not_zeroed(displacement_starts(model, compared)))
    findings = (*reading.findings, *told, *of_starts, *application.findings)
    return dataclasses.replace(application, findings=findings), compared


def _says_the_same(said: Finding, finding: Finding) -> bool:
    """Whether the model's own look at a sensor covers what the quality check found there."""
    a, b = said.where, finding.where
    if said.id != SENSOR_LOOKS_BROKEN or (a.channel, a.run) != (b.channel, b.run):
        return False
    if a.from_s is None or a.to_s is None or b.from_s is None or b.to_s is None:
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
