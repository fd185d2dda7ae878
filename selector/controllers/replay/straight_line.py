"""What a control or a drive adds to an axis that gets a straight line, as the exported parameters say it."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np

from selector.controllers.evaluator import axes_of, first_finite
from selector.controllers.model_file import ModelFile
from selector.controllers.replay.parts import places_m
from selector.controllers.replay.rows import Answers, Rows
from selector.controllers.replay.structured_text_executed import executable
from selector.controllers.writers.beckhoff import ADS_TABLE, list_values, temp_comp_mm
from selector.controllers.writers.rexroth import FILE, drive_parameters, rexroth_export
from selector.controllers.writers.sinumerik import SETTING_DATA
from selector.errors import NotExecutableError
from selector.types import Array

_UM_PER_MM, _MM_PER_M = 1000.0, 1000.0
_OFFSET = re.compile(r"^  offset_0_(\d+) := LREAL_TO_DINT\((\d+\.\d+) \* fb\.k0_\1\);", re.MULTILINE)
_COEFFICIENT = re.compile(r"^  coefficient_(\d+) := (?:(0\.0)|fb\.slope_\1);", re.MULTILINE)


def setting_data_answers(model: ModelFile, rows: Rows, files: Mapping[str, str], main: Answers) -> Answers:
    """What the NC adds with the setting data that ``thermal_to_sd.scl`` makes, in REAL, of the answers of the model.

    Raises
    ------
    NotExecutableError
        As `executable`.
    """
    block = executable(files[SETTING_DATA])
    line, places = np.zeros_like(main.correction_um), places_m(model, rows)
    axes = axes_of(model)
    for k in range(len(rows)):
        for i in range(len(model.outputs)):
            for name, of in (("correction", main.correction_um), ("k0", main.k0_um), ("slope", main.slope_um_per_m)):
                setattr(block, f"v_{name}_{i + 1}", block.number(of[k, i]))
        block.call()
        for i, output in enumerate(model.outputs):
            k0, slope, zero = (float(getattr(block, f"v_sd{number}_{i + 1}")) for number in (43900, 43910, 43920))
            place_mm = 0.0
            if output.position is not None:
                place_mm = _MM_PER_M * places[k, axes.index(output.position.axis)]
            line[k, i] = _UM_PER_MM * (k0 + slope * (place_mm - zero))
    return Answers(line, main.k0_um, main.slope_um_per_m, main.mode, main.sensors, main.axes)


def temp_comp_answers(model: ModelFile, rows: Rows, files: Mapping[str, str], main: Answers) -> Answers:
    """What the CNC adds with the axis lists and what ``temp_comp_ads.txt`` writes of the answers of the block.

    Raises
    ------
    NotExecutableError
        The table has other statements than those that are exported.
    """
    tenths = {int(k): float(factor) for k, factor in _OFFSET.findall(files[ADS_TABLE])}
    is_flat = {int(k): bool(zero) for k, zero in _COEFFICIENT.findall(files[ADS_TABLE])}
    expected = set(range(1, len(model.outputs) + 1))
    if set(tenths) != expected or set(is_flat) != expected:
        raise NotExecutableError(
            f"statements for {len(tenths)} offsets and {len(is_flat)} coefficients",
            expected=f"one of each for {len(expected)} outputs",
            where=ADS_TABLE,
            advice="replay the file as it was exported",
        )
    line, places, axes = np.zeros_like(main.correction_um), places_m(model, rows), axes_of(model)
    for i, output in enumerate(model.outputs):
        position_0 = list_values(files[f"temp_comp_{i + 1}.lis"])["_position_0"]
        offsets = np.rint(tenths[i + 1] * main.k0_um[:, i]).astype(np.int64)
        slopes = np.zeros(len(rows)) if is_flat[i + 1] else main.slope_um_per_m[:, i]
        at_mm: Array = np.zeros(len(rows))
        if output.position is not None:
            at_mm = _MM_PER_M * places[:, axes.index(output.position.axis)]
        for k, (place, offset, slope) in enumerate(zip(at_mm.tolist(), offsets.tolist(), slopes.tolist(), strict=True)):
            added = temp_comp_mm(place, position_0=position_0, offset_0=offset, coefficient_um_per_m=slope)
            line[k, i] = _UM_PER_MM * added
    return Answers(line, main.k0_um, main.slope_um_per_m, main.mode, main.sensors, main.axes)


HALF_K, HALF_M, HALF_DIGIT = 0.5e-4, 0.5e-7, 5e-6
"""Half of the last digit: of the reference temperature [K], of x0 [m], of a factor, as a share of it."""

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
    found = Answers.empty(len(rows), len(model.outputs), len(model.inputs), len(axes_of(model)))
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
            away_m = places_m(model, rows)[:, axes.index(output.position.axis)] - zero_mm / 1000.0
            found.correction_um[:, k] += found.slope_um_per_m[:, k] * away_m
    return found


def printed_parameters_um(model: ModelFile, rows: Rows) -> dict[str, float]:
    """Per output, what the printed digits of the parameters, and what they cannot say of the model, cost at most [µm].

    The reference temperature is printed in steps of 0.0001 K, factors in six digits, x0 in steps of 0.0001 mm.
    """
    found = {}
    for output in model.outputs:
        of, part = drive_parameters(model, output), output.position
        at = [item.name for item in model.inputs].index(of.source)
        readings: Array = rows.readings[:, at]
        start = first_finite(readings) if model.inputs[at].reference == "rise" else 0.0
        warmer = np.abs(readings - start - of.shift_k)
        warmest = float(np.max(warmer[np.isfinite(warmer)], initial=0.0)) + HALF_K
        reach, within, steep = 0.0, 0.0, abs(of.um_per_m_k)
        if part is not None:
            places = places_m(model, rows)[:, axes_of(model).index(part.axis)]
            reach = float(np.max(np.abs(places - of.zero_m), initial=0.0)) + HALF_M
            within = max(abs(part.valid_min_m - of.zero_m), abs(part.valid_max_m - of.zero_m))
        size = abs(of.um_per_k) + steep * reach
        loss = of.loss_um * max(1.0, reach / within if within > 0.0 else 1.0)
        # and float64 itself
        found[output.name] = loss + size * (HALF_K + HALF_DIGIT * warmest) + steep * HALF_M * warmest + 1e-9
    return found
