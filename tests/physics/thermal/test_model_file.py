"""Model files: what is read, what is refused and how, what can be fitted again, and what runs."""

from __future__ import annotations

import copy
import dataclasses
import math
import os
import tomllib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from selector.errors import InputError, ModelFileError, OptionError
from selector.physics.model_fields import file_with, parameters_of
from selector.physics.model_text import plain_values
from selector.physics.thermal.field.machine import SENSORS, machine_laws
from selector.physics.thermal.field_model import laws_of
from selector.physics.thermal.model_file import (
    InputsSection,
    checked_model_file,
    complete_values,
    numbers,
    parsed_model_file,
    read_model_file,
)
from selector.physics.thermal.modes.modes import Cyclogram
from selector.physics.thermal.network.transient import simulate_heat
from selector.physics.thermal.schedule import (
    CONDITIONS,
    condensed,
    condition,
    driven,
    held_at,
    lagged,
    read_out,
    scheduled,
)
from selector.physics.thermal.thermal_model import driven_runs, model_findings, simulation_findings, thermal_model
from selector.recording import Channel, Recording
from tests.physics.thermal.segments import of_segments

EXAMPLES = Path(__file__).resolve().parents[3] / "fixtures" / "thermal"
HEADSTOCK = (EXAMPLES / "headstock.toml").read_text(encoding="utf-8")

# one node: everything about it has a closed form
CAPACITY, AREA, FILM, HEAT, UM_PER_K = 2.0e4, 0.5, 20.0, 100.0, 3.0
TAU_S = CAPACITY / (AREA * FILM)
RISE_K = HEAT / (AREA * FILM)
ONE_NODE = {
    "model": {"kind": "network", "name": "one node"},
    "run": {"duration_min": 120.0, "period_s": 60.0, "step_s": 60.0},
    "conditions": {"spindle_speed_rpm": 1000.0, "ambient_degc": 22.0},
    "nodes": {"block": {"heat_capacity_j_per_k": CAPACITY, "expansion_um_per_k": {"Z": UM_PER_K}}},
    "films": {"air": {"area_m2": {"block": AREA}, "still_w_per_m2_k": FILM}},
    "sources": {"bearing": {"shares": {"block": 1.0}, "speed_w": HEAT, "reference_rpm": 1000.0}},
}


def parameters(file):
    return parameters_of(file, numbers(file))


def with_parameters(file, values):
    return file_with(file, values, numbers(file), checked_model_file, complete_values(file))


def one_node(**changes: dict) -> dict:
    """The file of one node with other sections."""
    values = copy.deepcopy(ONE_NODE)
    for section, keys in changes.items():
        values[section] = {**values.get(section, {}), **keys} if isinstance(keys, dict) else keys
    return values


def own_conditions(file, columns=None, cyclogram=None):
    return scheduled(
        file.conditions, columns or {}, duration_s=file.run.duration_min * 60.0, period_s=file.run.period_s,
        cyclogram=cyclogram,
    )  # fmt: skip


def simulation(values: dict, **options) -> Recording:
    file = checked_model_file(values)
    return thermal_model(file).simulate(own_conditions(file), **options)


def column(recording: Recording, name: str) -> np.ndarray:
    return recording.values(recording.runs[0], [name])[:, 0]


# what runs


def test_one_node_warms_as_the_formula_says():
    recording = simulation(ONE_NODE)
    time_s = recording.time_s("simulation")
    rise = RISE_K * (1 - np.exp(-time_s / TAU_S))
    # the exact stepper has rounding errors only, about 1e-13 of 22 °C after 120 steps
    np.testing.assert_allclose(column(recording, "block"), 22.0 + rise, atol=1e-10)
    np.testing.assert_allclose(column(recording, "Z"), UM_PER_K * rise, atol=1e-10)
    assert [channel.role for channel in recording.channels] == [
        "spindle_speed", "ambient", "temperature", "displacement",
    ]  # fmt: skip
    assert recording.channel("Z").axis == "Z"
    balance = recording.provenance["runs"]["simulation"]
    assert balance["missing_share"] < 1e-9
    assert balance["sources_j"]["bearing"] == pytest.approx(HEAT * 7200.0, rel=1e-12)


def test_the_modes_of_a_file_follow_the_heating_law():
    file = read_model_file(EXAMPLES / "three-modes.toml")
    model = thermal_model(file)
    tau_s, gains = np.array(file.modes.tau_s), np.array(file.modes.gains_um["Z"])
    time_s = np.linspace(0.0, 7200.0, 50)
    for row, speed in zip(gains, file.modes.speed_rpm, strict=True):
        cyclogram = Cyclogram(np.zeros(1), np.array([speed]), 7200.0)
        conditions = scheduled(file.conditions, {}, duration_s=7200.0, period_s=30.0, cyclogram=cyclogram)
        z = column(model.simulate(conditions, time_s=time_s, instruments=False), "Z")
        # both sides are closed forms; powers of the speed cost a few digits of double precision
        np.testing.assert_allclose(z, ((1 - np.exp(-time_s[:, None] / tau_s)) * row).sum(axis=1), atol=1e-9)


def test_modes_refuse_a_speed_that_was_not_tested():
    file = read_model_file(EXAMPLES / "three-modes.toml")
    fast = scheduled(
        file.conditions, {}, duration_s=60.0, period_s=30.0, cyclogram=Cyclogram(np.zeros(1), np.array([4000.0]), 60.0)
    )
    with pytest.raises(InputError, match="2000"):
        thermal_model(file).simulate(fast)


@pytest.mark.parametrize(
    ("changes", "unchanged_without"),
    [
        ({"films": {"oil": {"area_m2": {"block": 1.0}, "still_w_per_m2_k": 500.0, "while_coolant": True}}}, "coolant"),
        ({"sources": {"gear": {"shares": {"block": 1.0}, "torque_share": 1.0}}}, "torque"),
        ({"sources": {"pump": {"shares": {"block": 1.0}, "coolant_w": 80.0}}}, "coolant"),
    ],
    ids=["film while coolant runs", "torque", "coolant heats"],
)
def test_physics_that_is_switched_off_changes_nothing(changes, unchanged_without):
    plain, more = simulation(ONE_NODE), simulation(one_node(**changes))
    np.testing.assert_array_equal(column(plain, "Z"), column(more, "Z"))
    on = {"coolant": {"coolant_on": 1.0}, "torque": {"torque_nm": 5.0}}[unchanged_without]
    assert np.abs(column(simulation(one_node(conditions=on, **changes)), "Z") - column(plain, "Z")).max() > 0.1


def test_a_network_that_no_heat_leaves_grows_and_is_told():
    values = one_node(run={"duration_min": 6000.0})
    del values["films"]
    (told,) = simulation_findings(simulation(values))
    assert told.id == "unlikely-temperature"
    assert told.where.channel == "block"
    assert simulation_findings(simulation(ONE_NODE)) == ()


# courses


def test_courses_of_every_kind():
    values = one_node(
        conditions={
            "spindle_speed_rpm": [[0, 500], [30, 0], [90, 2000]],
            "ambient_degc": {"mean": 20.0, "amplitude": 2.0, "period_min": 120.0, "phase_min": 30.0},
            "coolant_degc": {"file": "day.csv", "column": "tank"},
        }
    )
    file = checked_model_file(values)
    tank = (np.array([0.0, 1800.0]), np.array([19.0, 23.0]))
    conditions = own_conditions(file, {"coolant_degc": tank})
    at_s = np.array([0.0, 1799.0, 1800.0, 5399.0, 5400.0, 7200.0])
    np.testing.assert_array_equal(held_at(conditions, "spindle_speed", at_s), [500, 500, 0, 0, 2000, 2000])
    np.testing.assert_array_equal(held_at(conditions, "coolant", at_s), [19, 19, 23, 23, 23, 23])
    middle_s = np.arange(30.0, 7200.0, 60.0)
    exact = 20.0 + 2.0 * np.sin(2 * np.pi * (middle_s / 60.0 - 30.0) / 120.0)
    # the sine is held at the value of the middle of every period
    np.testing.assert_allclose(held_at(conditions, "ambient", middle_s), exact, atol=1e-12)
    assert held_at(conditions, "machine_on", at_s).tolist() == [1.0] * 6


@given(
    steps=st.lists(st.tuples(st.floats(0.5, 500), st.floats(0, 5000)), min_size=1, max_size=8),
    duration=st.floats(1.0, 2000.0),
)
@settings(max_examples=30)
def test_steps_hold_from_their_minute_on(steps, duration):
    starts = np.r_[0.0, np.cumsum([gap for gap, _ in steps])][:-1]
    course = [[float(start), speed] for start, (_, speed) in zip(starts, steps, strict=True)]
    file = checked_model_file(one_node(conditions={"spindle_speed_rpm": course}, run={"duration_min": duration}))
    conditions = own_conditions(file)
    assert conditions.time_s[0] == 0.0
    assert conditions.time_s[-1] == duration * 60.0
    at_min = np.linspace(0.0, duration, 37)
    expected = [next(speed for start, speed in reversed(course) if start * 60.0 <= t * 60.0) for t in at_min]
    np.testing.assert_array_equal(held_at(conditions, "spindle_speed", at_min * 60.0), expected)


# instruments


@given(tau_s=st.floats(0.1, 1e4), slope=st.floats(-1.0, 1.0), seed=st.integers(0, 99))
@settings(max_examples=30)
def test_a_lag_answers_a_ramp_as_the_formula_says(tau_s, slope, seed):
    steps = np.random.default_rng(seed).uniform(0.5, 20.0, 40)
    time_s = np.r_[0.0, np.cumsum(steps)]
    true = 20.0 + slope * time_s
    exact = 20.0 + slope * (time_s - tau_s * (1 - np.exp(-time_s / tau_s)))
    # differences of numbers of up to slope·τ = 1e4 leave 1e-12 of them, forty times
    np.testing.assert_allclose(lagged(time_s, true, tau_s), exact, atol=1e-8)


def test_instruments_have_the_noise_and_the_steps_that_they_say():
    values = np.full(20_000, 21.3)
    noisy = read_out(values, noise=0.05, resolution=0.0, seed=1, channel="T1")
    # the standard deviation of 20 000 draws is known to 0.5 %, four times that is 2 %
    assert np.std(noisy) == pytest.approx(0.05, rel=0.02)
    rounded = read_out(values, noise=0.05, resolution=0.1, seed=1, channel="T1")
    assert set(np.round(rounded * 10) / 10) == set(rounded)
    assert len(set(rounded)) > 3
    np.testing.assert_array_equal(read_out(values, noise=0.0, resolution=0.0, seed=1, channel="T1"), values)
    other = read_out(values, noise=0.05, resolution=0.0, seed=1, channel="T2")
    # independent channels: |r| of 20 000 pairs stays below 4/√20000 = 0.028
    assert abs(np.corrcoef(noisy, other)[0, 1]) < 0.028


def test_the_same_seed_gives_the_same_noise_whatever_else_is_measured():
    sensors = [{"name": "T1", "at": "block", "noise_k": 0.1}, {"name": "T2", "at": "block", "noise_k": 0.1}]
    both = simulation(one_node(sensors=sensors), seed=5)
    alone = simulation(one_node(sensors=sensors[1:]), seed=5)
    np.testing.assert_array_equal(column(both, "T2"), column(alone, "T2"))
    assert not np.array_equal(column(both, "T1"), column(both, "T2"))
    assert not np.array_equal(column(alone, "T2"), column(simulation(one_node(sensors=sensors[1:]), seed=6), "T2"))


# parameters


def test_parameters_have_units_values_and_bounds():
    file = read_model_file(EXAMPLES / "headstock.toml")
    found = thermal_model(file).parameters
    for name, parameter in found.items():
        assert parameter.low <= parameter.value <= parameter.high, name
        assert math.isfinite(parameter.high - parameter.low)
        assert parameter.low < parameter.high
    assert found["nodes.bed.heat_capacity_j_per_k"].unit == "J/K"
    assert found["nodes.bed.expansion_um_per_k.Z"].unit == "µm/K"
    assert found["films.hall.still_w_per_m2_k"].unit == "W/(m²·K)"
    assert found["films.hall.area_m2.bed"].unit == "m²"
    assert found["sources.lower_bearing.softening_per_k"].unit == "1/K"
    assert found["run.start_degc"].unit == "°C"
    assert (found["sources.lower_bearing.exponent"].low, found["sources.lower_bearing.exponent"].high) == (1.0, 2.0)
    modes = parameters(read_model_file(EXAMPLES / "three-modes.toml"))
    assert modes["modes.gains_um.Z.2000 rpm.mode 3"].value == 18.0
    assert modes["modes.tau_s.mode 2"].unit == "s"


@pytest.mark.parametrize("example", ["headstock.toml", "three-modes.toml"])
def test_every_parameter_does_something(example):
    file = read_model_file(EXAMPLES / example)
    model = thermal_model(file)
    speeds = of_segments((15, 800), (15, 1250), (15, 1600), (15, 2000), (15, 0))
    conditions = own_conditions(file, cyclogram=speeds)
    if example == "headstock.toml":
        # the file has coolant and torque from the second hour on only
        always = np.ones_like(conditions.time_s)
        conditions = dataclasses.replace(conditions, coolant_on=always, torque=10.0 * always)
    time_s = np.arange(0.0, speeds.end_s, 300.0)

    def outputs(changed) -> np.ndarray:
        recording = changed.simulate(conditions, time_s=time_s, instruments=False)
        return recording.frame[[channel.name for channel in model.outputs]].to_numpy()

    before = outputs(model)
    np.testing.assert_array_equal(outputs(model.with_parameters({})), before)
    for name, parameter in model.parameters.items():
        value = parameter.value + 0.2 * (parameter.high - parameter.value)
        changed = model.with_parameters({name: value})
        assert changed.parameters[name].value == value
        assert not np.array_equal(outputs(changed), before), name
    np.testing.assert_array_equal(outputs(model), before)


def test_parameters_that_do_not_exist_or_cannot_be_are_refused():
    model = thermal_model(checked_model_file(ONE_NODE))
    with pytest.raises(OptionError, match=r"nodes\.block\.heat_capacity"):
        model.with_parameters({"nodes.block.heat": 1.0})
    with pytest.raises(ModelFileError, match="heat_capacity_j_per_k"):
        model.with_parameters({"nodes.block.heat_capacity_j_per_k": -1.0})
    with pytest.raises(ModelFileError):
        model.with_parameters({"nodes.block.heat_capacity_j_per_k": math.nan})
    bounded = thermal_model(checked_model_file(one_node(bounds={"sources.bearing.speed_w": [50.0, 150.0]})))
    assert bounded.with_parameters({"sources.bearing.speed_w": 150.0}).parameters["sources.bearing.speed_w"].low == 50.0
    with pytest.raises(OptionError, match="50 to 150"):
        bounded.with_parameters({"sources.bearing.speed_w": 151.0})


def test_a_fit_finds_the_parameter_again():
    model = thermal_model(checked_model_file(ONE_NODE))
    conditions = own_conditions(model.file)
    target = column(model.with_parameters({"films.air.still_w_per_m2_k": 33.0}).simulate(conditions), "Z")
    from scipy.optimize import minimize_scalar

    bounds = model.parameters["films.air.still_w_per_m2_k"]

    def misfit(value: float) -> float:
        trial = model.with_parameters({"films.air.still_w_per_m2_k": value}).simulate(conditions)
        return float(np.sum((column(trial, "Z") - target) ** 2))

    found = minimize_scalar(misfit, bounds=(bounds.low, bounds.high), method="bounded")
    # a bounded search stops at about 1e-5 of the interval, 2 to 200
    assert found.x == pytest.approx(33.0, abs=0.01)


# driven by a recording


def recording_of(name: str = "r1", extra: dict | None = None, **columns) -> Recording:
    """A run with the irregular time stamps of a real one."""
    time_s = np.cumsum(np.random.default_rng(0).uniform(20.0, 40.0, 120))
    roles = {"n": "spindle_speed", "hall": "ambient", "T9": "temperature", "dial": "displacement", **(extra or {})}
    speed = np.where(time_s < 1800.0, 1000.0, 400.0)
    values = {"n": speed, "hall": 20.0 + time_s / 3600.0, "T9": 0 * speed, "dial": 0 * speed, **columns}
    units = {"spindle_speed": "rpm", "ambient": "degC", "temperature": "degC", "displacement": "um", "state": "1"}
    channels = [
        Channel(n, roles[n], units[roles[n]], "dial gauge" if n == "dial" else None, "Z" if n == "dial" else None)
        for n in values
    ]
    table = pd.DataFrame(values, index=pd.Index(time_s - time_s[0], name="time_s"))
    return Recording.from_runs({name: table}, channels)


def driven_by(recording: Recording, values: dict = ONE_NODE, **options):
    file = checked_model_file(values)
    return driven_runs(
        thermal_model(file), recording, inputs=file.inputs, otherwise=own_conditions(file), **options
    )  # fmt: skip


def test_a_recording_drives_the_model_under_its_own_names_and_times():
    recording = recording_of()
    simulated, findings = driven_by(recording)
    assert simulated.runs == ("r1",)
    np.testing.assert_array_equal(simulated.time_s("r1"), recording.time_s("r1"))
    # inputs as they were recorded, Z under the name of the recorded gauge of that axis, the node under its own
    assert simulated.names == ("n", "hall", "block", "dial")
    assert simulated.channel("dial") == recording.channel("dial")
    np.testing.assert_array_equal(column(simulated, "n"), column(recording, "n"))
    # dT/dt = (q − hA(T − θ))/C with every sample held: stepped here by hand
    time_s, n, hall = recording.time_s("r1"), column(recording, "n"), column(recording, "hall")
    expected = [hall[0]]
    for step, speed, fluid in zip(np.diff(time_s), n, hall, strict=False):
        level = fluid + HEAT * speed / 1000.0 / (AREA * FILM)
        expected.append(level + (expected[-1] - level) * math.exp(-step / TAU_S))
    np.testing.assert_allclose(column(simulated, "block"), expected, atol=1e-9)  # both exact up to rounding
    assert [finding.id for finding in findings] == ["output-not-recorded"]
    assert findings[0].evidence["outputs"] == ["block"]


def test_driving_is_free_of_noise_unless_a_seed_is_given():
    values = one_node(gauges=[{"name": "Z", "noise_um": 1.0}])
    clean, _ = driven_by(recording_of(), values)
    again, _ = driven_by(recording_of())
    np.testing.assert_array_equal(column(clean, "dial"), column(again, "dial"))
    noisy, _ = driven_by(recording_of(), values, seed=1)
    # 120 draws: the standard deviation is known to 6.5 %
    assert np.std(column(noisy, "dial") - column(clean, "dial")) == pytest.approx(1.0, rel=0.3)


def test_gaps_hold_the_last_value_and_rotation_has_no_sign():
    speed = column(recording_of(), "n")
    gaps = -speed
    gaps[10:20] = np.nan
    drive = driven(recording_of(n=gaps), "r1", InputsSection(), own_conditions(checked_model_file(ONE_NODE)))
    np.testing.assert_array_equal(drive.conditions.spindle_speed, speed)
    assert set(drive.not_recorded) == set(CONDITIONS) - {"spindle_speed", "ambient"}


def test_samples_closer_than_a_step_drive_as_their_mean():
    time_s = np.arange(0.0, 7200.0, 1.0)
    noise = np.random.default_rng(3).normal(0.0, 5.0, len(time_s))
    clean = np.where(time_s < 3605.0, 1000.0, 0.0)
    frame = pd.DataFrame({"n": clean + np.where(clean > 0, noise, 0.0)}, index=pd.Index(time_s, name="time_s"))
    trembling = Recording.from_runs({"r": frame}, [Channel("n", "spindle_speed", "rpm")])
    conditions = own_conditions(checked_model_file(ONE_NODE))
    drive = driven(trembling, "r", InputsSection(), conditions).conditions
    fewer = condensed(drive, 60.0)
    assert len(fewer.time_s) == 121
    assert fewer.time_s[-1] == drive.time_s[-1]
    for name in CONDITIONS:
        # the integral over the run is kept: sums of 7200 numbers of up to 1000, rounded at 1e-16
        before = np.sum(condition(drive, name)[:-1] * np.diff(drive.time_s))
        after = np.sum(condition(fewer, name)[:-1] * np.diff(fewer.time_s))
        assert after == pytest.approx(before, rel=1e-12)
    model = thermal_model(checked_model_file(ONE_NODE))
    full = model.machine
    every = simulate_heat(full.system, full.laws, drive, time_s=time_s[::60], step_s=60.0, start_degc=22.0)
    simulated = model.simulate(drive, time_s=time_s[::60])
    # the heat of the 5 s in which the spindle still turns is spread over its minute; noise averages to less
    bound = UM_PER_K * RISE_K * 5.0 * 60.0 / TAU_S**2
    np.testing.assert_allclose(
        column(simulated, "Z"), every.displacement_um[:, 0] - every.displacement_um[0, 0], atol=bound
    )
    assert condensed(fewer, 60.0) is fewer


def test_a_warm_start_is_told():
    cold, told = driven_by(
        recording_of(T9=column(recording_of(), "hall")), one_node(sensors=[{"name": "T9", "at": "block"}])
    )
    assert "start-differs" not in [finding.id for finding in told]
    warm = recording_of(T9=np.full(120, 27.5))
    _, told = driven_by(warm, one_node(sensors=[{"name": "T9", "at": "block"}]))
    (finding,) = (finding for finding in told if finding.id == "start-differs")
    assert finding.where.run == "r1"
    assert finding.evidence["largest_difference_k"]["r1"] == pytest.approx(27.5 - column(cold, "T9")[2], abs=1e-9)


def test_what_cannot_drive_a_model_is_refused():
    scheduled_speed = one_node(conditions={"spindle_speed_rpm": [[0, 100], [10, 0]]})
    without = recording_of(n=np.full(120, np.nan))
    with pytest.raises(OptionError, match="spindle_speed"):
        driven_by(without, scheduled_speed)
    simulated, findings = driven_by(without)
    assert "input-not-recorded" in [finding.id for finding in findings]
    assert "n" not in simulated.names
    with pytest.raises(OptionError, match="torque"):
        driven_by(recording_of(), one_node(inputs={"torque": "load"}))
    with pytest.raises(OptionError, match="ambient"):
        driven_by(recording_of(extra={"hall2": "ambient"}, hall2=np.full(120, 20.0)))
    with pytest.raises(OptionError, match="coolant_on"):
        driven_by(recording_of(extra={"coolant_on": "state"}, coolant_on=np.full(120, 7.0)))


def test_a_name_in_inputs_decides():
    hall2 = recording_of(extra={"hall2": "ambient"}, hall2=np.full(120, 30.0))
    drive = driven(
        hall2, "r1", InputsSection(ambient="hall2"), own_conditions(checked_model_file(ONE_NODE))
    )  # fmt: skip
    assert set(condition(drive.conditions, "ambient")) == {30.0}
    assert drive.channels == {"n": "spindle_speed", "hall2": "ambient"}


# the field machine


FIELD = (EXAMPLES / "field.toml").read_text(encoding="utf-8")


def test_the_laws_of_the_field_machine_are_varied_key_by_key():
    file = parsed_model_file(FIELD)
    shipped = {law.source: law for law in machine_laws("everything").heat}
    varied = {law.source: law for law in laws_of(file).heat}
    assert varied["lower bearing"].speed_w == 150.0 != shipped["lower bearing"].speed_w
    assert varied["lower bearing"].exponent == shipped["lower bearing"].exponent
    assert {n: law for n, law in varied.items() if n != "lower bearing"} == {
        n: law for n, law in shipped.items() if n != "lower bearing"
    }
    found = parameters(file)
    assert found["sources.lower bearing.speed_w"].value == 150.0
    assert found["coolant_films.table top.still_w_per_m2_k"].unit == "W/(m²·K)"
    for name, parameter in found.items():
        assert parameter.low <= parameter.value <= parameter.high, name
        changed = with_parameters(file, {name: parameter.value * 1.1})
        assert parameters(changed)[name].value == parameter.value * 1.1
        assert laws_of(changed) != laws_of(file), name
    assert laws_of(with_parameters(file, {})) == laws_of(file)


def test_a_cooler_is_a_film_of_oil_beside_the_air_and_its_numbers_are_parameters():
    file = parsed_model_file(FIELD + '\n[cooled."headstock inside"]\nstill_w_per_m2_k = 200\nfixed_degc = 22\n')
    plain = laws_of(parsed_model_file(FIELD))
    laws = laws_of(file)
    assert laws.films[:-1] == plain.films
    added = laws.films[-1]
    assert (added.film, added.fluid, added.fixed_degc, added.while_coolant) == ("headstock inside", "fixed", 22, False)
    warmer = with_parameters(file, {"cooled.headstock inside.fixed_degc": 25.0})
    assert laws_of(warmer).films[-1].fixed_degc == 25.0
    assert laws_of(warmer).films[:-1] == plain.films


@pytest.mark.parametrize(
    ("more", "where", "named"),
    [
        ('[sources."lower bering"]\nspeed_w = 1', 'sources."lower bering"', "'lower bearing' perhaps"),
        ('[films."table tops"]\nstill_w_per_m2_k = 1', 'films."table tops"', "'table top' perhaps"),
        ("[coolant_films.column]\nstill_w_per_m2_k = 1", "coolant_films.column", "table top"),
        ('[cooled."headstock inner"]\nstill_w_per_m2_k = 1', 'cooled."headstock inner"', "'headstock inside' perhaps"),
        ("[sources.motor]\nsoftening_per_k = 0.01", "sources.motor.softening_per_k", "lower bearing"),
        ("[sources.motor]\nshares = { motor = 1 }", "sources.motor.shares", "on_w"),
        ("[field.geometry]\ncolumn_hight_m = 2", "field.geometry.column_hight_m", "column_width_m"),
        ('[[sensors]]\nname = "T99"', "sensors[6].at", "T01"),
        ("[nodes.x]\nheat_capacity_j_per_k = 1", "nodes", "network"),
        ('physics = "all"', "field.physics", "everything"),
    ],
)
def test_what_the_field_machine_does_not_have_is_refused(more, where, named):
    # each of these before the machine is built
    text = f"{FIELD}\n{more}\n" if more.startswith("[") else FIELD.replace('physics = "everything"', more)
    with pytest.raises(ModelFileError) as caught:
        thermal_model(parsed_model_file(text))
    assert where in caught.value.where
    assert named in str(caught.value)


def test_the_field_machine_runs_with_sensors_anywhere():
    place = SENSORS["T19"].xyz_m
    same = f'[[sensors]]\nname = "same"\nxyz = {list(place)}\n'
    file = parsed_model_file(FIELD + same)
    model = thermal_model(file)
    conditions = own_conditions(file)
    time_s = np.arange(0.0, 18000.0, 600.0)
    recording = model.simulate(conditions, time_s=time_s, instruments=False)
    # one place, one row of the field: equal up to rounding
    np.testing.assert_allclose(column(recording, "same"), column(recording, "column front"), atol=1e-9)
    assert recording.channel("column front").place == SENSORS["T19"].place
    assert recording.channel("Y_lower").axis == "Y"
    assert recording.provenance["runs"]["simulation"]["missing_share"] < 1e-9
    softer = model.with_parameters({"sources.lower bearing.speed_w": 75.0})
    assert softer.machine.system is model.machine.system
    weaker = softer.simulate(conditions, time_s=time_s, instruments=False)
    # half of the heat of the hottest bearing: several K and several µm less
    assert column(recording, "T01").max() - column(weaker, "T01").max() > 1.0
    assert column(recording, "Z").max() - column(weaker, "Z").max() > 3.0
    elsewhere = FIELD + '[[sensors]]\nname = "far"\nxyz = [3.0, 3.0, 3.0]\n'
    with pytest.raises(ModelFileError, match=r"sensors\[6\]\.xyz"):
        thermal_model(parsed_model_file(elsewhere))
    with pytest.raises(ModelFileError, match=r"gauges\[5\]\.of"):
        thermal_model(parsed_model_file(FIELD + '[[gauges]]\nname = "W"\n'))


# what is refused


def refused(text: str) -> ModelFileError:
    with pytest.raises(ModelFileError) as caught:
        parsed_model_file(text, where="m.toml")
    error = caught.value
    assert all((error.found, error.expected, error.where, error.advice))
    assert error.where.startswith("m.toml")
    assert str(error).isprintable() or "\n" not in str(error)
    return error


@pytest.mark.parametrize(
    ("old", "new", "where", "named"),
    [
        ("period_s = 60\n", "periods_s = 60\n", "run.periods_s", "'period_s' perhaps"),
        ("heat_capacity_j_per_k = 9.0e3", "heat_capacity = 9.0e3", "nodes.lower_bearing.heat_capacity", "_j_per_k"),
        ("9.0e3", "-9.0e3", "nodes.lower_bearing.heat_capacity_j_per_k", "-9000"),
        ("9.0e3", "nan", "nodes.lower_bearing.heat_capacity_j_per_k", "finite"),
        ("9.0e3", "inf", "nodes.lower_bearing.heat_capacity_j_per_k", "finite"),
        ("9.0e3", "true", "nodes.lower_bearing.heat_capacity_j_per_k", "number"),
        ("9.0e3", '"9 kJ/K"', "nodes.lower_bearing.heat_capacity_j_per_k", "number"),
        ("9.0e3", "9" * 300, "nodes.lower_bearing.heat_capacity_j_per_k", "number"),
        ("9.0e3", "9" * 5000, "m.toml", "TOML"),
        ("duration_min = 480", "duration_min = 1e300", "run.duration_min", "1000000"),
        ("period_s = 60", "period_s = 0.0001", "run.period_s", "2000000"),
        ("step_s = 10", "step_s = 0", "run.step_s", "greater than 0"),
        ('["spindle", "lower_bearing"]', '["spindel", "lower_bearing"]', "links[1].between", "'spindle' perhaps"),
        ('["spindle", "lower_bearing"]', '["spindle", "spindle"]', "links[1].between", "different"),
        ('["spindle", "lower_bearing"]', '["upper_bearing", "spindle"]', "links[1].between", "twice"),
        ('kind = "network"', 'kind = "netwrk"', "model.kind", "network"),
        ('kind = "network"', "kind = 7", "model.kind", "network"),
        ("[model]", "[modes]\ntau_s = [1]\n[model]", "modes", "belongs to models of kind modes"),
        ('name = "T1"', 'name = "T\\u001b[31m"', "sensors[1].name", "printable"),
        ('name = "T1"', 'name = "T2"', "sensors[2].name", "T2"),
        ('name = "T1"', 'name = "spindle_speed"', "sensors[1].name", "spindle_speed"),
        ('at = "bed"', 'at = "bad"', "sensors[8].at", "'bed' perhaps"),
        ("spindle = 0.4 }", "spindle = 0.5 }", "sources.lower_bearing.shares", "1.1"),
        ('at = "lower_bearing"\n\n', "\n", "sources.lower_bearing.softening_per_k", "without a place"),
        ("[0, 1500]", "[5, 1500]", "conditions.spindle_speed_rpm", "begin with 0"),
        ("[120, 2500]", "[0, 2500]", "conditions.spindle_speed_rpm", "increase"),
        ("[120, 2500]", '["2 h", 2500]', "conditions.spindle_speed_rpm[2][1]", "number"),
        ("amplitude = 1.5", "amplitud = 1.5", "conditions.ambient_degc.amplitud", "'amplitude' perhaps"),
        ("[1.0, 2.0]", "[2.0, 1.0]", 'bounds."sources.lower_bearing.exponent"', "exchange"),
        ("[run]", "[run", "m.toml", "line"),
        ("[run]\n", "[run]\nx = " + "[" * 5000 + "]" * 5000 + "\n", "m.toml", "deep"),
        ("[run]\n", "[run]\n[run]\n", "m.toml", "TOML"),
        ("[run]\n", "[run]\n" + "a." * 500_000 + "a = 1\n", "line ", "more than 32 parts"),
        ("[run]\n", "[run]\nx = { " + "a . 'b' . " * 200_000 + "a = 1 }\n", "line ", "more than 32 parts"),
        ('["spindle", "lower_bearing"]', '["spindle", "lower_bearing", "bed"]', "links[1].between", "at most 2 values"),
        ('["spindle", "lower_bearing"]', '"spindle"', "links[1].between", "an array"),
        ("spindle = 0.4 }", "spindle = 0.4 }\n[sources.none]\nshares = {}", "sources.none.shares", "at least 1 entry"),
    ],
)
def test_a_file_with_a_mistake_is_refused_with_its_place(old, new, where, named):
    assert old in HEADSTOCK
    error = refused(HEADSTOCK.replace(old, new, 1))
    assert where in error.where
    assert named in str(error)


@pytest.mark.parametrize(
    ("old", "new", "where"),
    [
        ("tau_s = [300.0, 1800.0, 7200.0]", "tau_s = [1800.0, 300.0, 7200.0]", "modes.tau_s"),
        ("tau_s = [300.0, 1800.0, 7200.0]", "tau_s = [300.0, 1800.0]", "modes.gains_um.Z"),
        ("speed_rpm = [800, 1250, 1600, 2000]", "speed_rpm = [800, 1250, 1600]", "modes.gains_um.Z"),
        ('name = "Y"', 'name = "X"', "gauges[2].of"),
        ("[conditions]", "[conditions]\nambient_degc = 20", "conditions.ambient_degc"),
    ],
)
def test_modes_with_a_mistake_are_refused(old, new, where):
    text = (EXAMPLES / "three-modes.toml").read_text(encoding="utf-8")
    assert old in text
    assert where in refused(text.replace(old, new, 1)).where


def test_bounds_must_hold_the_value_and_name_a_parameter():
    for bounds in ({"run.start": [0.0, 1.0]}, {"films.air.still_w_per_m2_k": [100.0, 200.0]}):
        with pytest.raises(ModelFileError, match="bounds"):
            thermal_model(checked_model_file(one_node(bounds=bounds)))


def test_files_that_are_no_model_files(tmp_path):
    (tmp_path / "large.toml").write_bytes(b"#" * 5_000_000)
    (tmp_path / "bytes.toml").write_bytes(b"name = '\xff'")
    (tmp_path / "empty.toml").write_bytes(b"")
    for name in ("large.toml", "bytes.toml", "empty.toml", "nothing.toml", "."):
        with pytest.raises(ModelFileError) as caught:
            read_model_file(tmp_path / name)
        assert str(tmp_path) in caught.value.where


def test_keys_of_a_million_letters_cost_no_time():
    # a search that grows with the square takes an hour, tomllib itself some tenths of a second
    for text in ("a" * 4_000_000, "a " * 2_000_000, "a." * 30 + "b" * 3_000_000, '"' * 3_999_999):
        refused(f"[model]\n{text}")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes on this system")
def test_a_pipe_is_no_model_file(tmp_path):
    os.mkfifo(tmp_path / "pipe.toml")
    with pytest.raises(ModelFileError, match="a device, a pipe"):
        read_model_file(tmp_path / "pipe.toml")


def test_parts_that_no_heat_leaves_are_named():
    assert model_findings(checked_model_file(ONE_NODE)) == ()
    alone = {"nodes": {"lid": {"heat_capacity_j_per_k": 1e3}}}
    (told,) = model_findings(checked_model_file(one_node(**alone)))
    assert (told.id, told.level, told.where.channel) == ("no-way-for-heat", "warning", "lid")
    assert told.evidence == {"nodes": ["lid"], "heated": False}
    linked = alone | {"links": [{"between": ["block", "lid"], "conductance_w_per_k": 1.0}]}
    assert model_findings(checked_model_file(one_node(**linked))) == ()
    closed = one_node(**linked)
    del closed["films"]
    (told,) = model_findings(checked_model_file(closed))
    assert told.evidence["nodes"] == ["block", "lid"]
    assert "stays there" in told.statement


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=12), inner, max_size=4),
    max_leaves=12,
)
PLACES = [(s, k) for s, v in tomllib.loads(HEADSTOCK).items() for k in (v if isinstance(v, dict) else range(len(v)))]


@given(place=st.sampled_from(PLACES), junk=JSON)
@settings(max_examples=75)
def test_junk_anywhere_is_read_or_refused_but_never_a_defect(place, junk):
    values = tomllib.loads(HEADSTOCK)
    values[place[0]][place[1]] = junk
    try:
        file = checked_model_file(values)
        parameters(file)
    except InputError as error:
        refusal = (error.where, error.found, error.expected, error.advice)
    else:
        refusal = ("read",)
        assert checked_model_file(plain_values(file)) == file
    assert all(refusal)


NUMBERS = st.sampled_from([0, 1, -1, 4, 100, 1e-9, 1e-3, 1e3, 1e6, 1e9, 1e12, 1e300, -1e9, 1e-300])
PHYSICS = sorted(parameters(parsed_model_file(HEADSTOCK)))


@given(changes=st.dictionaries(st.sampled_from(PHYSICS), NUMBERS, max_size=4))
@settings(max_examples=30)
def test_absurd_physics_is_simulated_or_refused_but_never_a_defect(changes):
    file = parsed_model_file(HEADSTOCK)
    cyclogram = Cyclogram(np.array([0.0, 300.0]), np.array([3000.0, 0.0]), 600.0)
    conditions = scheduled(file.conditions, {}, duration_s=600.0, period_s=60.0, cyclogram=cyclogram)
    try:
        recording = thermal_model(with_parameters(file, changes)).simulate(conditions)
        told = simulation_findings(recording)
    except InputError as error:
        outcome = [error.where, error.advice]
    else:
        outcome = [recording.runs, *(finding.statement for finding in told)]
    assert all(outcome)


@pytest.mark.parametrize("example", sorted(path.name for path in EXAMPLES.glob("*.toml")))
def test_examples_read_back_as_they_are(example):
    file = read_model_file(EXAMPLES / example)
    assert checked_model_file(plain_values(file)) == file
