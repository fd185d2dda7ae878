"""Beckhoff TwinCAT CNC TF5200: the native compensation ds(T, s) = offset_0 + coefficient · (s − position_0).

The axis list switches it on with a reference position and nothing to correct; while the machine runs, the PLC program
``FB_ThermalCorrection`` gives offset and coefficient, which go to the CNC by ADS. Remarks in lists begin with ``#``
(as in the examples of infosys.beckhoff.com/content/1033/tf5200_tool_data/104785803.html).
"""

import re
from collections.abc import Iterator
from fractions import Fraction

from selector.controllers.model_file import ModelFile, Output
from selector.controllers.program.language import plain
from selector.controllers.writers import exported
from selector.controllers.writers.structured_text import tcpou_export

ADS_TABLE = "temp_comp_ads.txt"
ADS_PORT = 551
ADS_INDEX_GROUP = 0x120300
ADS_ACTIVE, ADS_ACTUAL_OFFSET, ADS_COEFFICIENT = 0x41, 0x42, 0x43
SMOOTHING_CYCLES = 10  #: P-AXIS-00275: a step of the offset is spread over so many interpolation cycles; 0 < n < 20.
TENTHS_PER_UM, TENTHS_PER_M, UM_PER_MM = 10, 10**7, 1000
_LARGEST_SGN32 = 2**31 - 1
_LINE = re.compile(r"lr_param\.temp_comp(_\w+)?\s+(-?\d+)\s*(#.*)?")


def beckhoff_export(model: ModelFile, *, is_sign_verified: bool = False) -> exported.Exported:
    """An axis list per output, the table of what the PLC writes by ADS, and the function block that it comes from."""
    axes = list(_axes(model))
    head = [f"# {line}" for line in exported.heading(model, is_sign_verified=is_sign_verified)]
    files = {
        f"temp_comp_{k}.lis": "\n".join([*head, *_axis_list(output)]) + "\n"
        for k, output in enumerate(model.outputs, 1)
    }
    files[ADS_TABLE] = _ads_table(model, head)
    files |= tcpou_export(model, is_sign_verified=is_sign_verified).files
    lists = ", ".join(f"temp_comp_{k}.lis into the axis list of {axis}" for k, axis in enumerate(axes, 1))
    return exported.with_sheet("beckhoff", model, files, lists=lists, cycles=SMOOTHING_CYCLES)


def temp_comp_mm(position_mm: float, *, position_0: int, offset_0: int, coefficient_um_per_m: float) -> float:
    """What the CNC adds at a position [mm]; `position_0` and `offset_0` in 0.1 µm as in the axis list."""
    from_reference_mm = position_mm - position_0 / (TENTHS_PER_UM * UM_PER_MM)
    return offset_0 / (TENTHS_PER_UM * UM_PER_MM) + coefficient_um_per_m * 1e-6 * from_reference_mm


def list_values(text: str) -> dict[str, int]:
    """Values of the lines ``lr_param.temp_comp…`` of an axis list, by what follows ``temp_comp`` (``"_offset_0"``)."""
    found = (_LINE.fullmatch(line) for line in text.splitlines())
    return {match[1] or "": int(match[2]) for match in found if match}


def ads_offset(axis_id: int, number: int) -> int:
    """Index offset 0x<AID><number> of an object of an axis; `axis_id` from 1 to 65535."""
    return axis_id << 16 | number


def _axes(model: ModelFile) -> Iterator[str]:
    exported.require_own_axes(model, "TwinCAT CNC axis lists, outputs")
    for output in model.outputs:
        axis = output.axis
        if axis is None:
            raise exported.ExportRefusedError(
                f"output {output.name} has no axis",
                expected="one axis for one output",
                where="TwinCAT CNC axis lists, outputs",
                advice="name the axis of the output in the model file, or leave the output out",
            )
        if output.position is not None and output.position.axis != axis:
            raise exported.ExportRefusedError(
                f"output {output.name} of axis {axis} depends on the position of axis {output.position.axis}",
                expected="the position of the corrected axis itself",
                where="TwinCAT CNC axis lists, outputs",
                advice="use the PLC program alone (target tcpou) with a compensation that takes both axes",
            )
        yield plain(axis)


def _sgn32(value: Fraction, what: str) -> int:
    whole = round(value)
    if abs(whole) > _LARGEST_SGN32:
        raise exported.ExportRefusedError(
            what,
            expected=f"at most {_LARGEST_SGN32 / TENTHS_PER_M:.1f} m, the range of SGN32 in 0.1 um",
            where="TwinCAT CNC axis list",
            advice="correct the reference position of the model file",
        )
    return whole


def _axis_list(output: Output) -> Iterator[str]:
    part = output.position
    reference_m = 0.0 if part is None else part.reference_m
    position_0 = _sgn32(Fraction(reference_m) * TENTHS_PER_M, f"reference position {reference_m:g} m")
    yield f"# Output {plain(output.name)}, axis {plain(output.axis or '')}"
    lines = (
        ("", "1", "P-AXIS-00271 on"),
        ("_position_0", str(position_0), f"P-AXIS-00272 reference position [0.1 um]: {reference_m * 1000:g} mm"),
        ("_offset_0", "0", "P-AXIS-00273 [0.1 um], written by the PLC"),
        ("_coefficient", "0", "P-AXIS-00274 [um/m], written by the PLC"),
        ("_n_cycles", str(SMOOTHING_CYCLES), "P-AXIS-00275 interpolation cycles, 0 < n < 20"),
    )
    yield from (f"lr_param.temp_comp{name:13s} {value:>11s}  # {about}" for name, value, about in lines)


def _ads_table(model: ModelFile, head: list[str]) -> str:
    outputs, statements = [], []
    for k, output in enumerate(model.outputs, 1):
        axis, slope = plain(output.axis or ""), f"slope_{k}"
        has_slope = output.position is not None
        told = slope if has_slope else "0 (no position-dependent part)"
        outputs.append(f"{plain(output.name)}  {axis}  10 * k0_{k}, rounded  {told}")
        statements.append(f"  offset_0_{k} := LREAL_TO_DINT(10.0 * fb.k0_{k});   // axis {axis}, 0.1 um")
        statements.append(f"  coefficient_{k} := {f'fb.{slope}' if has_slope else '0.0'};   // um/m")
    return exported.filled(
        "beckhoff_ads",
        head=head,
        port=ADS_PORT,
        group=f"0x{ADS_INDEX_GROUP:X}",
        group_2=f"0x{ADS_INDEX_GROUP & 0xFFFFF:X}",
        example=f"0x{ads_offset(1, ADS_COEFFICIENT):X}",
        active=f"{ADS_ACTIVE:04X}",
        actual=f"{ADS_ACTUAL_OFFSET:04X}",
        coefficient=f"{ADS_COEFFICIENT:04X}",
        outputs=outputs,
        statements=statements,
    )
