"""Timed corrections of a duty cycle as an NC subprogram, for a control that counts the time itself."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from selector.controllers.replay.macro_b_executed import MacroB
from selector.controllers.writers.exported import TEST_UM, filled
from selector.controllers.writers.fanuc import LINEAR_AXES, literal, offset_asked, offset_written, remarks
from selector.errors import OptionError
from selector.physics.thermal.prediction.correction_program import CorrectionProgram

#: The clocks tell the time of the day, and whether it is the next one: an operation has to be over before it is doubted
#: which day it began.
LONGEST_OPERATION_S = 80_000.0
#: So long after the end of its operation the last correction stays; the prediction says nothing of then.
STAYS_S = 3600
TARGETS = ("fanuc", "sinumerik")
_CALLS = ("begins", "goes_on", "tests")  #: The zero of operation 1 was set; between cuts; sign test.
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
_OF_FANUC = {"operation": 990, "begun": 991, "day": 992}
_CLOCK, _PASSED, _NOW, _FIRST_AXIS = 28, 29, 30, 4  #: Local variables: times, and the corrections of the axes [µm].
_FIRST_LABEL = 1000


def _fanuc(operations: Sequence[_Timed], signs: Mapping[str, float]) -> TimedProgram:
    variables = {axis: _FIRST_AXIS + k for k, axis in enumerate(signs)}
    calls = dict(
        zip(_CALLS, (f"G65 P{_FANUC_PROGRAM}{letter}" for letter in (" A1.", "", f" B{TEST_UM:g}.")), strict=True)
    )
    told = (
        "{begins} - the zero of operation 1 was set. A0. - off",
        "{goes_on} - between cuts",
        "{tests} - sign test",
        "keeps the operation in No. {operation} and when it began in No. {begun} and {day}",
    )
    corrections = [f"#{variable}=0." for variable in variables.values()]
    for one in operations:
        corrections.append(f"IF[#{_OF_FANUC['operation']}NE{one.number}.]GOTO{_FIRST_LABEL + one.number}")
        corrections.append(f"IF[#{_PASSED}GT{one.until_s}.]GOTO{_FIRST_LABEL + one.number}")
        for axis, from_s, um in one.steps:
            sign = "-" if um * signs[axis] < 0.0 else ""
            corrections.append(f"IF[#{_PASSED}GE{from_s}.]THEN#{variables[axis]}={sign}{literal(abs(um))}")
        corrections.append(f"N{_FIRST_LABEL + one.number}")
    for axis, variable in variables.items():
        corrections.append(f"IF[#2NE#0]THEN#{variable}={'-' if signs[axis] < 0.0 else ''}#2")
    text = filled(
        "timed_fanuc",
        program=_FANUC_PROGRAM,
        told=[line for one in told for line in remarks(one.format(**calls, **_OF_FANUC))],
        asked=list(offset_asked(signs)),
        clock=_CLOCK,
        now=_NOW,
        passed=_PASSED,
        corrections=corrections,
        written=list(offset_written(variables)),
        **_OF_FANUC,
    )
    n_calls, difference_um = replay = _replayed(text, operations, signs)
    said = f"Executed here, block by block, {n_calls} calls: largest difference {difference_um:.2g} um."
    sheet = _sheet(
        "fanuc", operations, signs, said=said, file=FANUC_FILE, off=f"G65 P{_FANUC_PROGRAM} A0.", **calls, **_OF_FANUC
    )
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


SINUMERIK_FILE, _SINUMERIK_NAME = "SELECTOR_TIMED.SPF", "SELECTOR_TIMED"
_OF_SINUMERIK = {"operation": 97, "begun": 98, "day": 99}  #: R parameters; a control has 100 unless told otherwise.


def _sinumerik(operations: Sequence[_Timed], signs: Mapping[str, float]) -> TimedProgram:
    calls = dict(zip(_CALLS, (f"{_SINUMERIK_NAME}({what})" for what in ("1", "-1", f"-2,{TEST_UM:g}")), strict=True))
    corrections = []
    for one in operations:
        corrections.append(f"IF (R{_OF_SINUMERIK['operation']}=={one.number}) AND (PASSED<={one.until_s})")
        for axis, from_s, um in one.steps:
            corrections += [f"  IF PASSED>={from_s}", f"    {axis}_UM={signs[axis] * um:.3f}", "  ENDIF"]
        corrections.append("ENDIF")
    corrections.append("IF OPERATION==-2")
    corrections += [f"  {axis}_UM={'-' if signs[axis] < 0.0 else ''}TEST_UM" for axis in signs]
    corrections.append("ENDIF")
    corrections += [f"$SA_TEMP_COMP_ABS_VALUE[{axis}]={axis}_UM/1000" for axis in signs]
    own = {"name": _SINUMERIK_NAME, **calls, **_OF_SINUMERIK}
    axes = [f"DEF REAL {axis}_UM=0" for axis in signs]
    text = filled("timed_sinumerik", axes=axes, corrections=corrections, **own)
    said = "Not executed here: there is no SINUMERIK to do so. Try every operation without cutting first."
    sheet = _sheet("sinumerik", operations, signs, said=said, file=SINUMERIK_FILE, off=f"{_SINUMERIK_NAME}(0)", **own)
    return TimedProgram("sinumerik", SINUMERIK_FILE, text, sheet, None)


def _sheet(target: str, operations: Sequence[_Timed], signs: Mapping[str, float], **values: object) -> str:
    # with a new zero all that was taken off goes at once
    largest_um = max((abs(um) for one in operations for _, _, um in one.steps), default=0.0)
    return filled(
        "timed_sheet",
        steps=filled(f"timed_{target}_steps", largest=f"{largest_um:g}", **values),
        minutes=STAYS_S // 60,
        moves=", ".join(f"{axis} by {sign * TEST_UM:+g} um" for axis, sign in signs.items()),
        um=f"{TEST_UM:g}",
        **values,
    )
