"""The guard at the machine: sign test, the first readings, positions that are lost, slow slews, a turned axis."""

from __future__ import annotations

import math
from dataclasses import fields

import numpy as np
import pytest

from selector.controllers import Guard, Output, OutputLimits, PositionPart, Term, read_model
from selector.controllers.guard import GuardedModel, Mode, SensorCode, decided_limits
from selector.controllers.guard.decided import longest_test_s
from selector.controllers.model_io import equations_sha256, model_sha256
from selector.controllers.program.guarded_program import axes_of
from selector.controllers.replay.compiled import c_answers, compiler
from selector.controllers.replay.replayed import faulty_share
from selector.controllers.replay.rows import Answers, Rows, reference_answers
from selector.controllers.signs import is_turned, with_turned_signs
from selector.controllers.writers.targets import TARGETS
from selector.errors import ModelFileError, OptionError
from tests.controllers import hostile
from tests.controllers.model_builders import rise_model

needs_cc = pytest.mark.skipif(compiler() is None, reason="no C compiler; Debian: apt install gcc")
GOOD = {"T1": 20.0, "T3": 20.0}


def guarded(*, rate=None, slew=1.0, clamp=100.0, dead=0.0, part=None, number=float, **guard):
    limits = OutputLimits(output="Z", clamp_um=clamp, slew_um_per_s=slew, dead_band_um=dead)
    first, second = rise_model().inputs
    output = rise_model().outputs[0].model_copy(update={"position": part})
    model = rise_model(
        inputs=(first.model_copy(update={"rate_limit_per_min": rate}), second),
        outputs=(output,),
        guard=Guard.model_validate({"limits": (limits,), **guard}),
    )
    return GuardedModel(model, number)


# sign test


def test_the_program_goes_to_a_commanded_value_and_back_whatever_sensors_and_operator_say():
    model = guarded(dead=5.0)
    model.step(0.0, {"T1": math.nan, "T3": math.nan}, is_wanted=False)
    seen = [model.step(1.0, {"T1": math.nan, "T3": math.nan}, is_wanted=False, test_um={"Z": 3.0}) for _ in range(5)]
    assert [one.correction_um["Z"] for one in seen] == [1.0, 2.0, 3.0, 3.0, 3.0]
    assert {one.mode for one in seen} == {Mode.TEST}
    back = [model.step(1.0, {"T1": math.nan, "T3": math.nan}, is_wanted=False) for _ in range(4)]
    assert [one.correction_um["Z"] for one in back] == [2.0, 1.0, 0.0, 0.0]
    assert back[0].mode == Mode.SWITCHED_OFF


@pytest.mark.parametrize("strange", [math.nan, math.inf, -math.inf, 1e12, 0.0, -0.0])
def test_what_is_no_number_commands_nothing(strange):
    one, other = guarded(recover_after_s=0.0), guarded(recover_after_s=0.0)
    for _ in range(5):
        assert one.step(1.0, GOOD, test_um={"Z": strange}) == other.step(1.0, GOOD)


def test_a_commanded_value_is_clamped_and_nothing_moves_while_the_axis_is_not_ready():
    model = guarded(clamp=5.0)
    model.step(0.0, GOOD)
    for _ in range(20):
        found = model.step(1.0, GOOD, test_um={"Z": 1e8})
    assert found.correction_um["Z"] == 5.0
    off = model.step(1.0, GOOD, is_ready=False, test_um={"Z": 1e8})
    assert (off.mode, off.correction_um["Z"]) == (Mode.OFF, 0.0)


def _tested(model, z_um, seconds=1.0, **switches):
    return model.step(seconds, GOOD, test_um={"Z": z_um}, **switches)


@pytest.mark.parametrize("number", [float, np.float32])
def test_what_is_commanded_without_a_zero_before_it_is_not_followed(number):
    model = guarded(number=number, recover_after_s=0.0)
    assert {_tested(model, 5.0).mode for _ in range(10)} == {Mode.MODEL}, "since the start of the control"
    assert _tested(model, 0.0).mode == Mode.MODEL
    assert _tested(model, 5.0).mode == Mode.TEST
    assert _tested(model, -5.0).mode == Mode.TEST, "another value is the same test"
    _tested(model, 5.0, is_ready=False)
    back = [_tested(model, 5.0) for _ in range(10)]
    assert {one.mode for one in back} == {Mode.MODEL}, "the drives came on again"
    # the test value of a drive that is off arms nothing
    _tested(model, 0.0, is_ready=False)
    assert _tested(model, 5.0).mode == Mode.MODEL
    _tested(model, 0.0)
    assert _tested(model, 5.0).mode == Mode.TEST
    model.restart(60.0)
    assert {_tested(model, 5.0).mode for _ in range(10)} == {Mode.MODEL}, "the control came on again"


@pytest.mark.parametrize("number", [float, np.float32])
@pytest.mark.parametrize("rhythm_s", [0.01, 1.0, 45.0])
def test_a_forgotten_test_ends_by_itself_and_the_model_takes_over_slowly(number, rhythm_s):
    model = guarded(number=number, clamp=10.0, slew=0.5, recover_after_s=0.0)
    for _ in range(round(100.0 / rhythm_s)):
        begun = _tested(model, 0.0, rhythm_s).correction_um["Z"]
    calls = 0
    while _tested(model, 9.0, rhythm_s).mode == Mode.TEST:
        calls += 1
    assert calls * rhythm_s == pytest.approx(600.0 + 2.0 * 10.0 / 0.5, abs=1.0 + 2.0 * rhythm_s)
    found = _tested(model, 9.0, rhythm_s).correction_um["Z"]
    for _ in range(round(200.0 / rhythm_s)):
        was, found = found, _tested(model, 9.0, rhythm_s).correction_um["Z"]
        assert abs(found - was) <= 0.5 * min(rhythm_s, 10.0) * 1.0001
    assert found == begun


def test_a_test_is_long_enough_for_any_slew_and_ends_before_clocks_stop():
    for slew, expected_s in ((0.5, 640.0), (0.001, 20_600.0), (1e-300, 1e6)):
        limits = OutputLimits(output="Z", clamp_um=10.0, slew_um_per_s=slew)
        assert longest_test_s(rise_model(guard=Guard(limits=(limits,)))) == expected_s


def test_the_other_outputs_go_to_zero_meanwhile_and_the_slope_too():
    model = GuardedModel(hostile.model(recover_after_s=0.0))
    readings = {"T1": 25.0, "T2": 30.0, "n": 3000.0}
    for _ in range(100):
        before = model.step(1.0, readings, {"Z": 0.5})
    assert before.slope_um_per_m["Z"] != 0.0 != before.correction_um["Y"]
    for _ in range(200):
        found = model.step(1.0, readings, {"Z": 0.5}, test_um={"Z": 4.0})
    assert found.correction_um == {"Z": 4.0, "Y": 0.0}
    assert found.slope_um_per_m["Z"] == 0.0


@pytest.mark.parametrize("target", TARGETS)
def test_every_target_says_how_the_sign_is_proved(target):
    model = read_model("fixtures/models/patent-two-sensors.json")
    if target == "rexroth":
        one = Output(name="Z", axis="Z", intercept=0.0, terms=(Term(powers={"T1": 1}, coefficient=4.0),))
        model = rise_model(inputs=(rise_model().inputs[0],), outputs=(one,))
    for turned in ((), ("Z",)):
        found = TARGETS[target].write(with_turned_signs(model, turned)).sign_test
        z = found.commanded[0]
        # what is commanded on a drive has the sign of the displacement
        assert z.expected_um == 10.0 * (-1.0 if turned else 1.0) * (-1.0 if target == "rexroth" else 1.0)
        assert "10" in z.command
        assert ("turned already" if turned else "--invert") in found.wrong


@pytest.mark.parametrize("target", ["c", "fanuc", "st"])
def test_the_written_programs_are_told_what_to_correct(target):
    if target == "c" and compiler() is None:
        pytest.skip("no C compiler; Debian: apt install gcc")
    model = read_model("fixtures/models/patent-two-sensors.json")
    n = 1400
    yes = np.ones(n, dtype=bool)
    readings = 20.0 + np.outer(np.arange(n) / n, [3.0, 2.0])
    test_um = np.zeros((n, 2))
    test_um[:20], test_um[100:150], test_um[200:210] = [4.0, 0.0], [10.0, 0.0], [math.nan, -1e8]
    test_um[300:1350] = [0.0, 5.0]
    rows = Rows(np.r_[0.0, np.full(n - 1, 1.0)], readings, np.zeros((n, 0)), yes, yes, ~yes, np.zeros(n), test_um)
    files, whole = TARGETS[target].write(model).files, reference_answers(model, rows)
    assert set(whole.mode[100:150]) == set(whole.mode[200:210]) == {Mode.TEST}
    assert whole.correction_um[149].tolist() == [10.0, 0.0]
    assert Mode.TEST not in whole.mode[:20], "commanded before the program began"
    assert (whole.mode[301], whole.mode[1349]) == (Mode.TEST, Mode.MODEL), "forgotten"
    main = whole
    for part in TARGETS[target].parts:
        found = part.execute(model, rows, files, main)
        main = found if part is TARGETS[target].parts[0] else main
        allowed = part.allowed_um(model, rows, whole)
        for k, output in enumerate(model.outputs):
            assert np.abs(found.correction_um - whole.correction_um)[:, k].max() <= allowed[output.name]
        assert np.array_equal(found.mode, whole.mode)


# the first readings


def test_a_wrong_first_reading_is_no_start_reading():
    model = guarded(rate=2.0)
    model.step(1.0, {"T1": 0.0, "T3": 20.0})
    codes = [model.step(1.0, GOOD).sensors[0] for _ in range(120)]
    assert codes[0] == SensorCode.JUMP
    assert codes[1:61] == [SensorCode.RECOVERING] * 60
    assert set(codes[61:]) == {SensorCode.OK}
    assert model.start_readings == GOOD


def test_without_a_rate_limit_a_first_reading_further_off_than_the_valid_range_is_wide_is_none():
    model = guarded()
    model.step(1.0, {"T1": 0.0, "T3": 20.0})
    for _ in range(120):
        model.step(1.0, GOOD)
    assert model.start_readings == GOOD


def test_the_rise_counts_from_the_first_good_reading_not_from_when_it_was_believed():
    model = guarded(slew=1e6)
    for k in range(61):
        found = model.step(1.0, {"T1": 20.0 + 0.01 * k, "T3": 20.0})
        assert (found.mode == Mode.MODEL) is (k == 60)
    assert model.start_readings == GOOD
    # T1: z = (0.6 - 4) / 2; T3: z = -2
    z1, z3 = (0.01 * 60 - 4.0) / 2.0, -2.0
    assert found.correction_um["Z"] == pytest.approx(-(1.0 + 3.0 * z1 - 2.0 * z3 + 0.5 * z1 * z3), abs=1e-12)


def test_a_jump_of_a_sensor_that_was_believed_stays_a_fault_but_a_wrong_first_reading_after_a_restart_does_not():
    model = guarded(rate=2.0)
    for _ in range(100):
        model.step(1.0, GOOD)
    model.restart(60.0)
    model.step(1.0, {"T1": 0.0, "T3": 20.0})
    for _ in range(100):
        found = model.step(1.0, GOOD)
    assert found.mode == Mode.MODEL
    assert {model.step(1.0, {"T1": 70.0, "T3": 20.0}).sensors[0] for _ in range(1000)} == {SensorCode.JUMP}


def test_memory_begins_with_the_first_good_reading():
    plain = hostile.model(on_fault="hold", has_slope=False, stuck_after_s=None)
    late, at_once = (
        GuardedModel(plain.model_copy(update={"guard": plain.guard.model_copy(update={"recover_after_s": seconds})}))
        for seconds in (60.0, 0.0)
    )
    for k in range(120):
        readings = {"T1": 22.0 + 0.005 * k, "T2": 26.0, "n": 3000.0}
        found = [one.step(1.0, readings) for one in (late, at_once)]
    # one step of 60 s instead of 60 steps of 1 s: 0.01 K of a memory of 900 s
    assert found[0].k0_um["Z"] == pytest.approx(found[1].k0_um["Z"], abs=0.05)


def test_the_start_is_no_fault_of_a_run_and_a_dead_sensor_is():
    def answers(mode, sensors):
        found = Answers.empty(len(mode), 1, 1, 0)
        found.mode[:], found.sensors[:, 0] = mode, sensors
        return found

    for mode, codes, share in (
        ([2, 2, 1, 1], [2, 2, 0, 1], 0.0),
        ([2, 2, 1, 2], [2, 3, 0, 3], 0.5),
        ([2, 2], [3, 3], 1.0),
        ([], [], 0.0),
    ):
        whole = answers(mode, codes)
        assert faulty_share(whole, whole) == share


# one wrong time since the last call


WRONG_TIMES = [math.inf, 1e300, 1e6, 1e5, 61.0]


@pytest.mark.parametrize("wrong", WRONG_TIMES)
@pytest.mark.parametrize("number", [float, np.float32])
def test_one_wrong_time_ends_no_recovery_and_takes_no_start_reading(wrong, number):
    model = guarded(number=number)
    model.step(1.0, {"T1": 17.0, "T3": 20.0})
    codes = [model.step(wrong, {"T1": 17.0, "T3": 20.0}).sensors[0]]
    codes += [model.step(1.0, {"T1": math.nan, "T3": 20.0}).sensors[0]]
    assert codes == [SensorCode.RECOVERING, SensorCode.MISSING]
    for _ in range(61):
        model.step(1.0, GOOD)
    assert model.start_readings == GOOD
    model.step(1.0, {"T1": 850.0, "T3": 20.0})
    codes = [model.step(dt_s, GOOD).sensors[0] for dt_s in (1.0, wrong, *[1.0] * 49)]
    assert codes == [SensorCode.RECOVERING] * 51


@pytest.mark.parametrize("wrong", WRONG_TIMES)
def test_one_wrong_time_excuses_no_jump(wrong):
    model = guarded(rate=2.0)
    for _ in range(100):
        model.step(1.0, GOOD)
    # two minutes' worth of 2 K/min is the most that one sample can excuse
    found = [model.step(dt_s, {"T1": 24.1, "T3": 20.0}).sensors[0] for dt_s in (wrong, 1.0)]
    assert found[-1] == SensorCode.JUMP


@pytest.mark.parametrize("wrong", [math.inf, -math.inf, math.nan, 1e300, 1.1e6, -1.0])
def test_what_is_no_time_is_none(wrong):
    one, other = guarded(rate=2.0), guarded(rate=2.0)
    for k in range(200):
        readings = {"T1": 20.0 + 0.01 * k, "T3": 20.0}
        dt_s = wrong if k % 3 == 0 else 1.0
        assert one.step(dt_s, readings) == other.step(0.0 if k % 3 == 0 else dt_s, readings)


@pytest.mark.parametrize(("period_s", "samples"), [(1.0, 60), (10.0, 6), (60.0, 6), (600.0, 6)])
def test_a_reading_is_believed_after_a_minute_and_six_more_samples_at_any_rhythm(period_s, samples):
    model = guarded(rate=2.0)
    modes = [model.step(period_s, {"T1": 20.0 + 0.03 * period_s * k / 60.0, "T3": 20.0}).mode for k in range(100)]
    assert modes == [Mode.HOLD] * samples + [Mode.MODEL] * (100 - samples)


# positions


def along():
    return PositionPart(axis="Z", reference_m=0.0, valid_min_m=0.0, valid_max_m=0.5, intercept=40.0)


def test_a_position_that_was_lost_has_a_code_and_its_return_is_slewed():
    model = guarded(part=along(), recover_after_s=0.0)
    for _ in range(100):
        before = model.step(1.0, GOOD, {"Z": 0.5})
    assert before.axes == {"Z": SensorCode.OK}
    lost = [model.step(1.0, GOOD, {"Z": bad}) for bad in (math.nan, math.inf, 1e12)]
    assert {one.axes["Z"] for one in lost} == {SensorCode.MISSING}
    assert {one.correction_um["Z"] for one in lost} == {before.correction_um["Z"]}
    # it moved by 0.5 m meanwhile, 20 µm of correction
    course = [before.correction_um["Z"], *(model.step(1.0, GOOD, {"Z": 0.0}).correction_um["Z"] for _ in range(30))]
    assert np.abs(np.diff(course)).max() <= 1.0 + 1e-12
    assert course[-1] == pytest.approx(before.correction_um["Z"] + 20.0)
    assert model.step(1.0, GOOD, {"Z": 0.7}).axes == {"Z": SensorCode.LIMITED}


def test_an_axis_that_moves_takes_its_correction_along_at_once():
    model = guarded(part=along(), recover_after_s=0.0)
    for _ in range(100):
        before = model.step(1.0, GOOD, {"Z": 0.5})
    assert model.step(0.001, GOOD, {"Z": 0.0}).correction_um["Z"] == pytest.approx(before.correction_um["Z"] + 20.0)


@pytest.mark.parametrize("number", [float, np.float32])
def test_clamp_and_slew_hold_with_positions_on_hostile_rows(number):
    model = hostile.model()
    rows = hostile.rows(6000, 31)
    found, limit = reference_answers(model, rows, number), decided_limits(model)[0]["Z"]
    slack = 1e-9 if number is float else 2e-5  # binary32 resolves 2e-6 µm at 20 µm
    assert np.abs(found.correction_um[:, 0]).max() <= limit.clamp_um
    position = rows.positions_m[:, 0]
    is_there = np.abs(np.nan_to_num(position, nan=np.inf)) <= 1e9
    where = np.full(len(rows), 0.1)
    for k in range(len(rows)):
        where[k] = np.clip(position[k], -0.2, 0.5) if is_there[k] else where[k - 1] if k else 0.1
    both = is_there[1:] & is_there[:-1]
    carried = np.where(both, found.slope_um_per_m[:-1, 0] * np.diff(where), 0.0)
    base = np.clip(found.correction_um[:-1, 0] + carried, -limit.clamp_um, limit.clamp_um)
    passed_s = np.clip(np.nan_to_num(rows.dt_s[1:], nan=0.0, posinf=10.0), 0.0, 10.0)
    excess = np.abs(found.correction_um[1:, 0] - base) - limit.slew_um_per_s * passed_s
    free = (found.mode[1:] != Mode.OFF) & ~rows.is_restart[1:]
    came_back = free & is_there[1:] & ~is_there[:-1]
    assert came_back.sum() > 50
    assert excess[free].max() <= slack


# slow slews


@pytest.mark.parametrize("slew", [0.003, 0.0001])
def test_a_slow_slew_at_a_millisecond_is_right_in_single_precision(slew):
    single = guarded(slew=slew, number=np.float32)
    single.step(0.0, GOOD)
    for _ in range(2000):
        single.step(1.0, GOOD, test_um={"Z": 6.0})
    begun = float(single.step(0.0, GOOD, test_um={"Z": 99.0}).k0_um["Z"])
    for _ in range(20_000):
        found = single.step(0.001, GOOD, test_um={"Z": 99.0})
    # the value itself has steps of 5e-7 µm at 6 µm
    assert float(found.k0_um["Z"]) - begun == pytest.approx(20.0 * slew, rel=1e-5, abs=5e-7)


# a turned axis


def test_a_turned_output_is_the_displacement_and_nothing_else_changes():
    model = hostile.model()
    turned = with_turned_signs(model, ["Z"])
    assert [is_turned(output) for output in turned.outputs] == [True, False]
    assert with_turned_signs(turned, ["Z"]) == turned, "the same words, the same program"
    rows = hostile.rows(3000, 17)
    rows.test_um[:] = 0.0
    was, now = reference_answers(model, rows), reference_answers(turned, rows)
    assert np.array_equal(now.correction_um, was.correction_um * [-1.0, 1.0])
    assert np.array_equal(now.slope_um_per_m, was.slope_um_per_m * [-1.0, 1.0])
    with pytest.raises(OptionError, match="no output 'Q'"):
        with_turned_signs(model, ["Q"])


@pytest.mark.parametrize("target", TARGETS)
def test_the_generated_programs_are_turned(target):
    model = read_model("fixtures/models/patent-two-sensors.json")
    if target == "rexroth":
        one = Output(name="Z", axis="Z", intercept=0.0, terms=(Term(powers={"T1": 1}, coefficient=4.0),))
        model = rise_model(inputs=(rise_model().inputs[0],), outputs=(one,))
    if target == "linuxcnc":
        pytest.skip("the same C as of the target c")
    model = with_turned_signs(model, ["Z"])
    n = 200
    yes, no = np.ones(n, dtype=bool), np.zeros(n, dtype=bool)
    readings = 20.0 + np.outer(9.0 * np.arange(n) / n, np.ones(len(model.inputs)))
    rows = Rows(np.r_[0.0, np.full(n - 1, 10.0)], readings, np.zeros((n, 0)), yes, yes, no, np.zeros(n))
    exported = TARGETS[target].write(model)
    assert all("TURNED ROUND" in text for name, text in exported.files.items() if not name.endswith(".csv"))
    if target == "c" and compiler() is None:
        pytest.skip("no C compiler; Debian: apt install gcc")
    (main, *_) = TARGETS[target].parts
    found = main.execute(model, rows, exported.files, reference_answers(model, rows))
    expected = main.expected(model, rows, reference_answers(model, rows), found)
    assert expected[-1, 0] > 5.0
    allowed = main.allowed_um(model, rows, reference_answers(model, rows))["Z"]
    assert np.abs(found.correction_um[:, 0] - expected[:, 0]).max() <= allowed


@needs_cc
def test_turned_c_is_the_turned_guard_bit_for_bit():
    model = with_turned_signs(hostile.model(), ["Z", "Y"])
    rows = hostile.rows(4000, 5, len(axes_of(model)))
    one, other = c_answers(model, rows), reference_answers(model, rows)
    assert all(np.array_equal(getattr(one, field.name), getattr(other, field.name)) for field in fields(Answers))


def test_a_fallback_of_another_sign_is_refused():
    model = hostile.model()
    text = with_turned_signs(model, ["Z"]).model_dump(by_alias=True)
    text["fallbacks"][0]["outputs"][0]["sign"] = "correction = -displacement"
    with pytest.raises((ModelFileError, ValueError), match="as the model has"):
        type(model).model_validate(text)


def test_the_hash_of_the_equations_is_that_of_what_is_computed():
    model = hostile.model()
    other_clamp = hostile.model(limits=(OutputLimits(output="Z", clamp_um=3.0),), recover_after_s=5.0)
    assert model_sha256(model) != model_sha256(other_clamp)
    assert equations_sha256(model) == equations_sha256(other_clamp)
    assert equations_sha256(model) != equations_sha256(with_turned_signs(model, ["Y"]))
    first = model.inputs[0].model_copy(update={"valid_max": 13.0})
    assert equations_sha256(model) != equations_sha256(model.model_copy(update={"inputs": (first, *model.inputs[1:])}))
    checked = model.inputs[0].model_copy(update={"rate_limit_per_min": 7.0, "reading_max": 99.0})
    assert equations_sha256(model) == equations_sha256(
        model.model_copy(update={"inputs": (checked, *model.inputs[1:])})
    )
