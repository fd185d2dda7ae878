"""TwinCAT CNC: the worked example of the manual, units there and back, names that stay in remarks."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from selector.controllers import Input, ModelFile, Output, PositionPart, Term
from selector.controllers.guard.guarded_model import GuardedModel
from selector.controllers.model_file import read_model
from selector.controllers.replay.parts import reference_answers
from selector.controllers.writers.beckhoff import ads_offset, beckhoff_export, list_values, temp_comp_mm
from selector.controllers.writers.exported import ExportRefusedError
from selector.controllers.writers.structured_text import tcpou_export
from selector.controllers.writers.targets import TARGETS
from tests.controllers import hostile
from tests.controllers.golden_text import GOLDEN, golden, without_version

ROOT = Path(__file__).resolve().parents[2]
PATENT = ROOT / "fixtures/models/patent-two-sensors.json"
WORKED_EXAMPLE = """\
lr_param.temp_comp 1
lr_param.temp_comp_position_0 100
lr_param.temp_comp_offset_0 40 # 4 um
lr_param.temp_comp_coefficient 4000
lr_param.temp_comp_n_cycles 20
"""


def with_slope(reference_m=0.1234567, **names):
    return ModelFile(
        name="slope",
        inputs=(Input(name="T1", reference="absolute", valid_min=10.0, valid_max=40.0, centre=20.0),),
        outputs=(
            Output(
                name="Z", axis="Z", intercept=-1.5, terms=(Term(powers={"T1": 1}, coefficient=2.0),),
                position=PositionPart(axis="Z", reference_m=reference_m, valid_min_m=0.0, valid_max_m=0.6,
                                      intercept=1.0, terms=(Term(powers={"T1": 1}, coefficient=0.3),)),
            ),
        ),
    ).model_copy(update=names)  # fmt: skip


def test_worked_example_of_the_manual():
    values = list_values(WORKED_EXAMPLE)
    assert values == {"": 1, "_position_0": 100, "_offset_0": 40, "_coefficient": 4000, "_n_cycles": 20}
    # 0.004 mm + 0.004 · (100 − 0.01) mm
    found = temp_comp_mm(
        100.0,
        position_0=values["_position_0"],
        offset_0=values["_offset_0"],
        coefficient_um_per_m=float(values["_coefficient"]),
    )
    assert found == pytest.approx(0.40396, abs=1e-12)


@pytest.mark.parametrize("reference_m", [0.0, 0.1234567, -0.35000004, 12.3])
def test_reference_position_comes_back_within_half_a_step(reference_m):
    values = list_values(beckhoff_export(with_slope(reference_m)).files["temp_comp_1.lis"])
    assert abs(values["_position_0"] * 1e-7 - reference_m) <= 0.5e-7
    assert values == {"": 1, "_position_0": values["_position_0"], "_offset_0": 0, "_coefficient": 0, "_n_cycles": 10}


def test_what_the_control_adds_is_the_correction_of_the_model():
    """Through the axis list and the values written by ADS, at both ends of the axis."""
    model = with_slope()
    position_0 = list_values(beckhoff_export(model).files["temp_comp_1.lis"])["_position_0"]
    guarded = GuardedModel(model)
    for temperature, position_m in ((31.0, 0.6), (12.5, 0.0), (20.0, 0.3)):
        for _ in range(20):
            answer = guarded.step(10.0, {"T1": temperature}, {"Z": position_m})
        found_mm = temp_comp_mm(
            position_m * 1000.0,
            position_0=position_0,
            offset_0=round(10.0 * answer.k0_um["Z"]),
            coefficient_um_per_m=answer.slope_um_per_m["Z"],
        )
        # half a step of 0.1 µm, and half a step of the reference times the slope
        assert found_mm * 1000.0 == pytest.approx(answer.correction_um["Z"], abs=0.05 + 1e-6)


def test_ads_offset_is_axis_id_then_object():
    assert ads_offset(1, 0x43) == 0x10043
    assert ads_offset(0x1A, 0x41) == 0x1A0041
    table = beckhoff_export(with_slope()).files["temp_comp_ads.txt"]
    assert "port 551, index group 0x120300" in table
    assert "0x<AID>0041" in table
    assert "0x<AID>0043" in table
    assert "coefficient_1 := fb.slope_1;" in table
    assert "coefficient_1 := 0.0;" in beckhoff_export(read_model(PATENT)).files["temp_comp_ads.txt"]


def test_golden_files():
    files = dict(beckhoff_export(read_model(PATENT)).files)
    # the same text as of the target tcpou, which has a golden file of its own
    assert {"FB_ThermalCorrection.TcPOU": files.pop("FB_ThermalCorrection.TcPOU")} == tcpou_export(
        read_model(PATENT)
    ).files
    assert sorted(files) == sorted(path.name for path in (GOLDEN / "beckhoff").iterdir())
    for name, text in files.items():
        assert without_version(text) == golden(f"beckhoff/{name}")


def test_sign_is_said_at_the_head_of_every_file():
    for is_verified, first in ((False, "# SIGN UNVERIFIED"), (True, "# Sign verified")):
        for name, text in beckhoff_export(with_slope(), is_sign_verified=is_verified).files.items():
            if not name.endswith(".TcPOU"):
                assert text.startswith(first)


@pytest.mark.parametrize("name", [")", "*/", '"', "Z # 1", "温度 µ", "lr_param.temp_comp_offset_0 5", "}"])
def test_names_stay_in_their_remarks(name):
    output = Output(name=name, axis=name, intercept=1.0, terms=())
    model = with_slope(name=name, outputs=(output,))
    text = beckhoff_export(model).files["temp_comp_1.lis"]
    assert text.isascii()
    codes = [line.split("#")[0].split() for line in text.splitlines()]
    assert [len(code) for code in codes if code] == [2] * 5
    assert all(re.fullmatch(r"lr_param\.temp_comp\w*", code[0]) for code in codes if code)
    assert list_values(text)["_offset_0"] == 0


def test_what_the_axis_lists_cannot_take_is_refused():
    for outputs, reason in (
        ((Output(name="Z", intercept=0.0),), "no axis"),
        ((hostile.model().outputs[0].model_copy(update={"axis": "X"}),), "position of axis Z"),
    ):
        with pytest.raises(ExportRefusedError, match=reason):
            beckhoff_export(hostile.model().model_copy(update={"outputs": outputs}))
    with pytest.raises(ExportRefusedError, match="SGN32"):
        beckhoff_export(with_slope(300.0))


@pytest.mark.parametrize("target", ["tcpou", "beckhoff"])
def test_what_stops_twincat_is_on_the_sheet(target):
    """Comparisons with NaN raise an exception there, and stop the runtime (infosys.beckhoff.com, NaN values)."""
    (said,) = [line for line in TARGETS[target].write(hostile.model()).silently if "Floating point exceptions" in line]
    assert "1.0E30" in said
    # which is a missing reading, like NaN
    model, rows = hostile.model(), hostile.rows(3000, 5)
    missing = np.where(np.isfinite(rows.readings), rows.readings, 1e30)
    instead = reference_answers(model, replace(rows, readings=missing))
    assert np.array_equal(instead.correction_um, reference_answers(model, rows).correction_um)
