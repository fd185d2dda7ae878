"""Which recorded displacement a model is compared with: without its own faults, and counted from which zero."""

from __future__ import annotations

import dataclasses
import re

from selector.controllers.model_file import ModelFile
from selector.findings import Finding
from selector.models.design import datum_of
from selector.quality import inspect, without_faults
from selector.recording import Recording


def displacement_starts(model: ModelFile, recording: Recording) -> dict[str, dict[str, float]]:
    """Run → output → displacement [µm] that counts as zero, for the outputs that are rises and were recorded.

    As in a selection, so that a model is compared with what it was fitted to: 0 where the gauge was zeroed, else the
    start of a curve through the first samples (`gauge_start`); the first sample would leave its noise in the whole run.
    """
    rises = [output.name for output in model.outputs if output.reference == "rise" and output.name in recording.names]
    levels = datum_of(recording, (), rises, "rise").levels
    return {run: dict(found) for run, found in levels.items()}


def without_displacement_faults(model: ModelFile, recording: Recording) -> tuple[Recording, tuple[Finding, ...]]:
    """The recording without the faults of its displacement, and what is wrong with the channels of the model.

    A broken sensor is not mended: its readings stay what a control would get. What is missing altogether is left for
    `require_channels`, which says it in the words of the model.
    """
    outputs = [output.name for output in model.outputs]
    used = {*outputs, *(item.name for item in model.inputs)} & set(recording.names)
    found = tuple(_of_comparison(finding, outputs) for finding in inspect(recording, used))
    return without_faults(recording, found), found


def _of_comparison(finding: Finding, outputs: list[str]) -> Finding:
    """The finding with the action that it has here: only faulty displacement is left out."""
    if finding.action == "none" or (finding.action == "leave-out-stretch" and finding.where.channel in outputs):
        return finding
    suggestion = re.sub(r" *\bThe \w+ (is|are) left out\.", "", finding.suggestion)
    return dataclasses.replace(finding, action="none", suggestion=suggestion)
