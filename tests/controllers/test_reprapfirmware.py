"""RepRapFirmware: the macro and what calls it, in an interpreter that knows nothing of the writer (`meta_commands`)."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from selector.controllers import Guard, Input, Output, OutputLimits, State, Term, read_model
from selector.controllers.guard.decided import decided_limits
from selector.controllers.replay.parts import Answers, Rows, reference_answers
from selector.controllers.replay.printers_executed import reprapfirmware_answers
from selector.controllers.writers.exported import ExportRefusedError
from selector.controllers.writers.fanuc import macro_model
from selector.controllers.writers.reprapfirmware import DAEMON, START, STEP, reprapfirmware_export
from tests.controllers import hostile
from tests.controllers.golden_text import golden, without_version
from tests.controllers.meta_commands import DateTime, Duet, Float, MetaError, literal
from tests.controllers.model_builders import PATENT, frame_model

SLEW_UM_PER_S = 1.0
GUARD = Guard(limits=(OutputLimits(output="Z", clamp_um=100.0, slew_um_per_s=SLEW_UM_PER_S),), on_fault="hold")
NOON = 1_790_000_000


def z_model(**changes: object):
    return frame_model(**({"guard": GUARD} | changes))


def board(model=None, files: dict[str, str] | None = None) -> Duet:
    """A board that has run config.g, with the sensors of the model."""
    model = model or z_model()
    duet = Duet(dict(reprapfirmware_export(model).files) | (files or {}))
    duet.analog = [{"lastReading": 20.0, "state": "ok"} for _ in model.inputs]
    duet.run(START)
    for k, item in enumerate(model.inputs):
        if item.unit == "degC":
            duet.console(f"set global.selector_number_{k + 1} = {k}")
    return duet


def passed(duet: Duet, seconds: int, *degc: float) -> list[float]:
    """So many seconds with these readings; the babysteps of Z after each [µm]."""
    for sensor, reading in zip(duet.analog, degc, strict=False):
        sensor["lastReading"] = reading
    found = []
    for _ in range(seconds):
        duet.up_s += 1
        duet.run(STEP)
        found.append(1000.0 * float(duet.axes[2].babystep))
    return found


def number(duet: Duet, name: str) -> Any:
    """A global variable as a number."""
    value = duet.globals[f"selector_{name}"]
    return float(value.value) if isinstance(value, Float) else value


def in_the_interpreter(model, rows: Rows) -> tuple[Answers, np.ndarray]:
    """What the macro gives row by row; readings as any sensor might show them, whole seconds."""
    duet, own = board(model), macro_model(model)
    names = [f"k0_{k}" for k in range(1, len(model.outputs) + 1)]
    names += [f"correction_{k}" for k in range(1, len(model.outputs) + 1)]
    names += ["mode", *(f"sensor_{k}" for k in range(1, len(model.inputs) + 1))]
    found, babysteps = [], []
    for k in range(len(rows)):
        duet.up_s += int(rows.dt_s[k])
        for i, item in enumerate(model.inputs):
            with np.errstate(all="ignore"):
                reading = np.float32(rows.readings[k, i])
            duet.analog[i]["lastReading"] = reading
            if item.unit != "degC":
                duet.globals[f"selector_reading_{i + 1}"] = Float(reading, 1)
        for axis in duet.axes:
            axis.homed = bool(rows.is_ready[k])
        duet.globals["selector_is_wanted"] = bool(rows.is_wanted[k])
        duet.globals["selector_is_restart"] = bool(rows.is_restart[k])
        with np.errstate(all="ignore"):
            duet.globals["selector_standstill_s"] = Float(np.float32(rows.standstill_s[k]), 1)
            for i, um in enumerate(rows.tests_um(len(model.outputs))[k]):
                duet.globals[f"selector_test_um_{i + 1}"] = Float(np.float32(um), 1)
        duet.run(STEP)
        found.append([number(duet, name) for name in names])
        babysteps.append([1000.0 * float(duet.axes["XYZ".index(o.axis_or_name)].babystep) for o in model.outputs])
    table, n = np.array(found, dtype=float), len(model.outputs)
    answers = Answers.empty(len(rows), n, len(model.inputs), 0)
    answers.k0_um[:], answers.correction_um[:] = table[:, :n], table[:, n : 2 * n]
    answers.mode[:], answers.sensors[:] = table[:, 2 * n], table[:, 2 * n + 1 :]
    assert own.outputs[0].position is None
    return answers, np.array(babysteps)


def whole_seconds(rows: Rows, seed: int) -> Rows:
    """As the firmware counts time."""
    dt_s = np.random.default_rng(seed).choice([0.0, 1.0, 2.0, 7.0, 60.0, 900.0, 2e6], len(rows),
                                              p=[0.05, 0.6, 0.2, 0.1, 0.04, 0.009, 0.001])  # fmt: skip
    return replace(rows, dt_s=dt_s, positions_m=np.zeros((len(rows), 0)))


KINDS = [{}, {"on_fault": "hold"}, {"outside_valid_range": "fault", "without_fallback": "ramp-to-zero"}]


@pytest.mark.parametrize("kind", KINDS)
def test_on_hostile_rows_it_is_the_guard_in_32_bits_to_the_last_bit(kind):
    model = hostile.model(**kind)
    rows = whole_seconds(hostile.rows(700, 11), 3)
    found, babysteps = in_the_interpreter(model, rows)
    expected = reference_answers(macro_model(model), rows, np.float32)
    for name in ("k0_um", "correction_um", "mode", "sensors"):
        assert np.array_equal(getattr(found, name), getattr(expected, name)), name
    assert len(set(found.mode.tolist())) >= 5, "the rows reach every mode"
    # nothing beyond clamp or slew is in the babysteps; a babystep of 0.02 mm has 2e-6 um
    assert np.abs(babysteps - found.correction_um).max() <= 4e-6
    limits, _ = decided_limits(model)
    for k, limit in enumerate(limits.values()):
        assert np.abs(babysteps[:, k]).max() <= limit.clamp_um + 4e-6
        steps = np.abs(np.diff(babysteps[:, k], prepend=0.0))
        is_on = rows.is_ready & ~rows.is_restart  # else it goes to 0 at once
        most = limit.slew_um_per_s * np.minimum(np.where(rows.dt_s <= 1e6, rows.dt_s, 0.0), 10.0)
        # a step may have what rounding has left of the one before
        assert (steps - most)[is_on].max() <= 1e-5


def test_the_replay_gives_the_same():
    model = hostile.model()
    rows = whole_seconds(hostile.rows(800, 5), 5)
    found, babysteps = in_the_interpreter(model, rows)
    replayed = reprapfirmware_answers(model, rows, reprapfirmware_export(model).files)
    assert np.array_equal(replayed.k0_um, found.k0_um)
    assert np.array_equal(replayed.mode, found.mode)
    assert np.abs(replayed.correction_um - babysteps).max() <= 4e-6


def test_many_sensors_have_conditions_part_by_part_and_are_the_guard():
    names = [f"T{k}" for k in range(1, 13)]
    inputs = tuple(Input(name=name, valid_min=-20.0, valid_max=20.0) for name in names)
    terms = tuple(Term(powers={name: 1}, coefficient=0.3) for name in names)
    output = Output(name="Z", axis="Z", intercept=0.0, terms=terms)
    model = z_model(inputs=inputs, outputs=(output,))
    text = reprapfirmware_export(model).files[STEP]
    assert "set var.holds = var.holds && " in text
    rng, n = np.random.default_rng(1), 300
    readings = 20.0 + np.cumsum(rng.normal(0.0, 0.02, (n, 12)), axis=0)
    readings[150:200, 11] = np.nan
    yes = np.ones(n, dtype=bool)
    rows = Rows(np.ones(n), readings, np.zeros((n, 0)), yes, yes, ~yes, np.zeros(n))
    found, _ = in_the_interpreter(model, rows)
    expected = reference_answers(model, rows, np.float32)
    assert np.array_equal(found.correction_um, expected.correction_um)
    assert {1, 2} <= set(found.mode.tolist())


def test_no_line_is_longer_than_the_firmware_reads():
    for model in (hostile.model(), read_model(PATENT)):
        for text in reprapfirmware_export(model).files.values():
            assert max(len(line.split(" ;")[0].strip()) for line in text.splitlines()) <= 255
    inputs = tuple(Input(name=f"T{k}", valid_min=0.0, valid_max=9.0) for k in range(1, 31))
    products = [Term(powers={f"T{k}": 3 for k in range(23, 31)}, coefficient=1e-9)]
    products += [Term(powers={item.name: 1}, coefficient=1.0) for item in inputs]
    output = Output(name="Z", axis="Z", intercept=0.0, terms=tuple(products))
    with pytest.raises(ExportRefusedError, match=r"a line of \d+ characters.*at most 255.*--degree 2"):
        reprapfirmware_export(z_model(inputs=inputs, outputs=(output,)))


def test_the_program_avoids_what_the_firmware_takes_for_something_else():
    """`<=` is true of NaN there, and a sign before a variable is an error where `&&` or `||` leave it out."""
    duet = Duet({})
    duet.globals |= {"nan": Float(np.float32(np.nan), 1), "x": Float(np.float32(1.0), 1), "is": False}
    duet.console("if global.nan <= 1.0\n  set global.is = true")
    assert duet.globals["is"] is True
    with pytest.raises(MetaError, match="expected numeric value after '-'"):
        duet.console("if global.x > 0.0 || global.x < -global.x\n  set global.is = true")
    text = reprapfirmware_export(hostile.model()).files[STEP]
    program = text[text.index("; the program") :]
    assert not re.search(r"(<|>)= (?!300)", program)
    assert not re.search(r"(?<![\w)}]) ?-(global|var|sensors|move)", program)


def test_numbers_are_read_as_they_are_meant():
    rng = np.random.default_rng(0)
    values = np.concatenate([rng.normal(size=3000) * 10.0 ** rng.integers(-30, 30, 3000), [1e9, 1e30, 5e-324, 0.0]])
    for value in np.abs(values).astype(np.float32):
        read = literal(str(value))
        assert isinstance(read, Float)
        assert read.value == value, value


@pytest.mark.parametrize("name", [STEP, START, DAEMON])
def test_golden_files(name):
    assert without_version(reprapfirmware_export(read_model(PATENT)).files[name]) == golden(f"reprapfirmware/{name}")


def test_a_model_without_an_axis_of_the_firmware_is_refused():
    of = z_model().outputs[0]
    for axis, name in (("A", "Z"), (None, "error"), ("U", "Z"), ("XY", "Z")):
        with pytest.raises(ExportRefusedError, match="X, Y or Z"):
            reprapfirmware_export(z_model(outputs=(of.model_copy(update={"axis": axis, "name": name}),), guard=Guard()))


def test_what_depends_on_the_position_is_left_out_and_told():
    found = {finding.id: finding for finding in reprapfirmware_export(hostile.model()).findings}
    assert found["position-part-left-out"].evidence["output"] == "Z"
    assert "babysteps cannot follow the position" in found["position-part-left-out"].statement
    assert "single-precision-bound" in found


def test_a_drift_is_followed_at_the_slew_limit():
    duet = board()
    passed(duet, 120, 20.0)
    added = passed(duet, 60, 23.0)
    assert added[29] == pytest.approx(-30.0, abs=1e-5)
    assert added[-1] == pytest.approx(-30.0, abs=1e-5)
    assert np.abs(np.diff([0.0, *added])).max() <= SLEW_UM_PER_S + 1e-5
    duet.up_s += 3600
    assert np.abs(passed(duet, 1, 25.0)[0] + 30.0) <= 10.0 * SLEW_UM_PER_S + 1e-5, "after an hour without a call"


@pytest.mark.parametrize(
    ("broken", "code"),
    [
        ({"state": "openCircuit", "lastReading": 2000.0}, 3),
        ({"state": "notReady", "lastReading": 0.0}, 3),
        ({"lastReading": float("nan")}, 3),
        ({"lastReading": -9999.0}, 4),
        ({"lastReading": 2000.0}, 5),
        (None, 3),
    ],
)
def test_a_broken_sensor_is_a_fault_and_what_is_applied_stays(broken, code):
    model = z_model(inputs=(Input(name="T1", valid_min=-20.0, valid_max=20.0, reading_min=-20.0, reading_max=120.0),))
    duet = board(model)
    passed(duet, 120, 20.0)
    passed(duet, 60, 23.0)
    before = float(duet.axes[2].babystep)
    duet.analog[0] = None if broken is None else {"state": "ok"} | broken
    passed(duet, 60)
    assert (number(duet, "sensor_1"), number(duet, "mode")) == (code, 2)
    assert float(duet.axes[2].babystep) == before
    duet.analog[0] = {"lastReading": 23.0, "state": "ok"}
    passed(duet, 70)
    assert (number(duet, "sensor_1"), number(duet, "mode")) == (0, 1)


def test_a_sensor_that_is_not_there_yet_is_no_start_reading():
    for wrong in (-1, 7):
        duet = board()
        duet.console(f"set global.selector_number_1 = {wrong}")
        assert set(passed(duet, 120, 20.0)) == {0.0}
        assert (number(duet, "sensor_1"), number(duet, "has_start_1")) == (3, False)
        duet.console("set global.selector_number_1 = 0")
        passed(duet, 120, 25.0)
        assert number(duet, "start_1") == 25.0


def test_babysteps_of_others_stay():
    duet = board()
    passed(duet, 120, 20.0)
    duet.babystep("Z", 0.05)
    added = passed(duet, 60, 23.0)
    assert added[-1] == pytest.approx(50.0 - 30.0, abs=1e-4)
    duet.babystep("Z", -0.02)
    assert passed(duet, 10, 23.0)[-1] == pytest.approx(0.0, abs=1e-4)
    assert passed(duet, 60, 20.0)[-1] == pytest.approx(30.0, abs=1e-4)
    duet.axes[2].homed = False
    assert passed(duet, 1, 23.0)[-1] == pytest.approx(30.0, abs=1e-4)


def test_who_clears_babysteps_gets_the_correction_back_at_the_slew_limit():
    duet = board()
    passed(duet, 120, 20.0)
    duet.babystep("Z", 0.05)
    passed(duet, 60, 23.0)
    duet.console("M290 R0 Z0")
    added = passed(duet, 60, 23.0)
    assert np.abs(np.diff([0.0, *added])).max() <= SLEW_UM_PER_S + 1e-5
    assert added[-1] == pytest.approx(-30.0, abs=1e-4)


def test_over_a_long_print_nothing_adds_up():
    duet, rng = board(), np.random.default_rng(2)
    passed(duet, 120, 20.0)
    for _ in range(400):
        passed(duet, 2, 20.0 + 3.0 * rng.random())
    assert passed(duet, 60, 20.0)[-1] == pytest.approx(0.0, abs=4e-6)


def test_an_axis_that_is_not_homed_is_not_corrected_and_comes_back_slowly():
    duet = board()
    passed(duet, 120, 20.0)
    passed(duet, 60, 23.0)
    duet.axes[2].homed = False
    assert passed(duet, 2, 23.0) == pytest.approx([0.0, 0.0], abs=1e-6)
    assert number(duet, "mode") == 0
    duet.axes[2].homed = True
    assert passed(duet, 3, 23.0) == pytest.approx([-1.0, -2.0, -3.0], abs=1e-5)


def test_homing_that_measures_the_error_away():
    duet = board()
    passed(duet, 120, 20.0)
    passed(duet, 60, 23.0)
    duet.console("set global.selector_is_zero_1 = true")
    assert passed(duet, 5, 23.0) == pytest.approx([0.0] * 5, abs=1e-6)
    assert number(duet, "is_zero_1") is False
    assert passed(duet, 30, 24.0)[-1] == pytest.approx(-10.0, abs=1e-5)


def test_a_homing_that_ends_within_a_call_is_not_lost():
    duet = board()
    passed(duet, 120, 20.0)
    passed(duet, 60, 23.0)
    text = duet.files[STEP]
    at = text.index("  set global.selector_is_zero_1 = false")
    # homez.g ends while the call is at its end
    duet.files[STEP] = (
        text[:at].rsplit("\n", 2)[0] + "\nset global.selector_is_zero_1 = true\nif var.is_zero_1\n" + text[at:]
    )
    passed(duet, 1, 23.0)
    duet.files[STEP] = text
    assert passed(duet, 1, 23.0) == pytest.approx([0.0], abs=1e-6)


def test_the_sign_test_commands_and_a_whole_number_will_do():
    for typed in ("10.0", "10"):
        duet = board()
        duet.console("set global.selector_is_wanted = false")
        passed(duet, 5, 20.0)
        duet.console(f"set global.selector_test_um_1 = {typed}")
        assert passed(duet, 12, 20.0)[-1] == pytest.approx(10.0, abs=1e-5)
        assert number(duet, "mode") == 5
        duet.console("set global.selector_test_um_1 = 0")
        assert passed(duet, 12, 20.0)[-1] == pytest.approx(0.0, abs=1e-5)
    assert reprapfirmware_export(z_model()).sign_test.commanded[0].command == "set global.selector_test_um_1 = 10.0"


def memory_model():
    """A rise and its memory."""
    terms = (Term(powers={"T1": 1}, coefficient=10.0), Term(powers={"late": 1}, coefficient=4.0))
    return z_model(
        states=(State(name="late", source="T1", tau_s=3600.0),),
        outputs=(Output(name="Z", axis="Z", intercept=0.0, terms=terms),),
    )


def kept_of(duet: Duet) -> str:
    """Name of the file with what is kept."""
    (name,) = [name for name in duet.files if name.startswith("selector_kept_")]
    return name


def warm(model) -> Duet:
    """Switched on cold, warm for a quarter of an hour, the clock of the network known."""
    duet = board(model)
    duet.time = DateTime(NOON)
    passed(duet, 120, 20.123456)
    passed(duet, 900, 23.0)
    duet.time = DateTime(NOON + 900)
    passed(duet, 310, 23.0)
    return duet


def test_a_warm_restart_goes_on_with_start_readings_and_memory():
    model = memory_model()
    was = warm(model)
    name = kept_of(was)
    again = board(model, {name: was.files[name]})
    again.time = DateTime(NOON + 900 + 600)
    added = passed(again, 200, 23.0)
    assert number(again, "start_1") == pytest.approx(20.123456, abs=1e-5)
    # ten minutes more of memory
    expected = number(was, "level_1") + (2.876544 - number(was, "level_1")) * (
        1.0 - (1.0 + 600.0 / 16.0 / 3600.0) ** -16
    )
    after = board(model, {name: was.files[name]})
    after.time = DateTime(NOON + 900 + 600)
    passed(after, 65, 23.0)
    assert number(after, "level_1") == pytest.approx(expected, rel=0.03)
    assert added[-1] == pytest.approx(-10.0 * 2.876544 - 4.0 * number(again, "level_1"), abs=0.01)
    assert added[0] == 0.0
    assert np.abs(np.diff(added)).max() <= SLEW_UM_PER_S + 1e-5


def test_without_a_clock_memory_begins_as_after_a_long_standstill():
    model = memory_model()
    was = warm(model)
    again = board(model, {kept_of(was): was.files[kept_of(was)]})
    passed(again, 70, 23.0)
    assert number(again, "start_1") == pytest.approx(20.123456, abs=1e-5)
    assert number(again, "level_1") == pytest.approx(2.8765, abs=0.01)


@pytest.mark.parametrize(
    ("saved", "now", "standstill_s"),
    [
        (NOON, NOON + 600, 600.0 - 330.0),  # five minutes and a half after `saved` it was written
        (NOON, NOON - 3600, 1e6),
        (NOON, 5, 1e6),
        (None, 5, 1e6),
        (None, NOON, 1e6),
        (NOON, None, 1e6),
    ],
)
def test_a_clock_that_was_not_set_or_was_put_back_counts_as_a_long_standstill(saved, now, standstill_s):
    model = memory_model()
    was = board(model)
    passed(was, 120, 20.0)
    was.time = None if saved is None else DateTime(saved + 330)
    passed(was, 210, 20.0)
    again = board(model, {kept_of(was): was.files[kept_of(was)]})
    again.time = None if now is None else DateTime(now)
    passed(again, 1, 20.0)
    assert number(again, "standstill_s") == standstill_s


def test_what_a_power_failure_has_cut_off_is_not_believed():
    model = memory_model()
    was = warm(model)
    name, whole = kept_of(was), was.files[kept_of(was)]
    other = board(z_model(), {name: whole})
    passed(other, 120, 23.0)
    assert number(other, "start_1") == 23.0, "kept by another model"
    for end in range(0, len(whole), 19):
        again = board(model, {name: whole[:end]})
        again.time = DateTime(NOON + 1000)
        for _ in range(2):
            try:
                passed(again, 1, 23.0)
            except MetaError:  # told in the console; the next call goes on
                continue
        passed(again, 70, 23.0)
        start = number(again, "start_1")
        assert start in (23.0, pytest.approx(20.123456, abs=1e-5)), whole[:end]
    assert start == pytest.approx(20.123456, abs=1e-5), "but for the last lines it is there"


def test_daemon_calls_it_every_second_until_it_is_told_to_end():
    def second(duet: Duet) -> None:
        if duet.up_s == 30:
            duet.console("set global.selector_is_running = false")

    duet = board()
    duet.second = second
    duet.run(DAEMON)
    assert duet.up_s == 30
    assert number(duet, "dt_s") == 1.0
    duet.run(DAEMON)
    assert duet.up_s == 30, "and again ten seconds later"
    Duet(duet.files).run(DAEMON)  # config.g has not run: nothing happens


def test_config_that_runs_a_second_time_changes_nothing():
    duet = board()
    passed(duet, 120, 23.0)
    before = dict(duet.globals)
    assert duet.said == []
    duet.run(START)
    assert duet.globals == before
    (said,) = duet.said
    assert "restart" in said


def test_a_second_model_on_the_board_is_told():
    duet = board()
    duet.files |= reprapfirmware_export(z_model(name="another")).files
    duet.run(START)
    (said,) = duet.said
    assert "Of two models export one" in said


def test_names_of_a_model_do_not_leave_their_comments():
    evil = "T1\" ; M112 {global.x} layer 3 '"
    model = z_model(
        name=evil,
        inputs=(Input(name=evil, valid_min=0.0, valid_max=9.0),),
        outputs=(Output(name="Z", axis="Z", intercept=0.0, terms=(Term(powers={evil: 1}, coefficient=2.0),)),),
    )
    for text in reprapfirmware_export(model).files.values():
        assert text.isascii()
        # a comment without an indent would be looked at by the firmware
        assert not any(line.startswith(";") for line in text.splitlines())
        assert "M112" not in "\n".join(line.split(";")[0] for line in text.splitlines())
    passed(board(model), 3, 20.0)


def test_the_sheet_says_what_the_firmware_does_silently():
    told = " ".join(reprapfirmware_export(z_model()).silently)
    for needed in ("M290 R0 Z0", "resurrect.g", "CoreXZ", "not tried by the authors", "stuck_after_s"):
        assert needed in told
