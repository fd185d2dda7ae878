"""FANUC custom macro B: a subprogram that computes the correction and writes it to the external work offset."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from textwrap import wrap

from selector.controllers.evaluator import output_bound_um
from selector.controllers.finding_table import FINDINGS
from selector.controllers.guard.decided import (
    CODE_SLACK,
    LARGEST_NUMBER,
    LEAST_GOOD_SAMPLES,
    LONGEST_S,
    LONGEST_STEP_S,
    RANGE_SLACK,
    DecidedLimits,
    Mode,
    decided_limits,
    is_turned,
    longest_test_s,
)
from selector.controllers.model_file import Input, ModelFile, Output, kept_sha256
from selector.controllers.program.language import plain
from selector.controllers.writers.exported import Exported, ExportRefusedError, heading, sign_test
from selector.findings import Finding

LONGEST_BLOCK = 72
SIGNIFICANT_DIGITS = 12
"""Of a literal; the model has its inputs centred and scaled, so that 12 digits cost 1e-10 µm at 100 µm."""


LITERAL_ROUNDOFF = 5e-12
"""Largest relative rounding of a literal."""


def literal(value: float) -> str:
    """A number without an exponent, in `SIGNIFICANT_DIGITS`: ``6.0476``, ``10.``, ``[1.5/100000.]``."""
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


def minus(value: float) -> str:
    """What is appended to subtract a number: ``-6.5``, or ``+6.5`` for −6.5."""
    return f"-{literal(value)}" if value >= 0.0 else f"+{literal(-value)}"


def remarks(text: str) -> Iterator[str]:
    """Comment blocks: capital letters, digits, few signs, [ ] for ( ), so that nothing can end a comment or a block."""
    bracketed = plain(text).upper().translate(str.maketrans("():;", "[],,"))
    harmless = re.sub(r"[^A-Z0-9 .,+\-*/=\[\]]", " ", bracketed)
    yield from (f"({line})" for line in wrap(harmless, LONGEST_BLOCK - 2))


def limited(variable: int, low: str, high: str) -> Iterator[str]:
    """The variable becomes low if below it, high if above it."""
    yield f"IF[#{variable}LT{low}]THEN#{variable}={low}"
    yield f"IF[#{variable}GT{high}]THEN#{variable}={high}"


def product(to: int, coefficient: float, factors: Sequence[int]) -> Iterator[str]:
    """A coefficient times variables, in blocks that are not too long."""
    block = f"#{to}={literal(coefficient)}"
    for variable in factors:
        factor = f"*#{variable}"
        if len(block) + len(factor) > LONGEST_BLOCK:
            yield block
            block = f"#{to}=#{to}"
        block += factor
    yield block


def _with_point(text: str) -> str:
    return text if "." in text else f"{text}."


def left_out_of_macro(model: ModelFile) -> Iterator[str]:
    """What the macro does not do, for its head and its finding."""
    guard = model.guard
    if any(item.rate_limit_per_min is not None for item in model.inputs):
        yield "a reading that jumps is not found"
    if guard.stuck_after_s is not None:
        yield "a sensor that stands still is not found"
    if len(model.inputs) > 1:
        yield "while one sensor is bad or has to recover, all wait"
    if guard.on_fault == "fallback":
        yield f"no fallback models, with a bad sensor it does {guard.without_fallback}"
    if guard.hold_at_most_s is not None and guard.last_resort == "hold":
        yield "it holds the last value for ever"
    if any(item.reference == "rise" for item in model.inputs):
        yield "a control that was off for less than 10 minutes is not noticed, the time counts as a call"
    if guard.restart == "new-start" or guard.new_start_after_s is not None:
        yield f"new start readings only with #{_HAS_BEGUN} = 0"
    for output in model.outputs:
        if output.position is not None:
            yield f"position-dependent part of {output.name}: the work offset is the same at every position"
    yield "it does not know whether the drives are on and the axis is referenced"


def findings_of_macro(model: ModelFile, left_out: Sequence[str]) -> Iterator[Finding]:
    """What is left out of the guard, and of the model."""
    yield FINDINGS.finding(
        "guard-reduced",
        f"Custom macro B has a smaller guard than the model file asks for: {'; '.join(left_out)}.",
        evidence={"left_out": list(left_out)},
        suggestion="let the program that feeds the temperatures watch the sensors, or run the whole model there",
    )
    for output in model.outputs:
        if output.position is not None:
            without = output.model_copy(update={"position": None})
            lost_um = output_bound_um(model, output) - output_bound_um(model, without)
            yield FINDINGS.finding(
                "position-part-left-out",
                f"{output.name}: the external work offset cannot follow the position; up to {lost_um:.3g} µm at the "
                "far end of the axis are not corrected.",
                evidence={"output": output.name, "lost_um": lost_um},
            )


ABSOLUTE_OR_NOT, INCH_OR_MM = 4003, 4006
"""Modal information: G90 or G91 of group 03, G20 or G21 of group 06."""

_INCH, _MM = (20, 70), (21, 71)
"""What group 06 has; 70 and 71 in G-code system C of lathes."""

_GROUP_3, _UNITS = 31, 32
"""Local variables."""

_WRITE, _NO_UNIT, _NO_UVW = 20, 890, 891


def offset_asked(axes: Collection[str]) -> Iterator[str]:
    """Jumps to an alarm where the control cannot be told what is meant, before anything is changed."""
    yield from remarks("inch or mm, absolute or incremental")
    yield f"#{_UNITS}=0."
    yield from (f"IF[#{INCH_OR_MM}EQ{code}.]THEN#{_UNITS}=1000." for code in _MM)
    yield from (f"IF[#{INCH_OR_MM}EQ{code}.]THEN#{_UNITS}=25400." for code in _INCH)
    yield f"IF[#{_UNITS}EQ0.]GOTO{_NO_UNIT}"
    yield f"#{_GROUP_3}=#{ABSOLUTE_OR_NOT}"
    if set(axes) & set("UVW"):
        # in G-code system A of lathes U, V and W are increments of X, Y and Z
        yield f"IF[[#{_GROUP_3}-90.]*[#{_GROUP_3}-91.]NE0.]GOTO{_NO_UVW}"


def offset_written(corrections: Mapping[str, int]) -> Iterator[str]:
    """Per axis the correction [µm] of a variable, in absolute values; G90 and G91 are as before afterwards."""
    yield from remarks("external work offset")
    yield f"IF[#{_GROUP_3}NE91.]GOTO{_WRITE}"
    yield "G90"
    yield f"N{_WRITE}"
    yield from (f"G10L2P0{axis}[#{variable}/#{_UNITS}]" for axis, variable in corrections.items())
    yield f"IF[#{_GROUP_3}NE91.]GOTO{_END}"
    yield "G91"
    yield f"GOTO{_END}"
    yield f"N{_NO_UNIT}"
    yield "#3000=101(NEITHER INCH NOR MM)"
    if set(corrections) & set("UVW"):
        yield f"N{_NO_UVW}"
        yield "#3000=102(U V W IN G-CODE SYSTEM A)"


FILE = "O9100.nc"
PROGRAM = 9100
TIME = 100
"""Common variable with the time of the readings [s]; the readings follow it."""

LAST_VOLATILE, FIRST_KEPT, LAST_KEPT = 199, 500, 999
LINEAR_AXES = "XYZUVW"

LONGEST_PAUSE_S = 600.0
"""Between two calls; after a longer one the control was off, or might have been, and readings have to be good anew."""

_TOTAL, _PRODUCT, _CHANGE, _DT, _SLEWED, _SINCE, _IS_TEST, _FIRST_TESTED = range(1, 9)
_MODEL, _LAST_CALL, _LAST_SAMPLE, STATUS, _FAULTY, _HAS_BEGUN, _GOOD_FOR = range(FIRST_KEPT, FIRST_KEPT + 7)
_SWITCHED_OFF = literal(float(Mode.SWITCHED_OFF))
_BEGIN, _JUDGED, _FAULT, _WAIT, _MOVE, _END = 30, 31, 800, 810, 850, 900
_IS_BEGUN, _IS_CANDIDATE, _NOT_GOOD = "1.", "2.", "-1."
"""Of start readings: believed, or good so far, but not yet for long enough; of the time for which all are good."""


@dataclass(frozen=True)
class MacroVariables:
    """Numbers of the common variables of a model."""

    #: readings, z and tests: Per input; per input and state; per output, for the sign test (volatile)
    readings: dict[str, int]
    z: dict[str, int]
    tests: dict[str, int]
    off: int  #: Not 0: no correction is wanted (volatile)
    test_left: int  #: A sign test may go on for so long [s] (volatile)
    starts: dict[str, int]  #: Per input that is a rise (kept)
    levels: dict[tuple[str, float], int]  #: Memory (kept)
    #: aims and corrections: Per output [um] (kept)
    aims: dict[str, int]
    corrections: dict[str, int]


def fanuc_export(model: ModelFile, *, is_sign_verified: bool = False) -> Exported:
    """``O9100.nc``."""
    names = macro_variables(model)
    left_out = list(left_out_of_macro(model))
    first, tests, corrections = model.outputs[0].name, list(names.tests.values()), list(names.corrections.values())
    _, open_limits = decided_limits(model)
    return Exported(
        files={FILE: _program(model, names, left_out, is_sign_verified=is_sign_verified)},
        install=(
            "Check in the manual of the control: custom macro B is there; common variables "
            f"#{TIME}-#{names.test_left} and #{FIRST_KEPT}-#{max(names.corrections.values())} "
            f"are there, free, and those from #{FIRST_KEPT} outlive power-off; literals may have {SIGNIFICANT_DIGITS} "
            "digits; G10 L2 P0 is the external work offset; comments of capital letters stand in ( ).",
            f"Let FOCAS (cnc_wrmacro) or the PMC write #{TIME} = time of the readings [s], a clock that runs on, and "
            + ", ".join(f"#{number} = {plain(name)} [{_unit(model, name)}]" for name, number in names.readings.items())
            + "; a sensor without a reading is written as the code of its amplifier, never as its last value.",
            f"Load {FILE}, call it with G65 P{PROGRAM} between cuts, at most once a second (M98 would share the local "
            "variables of the caller). It asks the control for G20 or G21 and writes inches or mm; G90 and G91 "
            "are as before afterwards, and are not touched where they are something else (lathes, G-code system A). "
            "Programs O9000 to O9999 may be protected, and X may be a diameter: check in the manual.",
            f"After each call #{STATUS} says 1 model, 2 hold, 3 ramp to zero, 4 switched off, 5 sign test, and "
            f"#{_FAULTY} which reading is bad.",
            f"After {LONGEST_PAUSE_S / 60.0:g} min without a call (the control was off) no reading is believed at "
            f"once, as after a bad one: before the first cut of a day call the program {LEAST_GOOD_SAMPLES + 2} times, "
            f"{max(1.0, model.guard.recover_after_s / LEAST_GOOD_SAMPLES):g} s apart or more.",
            f"Set #{_HAS_BEGUN} = 0 to take new start readings at a cold start; it is 2 until all readings have been "
            f"good for {model.guard.recover_after_s:g} s, then 1.",
        ),
        sign_test=sign_test(
            model,
            f"#{TIME} runs on. Set #{names.off} = 1 (no correction) and #{names.tests[first]} ... = 0; call "
            f"G65 P{PROGRAM} once a second until #{names.corrections[first]} ... are 0. In MDI, command the axis to a "
            "place in the work coordinate system. No sensor is needed.",
            lambda k, um: f"#{tests[k - 1]} = {um:g}, then G65 P{PROGRAM} once a second, then the same place again",
            lambda k, um: f"#{STATUS} = {Mode.TEST:d}, #{corrections[k - 1]} = {um:g}",
            f"Set #{names.tests[first]} ... to 0, call G65 P{PROGRAM} until the corrections are 0, then set "
            f"#{names.off} = 0.",
        ),
        silently=(
            "The external work offset is overwritten: whatever else was in it is gone.",
            "The first call of another model begins at zero: what the one before it had written is taken back at once.",
            "The offset takes effect in blocks after the call, and stays when nobody calls the program any more: a "
            f"feeding program that has died is seen only as #{TIME} standing still.",
            "Called rarely, the correction catches up with at most "
            f"{LONGEST_STEP_S:g} s worth of its slew limit a call.",
        ),
        findings=(*findings_of_macro(model, left_out), *open_limits),
    )


def macro_variables(model: ModelFile) -> MacroVariables:
    """Which common variables the program of a model uses."""
    volatile = iter(range(TIME + 1, 10_000))
    kept = iter(range(_GOOD_FOR + 1, 10_000))
    taus = sorted({(state.source, state.tau_s) for state in model.states})
    variables = [*(item.name for item in model.inputs), *(state.name for state in model.states)]
    names = MacroVariables(
        readings={item.name: next(volatile) for item in model.inputs},
        z={name: next(volatile) for name in variables},
        tests={output.name: next(volatile) for output in model.outputs},
        off=next(volatile),
        test_left=next(volatile),
        starts={item.name: next(kept) for item in model.inputs if item.reference == "rise"},
        levels={key: next(kept) for key in taus},
        aims={output.name: next(kept) for output in model.outputs},
        corrections={output.name: next(kept) for output in model.outputs},
    )
    for used, last in ((names.test_left, LAST_VOLATILE), (max(names.corrections.values()), LAST_KEPT)):
        if used > last:
            raise ExportRefusedError(
                f"the model needs common variables up to #{used}",
                expected=f"at most #{last}",
                where="FANUC custom macro B",
                advice="choose fewer sensors, or compute the correction outside the control (target c or python)",
            )
    return names


def _unit(model: ModelFile, name: str) -> str:
    return next(item.unit for item in model.inputs if item.name == name)


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
        lines += remarks(f"NO. {names.tests[output.name]} - sign test of {output.name}, not 0 commands so much in um")
    lines += remarks(f"NO. {names.off} - not 0 switches off, the correction goes to zero")
    lines += [f"IF[#{TIME}EQ#0]GOTO{_END}", *offset_asked(axes.values())]
    lines += _begun(model, names)
    lines += _kept_checked(model, names)
    lines += remarks("after a pause, or a clock put back, nothing is believed at once")
    lines += [f"#{_FAULTY}=0.", f"IF[#{_DT}LT0.]GOTO{_FAULT}", f"IF[#{_DT}GT{literal(LONGEST_PAUSE_S)}]GOTO{_FAULT}"]
    for k, item in enumerate(model.inputs, 1):
        lines += _checked(model, item, k, names)
    lines += _remembered(model, names)
    for output in model.outputs:
        lines += _aimed(output, limits[output.name], names)
    lines += _faulted(model, names)
    written = {axes[name]: variable for name, variable in names.corrections.items()}
    lines += _tested(limits, names, longest_test_s(model))
    for k, output in enumerate(model.outputs):
        lines += _moved(output, axes[output.name], limits[output.name], names, _FIRST_TESTED + k)
    lines += [*offset_written(written), f"N{_END}", "M99", "%"]
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
    number = literal(float(int(kept_sha256(model)[:6], 16)))
    yield f"IF[#{_MODEL}EQ{number}]GOTO10"
    yield from remarks("first call of this model")
    yield f"#{_MODEL}={number}"
    yield f"#{_LAST_CALL}=#{TIME}"
    yield f"#{_HAS_BEGUN}=0."
    yield f"#{_GOOD_FOR}={_NOT_GOOD}"
    yield f"#{names.test_left}=0."
    yield from (f"#{kept}=0." for of in (names.aims, names.corrections) for kept in of.values())
    yield "N10"
    yield f"#{_DT}=#{TIME}-#{_LAST_CALL}"
    yield f"#{_LAST_CALL}=#{TIME}"
    yield f"#{_SLEWED}=#{_DT}"
    yield f"IF[#{_SLEWED}LT0.]THEN#{_SLEWED}=0."
    yield f"IF[#{_SLEWED}GT{literal(LONGEST_S)}]THEN#{_SLEWED}=0."
    yield f"IF[#{STATUS}EQ{literal(float(Mode.TEST))}]THEN#{names.test_left}=#{names.test_left}-#{_SLEWED}"
    yield f"IF[#{_SLEWED}GT{literal(LONGEST_STEP_S)}]THEN#{_SLEWED}={literal(LONGEST_STEP_S)}"


def _kept_checked(model: ModelFile, names: MacroVariables) -> Iterator[str]:
    """A start that is no reading begins all anew."""
    for item in (item for item in model.inputs if item.reference == "rise"):
        start, low, high = names.starts[item.name], item.reading_min, item.reading_max
        yield f"IF[#{start}LT{literal(-LARGEST_NUMBER if low is None else low)}]THEN#{_HAS_BEGUN}=0."
        yield f"IF[#{start}GT{literal(LARGEST_NUMBER if high is None else high)}]THEN#{_HAS_BEGUN}=0."


def _checked(model: ModelFile, item: Input, k: int, names: MacroVariables) -> Iterator[str]:
    """Jumps to the fault, or leaves x in the variable of z."""
    reading, x = names.readings[item.name], names.z[item.name]
    yield from remarks(item.name)
    yield f"#{_FAULTY}={literal(float(k))}"
    yield f"IF[#{reading}EQ#0]GOTO{_FAULT}"
    yield f"IF[ABS[#{reading}]GT{literal(LARGEST_NUMBER)}]GOTO{_FAULT}"
    for code in model.guard.break_codes if item.unit == "degC" else ():
        yield f"IF[ABS[#{reading}{minus(code)}]LE{literal(CODE_SLACK * abs(code))}]GOTO{_FAULT}"
    if item.reading_min is not None:
        yield f"IF[#{reading}LT{literal(item.reading_min)}]GOTO{_FAULT}"
    if item.reading_max is not None:
        yield f"IF[#{reading}GT{literal(item.reading_max)}]GOTO{_FAULT}"
    if item.reference == "absolute":
        yield f"#{x}=#{reading}"
    else:
        yield f"#{x}=0."
        yield f"IF[#{_HAS_BEGUN}EQ{_IS_BEGUN}]THEN#{x}=#{reading}-#{names.starts[item.name]}"
    if model.guard.outside_valid_range == "fault":
        slack = RANGE_SLACK * (item.valid_max - item.valid_min)
        yield f"IF[#{x}LT{literal(item.valid_min - slack)}]GOTO{_FAULT}"
        yield f"IF[#{x}GT{literal(item.valid_max + slack)}]GOTO{_FAULT}"
    yield from limited(x, literal(item.valid_min), literal(item.valid_max))


def _remembered(model: ModelFile, names: MacroVariables) -> Iterator[str]:
    """All sensors are good: start readings and memory once they have been so for long enough, z."""
    yield from remarks("start readings")
    yield f"#{_FAULTY}=0."
    rises = [item for item in model.inputs if item.reference == "rise"]
    yield f"IF[#{_HAS_BEGUN}EQ{_IS_BEGUN}]GOTO{_BEGIN}"
    yield f"IF[#{_HAS_BEGUN}NE{_IS_CANDIDATE}]THEN#{_GOOD_FOR}={_NOT_GOOD}"
    for item in rises:
        yield f"#{_CHANGE}=ABS[#{names.readings[item.name]}-#{names.starts[item.name]}]"
        yield f"IF[#{_CHANGE}GT{literal(item.valid_max - item.valid_min)}]THEN#{_GOOD_FOR}={_NOT_GOOD}"
    yield f"N{_BEGIN}"
    most = literal(model.guard.recover_after_s / LEAST_GOOD_SAMPLES)
    yield f"IF[#{_DT}GT{most}]THEN#{_DT}={most}"
    yield f"#{_GOOD_FOR}=#{_GOOD_FOR}+#{_DT}"
    yield f"IF[#{_GOOD_FOR}GE#{_DT}]GOTO{_JUDGED}"
    yield f"#{_GOOD_FOR}=0."
    yield f"IF[#{_HAS_BEGUN}EQ{_IS_BEGUN}]GOTO{_JUDGED}"
    for item in rises:
        yield f"#{names.starts[item.name]}=#{names.readings[item.name]}"
        yield f"#{names.z[item.name]}=0."
        yield from limited(names.z[item.name], literal(item.valid_min), literal(item.valid_max))
    yield from (f"#{level}=#{names.z[source]}" for (source, _), level in names.levels.items())
    yield f"#{_LAST_SAMPLE}=#{TIME}"
    yield f"#{_HAS_BEGUN}={_IS_CANDIDATE}"
    yield f"N{_JUDGED}"
    yield f"IF[#{_GOOD_FOR}LT{literal(model.guard.recover_after_s)}]GOTO{_WAIT}"
    yield f"#{STATUS}={literal(float(Mode.MODEL))}"
    yield f"#{_HAS_BEGUN}={_IS_BEGUN}"
    for item in rises:
        yield f"#{names.z[item.name]}=#{names.readings[item.name]}-#{names.starts[item.name]}"
        yield from limited(names.z[item.name], literal(item.valid_min), literal(item.valid_max))
    yield from remarks("memory")
    yield f"#{_SINCE}=#{TIME}-#{_LAST_SAMPLE}"
    yield f"IF[#{_SINCE}LT0.]THEN#{_SINCE}=0."
    yield f"IF[#{_SINCE}GT{literal(LONGEST_S)}]THEN#{_SINCE}={literal(LONGEST_S)}"
    yield f"#{_LAST_SAMPLE}=#{TIME}"
    ranges = {item.name: (item.valid_min, item.valid_max) for item in model.inputs}
    for (source, tau_s), level in names.levels.items():
        low, high = ranges[source]
        slack = RANGE_SLACK * (high - low)
        yield f"IF[#{level}LT{literal(low - slack)}]THEN#{level}=#{names.z[source]}"
        yield f"IF[#{level}GT{literal(high + slack)}]THEN#{level}=#{names.z[source]}"
        yield f"#{_PRODUCT}=#{_SINCE}/[{literal(tau_s)}+#{_SINCE}]"
        yield f"#{level}=#{level}+#{_PRODUCT}*[#{names.z[source]}-#{level}]"
    for state in model.states:
        level = names.levels[state.source, state.tau_s]
        yield f"#{names.z[state.name]}=[#{level}{minus(state.centre)}]/{literal(state.scale)}"
    for item in model.inputs:
        z = names.z[item.name]
        if (item.centre, item.scale) != (0.0, 1.0):
            yield f"#{z}=[#{z}{minus(item.centre)}]/{literal(item.scale)}"


def _aimed(output: Output, limits: DecidedLimits, names: MacroVariables) -> Iterator[str]:
    yield from remarks(f"displacement {output.name}")
    yield f"#{_TOTAL}={literal(output.intercept)}"
    for term in output.terms:
        factors = [names.z[name] for name, power in term.powers.items() for _ in range(power)]
        yield from product(_PRODUCT, term.coefficient, factors)
        yield f"#{_TOTAL}=#{_TOTAL}+#{_PRODUCT}"
    aim, clamp, band = names.aims[output.name], literal(limits.clamp_um), limits.dead_band_um
    if not is_turned(output):
        yield f"#{_TOTAL}=-#{_TOTAL}"
    yield from limited(_TOTAL, f"-{clamp}", clamp)
    if band == 0.0:
        yield f"#{aim}=#{_TOTAL}"
    else:
        yield f"#{_CHANGE}=ABS[#{_TOTAL}-#{aim}]"
        yield f"IF[#{_CHANGE}GE{literal(band)}]THEN#{aim}=#{_TOTAL}"


def _faulted(model: ModelFile, names: MacroVariables) -> Iterator[str]:
    is_ramped = model.guard.last_resort == "ramp-to-zero"
    yield f"GOTO{_MOVE}"
    yield f"N{_FAULT}"
    yield f"#{_GOOD_FOR}={_NOT_GOOD}"
    yield f"N{_WAIT}"
    yield from remarks("not all are good - the aim goes to zero" if is_ramped else "not all are good - the aim stays")
    yield f"#{STATUS}={literal(float(Mode.RAMP_TO_ZERO if is_ramped else Mode.HOLD))}"
    if is_ramped:
        yield from (f"#{aim}=0." for aim in names.aims.values())
    yield f"N{_MOVE}"


def _tested(limits: Mapping[str, DecidedLimits], names: MacroVariables, longest_s: float) -> Iterator[str]:
    """What is commanded by hand, 0 if nothing is."""
    yield from remarks("switched off")
    yield f"IF[#{names.off}EQ#0]THEN#{names.off}=0."
    yield f"IF[#{names.off}NE0.]THEN#{STATUS}={_SWITCHED_OFF}"
    yield from remarks("sign test - only after all were 0, and not for ever, else to zero")
    yield f"#{_IS_TEST}=0."
    for k, (name, test) in enumerate(names.tests.items(), _FIRST_TESTED):
        clamp = literal(limits[name].clamp_um)
        yield f"#{k}=0."
        yield f"IF[#{test}NE#0]THEN#{k}=#{test}"
        yield f"IF[ABS[#{k}]GT{literal(LARGEST_NUMBER)}]THEN#{k}=0."
        yield f"IF[#{k}NE0.]THEN#{_IS_TEST}=1."
        yield from limited(k, f"-{clamp}", clamp)
    left = names.test_left
    yield f"IF[#{_IS_TEST}EQ0.]THEN#{left}={literal(longest_s)}"
    yield f"IF[#{left}EQ#0]THEN#{left}=0."
    yield f"IF[#{_IS_TEST}EQ1.]THEN#{STATUS}={_SWITCHED_OFF}"
    yield f"IF[#{left}LE0.]THEN#{_IS_TEST}=0."
    yield f"IF[#{_IS_TEST}EQ1.]THEN#{STATUS}={literal(float(Mode.TEST))}"


def _moved(output: Output, axis: str, limits: DecidedLimits, names: MacroVariables, tested: int) -> Iterator[str]:
    aim, now = names.aims[output.name], names.corrections[output.name]
    yield from remarks(f"axis {axis} - no faster than {limits.slew_um_per_s:g} um/s")
    yield f"#{_CHANGE}={literal(limits.slew_um_per_s)}*#{_SLEWED}"
    yield f"#{_TOTAL}=#{aim}"
    yield f"IF[#{STATUS}EQ{_SWITCHED_OFF}]THEN#{_TOTAL}=0."
    yield f"IF[#{_IS_TEST}EQ1.]THEN#{_TOTAL}=#{tested}"
    yield from limited(_TOTAL, f"[#{now}-#{_CHANGE}]", f"[#{now}+#{_CHANGE}]")
    yield f"#{now}=#{_TOTAL}"
