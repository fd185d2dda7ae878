"""Small simulations of gauging for the tests of reports, with names that try to be markup."""

from __future__ import annotations

import functools
import tempfile
from pathlib import Path

from selector.cli.gauging_page import page_of
from selector.findings import Finding
from selector.physics.channel_differences import channel_differences
from selector.physics.gauging.gauging_driving import driven_runs
from selector.physics.gauging.gauging_model import gauging_model
from selector.physics.gauging.gauging_summary import gauging_summary
from selector.physics.gauging.model_file import parsed_model_file
from selector.report.gauging_report import GaugingPage

NAME = "a <b>gauge</b></script><script>alert(1)</script>"
FIXTURES = Path(__file__).resolve().parents[2] / "fixtures" / "gauging"

LINE = f"""
[model]
kind = "gauging"
name = '{NAME}'
note = "an <i>odd</i> one"
[run]
parts = 12
seed = 3
[linear]
gain_v_per_um = -0.01
bias_v = 2.0
time_constant_s = 0.1
[grinding]
allowance_um = 40.0
feed_sd = 0.03
wheel_wear = 0.1
wear_growth_per_part = 0.05
dress_every = 5
[[grinding.stages]]
feed_um_per_s = 20.0
until_um = 15.0
[[grinding.stages]]
feed_um_per_s = 5.0
until_um = 0.0
[noise]
sd_um = 0.3
rate_per_s = 1.0
[tolerance]
lower_um = -1.5
upper_um = 1.5
"""
OFF = LINE.replace("[noise]", "[thresholds]\nvolts = [1.83, 1.97]\n[noise]").replace(
    "[tolerance]\nlower_um = -1.5\nupper_um = 1.5\n", ""
)


def text_of(kind: str) -> str:
    """Model file of a gauge as a "line", "off" what is wanted, or as a "chain" of its parts."""
    if kind == "chain":
        text = (FIXTURES / "grind-to-size.toml").read_text(encoding="utf-8")
        return text.replace("grinding a shaft to size", NAME.replace('"', "'")).replace("parts = 50", "parts = 2")
    return OFF if kind == "off" else LINE


@functools.cache
def page(kind: str) -> GaugingPage:
    """The page of a model of `text_of`, or of a "driven" line that follows a recording of itself."""
    text = text_of("line" if kind == "driven" else kind)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "<a>.toml"
        path.write_text(text, encoding="utf-8")
        model = gauging_model(parsed_model_file(text))
        simulation, differences, inputs = model.simulation(run="run <1>"), (), ()
        if kind == "driven":
            recorded = simulation.recording
            driven = driven_runs(model, recorded)
            simulation, inputs = driven.simulation, driven.inputs
            differences = channel_differences(simulation.recording, recorded, inputs)
        said = Finding("from-<b>afar</b>", "warning", "said before </script>")
        summary = gauging_summary(model, simulation)
        return page_of(model, simulation, summary, (said,), path, differences, inputs)
