"""FANUC custom macro B: a subprogram that computes the correction and writes it to the external work offset."""

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from textwrap import wrap
from typing import Any

from selector.controllers.evaluator import output_bound_um
from selector.controllers.finding_table import FINDINGS
from selector.controllers.guard.decided import LEAST_GOOD_SAMPLES, LONGEST_S, LONGEST_STEP_S, SAMPLE_S, decided_limits
from selector.controllers.model_file import Fallback, ModelFile, kept_sha256
from selector.controllers.program import language
from selector.controllers.program.guarded_program import guarded_program
from selector.controllers.writers.exported import Exported, ExportRefusedError, heading, require_own_axes, with_sheet
from selector.findings import Finding

LONGEST_BLOCK = 72
#: Of a literal: as many as older controls take. The model has its inputs centred and scaled: they cost 1e-6 µm at 100.
SIGNIFICANT_DIGITS = 8


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
    plainly = f"{value:.{SIGNIFICANT_DIGITS}g}"
    if abs(value) >= 0.1 and "e" not in plainly:
        return _with_point(plainly)
    mantissa, exponent = f"{value:.{SIGNIFICANT_DIGITS - 1}e}".split("e")
    mantissa = _with_point(mantissa.rstrip("0"))
    power, sign = abs(int(exponent)), "/" if int(exponent) < 0 else "*"
    most = SIGNIFICANT_DIGITS - 1
    steps = [min(most, power - done) for done in range(0, power, most)]
    return f"[{mantissa}{''.join(f'{sign}1{0:0{step}d}.' for step in steps)}]"


def literal_value(value: float) -> float:
    """What a control makes of `literal`."""
    first, *others = re.split(r"([*/])", literal(value).strip("[]"))
    found = float(first)
    for sign, factor in zip(others[::2], others[1::2], strict=True):
        found = found * float(factor) if sign == "*" else found / float(factor)
    return found


def remarks(text: str) -> Iterator[str]:
    """Comment blocks: capital letters, digits, few signs, [ ] for ( ), so that nothing can end a comment or a block."""
    bracketed = language.plain(text).upper().translate(str.maketrans("():;", "[],,"))
    harmless = re.sub(r"[^A-Z0-9 .,+\-*/=\[\]]", " ", bracketed)
    yield from (f"({line})" for line in wrap(harmless, LONGEST_BLOCK - 2))


def _with_point(text: str) -> str:
    return text if "." in text else f"{text}."


def left_out_of_macro(model: ModelFile) -> Iterator[str]:
    """What the macro does not do, for its head and its finding."""
    guard = model.guard
    if any(item.reference == "rise" for item in model.inputs):
        yield "a control that was off for less than 10 minutes is not noticed, the time counts as a call"
    if guard.restart == "new-start" or guard.new_start_after_s is not None:
        yield "new start readings only by hand"
    for output in model.outputs:
        if output.position is not None:
            yield f"position-dependent part of {output.name}: the work offset is the same at every position"
    yield "it does not know whether the drives are on and the axis is referenced"


def macro_model(model: ModelFile) -> ModelFile:
    """What the macro computes: the model at the reference position."""

    def without_positions(of: ModelFile | Fallback) -> dict[str, Any]:
        return {"outputs": tuple(output.model_copy(update={"position": None}) for output in of.outputs)}

    fallbacks = tuple(one.model_copy(update=without_positions(one)) for one in model.fallbacks)
    return model.model_copy(update=without_positions(model) | {"fallbacks": fallbacks, "adaptation": None})


def findings_of_macro(model: ModelFile, left_out: Sequence[str]) -> Iterator[Finding]:
    """What is left out of the guard, and of the model."""
    yield FINDINGS.finding(
        "guard-reduced",
        f"Custom macro B has a smaller guard than the model file asks for: {'; '.join(left_out)}.",
        evidence={"left_out": list(left_out)},
        suggestion="let the program that feeds the temperatures watch the sensors, or run the whole model there",
    )
    yield from position_findings(model, "the external work offset")


def position_findings(model: ModelFile, what: str) -> Iterator[Finding]:
    """For each position-dependent part, what is lost: `what` moves the axis cannot follow its position."""
    for output in model.outputs:
        if output.position is not None:
            without = output.model_copy(update={"position": None})
            lost_um = output_bound_um(model, output) - output_bound_um(model, without)
            yield FINDINGS.finding(
                "position-part-left-out",
                f"{output.name}: {what} cannot follow the position; up to {lost_um:.3g} µm at the "
                "far end of the axis are not corrected.",
                evidence={"output": output.name, "lost_um": lost_um},
            )


ABSOLUTE_OR_NOT, INCH_OR_MM = 4003, 4006  #: Modal information: G90 or G91 of group 03, G20 or G21 of group 06.
_INCH, _MM = (20, 70), (21, 71)  #: What group 06 has; 70 and 71 in G-code system C of lathes.
_GROUP_3, _UNITS = 31, 32  #: Local variables.
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
TIME = 100  #: Common variable with the time of the readings [s]; the readings follow it.
LAST_VOLATILE, FIRST_KEPT, LAST_KEPT = 199, 500, 999
LINEAR_AXES = "XYZUVW"

#: Between two calls; after a longer one the control was off, or might have been, and readings have to be good anew.
LONGEST_PAUSE_S = 600.0
_MODEL, _LAST_CALL, STATUS = range(FIRST_KEPT, FIRST_KEPT + 3)
_FIRST_LABEL, _LAST_LABEL = 1000, 9999
_BEGUN, _CALLED, _END = 10, 11, 900
_NO_READING = literal(1e10)  #: Beyond what any reading can be.
_PART = 33  #: Local variable for part of a long product.


@dataclass(frozen=True)
class MacroVariables:
    """Numbers of the variables of a model."""

    readings: dict[str, int]  #: Per input (common, volatile)
    tests: dict[str, int]  #: Per output, for the sign test (common, volatile)
    off: int  #: Not 0: no correction is wanted (common, volatile)
    program: dict[str, int]  #: Of the guarded program, by their names
    last_volatile: int
    last_kept: int


class _MacroText(language.Language):
    """Expressions of custom macro B; brackets group, codes and flags are numbers."""

    def __init__(self, numbers: Mapping[str, int]) -> None:
        self.numbers = numbers

    def name(self, variable: language.Variable) -> str:
        return f"#{self.numbers[variable.name]}"

    def real(self, value: float) -> str:
        return literal(value)

    def flag(self, value: bool) -> str:
        return "1." if value else "0."

    def code(self, value: int) -> str:
        return f"{value}."

    def text(self, of: language.Expression) -> str:
        """A real number, a code or a flag that is no condition."""
        return self.expression(of).replace("(", "[").replace(")", "]").replace(" ", "")


class _Blocks:
    _OPPOSITE: Mapping[str, str] = {"<": "GE", "<=": "GT", ">": "LE", ">=": "LT", "==": "NE"}
    _SIGNS: Mapping[str, str] = {"<": "LT", "<=": "LE", ">": "GT", ">=": "GE", "==": "EQ"}

    def __init__(self, numbers: Mapping[str, int]) -> None:
        self._language = _MacroText(numbers)
        self._label = _FIRST_LABEL - 1

    def lines(self, body: Sequence[language.Statement]) -> Iterator[str]:
        for one in body:
            if isinstance(one, language.Remark):
                yield from remarks(one.text)
            elif isinstance(one, language.If):
                yield from self._branches(one)
            else:
                yield from self._assigned(one)

    def _assigned(self, one: language.Assign) -> Iterator[str]:
        to = self._language.name(one.to)
        if one.to.kind == "flag" and not isinstance(one.value, language.Variable | language.Flag):
            otherwise = self._next()
            yield f"{to}=0."
            yield from self._jumps(one.value, otherwise, when=False)
            yield f"{to}=1."
            yield f"N{otherwise}"
            return
        block = f"{to}={self._language.text(one.value)}"
        if len(block) <= LONGEST_BLOCK:
            yield block
            return
        if not isinstance(one.value, language.Operation) or one.value.sign != "+":
            raise ExportRefusedError(
                f"a block of {len(block)} characters",
                expected=f"at most {LONGEST_BLOCK}",
                where="FANUC custom macro B",
                advice="compute the correction outside the control (target c or python)",
            )
        # a sum plus a long product
        part, factor = "", one.value.right
        factors: list[language.Expression] = []
        while isinstance(factor, language.Operation) and factor.sign == "*":
            factors.insert(0, factor.right)
            factor = factor.left
        for of in [factor, *factors]:
            text = self._language.text(of)
            if len(f"#{_PART}={part}*{text}") > LONGEST_BLOCK:
                yield f"#{_PART}={part}"
                part = f"#{_PART}"
            part = f"{part}*{text}" if part else text
        yield f"#{_PART}={part}"
        yield f"{to}={self._language.text(one.value.left)}+#{_PART}"

    def _branches(self, one: language.If) -> Iterator[str]:
        if not any(isinstance(inner, language.Assign | language.If) for inner in (*one.then, *one.otherwise)):
            return
        short = self._short(one)
        if short:
            yield short
            return
        otherwise = self._next()
        yield from self._jumps(one.condition, otherwise, when=False)
        yield from self.lines(one.then)
        if one.otherwise:
            end = self._next()
            yield f"GOTO{end}"
            yield f"N{otherwise}"
            yield from self.lines(one.otherwise)
            otherwise = end
        yield f"N{otherwise}"

    def _short(self, one: language.If) -> str:
        """IF … THEN in one block; empty: it is more than that."""
        if len(one.then) != 1 or one.otherwise or not isinstance(one.then[0], language.Assign):
            return ""
        inner, condition = one.then[0], one.condition
        is_condition = inner.to.kind == "flag" and not isinstance(inner.value, language.Variable | language.Flag)
        if is_condition or not isinstance(condition, language.Operation) or condition.sign not in self._SIGNS:
            return ""
        block = f"IF[{self._compared(condition, self._SIGNS)}]THEN{next(iter(self._assigned(inner)))}"
        return block if len(block) <= LONGEST_BLOCK else ""

    def _jumps(self, condition: language.Expression, to: int, *, when: bool) -> Iterator[str]:
        """To a label if the condition is as said."""
        if isinstance(condition, language.Not):
            yield from self._jumps(condition.of, to, when=not when)
        elif isinstance(condition, language.Operation) and condition.sign in ("and", "or"):
            if (condition.sign == "or") == when:
                yield from self._jumps(condition.left, to, when=when)
                yield from self._jumps(condition.right, to, when=when)
            else:
                past = self._next()
                yield from self._jumps(condition.left, past, when=not when)
                yield from self._jumps(condition.right, to, when=when)
                yield f"N{past}"
        elif isinstance(condition, language.Operation):
            yield f"IF[{self._compared(condition, self._SIGNS if when else self._OPPOSITE)}]GOTO{to}"
        else:
            yield f"IF[{self._language.text(condition)}{'NE' if when else 'EQ'}0.]GOTO{to}"

    def _compared(self, of: language.Operation, signs: Mapping[str, str]) -> str:
        return f"{self._language.text(of.left)}{signs[of.sign]}{self._language.text(of.right)}"

    def _next(self) -> int:
        self._label += 1
        if self._label > _LAST_LABEL:
            raise ExportRefusedError(
                f"a program of more than {_LAST_LABEL - _FIRST_LABEL} branches",
                expected="fewer sensors or fallbacks",
                where="FANUC custom macro B",
                advice="choose fewer sensors, or compute the correction outside the control (target c or python)",
            )
        return self._label


def fanuc_export(model: ModelFile, *, is_sign_verified: bool = False) -> Exported:
    """``O9100.nc``."""
    names = macro_variables(model)
    left_out = list(left_out_of_macro(model))
    program, tests = names.program, list(names.tests.values())
    kinds = {"rise": "has_start", "absolute": "has_memory"}
    begins_anew = [f"{kinds[item.reference]}_{k}" for k, item in enumerate(model.inputs, 1)]
    corrections = [program[f"correction_{k}"] for k in range(1, len(model.outputs) + 1)]
    _, open_limits = decided_limits(model)
    units = {item.name: item.unit for item in model.inputs}
    return with_sheet(
        "fanuc",
        model,
        {FILE: _program(model, names, left_out, is_sign_verified=is_sign_verified)},
        (*findings_of_macro(model, left_out), *open_limits),
        lambda k, _um: {"test": tests[k - 1], "correction": corrections[k - 1]},
        time=TIME,
        off=names.off,
        first_test=tests[0],
        first_correction=corrections[0],
        last_volatile=names.last_volatile,
        first_kept=FIRST_KEPT,
        last_kept=names.last_kept,
        digits=SIGNIFICANT_DIGITS,
        readings=", ".join(
            f"#{number} = {language.plain(name)} [{units[name]}]" for name, number in names.readings.items()
        ),
        file=FILE,
        program=PROGRAM,
        status=STATUS,
        sensors=", ".join(
            f"#{program[f'sensor_{k}']} of {language.plain(item.name)}" for k, item in enumerate(model.inputs, 1)
        ),
        pause_min=LONGEST_PAUSE_S / 60.0,
        calls=LEAST_GOOD_SAMPLES + 2,
        apart_s=max(1.0, model.guard.recover_after_s / LEAST_GOOD_SAMPLES),
        anew=", ".join(f"#{program[name]}" for name in begins_anew),
        step_s=LONGEST_STEP_S,
    )


def macro_variables(model: ModelFile) -> MacroVariables:
    """Which variables the program of a model uses."""
    program = _guarded(model)
    local, volatile, kept = iter(range(1, _GROUP_3)), iter(range(TIME + 1, 10_000)), iter(range(STATUS + 1, 10_000))
    readings = {item.name: next(volatile) for item in model.inputs}
    tests = {output.name: next(volatile) for output in model.outputs}
    off = next(volatile)
    numbers = {"mode": STATUS}
    for one in program.variables:
        is_kept = one.place in ("output", "kept", "retained")
        if one.name not in numbers:
            numbers[one.name] = next(kept) if is_kept else next(local, 0) or next(volatile)
    last_volatile, last_kept = max(off, next(volatile) - 1), next(kept) - 1
    for used, last in ((last_volatile, LAST_VOLATILE), (last_kept, LAST_KEPT)):
        if used > last:
            raise ExportRefusedError(
                f"the model needs common variables up to #{used}",
                expected=f"at most #{last}",
                where="FANUC custom macro B",
                advice="choose fewer sensors, or compute the correction outside the control (target c or python)",
            )
    return MacroVariables(readings, tests, off, numbers, last_volatile, last_kept)


def _guarded(model: ModelFile) -> language.Program:
    """The program of an axis that is always ready, on a control that is never told of a restart."""
    return guarded_program(macro_model(model)).with_flags({"is_ready": True, "is_restart": False})


def _program(model: ModelFile, names: MacroVariables, left_out: Sequence[str], *, is_sign_verified: bool) -> str:
    axes = _axes(model)
    lines = ["%", f"O{PROGRAM}(THERMAL CORRECTION)"]
    for line in heading(model, is_sign_verified=is_sign_verified):
        lines += remarks(line)
    for line in left_out:
        lines += remarks(f"Left out - {line}")
    lines += remarks(f"NO. {TIME} - time of the readings in s, a clock that runs on")
    for item in model.inputs:
        lines += remarks(f"NO. {names.readings[item.name]} - {item.name} in {item.unit}")
    for k, output in enumerate(model.outputs, 1):
        correction = names.program[f"correction_{k}"]
        lines += remarks(f"NO. {correction} - correction for {output.name} in um")
        lines += remarks(f"NO. {names.tests[output.name]} - sign test of {output.name}, not 0 commands so much in um")
    lines += remarks(f"NO. {names.off} - not 0 switches off, the correction goes to zero")
    lines += [f"IF[#{TIME}EQ#0]GOTO{_END}", *offset_asked(axes.values())]
    program = _guarded(model)
    lines += [*_begun(model, program, names), *_called(model, names), *_Blocks(names.program).lines(program.body)]
    written = {axes[output.name]: names.program[f"correction_{k}"] for k, output in enumerate(model.outputs, 1)}
    lines += [*offset_written(written), f"N{_END}", "M99", "%"]
    return "\n".join(lines) + "\n"


def _axes(model: ModelFile) -> dict[str, str]:
    axes = {output.name: (output.axis or "").upper() for output in model.outputs}
    require_own_axes(model, "FANUC custom macro B, outputs")
    for name, axis in axes.items():
        if len(axis) != 1 or axis not in LINEAR_AXES:
            raise ExportRefusedError(
                f"output {name} has " + (f"the axis {axis}" if axis else "no axis"),
                expected=f"one linear axis ({', '.join(LINEAR_AXES)}) for one output",
                where="FANUC custom macro B, outputs",
                advice="name the axis of the output in the model file, or leave the output out",
            )
    return axes


def _begun(model: ModelFile, program: language.Program, names: MacroVariables) -> Iterator[str]:
    number = literal(float(int(kept_sha256(model)[:6], 16)))
    yield f"IF[#{_MODEL}EQ{number}]GOTO{_BEGUN}"
    yield from remarks("first call of this model")
    yield f"#{_MODEL}={number}"
    yield f"#{_LAST_CALL}=#{TIME}"
    for one in program.variables:
        if one.place in ("output", "kept", "retained"):
            yield f"#{names.program[one.name]}={literal(one.initial)}"
    yield f"N{_BEGUN}"


def _called(model: ModelFile, names: MacroVariables) -> Iterator[str]:
    """From the common variables to the inputs of the program."""
    dt, readings = names.program["dt_s"], [names.program[f"reading_{k}"] for k in range(1, len(model.inputs) + 1)]
    yield f"#{dt}=#{TIME}-#{_LAST_CALL}"
    yield f"#{_LAST_CALL}=#{TIME}"
    for given, reading in zip(names.readings.values(), readings, strict=True):
        yield f"#{reading}=#{given}"
        yield f"IF[#{given}EQ#0]THEN#{reading}={_NO_READING}"
    for k, test in enumerate(names.tests.values(), 1):
        yield f"#{names.program[f'test_um_{k}']}=#{test}"
        yield f"IF[#{test}EQ#0]THEN#{names.program[f'test_um_{k}']}=0."
    yield f"#{names.program['is_wanted']}=1."
    yield f"IF[#{names.off}EQ#0]THEN#{names.off}=0."
    yield f"IF[#{names.off}NE0.]THEN#{names.program['is_wanted']}=0."
    yield from remarks("after a pause, or a clock put back, nothing is believed at once")
    yield f"IF[#{dt}GT{literal(LONGEST_S)}]THEN#{dt}={literal(LONGEST_S)}"
    yield f"IF[#{dt}LT0.]GOTO{_CALLED + 1}"
    yield f"IF[#{dt}LE{literal(LONGEST_PAUSE_S)}]GOTO{_CALLED}"
    yield f"N{_CALLED + 1}"
    yield f"IF[#{dt}LT0.]THEN#{dt}={literal(SAMPLE_S)}"
    yield from (f"#{reading}={_NO_READING}" for reading in readings)
    yield f"#{names.program['is_first']}=1."
    yield f"N{_CALLED}"
