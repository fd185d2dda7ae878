"""Small simulations of gauging for the tests of reports, with names that try to be markup."""

from __future__ import annotations

import functools
from pathlib import Path

import pytest

from selector.findings import Finding
from selector.physics.gauging import gauging_summary
from selector.telling.simulated.result import SimulationResult
from tests.physics.gauging.quick_trials import shorten_trials
from tests.report.simulated import result

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
def page(kind: str) -> SimulationResult:
    """A model of `text_of`, or a "driven" line that follows a recording of itself."""
    said = Finding("from-<b>afar</b>", "warning", "said before </script>")
    with pytest.MonkeyPatch.context() as patch:
        shorten_trials(patch)
        # few parts and filters, but for sizes that are off: what is told of them has more digits
        if kind != "off":
            patch.setattr(gauging_summary, "FEWEST_SIZES", 200)
            patch.setattr(gauging_summary, "_FILTERS", 4)
        return result("gauging", text_of("line" if kind == "driven" else kind), said, driven=kind == "driven")
