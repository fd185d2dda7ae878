"""Klipper: the extra, called by a stand-in for Klipper's printer; Klipper itself is in `test_klipper_itself.py`."""

from __future__ import annotations

import json
import re
import subprocess
import time
from dataclasses import fields, replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from selector.controllers import Guard, Input, Output, OutputLimits, PositionPart, State, Term, read_model
from selector.controllers.evaluator import axes_of
from selector.controllers.guard.decided import decided_limits
from selector.controllers.model_file import equations_sha256
from selector.controllers.replay.printers_executed import Printer, klipper_answers
from selector.controllers.writers.exported import ExportRefusedError
from selector.controllers.writers.klipper import COMMAND, MOST_INPUTS, klipper_export, klipper_extra
from tests.controllers import hostile
from tests.controllers.golden_text import golden, without_version
from tests.controllers.model_builders import PATENT, frame_model
from tests.controllers.plain_guard import plain_answers
from tests.controllers.test_generated_programs import KINDS, same

PYTHON_2 = next((Path.home() / ".pyenv" / "versions").glob("2.7.*/bin/python2.7"), Path("/usr/bin/python2.7"))
SLEW_UM_PER_S = 1.0
GUARD = Guard(limits=(OutputLimits(output="Z", clamp_um=100.0, slew_um_per_s=SLEW_UM_PER_S),))


def z_model(**changes: object):
    return frame_model(**({"guard": GUARD} | changes))


def started(model=None, options=None, arguments=None) -> Printer:
    """Klipper ready and homed, everything at 20 °C for two minutes, nothing to be corrected."""
    printer = Printer(klipper_extra(model or z_model()), options, arguments)
    passed(printer, 120, 20.0)
    printer.extra.move([100.0, 50.0, 5.0, 0.0], 100.0)
    return printer


def passed(printer: Printer, seconds: int, degc: object, *, is_heard: bool = True) -> None:
    """So many seconds with these readings."""
    printer.readings = list(degc) if isinstance(degc, list) else [degc] * len(printer.readings)
    for _ in range(seconds):
        printer.now += 1.0
        for sensor in printer.sensors.values():
            if is_heard and hasattr(sensor, "speak"):
                sensor.speak(printer.now, 0.0)
        printer.tick(printer.now)


def z_um(printer: Printer) -> float:
    """What is added to Z now."""
    return 1000.0 * printer.extra.applied[2]


def along_x(printer: Printer, moves: int, *, length: float = 10.0, speed: float = 10.0) -> list[float]:
    """Moves of X forth and back at Z 5, and what was added to Z at the end of each [µm]."""
    found = []
    for _ in range(moves):
        x = 100.0 + (length if printer.at[0] == 100.0 else 0.0)
        printer.extra.move([x, 50.0, 5.0, 0.0], speed)
        found.append(1000.0 * (printer.sent[-1][2] - 5.0))
    return found


@pytest.mark.parametrize("kind", KINDS)
def test_the_extra_is_the_guard_bit_for_bit(kind):
    model = hostile.model(**kind)
    rows = hostile.rows(4000, 7, len(axes_of(model)))
    assert same(klipper_answers(model, rows), plain_answers(model, rows))


def test_every_axis_that_is_never_homed_anew_is_corrected_as_by_the_other_targets():
    model = z_model(
        states=(State(name="late", source="T1", tau_s=600.0),),
        outputs=(
            Output(name="Z", axis="Z", intercept=-2.0, terms=(Term(powers={"T1": 2, "late": 1}, coefficient=0.1),)),
        ),
    )
    rows = hostile.rows(3000, 5, 0)
    one = replace(rows, readings=rows.readings[:, :1], test_um=rows.test_um[:, :1])
    assert same(klipper_answers(model, one), plain_answers(model, one))


@pytest.mark.parametrize("name", ["selector_correction.py", "selector_correction.cfg"])
def test_golden_files(name):
    assert without_version(klipper_export(read_model(PATENT)).files[name]) == golden(f"klipper/{name}")


def test_a_model_without_an_axis_of_klipper_is_refused():
    of = z_model().outputs[0]
    for axis, name in (("A", "Z"), (None, "error"), ("U", "Z"), ("XY", "Z")):
        with pytest.raises(ExportRefusedError, match="X, Y or Z"):
            klipper_export(z_model(outputs=(of.model_copy(update={"axis": axis, "name": name}),), guard=Guard()))
    part = PositionPart(axis="C", reference_m=0.0, valid_min_m=0.0, valid_max_m=0.2, intercept=1.0, terms=())
    with pytest.raises(ExportRefusedError, match="'C'"):
        klipper_export(z_model(outputs=(of.model_copy(update={"position": part}),)))
    # an output without an axis is that of its name, and small letters will do
    files = klipper_export(z_model(outputs=(of.model_copy(update={"axis": None, "name": "x"}),), guard=Guard())).files
    assert "(1, 0, " in files["selector_correction.py"]


def test_too_many_inputs_are_refused():
    def many(n):
        return z_model(inputs=tuple(Input(name=f"T{k}", valid_min=0.0, valid_max=9.0) for k in range(1, n + 1)))

    klipper_export(many(MOST_INPUTS))
    with pytest.raises(ExportRefusedError, match="101 inputs"):
        klipper_export(many(MOST_INPUTS + 1))


def test_names_of_a_model_leave_neither_remarks_nor_their_line():
    evil = "T1'] [force_move] enable_force_move: True #*# <- SAVE_CONFIG -> '''; import os #"
    model = z_model(
        name=evil,
        inputs=(Input(name=evil, valid_min=0.0, valid_max=9.0, place="'''"),),
        outputs=(Output(name="Z", axis="Z", intercept=0.0, terms=(Term(powers={evil: 1}, coefficient=2.0),)),),
    )
    files = klipper_export(model).files
    assert all(text.isascii() for text in files.values())
    section = files["selector_correction.cfg"].splitlines()
    assert [line for line in section if line and not line.startswith("#")] == ["[selector_correction]"]
    assert not any(line.startswith("#*#") for line in section)
    printer = Printer(files["selector_correction.py"])
    assert len(printer.readings) == 1
    code = [line for line in files["selector_correction.py"].splitlines() if line.startswith("import")]
    assert code == ["import logging", "import math", "import os", "import time"]


def test_a_sensor_whose_name_klipper_can_have_is_named_and_others_are_asked_for():
    model = z_model(
        inputs=(Input(name="frame", valid_min=0.0, valid_max=9.0),
                Input(name="Ständer 2", valid_min=0.0, valid_max=9.0),
                Input(name="n", role="spindle_speed", unit="rpm", reference="absolute", valid_min=0.0, valid_max=9.0)),
        outputs=(Output(name="Z", axis="Z", intercept=0.0, terms=(Term(powers={"frame": 1}, coefficient=2.0),)),),
    )  # fmt: skip
    lines = klipper_export(model).files["selector_correction.cfg"].splitlines()
    assert "sensor_1: temperature_sensor frame" in lines
    assert {"#sensor_2:", "#sensor_3:", "#field_3:"} <= set(lines)
    assert any("Staender 2" in line for line in lines)


def test_no_move_jumps_and_none_is_faster_than_the_slew_limit():
    printer = started()
    passed(printer, 60, 23.0)  # -30 um wanted
    assert z_um(printer) == 0.0, "nothing moves between moves"
    added = [0.0, *along_x(printer, 40)]  # a second each
    steps = np.abs(np.diff(added))
    assert steps.max() <= SLEW_UM_PER_S * 1.0 + 1e-9
    assert added[30] == pytest.approx(-30.0)
    assert added[-1] == pytest.approx(-30.0)


def test_a_short_move_after_a_long_pause_carries_its_own_share_only():
    printer = started()
    passed(printer, 600, 25.0)
    (added,) = along_x(printer, 1, length=0.1, speed=100.0)
    assert added == pytest.approx(-0.001 * SLEW_UM_PER_S)


def test_a_move_of_the_extruder_alone_stays_one():
    printer = started()
    passed(printer, 60, 23.0)
    along_x(printer, 5)
    before = printer.sent[-1]
    printer.extra.move([*before[:2], 5.0, 3.0], 40.0)
    assert printer.sent[-1][:3] == before[:3]
    assert printer.sent[-1][3] == 3.0


def test_further_axes_and_the_extruder_pass_through():
    printer = started()
    printer.extra.move([1.0, 2.0, 3.0, 4.0, 5.0, 6.0], 10.0)
    assert printer.sent[-1] == (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 10.0)


def test_what_g_code_asks_for_is_what_it_gets_back():
    printer = started()
    passed(printer, 60, 23.0)
    along_x(printer, 40)
    assert printer.at[2] == pytest.approx(5.0 - 0.030)
    assert printer.extra.get_position()[:3] == pytest.approx([100.0, 50.0, 5.0])


def test_a_move_that_klipper_refuses_changes_nothing():
    printer = started()
    passed(printer, 60, 23.0)
    along_x(printer, 5)
    known = list(printer.extra.applied), list(printer.extra.followed), list(printer.extra.last)

    def refuse(_position, _speed):
        raise ValueError("Move out of range")

    taken, printer.extra.next_transform = printer.extra.next_transform, SimpleNamespace(move=refuse)
    with pytest.raises(ValueError, match="out of range"):
        printer.extra.move([900.0, 50.0, 5.0, 0.0], 10.0)
    printer.extra.next_transform = taken
    assert (printer.extra.applied, printer.extra.followed, printer.extra.last) == known


def test_a_correction_does_not_push_a_move_over_the_end_of_its_axis():
    printer = started()
    passed(printer, 60, 23.0)
    along_x(printer, 40)
    limits = {"homed_axes": "xyz", "axis_minimum": [0.0, 0.0, 0.0], "axis_maximum": [200.0, 200.0, 200.0]}
    printer.get_status = lambda _time: limits
    printer.extra.move([110.0, 50.0, 0.01, 0.0], 10.0)
    assert printer.sent[-1][2] == 0.0
    # and is whole again away from there, without having to be slewed anew
    printer.extra.move([110.0, 50.0, 5.0, 0.0], 10.0)
    assert printer.sent[-1][2] == pytest.approx(4.97)
    # what G-code itself sends beyond is Klipper's to refuse
    printer.extra.move([110.0, 50.0, -1.0, 0.0], 10.0)
    assert printer.sent[-1][2] == pytest.approx(-1.03)


def test_homing_measures_the_error_away():
    printer = started()
    passed(printer, 120, 23.0)
    along_x(printer, 40)
    printer.at[2] = 0.0  # at the endstop
    printer.run("G28")
    assert printer.extra.get_position()[2] == 0.0
    passed(printer, 5, 23.0)
    assert along_x(printer, 3) == pytest.approx([0.0, 0.0, 0.0])
    passed(printer, 60, 24.0)
    assert along_x(printer, 30)[-1] == pytest.approx(-10.0), "the error since then is corrected"
    passed(printer, 60, 20.0)
    assert along_x(printer, 60)[-1] == pytest.approx(30.0)


def test_homing_beyond_the_clamp_measures_the_whole_error_away():
    printer = started()
    passed(printer, 300, 35.0)  # 150 um, of which the clamp lets 100
    assert printer.extra.get_status(0.0)["wanted_um"]["z"] == -100.0
    printer.run("G28")
    passed(printer, 2, 35.0)
    passed(printer, 60, 36.0)
    assert along_x(printer, 30)[-1] == pytest.approx(-10.0)


@pytest.mark.parametrize(("asked", "expected_um"), [({"X": ""}, -30.0), ({"Z": ""}, 0.0), ({}, 0.0)])
def test_homing_of_another_axis_leaves_the_correction(asked, expected_um):
    printer = started()
    passed(printer, 120, 23.0)
    along_x(printer, 40)
    printer.run("G28", **asked)
    passed(printer, 60, 23.0)
    assert along_x(printer, 40)[-1] == pytest.approx(expected_um)


def test_inside_of_a_homing_override_the_real_homing_counts():
    printer = started()

    def override(_gcmd):
        # homes X only, whatever was asked
        if not is_inside:
            is_inside.append(True)
            printer.run("G28", X="")

    is_inside: list[bool] = []
    passed(printer, 120, 23.0)
    along_x(printer, 40)
    printer.extra.real_G28 = override
    printer.run("G28")
    assert z_um(printer) == pytest.approx(-30.0)


def test_with_an_endstop_that_does_not_see_the_error_the_correction_goes_on():
    printer = started(options={"zero_at_homing": False})
    passed(printer, 120, 23.0)
    along_x(printer, 40)
    printer.run("G28")
    passed(printer, 5, 23.0)
    assert along_x(printer, 3) == pytest.approx([-30.0] * 3)


def test_homing_before_sensors_are_believed_counts_from_the_first_believed_reading():
    first = started()
    passed(first, 60, 23.0)
    again = Printer(klipper_extra(z_model()))
    for name in ("start_1", "has_start_1", "has_memory_1"):
        setattr(again.extra.program, name, getattr(first.extra.program, name))
    again.extra.program.is_restart = True
    passed(again, 1, 23.0)
    again.run("G28")
    passed(again, 120, 23.0)
    assert along_x(again, 5) == pytest.approx([0.0] * 5)
    passed(again, 60, 24.0)
    assert along_x(again, 30)[-1] == pytest.approx(-10.0)


def test_a_slope_is_followed_along_the_axis_and_zero_where_it_was_homed():
    part = PositionPart(
        axis="X", reference_m=0.1, valid_min_m=0.0, valid_max_m=0.2, intercept=0.0,
        terms=(Term(powers={"T1": 1}, coefficient=20.0),),
    )  # fmt: skip
    limits = OutputLimits(output="Z", clamp_um=100.0, slew_um_per_s=10.0, slope_clamp_um_per_m=1000.0)
    model = z_model(
        outputs=(z_model().outputs[0].model_copy(update={"position": part}),), guard=Guard(limits=(limits,))
    )
    printer = started(model)
    passed(printer, 300, 25.0)  # Z: 50 um, and 100 um/m along X
    along_x(printer, 60)
    for x, expected in ((0.0, -40.0), (100.0, -50.0), (200.0, -60.0), (250.0, -60.0), (100.0, -50.0)):
        printer.extra.move([x, 50.0, 5.0, 0.0], 100.0)
        assert 1000.0 * (printer.sent[-1][2] - 5.0) == pytest.approx(expected, abs=1e-6)
    printer.at[0] = 250.0  # beyond the places that the model has seen: as at 200
    printer.extra.get_position()
    printer.run("G28", Z="")
    passed(printer, 120, 25.0)
    for x, expected in ((200.0, 0.0), (100.0, 10.0), (0.0, 20.0)):
        printer.extra.move([x, 50.0, 5.0, 0.0], 0.1)
        assert 1000.0 * (printer.sent[-1][2] - 5.0) == pytest.approx(expected, abs=1e-6)


def test_what_is_left_from_one_place_and_what_is_wanted_at_another_stay_within_the_clamp():
    part = PositionPart(axis="X", reference_m=0.1, valid_min_m=0.0, valid_max_m=0.2, intercept=0.0, terms=())
    printer = started(z_model(outputs=(z_model().outputs[0].model_copy(update={"position": part}),)))
    printer.extra.wanted[0] = (0.0, 1000.0)
    printer.extra.followed[2] = 0.1
    printer.extra.move([200.0, 50.0, 5.0, 0.0], 300.0)
    assert z_um(printer) == pytest.approx(100.0)


def test_switched_off_in_the_middle_of_a_print_it_goes_to_zero_slowly_and_back():
    printer = started()
    passed(printer, 120, 23.0)
    along_x(printer, 40)
    printer.run(COMMAND, ENABLE=0)
    added = []
    for _ in range(40):
        passed(printer, 1, 23.0)
        added += along_x(printer, 1)
    assert np.abs(np.diff([-30.0, *added])).max() <= SLEW_UM_PER_S + 1e-9
    assert added[-1] == 0.0
    printer.run(COMMAND, ENABLE=1)
    passed(printer, 60, 23.0)
    assert along_x(printer, 40)[-1] == pytest.approx(-30.0)


def test_a_sensor_that_falls_silent_is_missing_after_the_time_for_it():
    printer = started(options={"stale_after": 10.0})
    passed(printer, 120, 23.0)
    passed(printer, 9, 23.0, is_heard=False)
    assert printer.extra.get_status(0.0)["sensors"] == [0]
    passed(printer, 3, 23.0, is_heard=False)
    assert printer.extra.get_status(0.0)["sensors"] == [3]
    passed(printer, 70, 23.0)
    assert printer.extra.get_status(0.0)["sensors"] == [0]


@pytest.mark.parametrize("reading", [None, "n/a", float("nan"), 400.0])
def test_what_is_no_reading_is_a_fault_and_the_correction_goes_to_zero(reading):
    model = z_model(
        inputs=(Input(name="T1", valid_min=-20.0, valid_max=20.0, reading_max=90.0),),
        guard=GUARD.model_copy(update={"on_fault": "ramp-to-zero"}),
    )
    printer = started(model)
    passed(printer, 120, 23.0)
    along_x(printer, 40)
    passed(printer, 60, reading)
    assert printer.extra.program.sensor_1 == (5 if reading == 400.0 else 3)
    added = along_x(printer, 40)
    assert added[0] == pytest.approx(-29.0)
    assert added[-1] == 0.0


def test_zero_before_the_first_reading_is_none():
    # an object that tells nobody when it is read: what it shows before that is 0.0
    printer = Printer(klipper_extra(z_model()))
    printer.extra.heard.clear()
    passed(printer, 120, 0.0, is_heard=False)
    assert printer.extra.program.sensor_1 == 3
    passed(printer, 120, 23.0, is_heard=False)
    assert printer.extra.program.sensor_1 == 0
    assert printer.extra.program.start_1 == 23.0
    passed(printer, 1, 0.0, is_heard=False)
    assert printer.extra.program.sensor_1 == 1, "now it is a reading, below the range of the model"


def test_axes_that_are_not_homed_and_a_printer_that_is_shut_down_are_not_corrected():
    printer = started()
    passed(printer, 120, 23.0)
    along_x(printer, 40)
    printer.homed = "xy"
    passed(printer, 2, 23.0)
    assert printer.extra.get_status(0.0)["mode"] == 0
    before = printer.sent[-1][2]
    assert along_x(printer, 1) == [pytest.approx(1000.0 * (before - 5.0))], "an axis without a place is left alone"
    printer.homed, printer.is_off = "xyz", True
    passed(printer, 2, 23.0)
    assert printer.extra.get_status(0.0)["mode"] == 0
    printer.is_off = False
    passed(printer, 60, 23.0)
    assert along_x(printer, 1)[0] == pytest.approx(-30.0, abs=1.1)


def test_the_sign_test_commands_and_moves():
    printer = started()
    printer.run(COMMAND, ENABLE=0)
    passed(printer, 5, 20.0)
    printer.run(COMMAND, TEST_Z=10.0)
    passed(printer, 11, 20.0)
    printer.run(COMMAND, MOVE=1)
    assert "mode 5" in printer.said
    assert "z: +10.0 um wanted, +10.0 um applied" in printer.said
    assert printer.at[2] == pytest.approx(5.010)
    assert (printer.at[2] - 5.0) / printer.sent[-1][-1] >= 10.0 / SLEW_UM_PER_S - 1e-6, "no faster than the slew limit"
    sheet = klipper_export(z_model()).sign_test
    assert sheet.commanded[0].command.startswith(f"{COMMAND} TEST_Z=10;")
    printer.run(COMMAND, TEST_Z=0.0)
    passed(printer, 12, 20.0)
    printer.run(COMMAND, MOVE=1)
    assert printer.at[2] == pytest.approx(5.0)
    printer.homed = "xy"
    with pytest.raises(ValueError, match="axis Z is not homed; G28"):
        printer.run(COMMAND, MOVE=1)


def test_what_is_asked_is_told():
    printer = started()
    passed(printer, 60, 23.0)
    printer.run(COMMAND)
    assert ": ENABLE=1, mode 1, follows the model" in printer.said
    assert "z: -30.0 um wanted, +0.0 um applied" in printer.said
    assert f"Thermal correction {equations_sha256(z_model())[:16]}: " in printer.said
    assert "sensor_1 (temperature_sensor s1): 23.00, ok" in printer.said
    status = printer.extra.get_status(0.0)
    assert status == {
        "enabled": True, "mode": 1, "state": "follows the model", "wanted_um": {"z": -30.0}, "applied_um": {"z": 0.0},
        "sensors": [0],
    }  # fmt: skip
    json.dumps(status)  # what Moonraker makes of it
    assert printer.extra.stats(0.0) == (False, "selector_correction: mode=1 z=0.0")
    passed(printer, 5, None)
    printer.run(COMMAND)
    assert "-, no reading" in printer.said


def test_new_start_readings_on_demand():
    printer = started()
    passed(printer, 60, 23.0)
    printer.run(COMMAND, NEW_START=1)
    passed(printer, 120, 23.0)
    assert printer.extra.program.start_1 == 23.0
    assert printer.extra.get_status(0.0)["wanted_um"]["z"] == 0.0
    passed(printer, 60, 25.0)
    printer.run("G28")  # what counts as none is now 20 um, from the start at 23
    passed(printer, 2, 25.0)
    passed(printer, 60, 26.0)
    assert along_x(printer, 30)[-1] == pytest.approx(-10.0)
    printer.run(COMMAND, NEW_START=1)
    passed(printer, 120, 26.0)
    assert np.diff([-10.0, *along_x(printer, 30)]).max() <= SLEW_UM_PER_S + 1e-9
    assert printer.extra.get_status(0.0)["wanted_um"]["z"] == 0.0
    passed(printer, 60, 27.0)
    assert printer.extra.get_status(0.0)["wanted_um"]["z"] == pytest.approx(-10.0)


def test_a_restart_goes_on_with_the_start_readings_of_the_same_model(tmp_path, monkeypatch):
    arguments = {"config_file": str(tmp_path / "printer.cfg")}
    kept = tmp_path / "selector_correction_kept.txt"
    printer = started(arguments=arguments)
    passed(printer, 400, 23.0)
    assert "start_1 20.0" in kept.read_text(), "every five minutes"
    kept.unlink()
    printer.handlers["klippy:disconnect"]()
    assert not list(tmp_path.glob("*.new"))
    saved = kept.read_text()
    again = Printer(klipper_extra(z_model()), arguments=arguments)
    passed(again, 120, 23.0)
    assert again.extra.program.start_1 == 20.0
    assert along_x(again, 40)[-1] == pytest.approx(-30.0)
    other = Printer(klipper_extra(z_model(name="frame", outputs=z_model().outputs, inputs=(
        Input(name="T1", valid_min=-20.0, valid_max=21.0),))), arguments=arguments)  # fmt: skip
    passed(other, 120, 23.0)
    assert other.extra.program.start_1 == 23.0
    for damaged in ("", "model", saved.replace("20.0", "x"), saved[: len(saved) // 2]):
        kept.write_text(damaged)
        anew = Printer(klipper_extra(z_model()), arguments=arguments)
        passed(anew, 120, 23.0)
        assert anew.extra.program.start_1 == 23.0
    for saved_at, least_s, most_s in ((time.time() - 600.0, 600.0, 660.0), (time.time() + 3600.0, 1e6, 1e6)):
        kept.write_text(re.sub(r"saved-at \d+", f"saved-at {saved_at:.0f}", saved))
        anew = Printer(klipper_extra(z_model()), arguments=arguments)
        assert least_s - 1.0 <= anew.extra.program.standstill_s <= most_s
    kept.write_text(saved.replace("start_1 20.0", "start_1 nan"))
    anew = Printer(klipper_extra(z_model()), arguments=arguments)
    passed(anew, 120, 23.0)
    assert anew.extra.program.start_1 == 23.0


def test_a_folder_that_cannot_be_written_stops_no_print(tmp_path, caplog):
    arguments = {"config_file": str(tmp_path / "nowhere" / "printer.cfg")}
    printer = started(arguments=arguments)
    passed(printer, 400, 23.0)
    assert "cannot be written" in caplog.text
    assert along_x(printer, 40)[-1] == pytest.approx(-30.0)


def test_a_test_of_a_configuration_overwrites_nothing(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    printer = started()
    passed(printer, 400, 23.0)
    printer.handlers["klippy:disconnect"]()
    assert not list(tmp_path.iterdir())


def test_a_wrong_configuration_says_what_to_do():
    text = klipper_extra(hostile.model())
    with pytest.raises(ValueError, match=r"sensor_2.*temperature_sensor s1.*a second time.*this one is T2"):
        Printer(text, {"sensor_2": "temperature_sensor s1"})

    class Renamed(Printer):
        def lookup_object(self, name, *default):
            return super().lookup_object({"temperature_sensor typo": "nothing"}.get(name, name), *default)

    with pytest.raises(ValueError, match=r"sensor_1 \(T1\) is 'temperature_sensor typo', which is not in the config"):
        Renamed(text, {"sensor_1": "temperature_sensor typo"})
    with pytest.raises(ValueError, match=r"has no 'humidity'\. Temperatures are in: temperature_sensor s1, "):
        Printer(text, {"field_3": "humidity"})

    class WithOther(Printer):
        def lookup_object(self, name, *default):
            return self if name == "z_thermal_adjust" else super().lookup_object(name, *default)

    with pytest.raises(ValueError, match="both correct Z"):
        WithOther(text)


@pytest.mark.parametrize("seed", range(6))
def test_whatever_comes_no_move_jumps_and_g_code_keeps_its_places(seed):
    """Hostile readings, switches, sign tests, homing and moves of any length, in any order."""
    rng = np.random.default_rng(seed)
    model = hostile.model()
    limits, _ = decided_limits(model)
    rows = hostile.rows(3000, 50 + seed)
    printer, slope = Printer(klipper_extra(model)), 0.0
    for k in range(len(rows)):
        printer.now += float(rng.choice([0.3, 1.0, 5.0]))
        printer.readings = rows.readings[k].tolist()
        for sensor in printer.sensors.values():
            if hasattr(sensor, "speak"):
                sensor.speak(printer.now, 0.0)
        printer.homed = "xyz" if rows.is_ready[k] else "xy"
        tests = dict(zip(("TEST_Z", "TEST_Y"), rows.test_um[k].tolist(), strict=True))
        printer.run(COMMAND, ENABLE=int(rows.is_wanted[k]), **tests)
        if rng.random() < 0.005:
            printer.at[2] = 0.0
            printer.run("G28", Z="")
        printer.tick(printer.now)
        slope = abs(printer.extra.program.slope_1)
        before, placed = list(printer.extra.applied), list(printer.extra.last)
        to = [*(placed + rng.choice([0.0, 0.01, 30.0]) * rng.normal(size=3)), float(k)]
        speed = float(rng.choice([0.5, 50.0, 300.0]))
        seconds = np.linalg.norm(np.subtract(to[:3], placed)) / speed
        printer.extra.move(list(to), speed)
        for axis, name in ((2, "Z"), (1, "Y")):
            carried_um = slope * abs(np.clip(to[2], -200.0, 500.0) - np.clip(placed[2], -200.0, 500.0)) / 1000.0
            step_um = 1000.0 * abs(printer.extra.applied[axis] - before[axis])
            allowed_um = limits[name].slew_um_per_s * seconds + (carried_um if name == "Z" else 0.0)
            assert step_um <= allowed_um + 1e-9
            assert 1000.0 * abs(printer.extra.applied[axis]) <= limits[name].clamp_um + 1e-9
        assert printer.extra.get_position() == pytest.approx(to, abs=1e-9)
        assert np.isfinite(printer.sent[-1]).all()


@pytest.mark.skipif(not PYTHON_2.exists(), reason="no Python 2.7 here (pyenv install 2.7.18)")
def test_python_2_computes_the_same(tmp_path):
    model, n = hostile.model(), 600
    rows = hostile.rows(n, 3, 1)
    expected = plain_answers(model, rows).correction_um
    columns = {name: column.tolist() for name, column in rows.columns(model).items()}
    (tmp_path / "extra.py").write_text(klipper_extra(model))
    driver = """
import json, sys
import extra
given = json.load(open('rows.json'))
program = extra.ThermalCorrection()
for k in range(len(given['dt_s'])):
    for name in given:
        value = given[name][k]
        setattr(program, str(name), value if isinstance(value, bool) else float(value))
    program.step()
    print('%r %r' % (program.correction_1, program.correction_2))
assert sys.version_info[0] == 2 and callable(extra.load_config)
"""
    (tmp_path / "driver.py").write_text(driver)
    (tmp_path / "rows.json").write_text(json.dumps(columns))
    done = subprocess.run([PYTHON_2, "driver.py"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert np.array_equal(np.array(re.findall(r"\S+", done.stdout), dtype=float).reshape(n, 2), expected)
    assert fields(rows)
