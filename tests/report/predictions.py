"""Small predictions and simulations for the tests of figures and reports, with names that try to be markup."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np

from selector.findings import Finding, Where
from selector.physics.thermal.cyclogram import Cyclogram
from selector.physics.thermal.model_file import parsed_model_file
from selector.physics.thermal.modes import ModalModel
from selector.physics.thermal.prediction import Method, Prediction, predict
from selector.physics.thermal.schedule import scheduled
from selector.physics.thermal.speed_law import SpeedLaw
from selector.physics.thermal.thermal_model import thermal_model
from selector.physics.thermal.thermal_test import ThermalTest
from selector.physics.thermal.time_constants import slowest_time_constants
from selector.report.simulation_report import SimulationPage
from tests.report.studies import HOSTILE

CYCLE = Cyclogram.of_segments((60, 1000.0), (60, 2000.0), (60, 1600.0))
OPERATIONS_S = (3600.0, 3600.0, 3600.0)


def spindle_tests() -> list[ThermalTest]:
    """Four runs of a machine with one mode and two displacements, the second much smaller; noise of 0.1 µm."""
    gains = np.array([[[60.0, 4.0]]])
    machine = ModalModel(HOSTILE, np.array([3000.0]), gains, SpeedLaw((1.2,), 2000.0), 2000.0, np.zeros(1))
    time_s = np.arange(0.0, 6 * 3600.0 + 1, 120.0)
    found = []
    for k, speed in enumerate((800.0, 1200.0, 1600.0, 2000.0)):
        held = Cyclogram.of_segments((180, speed), (180, 0.0))
        noise = np.random.default_rng(k).normal(0.0, 0.1, (len(time_s), 2))
        displacement = machine.displacement_um(held, time_s) + noise
        found.append(ThermalTest(f"<i>{speed:g}</i> & {k}", time_s, held.speed_at(time_s), displacement))
    return found


@functools.cache
def prediction(method: Method = "piecewise", tolerance_um: float | None = 10.0) -> Prediction:
    """Three operations of an hour each; with `tolerance_um` None no program."""
    return predict(
        spindle_tests(),
        HOSTILE,
        CYCLE,
        method=method,
        operations_s=None if tolerance_um is None else OPERATIONS_S,
        tolerance_um=tolerance_um,
        told=[Finding("from-<b>afar</b>", "warning", "said before </script>", Where(file="some/where/x.csv"))],
    )


def unsure() -> Prediction:
    """The same with an error on unseen tests that leaves nothing of the tolerance."""
    return dataclasses.replace(prediction(), heldout_um=np.array([7.0, 0.2]))


NETWORK = """
[model]
kind = "network"
name = "<u>two</u> blocks & {{7*7}}"
note = "invented"
[run]
duration_min = 120
period_s = 60
seed = 1
[conditions]
spindle_speed_rpm = [[0, 1500], [40, 3000], [80, 0]]
ambient_degc = { mean = 20.0, amplitude = 1.0 }
coolant_on = [[0, 0], [40, 1]]
coolant_degc = { mean = 19.0, amplitude = 0.5 }
[nodes.head]
heat_capacity_j_per_k = 3e4
place = "headstock, front"
expansion_um_per_k = { Z = 2.0 }
[nodes.column]
heat_capacity_j_per_k = 2e5
place = "column, front"
expansion_um_per_k = { Z = 1.0, Y = -3.0 }
[[links]]
between = ["head", "column"]
conductance_w_per_k = 20.0
[films.hall]
area_m2 = { head = 1.0, column = 2.0 }
still_w_per_m2_k = 8.0
[films.flood]
area_m2 = { column = 0.3 }
still_w_per_m2_k = 200.0
while_coolant = true
fluid = "coolant"
[sources.bearing]
shares = { head = 1.0 }
speed_w = 300.0
reference_rpm = 3000
exponent = 1.5
[[sensors]]
name = "<script>alert(1)</script>"
at = "head"
noise_k = 0.03
[[sensors]]
name = "T2"
at = "column"
[[gauges]]
name = "Z"
noise_um = 0.2
[[gauges]]
name = "Y"
noise_um = 0.2
"""


@functools.cache
def simulation() -> SimulationPage:
    """Two blocks with coolant, two hours."""
    file = parsed_model_file(NETWORK)
    machine = thermal_model(file)
    conditions = scheduled(file.conditions, {}, duration_s=7200.0, period_s=60.0)
    recording = machine.simulate(conditions, run="run <1>")
    return SimulationPage(
        recording=recording,
        model=machine.name,
        inputs=recording.names[: len(recording.names) - len(machine.outputs)],
        findings=(Finding("odd-<b>", "warning", "an <b>odd</b> thing"),),
        time_constants=slowest_time_constants(machine.machine, conditions),
        parameters=machine.parameters,
        told={"model file": "<a>.toml", "seed": 1},
    )
