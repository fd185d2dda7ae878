"""Options that cannot be used are refused with the option's name, what is possible, and what to do."""

from __future__ import annotations

import math

import numpy as np
import pytest

from selector.errors import InputError, OptionError
from selector.selection import Options, select
from selector.selection.options import question_of
from tests.models.runs import recording
from tests.selection.machines import machine


@pytest.mark.parametrize(
    ("options", "where"),
    [
        ({"degree": 4}, "--degree"),
        ({"degree": 0}, "--degree"),
        ({"level": 1.1}, "--lambda"),
        ({"level": -0.1}, "--lambda"),
        ({"level": math.nan}, "--lambda"),
        ({"level": (0.9, 2.0), "rounds": 2}, "--lambda"),
        ({"rounds": 0}, "--rounds"),
        ({"max_sensors": 0}, "--max-sensors"),
        ({"max_sensors": 10**20}, "--max-sensors"),
        ({"tolerance": -0.1}, "--tolerance"),
        ({"tolerance": math.inf}, "--tolerance"),
        ({"cost": {"T1": -1.0}}, "--cost"),
        ({"cost": {"T1": math.nan}}, "--cost"),
        ({"must": ("T1",), "never": ("T1",)}, "--must and --never"),
        ({"must": ("T1", "T2", "T3"), "max_sensors": 2}, "--must"),
    ],
)
def test_values_that_no_recording_can_use(options, where):
    with pytest.raises(OptionError) as caught:
        Options(**options)
    assert caught.value.where == where
    assert caught.value.advice


@pytest.mark.parametrize(
    ("options", "where", "listed"),
    [
        ({"responses": ("X",)}, "--response", "Z"),
        ({"responses": ("T1",)}, "--response", "Z"),
        ({"must": ("T99",)}, "--must", "T1"),
        ({"never": ("Z",)}, "--never", "T1"),
        ({"cost": {"t1": 2.0}}, "--cost", "T1"),
        ({"conditions": {"day9": "winter"}}, "--condition", "day1"),
        ({"never": ("T1", "T2", "T3", "T4", "T5", "T6", "T7")}, "--never", "sensor"),
    ],
)
def test_names_that_this_recording_does_not_have(options, where, listed):
    with pytest.raises(OptionError) as caught:
        select(machine(n_runs=2, n=60), Options(**options))
    assert caught.value.where == where
    assert listed in caught.value.expected


def some(**values):
    return recording({"a": (np.arange(50.0), {name: np.asarray(v, dtype=float) for name, v in values.items()})})


RAMP = np.linspace(0, 5, 50)


@pytest.mark.parametrize(
    ("source", "message"),
    [
        (some(T1=RAMP), "no displacement channel"),
        (some(Z=RAMP), "no temperature channel"),
        (some(T1=RAMP, Z=np.full(50, np.nan)), "no run has two samples with Z"),
        (some(T1=RAMP, Z=np.full(50, 3.0)), "Z always reads 3 µm"),
        (some(T1=np.full(50, 21.0), T2=np.full(50, np.nan), Z=RAMP), "no usable sensor: T1 always reads 21 °C"),
        (some(T1=RAMP * 1e20, Z=RAMP), "T1 reads from"),
        (recording({"a": (np.arange(4.0), {"T1": RAMP[:4], "Z": RAMP[:4]})}), "complete samples"),
    ],
    ids=["no response", "no sensor", "response missing", "response at rest", "sensors at rest", "absurd", "too short"],
)
def test_recordings_that_cannot_support_a_model(source, message):
    with pytest.raises(InputError, match=message) as caught:
        select(source)
    assert caught.value.advice


def test_no_more_sensors_are_looked_for_than_there_are():
    source = machine(n_runs=2, n=60)
    asked = question_of(source, Options(max_sensors=10_000))
    assert asked.max_sensors == len(asked.sensors)
    assert question_of(source, Options(max_sensors=2)).max_sensors == 2


def test_levels_are_repeated_for_further_rounds():
    assert Options(level=0.99, rounds=3).levels == (0.99, 0.99, 0.99)
    assert Options(level=(0.99, 0.9), rounds=3).levels == (0.99, 0.9, 0.9)
    assert Options().levels is None


def test_a_set_costs_the_sum_of_its_sensors():
    assert Options(cost={"T3": 2.5}).total_cost(["T1", "T3"]) == 3.5


def test_options_round_trip_into_json():
    options = Options(level=0.9, must=("T1",), conditions={"day1": "winter"})
    document = options.as_dict()
    assert document["lambda"] == [0.9]
    assert document["conditions"] == {"day1": "winter"}
    assert Options().as_dict()["lambda"] == "auto"
