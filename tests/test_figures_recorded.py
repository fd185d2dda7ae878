"""The picture of a recorded run: all its channels, by role, and nothing that a name could draw."""

from __future__ import annotations

import numpy as np
import pandas as pd

from selector.figures.simulated.thermal import MOST_NAMED, courses
from selector.recording import Channel, Recording


def recording(names: list[str], role: str = "temperature", unit: str = "degC", n: int = 30) -> Recording:
    frame = pd.DataFrame({name: np.linspace(20.0, 21.0 + k, n) for k, name in enumerate(names)})
    frame["Z"] = np.linspace(0.0, 9.0, n)
    frame["empty"] = np.nan
    frame.index = pd.Index(np.arange(n, dtype=float), name="time_s")
    channels = [*(Channel(name, role, unit) for name in names), Channel("Z", "displacement", "um")]
    return Recording.from_runs({"r1": frame}, [*channels, Channel("empty", "force", "N")])


def test_every_channel_with_values_is_drawn_with_its_name():
    drawn = courses(recording(["T1", "T2"]), "r1")
    assert [line.name for line in drawn.data] == ["Z", "T1", "T2"]
    assert all(line.name in line.hovertemplate for line in drawn.data)
    assert {drawn.layout.yaxis.title.text, drawn.layout.yaxis2.title.text} == {"displacement [µm]", "temperature [°C]"}


def test_many_channels_are_named_by_hovering_only():
    names = [f"T{k}" for k in range(MOST_NAMED + 1)]
    drawn = courses(recording(names), "r1")
    assert [line.name for line in drawn.data] == ["Z", *names]
    assert "T3" not in [annotation.text for annotation in drawn.layout.annotations]
    assert drawn.data[4].hovertemplate.endswith("<extra>T3</extra>")


def test_names_are_no_markup():
    drawn = courses(recording(["<b>T</b>"]), "r1")
    assert drawn.data[1].name == "&lt;b&gt;T&lt;/b&gt;"
    assert "<b>T" not in drawn.to_json().replace("\\u003c", "<")


def test_long_names_have_room_at_the_ends_of_the_lines():
    short, long = (courses(recording([name]), "r1").layout.margin.r for name in ("T1", "Gehäuse oben links & rechts"))
    assert short == 150
    assert long >= 24 * 7
