"""What a guarded program says, the numbers that are the same everywhere, and limits and sign of the correction."""

import math
from collections.abc import Collection
from dataclasses import dataclass
from enum import IntEnum

from selector.controllers.closed_values import Sign
from selector.controllers.evaluator import output_bound_um
from selector.controllers.finding_table import FINDINGS
from selector.controllers.model_file import ModelFile, Output, OutputLimits, with_signs
from selector.errors import OptionError
from selector.findings import Finding
from selector.json_text import fields_of
from selector.recording import named_by_axis
from selector.text_file import shell_word

LARGEST_NUMBER = 1e9  #: What is beyond it, in whatever unit, is no reading, no position and no correction.
#: Clocks stop there: what is added to a larger one is lost in single precision. A longer time between calls is none.
LONGEST_S = 1e6
#: Of time since the last call, for the slew limit: a program that was held up does not catch up in one jump.
LONGEST_STEP_S = 10.0
#: Readings are looked at so often at most: filled every millisecond, memory of hours stands still in binary32.
SAMPLE_S = 1.0
ANCHOR_S = 60.0  #: The rate of a reading is judged over a minute, so that noise and resolution are no jumps.
#: Of the time that a reading has to be good, one sample counts for this part at most: one wrong time proves nothing.
LEAST_GOOD_SAMPLES = 6
TEST_S = 600.0  #: A sign test that goes on for longer, its way not counted, was forgotten: the correction goes to zero.
#: A changed reading is believed again when it could have got there within this time; what jumped further never is.
FORGIVEN_S = 600.0
#: Over a standstill a memory is filled in 2^4 equal steps: one step would keep a fifth of it where 2 % are left.
GAP_STEPS_LOG2 = 4

RANGE_SLACK = 1e-9  #: Of the width of a valid range: the rounding of a difference of two readings is not an excess.
CODE_SLACK = 1e-6  #: Relative: break codes pass through float32 (6e-8) and decimal text on their way into a recording.


class SensorCode(IntEnum):
    """State of one sensor; up to LIMITED its reading is used."""

    OK = 0
    LIMITED = 1  #: Beyond what the model has seen, used as if at the end of its valid range.
    RECOVERING = 2  #: Good again, but not yet for long enough.
    MISSING = 3
    BREAK_CODE = 4
    OUT_OF_LIMITS = 5
    JUMP = 6
    STUCK = 7
    OUTSIDE_VALID_RANGE = 8


class Mode(IntEnum):
    """What the correction follows; FALLBACK + k: the k-th fallback model (from 0)."""

    OFF = 0  #: The axis is not ready: no correction, at once.
    MODEL = 1
    HOLD = 2
    RAMP_TO_ZERO = 3
    SWITCHED_OFF = 4  #: The operator does not want the correction, or has forgotten a test value: ramped to zero.
    TEST = 5  #: A value is commanded by hand, for the sign test: the program goes there, its other outputs to zero.
    FALLBACK = 10


def mode_words(mode: int, model: ModelFile) -> str:
    """What a correction follows, in words, e.g. ``"fallback without T1"``."""
    if Mode.FALLBACK <= mode < Mode.FALLBACK + len(model.fallbacks):
        return f"fallback without {', '.join(model.fallbacks[mode - Mode.FALLBACK].without)}"
    return Mode(mode).name.lower().replace("_", " ")


class TouchCode(IntEnum):
    """What became of the last touch-off of an output."""

    NONE = 0
    BELIEVED = 1
    DOUBTED = 2  #: Too far from what was expected; a second one that agrees with it is believed.
    UNUSED = 3  #: It came when the model was not in force.


#: As HEIDENHAIN's controls follow an external correction: below what a finishing cut shows.
CAUTIOUS_SLEW_UM_PER_S = 1.0


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
            options.append(f"--clamp {shell_word(output.name)}={clamp_um:g}")
        if limits.slew_um_per_s is None:
            open_ones.append(f"no faster than {slew:g} µm/s (slow enough for a finishing cut)")
            options.append(f"--slew {shell_word(output.name)}={slew:g}")
        if open_ones:
            how = "how far and how fast" if len(open_ones) > 1 else "how far" if limits.clamp_um is None else "how fast"
            findings.append(
                FINDINGS.finding(
                    "limit-not-decided",
                    f"Nobody has decided {how} {output.name} may be corrected. The program was written "
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
            **fields_of(of, "clamp_um", "slew_um_per_s", "dead_band_um"),
            slope_clamp_um_per_m=of.slope_clamp_um_per_m or None,
        )
        for name, of in decided.items()
    )
    return model.model_copy(update={"guard": model.guard.model_copy(update={"limits": limits})})


def _open_clamp_um(model: ModelFile, output: Output) -> float:
    bound_um = output_bound_um(model, output)
    for of in () if model.adaptation is None else model.adaptation.outputs:
        if of.output == output.name:
            bound_um += of.offset_limit_um + of.gain_limit * bound_um
    return float(max(1.0, math.ceil(bound_um))) if bound_um < 1e6 else 1e6


WITH: Sign = "correction = displacement"


def is_turned(output: Output) -> bool:
    """Whether the control counts the axis the other way: its correction is the displacement itself."""
    return output.sign == WITH


def with_turned_signs(model: ModelFile, outputs: Collection[str]) -> ModelFile:
    """The model with the corrections of these outputs turned round, whatever the file says of them; others stay.

    Displacements, and so the formulas and test vectors, stay as they are. Naming an output twice is naming it once, so
    that the same words give the same program from the model and from the copy of it that an export leaves.
    """
    turned = [named_output(model, name, "--invert") for name in outputs]
    return with_signs(model, lambda output: WITH if output.name in turned else output.sign)


def named_output(model: ModelFile, name: str, option: str) -> str:
    """The output that an option names, by its own name or by its axis. Raises OptionError: there is none."""
    axes = {output.name: output.axis for output in model.outputs}
    found = named_by_axis(name, axes)
    if found not in axes:
        expected = "one of " + ", ".join(axes)
        raise OptionError(f"no output {name!r}", expected=expected, where=option, advice="correct the name")
    return found
