"""Loops and the range of a model: widths, samples outside, names that are text."""

from __future__ import annotations

import re

import numpy as np
import pytest

from selector.figures import style
from selector.figures.loops import MOST_SENSORS, LoopShown, displacement_loops, loop_width_um
from selector.figures.proof import SetError, set_error_changes, set_errors_picture
from selector.figures.style import changed
from selector.number_text import number_text


def loop(width_um: float, n: int = 2000) -> tuple[np.ndarray, np.ndarray]:
    """Up and down again; on the way back the displacement is larger by `width_um`."""
    up = np.linspace(0.0, 10.0, n // 2)
    reading = np.concatenate([up, up[::-1]])
    return reading, 3.0 * reading + width_um * (np.arange(n) >= n // 2)


@pytest.mark.parametrize("width_um", [0.0, 4.0])
def test_the_width_of_a_loop(width_um):
    # half a step of 1/30 of the range on a slope of 3 µm/K at most
    assert loop_width_um(*loop(width_um)) == pytest.approx(width_um, abs=0.5)


def shown(run: str, reading: np.ndarray, displacement_um: np.ndarray, left: float | None = None) -> LoopShown:
    """A run with one sensor; a model leaves a share of the displacement."""
    return LoopShown(run, reading[:, None], displacement_um, None if left is None else left * displacement_um)


def test_a_run_that_only_warms_up_has_no_loop():
    rising = np.linspace(0.0, 5.0, 100)
    drawn = displacement_loops(["T1"], "Z", [shown("day 1", rising, 2 * rising)])
    assert np.isnan(loop_width_um(rising, 2 * rising))
    assert "no run" in drawn.layout.title.text
    assert drawn.layout.xaxis.title.text == "ΔT1 [K]"
    assert drawn.layout.yaxis.title.text == "Z [µm]"


def test_the_widest_loop_is_named_with_what_the_model_leaves():
    runs = [shown(f"<b>day {k}</b>", *loop(float(k)), left=0.5) for k in (1, 5)]
    drawn = displacement_loops(["<i>T1</i>"], "Z", runs, rise=False)
    assert "&lt;b&gt;day 5" in drawn.layout.title.text.replace("<br>", " ")
    assert [len(line.x) for line in drawn.data] == [2000] * 2
    assert "<i>" not in drawn.to_json()
    assert drawn.layout.xaxis.title.text.endswith("[°C]")
    widths = re.search(r": ([\d.]+) µm<br>residual ([\d.]+) µm", drawn.layout.annotations[0].text)
    assert [float(width) for width in widths.groups()] == pytest.approx([5.0, 2.5], abs=0.5)


def test_of_many_runs_the_widest_stands_out_and_too_many_sensors_are_not_drawn():
    reading, displacement_um = loop(1.0, 60)
    readings = np.repeat(reading[:, None], MOST_SENSORS + 2, axis=1)
    runs = [LoopShown(f"day {k}", readings, displacement_um + (k == 3) * (np.arange(60) > 30)) for k in range(9)]
    drawn = displacement_loops([f"T{j}" for j in range(MOST_SENSORS + 2)], "Z", runs)
    assert len(drawn.data) == 9 * MOST_SENSORS
    assert {line.line.color for line in drawn.data} == {style.MEASURED, style.BEFORE}
    assert [line.name for line in drawn.data if line.showlegend] == ["other runs", "run with the widest loop"]
    assert "(day 3)" in drawn.layout.title.text


def test_a_point_of_a_curve_carries_its_set():
    everywhere = [SetError(("<T1>",), 3.0), SetError(("<T1>", "T4"), 1.0)]
    drawn = changed(
        set_errors_picture(300), set_error_changes("Z", everywhere, everywhere[:1], everywhere[1], 9.0, target_um=2.0)
    )
    assert [list(sensors) for sensors in drawn.data[1].customdata] == [["<T1>"], ["<T1>", "T4"]]
    assert drawn.data[1].text[1] == "&lt;T1&gt; and T4"
    assert (drawn.data[3].x[0], drawn.data[3].y[0]) == (2, 1.0)
    assert drawn.layout.yaxis.title.text == "error of Z, rms [µm]"
    assert drawn.data[4].y == (2.0, 2.0)
    low, high = drawn.layout.yaxis.range
    assert low < np.log10(1.0) < np.log10(9.0) < high
    assert number_text(9.0) == "9.00"
