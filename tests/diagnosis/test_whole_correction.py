"""What is saved beside an answer gives the error that the answer promises, computed from the files alone."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pandas as pd
import pytest

from selector.cli.shared.diagnosed import correction_told, write_correction
from selector.controllers import evaluate, parsed_model
from selector.diagnosis.answer import recalibration_of
from selector.diagnosis.effects.catalogue import effect_of
from selector.diagnosis.effects.effect import Quantity
from selector.diagnosis.matching.alignment import comparison_of
from selector.diagnosis.workflow import diagnosis
from selector.recording import Channel, Recording

CHANNELS = (
    Channel("T1", "temperature", "degC"),
    Channel("n", "spindle_speed", "rpm"),
    Channel("Z", "displacement", "um", axis="Z"),
)
N, STEP_S = 360, 60.0


def lag(x, tau_s):
    y = np.zeros(len(x))
    for k in range(1, len(x)):
        y[k] = y[k - 1] + STEP_S / tau_s * (x[k] - y[k - 1])
    return y


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    """An answer about a simulation of wrong offset, gain and delay without memory, what was saved, and the files."""
    rng = np.random.default_rng(3)
    recorded, simulated = {}, {}
    for run in ("r1", "r2", "r3"):
        speed = np.repeat(rng.choice([0.0, 1500.0, 3000.0], 9), N // 9)
        fast = 20.0 * lag(speed / 3000.0, 1200.0)
        known = 1.5 * fast
        z = known + 6.0 * lag(lag(speed / 3000.0, 1200.0), 9000.0) + rng.normal(scale=0.3, size=N)
        index = pd.Index(STEP_S * np.arange(N), name="time_s")
        recorded[run] = pd.DataFrame({"T1": 20.0 + fast, "n": speed, "Z": z}, index)
        simulated[run] = pd.DataFrame({"Z": 0.93 * np.interp(index - 40.0, index, known) - 2.0}, index)
    comparison = comparison_of(
        Recording.from_runs(recorded, CHANNELS, {}), Recording.from_runs(simulated, CHANNELS[2:], {}), holdout="r3"
    )
    found, model = correction_told(diagnosis(comparison, effects=[effect_of("thermal.memory")]), None)
    folder = tmp_path_factory.mktemp("saved")
    written = write_correction(found, None, model, folder)
    return found, written, folder, recorded["r3"], simulated["r3"]


def rms(values):
    return float(np.sqrt(np.mean(np.asarray(values) ** 2)))


def test_the_simulation_with_correction_json_has_the_promised_error(saved):
    found, _, folder, recorded, simulated = saved
    promised = found.as_dict()["fit"]["Z"]["heldout"]
    # the whole is worth something, and recalibration is a part of it
    assert promised["rmse_after"] < 0.4 * promised["rmse_before"]
    run = json.loads((folder / "correction.json").read_text(encoding="utf-8"))["runs"]["r3"]
    add = np.interp(recorded.index, run["time_s"], run["add"]["Z"])
    assert rms(recorded["Z"] - simulated["Z"] - add) == pytest.approx(promised["rmse_after"], rel=0.02)
    of_effects = np.interp(recorded.index, run["time_s"], run["of_effects"]["Z"])
    assert rms(recorded["Z"] - simulated["Z"] - of_effects) > 1.5 * promised["rmse_after"]


def test_the_numbers_of_the_recalibration_with_the_effects_have_it_too(saved):
    found, _, folder, recorded, simulated = saved
    promised = found.as_dict()["fit"]["Z"]["heldout"]["rmse_after"]
    numbers = {key: one["value"] for key, one in found.as_dict()["recalibration"]["Z"].items()}
    correction = json.loads((folder / "correction.json").read_text(encoding="utf-8"))
    assert {key: one["value"] for key, one in correction["recalibration"]["Z"].items()} == numbers
    late = np.interp(simulated.index - numbers["delay"], simulated.index, simulated["Z"])
    left = recorded["Z"] - (numbers["gain"] * late + numbers["offset"]) - correction["runs"]["r3"]["of_effects"]["Z"]
    assert rms(left) == pytest.approx(promised, rel=0.05)


def test_the_simulation_with_model_json_has_the_promised_error(saved):
    found, written, folder, recorded, simulated = saved
    assert "model.json" in written
    model = parsed_model((folder / "model.json").read_text(encoding="utf-8"))
    said = evaluate(model, recorded.index.to_numpy(), {one.name: recorded[one.name] for one in model.inputs})
    course = np.asarray(said["Z"])
    partly = [finding for finding in found.findings if finding.id == "correction-of-recalibrated"]
    if partly:
        told = partly[0].evidence
        late = np.interp(simulated.index - told["delay_s"], simulated.index, simulated["Z"])
        course = course + told["gain"] * late - simulated["Z"]
        assert "recalibrated" in str(model.provenance.note)
    left = recorded["Z"] - simulated["Z"] - course
    assert rms(left) == pytest.approx(found.fit["Z"].heldout.rmse_after, rel=0.1)


def test_what_nothing_held_out_can_check_is_suspected_only(saved):
    whole = saved[0].comparison
    z = np.where(whole.held_out, np.nan, whole.recorded["Z"])
    comparison = dataclasses.replace(whole, recorded={**whole.recorded, "Z": z})
    found = diagnosis(comparison, effects=[effect_of("thermal.memory")])
    assert [(effect.id, effect.suspected) for effect in found.effects] == [("thermal.memory", True)]
    assert found.effects[0].confidence <= min(0.5, saved[0].effects[0].confidence)
    assert found.as_dict()["fit"]["Z"]["heldout"]["rmse_after"] is None
    assert "held out" in found.headline


def test_the_delay_is_that_of_the_course_of_its_size():
    fitted = {"gain": Quantity(0.5, "1", 0.4, 0.6), "delay": Quantity(3.0, "s", 2.0, 4.0)}
    assert recalibration_of(fitted)["delay"] == Quantity(6.0, "s", 4.0, 8.0)
    turned = recalibration_of(fitted | {"gain": Quantity(-0.5, "1")})["delay"]
    assert (turned.value, turned.low, turned.high) == (-6.0, -8.0, -4.0)
