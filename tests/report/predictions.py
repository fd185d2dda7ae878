"""Small predictions and simulations for the tests of figures and reports, with names that try to be markup."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np

from selector.findings import Finding, Where
from selector.physics.thermal.field_model import FieldMoment
from selector.physics.thermal.modes.modes import ModalModel, SpeedLaw
from selector.physics.thermal.modes.thermal_test import ThermalTest
from selector.physics.thermal.prediction.prediction import Method, Prediction, predict
from selector.telling.account import Account, Section
from selector.telling.simulated import account_of
from selector.telling.simulated.result import SimulationResult
from selector.telling.simulated.thermal import moment_drawing
from tests.physics.thermal.segments import of_segments
from tests.report.simulated import result
from tests.report.studies import HOSTILE

CYCLE = of_segments((60, 1000.0), (60, 2000.0), (60, 1600.0))
OPERATIONS_S = (3600.0, 3600.0, 3600.0)


def spindle_tests() -> list[ThermalTest]:
    """Four runs of a machine with one mode and two displacements, the second much smaller; noise of 0.1 µm."""
    gains = np.array([[[60.0, 4.0]]])
    machine = ModalModel(HOSTILE, np.array([3000.0]), gains, SpeedLaw((1.2,), 2000.0), 2000.0, np.zeros(1))
    time_s = np.arange(0.0, 6 * 3600.0 + 1, 120.0)
    found = []
    for k, speed in enumerate((800.0, 1200.0, 1600.0, 2000.0)):
        held = of_segments((180, speed), (180, 0.0))
        noise = np.random.default_rng(k).normal(0.0, 0.1, (len(time_s), 2))
        displacement = machine.displacement_um(held, time_s) + noise
        found.append(ThermalTest(f"<i>{speed:g}</i> & {k}", time_s, held.speed_at(time_s), displacement))
    return found


CUBE_M = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
# fmt: off
CUBE = np.array([
    [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4],
    [1, 5, 7], [1, 7, 3],
])


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
def simulation() -> SimulationResult:
    """Two blocks with coolant, two hours."""
    return result("thermal", NETWORK, Finding("odd-<b>", "warning", "an <b>odd</b> thing"))


def field_account() -> Account:
    """The account of `simulation`, with the picture of a cube before all else."""
    shown, account = simulation(), account_of(simulation(), drawn=True)
    moment = FieldMoment(4800.0, CUBE_M, CUBE, 20.0 + np.arange(8.0), np.eye(8, 3))
    drawing = moment_drawing(shown.recording, shown.simulated.inputs, moment, "run <1>")
    picture = Section("picture", "The machine at one moment", (drawing,), "Picture")
    return dataclasses.replace(account, sections=(picture, *account.sections))
