"""The straight line of a drive, as its exported parameters say it."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np

from selector.controllers.evaluator import first_finite
from selector.controllers.model_file import ModelFile
from selector.controllers.program.guarded_program import axes_of
from selector.controllers.replay.rows import Answers, Array, Rows
from selector.controllers.writers.rexroth import FILE, drive_parameters, rexroth_export

_NUMBER = r"([+-]? ?[0-9.]+(?:e[+-]?[0-9]+)?)"
_BLOCK = re.compile(
    rf"P-0-0402 .*?{_NUMBER} (?:degC|K)$\s+P-0-0406 .*?factor +{_NUMBER} um/.*?$\s+"
    rf"P-0-0407 .*?factor +{_NUMBER} um/K.*?$"
    rf"(?:\s+x0 .*?zero +{_NUMBER} mm)?",
    re.MULTILINE,
)


def drive_answers(model: ModelFile, rows: Rows, files: Mapping[str, str] | None = None) -> Answers:
    """What a drive with these parameters adds; it has no guard, so that mode and sensor codes are 0.

    The numbers are read from the exported text. A reading that is missing is passed on as the reference temperature.
    """
    found = Answers.empty(len(rows), len(model.outputs), len(model.inputs))
    blocks = _BLOCK.findall((files or rexroth_export(model).files)[FILE])
    names, axes = [item.name for item in model.inputs], axes_of(model)
    for k, (output, block) in enumerate(zip(model.outputs, blocks, strict=True)):
        reference, steep, own, zero_mm = (float(text.replace(" ", "") or "0") for text in block)
        at = names.index(drive_parameters(model, output).source)
        readings: Array = rows.readings[:, at]
        if model.inputs[at].reference == "rise":
            reference += first_finite(readings)
        warmer = np.where(np.isfinite(readings), readings - reference, 0.0)
        found.k0_um[:, k] = found.correction_um[:, k] = -own * warmer
        if output.position is not None:
            found.slope_um_per_m[:, k] = -steep * warmer
            away_m = rows.positions_m[:, axes.index(output.position.axis)] - zero_mm / 1000.0
            found.correction_um[:, k] += found.slope_um_per_m[:, k] * away_m
    return found
