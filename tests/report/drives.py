"""Small simulations of feed drives for the tests of reports, with names that try to be markup."""

from __future__ import annotations

import functools

from selector.findings import Finding
from selector.telling.simulated.result import SimulationResult
from tests.report.simulated import result

NAME = "a <b>slide</b></script><script>alert(1)</script>"

SCREW = f"""
[model]
kind = "drive"
name = '{NAME}'
note = "an <i>odd</i> one"
[run]
period_s = 0.001
[motion]
kind = "sine"
axis = "X"
amplitude_mm = 20.0
frequency_hz = 2.0
duration_s = 1.0
phase_deg = 90.0
[axes.X]
parts = "thc6350-x"
varying = "VARYING"
[axes.X.servo]
position_gain_per_s = 40.0
velocity_gain = 4.0
velocity_integral_gain = 160.0
command_limit = 20.0
"""

CIRCLE = f"""
[model]
kind = "drive"
name = '{NAME}'
[motion]
kind = "circle"
radius_mm = 25.0
feeds_mm_per_min = [3000.0, 6000.0]
[ball_bar]
squareness_um_per_m = 100.0
""" + "".join(
    f"""
[axes.{name}.mechanics]
kind = "rigid"
mass_kg = 95.0
guide_damping_ns_per_m = 200.0
[axes.{name}.friction]
coulomb_n = 10.0
[axes.{name}.servo]
position_gain_per_s = {gain}
velocity_gain = 200.0
actuator_gain = 35.0
"""
    for name, gain in (("X", 100.0), ("Y", 98.0))
)


@functools.cache
def page(kind: str) -> SimulationResult:
    """An axis whose stiffness varies along its "command" or with its "state", or a "circle"."""
    text = CIRCLE if kind == "circle" else SCREW.replace("VARYING", kind)
    return result("drive", text, Finding("from-<b>afar</b>", "warning", "said before </script>"))
