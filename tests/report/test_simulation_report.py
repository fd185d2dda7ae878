"""The page of a simulation says that it is one, what moved most, and where the heat went."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from selector.figures.simulation import largest_displacement
from selector.physics.thermal.field_moment import FieldMoment
from selector.report.numbers import number_text
from selector.report.simulation_report import largest_of, simulation_html, write_simulation_report
from tests.report import predictions
from tests.report.test_selection_report import MEGABYTE, Page
from tests.test_figures_thermal import CUBE, CUBE_M


@pytest.fixture(scope="module")
def page() -> Page:
    return Page(simulation_html(predictions.simulation()))


def text_of(page: Page) -> str:
    return " ".join(" ".join(page.text).split())


def test_it_says_simulated_before_anything_else(page):
    text = text_of(page)
    assert text.index("SIMULATED") < text.index("moves most")
    name, _, um = largest_displacement(predictions.simulation().recording, "run <1>")
    assert f"{name} moves most, by {number_text(um)} µm after " in text
    assert "<script>alert(1)</script> (headstock, front) warms most, by " in text


def test_inputs_channels_balance_constants_parameters_and_origin_are_there(page):
    shown = predictions.simulation()
    for channel in shown.recording.channels:
        assert channel.name in page.cells
    assert page.cells[page.cells.index("ambient") + 1] == "input"
    assert page.cells[page.cells.index("Z") + 1] == "output"
    balance = shown.recording.provenance["runs"]["run <1>"]
    assert page.cells[page.cells.index("bearing") + 2] == number_text(balance["sources_j"]["bearing"] / 1e3, 4)
    for name, values in shown.time_constants.items():
        assert f"{name} [min]" in page.cells
        assert number_text(float(values[0]) / 60) in page.cells
    assert {"nodes.head.heat_capacity_j_per_k", "<a>.toml", "an <b>odd</b> thing"} <= {*page.cells, *page.text}


def test_more_cooling_makes_the_machine_faster():
    constants = predictions.simulation().time_constants
    assert list(constants) == ["standing", "at 3000 r/min with coolant"]
    assert constants["at 3000 r/min with coolant"][0] < constants["standing"][0]


def test_the_field_stands_on_the_page_with_its_moment():
    moment = FieldMoment(4800.0, CUBE_M, CUBE, 20.0 + np.arange(8.0), np.eye(8, 3))
    shown = dataclasses.replace(predictions.simulation(), moment=moment, moment_run="run <1>")
    text = text_of(Page(simulation_html(shown)))
    assert "Simulated: after 1 h 20 min, at 0 r/min, the surface is up to 27.0 °C warm" in text


def test_nothing_runs_and_nothing_is_loaded(page):
    assert not [tag for tag in page.tags if tag in ("link", "img", "iframe", "object", "embed", "base", "form", "u")]
    assert not [name for _, name, _ in page.attributes if name.startswith("on") or name in ("src", "srcset")]
    assert "default-src 'none'" in page.policy
    kinds = [kind for kind, _ in page.scripts]
    assert (kinds.count(None), kinds.count("application/json")) == (2, 3)


def test_equal_simulations_give_equal_bytes(tmp_path):
    one = write_simulation_report(predictions.simulation(), tmp_path / "a.html").read_bytes()
    predictions.simulation.cache_clear()
    assert write_simulation_report(predictions.simulation(), tmp_path / "b.html").read_bytes() == one
    # the drawing program alone has 4.8 MB
    assert len(one) < 5.3 * MEGABYTE


def test_the_largest_of_all_runs_is_found():
    recording = predictions.simulation().recording
    assert largest_of(recording) == ("run <1>", largest_displacement(recording, "run <1>")[1])
