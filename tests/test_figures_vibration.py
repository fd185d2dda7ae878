"""Figures of vibration show what the results hold, with units, and no name is markup."""

from __future__ import annotations

import json
import re

import numpy as np
import plotly.graph_objects as go
import pytest

from selector.figures.simulated.vibration import (
    MOST_SOURCES,
    ZONES,
    Answer,
    errors_over_wavelength,
    motion_course,
    response_over_frequency,
    source_colours,
)
from selector.physics.vibration.chains import Chain
from selector.physics.vibration.final_motion import final_motions
from selector.physics.vibration.periodic_error import Cutting, Surface, periodic_errors
from selector.physics.vibration.structure import GROUND, Joint, Line, Member, Source, Structure, excitation
from selector.physics.vibration.vibration_model import RELATIVE
from selector.physics.vibration.vibration_summary import LineSummary
from tests.report.studies import HOSTILE
from tests.test_figures_thermal import FLOAT32, drawn_values, strings_of

BAD = HOSTILE[0]
STRUCTURE = Structure(
    (Member("bed", 900.0), Member(BAD, 200.0), Member("slide", 90.0), Member("tool", 20.0), Member("workpiece", 40.0)),
    (
        Joint(("bed", GROUND), 4e8, 0.5),
        Joint((BAD, "bed"), 1e9, 0.4),
        Joint(("slide", "bed"), 3e7, 0.6),
        Joint(("tool", "slide"), 2e8, 0.3),
        Joint(("workpiece", BAD), 3e8, 0.3),
    ),
)
SOURCES = (
    Source("IK1", "workpiece", (Line(frequency_hz=160.0, force_n=5.0), Line(frequency_hz=900.0, force_n=2.0)), "tool"),
    Source(BAD, BAD, (Line(frequency_hz=25.0, force_n=9.0), Line(frequency_hz=3.0, force_n=9.0))),
)
CHAINS = (
    Chain("high 1", "high", ("IK1",), (("workpiece",), (BAD,), ("bed",)), "workpiece"),
    Chain(BAD, "high", ("IK1",), (("tool",),), "tool", held="slide"),
    Chain("low", "low", (BAD,), ((BAD, "bed"),), "tool", branch=(("slide",), ("tool",))),
)
FINALS = {"tool": "tool", "workpiece": "workpiece"}
COLOURS = source_colours([source.name for source in SOURCES])
FREQUENCY_HZ = np.geomspace(2.0, 2000.0, 400)
CUTTING = Cutting(40.0, 600.0, 0.2, 243.0, 0.9, 0.6, -0.3)
EXCITATION = excitation(SOURCES, {})
MOTIONS = final_motions(STRUCTURE, SOURCES, EXCITATION, FINALS)


def answers() -> dict[str, list[Answer]]:
    amplitude = 1.0 / np.abs(1.0 - (FREQUENCY_HZ / 100.0) ** 2 + 0.1j)
    half = np.where(FREQUENCY_HZ > 60.0, 0.9 * amplitude, np.nan)
    return {
        "tool": [
            Answer("IK1", amplitude, half, np.array([160.0, 900.0, 5000.0])),
            Answer(BAD, 2 * amplitude, None, np.zeros(0)),
        ],
        BAD: [Answer("IK1", amplitude, None, np.array([160.0]))],
    }


def lines(count: int = 3) -> list[LineSummary]:
    return [
        LineSummary(
            100.0 + k, ("IK1", BAD)[k % 2], None, None, 1.0,
            {"tool": 1.0 + k, "workpiece": 0.5, RELATIVE: 0.5 + k},
            {"tool": 1.0 + k, "workpiece": 0.5, RELATIVE: 0.5 + k},
            {"tool": None if k else 0.9, "workpiece": None, RELATIVE: None if k else 0.9},
        )
        for k in range(count)
    ]  # fmt: skip


def errors() -> go.Figure:
    return errors_over_wavelength(periodic_errors(MOTIONS, CUTTING), CUTTING, Surface(), COLOURS, "x")


def with_axes() -> list[go.Figure]:
    time_s = np.linspace(0.0, 0.2, 4000)
    course = np.sin(300.0 * time_s)
    return [
        response_over_frequency(FREQUENCY_HZ, answers(), COLOURS, "x", 60.0),
        errors(),
        motion_course(
            time_s,
            {"tool": course, BAD: 2 * course, RELATIVE: -course},
            {BAD: course},
            {BAD: 600.0 + time_s},
            COLOURS,
            "x",
        ),
    ]


def test_every_axis_of_numbers_has_a_unit():
    units = r"\[(µm|µm/N|Hz|mm|N|r/min|%|s)\]"
    for drawn in with_axes():
        layout = drawn.to_plotly_json()["layout"]
        titles = [layout[key].get("title", {}).get("text") for key in layout if re.fullmatch(r"[xy]axis\d*", key)]
        assert [title for title in titles if title]
        assert not [title for title in titles if title and not re.search(units, title)]


def test_names_are_never_markup():
    own = re.compile(r"</?(?:b|br|extra)>")
    texts = [own.sub("", text) for drawn in with_axes() for text in strings_of(json.loads(drawn.to_json()))]
    assert any("&lt;" in text for text in texts)
    assert not [text for text in texts if "<" in text]


def test_lines_stand_on_the_answer_and_the_split_is_marked():
    drawn = response_over_frequency(FREQUENCY_HZ, answers(), COLOURS, "x", 60.0)
    content = json.loads(drawn.to_json())["data"]
    marks = next(trace for trace in content if trace.get("mode") == "markers")
    at = drawn_values(marks["x"])
    # 5000 Hz is off the picture
    assert at.tolist() == pytest.approx([160.0, 900.0], rel=FLOAT32)
    expected = 1.0 / np.abs(1.0 - (at / 100.0) ** 2 + 0.1j)
    # interpolated between frequencies 1.7 % apart, second order: below 0.1 %
    np.testing.assert_allclose(drawn_values(marks["y"]), expected, rtol=1e-3)
    assert [shape.x0 for shape in drawn.layout.shapes] == [60.0, 60.0]


def test_every_source_stands_once_in_the_legend():
    only_below = {"tool": answers()["tool"][:1], "workpiece": answers()["tool"]}
    drawn = response_over_frequency(FREQUENCY_HZ, only_below, COLOURS, "x", None)
    named = [trace.name for trace in drawn.data if trace.showlegend]
    assert len(named) == len(set(named)) == 2


def test_only_sources_with_a_colour_of_their_own_are_coloured():
    colours = source_colours([f"s{k}" for k in range(MOST_SOURCES + 2)])
    assert len(set(colours.values())) == MOST_SOURCES + 1
    assert colours[f"s{MOST_SOURCES}"] == colours[f"s{MOST_SOURCES + 1}"]
    time_s = np.linspace(0.0, 1.0, 50)
    drawn = motion_course(time_s, {RELATIVE: time_s}, dict.fromkeys(colours, time_s), {}, colours, "x")
    assert len(drawn.data) == 1 + MOST_SOURCES


def test_errors_lie_in_the_zone_of_their_kind():
    found = periodic_errors(MOTIONS, CUTTING)
    drawn = errors()
    kind_of = {colour: kind for kind, colour in ZONES.items()}
    zones = {
        (kind_of[shape.fillcolor], shape.xref): (shape.x0, shape.x1) for shape in drawn.layout.shapes if shape.fillcolor
    }
    assert {one.direction for one in found} == {"cut", "feed"}
    for one in found:
        low, high = zones[one.kind, "x" if one.direction == "cut" else "x2"]
        assert low <= one.wavelength_mm <= high
    drawn_mm = sorted({x for trace in drawn.data if trace.mode == "markers" for x in trace.x if x is not None})
    assert drawn_mm == sorted(one.wavelength_mm for one in found)


def test_speeds_that_do_not_change_are_not_drawn():
    time_s = np.linspace(0.0, 1.0, 500)
    still = {"spindle": np.full(500, 600.0)}
    titles = []
    for speeds in (still, {"spindle": 600.0 + time_s}):
        layout = motion_course(time_s, {RELATIVE: time_s}, {}, speeds, {}, "x").to_plotly_json()["layout"]
        titles.append([layout[key]["title"]["text"] for key in layout if key.startswith("yaxis")])
    assert titles == [["tool – workpiece [µm]"], ["speed [r/min]", "tool – workpiece [µm]"]]
