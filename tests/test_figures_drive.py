"""Figures of feed axes show what the results hold, with units, peaks kept, and no name is markup."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import numpy as np
import plotly.graph_objects as go
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from selector.figures.simulated.drive import axis_course, frequency_response, stiffness_and_damping, stretches
from selector.physics.drive.drive_summary import ROTARY
from selector.physics.drive.trajectory import Motion
from tests.report.studies import HOSTILE
from tests.test_figures_thermal import FLOAT32, drawn_values, strings_of

TIME_S = np.linspace(0.0, 1.0, 20_001)
FREQUENCY_HZ = np.geomspace(1.0, 1000.0, 300)


def moved() -> Motion:
    """An axis with a lag, a spike of one sample, and friction that changes with its direction."""
    reference = 0.1 * np.sin(2.0 * np.pi * TIME_S)
    speed = 0.2 * np.pi * np.cos(2.0 * np.pi * TIME_S)
    error = 1e-3 * speed
    error[12_345] = 5e-3
    nothing = np.zeros_like(TIME_S)
    return Motion(
        time_s=TIME_S,
        reference_m=reference,
        table_m=reference - error,
        table_speed_m_per_s=speed,
        motor=nothing,
        motor_speed=nothing,
        measured_m=reference - error,
        command=np.clip(speed * 40.0, -20.0, 20.0),
        actuator_force=nothing,
        axial_force_n=nothing,
        friction_n=200.0 * np.sign(speed),
    )


def response(corner_hz: float) -> tuple[np.ndarray, np.ndarray]:
    loop = 1.0 / (1.0 + 1j * FREQUENCY_HZ / corner_hz)
    return np.abs(loop), np.degrees(np.angle(loop))


def bode() -> go.Figure:
    both = {name: response(corner) for name, corner in ((HOSTILE[0], 10.0), ("at 0.5 s", 12.0))}
    return frequency_response(
        FREQUENCY_HZ, {name: one[0] for name, one in both.items()}, {name: one[1] for name, one in both.items()}, "x"
    )


def every_figure() -> list[go.Figure]:
    motion = moved()
    return [
        axis_course(motion, HOSTILE[0], "A", limited=np.abs(motion.command) >= 20.0),
        axis_course(motion, "B", "A", measures=ROTARY),
        stiffness_and_damping(TIME_S, 1e8 + 1e7 * TIME_S, 100.0 + TIME_S, (0.1, 0.5)),
        bode(),
    ]


def test_every_axis_has_a_unit():
    units = r"\[(mm|µm|m/min|A|N|N/µm|kN·s/m|Hz|dB|°|µrad|r/min|N·m|s)\]"
    for drawn in every_figure():
        layout = drawn.to_plotly_json()["layout"]
        assert drawn.layout.title.text
        titles = [layout[key].get("title", {}).get("text") for key in layout if re.fullmatch(r"[xy]axis\d*", key)]
        assert [title for title in titles if title]
        assert not [title for title in titles if title and not re.search(units, title)]


def test_names_are_never_markup():
    own = re.compile(r"</?(?:b|br|extra)>")
    texts = [own.sub("", text) for drawn in every_figure() for text in strings_of(json.loads(drawn.to_json()))]
    assert any("&lt;" in text for text in texts)
    assert not [text for text in texts if "<" in text]


def test_the_largest_error_survives_thinning_and_stands_in_the_title():
    drawn = axis_course(moved(), "X", "A")
    (error,) = (trace for trace in json.loads(drawn.to_json())["data"] if trace["yaxis"] == "y3")
    values = drawn_values(error["y"])
    assert len(values) < 1000
    assert float(values.max()) == pytest.approx(5000.0, rel=FLOAT32)
    assert "5000 µm (after 0.617 s)" in drawn.layout.title.text


def test_limits_are_shaded_where_they_were_reached():
    motion = moved()
    limited = np.abs(motion.command) >= 20.0
    found = stretches(TIME_S, limited)
    # |cos| above 20/(40·0.2π): at the start, in the middle and at the end
    edge = np.arccos(20.0 / (40.0 * 0.2 * np.pi)) / (2.0 * np.pi)
    expected = [(0.0, edge), (0.5 - edge, 0.5 + edge), (1.0 - edge, 1.0)]
    np.testing.assert_allclose(found, expected, atol=1.01 * TIME_S[1])  # a sample at each end
    shaded = [s for s in axis_course(motion, "X", "A", limited=limited).layout.shapes if s.type == "rect"]
    assert [(s.x0, s.x1) for s in shaded[:3]] == found
    assert stretches(TIME_S, np.zeros(len(TIME_S), dtype=bool)) == []


def test_limits_that_are_touched_all_the_time_are_few_shapes():
    assert len(stretches(TIME_S, np.arange(len(TIME_S)) % 2 == 0)) == 1


def test_amplitudes_are_decibels():
    drawn = bode()
    amplitude = drawn_values(json.loads(drawn.to_json())["data"][0]["y"])
    k = int(np.argmin(np.abs(FREQUENCY_HZ - 10.0)))
    # at its corner a lag of first order is 3.01 dB down; the grid hits the corner within 1.2 %, 0.05 dB
    assert amplitude[k] == pytest.approx(-3.01, abs=0.06)
    assert {trace.yaxis for trace in drawn.data} == {"y", "y2"}


def test_a_short_limit_is_shaded_so_that_it_is_seen():
    limited = np.zeros(len(TIME_S), dtype=bool)
    limited[100:105] = True
    (short,) = {s.opacity for s in axis_course(moved(), "X", "A", limited=limited).layout.shapes if s.type == "rect"}
    limited[100 : len(TIME_S) // 2] = True
    (wide,) = {s.opacity for s in axis_course(moved(), "X", "A", limited=limited).layout.shapes if s.type == "rect"}
    assert short > 3 * wide


@settings(max_examples=20)
@given(st.floats(1e-3, 1e3), st.floats(-1.0, 1.0))
def test_small_panels_have_two_ticks_at_least(size, middle):
    motion = replace(moved(), command=size * (middle + np.sin(TIME_S)))
    axis = axis_course(motion, "X", "A").layout.yaxis4
    span = axis.range[1] - axis.range[0]
    # plotly takes the smallest step of 1, 2, 5 · 10ⁿ that makes no more ticks than it may
    steps = [factor * 10.0**power for power in range(-6, 5) for factor in (1.0, 2.0, 5.0)]
    step = min(one for one in steps if span / one <= axis.nticks)
    assert np.floor(axis.range[1] / step) - np.ceil(axis.range[0] / step) >= 1
