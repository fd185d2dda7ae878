"""What a control adds to an axis that gets a straight line: written files turn µm into its units, it does the rest."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np

from selector.controllers.model_file import ModelFile
from selector.controllers.program.guarded_program import axes_of
from selector.controllers.replay.reduced_guard import places_m
from selector.controllers.replay.rows import Answers, Array, Rows
from selector.controllers.replay.structured_text_executed import executable
from selector.controllers.writers.beckhoff import ADS_TABLE, list_values, temp_comp_mm
from selector.controllers.writers.sinumerik import SETTING_DATA
from selector.errors import NotExecutableError

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
