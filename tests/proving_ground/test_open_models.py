"""True machines beside open models of them: cases are as they say, and effects that a file can have are put into it.

Whole answers: of two cases benchmarks/bench_open_models.py, of smaller machines tests/diagnosis/test_modelled.py.
"""

from __future__ import annotations

import numpy as np
import pytest

from proving_ground.runner import questions
from proving_ground.scenarios import scenarios
from selector.diagnosis.open_model.refitting import refitted
from selector.diagnosis.open_model.switches import switches, through_model
from selector.physics.model_fields import model_file_text
from selector.physics.simulation_kind import simulation_kinds

SCENARIOS = scenarios(("open_model",))


def case_of(name, seed=3):
    (scenario,) = (one for one in SCENARIOS if one.name == name)
    return scenario.build(seed, None)


def test_every_kind_of_simulation_has_clean_wrong_and_concealed_cases():
    kinds = {one.name.rpartition("/")[2] for one in SCENARIOS}
    assert kinds == {"heated", "axis", "shaken", "gauged"}
    for kind in kinds:
        found = {one.kind for one in SCENARIOS if one.name.endswith(kind)}
        assert {"clean", "miscalibrated", "single", "out-of-catalogue"} <= found


def test_a_case_is_asked_once_a_seed():
    assert len(questions(SCENARIOS, (3.0, 6.0), range(2))) == 2 * len(SCENARIOS)


@pytest.mark.parametrize("name", ["thermal.coolant/heated", "gauging.lag/gauged"])
def test_what_an_effect_leaves_lies_above_the_noise(name):
    case = case_of(name)
    assert case.model is not None
    # at least the noise in one response: a d′ of the root of its fitted rows, 840 or 1400
    assert case.truth.d_prime > np.sqrt(840)
    assert max(one.recalibrated / one.oracle for one in case.truth.held_out.values()) > 1.2
    again = case_of(name)
    assert np.array_equal(case.recording.frame.to_numpy(), again.recording.frame.to_numpy())


def test_coolant_is_looked_for_among_recorded_channels():
    model = case_of("thermal.coolant/heated").model
    assert not hasattr(model.file.conditions, "coolant_on") or "coolant_on" not in str(model.text())
    assert {one.place for one in switches(model) if one.id == "thermal.coolant"} == {"spindle", "headstock", "column"}


def known_switches(model):
    known = [one for one in switches(model) if one.id in ("vibration.imbalance", "vibration.mode", "gauging.lag")]
    assert known
    return known[:4]


@pytest.mark.parametrize("name", ["clean/shaken", "clean/gauged"])
def test_files_keep_what_is_put_into_them(name):
    model = case_of(name).model
    for one in known_switches(model):
        changed = model.with_changes(one.changes(one.sizes))
        text = model_file_text(changed.file.model_dump(exclude_unset=True))
        read = simulation_kinds()[model.kind].family().parsed(text)
        assert read == changed.file
        assert set(one.parameters) <= set(changed.parameters)


def test_what_a_switch_changes_is_finite_in_every_response():
    case = case_of("clean/gauged")
    shown = through_model(case.model, refitted(case.model, case.recording, responses=case.responses))
    assert all(np.isfinite(columns[name]).all() for columns in shown.columns.values() for name in case.responses)
