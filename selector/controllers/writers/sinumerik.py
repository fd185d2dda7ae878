"""SINUMERIK 840D sl: the model in SCL for its PLC, and what the NC's own temperature compensation needs of it.

The NC adds a straight line per axis, dK = K0 + tan(beta) (P - P0): K0, tan(beta) and P0 are setting data 43900, 43910
and 43920 (Siemens, Function Manual K3 "Compensations"). The PLC (S7-300) has no LREAL.

Who writes them: the PLC hands the values over in the memory that it shares with the NC, where static synchronised
actions take them; the manuals that bear this out stand in the head of their file. A word says whose turn it is: only
two bytes arrive whole, and whoever waits for the other in vain knows that it stands still.
"""

import re
import textwrap
from collections.abc import Iterator, Mapping
from itertools import count

import numpy as np

from selector.controllers.finding_table import FINDINGS
from selector.controllers.guard.decided import decided_limits
from selector.controllers.model_file import ModelFile, Output
from selector.controllers.program.guarded_program import guarded_program
from selector.controllers.program.language import Place, Program, Real, Writing, plain
from selector.controllers.single_precision import single_precision_findings
from selector.controllers.writers.exported import Exported, ExportRefusedError, filled, require_own_axes, with_sheet
from selector.controllers.writers.structured_text import BLOCK, NAME, SECTIONS, StructuredText, block_text, head_lines
from selector.csv_text import csv_text
from selector.findings import Finding
from selector.text_file import shell_word

BLOCK_OF_SETTING_DATA = "FB_ThermalToSD"
SETTING_DATA = "thermal_to_sd.scl"
SETTINGS = "sinumerik_settings.csv"
BLOCK_OF_HANDOVER = "FB_ThermalHandover"
HANDOVER = "thermal_handover.scl"
ACTIONS = "thermal_sd.spf"
FIRST_ACTION = 101  #: Number of the first synchronised action.
FIRST_VALUE = 8  #: Where the values stand in the shared memory of PLC and NC; a K0 and a slope, 4 bytes each, per axis.
STALE_S = 5.0  #: After so long without the other side, PLC and NC say so.
#: Default of MD32760 $MA_COMP_ADD_VELO_FACTOR: share of the axis velocity, and largest slope [mm/mm].
ADD_VELO_FACTOR = 0.01
VELOCITY_MM_PER_MIN = 10_000.0  #: MD32000 $MA_MAX_AX_VELO of the manual's worked example.
IPO_S = 0.012  #: Interpolation cycle of the manual's worked example.
MM_PER_UM, MM_PER_MM_PER_UM_PER_M, MM_PER_M = 0.001, 1e-6, 1000.0
# an instance data block is retentive as a whole
_SECTIONS: Mapping[Place, str] = {**SECTIONS, "retained": "VAR"}

#: Largest change of the compensation in one interpolation cycle; what is more waits for the next cycles.
STEP_MM = VELOCITY_MM_PER_MIN * ADD_VELO_FACTOR / 60.0 * IPO_S
#: Largest tan(beta) [mm/mm]: the largest step over the way of the axis in one cycle at its full velocity.
LARGEST_SLOPE = STEP_MM / (VELOCITY_MM_PER_MIN / 60.0 * IPO_S)


def sinumerik_export(model: ModelFile, *, is_sign_verified: bool = False) -> Exported:
    """SCL in REAL, the setting data in their units, and a table of what to set on the control."""
    require_own_axes(model, "SINUMERIK setting data, outputs")
    _require_axis_names(model)
    head = head_lines(model, is_sign_verified=is_sign_verified)
    said = [part for line in head[1:-1] for part in textwrap.wrap(line[3:], 100, subsequent_indent="    ")]
    return with_sheet(
        "sinumerik",
        model,
        {
            f"{NAME}.scl": scl_text(model, is_sign_verified=is_sign_verified),
            SETTING_DATA: _scl(setting_data_program(model), BLOCK_OF_SETTING_DATA, head),
            HANDOVER: filled("sinumerik_handover", head="\n * ".join(said), block=BLOCK_OF_HANDOVER, stale=STALE_S),
            ACTIONS: _actions(model, said),
            SETTINGS: _settings(model),
        },
        findings=(*_limit_findings(model), *_axis_findings(model), *single_precision_findings(model, f"{NAME}.scl")),
        block=BLOCK,
        setter=BLOCK_OF_SETTING_DATA,
        settings=SETTINGS,
        handover=BLOCK_OF_HANDOVER,
        actions=ACTIONS,
        first_value=FIRST_VALUE,
        stale_s=STALE_S,
        step_mm=STEP_MM,
        cycle_s=IPO_S,
        mm_per_min=VELOCITY_MM_PER_MIN,
        factor=ADD_VELO_FACTOR,
        slope=LARGEST_SLOPE,
        um_per_m=LARGEST_SLOPE * 1e6,
    )


def scl_text(model: ModelFile, *, is_sign_verified: bool = False) -> str:
    """The text of ``thermal_correction.scl``."""
    return _scl(guarded_program(model), BLOCK, head_lines(model, is_sign_verified=is_sign_verified))


def setting_data_program(model: ModelFile) -> Program:
    """From the outputs of the guarded program to setting data: um to mm, um/m to mm/mm, m to mm."""
    w = Writing()
    for k, output in enumerate(model.outputs, start=1):
        axis = output.axis_or_name
        source = "k0" if has_own_line(output) or output.position is None else "correction"
        value = w.variable(f"{source}_{k}", "real", "input", f"as {BLOCK} gives it [um]")
        steep = w.variable(f"slope_{k}", "real", "input", "[um/m]") if has_own_line(output) else None
        k0 = w.variable(f"sd43900_{k}", "real", "output", f"axis {axis}: K0 [mm]")
        tan_beta = w.variable(f"sd43910_{k}", "real", "output", f"axis {axis}: tan(beta) [mm/mm]")
        reference = w.variable(f"sd43920_{k}", "real", "output", f"axis {axis}: P0 [mm]")
        w.assign(k0, value * MM_PER_UM)
        w.assign(tan_beta, Real(0.0) if steep is None else steep * MM_PER_MM_PER_UM_PER_M)
        w.assign(reference, _reference_mm(output))
    return w.program(model.name)


def _actions(model: ModelFile, said: list[str]) -> str:
    """Static synchronised actions of the NC: what is within the limits of the guard is taken over, all axes at once."""
    n, limits, axes = len(model.outputs), decided_limits(model)[0], []
    for k, output in enumerate(model.outputs, 1):
        of, at = limits[output.name], FIRST_VALUE + 8 * (k - 1)
        most = of.clamp_um * MM_PER_UM, of.slope_clamp_um_per_m * MM_PER_MM_PER_UM_PER_M * has_own_line(output)
        # strictly below, and as a REAL
        edges = (_decimal(1.000001 * value + 1e-9) for value in most)
        of_axis = {"axis": output.axis_or_name, "reference": _decimal(_reference_mm(output)), "at": at, "next": at + 4}
        values = {**dict(zip(("most", "steepest"), edges, strict=True)), **of_axis, "k": k, "good": k + 1}
        axes.append(filled("sinumerik_axis", whole=n + 1, **values).rstrip().split("\n---\n"))
    layout, checks, taken = map(list, zip(*axes, strict=True))
    ends = {"whole": n + 1, "stale": f"{STALE_S:g}", "first": FIRST_ACTION, "last": FIRST_ACTION + 2 * n + 3}
    text = filled("sinumerik_actions", head="\n; ".join(said), layout=layout, checks=checks, taken=taken, **ends)
    number = count(FIRST_ACTION)
    return re.sub("^WHENEVER", lambda _: f"IDS={next(number)} WHENEVER", text, flags=re.MULTILINE)


def _decimal(value: float) -> str:
    return np.format_float_positional(value, precision=15, trim="-")


def _require_axis_names(model: ModelFile) -> None:
    words = filled("sinumerik_words").split()
    for output in model.outputs:
        name = output.axis_or_name
        if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]{0,30}", name) or name.upper() in words:
            raise ExportRefusedError(
                f"axis {name!r} of output {output.name!r}",
                expected="the name of an axis as the NC has it: ≤ 31 letters, digits, _; no digit first; no NC word",
                where="SINUMERIK synchronised actions, outputs",
                advice="name the axis of the output in the model file (outputs.axis)",
            )


def _scl(program: Program, block: str, head: list[str]) -> str:
    return block_text(head, program, StructuredText(real_type="REAL"), f'"{block}"', _SECTIONS, "BEGIN")


def has_own_line(output: Output) -> bool:
    """Whether the slope is over the position of the corrected axis itself, as the NC calculates it."""
    return output.position is not None and output.position.axis == output.axis_or_name


def _reference_mm(output: Output) -> float:
    part = output.position
    return part.reference_m * MM_PER_M if part is not None and has_own_line(output) else 0.0


def _settings(model: ModelFile) -> str:
    """One line per datum: comma separated, ASCII."""
    table: list[tuple[str, ...]] = []
    sign = "SIGN: prove on the machine that +0.010 mm in SD43900 moves the axis 10 um towards +"
    for k, output in enumerate(model.outputs, start=1):
        axis = plain(output.axis_or_name)
        has_line = has_own_line(output)
        source = "k0" if has_line or output.position is None else "correction"
        rows = (
            ("MD32750 $MA_TEMP_COMP_TYPE", "3" if has_line else "1", "",
             "bit 0: position-independent; bit 1: position-dependent; takes effect at power on"),
            ("MD32760 $MA_COMP_ADD_VELO_FACTOR", f"{ADD_VELO_FACTOR:g}", "",
             f"more than {STEP_MM:.4g} mm per interpolation cycle is spread without alarm; a slope above "
             f"{LARGEST_SLOPE:.4g} mm/mm is clipped without alarm; MD36200 (velocity limit) must allow for it"),
            ("SD43900 $SA_TEMP_COMP_ABS_VALUE", f"sd43900_{k}", "mm", f"K0 = {source}_{k} [um] x 0.001; {sign}"),
            ("SD43910 $SA_TEMP_COMP_SLOPE", f"sd43910_{k}", "mm/mm",
             f"tan(beta) = slope_{k} [um/m] x 0.000001" if has_line else "0"),
            ("SD43920 $SA_TEMP_COMP_REF_POSITION", f"{_reference_mm(output):.10g}", "mm", "P0"),
        )  # fmt: skip
        table += [(axis, *row) for row in rows]
    return csv_text(("axis", "datum", "value", "unit", "meaning"), table)


def _limit_findings(model: ModelFile) -> Iterator[Finding]:
    fastest_um_per_s = VELOCITY_MM_PER_MIN * ADD_VELO_FACTOR / 60.0 / MM_PER_UM
    steepest_um_per_m = LARGEST_SLOPE * 1e6
    for name, limits in decided_limits(model)[0].items():
        slew, slope = limits.slew_um_per_s, limits.slope_clamp_um_per_m
        if slew > fastest_um_per_s:
            yield FINDINGS.finding(
                "step-spread-silently",
                f"The correction of {name} may change by {slew:g} um/s; the control passes on {fastest_um_per_s:g} "
                f"um/s ({STEP_MM:.4g} mm per interpolation cycle) at an axis velocity of {VELOCITY_MM_PER_MIN:g} "
                "mm/min and spreads the rest over later cycles without an alarm.",
                evidence={"output": name, "slew_um_per_s": slew, "passed_um_per_s": fastest_um_per_s},
                suggestion=f"decide with --slew {shell_word(name)}=… below it; a thermal correction needs about 1 um/s",
            )
        if slope > steepest_um_per_m:
            yield FINDINGS.finding(
                "slope-clipped-silently",
                f"The slope of the correction of {name} may be {slope:g} um/m; the control clips at "
                f"{steepest_um_per_m:g} um/m (MD32760 = {ADD_VELO_FACTOR:g}) without an alarm.",
                evidence={"output": name, "slope_clamp_um_per_m": slope, "passed_um_per_m": steepest_um_per_m},
            )


def _axis_findings(model: ModelFile) -> Iterator[Finding]:
    for output in model.outputs:
        axis, part = output.axis_or_name, output.position
        if output.axis is None:
            yield FINDINGS.finding(
                "axis-not-named",
                f"The model file does not say which axis the displacement {output.name} belongs to; the table takes "
                f"{axis} for its name.",
                evidence={"output": output.name},
            )
        if part is not None and not has_own_line(output):
            yield FINDINGS.finding(
                "position-of-another-axis",
                f"The correction of {axis} depends on the position of {part.axis}; the control's straight line knows "
                f"only the position of {axis}. The whole correction goes into SD43900 and follows {part.axis} as often "
                "as the PLC writes it, without a slew limit of its own.",
                evidence={"output": output.name, "position_axis": part.axis},
            )
