"""Timed corrections of a duty cycle as an NC subprogram, for a control that counts the time itself."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from selector.controllers.program.language import plain
from selector.controllers.replay.macro_b_executed import MacroB
from selector.controllers.writers.exported import TEST_UM
from selector.controllers.writers.fanuc import LINEAR_AXES, literal, offset_asked, offset_written, remarks
from selector.errors import OptionError
from selector.physics.thermal.prediction.correction_program import CorrectionProgram

LONGEST_OPERATION_S = 86_000.0
"""The clocks tell the time of the day; an operation of a day or more would begin again."""
_DAY_S = 86_400
TARGETS = ("fanuc", "sinumerik")


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
    responses. FANUC: the external work offset (G10 L2 P0), the time of day from #3012. SINUMERIK: the setting data
    43900 of the temperature compensation, the time of day from $A_HOUR ... $A_SECOND.

    Raises OptionError: the control is not known, a response has no linear axis of its own, an inverted response does
    not exist, or an operation lasts a day.
    """
    if target not in TARGETS:
        raise OptionError(
            repr(target), expected=" or ".join(TARGETS), where="--nc", advice="take program.csv for other controls"
        )
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
    stairs = {axis: _stairs(program) for axis, program in zip(taken, programs.values(), strict=True)}
    return _fanuc(stairs, signs) if target == "fanuc" else _sinumerik(stairs, signs)


_Stairs = list[list[tuple[int, float]]]
"""Per operation the whole seconds from its start, and the displacement that is taken off from then on [µm]."""


def _stairs(program: CorrectionProgram) -> _Stairs:
    # down, so that none is late
    return [
        [
            (int(at - one.start_s + 1e-6), um)
            for at, um in zip(one.times_s.tolist(), one.offsets_um.tolist(), strict=True)
        ]
        for one in program.operations
    ]


FANUC_FILE, _FANUC_PROGRAM = "O9110.nc", 9110
_OPERATION, _BEGUN = 990, 991
"""Common variables that outlive power-off: the operation (0: none), and when it began [s of the day]."""
_NOW, _PASSED, _FIRST_AXIS = 30, 29, 4
"""Local variables: two times, and the corrections of the axes [µm]."""
_GOES_ON, _FIRST_LABEL = 30, 100


def _fanuc(stairs: Mapping[str, _Stairs], signs: Mapping[str, float]) -> TimedProgram:
    variables = {axis: _FIRST_AXIS + k for k, axis in enumerate(stairs)}
    begins, goes_on, tests = (f"G65 P{_FANUC_PROGRAM}{letter}" for letter in (" A1.", "", f" B{TEST_UM:g}."))
    lines = ["%", f"O{_FANUC_PROGRAM}(TIMED CORRECTION)"]
    for told in (
        f"{begins} - the zero of operation 1 was set. A0. - off",
        f"{goes_on} - between cuts",
        f"{tests} - sign test",
        f"keeps the operation in No. {_OPERATION} and when it began in No. {_BEGUN}",
    ):
        lines += remarks(told)
    lines += [
        *offset_asked(stairs),
        f"#{_NOW}=FIX[#3012/10000.]*3600.+FIX[#3012/100.]*60.-FIX[#3012/10000.]*6000.",
        f"#{_NOW}=#{_NOW}+#3012-FIX[#3012/100.]*100.",
        f"IF[#{_OPERATION}EQ#0]THEN#{_OPERATION}=0.",
        f"IF[#1EQ#0]GOTO{_GOES_ON}",
        f"#{_OPERATION}=#1",
        f"#{_BEGUN}=#{_NOW}",
        f"N{_GOES_ON}",
        f"#{_PASSED}=#{_NOW}-#{_BEGUN}",
        f"IF[#{_PASSED}LT0.]THEN#{_PASSED}=#{_PASSED}+{_DAY_S}.",
        *(f"#{variable}=0." for variable in variables.values()),
    ]
    for k, steps in _by_operation(stairs):
        lines.append(f"IF[#{_OPERATION}NE{k}.]GOTO{_FIRST_LABEL + k}")
        for axis, from_s, um in steps:
            correction = literal(round(abs(um), 3))
            sign = "-" if um * signs[axis] < 0.0 else ""
            lines.append(f"IF[#{_PASSED}GE{from_s}.]THEN#{variables[axis]}={sign}{correction}")
        lines.append(f"N{_FIRST_LABEL + k}")
    for axis, variable in variables.items():
        lines.append(f"IF[#2NE#0]THEN#{variable}={'-' if signs[axis] < 0.0 else ''}#2")
    text = "\n".join([*lines, *offset_written(variables), "N900", "M99", "%", ""])
    install = (
        f"Load {FANUC_FILE}. Check in the manual of the control: custom macro B is there; #3012 is the time of day, "
        f"hhmmss; #{_OPERATION} and #{_BEGUN} are free and outlive power-off; G10 L2 P0 is the external work offset, "
        "and nothing else uses it: what was in it is gone.",
        f"Set the zero of operation 1, then call {begins}, and the same with the number of each later one. Call "
        f"{goes_on} between cuts, without contact: the offset comes as one step of up to {_largest_step(stairs):g} um, "
        "into force in the blocks after the call.",
    )
    replay = _replayed(text, stairs, signs)
    told = f"Executed here, block by block, {replay[0]} calls: largest difference {replay[1]:.2g} um."
    sheet = _sheet(install, signs, tests, f"G65 P{_FANUC_PROGRAM} A0.", told)
    return TimedProgram("fanuc", FANUC_FILE, text, sheet, replay)


def _replayed(text: str, stairs: Mapping[str, _Stairs], signs: Mapping[str, float]) -> tuple[int, float]:
    """The subprogram executed at the start of every operation, and one second before and at every correction."""
    macro, calls, largest = MacroB(text), 0, 0.0
    for k, steps in _by_operation(stairs):
        begun = 17_777 * k  # of the fifth operation it is past midnight
        moments = sorted({moment for _, from_s, _ in steps for moment in (from_s - 1, from_s) if moment > 0})
        for passed in (0, *moments):
            now = (begun + passed) % _DAY_S
            macro.variables[3012] = float(now // 3600 * 10_000 + now // 60 % 60 * 100 + now % 60)
            macro.variables.pop(1, None)
            if passed == 0:
                macro.variables[1] = float(k)
            macro.call()
            calls += 1
            due = dict.fromkeys(stairs, 0.0) | {axis: um for axis, from_s, um in steps if from_s <= passed}
            found = (abs(1000.0 * macro.offsets[axis] - signs[axis] * round(um, 3)) for axis, um in due.items())
            largest = max(largest, *found)
    return calls, largest


def _largest_step(stairs: Mapping[str, _Stairs]) -> float:
    """In µm; at the end of an operation all that was taken off goes at once."""
    steps = (
        abs(b - a)
        for one in stairs.values()
        for operation in one
        for (_, a), (_, b) in pairwise([*operation, (0, 0.0)])
    )
    return round(max(steps), 3)


def _by_operation(stairs: Mapping[str, _Stairs]) -> Iterator[tuple[int, list[tuple[str, int, float]]]]:
    """Of each operation that is corrected (axis, from [s], displacement that is taken off [µm])."""
    for k in range(max(len(one) for one in stairs.values())):
        steps = [(axis, from_s, um) for axis, one in stairs.items() if k < len(one) for from_s, um in one[k][1:]]
        if steps:
            yield k + 1, steps


SINUMERIK_FILE, _SINUMERIK_NAME = "SELECTOR_TIMED.SPF", "SELECTOR_TIMED"


def _sinumerik(stairs: Mapping[str, _Stairs], signs: Mapping[str, float]) -> TimedProgram:
    begins, goes_on, tests = (f"{_SINUMERIK_NAME}({what})" for what in ("1", "-1", f"-2,{TEST_UM:g}"))
    lines = [
        f"PROC {_SINUMERIK_NAME}(INT OPERATION, REAL TEST_UM) SAVE DISPLOF",
        f"; {begins}: the zero of operation 1 was set; 0 instead of 1: off",
        f"; {goes_on}: between cuts; {tests}: sign test",
        f"; R{_OPERATION}: the operation, R{_BEGUN}: when it began [s of the day]",
        "DEF INT NOW",
        "DEF INT PASSED",
        *(f"DEF REAL {axis}_UM=0" for axis in stairs),
        "STOPRE",
        "NOW=$A_HOUR*3600+$A_MINUTE*60+$A_SECOND",
        "IF OPERATION>=0",
        f"  R{_OPERATION}=OPERATION",
        f"  R{_BEGUN}=NOW",
        "ENDIF",
        f"PASSED=NOW-R{_BEGUN}",
        "IF PASSED<0",
        f"  PASSED=PASSED+{_DAY_S}",
        "ENDIF",
    ]
    for k, steps in _by_operation(stairs):
        lines.append(f"IF R{_OPERATION}=={k}")
        for axis, from_s, um in steps:
            lines += [f"  IF PASSED>={from_s}", f"    {axis}_UM={signs[axis] * round(um, 3):.3f}", "  ENDIF"]
        lines.append("ENDIF")
    lines.append("IF OPERATION==-2")
    lines += [f"  {axis}_UM={'-' if signs[axis] < 0.0 else ''}TEST_UM" for axis in stairs]
    lines.append("ENDIF")
    lines += [f"$SA_TEMP_COMP_ABS_VALUE[{axis}]={axis}_UM/1000" for axis in stairs]
    install = (
        f"Load {SINUMERIK_FILE} into the user cycles; elsewhere the calling program needs EXTERN "
        f"{_SINUMERIK_NAME}(INT,REAL). R{_OPERATION} and R{_BEGUN} must be there and free (MD28050). Set bit 0 of "
        "MD32750 $MA_TEMP_COMP_TYPE of the axes, then power on. Nothing else may write SD43900 of these axes.",
        f"Set the zero of operation 1, then call {begins}, and the same with the number of each later one. Call "
        f"{goes_on} between cuts, without contact: it stops the look-ahead for a moment, and the axis makes a step of "
        f"up to {_largest_step(stairs):g} um.",
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
            "again.",
            *(f"{k}. {plain(line)}" for k, line in enumerate(install, start=1)),
            f"{len(install) + 1}. Sign test, before the first part: with an indicator in place of the gauge of the "
            f"tests, call {test} and go to the same place again. The program moves {moves}. The indicator must read "
            f"{TEST_UM:g} um less in the direction in which the tests count up. If it reads more, write the program "
            f"again with --invert and the name of that response. Then call {after}",
            told,
            "",
        )
    )
