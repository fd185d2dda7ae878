"""The sign of the correction: the sign test of every program, and axes that are counted the other way."""

from __future__ import annotations

import math
from dataclasses import fields

import numpy as np
import pytest

from selector.controllers import Guard, Output, OutputLimits, Term, read_model
from selector.controllers.c_compiler import compiler
from selector.controllers.evaluator import axes_of
from selector.controllers.guard.decided import Mode, is_turned, longest_test_s, with_turned_signs
from selector.controllers.guard.guarded_model import GuardedModel
from selector.controllers.model_file import equations_sha256, model_sha256
from selector.controllers.replay.compiled import c_answers
from selector.controllers.replay.parts import Answers, Rows, reference_answers
from selector.controllers.writers.targets import TARGETS
from selector.errors import ModelFileError, OptionError
from tests.controllers import hostile
from tests.controllers.golden_text import texts_of
from tests.controllers.model_builders import guarded, rise_model

needs_cc = pytest.mark.skipif(compiler() is None, reason="no C compiler; Debian: apt install gcc")
GOOD = {"T1": 20.0, "T3": 20.0}


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
    begun = [_tested(model, 5.0) for _ in range(10)]
    assert {(one.mode, one.correction_um["Z"]) for one in begun} == {(Mode.SWITCHED_OFF, 0.0)}, "since the start"
    assert _tested(model, 0.0).mode == Mode.MODEL
    assert _tested(model, 5.0).mode == Mode.TEST
    assert _tested(model, -5.0).mode == Mode.TEST, "another value is the same test"
    _tested(model, 5.0, is_ready=False)
    back = [_tested(model, 5.0) for _ in range(10)]
    assert {(one.mode, one.correction_um["Z"]) for one in back} == {(Mode.SWITCHED_OFF, 0.0)}, (
        "the drives came on again"
    )
    # the test value of a drive that is off arms nothing
    _tested(model, 0.0, is_ready=False)
    assert _tested(model, 5.0).mode == Mode.SWITCHED_OFF
    _tested(model, 0.0)
    assert _tested(model, 5.0).mode == Mode.TEST
    model.restart(60.0)
    assert {_tested(model, 5.0).mode for _ in range(10)} == {Mode.SWITCHED_OFF}, "the control came on again"


@pytest.mark.parametrize("number", [float, np.float32])
@pytest.mark.parametrize("rhythm_s", [0.01, 1.0, 45.0])
def test_a_forgotten_test_ends_by_itself_and_the_axis_goes_to_zero_slowly(number, rhythm_s):
    model = guarded(number=number, clamp=10.0, slew=0.5, recover_after_s=0.0)
    begun = _tested(model, 0.0, rhythm_s).correction_um["Z"]
    calls = 0
    while _tested(model, 9.0, rhythm_s).mode == Mode.TEST:
        calls += 1
    assert calls * rhythm_s == pytest.approx(600.0 + 2.0 * 10.0 / 0.5, abs=1.0 + 2.0 * rhythm_s)
    found = _tested(model, 9.0, rhythm_s).correction_um["Z"]
    for _ in range(round(200.0 / rhythm_s)):
        was, found = found, _tested(model, 9.0, rhythm_s).correction_um["Z"]
        assert was >= found >= was - 0.5 * min(rhythm_s, 10.0) * 1.0001
    assert found == 0.0
    for _ in range(round(200.0 / rhythm_s)):
        found = _tested(model, 0.0, rhythm_s).correction_um["Z"]
    assert (found, begun) == (-1.0, max(-1.0, -0.5 * min(rhythm_s, 10.0))), "the model, once 0 was commanded"


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
    wanted = (np.arange(n) < 90) | (np.arange(n) > 120)
    rows = Rows(np.r_[0.0, np.full(n - 1, 1.0)], readings, np.zeros((n, 0)), yes, wanted, ~yes, np.zeros(n), test_um)
    files, whole = TARGETS[target].write(model).files, reference_answers(model, rows)
    assert set(whole.mode[100:150]) == set(whole.mode[200:210]) == {Mode.TEST}
    assert whole.correction_um[149].tolist() == [10.0, 0.0]
    assert Mode.TEST not in whole.mode[:20], "commanded before the program began"
    assert (whole.mode[301], whole.mode[1349]) == (Mode.TEST, Mode.SWITCHED_OFF), "forgotten"
    assert whole.correction_um[1349].tolist() == [0.0, 0.0]
    assert whole.mode[-1] == Mode.MODEL
    main = whole
    for part in TARGETS[target].parts:
        found = part.execute(model, rows, files, main)
        main = found if part is TARGETS[target].parts[0] else main
        allowed = part.allowed_um(model, rows, whole)
        expected = part.expected(model, rows, whole, main)
        for k, output in enumerate(model.outputs):
            assert np.abs(found.correction_um - expected)[:, k].max() <= allowed[output.name]
        assert np.array_equal(found.mode, whole.mode)


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
    without_head = (".csv", "buildDescription.xml")
    assert all(
        "TURNED ROUND" in text for name, text in texts_of(exported.files).items() if not name.endswith(without_head)
    )
    if target in ("c", "fmu") and compiler() is None:
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
