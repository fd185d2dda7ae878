"""The correction of a thermal effect as a model file gives the effect's course again when it is applied."""

from __future__ import annotations

import dataclasses

import numpy as np
import pandas as pd
import pytest

from selector.controllers import evaluate, parsed_model
from selector.controllers.from_diagnosis import WORST, correction_of
from selector.controllers.model_file import model_text
from selector.diagnosis.answer import Diagnosis, Errors, Fit, NamedEffect
from selector.diagnosis.effects.effect import Quantity
from selector.diagnosis.matching.alignment import comparison_of
from selector.diagnosis.shapes.signals import course, lagged, rise
from selector.recording import Channel, Recording

CHANNELS = (
    Channel("T1", "temperature", "degC"),
    Channel("T2", "temperature", "degC"),
    Channel("n", "spindle_speed", "rpm"),
    Channel("Z", "displacement", "um", axis="Z"),
)


def recordings():
    """Two runs of five hours, a reading a minute."""
    random = np.random.default_rng(5)
    tables, simulated = {}, {}
    for number in range(2):
        t = 60.0 * np.arange(300.0)
        speed = np.repeat(random.choice([0.0, 1500.0, 3000.0], 6), 50)
        fast = np.zeros(300)
        slow = np.zeros(300)
        for k in range(1, 300):
            fast[k] = fast[k - 1] + (speed[k] / 250.0 - fast[k - 1]) / 20.0
            slow[k] = slow[k - 1] + (speed[k] / 400.0 - slow[k - 1]) / 90.0
        z = 4.0 * fast + random.normal(scale=0.2, size=300)
        index = pd.Index(t, name="time_s")
        tables[f"r{number}"] = pd.DataFrame({"T1": 20 + fast, "T2": 21 + slow, "n": speed, "Z": z}, index)
        simulated[f"r{number}"] = pd.DataFrame({"Z": 3.0 * fast}, index)
    return Recording.from_runs(tables, CHANNELS, {}), Recording.from_runs(simulated, CHANNELS[3:], {})


def answer(make):
    comparison = comparison_of(*recordings(), holdout="r1")
    shape = make(comparison)
    effect = NamedEffect(
        id="thermal.memory", channel="Z", place=None, statement="", parameters={}, confidence=0.9, p_value=0.0,
        share=0.9, cannot_be_told_from=(), experiment="", channels=("Z",), courses={"Z": shape},
    )  # fmt: skip
    return Diagnosis(
        comparison=comparison, verdict="missing-physics", headline="", where=(), effects=(effect,), fit={},
        evidence=(), detectable=(), next_runs=(), recalibration={}, findings=(), seed=3,
    ), shape  # fmt: skip


def memory(comparison):
    return 3.0 * lagged(comparison, rise(comparison, course(comparison, "T1")), 2400.0)


def test_the_model_file_applied_to_the_recordings_is_the_effect():
    found, shape = answer(memory)
    model, findings = correction_of(found)
    assert model is not None
    assert not findings
    read = parsed_model(model_text(model))
    for run, rows in found.comparison.rows_of_runs():
        readings = {name: found.comparison.recorded[name][rows] for name in ("T1", "T2", "n")}
        said = evaluate(read, found.comparison.time_s[rows], {one.name: readings[one.name] for one in read.inputs})
        left = np.asarray(said["Z"]) - shape[rows]
        # what the file itself promises of the whole, twice that for one run
        assert np.sqrt(np.mean(left**2)) < 2.0 * WORST * np.sqrt(np.mean(shape**2)), run
    assert any(state.source == "T1" and state.tau_s == pytest.approx(2400.0, rel=0.1) for state in read.states)


def test_a_course_that_no_reading_goes_with_is_refused_by_a_finding():
    found, _ = answer(lambda comparison: 5.0 * np.sin(comparison.time_s / 300.0) ** 2)
    model, findings = correction_of(found)
    assert model is None
    assert [finding.id for finding in findings] == ["correction-not-in-model-file"]


def test_a_gain_that_no_reading_follows_is_told_with_its_numbers():
    found, shape = answer(memory)
    before = 20.0 * np.sin(found.comparison.time_s / 300.0) ** 2
    after = before + shape + 0.1 * before + 2.0
    errors = Errors(2.0, 0.2, 0.2)
    fit = Fit("um", errors, errors, 1.0, None, None, before, after - shape, after)
    numbers = {"offset": Quantity(2.0, "um"), "gain": Quantity(1.1, "1"), "delay": Quantity(0.0, "s")}
    model, findings = correction_of(dataclasses.replace(found, fit={"Z": fit}, recalibration={"Z": numbers}))
    assert model is not None
    assert [finding.id for finding in findings] == ["correction-of-recalibrated"]
    assert "1.1 · s(t − 0 s)" in findings[0].statement
    assert model.provenance.note == findings[0].statement
    alone, _ = correction_of(found)
    assert alone is not None
    assert model.outputs[0].intercept == pytest.approx(alone.outputs[0].intercept + 2.0)


def test_effects_that_are_not_thermal_have_no_model_file():
    found, _ = answer(memory)
    other = dataclasses.replace(found, effects=(dataclasses.replace(found.effects[0], id="drive.coulomb"),))
    assert correction_of(other) == (None, ())
