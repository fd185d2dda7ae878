"""Mode C: a term deleted from a model of ours is named through the model, put in, and the model is whole again."""

from __future__ import annotations

import copy
import dataclasses

import numpy as np
import pandas as pd
import pytest

from selector.diagnosis.open_model.modelled import Improved, diagnosis_of_model, with_longest_steps
from selector.diagnosis.open_model.refitting import refitted, simulated_rows
from selector.diagnosis.open_model.runnable import FunctionModel, OwnModel
from selector.diagnosis.open_model.switches import switches
from selector.errors import InputError
from selector.physics.drive.model_file import parsed_model_file
from selector.physics.gauging.gauging_model import gauging_model
from selector.physics.gauging.model_file import checked_model_file as gauging_file
from selector.physics.model_fields import Parameter
from selector.recording import Channel, Recording
from tests.diagnosis.ablated import (
    AXIS,
    axis_model,
    axis_recording,
    axis_without,
    heat_model,
    heat_recording,
    heat_without,
)


@pytest.fixture(scope="module")
def axis() -> Recording:
    return axis_recording()


@pytest.fixture(scope="module")
def without_coulomb(axis):
    return diagnosis_of_model(axis_model(axis_without("coulomb_n"), axis), axis)


def test_deleted_friction_is_named_and_its_size_is_found(without_coulomb):
    answer = without_coulomb.answer
    assert [effect.id for effect in answer.effects] == ["drive.coulomb"]
    assert answer.effects[0].place == "X.guide"
    # 20 N; voltage noise of 0.02 V over some thousand samples leaves 0.1 N
    assert answer.effects[0].parameters["coulomb_n"].value == pytest.approx(20.0, abs=0.3)
    assert answer.verdict == "missing-physics"
    assert "friction" in answer.headline
    # the whole gap, but for a tenth: everything that was deleted can be put back
    assert all(fit.gap_closed is not None and fit.gap_closed.value > 0.9 for fit in answer.fit.values())


def test_viscous_friction_by_direction_is_named_and_put_into_the_model():
    whole = copy.deepcopy(AXIS)
    whole["axes"]["X"]["friction"]["viscous_negative_ns_per_m"] = 100.0
    recording = axis_recording(whole)
    found = diagnosis_of_model(axis_model(AXIS, recording), recording)
    assert [effect.id for effect in found.answer.effects] == ["drive.asymmetric_friction"]
    # N·s/m; the noise of 0.02 V leaves less than a hundredth of it
    assert found.answer.effects[0].parameters["viscous_negative_ns_per_m"].value == pytest.approx(100.0, abs=3.0)
    assert found.refit.values["axes.X.friction.offset_n"] < -5.0, "a constant force stood in for it"
    assert found.improved.refit.values["axes.X.friction.offset_n"] == pytest.approx(-3.0, abs=0.5)


def test_the_improved_file_keeps_the_errors_that_the_answer_says(without_coulomb, axis):
    improved = without_coulomb.improved
    assert isinstance(improved, Improved)
    again = dataclasses.replace(improved.model, file=parsed_model_file(improved.model.text("improved")))
    comparison = improved.refit.comparison
    simulated = simulated_rows(comparison, again.simulated({}))
    for name, fit in without_coulomb.answer.fit.items():
        left = (comparison.recorded[name] - simulated[name])[comparison.held_out]
        # what a user gets who simulates the file; 5 % is what is promised
        assert np.sqrt(np.mean(left**2)) == pytest.approx(fit.heldout.rmse_after, rel=0.05)
        assert fit.heldout.rmse_after < 0.2 * fit.recalibrated_heldout


def test_the_answer_says_mode_and_what_was_refitted(without_coulomb):
    told = {finding.id: finding for finding in without_coulomb.answer.findings}
    assert told["mode"].statement.startswith("Mode C")
    assert "'axis'" in told["mode"].statement
    assert "; 3 parameters" in told["mode"].statement
    assert "axes.X.mechanics.mass_kg" in told["mode"].evidence["refitted"]


def test_a_wrong_mass_is_a_wrong_mass_and_nothing_else(axis):
    found = diagnosis_of_model(axis_model(axis_without(mass_kg=75.0), axis), axis)
    assert found.answer.verdict == "miscalibrated"
    assert not found.answer.effects
    assert found.improved is None
    # 95 kg, known to some hundred grams by some thousand samples
    assert found.refit.values["axes.X.mechanics.mass_kg"] == pytest.approx(95.0, abs=0.5)
    pulled = [finding for finding in found.answer.findings if finding.id == "parameter-pulled"]
    assert [finding.evidence["parameter"] for finding in pulled] == ["axes.X.mechanics.mass_kg"]


def test_a_deleted_source_of_heat_is_named_with_its_place_and_power():
    recording = heat_recording()
    found = diagnosis_of_model(heat_model(heat_without("pump"), recording), recording)
    (effect,) = found.answer.effects
    assert effect.id == "thermal.second_source"
    assert effect.place == "column"
    # 60 W; nameplates of ±20 % beside it leave 9 W, and the estimate is half of that off at most
    assert effect.parameters["on_w"].value == pytest.approx(60.0, abs=5.0)
    for name, fit in found.answer.fit.items():
        # the noise of the instruments, but for a tenth
        assert fit.heldout.rmse_after < 1.1 * (fit.heldout.noise_floor or 0.0), name


def test_amounts_that_change_with_speed_are_told_at_the_speed_that_the_changed_file_says():
    recording = heat_recording()
    model = heat_model(heat_without("pump"), recording)
    told = 0
    for switch in switches(model):
        changes = dict(switch.changes([2.0]))
        laws = [value for value in changes.values() if isinstance(value, dict)]
        said = [law["reference_rpm"] for law in laws if "reference_rpm" in law]
        said += [value for key, value in changes.items() if key[-1] == "reference_rpm"]
        assert said == ([] if switch.at_rpm is None else [switch.at_rpm])
        told += len(said)
    assert told > 0


def test_a_recording_is_not_surely_at_fault_while_the_model_is_still_wrong(monkeypatch):
    """With one effect at most a source at the headstock stands in for the pump, and what it leaves looks like drift."""
    monkeypatch.setattr("selector.diagnosis.open_model.modelled._MOST", 1)
    recording = heat_recording()
    found = diagnosis_of_model(heat_model(heat_without("pump"), recording), recording)
    faults = [effect for effect in found.answer.effects if effect.id.startswith("data.")]
    assert faults
    assert all(effect.confidence <= 0.5 for effect in faults)


def test_parameters_that_the_record_says_nothing_of_stay_where_they_were(axis):
    still = AXIS | {"model": {"kind": "drive", "name": "axis", "note": "whole"}}
    found = refitted(axis_model(still, axis), axis)
    for name, one in found.quantities.items():
        assert one.low is not None
        assert one.high is not None
        # whole model: every parameter is where it was, within four standard errors (two half-widths)
        half = 0.5 * (one.high - one.low)
        assert abs(one.value - axis_model(still, axis).parameters[name].value) < 2.0 * half
    assert not [finding for finding in found.findings if finding.id == "parameter-pulled"]


def test_a_recording_that_its_model_made_lacks_nothing():
    """Without any difference the noise is what rounding leaves, not nothing, by which nothing can be divided."""
    still = copy.deepcopy(AXIS)
    still["axes"]["X"]["sensing"]["current_noise"] = 0.0
    made = axis_recording(still)
    found = diagnosis_of_model(axis_model(still, made), made)
    assert found.answer.verdict == "nothing-missing"
    assert not found.answer.effects
    assert found.improved is None
    for name, one in found.refit.values.items():
        assert one == pytest.approx(axis_model(still, made).parameters[name].value, rel=1e-6), name


def test_a_gauge_without_noise_lacks_nothing():
    file = gauging_file({
        "model": {"kind": "gauging", "name": "a gauge as a line"},
        "linear": {"gain_v_per_um": -0.005, "bias_v": 0.8, "time_constant_s": 0.2},
        "grinding": {"allowance_um": 60.0, "stages": [{"feed_um_per_s": 4.0, "until_um": 0.0}]},
    })  # fmt: skip
    made = gauging_model(file).simulation(run="r").recording
    found = diagnosis_of_model(OwnModel("gauging", file, made), made)
    assert found.answer.verdict == "nothing-missing"


def test_a_python_function_is_refitted(axis):
    """Mode B: the model as a function that nothing is known of."""
    whole = axis_model(AXIS, axis)

    def function(values):
        done = whole.simulated({"axes.X.mechanics.mass_kg": values["mass"]})
        names = ["X_position", "X_voltage"]
        return {run: done.frame.loc[run][names] for run in done.runs}

    model = FunctionModel("axis", function, {"mass": Parameter(80.0, 50.0, 150.0, "kg")}, axis)
    found = refitted(model, axis)
    assert found.values["mass"] == pytest.approx(95.0, abs=0.5)
    assert set(found.comparison.tangents) == {"X_position", "X_voltage"}
    assert np.isfinite(found.comparison.tangents["X_voltage"]["mass"]).all()


class OfANameplate(FunctionModel):
    """A function whose parameters are held by what they say, as those of a model file."""

    bounded = frozenset()


def test_a_resonance_on_the_wrong_side_of_the_recorded_one_is_crossed():
    time_s = np.arange(0.0, 40.0, 0.1)
    channels = (Channel("y", "displacement", "um"),)

    def function(values):
        answer = 1.0 / (values["stiffness"] - 1.0 + 0.05j)
        course = np.abs(answer) * np.sin(time_s + np.angle(answer))
        return {run: pd.DataFrame({"y": course}, pd.Index(time_s, name="time_s")) for run in ("r1", "r2")}

    recording = Recording.from_runs(function({"stiffness": 0.85}), channels, {})
    # going down the slope from here only leads away
    model = OfANameplate("spring", function, {"stiffness": Parameter(1.2, 0.1, 10.0, "1")}, recording)
    assert refitted(model, recording).values["stiffness"] == pytest.approx(0.85, abs=1e-3)


def test_a_function_that_diverges_is_refused(axis):
    whole = axis_model(AXIS, axis)

    def function(values):
        done = whole.simulated({})
        return {run: done.frame.loc[run][["X_voltage"]] * np.inf for run in done.runs}

    model = FunctionModel("axis", function, {"mass": Parameter(80.0, 50.0, 150.0, "kg")}, axis)
    with pytest.raises(InputError, match="not finite"):
        refitted(model, axis)


def test_a_recording_without_a_command_drives_no_axis(axis):
    names = [name for name in axis.names if name != "X_command"]
    bare = Recording.from_runs(
        {run: axis.frame.loc[run][names] for run in axis.runs}, tuple(axis.channel(name) for name in names), {}
    )
    with pytest.raises(InputError, match="commanded position"):
        diagnosis_of_model(OwnModel("drive", axis_model(AXIS, axis).file, bare), bare)


def test_a_model_of_heat_is_searched_with_the_longest_steps_that_nobody_tells():
    recording = heat_recording()
    model = heat_model(heat_without("pump"), recording)
    found = with_longest_steps(model, recording)
    assert found.step_s >= 2.0 * model.file.run.step_s
    there, here = found.simulated({}), model.simulated({})
    for name in ("T1", "T2"):
        # thermometers rustle by 0.02 K
        assert np.abs(there.frame[name] - here.frame[name]).max() < 2e-3
    assert found.text() == model.text()
