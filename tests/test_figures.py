"""Figures show what the results hold: numbers, units, nothing lost in thinning, nothing read as markup."""

from __future__ import annotations

import json
import re

import numpy as np
import plotly.graph_objects as go
import pytest

from selector import figures
from selector.figures import proof, style
from selector.number_text import number_text
from selector.selection.exploration import HeldOutPart
from selector.sensors.groups import dendrogram, transitive_closure
from tests.report import studies

# drawn samples are float32: 2**-24 of values up to some hundred µm
FLOAT32_UM = 1e-4


def every_figure(selection):
    for response in selection.models:
        yield figures.error_against_sensors(selection, response)
        yield figures.errors_per_run(selection, response)
        yield figures.measured_and_predicted(selection, response)
    yield figures.similarity_and_closure(selection)
    yield figures.sensor_tree(selection)
    yield figures.sensor_places(selection, places_of(selection))


def places_of(selection):
    """Places of all sensors but the last one."""
    return {name: (0.1 * i, 0.3 - 0.05 * i, 1.0) for i, name in enumerate(selection.sensors[:-1])}


def named(drawn: go.Figure, name: str) -> list:
    return [trace for trace in drawn.data if trace.name is not None and trace.name.startswith(name)]


@pytest.mark.parametrize("study", [studies.small, studies.single_run], ids=["runs", "one run"])
def test_every_figure_has_a_title_and_units_on_every_axis(study):
    for drawn in every_figure(study()):
        assert drawn.layout.title.text
        layout = drawn.to_plotly_json()["layout"]
        titles = [layout[key].get("title", {}).get("text") for key in layout if re.fullmatch(r"[xy]axis\d*", key)]
        shown = [title for title in titles if title]
        for title in shown:
            assert re.search(r"\[(µm|–|s|min|h|m)\]", title), title
        # axes without a title carry names, or units in their tick labels
        assert shown or "[" in json.dumps(layout, ensure_ascii=False)


def test_equal_results_give_equal_figures():
    again = studies.select(studies.recording(), studies.small().options)
    for one, other in zip(every_figure(studies.small()), every_figure(again), strict=True):
        assert one.to_json() == other.to_json()


def test_names_are_never_markup():
    own = re.compile(r"</?(?:b|br|extra)>")
    texts = []
    for drawn in every_figure(studies.small()):
        texts += strings_of(json.loads(drawn.to_json()))
    shown = [own.sub("", text) for text in texts]
    assert any("&lt;script&gt;alert(1)" in text for text in shown)
    assert not [text for text in shown if "<" in text]
    templates = [text for drawn in every_figure(studies.small()) for text in hover_templates(drawn)]
    assert templates
    assert not [text for text in templates if "%{y}</b>" in text or "alert" in text]


def strings_of(value) -> list[str]:
    if isinstance(value, str):
        return [value]
    items = value.values() if isinstance(value, dict) else value if isinstance(value, list) else []
    return [text for item in items for text in strings_of(item)]


def hover_templates(drawn: go.Figure) -> list[str]:
    return [trace.hovertemplate for trace in drawn.data if trace.hovertemplate]


@pytest.mark.parametrize(
    ("name", "shown"),
    [
        ("<b>T1</b>", "&lt;b&gt;T1&lt;/b&gt;"),
        ("a & b", "a &amp; b"),
        ("line\nbreak\u202e", "line break "),
        ("x" * 40, "x" * 14 + "…" + "x" * 13),
    ],
)
def test_labels(name, shown):
    assert style.label(name) == shown


def test_similarity_stands_below_the_diagonal_and_closure_above():
    selection = studies.small()
    drawn = figures.similarity_and_closure(selection)
    similarity = selection.grouping.similarity.matrix
    order = dendrogram(similarity).leaf_order
    n = len(order)
    z = np.array(drawn.data[0].z, dtype=np.float64)
    lower, upper = np.tril_indices(n, -1), np.triu_indices(n, 1)
    # float32 of values below 7
    np.testing.assert_allclose(z[lower], style.nines(similarity[np.ix_(order, order)][lower]), rtol=1e-6)
    closure = transitive_closure(similarity)[np.ix_(order, order)]
    np.testing.assert_allclose(z[upper], style.nines(closure[upper]), rtol=1e-6)
    outlined = sorted(round(shape.x1 - shape.x0) for shape in drawn.layout.shapes)
    assert outlined == sorted(len(group) for group in selection.grouping.chosen.rounds[0].groups)


def test_tree_merges_at_the_exact_levels():
    selection = studies.small()
    drawn = figures.sensor_tree(selection)
    tree = dendrogram(selection.grouping.similarity.matrix)
    # a merge is drawn as a stem to its level, across, and a stem
    merges = {shape.line.color: re.findall(r"M\S+?H(\S+?)V\S+?H", shape.path) for shape in outlines(drawn)}
    corners = sorted(float(x) for levels in merges.values() for x in levels)
    np.testing.assert_allclose(corners, sorted(style.nines(tree.levels)), rtol=1e-12)  # the same function of the same
    coloured = sum(len(levels) for colour, levels in merges.items() if colour != style.MUTED)
    assert coloured == int((tree.levels >= selection.grouping.chosen.level).sum())
    chosen = next(trace for trace in drawn.data if trace.name == "chosen")
    assert [tree.leaf_order[row] for row in chosen.y] == [
        i for i in tree.leaf_order if selection.sensors[i] in selection.chosen
    ]


def outlines(drawn: go.Figure) -> list[go.layout.Shape]:
    return [shape for shape in drawn.layout.shapes if shape.type == "path"]


def test_places_show_where_the_kept_sensors_sit():
    selection = studies.small()
    drawn = figures.sensor_places(selection, places_of(selection), 2 * [np.array([[0.0, 0, 0], [0, 0, 2.0]])])
    kept = [name for name in selection.chosen if name in places_of(selection)]
    for axis, across in (("x", 0), ("x2", 1)):
        (points,) = (t for t in drawn.data if t.name == "kept" and (t.xaxis or "x") == axis)
        seen = [k for k, x in enumerate(points.x) if x is not None]
        assert [k for k, text in enumerate(points.text) if text] == seen
        assert [points.x[k] for k in seen] == [places_of(selection)[name][across] for name in kept]
        assert [points.text[k].removeprefix("<b>").removesuffix("</b>") for k in seen] == [
            style.label(name) for name in kept
        ]
    assert "place of 1 " in drawn.layout.title.text.replace("<br>", " ")
    # what lies behind something else is drawn once
    assert [(shape.xref, shape.path) for shape in outlines(drawn)] == [("x", "M0,0L0,2"), ("x2", "M0,0L0,2")]


def test_a_thermometer_in_the_hall_does_not_make_the_machine_small():
    selection = studies.small()
    places = places_of(selection)
    first = next(iter(places))
    body = [np.array(list(places.values()))]
    near = figures.sensor_places(selection, places, body)
    far = figures.sensor_places(selection, {**places, first: (30.0, 0.0, 0.0)}, body)
    assert "not drawn" not in near.layout.title.text.replace("<br>", " ")
    assert f"not drawn: {style.label(first)}" in far.layout.title.text.replace("<br>", " ")
    assert (
        far.layout.xaxis.range[1]
        < 30.0
        < figures.sensor_places(selection, {**places, first: (30.0, 0.0, 0.0)}).layout.xaxis.range[1]
    )


def test_curve_holds_the_held_out_errors():
    selection = studies.small()
    for j, response in enumerate(selection.models):
        drawn = figures.error_against_sensors(selection, response)
        curve = named(drawn, "best of each size")[0]
        assert list(curve.x) == [point.n_sensors for point in selection.proof.curve]
        assert list(curve.y) == [point.rmse_um[j] for point in selection.proof.curve]
        assert list(curve.error_y.array) == [point.standard_error_um[j] for point in selection.proof.curve]
        ring = named(drawn, "whole procedure")[0]
        assert (ring.x[0], ring.y[0]) == (len(selection.chosen), selection.proof.rmse_um(response))
        for way, value in selection.proof.baselines_um[response].items():
            colour = style.BASELINES.get(way, style.OTHER_BASELINE)
            assert any(trace.y[0] == value for trace in drawn.data if trace.line.color == colour)
        fixed = named(drawn, "fixed set")[0]
        assert dict(zip(fixed.x, fixed.y, strict=True)) == selection.fixed_set_errors_um(response)
        # the title names both errors that stand at the chosen size
        title, at_size = style.title_text(drawn), dict(zip(curve.x, curve.y, strict=True))[ring.x[0]]
        assert f"whole procedure (ring) {number_text(ring.y[0])} µm" in title
        assert f"size {number_text(at_size)} µm" in title


def test_a_curve_that_buys_nothing_says_so():
    title = style.title_text(figures.error_against_sensors(studies.useless(), "Z"))
    assert "no better" in title
    assert "against" in style.title_text(figures.error_against_sensors(studies.small(), "Z"))


@pytest.mark.parametrize("study", [studies.small, studies.single_run], ids=["runs", "one run"])
def test_residual_is_measured_minus_predicted_and_keeps_its_peak(study):
    selection = study()
    drawn = figures.measured_and_predicted(selection, "Z")
    measured, predicted, residual = (named(drawn, name) for name in ("measured", "predicted", "residual"))
    assert len(measured) == len({trace.run for trace in selection.proof.traces})
    for one, other, rest in zip(measured, predicted, residual, strict=True):
        np.testing.assert_allclose(np.subtract(one.y, other.y), rest.y, atol=FLOAT32_UM)
        assert len(rest.x) <= 2 * 400
    peak = max(float(np.nanmax(np.abs(rest.y))) for rest in residual)
    assert peak == pytest.approx(selection.proof.max_um("Z"), abs=FLOAT32_UM)


def test_no_peak_is_lost_in_thinning():
    # one sample of 10 000 sticks out
    residual = np.zeros(10_000)
    residual[6_789] = -5.0
    kept = figures.panels.telling_samples(residual, 100)
    assert 6_789 in kept
    assert len(kept) <= 101
    assert kept[0] == 0
    assert kept[-1] == 9_999


def test_runs_can_be_picked():
    drawn = figures.measured_and_predicted(studies.small(), "Z", ["day 3", "day 1"])
    assert len(named(drawn, "residual")) == 2
    shown = [note.text for note in drawn.layout.annotations]
    assert ["day 3" in shown[0], "day 1" in shown[1]] == [True, True]


def test_bars_hold_the_errors_of_every_run():
    selection = studies.small()
    drawn = figures.errors_per_run(selection, "Y")
    parts = selection.proof.per_response["Y"]
    assert list(named(drawn, "without")[0].x) == [part.before_rmse_um for part in parts]
    assert list(named(drawn, "with the model, rms")[0].x) == [part.rmse_um for part in parts]
    assert "all 4 runs" in style.title_text(drawn)


def test_of_many_runs_the_worst_and_some_of_all_sorts_are_drawn():
    """A thousand rows could not be read, and took two and a half minutes."""
    runs = [HeldOutPart(f"day {k}", 10, abs(k - 500.0), 7.0) for k in range(1000)]
    title = proof.run_errors_title("Z", runs, "runs")
    drawn = style.changed(proof.run_errors_picture(runs, title), proof.run_error_changes("Z", runs))
    assert title.endswith("30 of 1000 are drawn: the worst 15, and 15 spread evenly over the others from bad to good")
    error = dict(zip(drawn.layout.yaxis.ticktext, named(drawn, "with the model, rms")[0].x, strict=True))
    assert error == {name: abs(float(name.removeprefix("day ")) - 500.0) for name in error}
    assert len(error) == 30
    assert sorted(error.values())[-15:] == [*(493.0 + k // 2 for k in range(14)), 500.0]
    assert min(error.values()) < 5.0
    assert sum("→" in note.text for note in drawn.layout.annotations) == 30


def test_a_title_names_the_runs_that_get_worse():
    selection = studies.useless()
    worse = [part.name for part in selection.proof.per_response["Z"] if part.rmse_um >= part.before_rmse_um]
    title = style.title_text(figures.errors_per_run(selection, "Z"))
    assert worse
    assert f"on {len(worse)} of 4 runs" in title
    assert all(name in title for name in worse)


def test_nines_rise_with_the_level_and_stay_finite():
    levels = np.array([-1.0, 0.0, 0.9, 0.99, 0.999, 1.0])
    places = style.nines(levels)
    assert (np.diff(places) > 0).all()
    assert np.isfinite(places).all()
    # 0.9, 0.99 and 0.999 are equally far apart; 1e-12: four roundings
    assert places[3] - places[2] == pytest.approx(places[4] - places[3], abs=1e-12)


@pytest.mark.parametrize(("low", "high"), [(0.87, 0.8886), (0.2, 0.99999), (-0.9, 0.3), (0.99991, 0.99997)])
def test_level_axes_have_a_few_ticks_that_do_not_touch(low, high):
    ticks = style.level_axis(low, high)
    places = np.sort(ticks["tickvals"])
    assert 2 <= len(places) <= 16
    assert np.diff(places).min() >= 0.069 * (style.nines(high) - style.nines(low))
    for place, text in zip(ticks["tickvals"], ticks["ticktext"], strict=True):
        assert style.nines(float(text)) == pytest.approx(place, abs=1e-6)  # labels are rounded to nine digits


@pytest.mark.parametrize(
    ("value", "text"),
    [(83.64, "83.6"), (-2.0, "−2.00"), (0.0, "0"), (9.9996, "10.0"), (float("nan"), "–"), (2e-7, "2.00·10⁻⁷")],
)
def test_numbers(value, text):
    assert number_text(value) == text
