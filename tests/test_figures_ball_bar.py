"""Polar plots of circular tests: traces as they are, scale, units, spikes that thinning keeps, no name as markup."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

from selector.figures import style
from selector.figures.simulated.drive import POINTS, ball_bar_figure
from selector.physics.drive.ball_bar.circle import BallBarTrace, centred_traces
from tests.test_figures_thermal import drawn_values

FLOAT32 = 1e-6
"""Drawn values are float32: 2**-24 of the value."""


def pair(feed=1000.0, samples=9000, size=8.0, axes=("X", "Y"), centre=0.0):
    angle = np.arange(samples) * 2 * np.pi / samples
    made = []
    for direction in (1, -1):
        deviation = size * np.cos(2 * direction * angle) + centre * np.cos(angle)
        deviation[1234] = 1.2 * size  # one sample of a spike
        made.append(BallBarTrace(direction * angle, deviation, direction, feed, 0.1, axes))
    return made


def lines(drawn, name):
    return [trace for trace in drawn.data if trace.name.startswith(name)]


def test_both_directions_are_drawn_with_their_spikes():
    traces = pair()
    drawn = ball_bar_figure(traces)
    for trace, name in zip(centred_traces(traces), ("counter-clockwise", "clockwise"), strict=True):
        (line,) = lines(drawn, name)
        r, theta = drawn_values(line.r), drawn_values(line.theta)
        assert len(r) <= POINTS + 2
        assert r.max() == pytest.approx(trace.deviation_um.max(), rel=FLOAT32)
        assert r.min() == pytest.approx(trace.deviation_um.min(), rel=FLOAT32)
        # every point is a sample at its angle
        at = np.rint(theta / 360 * len(trace.angle_rad) * trace.direction).astype(int) % len(trace.angle_rad)
        np.testing.assert_allclose(r, trace.deviation_um[at], rtol=1e-5, atol=1e-5)
        assert (r[0], theta[0]) == (r[-1], theta[-1])


def test_the_scale_is_the_one_that_the_title_states():
    drawn = ball_bar_figure(pair())
    low, high = drawn.layout.polar.radialaxis.range
    # the nominal circle, 100 mm, is drawn where the axis has gone from `low` to 0
    stated = float(re.search(r"drawn (\d+) times", style.title_text(drawn))[1])
    assert stated == pytest.approx(1e5 / -low, rel=0.005)  # three digits
    assert low < -9.6 * 0.5
    assert high >= 9.6
    ticks = drawn.layout.polar.radialaxis
    for value, text in zip(ticks.tickvals, ticks.ticktext, strict=True):
        assert text == "0" if value == 0 else re.fullmatch(r"[+−][\d.]+ µm", text)
        if value:
            assert float(text.replace("−", "-").split()[0]) == pytest.approx(value)


def test_the_set_up_is_taken_out():
    traces = pair(centre=30.0)
    centred = drawn_values(lines(ball_bar_figure(traces), "counter")[0].r)
    assert traces[0].deviation_um.max() > 35
    assert centred.max() == pytest.approx(centred_traces(traces)[0].deviation_um.max(), rel=FLOAT32)
    assert centred.max() < 10


def test_reversals_are_marked_where_axes_reverse():
    (marks,) = lines(ball_bar_figure(pair()), "an axis reverses")
    np.testing.assert_allclose(marks.theta, [0, 90, 180, 270])
    # with a rotary axis the linear ones reverse elsewhere
    assert not lines(ball_bar_figure(pair(axes=("X", "Y", "B"))), "an axis reverses")


def test_names_are_never_markup():
    drawn = ball_bar_figure(pair(axes=("<i>X</i>", "Y&")))
    text = json.dumps(json.loads(drawn.to_json())["layout"]["polar"], ensure_ascii=False)
    assert "<i>" not in text
    assert "&lt;i&gt;X" in text


def test_equal_traces_give_equal_figures():
    assert ball_bar_figure(pair()).to_json() == ball_bar_figure(pair()).to_json()


def test_a_perfect_circle_can_be_drawn():
    angle = np.linspace(0, 2 * np.pi, 400, endpoint=False)
    drawn = ball_bar_figure([BallBarTrace(d * angle, 0 * angle, d, 1000.0) for d in (1, -1)])
    assert drawn.layout.polar.radialaxis.range[1] > 0
