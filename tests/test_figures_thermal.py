"""Figures of predictions, simulations and fields show what the results hold, with units, and no name is markup."""

from __future__ import annotations

import base64
import json
import re

import numpy as np
import pandas as pd
import plotly.graph_objects as go
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from selector.figures.duty_cycle import duty_cycle, prediction_of_tests
from selector.figures.panels import shown_samples
from selector.figures.simulated.thermal import inputs_and_displacements, machine_field, temperatures
from selector.physics.thermal.drift_quantities import largest_displacement
from selector.recording import Channel, Recording
from tests.report import predictions
from tests.report.predictions import CUBE, CUBE_M
from tests.report.studies import HOSTILE

FLOAT32 = 1e-6
"""Drawn values are float32: 2**-24 of the value."""

# fmt: on


def drawn_values(values) -> np.ndarray:
    """The numbers of an array in a figure's JSON."""
    if isinstance(values, dict):
        return np.frombuffer(base64.b64decode(values["bdata"]), dtype=np.dtype(values["dtype"]))
    return np.asarray(values)


def every_figure() -> list[go.Figure]:
    prediction, page = predictions.prediction(), predictions.simulation()
    run = page.recording.runs[0]
    return [
        *(duty_cycle(prediction, name) for name in HOSTILE),
        duty_cycle(predictions.prediction(tolerance_um=None), HOSTILE[0]),
        prediction_of_tests(prediction, HOSTILE[0], prediction.repeats),
        inputs_and_displacements(page.recording, run, page.simulated.inputs),
        temperatures(page.recording, run, page.simulated.inputs),
        cube(),
    ]


def cube(**more) -> go.Figure:
    deformation = np.zeros((8, 3))
    deformation[7] = [30.0, 0.0, 40.0]
    return machine_field(
        CUBE_M, CUBE, 20.0 + np.arange(8.0), deformation, "<b>now</b>", {"<i>T</i>": (0.5, 0.5, 0.9)}, **more
    )


def test_every_axis_has_a_unit_and_every_title_a_number():
    for drawn in every_figure():
        layout = drawn.to_plotly_json()["layout"]
        assert drawn.layout.title.text
        titles = [layout[key].get("title", {}).get("text") for key in layout if re.fullmatch(r"[xy]axis\d*", key)]
        titles += [layout["scene"][key]["title"]["text"] for key in ("xaxis", "yaxis", "zaxis") if "scene" in layout]
        shown = [title for title in titles if title]
        assert shown
        for title in shown:
            assert re.search(r"\[(µm|°C|r/min|s|min|h|m|0, 1|N·m|[kMG]?J)\]", title), title


def test_names_are_never_markup():
    own = re.compile(r"</?(?:b|br|extra)>")
    texts = [own.sub("", text) for drawn in every_figure() for text in strings_of(json.loads(drawn.to_json()))]
    assert any("&lt;script&gt;alert(1)" in text for text in texts)
    assert not [text for text in texts if "<" in text]


def strings_of(value) -> list[str]:
    if isinstance(value, str):
        return [value]
    items = value.values() if isinstance(value, dict) else value if isinstance(value, list) else []
    return [text for item in items for text in strings_of(item)]


def test_equal_results_give_equal_figures():
    first = [drawn.to_json() for drawn in every_figure()]
    predictions.prediction.cache_clear()
    predictions.simulation.cache_clear()
    assert first == [drawn.to_json() for drawn in every_figure()]


def test_the_drift_that_is_drawn_stays_in_the_band_and_the_steps_are_those_of_the_program():
    prediction = predictions.prediction()
    program = prediction.programs[HOSTILE[0]]
    drawn = duty_cycle(prediction, HOSTILE[0])
    traces = json.loads(drawn.to_json())["data"]
    drift = drawn_values(traces[-1]["y"])
    assert np.abs(drift).max() <= program.tolerance_um * (1 + FLOAT32)
    assert np.abs(drift).max() > 0.99 * program.tolerance_um  # a correction comes when the tolerance is reached
    steps = next(trace for trace in traces if trace["name"] == "zero and corrections")
    assert steps["line"]["shape"] == "hv"
    times = np.concatenate([operation.times_s for operation in program.operations]) / 3600
    np.testing.assert_allclose(drawn_values(steps["x"])[:-1], times, rtol=FLOAT32)
    course = next(trace for trace in traces if trace["name"] == "predicted")
    k = int(np.argmax(np.abs(prediction.displacement_um[:, 0])))
    largest = float(prediction.displacement_um[k, 0])
    assert float(drawn_values(course["y"]).max()) == pytest.approx(largest, rel=FLOAT32)
    assert f" {largest:.3g} µm" in drawn.layout.title.text
    assert sum(len(operation.times_s) - 1 for operation in program.operations) > 2


def test_the_worst_test_is_named():
    prediction = predictions.prediction()
    worst = max(prediction.repeats, key=lambda one: one.rmse_um[0])
    title = prediction_of_tests(prediction, HOSTILE[0], prediction.repeats).layout.title.text
    assert worst.run.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;") in title


def test_the_largest_displacement_counts_from_the_start():
    page = predictions.simulation()
    name, at_s, um = largest_displacement(page.recording, page.recording.runs[0])
    course = page.recording.values(page.recording.runs[0], [name])[:, 0]
    k = int(np.flatnonzero(page.recording.time_s(page.recording.runs[0]) == at_s)[0])
    assert um == course[k] - course[0]
    for other in ("Z", "Y"):
        rest = page.recording.values(page.recording.runs[0], [other])[:, 0]
        assert np.abs(rest - rest[0]).max() <= abs(um)


def test_the_deformation_is_scaled_by_what_is_said():
    drawn = cube()
    data = json.loads(drawn.to_json())["data"]
    texts = [note.text for note in drawn.layout.annotations]
    scale = float(
        next(re.search(r"drawn ([\d ]+) times", text) for text in texts if "drawn" in text)[1].replace(" ", "")
    )
    moved = np.stack([drawn_values(data[1][axis]) for axis in "xyz"], axis=1)
    np.testing.assert_allclose(moved[7] - CUBE_M[7], np.array([30e-6, 0.0, 40e-6]) * scale, rtol=1e-4)  # float32 of 1 m
    # a tenth of the machine at most, and not invisible
    assert 0.02 < 50e-6 * scale < 0.1
    assert drawn_values(data[0]["intensity"]).tolist() == (20.0 + np.arange(8.0)).tolist()


def test_a_thermometer_stands_outside_beside_the_nearest_face():
    inner_m = 0.3 + 0.4 * CUBE_M
    nodes, triangles = np.vstack([CUBE_M, inner_m]), np.vstack([CUBE, CUBE[:, ::-1] + 8])
    still = machine_field(
        nodes, triangles, np.full(16, 20.0), np.zeros((16, 3)), "x",
        {"wall": (0.5, 0.5, 0.88), "chamber side": (0.5, 0.5, 0.72), "far": (5.0, 0.0, 0.0)},
    )  # fmt: skip
    marks = json.loads(still.to_json())["data"][-1]
    x, _, z = (drawn_values(marks[axis]) for axis in "xyz")
    assert z[0] > 1.0
    assert (x[2], z[2]) == (5.0, 0.0)
    # no outer face is within the reach of the second one but the chamber's: it stays there
    assert 0.5 < z[1] < 1.1


def test_a_field_that_does_not_move_can_be_drawn():
    drawn = machine_field(CUBE_M, CUBE, np.full(8, 20.0), np.zeros((8, 3)), "cold")
    assert len(drawn.data) == 2


@given(
    values=arrays.arrays(np.float64, st.integers(2, 4000), elements=st.floats(-1e6, 1e6)), points=st.integers(30, 300)
)
def test_thinning_keeps_ends_and_extremes(values, points):
    time_s = np.arange(float(len(values)))
    kept = shown_samples(time_s, values, points=points)
    assert (kept[0], kept[-1]) == (0, len(values) - 1)
    assert (np.diff(kept) > 0).all()
    assert (values[kept].min(), values[kept].max()) == (values.min(), values.max())
    assert len(kept) <= points + 3


def test_thinning_keeps_every_step():
    values = np.repeat([0.0, 1000.0, 2000.0, 0.0], [3000, 1, 2999, 10])
    kept = shown_samples(np.arange(6010.0), values, steps=True)
    assert {0, 3000, 3001, 6000, 6009} == set(kept.tolist())


def test_thermometers_stand_with_their_part_and_the_lonely_ones_together():
    names = [*(f"h{k}" for k in range(14)), "c1", "c2", "bed", "motor", "nowhere"]
    places = ["headstock, front"] * 14 + ["column", "column, back", "bed", "motor, flange", None]
    channels = [Channel(name, "temperature", "degC", place) for name, place in zip(names, places, strict=True)]
    rises = np.arange(len(names), dtype=np.float64)
    table = pd.DataFrame(20.0 + np.outer([0.0, 1.0], rises), index=[0.0, 600.0], columns=names)
    drawn = temperatures(Recording.from_runs({"r": table}, channels), "r", ())
    layout = drawn.to_plotly_json()["layout"]
    titles = [layout[key]["title"]["text"] for key in layout if re.fullmatch(r"yaxis\d*", key)]
    assert titles == ["headstock [°C]", "column [°C]", "elsewhere [°C]"]
    of_panel = {key: [trace.name for trace in drawn.data if trace.yaxis == key] for key in ("y", "y2", "y3")}
    # of very many those from the least to the most
    assert len(of_panel["y"]) == 12
    assert (of_panel["y"][0], of_panel["y"][-1]) == ("h0", "h13")
    assert of_panel["y2"] == ["c1", "c2"]
    assert of_panel["y3"] == ["bed", "motor", "nowhere"]
    assert "nowhere" in drawn.layout.title.text
    assert drawn.layout.title.text.endswith(" 18.0 K")
