"""FANUC custom macro B: a subprogram that computes the correction and writes it to the external work offset.

Temperatures and the time come into common variables (FOCAS or PMC). The guard is smaller than that of the model file:
what is missing is said as a finding and at the head of the program. What the macro language itself allows is from
general knowledge, so that the installation asks for a look into the manual.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from textwrap import wrap

from selector.controllers.guard.codes import LARGEST_NUMBER, LONGEST_S, LONGEST_STEP_S, Mode
from selector.controllers.guard.decided import DecidedLimits, decided_limits
from selector.controllers.model_file import Input, ModelFile, Output, Term
from selector.controllers.model_io import model_sha256
from selector.controllers.program.text_of_program import plain
from selector.controllers.self_check import output_bound_um
from selector.controllers.sensor_check import CODE_SLACK, RANGE_SLACK
from selector.controllers.writers.exported import Exported
from selector.controllers.writers.heading import heading
from selector.controllers.writers.refused import ExportRefusedError
from selector.findings import Finding

FILE = "O9100.nc"
PROGRAM = 9100
LONGEST_BLOCK = 72
SIGNIFICANT_DIGITS = 12
"""Of a literal; the model has its inputs centred and scaled, so that 12 digits cost 1e-10 µm at 100 µm."""
LITERAL_ROUNDOFF = 5e-12
"""Largest relative rounding of a literal."""

TIME = 100
"""Common variable with the time of the readings [s]; the readings follow it."""

LAST_VOLATILE, FIRST_KEPT, LAST_KEPT = 199, 500, 999
LINEAR_AXES = "XYZUVW"

_TOTAL, _PRODUCT, _CHANGE, _DT, _SLEWED, _SINCE = 1, 2, 3, 4, 5, 6
_MODEL, _LAST_CALL, _LAST_SAMPLE, STATUS, _FAULTY, _HAS_BEGUN = range(FIRST_KEPT, FIRST_KEPT + 6)
_FAULT, _MOVE, _END = 800, 850, 900


@dataclass(frozen=True)
class MacroVariables:
    """Numbers of the common variables of a model.

    Attributes
    ----------
    readings, z : dict of str to int
        Per input; per input and state (volatile).
    starts : dict of str to int
        Per input that is a rise (kept).
    levels : dict of (source, tau_s) to int
        Memory (kept).
    aims, corrections : dict of str to int
        Per output [um] (kept).
    """

    readings: dict[str, int]
    z: dict[str, int]
    starts: dict[str, int]
    levels: dict[tuple[str, float], int]
    aims: dict[str, int]
    corrections: dict[str, int]


def fanuc_export(model: ModelFile, *, is_sign_verified: bool = False) -> Exported:
    """``O9100.nc``.

    Raises
    ------
    ExportRefusedError
        Too many variables, an output without a linear axis, two outputs of one axis, or a number out of reach.
    """
    names = macro_variables(model)
    left_out = list(_left_out(model))
    _, open_limits = decided_limits(model)
    return Exported(
        files={FILE: _program(model, names, left_out, is_sign_verified=is_sign_verified)},
        install=(
            "Check in the manual of the control: custom macro B is there; common variables "
            f"#{TIME}-#{max(names.z.values(), default=TIME)} and #{FIRST_KEPT}-#{max(names.corrections.values())} "
            f"are there, free, and those from #{FIRST_KEPT} outlive power-off; literals may have {SIGNIFICANT_DIGITS} "
            "digits; G10 L2 P0 is the external work offset; comments of capital letters stand in ( ).",
            f"Let FOCAS (cnc_wrmacro) or the PMC write #{TIME} = time of the readings [s], a clock that runs on, and "
            + ", ".join(f"#{number} = {plain(name)} [{_unit(model, name)}]" for name, number in names.readings.items())
            + "; a sensor without a reading is written as the code of its amplifier, never as its last value.",
            f"Load {FILE}, call it with M98 P{PROGRAM} in millimetres (G21) between cuts, at most once a second; it "
            "leaves G90 on. On a lathe with G-code system A, G90 is a turning cycle: take G90 out there. Programs "
            "O9000 to O9999 may be protected, and X may be a diameter: check in the manual.",
            f"After each call #{STATUS} says 1 model, 2 hold, 3 ramp to zero, and #{_FAULTY} which reading is bad.",
            f"Set #{_HAS_BEGUN} = 0 to take new start readings at a cold start.",
        ),
        silently=(
            "The external work offset is overwritten: whatever else was in it is gone.",
            "The first call of another model begins at zero: what the one before it had written is taken back at once.",
            "The offset takes effect in blocks after the call, and stays when nobody calls the program any more: a "
            f"feeding program that has died is seen only as #{TIME} standing still.",
            "Called rarely, the correction catches up with at most "
            f"{LONGEST_STEP_S:g} s worth of its slew limit a call.",
        ),
        findings=(*_findings(model, left_out), *open_limits),
    )


def macro_variables(model: ModelFile) -> MacroVariables:
    """Which common variables the program of a model uses.

    Raises
    ------
    ExportRefusedError
        There are not so many.
    """
    volatile = iter(range(TIME + 1, 10_000))
    kept = iter(range(_HAS_BEGUN + 1, 10_000))
    taus = sorted({(state.source, state.tau_s) for state in model.states})
    variables = [*(item.name for item in model.inputs), *(state.name for state in model.states)]
    names = MacroVariables(
        readings={item.name: next(volatile) for item in model.inputs},
        z={name: next(volatile) for name in variables},
        starts={item.name: next(kept) for item in model.inputs if item.reference == "rise"},
        levels={key: next(kept) for key in taus},
        aims={output.name: next(kept) for output in model.outputs},
        corrections={output.name: next(kept) for output in model.outputs},
    )
    for used, last in ((max(names.z.values()), LAST_VOLATILE), (max(names.corrections.values()), LAST_KEPT)):
        if used > last:
            raise ExportRefusedError(
                f"the model needs common variables up to #{used}",
                expected=f"at most #{last}",
                where="FANUC custom macro B",
                advice="choose fewer sensors, or compute the correction outside the control (target c or python)",
            )
    return names


def literal(value: float) -> str:
    """A number without an exponent, in `SIGNIFICANT_DIGITS`: ``6.0476``, ``10.``, ``[1.5/100000.]``.

    Raises
    ------
    ExportRefusedError
        It is too large or too small to be written.
    """
    if value == 0.0:
        return "0."
    if not 1e-20 <= abs(value) < 1e20:
        raise ExportRefusedError(
            f"the number {value:g}",
            expected="magnitudes from 1e-20 to 1e20",
            where="FANUC custom macro B",
            advice="find out which coefficient, centre or scale of the model file is so large or small",
        )
    if 0.1 <= abs(value) < 1e9:
        return _with_point(f"{value:.{SIGNIFICANT_DIGITS}g}")
    mantissa, exponent = f"{value:.{SIGNIFICANT_DIGITS - 1}e}".split("e")
    mantissa = _with_point(mantissa.rstrip("0"))
    power, sign = abs(int(exponent)), "/" if int(exponent) < 0 else "*"
    steps = [min(10, power - done) for done in range(0, power, 10)]
    return f"[{mantissa}{''.join(f'{sign}1{0:0{step}d}.' for step in steps)}]"


def remarks(text: str) -> Iterator[str]:
    """Comment blocks: capital letters, digits and few signs, so that nothing can end a comment or a block."""
    harmless = re.sub(r"[^A-Z0-9 .,+\-*/=]", " ", re.sub("[:;]", ",", plain(text).upper()))
    yield from (f"({line})" for line in wrap(harmless, LONGEST_BLOCK - 2))


def _with_point(text: str) -> str:
    return text if "." in text else f"{text}."


def _minus(value: float) -> str:
    return f"-{literal(value)}" if value >= 0.0 else f"+{literal(-value)}"


def _unit(model: ModelFile, name: str) -> str:
    return next(item.unit for item in model.inputs if item.name == name)


def _on_fault(model: ModelFile) -> str:
    guard = model.guard
    return guard.without_fallback if guard.on_fault == "fallback" else guard.on_fault


def _left_out(model: ModelFile) -> Iterator[str]:
    guard = model.guard
    if any(item.rate_limit_per_min is not None for item in model.inputs):
        yield "a reading that jumps is not found"
    if guard.stuck_after_s is not None:
        yield "a sensor that stands still is not found"
    if guard.recover_after_s > 0.0:
        yield "a sensor that is good again is used at once"
    if guard.on_fault == "fallback":
        yield f"no fallback models, with a bad sensor it does {guard.without_fallback}"
    if guard.hold_at_most_s is not None and _on_fault(model) == "hold":
        yield "it holds the last value for ever"
    if guard.restart == "new-start" or guard.new_start_after_s is not None:
        yield f"new start readings only with #{_HAS_BEGUN} = 0"
    for output in model.outputs:
        if output.position is not None:
            yield f"position-dependent part of {output.name}: the work offset is the same at every position"
    yield "no enabling by a switch"


def _findings(model: ModelFile, left_out: Sequence[str]) -> Iterator[Finding]:
    yield Finding(
        "guard-reduced",
        "warning",
        f"Custom macro B has a smaller guard than the model file asks for: {'; '.join(left_out)}.",
        evidence={"left_out": list(left_out)},
        suggestion="let the program that feeds the temperatures watch the sensors, or run the whole model there",
    )
    for output in model.outputs:
        if output.position is not None:
            without = output.model_copy(update={"position": None})
            lost_um = output_bound_um(model, output) - output_bound_um(model, without)
            yield Finding(
                "position-part-left-out",
                "warning",
                f"{output.name}: the external work offset cannot follow the position; up to {lost_um:.3g} µm at the "
                "far end of the axis are not corrected.",
                evidence={"output": output.name, "lost_um": lost_um},
                suggestion="use the offset near the reference position only, or a control with a slope of its own",
            )


def _program(model: ModelFile, names: MacroVariables, left_out: Sequence[str], *, is_sign_verified: bool) -> str:
    limits, _ = decided_limits(model)
    axes = _axes(model)
    lines = ["%", f"O{PROGRAM}(THERMAL CORRECTION)"]
    for line in heading(model, is_sign_verified=is_sign_verified):
        lines += remarks(line)
    for line in left_out:
        lines += remarks(f"Left out - {line}")
    lines += remarks(f"NO. {TIME} - time of the readings in s, a clock that runs on")
    for item in model.inputs:
        lines += remarks(f"NO. {names.readings[item.name]} - {item.name} in {item.unit}")
    for output in model.outputs:
        lines += remarks(f"NO. {names.corrections[output.name]} - correction for {output.name} in um")
    lines += _begun(model, names)
    for k, item in enumerate(model.inputs, 1):
        lines += _checked(model, item, k, names)
    lines += _remembered(model, names)
    for output in model.outputs:
        lines += _aimed(output, limits[output.name], names)
    lines += _faulted(model, names)
    for output in model.outputs:
        lines += _moved(output, axes[output.name], limits[output.name], names)
    lines += [f"N{_END}", "M99", "%"]
    return "\n".join(lines) + "\n"


def _axes(model: ModelFile) -> dict[str, str]:
    axes = {output.name: (output.axis or "").upper() for output in model.outputs}
    for name, axis in axes.items():
        is_shared = list(axes.values()).count(axis) > 1
        if len(axis) != 1 or axis not in LINEAR_AXES or is_shared:
            raise ExportRefusedError(
                f"output {name} has " + (f"the axis {axis}" if axis else "no axis") + (", as another" * is_shared),
                expected=f"one linear axis ({', '.join(LINEAR_AXES)}) for one output",
                where="FANUC custom macro B, outputs",
                advice="name the axis of the output in the model file, or leave the output out",
            )
    return axes


def _begun(model: ModelFile, names: MacroVariables) -> Iterator[str]:
    number = literal(float(int(model_sha256(model)[:6], 16)))
    yield f"IF[#{TIME}EQ#0]GOTO{_END}"
    yield f"IF[#{_MODEL}EQ{number}]GOTO10"
    yield from remarks("first call of this model")
    yield f"#{_MODEL}={number}"
    yield f"#{_LAST_CALL}=#{TIME}"
    yield f"#{_HAS_BEGUN}=0."
    yield from (f"#{kept}=0." for of in (names.aims, names.corrections) for kept in of.values())
    yield "N10"
    yield f"#{_DT}=#{TIME}-#{_LAST_CALL}"
    yield f"IF[#{_DT}LT0.]THEN#{_DT}=0."
    yield f"#{_LAST_CALL}=#{TIME}"
    yield f"#{_SLEWED}=#{_DT}"
    yield f"IF[#{_SLEWED}GT{literal(LONGEST_STEP_S)}]THEN#{_SLEWED}={literal(LONGEST_STEP_S)}"


def _checked(model: ModelFile, item: Input, k: int, names: MacroVariables) -> Iterator[str]:
    """Jumps to the fault, or leaves x in the variable of z."""
    reading, x = names.readings[item.name], names.z[item.name]
    yield from remarks(item.name)
    yield f"#{_FAULTY}={literal(float(k))}"
    yield f"IF[#{reading}EQ#0]GOTO{_FAULT}"
    yield f"IF[ABS[#{reading}]GT{literal(LARGEST_NUMBER)}]GOTO{_FAULT}"
    for code in model.guard.break_codes if item.unit == "degC" else ():
        yield f"IF[ABS[#{reading}{_minus(code)}]LE{literal(CODE_SLACK * abs(code))}]GOTO{_FAULT}"
    if item.reading_min is not None:
        yield f"IF[#{reading}LT{literal(item.reading_min)}]GOTO{_FAULT}"
    if item.reading_max is not None:
        yield f"IF[#{reading}GT{literal(item.reading_max)}]GOTO{_FAULT}"
    if item.reference == "absolute":
        yield f"#{x}=#{reading}"
    else:
        yield f"#{x}=0."
        yield f"IF[#{_HAS_BEGUN}EQ1.]THEN#{x}=#{reading}-#{names.starts[item.name]}"
    if model.guard.outside_valid_range == "fault":
        slack = RANGE_SLACK * (item.valid_max - item.valid_min)
        yield f"IF[#{x}LT{literal(item.valid_min - slack)}]GOTO{_FAULT}"
        yield f"IF[#{x}GT{literal(item.valid_max + slack)}]GOTO{_FAULT}"
    low, high = literal(item.valid_min), literal(item.valid_max)
    yield f"IF[#{x}LT{low}]THEN#{x}={low}"
    yield f"IF[#{x}GT{high}]THEN#{x}={high}"


def _remembered(model: ModelFile, names: MacroVariables) -> Iterator[str]:
    """All sensors are good: start readings, memory, z."""
    yield from remarks("start readings and memory")
    yield f"#{_FAULTY}=0."
    yield f"#{STATUS}={literal(float(Mode.MODEL))}"
    for name, start in names.starts.items():
        yield f"IF[#{_HAS_BEGUN}NE1.]THEN#{start}=#{names.readings[name]}"
    yield f"IF[#{_HAS_BEGUN}NE1.]THEN#{_LAST_SAMPLE}=#{TIME}"
    yield f"#{_SINCE}=#{TIME}-#{_LAST_SAMPLE}"
    yield f"IF[#{_SINCE}LT0.]THEN#{_SINCE}=0."
    yield f"IF[#{_SINCE}GT{literal(LONGEST_S)}]THEN#{_SINCE}={literal(LONGEST_S)}"
    yield f"#{_LAST_SAMPLE}=#{TIME}"
    for (source, tau_s), level in names.levels.items():
        x = names.z[source]
        yield f"IF[#{_HAS_BEGUN}NE1.]THEN#{level}=#{x}"
        yield f"#{_PRODUCT}=#{_SINCE}/[{literal(tau_s)}+#{_SINCE}]"
        yield f"#{level}=#{level}+#{_PRODUCT}*[#{x}-#{level}]"
    yield f"#{_HAS_BEGUN}=1."
    for state in model.states:
        level = names.levels[state.source, state.tau_s]
        yield f"#{names.z[state.name]}=[#{level}{_minus(state.centre)}]/{literal(state.scale)}"
    for item in model.inputs:
        z = names.z[item.name]
        if (item.centre, item.scale) != (0.0, 1.0):
            yield f"#{z}=[#{z}{_minus(item.centre)}]/{literal(item.scale)}"


def _aimed(output: Output, limits: DecidedLimits, names: MacroVariables) -> Iterator[str]:
    yield from remarks(f"displacement {output.name}")
    yield f"#{_TOTAL}={literal(output.intercept)}"
    for term in output.terms:
        yield from _product(term, names)
        yield f"#{_TOTAL}=#{_TOTAL}+#{_PRODUCT}"
    aim, clamp, band = names.aims[output.name], literal(limits.clamp_um), limits.dead_band_um
    yield f"#{_TOTAL}=-#{_TOTAL}"
    yield f"IF[#{_TOTAL}LT-{clamp}]THEN#{_TOTAL}=-{clamp}"
    yield f"IF[#{_TOTAL}GT{clamp}]THEN#{_TOTAL}={clamp}"
    if band == 0.0:
        yield f"#{aim}=#{_TOTAL}"
    else:
        yield f"#{_CHANGE}=ABS[#{_TOTAL}-#{aim}]"
        yield f"IF[#{_CHANGE}GE{literal(band)}]THEN#{aim}=#{_TOTAL}"


def _product(term: Term, names: MacroVariables) -> Iterator[str]:
    """In blocks that are not too long."""
    block = f"#{_PRODUCT}={literal(term.coefficient)}"
    for name, power in term.powers.items():
        for _ in range(power):
            factor = f"*#{names.z[name]}"
            if len(block) + len(factor) > LONGEST_BLOCK:
                yield block
                block = f"#{_PRODUCT}=#{_PRODUCT}"
            block += factor
    yield block


def _faulted(model: ModelFile, names: MacroVariables) -> Iterator[str]:
    is_ramped = _on_fault(model) == "ramp-to-zero"
    yield f"GOTO{_MOVE}"
    yield f"N{_FAULT}"
    yield from remarks("a reading is bad - the aim goes to zero" if is_ramped else "a reading is bad - the aim stays")
    yield f"#{STATUS}={literal(float(Mode.RAMP_TO_ZERO if is_ramped else Mode.HOLD))}"
    if is_ramped:
        yield from (f"#{aim}=0." for aim in names.aims.values())
    yield f"N{_MOVE}"


def _moved(output: Output, axis: str, limits: DecidedLimits, names: MacroVariables) -> Iterator[str]:
    aim, now = names.aims[output.name], names.corrections[output.name]
    yield from remarks(f"axis {axis} - no faster than {limits.slew_um_per_s:g} um/s")
    yield f"#{_CHANGE}={literal(limits.slew_um_per_s)}*#{_SLEWED}"
    yield f"#{_TOTAL}=#{aim}"
    yield f"IF[#{_TOTAL}LT[#{now}-#{_CHANGE}]]THEN#{_TOTAL}=#{now}-#{_CHANGE}"
    yield f"IF[#{_TOTAL}GT[#{now}+#{_CHANGE}]]THEN#{_TOTAL}=#{now}+#{_CHANGE}"
    yield f"#{now}=#{_TOTAL}"
    yield f"G90G10L2P0{axis}[#{now}/1000.]"
