"""Small simulations of feed drives for the tests of reports, with names that try to be markup."""

from __future__ import annotations

import functools
import tempfile
from pathlib import Path

from selector.cli.drive_page import page_of
from selector.findings import Finding
from selector.physics.drive.drive_model import drive_model
from selector.physics.drive.drive_summary import drive_summary
from selector.physics.drive.model_file import parsed_model_file
from selector.report.drive_report import DrivePage

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
radius_mm = 50.0
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
def page(kind: str) -> DrivePage:
    """The page of an axis whose stiffness varies along its "command" or with its "state", or of a "circle"."""
    text = CIRCLE if kind == "circle" else SCREW.replace("VARYING", kind)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "<a>.toml"
        path.write_text(text, encoding="utf-8")
        model = drive_model(parsed_model_file(text))
        simulation = model.simulation(run="run <1>")
        said = Finding("from-<b>afar</b>", "warning", "said before </script>")
        return page_of(model, simulation, drive_summary(model, simulation), (said,), path)
