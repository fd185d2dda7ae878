"""What a SINUMERIK 840D sl gets: setting data in its units, machine data, and what it would do silently."""

from __future__ import annotations

import csv
import io
from importlib.util import find_spec

import numpy as np
import pytest

from selector.controllers import OutputLimits
from selector.controllers.program.guarded_program import guarded_program
from selector.controllers.replay.parts import reference_answers
from selector.controllers.replay.structured_text_executed import executable
from selector.controllers.writers.exported import ExportRefusedError
from selector.controllers.writers.sinumerik import (
    LARGEST_SLOPE,
    SETTINGS,
    STEP_MM,
    setting_data_program,
    sinumerik_export,
)
from selector.controllers.writers.structured_text import LONGEST_NAME
from tests.controllers import hostile

needs_parser = pytest.mark.skipif(
    find_spec("tree_sitter_iec61131_3_st") is None, reason='no parser of Structured Text; pip install ".[controls]"'
)


def limited(**limits):
    return hostile.model(limits=(OutputLimits(output="Z", clamp_um=20.0, **limits),))


def with_outputs(model, **changes):
    first, second = model.outputs
    fallbacks = tuple(
        one.model_copy(update={"outputs": (one.outputs[0].model_copy(update=changes), one.outputs[1])})
        for one in model.fallbacks
    )
    return model.model_copy(update={"outputs": (first.model_copy(update=changes), second), "fallbacks": fallbacks})


def settings(model):
    return list(csv.DictReader(io.StringIO(sinumerik_export(model).files[SETTINGS])))


def test_the_worked_example_of_the_manual():
    # 10 000 mm/min, MD32760 = 0.01, interpolation cycle 12 ms: 0.02 mm a cycle; slope 0.02 mm / 2 mm
    assert pytest.approx(0.02, rel=1e-12) == STEP_MM
    assert pytest.approx(0.01, rel=1e-12) == LARGEST_SLOPE
    assert np.degrees(np.arctan(LARGEST_SLOPE)) == pytest.approx(0.57, abs=0.005)


@needs_parser
def test_setting_data_have_the_units_of_the_control():
    block = executable(sinumerik_export(hostile.model()).files["thermal_to_sd.scl"])
    block.v_k0_1, block.v_slope_1, block.v_k0_2 = np.float32(20.5), np.float32(-25.0), np.float32(-8.0)
    block.call()
    # one rounding of binary32 each
    assert float(block.v_sd43900_1) == pytest.approx(0.0205, rel=2e-7)
    assert float(block.v_sd43910_1) == pytest.approx(-25e-6, rel=2e-7)
    assert block.v_sd43920_1 == 100.0
    assert float(block.v_sd43900_2) == pytest.approx(-0.008, rel=2e-7)
    assert (block.v_sd43910_2, block.v_sd43920_2) == (0.0, 0.0)


@needs_parser
def test_the_line_of_the_control_is_the_correction():
    model = hostile.model()
    rows = hostile.rows(2000, 5)
    rows.positions_m[:] = 0.4
    answers = reference_answers(model, rows, np.float32)
    block = executable(sinumerik_export(model).files["thermal_to_sd.scl"])
    line = np.zeros(len(rows))
    for k in range(len(rows)):
        block.v_k0_1, block.v_slope_1 = np.float32(answers.k0_um[k, 0]), np.float32(answers.slope_um_per_m[k, 0])
        block.call()
        line[k] = float(block.v_sd43900_1) + float(block.v_sd43910_1) * (400.0 - float(block.v_sd43920_1))
    is_free = np.abs(answers.correction_um[:, 0]) < 20.0
    assert is_free.mean() > 0.5
    assert np.abs(answers.slope_um_per_m[:, 0]).max() > 1.0
    # 20 um in single precision
    np.testing.assert_allclose(line[is_free], 1e-3 * answers.correction_um[is_free, 0], rtol=0, atol=1e-8)


def test_the_table_names_every_datum_of_every_axis():
    table = settings(hostile.model())
    assert [row["axis"] for row in table] == ["Z"] * 5 + ["Y"] * 5
    data = [row["datum"].split()[0] for row in table]
    assert data == ["MD32750", "MD32760", "SD43900", "SD43910", "SD43920"] * 2
    value = {(row["axis"], row["datum"].split()[0]): row["value"] for row in table}
    assert (value["Z", "MD32750"], value["Y", "MD32750"]) == ("3", "1")
    assert (value["Z", "SD43920"], value["Z", "MD32760"]) == ("100", "0.01")
    assert all("prove" in row["meaning"] for row in table if row["datum"].startswith("SD43900"))


def test_every_name_is_one_that_step_7_takes():
    for program in (guarded_program(hostile.model()), setting_data_program(hostile.model())):
        assert max(len(one.name) for one in program.variables) <= LONGEST_NAME


def test_an_output_without_an_axis_is_taken_for_that_of_its_name():
    first, second = hostile.model().outputs
    assert first.name != second.name
    outputs = (first.model_copy(update={"axis": None, "name": "X9"}), second.model_copy(update={"axis": "x9"}))
    with pytest.raises(ExportRefusedError, match="both correct axis X9"):
        sinumerik_export(hostile.model().model_copy(update={"outputs": outputs, "fallbacks": ()}))


@pytest.mark.parametrize("word", ["IF", "whenever", "Do"])
def test_an_axis_called_by_a_word_of_the_language_is_refused(word):
    with pytest.raises(ExportRefusedError, match=f"axis '{word}'"):
        sinumerik_export(with_outputs(hostile.model(), axis=word))


def test_what_happens_without_an_alarm_is_said():
    silently = " ".join(sinumerik_export(hostile.model()).silently)
    for word in ("spread over several cycles", "clipped", "proved on the machine", "0.02 mm", "10000 um/m"):
        assert word in silently


@pytest.mark.parametrize(
    ("model", "ids"),
    [
        (hostile.model(), []),
        (limited(slew_um_per_s=1666.0, slope_clamp_um_per_m=9999.0), []),
        (limited(slew_um_per_s=1667.0), ["step-spread-silently"]),
        (limited(slope_clamp_um_per_m=10_001.0), ["slope-clipped-silently"]),
        (with_outputs(hostile.model(), axis=None), ["axis-not-named"]),
        (with_outputs(hostile.model(), axis="X"), ["position-of-another-axis"]),
    ],
)
def test_what_the_control_cannot_take_is_found(model, ids):
    *found, of_z, of_y = sinumerik_export(model).findings
    assert [finding.id for finding in found] == ids
    assert all(finding.suggestion for finding in found)
    assert of_z.id == of_y.id == "single-precision-bound"


@needs_parser
def test_the_position_of_another_axis_goes_into_k0():
    model = with_outputs(hostile.model(), axis="X")
    table = settings(model)
    assert table[0]["value"] == "1"
    assert "correction_1" in table[2]["meaning"]
    block = executable(sinumerik_export(model).files["thermal_to_sd.scl"])
    block.v_correction_1 = np.float32(10.0)
    block.call()
    assert float(block.v_sd43900_1) == pytest.approx(0.01, rel=2e-7)
    assert (block.v_sd43910_1, block.v_sd43920_1) == (0.0, 0.0)


def test_the_head_says_that_the_sign_is_unverified_until_somebody_verified_it():
    for verified in (False, True):
        files = sinumerik_export(hostile.model(), is_sign_verified=verified).files
        for name in ("thermal_correction.scl", "thermal_to_sd.scl"):
            assert ("SIGN UNVERIFIED" in files[name]) is not verified
