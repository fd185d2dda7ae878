"""What a control kept over a restart is believed only where it can be."""

from __future__ import annotations

import math

import pytest

from selector.controllers import Guard, Input, ModelFile, Output, OutputLimits, State, Term
from selector.controllers.guard.decided import Mode, SensorCode
from selector.controllers.guard.guarded_model import GuardedModel
from selector.controllers.replay.macro_b_executed import MacroB
from selector.controllers.writers.fanuc import FILE, fanuc_export, macro_variables
from selector.controllers.writers.python_module import CLASS, python_files


def model_of(**limits):
    """Z = 10 + 4·T1 + 2·(T1 after an hour), of a rise."""
    return ModelFile(
        name="kept",
        inputs=(Input(name="T1", valid_min=-1.0, valid_max=9.0, **limits),),
        states=(State(name="late", source="T1", tau_s=3600.0),),
        outputs=(
            Output(
                name="Z",
                axis="Z",
                intercept=10.0,
                terms=(Term(powers={"T1": 1}, coefficient=4.0), Term(powers={"late": 1}, coefficient=2.0)),
            ),
        ),
        guard=Guard(limits=(OutputLimits(output="Z", clamp_um=200.0, slew_um_per_s=1.0),)),
    )


def program_of(model, **kept):
    names: dict = {}
    exec(python_files(model)["thermal_correction.py"], names)
    program = names[CLASS]()
    program.dt_s, program.is_ready, program.is_wanted = 1.0, True, True
    for name, value in kept.items():
        setattr(program, name, value)
    return program


def called(program, reading, n):
    program.reading_1 = reading
    for _ in range(n):
        program.step()
    return program


NO_READINGS = [math.nan, math.inf, -math.inf, 1e30, -2e9]


@pytest.mark.parametrize("bad", NO_READINGS)
@pytest.mark.parametrize("is_restart", [False, True])
def test_a_program_drops_a_start_that_is_no_reading_and_begins_anew(bad, is_restart):
    program = program_of(model_of(), start_1=bad, has_start_1=True, has_memory_1=True, level_1=2.0)
    program.is_restart = is_restart
    called(program, 22.0, 200)
    assert (program.start_1, program.level_1, program.sensor_1, program.mode) == (22.0, 0.0, SensorCode.OK, Mode.MODEL)
    assert program.correction_1 == -10.0


@pytest.mark.parametrize("bad", NO_READINGS)
def test_the_guard_drops_a_start_that_is_no_reading_and_begins_anew(bad):
    guard = GuardedModel(model_of(), start_readings={"T1": bad})
    for _ in range(200):
        found = guard.step(1.0, {"T1": 22.0})
    assert guard.retained["start_1"] == 22.0
    assert found.correction_um["Z"] == -10.0


@pytest.mark.parametrize(("kept", "start"), [(61.0, 22.0), (-5.1, 22.0), (60.0, 60.0), (18.0, 18.0)])
def test_limits_of_the_reading_are_limits_of_its_start(kept, start):
    model = model_of(reading_min=-5.0, reading_max=60.0)
    guard = GuardedModel(model, start_readings={"T1": kept})
    program = called(program_of(model, start_1=kept, has_start_1=True), 22.0, 100)
    for _ in range(100):
        found = guard.step(1.0, {"T1": 22.0})
    assert (guard.retained["start_1"], program.start_1) == (start, start)
    assert program.correction_1 == found.correction_um["Z"]


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, 1e30, 9.1, -1.1])
def test_a_level_out_of_range_is_dropped_and_the_start_is_kept(bad):
    program = program_of(model_of(), start_1=20.0, has_start_1=True, has_memory_1=True, level_1=bad)
    program.is_restart = True
    called(program, 22.0, 200)
    assert (program.start_1, program.level_1, program.mode) == (20.0, 2.0, Mode.MODEL)
    assert program.correction_1 == -22.0


def test_what_can_be_is_kept_to_the_last_bit():
    good = program_of(model_of(), start_1=20.0, has_start_1=True, has_memory_1=True, level_1=9.0)
    good.is_restart = True
    called(good, 29.0, 100)
    assert (good.start_1, good.level_1) == (20.0, 9.0)


def macro_off_for_ten_minutes(model, name, bad):
    """The macro of a model, its memory of this name changed while it was not called, and then called again."""
    macro, names = MacroB(fanuc_export(model).files[FILE]), macro_variables(model)
    for time_s in (*range(0, 300, 5), *range(1000, 1300, 5)):
        macro.variables |= {100: float(time_s), names.readings["T1"]: 22.0 if time_s < 100 else 23.0}
        if time_s == 1000:
            assert macro.variables[names.program["start_1"]] == 22.0
            macro.variables[names.program[name]] = bad
        macro.call()
    kept = [macro.variables[names.program[one]] for one in ("start_1", "level_1", "mode", "sensor_1")]
    return macro.offsets["Z"], *kept


@pytest.mark.parametrize("bad", [1e30, -1e30, 61.0])
def test_the_macro_drops_a_start_that_is_no_reading(bad):
    z_mm, *kept = macro_off_for_ten_minutes(model_of(reading_max=60.0), "start_1", bad)
    assert kept == [23.0, 0.0, Mode.MODEL, SensorCode.OK]
    assert z_mm == pytest.approx(-0.010)


@pytest.mark.parametrize("bad", [1e30, -1e30, 9.1])
def test_the_macro_drops_a_level_out_of_range(bad):
    z_mm, *kept = macro_off_for_ten_minutes(model_of(), "level_1", bad)
    assert kept == [22.0, 1.0, Mode.MODEL, SensorCode.OK]
    assert z_mm == pytest.approx(-0.016)


def test_the_macro_keeps_what_can_be():
    _, start, level, *_ = macro_off_for_ten_minutes(model_of(), "level_1", 9.0)
    assert start == 22.0
    assert 1.0 + 8.0 * math.exp(-1000 / 3600) < level < 1.0 + 8.0 * math.exp(-300 / 3600)
