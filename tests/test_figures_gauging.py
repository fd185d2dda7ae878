"""Figures of gauging show what the results hold, with units on every axis, and no name is markup."""

from __future__ import annotations

import json
import re

import numpy as np
import plotly.graph_objects as go
import pytest

from selector.figures.simulated.gauging import (
    MOST_MARKERS,
    filter_trade_off,
    gauge_characteristic,
    part_in_time,
    size_histogram,
    sizes_over_parts,
)
from selector.number_text import number_text
from selector.physics.gauging.gauging_summary import Setting
from selector.physics.gauging.transducer import LinearGauge
from tests.report.studies import HOSTILE
from tests.test_figures_thermal import FLOAT32, drawn_values, strings_of

GAUGE = LinearGauge(gain_v_per_um=-0.01, bias_v=2.0, time_constant_s=0.05, allowance_um=0.0)
ALLOWANCE_UM = np.linspace(-50.0, 150.0, 81)
BEND_V_PER_UM2 = 1e-5
VOLTAGE_V = 2.0 - 0.01 * ALLOWANCE_UM - BEND_V_PER_UM2 * ALLOWANCE_UM**2
THRESHOLDS = ((20.0, 1.75), (0.0, 1.99))
TIME_S = np.linspace(0.0, 20.0, 20_001)
FEED_UM_PER_S = np.where(TIME_S < 15.0, 10.0, 2.0)
LEFT_UM = 161.0 - np.cumsum(FEED_UM_PER_S) * 1e-3
SIZES_UM = np.random.default_rng(3).normal(0.4, 0.8, 4000)
TIMES_S = np.geomspace(1e-3, 1.0, 61)
BIAS_UM = 4.0 * TIMES_S
SD_UM = 1.0 / np.sqrt(1.0 + 100.0 * TIMES_S)


def characteristic() -> go.Figure:
    return gauge_characteristic(ALLOWANCE_UM, VOLTAGE_V, GAUGE, (-30.0, 30.0), THRESHOLDS)


def part() -> go.Figure:
    return part_in_time(
        TIME_S, LEFT_UM, LEFT_UM + 0.5, 2.0 - 0.01 * LEFT_UM, FEED_UM_PER_S, THRESHOLDS, (15.0,), name=HOSTILE[0]
    )


def histogram() -> go.Figure:
    at = np.linspace(-3.0, 4.0, 141)
    density = np.exp(-0.5 * ((at - 0.4) / 0.8) ** 2) / (0.8 * np.sqrt(2.0 * np.pi))
    return size_histogram(SIZES_UM, (at, density), (-3.0, 3.5), 0.0, "Simulated")


def setting(time_constant_s: float, bias_um: float, sd_um: float) -> Setting:
    return Setting("best-filter", time_constant_s, (1.0,), 200, bias_um, 0.0, sd_um)


def compared(bias_um, sd_um, present: tuple[float, float]) -> go.Figure:
    """Filters with their errors, and the present one: time constant [s], error [µm]."""
    filters = [setting(*one) for one in zip(TIMES_S.tolist(), bias_um.tolist(), sd_um.tolist(), strict=True)]
    best = min(filters, key=lambda one: one.rms_um)
    return filter_trade_off(filters, best, setting(present[0], 0.0, present[1]), "Simulated")


def trade_off() -> go.Figure:
    return compared(BIAS_UM, SD_UM, (0.4, 2.0))


def every_figure() -> list[go.Figure]:
    return [
        characteristic(),
        part(),
        histogram(),
        sizes_over_parts(SIZES_UM[:60], (-3.0, 3.5), 0.0, (21, 41), "x"),
        sizes_over_parts(SIZES_UM, None, 0.0, (), "x"),
        trade_off(),
    ]


def test_every_axis_has_a_unit():
    units = r"\[(µm|V|µm/s|N|s|ms|µm²|% per µm|number)\]"
    for drawn in every_figure():
        layout = drawn.to_plotly_json()["layout"]
        assert drawn.layout.title.text
        titles = [layout[key].get("title", {}).get("text") for key in layout if re.fullmatch(r"[xy]axis\d*", key)]
        assert len([title for title in titles if title]) >= 2
        assert not [title for title in titles if title and not re.search(units, title)]


def test_names_are_never_markup():
    own = re.compile(r"</?(?:b|br|extra)>")
    texts = [own.sub("", text) for drawn in every_figure() for text in strings_of(json.loads(drawn.to_json()))]
    assert any("&lt;" in text for text in texts)
    assert not [text for text in texts if "<" in text]


def test_the_error_of_the_line_is_counted_as_size():
    traces = {one["name"]: one for one in json.loads(characteristic().to_json())["data"]}
    # the curve is bent by b·x² volts; at K volts a micrometre that is b·x²/|K| of size, above the line
    expected = BEND_V_PER_UM2 * ALLOWANCE_UM**2 / 0.01
    np.testing.assert_allclose(drawn_values(traces["error of the line"]["y"]), expected, rtol=FLOAT32, atol=1e-6)


def test_thresholds_stand_on_the_curve():
    marks = [one for one in characteristic().data if one.mode == "markers"]
    assert [mark.y[0] for mark in marks] == [volts for _, volts in THRESHOLDS]
    for mark in marks:
        on_curve = np.interp(mark.x[0], ALLOWANCE_UM, VOLTAGE_V)
        # between points of the table both are straight lines, of volts and of micrometres: the same ones
        assert mark.y[0] == pytest.approx(on_curve, abs=1e-9)


def test_the_line_of_a_gauge_that_is_straight_is_never_off():
    straight = GAUGE.bias_v + GAUGE.gain_v_per_um * ALLOWANCE_UM
    drawn = gauge_characteristic(ALLOWANCE_UM, straight, GAUGE, (-50.0, 150.0))
    low, high = drawn.layout.yaxis2.range
    assert low < 0 < high


def test_a_part_shows_its_size_and_every_threshold():
    drawn = part()
    size = number_text(LEFT_UM[-1])
    title = drawn.layout.title.text.replace("<br>", " ")
    assert f"{size} µm after 20.0 s, {size} µm above" in title
    assert title.count(" 0 µm") == 1
    assert [bool(re.search("stage 1", note.text)) for note in drawn.layout.annotations].count(True) == 1


def test_the_histogram_counts_every_part():
    bars = histogram().data[0]
    share = np.asarray(bars.y, dtype=np.float64) * np.asarray(bars.width, dtype=np.float64)
    assert share.sum() == pytest.approx(100.0, rel=100 * FLOAT32)  # sums of some 50 numbers of that precision
    assert "4000 parts" in bars.name


@pytest.mark.parametrize("sizes", [np.full(50, 1.25), np.array([0.5]), np.repeat([0.0, 1.0], 20)])
def test_sizes_without_spread_have_a_histogram_too(sizes):
    bars = size_histogram(sizes, None, None, 0.0, "x").data[0]
    share = np.asarray(bars.y, dtype=np.float64) * np.asarray(bars.width, dtype=np.float64)
    assert share.sum() == pytest.approx(100.0, rel=100 * FLOAT32)


def test_tolerance_and_target_are_marked():
    drawn = histogram()
    at = sorted(shape.x0 for shape in drawn.layout.shapes)
    assert at == [-3.0, 0.0, 3.5]
    low, high = drawn.layout.xaxis.range
    assert low < min(-3.0, SIZES_UM.min())
    assert high > max(3.5, SIZES_UM.max())


def test_the_extreme_parts_survive_thinning():
    (line,) = json.loads(sizes_over_parts(SIZES_UM, None, 0.0, (), "x").to_json())["data"]
    values = drawn_values(line["y"])
    assert len(SIZES_UM) > MOST_MARKERS
    assert len(values) < 1000
    assert float(values.max()) == pytest.approx(SIZES_UM.max(), rel=FLOAT32)
    assert float(values.min()) == pytest.approx(SIZES_UM.min(), rel=FLOAT32)


def test_dressing_stands_before_its_part():
    drawn = sizes_over_parts(SIZES_UM[:60], None, 0.0, (21, 41), "x")
    upright = [shape.x0 for shape in drawn.layout.shapes if shape.x0 == shape.x1]
    assert upright == [20.5, 40.5]


def test_the_sum_is_that_of_its_parts_and_the_best_is_its_lowest_point():
    traces = {one.name.split(":")[0]: one for one in trade_off().data}
    parts = [np.asarray(traces[name].y, dtype=np.float64) for name in ("bias²", "variance", "mean square error")]
    np.testing.assert_allclose(parts[0] + parts[1], parts[2], rtol=2 * FLOAT32)
    assert traces["best"].y[0] == pytest.approx(parts[2].min(), rel=FLOAT32)
    assert traces["present"].y[0] == 4.0


def test_a_filter_without_bias_is_drawn_on_logarithmic_axes():
    drawn = compared(np.zeros_like(TIMES_S), SD_UM, (0.1, 0.0))
    assert "bias²" not in [one.name for one in drawn.data]
    assert np.isfinite(drawn.layout.yaxis.range).all()


def test_an_error_that_hardly_changes_has_ticks_that_can_be_read():
    drawn = compared(np.full(61, 0.9), np.full(61, 0.5), (0.2, 1.03))
    low, high = drawn.layout.yaxis.range
    inside = [text for text in drawn.layout.yaxis.ticktext if 10**low <= float(text) <= 10**high]
    assert len(inside) >= 2
    assert "0.5" in inside
