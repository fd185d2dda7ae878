"""Small simulations of vibration for the tests of reports, with names that try to be markup."""

from __future__ import annotations

import functools

from selector.findings import Finding
from selector.telling.simulated.result import SimulationResult
from tests.report.simulated import result

NAME = "a <b>lathe</b></script><script>alert(1)</script>"
SOURCE = "<b>motor</b>"

LATHE = f"""
[model]
kind = "vibration"
name = '{NAME}'
note = "an <i>odd</i> one"
[run]
period_s = 0.0005
duration_s = 4.0
[members."<i>bed</i>"]
mass_kg = 600.0
[members.tool]
mass_kg = 10.0
[members.workpiece]
mass_kg = 40.0
[[joints]]
between = ["<i>bed</i>", "ground"]
stiffness_n_per_m = 4.0e8
dissipation = 0.6
[[joints]]
between = ["workpiece", "<i>bed</i>"]
stiffness_n_per_m = 1.0e8
dissipation = 0.3
[[joints]]
between = ["tool", "<i>bed</i>"]
stiffness_n_per_m = 4.0e6
dissipation = 0.3
[shafts.spindle]
rpm = SPEED
[sources."{SOURCE}"]
member = "tool"
lines = [{{ frequency_hz = 90.0, force_n = 4.0 }}]
[sources.spindle]
member = "workpiece"
shaft = "spindle"
lines = [{{ order = 2.0, force_n = 6.0 }}]
"""

CHAIN = f"""
[[chains]]
name = "<b>one</b>"
range = "low"
sources = ["{SOURCE}"]
path = ["tool", "<i>bed</i>"]
final = "tool"
"""

CUT = """
[cutting]
shaft = "spindle"
diameter_mm = 60.0
feed_mm_per_rev = 0.2
force_coefficient = 243.0
depth_exponent = 0.9
feed_exponent = 0.6
speed_exponent = -0.3
"""


@functools.cache
def page(kind: str) -> SimulationResult:
    """A "cut" with a chain, a "run-up", or the structure "alone", without either."""
    speed = "[[0.0, 300.0], [4.0, 900.0]]" if kind == "run-up" else "600.0"
    text = LATHE.replace("SPEED", speed) + (CHAIN + CUT if kind == "cut" else "")
    return result("vibration", text, Finding("from-<b>afar</b>", "warning", "said before </script>"))
