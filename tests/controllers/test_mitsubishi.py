"""Mitsubishi M800: words of R5700 in two's complement, and what stands around them. No control was there."""

from __future__ import annotations

import json
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from selector.controllers import Guard, Input, Output, OutputLimits, Term, read_model
from selector.controllers.guard.decided import Mode
from selector.controllers.replay.parts import reference_answers
from selector.controllers.writers.exported import ExportRefusedError
from selector.controllers.writers.python_module import CLASS, M800_FILE, MODULE_NAME, mitsubishi_export, python_files
from tests.controllers import hostile
from tests.controllers.golden_text import golden, without_version
from tests.controllers.model_builders import PATENT, rise_model


def z_model(**changes: object):
    """Z = 10 µm/K of the rise of T1, 1 µm/s at most."""
    limits = (OutputLimits(output="Z", clamp_um=40.0, slew_um_per_s=1.0),)
    fields_of_it = {
        "name": "spindle",
        "inputs": (Input(name="T1", valid_min=-20.0, valid_max=20.0),),
        "outputs": (Output(name="Z", axis="Z", intercept=0.0, terms=(Term(powers={"T1": 1}, coefficient=10.0),)),),
        "guard": Guard(limits=limits, hold_at_most_s=20.0),
    }
    return rise_model(**(fields_of_it | changes))


def three_axes():
    """X, Y and Z of one thermometer, in another order than that of the block."""
    outputs = tuple(
        Output(name=axis, axis=axis, intercept=0.0, terms=(Term(powers={"T1": 1}, coefficient=of),))
        for axis, of in (("Z", 10.0), ("X", -3.0), ("Y", 1.0))
    )
    return z_model(outputs=outputs, guard=Guard())


class Control:
    """R5700 … R5705, and every block that came."""

    def __init__(self, *words: int) -> None:
        self.words, self.came = list(words or (0,) * 6), []
        self.lies = 0

    def write(self, words: list[int]) -> None:
        self.words = [word + self.lies for word in words]
        self.came.append(list(words))


def module(model) -> SimpleNamespace:
    """The exported file, executed."""
    names: dict[str, Any] = {}
    exec(mitsubishi_export(model).files[M800_FILE], names)
    return SimpleNamespace(**names)


def program(model) -> Any:
    """The exported program."""
    names: dict[str, Any] = {}
    exec(mitsubishi_export(model).files[f"{MODULE_NAME}.py"], names)
    return names[CLASS]()


def offsets(model, control: Control, folder) -> Any:
    """As on the computer beside the control."""
    kept = str(folder / "kept.json")
    return module(model).Offsets(program(model), control.write, lambda: control.words, kept)


def test_the_words_of_the_published_deployment():
    words = module(three_axes()).words
    # in the order of the model: Z, X, Y
    assert words([-7.0, 0.0, 0.0]) == [0, 0, 0, 0, -7, -1]
    assert words([0.0, -7.0, 0.0]) == [-7, -1, 0, 0, 0, 0]
    assert words([25.0, 12.0, -20.0]) == [12, 0, -20, -1, 25, 0]
    assert words([0.4, -0.4, -0.6]) == [0, 0, -1, -1, 0, 0]
    assert module(z_model()).words([-7.0]) == [0, 0, 0, 0, -7, -1]


def test_every_micrometre_comes_back_with_or_without_signs_of_the_words():
    names = module(z_model())
    for um in (*range(-40_000, 40_001, 7), -32_768, -32_769, 32_767, 32_768, -65_536, 65_536):
        block = names.words([float(um)])
        assert all(-32_768 <= word <= 32_767 for word in block)
        assert names.micrometres(block) == [um]
        assert names.micrometres([word % 65_536 for word in block]) == [um]
        low, high = block[4:]
        assert int.from_bytes(np.array([low, high], dtype="<i2").tobytes(), "little", signed=True) == um


def test_the_program_is_the_python_module_as_it_is():
    model = hostile.model()
    own = {name: without_version(text) for name, text in mitsubishi_export(model).files.items()}
    assert {name: without_version(text) for name, text in python_files(model).items()}.items() <= own.items()


def test_golden_file():
    assert without_version(mitsubishi_export(read_model(PATENT)).files[M800_FILE]) == golden(f"mitsubishi/{M800_FILE}")


def test_other_axes_are_refused():
    of = z_model().outputs[0]
    for axis in ("C", "U"):
        with pytest.raises(ExportRefusedError, match="X, Y or Z: the six words are of these"):
            mitsubishi_export(z_model(outputs=(of.model_copy(update={"axis": axis}),)))


def test_hostile_rows_are_within_half_a_micrometre_of_the_guard():
    model = three_axes()
    rows = hostile.rows(1500, 4, 0)
    rows = replace(rows, readings=rows.readings[:, :1], test_um=None)
    corrections = reference_answers(model, rows).correction_um
    names = module(model)
    read = np.array([names.micrometres(names.words(row)) for row in corrections.tolist()])
    assert np.abs(read - corrections).max() == pytest.approx(0.5, abs=0.01)
    assert (read < 0).any()
    assert (read > 0).any()


def test_a_cycle_writes_and_compares(tmp_path):
    control = Control()
    control_of = offsets(z_model(), control, tmp_path)
    for _ in range(120):
        control_of.cycle(1.0, [20.0])
    for _ in range(60):
        block = control_of.cycle(1.0, [22.0])
    assert block == control.words == [0, 0, 0, 0, -20, -1]
    steps = np.abs(np.diff([words[4] for words in control.came]))
    assert steps.max() == 1, "no word moves faster than 1 um in a second"
    control.lies = 3
    with pytest.raises(Exception, match=r"R5700 holds .* and was sent .*: look at the data type"):
        control_of.cycle(1.0, [22.0])
    control.lies = 0
    assert control_of.cycle(1.0, [22.0])[4] == -20, "and goes on"


def test_a_dead_sensor_is_held_then_led_to_zero_and_never_left(tmp_path):
    control = Control()
    control_of = offsets(z_model(), control, tmp_path)
    for reading in [20.0] * 120 + [22.0] * 60:
        control_of.cycle(1.0, [reading])
    held = [control_of.cycle(1.0, [None])[4] for _ in range(20)]
    assert set(held) == {-20}
    ramp = [control_of.cycle(1.0, [None])[4] for _ in range(30)]
    assert ramp[-1] == 0
    assert np.abs(np.diff(held + ramp)).max() == 1


def test_a_new_process_takes_over_what_the_control_holds(tmp_path):
    control, model = Control(), z_model(guard=Guard(limits=z_model().guard.limits))
    control_of = offsets(model, control, tmp_path)
    for reading in [20.0] * 120 + [22.0] * 60:
        control_of.cycle(1.0, [reading])
    control_of.keep()
    # the machine is warm; the zero is not the first reading after the start
    again = offsets(model, control, tmp_path)
    control.came.clear()
    for _ in range(120):
        again.cycle(1.0, [22.0])
    lows = [-20] + [words[4] for words in control.came]
    assert set(lows) == {-20}, "held until the sensor is believed, then followed"
    assert again.program.mode == Mode.MODEL
    assert again.program.start_1 == 20.0
    again.cycle(1.0, [22.0], is_ready=False)
    assert control.words == [0] * 6


def test_words_of_another_time_go_at_the_slew_limit_to_what_the_model_says(tmp_path):
    control = Control(0, 0, 0, 0, 30, 0)
    control_of = offsets(z_model(guard=Guard(limits=z_model().guard.limits)), control, tmp_path)
    lows = [control_of.cycle(1.0, [20.0])[4] for _ in range(120)]
    assert lows[:50] == [30] * 50
    assert lows[-1] == 0
    assert np.abs(np.diff([30, *lows])).max() == 1


def test_a_reading_that_is_not_given_is_an_error_and_not_the_last_one(tmp_path):
    control = Control()
    control_of = offsets(z_model(), control, tmp_path)
    for given in ([], [20.0, 20.0]):
        with pytest.raises(ValueError, match=rf"{len(given)} values of reading_1 .* were given, .* has 1: give all"):
            control_of.cycle(1.0, given)
    with pytest.raises(ValueError, match="values of position_1"):
        control_of.cycle(1.0, [20.0], positions_m=[0.1])
    assert control.came == []


def test_a_time_that_is_none_does_not_end_the_keeping(tmp_path):
    control_of = offsets(z_model(), Control(), tmp_path)
    for dt_s in (float("nan"), -1e9, *[1.0] * 310):
        control_of.cycle(dt_s, [20.0])
    assert (tmp_path / "kept.json").exists()


def test_what_it_cannot_have_sent_is_not_taken_over(tmp_path):
    with pytest.raises(Exception, match=r"5000 um for Z, and this program sends 40 at most: something else writes"):
        offsets(z_model(), Control(0, 0, 0, 0, 5000, 0), tmp_path)
    offsets(z_model(), Control(7, 7, 7, 7, -40, -1), tmp_path)


@pytest.mark.parametrize("damaged", ["", "{", '{"model": "another"}', "whole", "short"])
def test_what_was_kept_by_others_or_is_damaged_is_not_taken(damaged, tmp_path):
    control = Control()
    control_of = offsets(z_model(), control, tmp_path)
    for reading in [20.0] * 120 + [22.0] * 400:
        control_of.cycle(1.0, [reading])
    kept = tmp_path / "kept.json"
    assert not list(tmp_path.glob("*.new"))
    saved = json.loads(kept.read_text())
    assert saved["kept"]["start_1"] == 20.0, "every five minutes"
    if damaged == "whole":
        saved["kept"]["start_1"] = "x"
    if damaged == "short":
        del saved["kept"]["has_start_1"]
    kept.write_text(json.dumps(saved) if damaged in ("whole", "short") else damaged)
    anew = offsets(z_model(), Control(), tmp_path)
    for _ in range(120):
        anew.cycle(1.0, [23.0])
    assert anew.program.start_1 == 23.0


def test_a_clock_that_was_put_back_counts_as_a_long_standstill(tmp_path):
    control_of = offsets(z_model(), Control(), tmp_path)
    for _ in range(310):
        control_of.cycle(1.0, [20.0])
    kept = tmp_path / "kept.json"
    saved = json.loads(kept.read_text())
    for later_s, least_s, most_s in ((-600.0, 600.0, 660.0), (3600.0, 1e6, 1e6)):
        kept.write_text(json.dumps(saved | {"saved_at": saved["saved_at"] + later_s}))
        assert least_s <= offsets(z_model(), Control(), tmp_path).program.standstill_s <= most_s


def test_drives_off_is_zero_at_once(tmp_path):
    control = Control()
    control_of = offsets(z_model(), control, tmp_path)
    for reading in [20.0] * 120 + [22.0] * 60:
        control_of.cycle(1.0, [reading])
    assert control_of.cycle(1.0, [22.0], is_ready=False) == [0] * 6


def test_the_sheet_says_what_is_not_known():
    exported = mitsubishi_export(z_model())
    told = " ".join((*exported.install, *exported.silently))
    for needed in ("[not known]", "R5700", "whole micrometres", "Ask the maker", "one deployment alone"):
        assert needed in told


def test_the_sign_test_is_commanded_as_the_sheet_says(tmp_path):
    control = Control()
    control_of = offsets(z_model(), control, tmp_path)
    (z,) = mitsubishi_export(z_model()).sign_test.commanded
    for _ in range(5):
        control_of.cycle(1.0, [None], is_wanted=False)
    exec(z.command, {"offsets": control_of})
    for _ in range(12):
        control_of.cycle(1.0, [None], is_wanted=False)
    assert control.words == [0, 0, 0, 0, 10, 0]
    assert (z.shown, control_of.program.mode) == ("offsets.program.mode == 5; cycle() gives 10 as the low word of Z", 5)
