"""Figures of a diagnosis show what it holds, with a unit on every axis, and no name is markup."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import numpy as np
import plotly.graph_objects as go
import pytest

from selector.figures import style
from selector.figures.diagnosis import RunAxis, before_after, mismatch_map
from selector.recording import Channel
from tests.diagnosis.answers import END_S, N, answer
from tests.report.studies import HOSTILE
from tests.test_figures_thermal import drawn_values, strings_of

FOUND = answer()
LENGTH_S = END_S


def every_figure() -> list[go.Figure]:
    found = answer(names=HOSTILE)
    return [mismatch_map(found), *(before_after(found, name) for name in HOSTILE)]


def test_names_are_never_markup():
    own = re.compile(r"</?(?:b|br|extra)>")
    texts = [own.sub("", text) for drawn in every_figure() for text in strings_of(json.loads(drawn.to_json()))]
    assert any("&lt;" in text for text in texts)
    assert not [text for text in texts if "<" in text]


def test_axes_of_numbers_have_a_unit():
    for drawn in every_figure():
        layout = drawn.to_plotly_json()["layout"]
        titles = [layout[key].get("title", {}).get("text") for key in layout if re.fullmatch(r"[xy]axis\d*", key)]
        assert not [title for title in titles if title and "[" not in title]


def test_the_map_frames_the_windows_of_the_answer_in_the_row_of_their_channel():
    drawn = mismatch_map(FOUND)
    frames = [shape for shape in drawn.layout.shapes if shape.type == "rect"]
    axis = RunAxis(FOUND.comparison)
    _, seconds = style.time_unit(axis.end_s)
    expected = sorted(axis.place_s(place.run, place.from_s) / seconds for place in FOUND.where)
    assert sorted(frame.x0 for frame in frames) == pytest.approx(expected)
    row = list(FOUND.fit).index("Z")
    assert all(frame.y0 < row < frame.y1 for frame in frames)


def test_the_map_shows_where_more_was_recorded():
    cells = next(trace for trace in mismatch_map(FOUND).data if trace.yaxis == "y")
    axis = RunAxis(FOUND.comparison)
    _, seconds = style.time_unit(axis.end_s)
    x, z = np.asarray(cells.x), np.asarray(cells.z, dtype=float)[0]
    inside = (x > axis.place_s("r1", 3000.0) / seconds) & (x < axis.place_s("r1", 6000.0) / seconds)
    # there the effect is 5 µm in noise of 1 µm
    assert np.nanmin(z[inside]) > 0.0


def test_runs_stand_one_after_the_other_without_overlap():
    axis = RunAxis(FOUND.comparison)
    for one, following in zip(axis.starts_s[:-1], axis.starts_s[1:], strict=True):
        assert following > one + LENGTH_S
    assert axis.end_s == pytest.approx(axis.starts_s[-1] + LENGTH_S)
    assert axis.held_out_s() == [pytest.approx((axis.starts_s[2], axis.end_s))]


def test_before_and_after_show_every_course_and_shade_what_was_held_out():
    drawn = before_after(FOUND, "Z")
    names = {trace.name for trace in drawn.data}
    assert {"recorded", "simulated", "with it", "before", "after", "memory of past heating"} <= names
    shades = [shape for shape in drawn.layout.shapes if shape.type == "rect"]
    assert len(shades) == 3  # one in each panel
    after = np.concatenate(
        [drawn_values(t["y"]) for t in json.loads(drawn.to_json())["data"] if t["yaxis"] == "y2"][3:]
    )
    assert np.sqrt(np.mean(after**2)) < 2.0  # noise of 1 µm; before it was 3.5 µm
    assert len(after) == 3 * N


def test_the_map_draws_what_an_effect_was_made_of_and_says_how_large_its_unit_is():
    of = FOUND.comparison
    sensors = [f"S{k}" for k in range(9)]
    channels = (*of.channels, *(Channel(name, "temperature", "degC") for name in sensors))
    drift = np.linspace(20.0, 25.0, 3 * N)
    of = replace(of, channels=channels, recorded={**of.recorded, **dict.fromkeys(sensors, drift)})
    found = replace(FOUND, comparison=of)
    assert "S8" not in mismatch_map(found).layout.yaxis2.ticktext
    named = replace(found, effects=(replace(FOUND.effects[0], sources=("S8",)),))
    assert "S8" in mismatch_map(named).layout.yaxis2.ticktext
    assert all(text.endswith("µm rms") for text in mismatch_map(named).layout.yaxis.ticktext)


@pytest.mark.parametrize("verdict", ["nothing-missing", "unexplained", "miscalibrated", "data-fault"])
def test_every_verdict_can_be_drawn(verdict):
    found = answer(verdict)
    assert mismatch_map(found).data
    assert before_after(found, "Y").data


def test_holes_in_the_recording_are_holes_in_the_picture():
    of = FOUND.comparison
    holed = dict(of.recorded)
    holed["Z"] = np.where((np.arange(3 * N) > 320) & (np.arange(3 * N) < 420), np.nan, holed["Z"])
    holed["Y"] = np.where(np.arange(3 * N) < N, np.nan, holed["Y"])
    found = replace(FOUND, comparison=replace(of, recorded=holed))
    assert np.isnan(np.asarray(mismatch_map(found).data[0].z, dtype=float)).any()
    assert before_after(found, "Y").data
