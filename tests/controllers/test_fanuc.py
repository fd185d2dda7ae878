"""The FANUC macro, executed as text, equals the model; what is not there is said."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from selector.controllers import Fallback, Guard, Input, ModelFile, Output, OutputLimits, PositionPart, State, Term
from selector.controllers.model_file import read_model
from selector.controllers.replay.macro_b_executed import MacroB, MacroError, macro_b_answers
from selector.controllers.replay.parts import Rows, reference_answers
from selector.controllers.writers.exported import ExportRefusedError
from selector.controllers.writers.fanuc import (
    FILE,
    LONGEST_BLOCK,
    STATUS,
    fanuc_export,
    literal,
    macro_variables,
    remarks,
)
from tests.controllers import hostile
from tests.controllers.golden_text import golden, without_version

ROOT = Path(__file__).resolve().parents[2]
PATENT = ROOT / "fixtures/models/patent-two-sensors.json"


def rich(**guard):
    """Rise, absolute, speed, memory, cubes and a dead band; the guard is one that the macro has."""
    decided = {
        "recover_after_s": 0.0,
        "limits": (OutputLimits(output="Z", clamp_um=42.0, slew_um_per_s=0.7, dead_band_um=0.2),),
    }
    return ModelFile(
        name="rich",
        inputs=(
            Input(name="T1", centre=4.1, scale=2.3, valid_min=-0.7, valid_max=10.0),
            Input(name="amb", role="ambient", reference="absolute", centre=-21.7, scale=1.1, valid_min=18.0,
                  valid_max=26.0, reading_min=-20.0, reading_max=70.0),
            Input(name="n", role="spindle_speed", unit="rpm", reference="absolute", centre=1500.0, scale=0.009,
                  valid_min=0.0, valid_max=3000.0),
        ),
        states=(
            State(name="late", source="T1", tau_s=1800.0, centre=2.2, scale=1.7),
            State(name="n late", source="n", tau_s=300.0, scale=1000.0),
        ),
        outputs=(
            Output(
                name="Z", axis="Z", intercept=-1.871,
                terms=(
                    Term(powers={"T1": 3}, coefficient=0.137), Term(powers={"T1": 1, "amb": 2}, coefficient=-0.000331),
                    Term(powers={"late": 1}, coefficient=11.3),
                    Term(powers={"late": 3, "n late": 3, "T1": 3, "amb": 3}, coefficient=1.0 / 3e7),
                ),
            ),
            Output(name="Y", axis="Y", intercept=0.1, terms=(Term(powers={"n": 1}, coefficient=2e-5 / 3.0),)),
        ),
        guard=Guard(**(decided | guard)),
    )  # fmt: skip


def warm_up(n=400, seed=2):
    """Calls of uneven rhythm through a warm-up; the first takes no time, as in the macro."""
    rng = np.random.default_rng(seed)
    dt_s = rng.choice([1.0, 7.3, 30.0, 61.0], n)
    dt_s[0] = 0.0
    time_s = np.cumsum(dt_s)
    readings = np.column_stack(
        [
            20.0 + 9.0 * (1.0 - np.exp(-time_s / 3000.0)) + rng.normal(0.0, 0.05, n),
            22.0 + 5.0 * np.sin(time_s / 5000.0),
            rng.choice([0.0, 1200.0, 3000.0, 3100.0], n),
        ]
    )
    always = np.ones(n, dtype=bool)
    return Rows(dt_s, readings, np.zeros((n, 0)), always, always, ~always, np.zeros(n))


def test_macro_equals_the_reference_over_a_warm_up():
    rows = warm_up()
    expected = reference_answers(rich(), rows)
    assert set(expected.mode) == {1}
    assert np.all(np.ptp(expected.correction_um, axis=0) > [40.0, 2.0])
    found = macro_b_answers(rich(), rows).correction_um
    # literals of 8 digits: 1e-6 µm
    np.testing.assert_allclose(found, expected.correction_um, rtol=0.0, atol=1e-6)


def test_macro_equals_the_patent_formula():
    model = read_model(PATENT)
    rows = warm_up()
    rows = replace(rows, readings=rows.readings[:, :2])
    np.testing.assert_allclose(
        macro_b_answers(model, rows).correction_um, reference_answers(model, rows).correction_um, rtol=0.0, atol=1e-6
    )


@pytest.mark.parametrize("bad", [np.nan, -9999.0, 70.1, -20.1])
def test_fault_keeps_the_last_value_and_says_which_reading(bad):
    rows = warm_up()
    rows.readings[200:300, 1] = bad
    rows.readings[195:200] = rows.readings[195]
    rows.dt_s[195:200] = 61.0
    found = macro_b_answers(rich(), rows).correction_um
    settled = found[199]
    np.testing.assert_array_equal(found[200:300], np.tile(settled, (100, 1)))
    assert np.abs(found[301] - settled).max() > 0.5
    macro = MacroB(fanuc_export(rich()).files[FILE])
    macro.variables |= {100: 0.0, 101: 20.0, 102: 850.0, 103: 0.0}
    macro.call()
    sensors = [macro.variables[macro_variables(rich()).program[f"sensor_{k}"]] for k in (1, 2, 3)]
    assert (macro.variables[STATUS], sensors) == (2.0, [0.0, 4.0, 0.0])


def test_fault_ramps_to_zero_where_the_model_file_says_so():
    rows = warm_up()
    rows.readings[300:, 2] = np.nan
    found = macro_b_answers(rich(on_fault="ramp-to-zero"), rows).correction_um
    step = np.abs(np.diff(found[300:, 0]))
    assert found[299, 0] != 0.0
    assert np.all(step <= 0.7 * np.minimum(rows.dt_s[301:], 10.0) + 1e-12)
    np.testing.assert_array_equal(found[-1], [0.0, 0.0])


def test_outside_the_valid_range_is_a_fault_where_the_model_file_says_so():
    rows = warm_up()
    rows.readings[:, 2] = np.minimum(rows.readings[:, 2], 3000.0)
    rows.readings[400:, 0] = 31.0
    model = rich(outside_valid_range="fault")
    np.testing.assert_allclose(
        macro_b_answers(model, rows).correction_um, reference_answers(model, rows).correction_um, rtol=0.0, atol=1e-6
    )


def test_time_that_stands_still_or_runs_backwards_moves_nothing():
    macro = MacroB(fanuc_export(read_model(PATENT)).files[FILE])
    for time_s in range(50, 121, 10):
        macro.variables |= {100: float(time_s), 101: 20.0, 102: 20.0}
        macro.call()
    before = dict(macro.offsets)
    assert before == pytest.approx({"Z": 0.001871, "Y": -0.0005703}, abs=1e-12)
    for time_s in (120.0, 5.0, -7.0):
        macro.variables |= {100: time_s, 101: 28.0, 102: 27.0}
        macro.call()
        assert macro.offsets == before


def called_until_settled(macro):
    for time_s in range(100, 400, 10):
        macro.variables |= {100: float(time_s), 101: 20.0, 102: 20.0}
        macro.call()
    return macro.offsets


@pytest.mark.parametrize(("code", "per_mm"), [(21.0, 1.0), (71.0, 1.0), (20.0, 25.4), (70.0, 25.4)])
@pytest.mark.parametrize("group_3", [90.0, 91.0, None])
def test_inches_and_lathes_are_asked_for_and_g90_is_as_before(code, per_mm, group_3):
    macro = MacroB(fanuc_export(read_model(PATENT)).files[FILE])
    macro.modal = {4006: code} | ({} if group_3 is None else {4003: group_3})
    modal = dict(macro.modal)
    assert called_until_settled(macro) == pytest.approx({"Z": 0.001871 / per_mm, "Y": -0.0005703 / per_mm}, abs=1e-12)
    assert macro.modal == modal


def test_what_the_control_does_not_say_is_an_alarm_before_anything_is_written():
    text = fanuc_export(read_model(PATENT)).files[FILE]
    macro = MacroB(text)
    macro.modal = {4003: 90.0}
    with pytest.raises(MacroError, match="alarm 3101"):
        called_until_settled(macro)
    assert macro.offsets == {}
    outputs = tuple(
        o.model_copy(update={"axis": axis}) for o, axis in zip(read_model(PATENT).outputs, "UW", strict=True)
    )
    lathe = MacroB(fanuc_export(read_model(PATENT).model_copy(update={"outputs": outputs})).files[FILE])
    lathe.modal = {4006: 21.0}
    with pytest.raises(MacroError, match="alarm 3102"):
        called_until_settled(lathe)
    lathe.modal = {4003: 91.0, 4006: 21.0}
    assert set(called_until_settled(lathe)) == {"U", "W"}


def test_a_reading_that_is_bad_again_within_the_first_minute_is_no_start_reading():
    macro = MacroB(fanuc_export(read_model(PATENT)).files[FILE])
    names = macro_variables(read_model(PATENT)).program
    course = [(0.0, 25.0), (30.0, 25.0), (40.0, 850.0), *((50.0 + 10.0 * k, 20.0) for k in range(7))]
    states = []
    for time_s, reading in course:
        macro.variables |= {100: time_s, 101: reading, 102: 20.0}
        macro.call()
        states.append((macro.variables[STATUS], macro.variables[names["has_start_1"]]))
    assert states == [(2.0, 0.0)] * 9 + [(1.0, 1.0)]
    assert macro.variables[names["start_1"]] == 20.0


def test_vacant_time_ends_the_program_before_it_writes_anything():
    macro = MacroB(fanuc_export(read_model(PATENT)).files[FILE])
    macro.call()
    assert macro.offsets == {}
    assert macro.variables == {}


def test_state_of_another_model_is_not_taken_over():
    text = fanuc_export(read_model(PATENT)).files[FILE]
    macro = MacroB(text)
    macro.variables = dict.fromkeys(range(500, 512), 77.0) | {100: 0.0, 101: 20.0, 102: 20.0}
    macro.call()
    assert macro.offsets == {"Z": 0.0, "Y": 0.0}


def test_golden_file():
    assert without_version(fanuc_export(read_model(PATENT)).files[FILE]) == golden(f"fanuc/{FILE}")


@pytest.mark.parametrize("name", ["T1)", "(", "T;1 %", "T1*/ \"'", "µ°温度", "a" * 99, "%", "M99", "T[#1]"])
def test_names_stay_in_their_comments(name):
    model = ModelFile(
        name=name,
        inputs=(Input(name=name, valid_min=0.0, valid_max=10.0),),
        outputs=(Output(name=name, axis="x", intercept=1.0, terms=(Term(powers={name: 1}, coefficient=2.0),)),),
    )
    text = fanuc_export(model).files[FILE]
    assert re.fullmatch(r"[A-Z0-9 .,+\-*/=%#()\[\]\n]*", text)
    assert max(map(len, text.split("\n"))) <= LONGEST_BLOCK
    # outside its comments the program is that of a model with other names
    plain = model.model_copy(update={"name": "m", "outputs": (
        Output(name="Z", axis="X", intercept=1.0, terms=(Term(powers={"T": 1}, coefficient=2.0),)),
    ), "inputs": (Input(name="T", valid_min=0.0, valid_max=10.0),)})  # fmt: skip
    codes = [
        [line for line in re.sub(r"\(.*?\)", "", file).split("\n") if line and not re.search(r"#500E|#500=", line)]
        for file in (text, fanuc_export(plain).files[FILE])
    ]
    assert codes[0] == codes[1]
    MacroB(text)


def test_literals_have_no_exponent_and_no_more_than_eight_digits():
    for value in (6.0476, 10.0, -1e-5, 1.23456789012345e-13, 1e12, 1.0 / 3.0, 0.05, 3e-20, 123456789.123456, 9.99e19):
        text = literal(value)
        assert "E" not in text.upper()
        assert all(len(d.replace(".", "").lstrip("0")) <= 8 for d in re.findall(r"[\d.]+", text))
        macro = MacroB(f"%\nO0001()\n#1={text}\nM99\n%\n")
        macro.call()
        assert macro.variables[1] == pytest.approx(value, rel=5e-8)
    assert literal(0.0) == "0."
    # a number of the model is compared: it stands there as it is
    assert literal(float(0xFFFFFF)) == "16777215."
    assert literal(99999999.6) == "[1.*10000000.*10.]"
    with pytest.raises(ExportRefusedError, match="1e-20"):
        literal(1e-30)


def test_what_macro_b_cannot_do_is_refused():
    many = tuple(Input(name=f"T{k}", valid_min=0.0, valid_max=1.0) for k in range(60))
    with pytest.raises(ExportRefusedError, match="#208"):
        fanuc_export(ModelFile(name="many", inputs=many, outputs=(Output(name="Z", axis="Z", intercept=0.0),)))
    for outputs in ((Output(name="Z", intercept=0.0),), (Output(name="Z", axis="spindle", intercept=0.0),)):
        with pytest.raises(ExportRefusedError, match="linear axis"):
            fanuc_export(ModelFile(name="axes", inputs=many[:1], outputs=outputs))


def test_everything_that_is_missing_is_said():
    model = hostile.model()
    found = {finding.id: finding for finding in fanuc_export(model).findings}
    assert set(found) == {"guard-reduced", "position-part-left-out", "limit-not-decided"}
    assert len(found["guard-reduced"].evidence["left_out"]) == 4
    assert found["position-part-left-out"].evidence["lost_um"] > 0.0
    assert isinstance(model.fallbacks[0], Fallback)
    assert isinstance(model.outputs[0].position, PositionPart)


def test_variables_are_as_the_installation_says():
    model = read_model(PATENT)
    assert macro_variables(model).readings == {"T1": 101, "T3": 102}
    assert "#101 = T1 [degC], #102 = T3 [degC]" in fanuc_export(model).install[1]


@pytest.mark.parametrize(
    "line",
    ["#1=1.5e3", "#1=1;", "#1=[1.", "IF[#1GT2.]#2=3.", "(a)", "((A))", "#1=[[[[[[1.]]]]]]", "G0Z1.", "#1=" + "1" * 80,
     "#1=SIN[1.]", "#1=2.+*3."],
)  # fmt: skip
def test_executor_refuses_what_is_not_in_the_subset(line):
    with pytest.raises(MacroError):
        MacroB(f"%\nO0001()\n{line}\nM99\n%\n").call()


def test_a_formula_keeps_its_brackets():
    (line,) = remarks("Z = 36.2 + (-615.2 + 26.7*T) * (P - 0 m); (um)")
    assert line == "(Z = 36.2 + [-615.2 + 26.7*T] * [P - 0 M], [UM])"
    MacroB(f"%\nO0001()\n{line}\nM99\n%\n").call()


def test_comments_are_cut_into_blocks():
    assert list(remarks("a:b " + "c" * 80)) == [f"(A,B {'C' * 66})", f"({'C' * 14})"]


def test_a_cold_start_by_hand_takes_new_start_readings():
    macro = MacroB(fanuc_export(read_model(PATENT)).files[FILE])
    names = macro_variables(read_model(PATENT)).program
    called_until_settled(macro)
    macro.variables |= {names["has_start_1"]: 0.0, names["has_start_2"]: 0.0}
    for time_s in range(400, 500, 10):
        macro.variables |= {100: float(time_s), 101: 15.0, 102: 16.0}
        macro.call()
    assert (macro.variables[names["start_1"]], macro.variables[names["start_2"]]) == (15.0, 16.0)
    assert macro.variables[STATUS] == 1.0
