"""Timed corrections as NC subprograms: what each control would write, at which second."""

import re

import numpy as np
import pytest

from selector.controllers.replay.macro_b_executed import MacroB
from selector.controllers.timed_program import timed_program
from selector.errors import OptionError
from selector.physics.thermal.prediction.correction_program import CorrectionProgram, Operation


def program(*operations, tolerance_um=10.0):
    """From (durations [min], corrections [µm]) of each operation, as the source prints them."""
    made, start = [], 0.0
    for durations, corrections in operations:
        ends = start + 60.0 * np.cumsum(durations)
        made.append(
            Operation(start, ends[-1], np.r_[start, ends[:-1]], np.array(corrections, dtype=float), tolerance_um)
        )
        start = ends[-1]
    return CorrectionProgram(tuple(made))


PRINTED = program(([18, 27, 15], [0, 10, 10]), ([15, 40, 5], [0, 10, 10]), ([60], [0]))
OTHER = program(([20.5, 39.5], [0, -4]), ([60], [0]), ([10, 50], [0, 3.5]))
BOTH = {"Z": PRINTED, "drift of X": OTHER}
AXES = {"Z": "z", "drift of X": "X"}


def clock(second):
    return float(second // 3600 * 10_000 + second // 60 % 60 * 100 + second % 60)


class Fanuc:
    """The macro at a control: time of the day [s], millimetres."""

    def __init__(self, made):
        self.macro = MacroB(made.text)

    def call(self, second, operation=None, test=None):
        self.macro.variables[3011] = 20_261_126.0 + second // 86_400 + (70 if second >= 5 * 86_400 else 0)
        self.macro.variables[3012] = clock(second % 86_400)
        for number, value in ((1, operation), (2, test)):
            self.macro.variables.pop(number, None)
            if value is not None:
                self.macro.variables[number] = float(value)
        self.macro.call()
        return {axis: round(1000.0 * mm, 6) for axis, mm in self.macro.offsets.items()}


class Sinumerik:
    """Only what is written: IF … ENDIF, whole numbers, additions and comparisons."""

    def __init__(self, made):
        self.lines = [line.strip() for line in made.text.splitlines() if not line.startswith(";")]
        self.kept = {"R97": 0, "R98": 0, "R99": 0}

    def call(self, second, operation=-1, test=0.0):
        day, second = divmod(second, 86_400)
        # from the fifth day on it is December
        today = {"$A_YEAR": 2026, "$A_MONTH": 11 if day < 5 else 12, "$A_DAY": 26 + day if day < 5 else day - 4}
        names = {**self.kept, "OPERATION": operation, "TEST_UM": test}
        day = today | {"$A_HOUR": second // 3600, "$A_MINUTE": second // 60 % 60, "$A_SECOND": second % 60}
        running, written = [True], {}
        for line in self.lines:
            for name, value in day.items():
                line = line.replace(name, str(value))
            if line.startswith("IF "):
                condition = line[3:].replace("<>", "!=").replace(" AND ", " and ")
                running.append(running[-1] and eval(condition, {}, names))
            elif line == "ENDIF":
                running.pop()
            elif not running[-1] or re.match(r"PROC|STOPRE|RET", line):
                continue
            elif match := re.fullmatch(r"DEF (?:INT|REAL) (\w+)(?:=(\w+))?", line):
                names[match[1]] = int(match[2] or 0)
            elif match := re.fullmatch(r"\$SA_TEMP_COMP_ABS_VALUE\[(\w)\]=(.+)", line):
                written[match[1]] = round(1000.0 * eval(match[2], {}, names), 6)
            else:
                name, value = line.split("=", 1)
                names[name] = eval(value, {}, names)
        assert running == [True]
        self.kept = {name: names[name] for name in self.kept}
        return written


CONTROLS = pytest.mark.parametrize(
    ("target", "control", "tests"), [("fanuc", Fanuc, {}), ("sinumerik", Sinumerik, {"operation": -2})]
)


@CONTROLS
def test_every_correction_comes_at_its_second_also_through_midnight(target, control, tests):
    machine = control(timed_program(target, BOTH, AXES))
    for first in (30_000, 86_400 - 1500):
        assert machine.call(first, 1) == {"Z": 0.0, "X": 0.0}
        due = {1079: (0, 0), 1080: (-10, 0), 1229: (-10, 0), 1230: (-10, 4), 2699: (-10, 4), 2700: (-20, 4)}
        for passed, (z, x) in due.items():
            assert machine.call(first + passed) == {"Z": z, "X": x}
        assert machine.call(first + 3600, 2) == {"Z": 0.0, "X": 0.0}
        assert machine.call(first + 3600 + 900) == {"Z": -10.0, "X": 0.0}
        assert machine.call(first + 7200, 3) == {"Z": 0.0, "X": 0.0}
        assert machine.call(first + 7200 + 600) == {"Z": 0.0, "X": -3.5}
        assert machine.call(first + 7200 + 700, 0) == {"Z": 0.0, "X": 0.0}
        assert machine.call(first + 9000) == {"Z": 0.0, "X": 0.0}


@CONTROLS
def test_a_forgotten_operation_corrects_nothing(target, control, tests):
    machine = control(timed_program(target, {"Z": PRINTED}, AXES))
    day = 86_400
    for begun, called, z in (
        # an hour after its end the last correction still stands, and no longer
        (30_000, 30_000 + 7200, -20.0),
        (30_000, 30_000 + 7201, 0.0),
        # at the same time of the next day, and of those that follow it
        (30_000, 30_000 + day + 1500, 0.0),
        (80_000, 2 * day + 1000, 0.0),
        # past midnight it goes on, but not into a new month
        (day - 1000, day + 500, -10.0),
        (5 * day - 1000, 5 * day + 500, 0.0),
    ):
        assert machine.call(begun, 1) == {"Z": 0.0}
        assert machine.call(called) == {"Z": z}
    # what was over stays over
    machine.call(80_000, 1)
    assert machine.call(80_000 + 2 * day) == {"Z": 0.0}
    assert machine.call(80_000 + 1500) == {"Z": 0.0}


@CONTROLS
def test_the_sign_test_and_a_turned_axis(target, control, tests):
    machine = control(timed_program(target, BOTH, AXES, ["Z"]))
    assert machine.call(100, **tests, test=10.0) == {"Z": 10.0, "X": -10.0}
    machine.call(100, 1)
    assert machine.call(1180) == {"Z": 10.0, "X": 0.0}


def test_the_macro_writes_inches_where_the_control_has_them_and_is_refused_where_it_has_neither():
    made = timed_program("fanuc", {"Z": PRINTED}, AXES)
    control = Fanuc(made)
    control.macro.modal[4006] = 20.0
    control.call(100, 1)
    control.call(1180)
    assert control.macro.offsets["Z"] * 25_400.0 == pytest.approx(-10.0)
    del control.macro.modal[4006]
    with pytest.raises(ValueError, match="alarm 3101"):
        control.call(1180)


def test_what_was_executed_stands_on_the_sheet_and_the_largest_step_too():
    made = timed_program("fanuc", BOTH, AXES)
    calls, difference = made.replay
    # the sign test and its end; of each of three operations the start and two calls at its end, and two at each
    # of 6 different times
    assert calls == 2 + 3 + 2 * 3 + 2 * 6
    assert difference < 1e-9
    assert made.as_dict()["replay"] == {"calls": calls, "max_abs_difference_um": difference}
    # the second and third zero take back 20 µm
    assert "up to 20 um" in made.sheet
    assert "Z by -10 um, X by -10 um" in made.sheet
    other = timed_program("sinumerik", BOTH, AXES)
    assert other.replay is None
    assert "Not executed here" in other.sheet


@pytest.mark.parametrize(
    ("target", "axes", "inverted", "said"),
    [
        ("heidenhain", AXES, (), "fanuc or sinumerik"),
        ("fanuc", {"Z": "Z"}, (), "no axis"),
        ("fanuc", {"Z": "Z", "drift of X": "Z"}, (), "as another"),
        ("sinumerik", {"Z": "B", "drift of X": "X"}, (), "the axis B"),
        ("fanuc", AXES, ("Y",), "Z, drift of X"),
    ],
)
def test_what_cannot_be_written_is_refused(target, axes, inverted, said):
    with pytest.raises(OptionError) as refused:
        timed_program(target, BOTH, axes, inverted)
    assert said in str(refused.value)


def test_an_operation_of_a_day_is_refused_because_the_clock_begins_again():
    with pytest.raises(OptionError, match="24 h"):
        timed_program("fanuc", {"Z": program(([700, 740], [0, 10]))}, AXES)


def test_what_corrects_nothing_is_executed_too_and_temperatures_have_no_subprogram():
    made = timed_program("fanuc", {"Z": program(([60], [0]))}, AXES)
    # the sign test, and the call after it
    assert made.replay == (2, 0.0)
    with pytest.raises(OptionError, match="temperatures"):
        timed_program("fanuc", {}, {})
