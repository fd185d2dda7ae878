"""How is a correction program written down: the source's notation, a table, and timed offset blocks for the control."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from selector.csv_text import csv_text
from selector.physics.thermal.correction_program import CorrectionProgram, Operation

_RULES = """\
Timed corrections of the thermal displacement
=============================================

offset      displacement that is predicted since the zero of the operation [µm], [mm], counted as the gauge counts it
step        change of the offset at this time [µm], [mm]
time        from the start of the duty cycle [h:mm:ss]

At its time, move the zero of the axis so that the offset is taken off: the correction is the displacement to be
SUBTRACTED. Whether that is + or - on your control depends on how the gauge stood and how the control counts:
VERIFY THE SIGN ON THE MACHINE (apply 10 µm by hand and read the gauge) before the first part.

Every operation begins with a new zero: touch off the workpiece or the tool, and set the offset to 0 there. A control
takes the offset as an external work zero or an external zero offset (`offset`, replacing the value before), or as an
increment (`step`, added to it), never both. The times hold for the duty cycle of the prediction: after a stop, predict
again. The notation number-{minutes}-{µm} is for reading: its times are rounded down to 0.1 min, so that corrections
read from there act up to 6 s early; prediction.json has the exact ones.
Spread large steps over a moment without cutting contact.
"""

_HEADINGS = (
    "response",
    "operation",
    "correction",
    "start_min",
    "duration_min",
    "step_um",
    "offset_um",
    "step_mm",
    "offset_mm",
)


def notation(operation: Operation) -> str:
    """One operation as the source prints it (C eq. 5): ``3-{18,27,15}-{0,10,10}``, minutes and µm.

    For reading: the times of the corrections are rounded down to 0.1 min, so that none is late and the durations add up
    to the operation, the corrections to 0.1 µm; `Operation` has the exact values.
    """
    starts = [_tenths(time_s - operation.start_s) for time_s in operation.times_s.tolist()]
    ends = [*starts[1:], (operation.end_s - operation.start_s) / 60.0]
    durations = ",".join(_minutes(end - start) for start, end in zip(starts, ends, strict=True))
    corrections = ",".join(_short(value) for value in operation.corrections_um)
    return f"{len(operation.corrections_um)}-{{{durations}}}-{{{corrections}}}"


def program_table(programs: Mapping[str, CorrectionProgram]) -> str:
    """The programs (response → program) as CSV, one row a correction; times are rounded down to 0.0001 min.

    Names of responses are those of `selector.csv_text.defused`.
    """
    rows: list[tuple[object, ...]] = []
    for response, program in programs.items():
        for number, operation in enumerate(program.operations, start=1):
            for correction, (time_s, duration_s, step_um, offset_um) in enumerate(_rows(operation), start=1):
                rows.append(
                    (
                        response,
                        number,
                        correction,
                        f"{_ten_thousandths(time_s):.4f}",
                        f"{_ten_thousandths(time_s + duration_s) - _ten_thousandths(time_s):.4f}",
                        f"{step_um:.3f}",
                        f"{offset_um:.3f}",
                        f"{step_um / 1000.0:.6f}",
                        f"{offset_um / 1000.0:.6f}",
                    )
                )
    return csv_text(_HEADINGS, rows)


def program_blocks(programs: Mapping[str, CorrectionProgram]) -> str:
    """The programs (response → program) as timed offset blocks that name no control, for people to type in."""
    lines = [_RULES]
    for response, program in programs.items():
        lines.append(f"[{_one_line(response)}]   tolerance {program.tolerance_um:g} µm")
        number = 0
        for place, operation in enumerate(program.operations, start=1):
            lines.append("")
            lines.append(
                f"; operation {place}: {_clock(operation.start_s)} to {_clock(operation.end_s)}   {notation(operation)}"
            )
            for correction, (time_s, _, step_um, offset_um) in enumerate(_rows(operation)):
                number += 10
                what = "new zero" if correction == 0 else f"step {step_um:+9.3f} µm ({step_um / 1000.0:+.6f} mm)"
                lines.append(
                    f"N{number:<5} AT {_clock(time_s):>9}  OFFSET {offset_um:+9.3f} µm ({offset_um / 1000.0:+.6f} mm)"
                    f"  ; {what}"
                )
        lines.append("")
    return "\n".join(lines)


def _rows(operation: Operation) -> Iterator[tuple[float, float, float, float]]:
    columns = (operation.times_s, operation.durations_s, operation.corrections_um, operation.offsets_um)
    yield from zip(*(column.tolist() for column in columns), strict=True)


def _clock(time_s: float) -> str:
    # down, so that a correction read from here is never late
    seconds = int(time_s + 1e-6)
    return f"{seconds // 3600}:{seconds // 60 % 60:02d}:{seconds % 60:02d}"


def _tenths(time_s: float) -> float:
    """Minutes, rounded down to 0.1; what is less than 0.06 s before a tenth counts as that tenth (fitted curves)."""
    return math.floor(time_s / 6.0 + 0.01) / 10.0


def _ten_thousandths(time_s: float) -> float:
    return math.floor(time_s / 60.0 * 1e4 + 1e-4) / 1e4


def _minutes(minutes: float) -> str:
    text = f"{max(minutes, 0.0):.4f}".rstrip("0").rstrip(".")
    return text or "0"


def _short(value: float) -> str:
    text = f"{value:.1f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def _one_line(text: str) -> str:
    return "".join(sign if sign.isprintable() else " " for sign in text)
