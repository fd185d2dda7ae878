"""Limits and sign of the correction that every program needs: as the model file decides them, or cautious ones."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass

from selector.controllers.finding_table import FINDINGS
from selector.controllers.guard.codes import LONGEST_S, TEST_S
from selector.controllers.model_file import ModelFile, Output, OutputLimits, Sign, with_signs
from selector.controllers.self_check import output_bound_um
from selector.errors import OptionError
from selector.findings import Finding

CAUTIOUS_SLEW_UM_PER_S = 1.0
"""As HEIDENHAIN's controls follow an external correction: below what a finishing cut shows."""


@dataclass(frozen=True)
class DecidedLimits:
    """Limits of the correction of one output."""

    clamp_um: float  #: Largest magnitude of the correction at the reference position, and of the whole
    slew_um_per_s: float  #: Largest change of the correction at any place that the axis stands at
    dead_band_um: float = 0.0  #: Smaller changes are not passed on
    slope_clamp_um_per_m: float = 0.0  #: Largest magnitude of the slope; 0 without a position-dependent part
    #: Largest distance of a valid position from the reference; 0 without a position-dependent part
    reach_m: float = 0.0

    @property
    def slope_slew_um_per_m_s(self) -> float:
        """Largest change of the slope: at the far end of the axis it takes half of the slew limit."""
        return 0.5 * self.slew_um_per_s / self.reach_m if self.reach_m > 0.0 else 0.0

    @property
    def own_slew_um_per_s(self) -> float:
        """Largest change of the position-independent part: what the slope leaves."""
        return 0.5 * self.slew_um_per_s if self.reach_m > 0.0 else self.slew_um_per_s


def decided_limits(model: ModelFile) -> tuple[dict[str, DecidedLimits], tuple[Finding, ...]]:
    """Limits per output, and a finding for each that the model file leaves open.

    An open clamp is what the model can give within its valid ranges; an open slew is `CAUTIOUS_SLEW_UM_PER_S`.
    """
    given = {limits.output: limits for limits in model.guard.limits}
    decided, findings = {}, []
    for output in model.outputs:
        limits = given.get(output.name, OutputLimits(output=output.name))
        reach_m = 0.0 if output.position is None else output.position.reach_m
        clamp_um = limits.clamp_um or _open_clamp_um(model, output)
        slope_clamp = 0.0 if reach_m == 0.0 else limits.slope_clamp_um_per_m or clamp_um / reach_m
        slew = limits.slew_um_per_s or CAUTIOUS_SLEW_UM_PER_S
        decided[output.name] = DecidedLimits(clamp_um, slew, limits.dead_band_um, slope_clamp, reach_m)
        open_ones, options = [], []
        if limits.clamp_um is None:
            open_ones.append(f"at most ±{clamp_um:g} µm (the largest that the model gives in its valid ranges)")
            options.append(f"--clamp {output.name}={clamp_um:g}")
        if limits.slew_um_per_s is None:
            open_ones.append(f"no faster than {slew:g} µm/s (slow enough for a finishing cut)")
            options.append(f"--slew {output.name}={slew:g}")
        if open_ones:
            findings.append(
                FINDINGS.finding(
                    "limit-not-decided",
                    f"Nobody has decided how far and how fast {output.name} may be corrected. The program was written "
                    f"with {' and '.join(open_ones)}.",
                    evidence={"output": output.name, "clamp_um": clamp_um, "slew_um_per_s": slew},
                    suggestion=f"if that suits the machine, say so: {' '.join(options)}; else give other numbers",
                )
            )
    return decided, tuple(findings)


def longest_test_s(model: ModelFile) -> float:
    """For so long a program follows what is commanded for the sign test: its way there, and `TEST_S`."""
    decided, _ = decided_limits(model)
    # a slope takes half of the slew limit
    way_s = max(2.0 * of.clamp_um / of.slew_um_per_s for of in decided.values())
    return min(TEST_S + way_s, LONGEST_S)


def valid_positions_m(model: ModelFile) -> dict[str, tuple[float, float]]:
    """Per axis, the positions [m] that every position-dependent part over it has seen."""
    found: dict[str, tuple[float, float]] = {}
    for part in (output.position for output in model.outputs if output.position is not None):
        low, high = found.get(part.axis, (part.valid_min_m, part.valid_max_m))
        found[part.axis] = max(low, part.valid_min_m), min(high, part.valid_max_m)
    return found


def with_decided_limits(model: ModelFile) -> ModelFile:
    """The model with nothing left open in the limits of its corrections: what its programs have."""
    decided, _ = decided_limits(model)
    limits = tuple(
        OutputLimits(
            output=name,
            clamp_um=of.clamp_um,
            slew_um_per_s=of.slew_um_per_s,
            dead_band_um=of.dead_band_um,
            slope_clamp_um_per_m=of.slope_clamp_um_per_m or None,
        )
        for name, of in decided.items()
    )
    return model.model_copy(update={"guard": model.guard.model_copy(update={"limits": limits})})


def _open_clamp_um(model: ModelFile, output: Output) -> float:
    bound_um = output_bound_um(model, output)
    return float(max(1.0, math.ceil(bound_um))) if bound_um < 1e6 else 1e6


WITH: Sign = "correction = displacement"


def is_turned(output: Output) -> bool:
    """Whether the control counts the axis the other way: its correction is the displacement itself."""
    return output.sign == WITH


def with_turned_signs(model: ModelFile, outputs: Collection[str]) -> ModelFile:
    """The model with the corrections of these outputs turned round, whatever the file says of them; others stay.

    Displacements, and so the formulas and test vectors, stay as they are. Naming an output twice is naming it once, so
    that the same words give the same program from the model and from the copy of it that an export leaves.

    Raises
    ------
    OptionError
        The model has no such output.
    """
    names = [output.name for output in model.outputs]
    for name in outputs:
        if name not in names:
            raise OptionError(
                f"no output {name!r}",
                expected="one of " + ", ".join(names),
                where="--invert",
                advice="correct the name",
            )

    return with_signs(model, lambda output: WITH if output.name in outputs else output.sign)
