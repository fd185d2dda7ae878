"""Parameters of a vibrating structure: every number that a fit may change, within bounds around its value."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from selector.errors import ModelFileError, OptionError
from selector.physics.vibration.model_file import checked_model_file, read_model_file
from selector.physics.vibration.vibration_model import VibrationModel, vibration_model
from tests.physics.vibration.model_values import SMALL, changed

LATHE = read_model_file(Path(__file__).resolve().parents[3] / "fixtures" / "vibration" / "lathe.toml")
FILE = checked_model_file(SMALL)


def parameters(file):
    return VibrationModel(file).parameters


def test_every_number_of_the_physics_has_unit_and_bounds_around_it():
    found = parameters(FILE)
    # 3 masses; stiffness and psi of 3 joints; force, unbalance, phase of 4 lines, but no unbalance at a fixed frequency
    assert len(found) == 3 + 2 * 3 + 3 * 4 - 1
    assert all(one.low <= one.value <= one.high and one.low < one.high for one in found.values())
    assert found["members.tool.mass_kg"].unit == "kg"
    assert (found["joints.2.stiffness_n_per_m"].low, found["joints.2.stiffness_n_per_m"].high) == (1e7, 1e9)
    assert "sources.motor.lines.1.unbalance_kg_m" not in found
    assert found["sources.spindle.lines.2.phase_rad"].high == math.pi


def test_what_is_switched_off_is_among_them_and_can_be_as_large_as_what_is_there():
    found = parameters(checked_model_file(changed(("joints.0.dissipation", ...))))
    psi, force = found["joints.1.dissipation"], found["sources.spindle.lines.1.force_n"]
    assert (psi.value, psi.low, psi.high) == (0.0, 0.0, 2.0)
    # unbalance 1e-4 kg·m at 20 Hz, exact but for rounding
    assert (force.value, force.low) == (0.0, 0.0)
    assert force.high == pytest.approx(10.0 * 1e-4 * (2.0 * math.pi * 20.0) ** 2, rel=1e-12)
    assert found["sources.motor.lines.2.unbalance_kg_m"].value == 0.0


@given(st.data())
def test_any_values_within_the_bounds_make_a_model_that_has_them(data):
    found = parameters(LATHE)
    names = data.draw(st.sets(st.sampled_from(sorted(found)), min_size=1, max_size=6))
    values = {name: data.draw(st.floats(found[name].low, found[name].high)) for name in names}
    new = vibration_model(LATHE).with_parameters(values).file
    assert {name: parameters(new)[name].value for name in names} == values
    others = {name: one.value for name, one in parameters(new).items() if name not in names}
    assert others == {name: one.value for name, one in found.items() if name not in names}


def test_no_change_is_the_same_file():
    assert vibration_model(LATHE).with_parameters({}).file == LATHE


def test_unknown_parameters_and_impossible_values_are_refused():
    with pytest.raises(OptionError, match=r"no parameter 'joints\.9\.dissipation'"):
        vibration_model(FILE).with_parameters({"joints.9.dissipation": 0.1})
    with pytest.raises(ModelFileError, match=r"joints\[1\].stiffness_n_per_m"):
        vibration_model(FILE).with_parameters({"joints.1.stiffness_n_per_m": 0.0})
    bounded = checked_model_file(changed(("bounds", {"joints.1.stiffness_n_per_m": [1e8, 5e10]})))
    assert parameters(bounded)["joints.1.stiffness_n_per_m"].high == 5e10
    with pytest.raises(OptionError, match=r"1e\+08 to 5e\+10"):
        vibration_model(bounded).with_parameters({"joints.1.stiffness_n_per_m": 1e7})


@pytest.mark.parametrize("bounds", [{"joints.1.mass": [0.0, 1.0]}, {"members.tool.mass_kg": [6.0, 9.0]}])
def test_bounds_of_nothing_or_beside_the_value_are_refused_when_the_model_is_made(bounds):
    with pytest.raises(ModelFileError, match="bounds"):
        vibration_model(checked_model_file(changed(("bounds", bounds))))


@pytest.mark.parametrize(
    ("name", "limits"),
    [
        ("joints.1.dissipation", [-0.5, 2.0]),
        ("joints.1.stiffness_n_per_m", [0.0, 5e10]),
        ("members.tool.mass_kg", [-1.0, 9.0]),
        ("members.tool.mass_kg", [1.0, 1e10]),
        ("sources.motor.lines.1.force_n", [-1.0, 20.0]),
    ],
)
def test_bounds_beyond_what_the_key_may_have_are_refused(name, limits):
    with pytest.raises(ModelFileError) as refused:
        vibration_model(checked_model_file(changed(("bounds", {name: limits}))))
    assert refused.value.where == f"key bounds.{name}"
    # not the value itself, but what the key may have
    assert re.search(r"between \S+ and \S+,", refused.value.expected)


def test_bounds_that_nobody_gave_stay_within_what_the_key_may_have():
    found = parameters(checked_model_file(changed(("joints.0.stiffness_n_per_m", 5e14), ("members.bed.mass_kg", 1e-9))))
    assert (found["joints.1.stiffness_n_per_m"].low, found["joints.1.stiffness_n_per_m"].high) == (5e13, 1e15)
    assert found["members.bed.mass_kg"].low == 1e-9
