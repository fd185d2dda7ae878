"""Bosch Rexroth IndraDrive: the axis correction in the drive, one temperature and straight lines only.

With the reference temperature T0 (P-0-0402) the drive computes from its temperature T and the position x
    correction value = P-0-0407 · (T − T0) + P-0-0406 · (T − T0) · (x − x0).
A correction value is measured position − actual position, so that it has the sign of the displacement, not of the
correction of the axis. Units, and the parameters of T and x0, are to be looked up in the manual.
"""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

from selector.controllers.evaluator import Equations, Polynomial, physical_coefficients, physical_slopes
from selector.controllers.finding_table import FINDINGS
from selector.controllers.guard.decided import is_turned
from selector.controllers.model_file import Input, ModelFile, Output
from selector.controllers.program.language import plain
from selector.controllers.writers.exported import Exported, ExportRefusedError, heading, with_sheet
from selector.findings import Finding

FILE = "indradrive_axis_correction.txt"
LARGEST_LOSS_UM = 0.1  #: What the drive's formula may leave of the model at most inside its valid ranges.
_NEGLIGIBLE = 1e-12


@dataclass(frozen=True)
class DriveParameters:
    """The drive's formula for one output."""

    source: str  #: Name of the temperature
    shift_k: float  #: T0 − start reading (a rise), or T0 itself (absolute)
    um_per_k: float  #: P-0-0407
    um_per_m_k: float  #: P-0-0406; 0 without a position-dependent part
    zero_m: float  #: x0
    loss_um: float  #: Largest difference to the model inside the valid ranges


def rexroth_export(model: ModelFile, *, is_sign_verified: bool = False) -> Exported:
    """``indradrive_axis_correction.txt``."""
    found = {output.name: drive_parameters(model, output) for output in model.outputs}
    lines = [f"; {line}" for line in heading(model, is_sign_verified=is_sign_verified)]
    for output in model.outputs:
        lines += _table(model, output, found[output.name])
    return with_sheet("rexroth", model, {FILE: "\n".join(lines) + "\n"}, _findings(model, found), file=FILE)


def drive_parameters(model: ModelFile, output: Output) -> DriveParameters:
    """The drive's formula for one output of a model."""
    item = _only_temperature(model, output)
    own = _line(output, item, physical_coefficients(model)[output.name])
    part = output.position
    slope = (0.0, 0.0) if part is None else _line(output, item, physical_slopes(model)[output.name])
    if part is not None and output.axis is not None and part.axis != output.axis:
        raise _refused(
            output, f"axis {output.axis} depends on the position of {part.axis}", "the position of the same axis"
        )
    reach_m = 0.0 if part is None else part.reach_m
    # the reference temperature is where the larger of the two parts is zero
    constant, gain = own if abs(own[1]) >= abs(slope[1]) * reach_m else slope
    if gain == 0.0:
        raise _refused(output, "a correction that does not depend on the temperature", "a straight line in it")
    zero = -constant / gain
    loss_um = abs(own[0] + own[1] * zero) + abs(slope[0] + slope[1] * zero) * reach_m
    if loss_um > LARGEST_LOSS_UM:
        raise _refused(
            output,
            f"{loss_um:.3g} um that stay where the temperature is at its reference, at a part of the axis",
            f"all parts zero at one reference temperature, within {LARGEST_LOSS_UM:g} um",
        )
    return DriveParameters(item.name, zero, own[1], slope[1], 0.0 if part is None else part.reference_m, loss_um)


def _refused(output: Output, found: str, expected: str) -> ExportRefusedError:
    return ExportRefusedError(
        f"output {output.name}: {found}",
        expected=expected,
        where="IndraDrive axis correction",
        advice="fit a model with one sensor, of degree 1 and without memory (selector select --max-sensors 1 "
        "--degree 1), or compute the correction in the control",
    )


def _only_temperature(model: Equations, output: Output) -> Input:
    names = dict.fromkeys(name for term in output.all_terms for name in term.powers)
    used = [item for item in model.inputs if item.name in names]
    if len(used) != 1 or len(names) != 1:
        raise _refused(output, f"it depends on {', '.join(names) or 'nothing'}", "one temperature, without memory")
    if used[0].unit != "degC":
        raise _refused(output, f"{used[0].name} is in {used[0].unit}", "a temperature")
    return used[0]


def _line(output: Output, item: Input, of: Polynomial) -> tuple[float, float]:
    """(constant, factor of the temperature)."""
    constant, terms = of
    reach = max(abs(item.valid_min), abs(item.valid_max))
    curved = sum(
        abs(value) * reach ** sum(power for _, power in key) for key, value in terms.items() if key != ((item.name, 1),)
    )
    if curved > _NEGLIGIBLE * sum(abs(value) for value in terms.values()) * max(1.0, reach):
        raise _refused(output, f"powers of {item.name} worth {curved:.3g} um", "a straight line in the temperature")
    return constant, terms.get(((item.name, 1),), 0.0)


def _table(model: ModelFile, output: Output, found: DriveParameters) -> Iterator[str]:
    item = next(item for item in model.inputs if item.name == found.source)
    name = plain(found.source)
    reference = f"{found.shift_k:.4f} degC"
    if item.reference == "rise":
        reference = f"start reading of {name} {'+' if found.shift_k >= 0.0 else '-'} {abs(found.shift_k):.4f} K"
    yield ""
    yield f"; output {plain(output.name)}, axis {plain(output.axis or 'not named')}, temperature {name}"
    yield f"P-0-0402  reference temperature           {reference}"
    sign = -1.0 if is_turned(output) else 1.0
    steep, own = sign * found.um_per_m_k, sign * found.um_per_k
    yield f"P-0-0406  position-dependent factor       {steep:.6g} um/(m*K)  = {steep * 1e-6:.6g} 1/K"
    yield f"P-0-0407  position-independent factor     {own:.6g} um/K  = {own * 1e-3:.6g} mm/K"
    if found.um_per_m_k != 0.0:
        yield f"x0        there the first part is zero    {found.zero_m * 1000.0:.4f} mm"
    yield f"; valid for x of {name} from {item.valid_min:g} to {item.valid_max:g}, loss {found.loss_um:.2g} um"


def _findings(model: ModelFile, found: dict[str, DriveParameters]) -> Iterator[Finding]:
    yield FINDINGS.finding(
        "guard-missing",
        "The drive has nothing of the guard: no check of the sensor, no valid range, no clamp, no slew limit.",
    )
    for item, (name, parameters) in itertools.product(model.inputs, found.items()):
        if item.name == parameters.source and item.reference == "rise":
            yield FINDINGS.finding(
                "reference-is-start-reading",
                f"{name} follows the rise of {item.name} since the start: P-0-0402 is the start reading "
                f"{'+' if parameters.shift_k >= 0.0 else '−'} {abs(parameters.shift_k):.3g} K, to be written anew at "
                "every cold start.",
                evidence={"output": name, "input": item.name, "shift_k": parameters.shift_k},
            )
