"""The page of a simulation says that it is one, what moved most, and where the heat went."""

from __future__ import annotations

import pytest

from selector.number_text import number_text
from selector.physics.thermal.drift_quantities import largest_displacement
from selector.physics.thermal.thermal_model import slowest_time_constants
from selector.telling.page import account_page, write_account
from selector.telling.simulated import account_of
from selector.telling.simulated.thermal import largest_of, pictured_at
from tests.report import predictions
from tests.report.simulated import html
from tests.report.test_selection_report import MEGABYTE, Page


@pytest.fixture(scope="module")
def page() -> Page:
    return Page(html(predictions.simulation()))


def constants(shown):
    run, _ = pictured_at(shown)
    return slowest_time_constants(shown.simulated.model.machine, shown.simulated.details(run))


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
    for name, values in constants(shown).items():
        assert f"{name} [min]" in page.cells
        assert number_text(float(values[0]) / 60) in page.cells
    assert {"nodes.head.heat_capacity_j_per_k", "<a>.toml", "an <b>odd</b> thing"} <= {*page.cells, *page.text}


def test_more_cooling_makes_the_machine_faster():
    constants_of = constants(predictions.simulation())
    assert list(constants_of) == ["standing", "at 3000 r/min with coolant"]
    assert constants_of["at 3000 r/min with coolant"][0] < constants_of["standing"][0]


def test_the_field_stands_on_the_page_with_its_moment():
    text = text_of(Page(account_page(predictions.field_account())))
    assert "Simulated: after 1 h 20 min, at 0 r/min, the surface is up to 27.0 °C warm" in text


def test_nothing_runs_and_nothing_is_loaded(page):
    assert not [tag for tag in page.tags if tag in ("link", "img", "iframe", "object", "embed", "base", "form", "u")]
    assert not [name for _, name, _ in page.attributes if name.startswith("on") or name in ("src", "srcset")]
    assert "default-src 'none'" in page.policy
    kinds = [kind for kind, _ in page.scripts]
    assert (kinds.count(None), kinds.count("application/json")) == (2, 2)


def test_equal_simulations_give_equal_bytes(tmp_path):
    one = write_account(account_of(predictions.simulation(), drawn=True), tmp_path / "a.html").read_bytes()
    predictions.simulation.cache_clear()
    assert write_account(account_of(predictions.simulation(), drawn=True), tmp_path / "b.html").read_bytes() == one
    # the drawing program alone has 4.8 MB
    assert len(one) < 5.3 * MEGABYTE


def test_the_largest_of_all_runs_is_found():
    recording = predictions.simulation().recording
    assert largest_of(recording) == ("run <1>", largest_displacement(recording, "run <1>")[1])
