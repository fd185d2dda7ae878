"""Timed corrections of a duty cycle as an NC subprogram, for a control that counts the time itself."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from selector.controllers.program.language import plain
from selector.controllers.replay.macro_b_executed import MacroB
from selector.controllers.writers.exported import TEST_UM
from selector.controllers.writers.fanuc import LINEAR_AXES, literal, offset_asked, offset_written, remarks
from selector.errors import OptionError
from selector.physics.thermal.prediction.correction_program import CorrectionProgram

#: The clocks tell the time of the day, and whether it is the next one: an operation has to be over before it is doubted
#: which day it began.
LONGEST_OPERATION_S = 80_000.0
#: So long after the end of its operation the last correction stays; the prediction says nothing of then.
STAYS_S = 3600
TARGETS = ("fanuc", "sinumerik")
_DAY_S = 86_400


@dataclass(frozen=True)
class TimedProgram:
    """A subprogram, and what the person has to know who loads it."""

    target: str  #: {"fanuc", "sinumerik"}
    file: str
    text: str
    sheet: str
    replay: tuple[int, float] | None  #: Calls that were executed, and the largest difference [µm]; None: not executed

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        executed = None
        if self.replay is not None:
            executed = {"calls": self.replay[0], "max_abs_difference_um": self.replay[1]}
        return {"target": self.target, "file": self.file, "replay": executed}


def timed_program(
    target: str, programs: Mapping[str, CorrectionProgram], axes: Mapping[str, str], inverted: Sequence[str] = ()
) -> TimedProgram:
    """The programs (response → program) as one subprogram that corrects an axis for each response.

    The subprogram is called with the number of an operation when its zero was set, and without a number between cuts;
    it then writes what is to be taken off at this time, which is minus the offset, or the offset for `inverted`
    responses. An hour after the end of an operation, on another day than the next one, and in a new month nothing is
    taken off until the next zero.

    FANUC: the external work offset (G10 L2 P0), date and time from #3011 and #3012. SINUMERIK: the setting data 43900
    of the temperature compensation, date and time from $A_YEAR ... $A_SECOND.

    Raises OptionError: the control is not known, there is no program, a response has no linear axis of its own, an
    inverted response does not exist, or an operation lasts a day.
    """
    if target not in TARGETS:
        raise OptionError(
            repr(target), expected=" or ".join(TARGETS), where="--nc", advice="take program.csv for other controls"
        )
    if not programs:
        raise OptionError(
            "responses that are temperatures", expected="a displacement", where="--nc",
            advice="name a displacement with --response, or leave --nc out",
        )  # fmt: skip
    unknown = [name for name in inverted if name not in programs]
    if unknown:
        raise OptionError(
            ", ".join(unknown), expected="a response with a program: " + ", ".join(programs), where="--invert",
            advice="correct the name",
        )  # fmt: skip
    taken = [axes.get(name, "").upper() for name in programs]
    for name, axis in zip(programs, taken, strict=True):
        if len(axis) != 1 or axis not in LINEAR_AXES or taken.count(axis) > 1:
            raise OptionError(
                f"{name} has " + (f"the axis {axis}" if axis else "no axis") + ", as another" * (taken.count(axis) > 1),
                expected=f"one linear axis ({', '.join(LINEAR_AXES)}) for one response", where="--nc",
                advice="name the axis of the channel in the machine file, or leave the response out (--response)",
            )  # fmt: skip
        longest = max(operation.end_s - operation.start_s for operation in programs[name].operations)
        if longest > LONGEST_OPERATION_S:
            raise OptionError(
                f"an operation of {longest / 3600.0:.3g} h", expected=f"at most {LONGEST_OPERATION_S / 3600.0:.3g} h",
                where="--nc", advice="part it with --operations: each begins with a new zero",
            )  # fmt: skip
    signs = {axis: 1.0 if name in inverted else -1.0 for name, axis in zip(programs, taken, strict=True)}
    operations = list(_operations(dict(zip(taken, programs.values(), strict=True))))
    return (_fanuc if target == "fanuc" else _sinumerik)(operations, signs)


@dataclass(frozen=True)
class _Timed:
    """An operation that is corrected: its number, and until when [whole s from its start]."""

    number: int
    until_s: int
    steps: tuple[tuple[str, int, float], ...]  #: Axis, from when [whole s], displacement that is taken off [µm]


def _operations(programs: Mapping[str, CorrectionProgram]) -> Iterator[_Timed]:
    """Of the programs (axis → program), which have the same operations."""
    for number, of_axes in enumerate(zip(*(one.operations for one in programs.values()), strict=True), start=1):
        steps = tuple(
            # down, so that none is late
            (axis, int(at - one.start_s + 1e-6), round(um, 3))
            for axis, one in zip(programs, of_axes, strict=True)
            for at, um in zip(one.times_s[1:].tolist(), one.offsets_um[1:].tolist(), strict=True)
        )
        if steps:
            yield _Timed(number, math.ceil(of_axes[0].end_s - of_axes[0].start_s) + STAYS_S, steps)


FANUC_FILE, _FANUC_PROGRAM = "O9110.nc", 9110
#: Common variables that outlive power-off: the operation (0: none), when [s of the day] and on which day it began.
_OPERATION, _BEGUN, _DAY = 990, 991, 992
_CLOCK, _PASSED, _NOW, _FIRST_AXIS = 28, 29, 30, 4  #: Local variables: times, and the corrections of the axes [µm].
_KNOWN_DAY, _GOES_ON, _FIRST_LABEL = 29, 30, 1000


def _fanuc(operations: Sequence[_Timed], signs: Mapping[str, float]) -> TimedProgram:
    variables = {axis: _FIRST_AXIS + k for k, axis in enumerate(signs)}
    begins, goes_on, tests = (f"G65 P{_FANUC_PROGRAM}{letter}" for letter in (" A1.", "", f" B{TEST_UM:g}."))
    lines = ["%", f"O{_FANUC_PROGRAM}(TIMED CORRECTION)"]
    for told in (
        f"{begins} - the zero of operation 1 was set. A0. - off",
        f"{goes_on} - between cuts",
        f"{tests} - sign test",
        f"keeps the operation in No. {_OPERATION} and when it began in No. {_BEGUN} and {_DAY}",
    ):
        lines += remarks(told)
    lines += [
        *offset_asked(signs),
        # read once: it goes on while it is taken apart
        f"#{_CLOCK}=#3012",
        f"#{_NOW}=FIX[#{_CLOCK}/10000.]*3600.+FIX[#{_CLOCK}/100.]*60.",
        f"#{_NOW}=#{_NOW}-FIX[#{_CLOCK}/10000.]*6000.+#{_CLOCK}-FIX[#{_CLOCK}/100.]*100.",
        f"IF[#{_OPERATION}EQ#0]THEN#{_OPERATION}=0.",
        f"IF[#1EQ#0]GOTO{_GOES_ON}",
        f"#{_OPERATION}=#1",
        f"#{_BEGUN}=#{_NOW}",
        f"#{_DAY}=#3011",
        f"N{_GOES_ON}",
        f"#{_PASSED}=#{_NOW}-#{_BEGUN}",
        f"IF[#3011EQ#{_DAY}]GOTO{_KNOWN_DAY}",
        f"#{_PASSED}=#{_PASSED}+{_DAY_S}.",
        f"IF[#3011EQ[#{_DAY}+1.]]GOTO{_KNOWN_DAY}",
        f"#{_OPERATION}=0.",
        f"N{_KNOWN_DAY}",
        *(f"#{variable}=0." for variable in variables.values()),
    ]
    for one in operations:
        lines.append(f"IF[#{_OPERATION}NE{one.number}.]GOTO{_FIRST_LABEL + one.number}")
        lines.append(f"IF[#{_PASSED}GT{one.until_s}.]GOTO{_FIRST_LABEL + one.number}")
        for axis, from_s, um in one.steps:
            sign = "-" if um * signs[axis] < 0.0 else ""
            lines.append(f"IF[#{_PASSED}GE{from_s}.]THEN#{variables[axis]}={sign}{literal(abs(um))}")
        lines.append(f"N{_FIRST_LABEL + one.number}")
    for axis, variable in variables.items():
        lines.append(f"IF[#2NE#0]THEN#{variable}={'-' if signs[axis] < 0.0 else ''}#2")
    text = "\n".join([*lines, *offset_written(variables), "N900", "M99", "%", ""])
    install = (
        f"Load {FANUC_FILE}. Check in the manual of the control: custom macro B is there; #3012 is the time of day, "
        f"hhmmss, and #3011 the date, yyyymmdd; #{_OPERATION} to #{_DAY} are free and outlive power-off; G10 L2 P0 is "
        "the external work offset, and nothing else uses it: what was in it is gone.",
        f"Set the zero of operation 1, then call {begins}, and the same with the number of each later one. Call "
        f"{goes_on} between cuts, without contact: the offset comes as one step of up to "
        f"{_largest_um(operations):g} um, into force in the blocks after the call.",
    )
    calls, difference_um = replay = _replayed(text, operations, signs)
    told = f"Executed here, block by block, {calls} calls: largest difference {difference_um:.2g} um."
    sheet = _sheet(install, signs, tests, f"G65 P{_FANUC_PROGRAM} A0.", told)
    return TimedProgram("fanuc", FANUC_FILE, text, sheet, replay)


def _replayed(text: str, operations: Sequence[_Timed], signs: Mapping[str, float]) -> tuple[int, float]:
    """The subprogram executed one second before and at every change, the start and the end of operations among them.

    First the sign test, and the call that ends it.
    """
    macro, calls, largest = MacroB(text), 0, 0.0

    def call(due: Mapping[str, float], **arguments: float) -> None:
        nonlocal calls, largest
        for letter, number in (("A", 1), ("B", 2)):
            macro.variables.pop(number, None)
            if letter in arguments:
                macro.variables[number] = arguments[letter]
        macro.call()
        calls += 1
        found = (abs(1000.0 * macro.offsets[axis] - sign * due.get(axis, 0.0)) for axis, sign in signs.items())
        largest = max(largest, *found)

    macro.variables |= {3011: 20_260_115.0, 3012: 120_000.0}
    call(dict.fromkeys(signs, TEST_UM), B=TEST_UM)
    call({}, A=0.0)
    for one in operations:
        begun = 17_777 * one.number  # of the fifth operation it is past midnight
        changes = {0, *(from_s for _, from_s, _ in one.steps), one.until_s + 1}
        for passed in sorted({moment for change in changes for moment in (change - 1, change) if moment >= 0}):
            days, now = divmod(begun % _DAY_S + passed, _DAY_S)
            macro.variables[3011] = 20_260_115.0 + days
            macro.variables[3012] = float(now // 3600 * 10_000 + now // 60 % 60 * 100 + now % 60)
            due = {axis: um for axis, from_s, um in one.steps if from_s <= passed <= one.until_s}
            call(due, **({"A": float(one.number)} if passed == 0 else {}))
    return calls, largest


def _largest_um(operations: Sequence[_Timed]) -> float:
    """Of all steps: with a new zero all that was taken off goes at once [µm]."""
    return max((abs(um) for one in operations for _, _, um in one.steps), default=0.0)


SINUMERIK_FILE, _SINUMERIK_NAME = "SELECTOR_TIMED.SPF", "SELECTOR_TIMED"
_R_OPERATION, _R_BEGUN, _R_DAY = 97, 98, 99  #: R parameters, of which a control has 100 unless told otherwise.


def _sinumerik(operations: Sequence[_Timed], signs: Mapping[str, float]) -> TimedProgram:
    begins, goes_on, tests = (f"{_SINUMERIK_NAME}({what})" for what in ("1", "-1", f"-2,{TEST_UM:g}"))
    lines = [
        f"PROC {_SINUMERIK_NAME}(INT OPERATION, REAL TEST_UM) SAVE DISPLOF",
        f"; {begins}: the zero of operation 1 was set; 0 instead of 1: off",
        f"; {goes_on}: between cuts; {tests}: sign test",
        f"; R{_R_OPERATION}: the operation, R{_R_BEGUN}: when it began [s of the day], R{_R_DAY}: on which day",
        "DEF INT NOW",
        "DEF INT TODAY",
        "DEF INT PASSED",
        *(f"DEF REAL {axis}_UM=0" for axis in signs),
        "STOPRE",
        "NOW=$A_HOUR*3600+$A_MINUTE*60+$A_SECOND",
        "TODAY=$A_YEAR*10000+$A_MONTH*100+$A_DAY",
        "IF OPERATION>=0",
        f"  R{_R_OPERATION}=OPERATION",
        f"  R{_R_BEGUN}=NOW",
        f"  R{_R_DAY}=TODAY",
        "ENDIF",
        f"PASSED=NOW-R{_R_BEGUN}",
        f"IF TODAY<>R{_R_DAY}",
        f"  PASSED=PASSED+{_DAY_S}",
        f"  IF TODAY<>R{_R_DAY}+1",
        f"    R{_R_OPERATION}=0",
        "  ENDIF",
        "ENDIF",
    ]
    for one in operations:
        lines.append(f"IF (R{_R_OPERATION}=={one.number}) AND (PASSED<={one.until_s})")
        for axis, from_s, um in one.steps:
            lines += [f"  IF PASSED>={from_s}", f"    {axis}_UM={signs[axis] * um:.3f}", "  ENDIF"]
        lines.append("ENDIF")
    lines.append("IF OPERATION==-2")
    lines += [f"  {axis}_UM={'-' if signs[axis] < 0.0 else ''}TEST_UM" for axis in signs]
    lines.append("ENDIF")
    lines += [f"$SA_TEMP_COMP_ABS_VALUE[{axis}]={axis}_UM/1000" for axis in signs]
    install = (
        f"Load {SINUMERIK_FILE} into the user cycles; elsewhere the calling program needs EXTERN "
        f"{_SINUMERIK_NAME}(INT,REAL). R{_R_OPERATION} to R{_R_DAY} must be free. Set bit 0 of "
        "MD32750 $MA_TEMP_COMP_TYPE of the axes, then power on. Nothing else may write SD43900 of these axes.",
        f"Set the zero of operation 1, then call {begins}, and the same with the number of each later one. Call "
        f"{goes_on} between cuts, without contact: it stops the look-ahead for a moment, and the axis makes a step of "
        f"up to {_largest_um(operations):g} um.",
        "After a reset or power-off the last value stays in SD43900 until the next call.",
    )
    told = "Not executed here: there is no SINUMERIK to do so. Try every operation without cutting first."
    sheet = _sheet(install, signs, tests, f"{_SINUMERIK_NAME}(0)", told)
    return TimedProgram("sinumerik", SINUMERIK_FILE, "\n".join([*lines, "RET", ""]), sheet, None)


def _sheet(install: Sequence[str], signs: Mapping[str, float], test: str, after: str, told: str) -> str:
    moves = ", ".join(f"{axis} by {sign * TEST_UM:+g} um" for axis, sign in signs.items())
    return "\n\n".join(
        (
            "Timed corrections: what to do at the machine",
            "This is not a safety function. The times hold for the duty cycle of the prediction: after a stop, predict "
            f"again. {STAYS_S // 60} min after the end of an operation, on a day that is not the next one, and from "
            "midnight of a new month on the correction is 0 until a zero is set again.",
            *(f"{k}. {plain(line)}" for k, line in enumerate(install, start=1)),
            f"{len(install) + 1}. Sign test, before the first part: with an indicator in place of the gauge of the "
            f"tests, call {test} and go to the same place again. The program moves {moves}. The indicator must read "
            f"{TEST_UM:g} um less in the direction in which the tests count up. If it reads more, write the program "
            f"again with --invert and the name of that response. Then call {after}",
            told,
            "",
        )
    )
