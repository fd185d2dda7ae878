"""Small simulations of vibration for the tests of reports, with names that try to be markup."""

from __future__ import annotations

import functools
import tempfile
from pathlib import Path

from selector.cli.vibration_page import page_of
from selector.findings import Finding
from selector.physics.vibration.model_file import parsed_model_file
from selector.physics.vibration.vibration_model import vibration_model
from selector.physics.vibration.vibration_summary import vibration_summary
from selector.report.vibration_report import VibrationPage

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
def page(kind: str) -> VibrationPage:
    """The page of a "cut" with a chain, of a "run-up", or of the structure "alone", without either."""
    speed = "[[0.0, 300.0], [4.0, 900.0]]" if kind == "run-up" else "600.0"
    text = LATHE.replace("SPEED", speed) + (CHAIN + CUT if kind == "cut" else "")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "<a>.toml"
        path.write_text(text, encoding="utf-8")
        model = vibration_model(parsed_model_file(text))
        simulation = model.simulation(run="run <1>")
        summary = vibration_summary(model, simulation)
        said = Finding("from-<b>afar</b>", "warning", "said before </script>")
        return page_of(model, simulation, summary, (said, *summary.findings), path)
