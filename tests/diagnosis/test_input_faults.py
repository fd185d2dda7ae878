"""Faults of recorded channels that are no responses: found, sized, and nothing said of normal recordings."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.catalogue import effect_of
from selector.diagnosis.effects.effect import Fitted
from selector.diagnosis.shapes.input_faults import input_faults, told_of_inputs
from selector.diagnosis.workflow import diagnosis
from selector.readers import read
from selector.recording import Channel

FIXTURES = Path(__file__).resolve().parents[2] / "fixtures"
N, STEP_S = 400, 60.0
RUNS = ("r1", "r2", "r3")
SENSORS = {"T1": (900.0, 1.0), "T2": (1800.0, 0.8), "T3": (3600.0, 0.6), "T4": (7200.0, 0.4)}


def warm_up(run, tau_s, gain):
    """Temperature of a place that follows the duty of a run with one time constant [°C], read to 0.1 K."""
    t = np.arange(N) * STEP_S
    duty = (np.sin(2 * np.pi * t / (7000.0 + 2500.0 * run)) > -0.3) * (1.0 - 0.2 * run)
    x = np.zeros(N)
    for k in range(1, N):
        x[k] = x[k - 1] + STEP_S / tau_s * (18.0 * gain * duty[k] - x[k - 1])
    return 20.0 + x


def machine(fault=None, seed=0):
    """`fault` (readings by name and run) changes readings; the simulation of Z is computed from T2 as it was read."""
    random = np.random.default_rng(seed)
    readings = {
        name: [np.round(warm_up(k, *of) + random.normal(scale=0.06, size=N), 1) for k in range(3)]
        for name, of in SENSORS.items()
    }
    true = np.concatenate(readings["T2"])
    if fault is not None:
        fault(readings)
    recorded = {name: np.concatenate(parts) for name, parts in readings.items()}
    simulated = 2.0 * (recorded["T2"] - 20.0)
    recorded["Z"] = np.round(2.0 * (true - 20.0) + random.normal(scale=0.3, size=3 * N), 2)
    channels = tuple(Channel(name, "temperature", "degC", place=f"place of {name}") for name in SENSORS)
    comparison = Comparison(
        runs=RUNS,
        starts=(0, N, 2 * N, 3 * N),
        time_s=np.tile(np.arange(N) * STEP_S, 3),
        channels=(*channels, Channel("Z", "displacement", "um")),
        recorded=recorded,
        simulated={"Z": simulated},
        responses=("Z",),
        held_out=np.repeat([False, False, True], N),
        resolution=dict.fromkeys(SENSORS, 0.1) | {"Z": 0.01},
    )
    return comparison, recorded["T2"] - true


def jump(readings):
    readings["T2"][0][150:] += 2.0


def freeze(readings):
    readings["T2"][0][100:250] = readings["T2"][0][100]


def drift(readings):
    readings["T2"][1][180:] += np.round(np.linspace(0.0, 6.0, N - 180), 1)


def exchange(readings):
    readings["T2"][1], readings["T4"][1] = readings["T4"][1], readings["T2"][1]


@pytest.mark.parametrize(
    ("fault", "effect_id", "run", "from_s"),
    [(jump, "data.step", "r1", 150), (freeze, "data.stuck", "r1", 100), (drift, "data.drift", "r2", 180)],
)
def test_faults_are_found_where_they_are(fault, effect_id, run, from_s):
    comparison, excess = machine(fault)
    found = [one for one in input_faults(comparison) if one.channel == "T2"]
    assert [(one.id, one.run) for one in found] == [(effect_id, run)]
    # a drift is seen when it has left the noise: a quarter of its length later
    assert abs(found[0].from_s / STEP_S - from_s) <= (70 if effect_id == "data.drift" else 2)
    # siblings are read to 0.1 K and follow with other lags
    assert np.corrcoef(found[0].course, excess)[0, 1] > 0.9
    assert np.abs(found[0].course).max() == pytest.approx(np.abs(excess).max(), rel=0.3)


def test_a_response_that_was_computed_from_a_faulty_reading_shows_it():
    comparison, _ = machine(jump)
    effect = effect_of("data.step")
    variants = [variant for variant in effect.variants(comparison, "Z") if variant.sources == ("T2",)]
    assert len(variants) == 1
    variant = variants[0]
    y = comparison.difference("Z")
    slope = float(variant.columns[:, 0] @ y / (variant.columns[:, 0] @ variant.columns[:, 0]))
    # what T2 reads too much, the simulation has too much times 2 µm/K
    assert slope == pytest.approx(-2.0, rel=0.1)
    fitted = Fitted("Z", "um", variant, np.array([slope]), np.array([0.05]), {}, 1.0, 4.0)
    said = effect.reading(fitted, comparison)
    assert all(word in said.statement for word in ("T2", "r1", "steps"))
    assert said.parameters["sensitivity"].unit == "um/K"
    assert variant.place == "place of T2"


def test_exchanged_sensors_are_one_fault():
    comparison, excess = machine(exchange)
    found = [one for one in input_faults(comparison) if one.id == "data.swapped"]
    assert len(found) == 1
    assert {found[0].channel, found[0].evidence["other"]} == {"T2", "T4"}
    # their readings, turned round, but for the sign of the one that is named first
    assert abs(np.corrcoef(found[0].course, excess)[0, 1]) > 0.99


@pytest.mark.parametrize("seed", range(5))
def test_normal_readings_have_no_fault(seed):
    assert input_faults(machine(seed=seed)[0]) == ()


@pytest.mark.parametrize("name", ["vmc37", "patent8"])
def test_recordings_of_machines_have_no_fault(name):
    folder = FIXTURES / name
    recording = read([folder], machine=folder / "machine.toml").recording
    parts = [recording.values(run, recording.names) for run in recording.runs]
    values = np.concatenate(parts)
    recorded = {channel: values[:, k] for k, channel in enumerate(recording.names)}
    responses = recording.with_role("displacement")
    comparison = Comparison(
        runs=recording.runs,
        starts=(0, *np.cumsum([len(part) for part in parts]).tolist()),
        time_s=np.concatenate([recording.time_s(run) for run in recording.runs]),
        channels=recording.channels,
        recorded=recorded,
        simulated={response: np.zeros(len(values)) for response in responses},
        responses=responses,
        held_out=np.zeros(len(values), dtype=bool),
    )
    assert input_faults(comparison) == ()


def test_a_leap_of_the_stamps_is_a_clock():
    comparison, _ = machine()
    time_s = comparison.time_s.copy()
    time_s[N + 200 : 2 * N] += 3600.0
    comparison = Comparison(**{**vars(comparison), "time_s": time_s})
    found = [one for one in input_faults(comparison) if one.id == "data.clock"]
    assert [(one.channel, one.run) for one in found] == [(None, "r2")]
    assert found[0].course[N + 250] == pytest.approx(3600.0, rel=1e-6)
    assert not found[0].course[: N + 200].any()
    leaps = [v for v in effect_of("data.clock").variants(comparison, "Z") if v.names == ("leap of the stamps",)]
    assert [variant.run for variant in leaps] == ["r2"]


def test_a_thermometer_that_died_in_most_runs_is_told():
    def dies(readings):
        for k in (0, 1):
            readings["T1"][k][200:] = readings["T1"][k][200]

    dead, _ = machine(dies)
    told = told_of_inputs(dead)
    assert [(f.id, f.level, f.action, f.where.channel, f.where.run) for f in told] == [
        ("stuck", "warning", "none", "T1", run) for run in ("r1", "r2")
    ]
    # readings in steps of 0.1 K may have been equal before
    assert all(190 * STEP_S <= finding.where.from_s <= 200 * STEP_S for finding in told)
    assert told_of_inputs(dead, {"T1"}) == ()
    assert told_of_inputs(machine()[0]) == ()
    # it may be at fault, and is not for sure
    assert [(fault.id, fault.sure) for fault in input_faults(dead)] == [("data.stuck", False)] * 2
    findings = diagnosis(dead).findings
    assert all(finding in findings for finding in told)
