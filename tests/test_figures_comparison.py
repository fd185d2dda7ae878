"""The picture of simulated beside recorded keeps its peaks, has its units, and no name is markup."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

from selector.figures.simulated.drive import recorded_and_simulated
from selector.figures.style import title_text
from tests.report.studies import HOSTILE
from tests.test_figures_thermal import strings_of

TIME_S = np.linspace(0.0, 20.0, 20_001)
RECORDED = 1e5 * np.sin(TIME_S)


def spiked() -> np.ndarray:
    simulated = RECORDED + 1.0
    simulated[12_345] += 40.0
    return simulated


def test_courses_and_difference_with_a_spike_of_one_sample():
    drawn = recorded_and_simulated(TIME_S, RECORDED, spiked(), "qm", "um")
    recorded, simulated, difference = drawn.data
    assert (recorded.name, simulated.name) == ("recorded", "simulated")
    # courses in mm, drawn in single precision
    assert max(recorded.y) == pytest.approx(100.0, rel=1e-5)
    assert max(difference.y) == pytest.approx(41.0, rel=1e-6)
    assert len(difference.y) < 1000
    assert difference.x[int(np.argmax(difference.y))] == pytest.approx(12.345, rel=1e-6)
    assert [drawn.layout[axis].title.text for axis in ("yaxis", "yaxis2")] == ["course [mm]", "difference [µm]"]
    # 1 everywhere and 41 once: √(1 + (41² − 1)/20 001)
    assert all(said in title_text(drawn) for said in ("1.04 µm rms", "41.0 µm", "12.3 s"))


def test_units_of_other_channels():
    drawn = recorded_and_simulated(TIME_S, RECORDED, RECORDED, "u", "V")
    assert [drawn.layout[axis].title.text for axis in ("yaxis", "yaxis2")] == ["course [V]", "difference [V]"]
    number = recorded_and_simulated(TIME_S, RECORDED, RECORDED, "u", "1")
    assert number.layout.yaxis.title.text == "course"


@pytest.mark.parametrize("name", HOSTILE)
def test_no_name_is_markup(name):
    drawn = recorded_and_simulated(TIME_S[:50], RECORDED[:50], RECORDED[:50], name, "um")
    texts = strings_of(json.loads(drawn.to_json()))
    assert any("simulated and recorded differ" in text for text in texts)
    assert not [text for text in texts if re.sub(r"</?extra>|<br>", "", text).count("<")]
