"""The page of a feed drive says how far it is off and why, then shows courses, loop and where its numbers are from."""

from __future__ import annotations

import math

import numpy as np
import pytest

from selector.number_text import number_text
from selector.physics.drive.drive_summary import course_of
from selector.physics.drive.parts.catalogue import thc6350_x_axis
from selector.physics.drive.parts.stiffness import axial_stiffness_n_per_m
from selector.telling.page import write_account
from selector.telling.simulated import account_of
from selector.telling.simulated.drive import axes_in_runs, cause_sentence
from tests.report import drives
from tests.report.simulated import html
from tests.report.test_selection_report import MEGABYTE, Page


@pytest.fixture(scope="module", params=["command", "state", "circle"])
def kind(request) -> str:
    return request.param


@pytest.fixture(scope="module")
def page(kind) -> Page:
    return Page(html(drives.page(kind)))


def text_of(page: Page) -> str:
    return " ".join(" ".join(page.text).split())


def test_it_says_simulated_before_anything_else(page):
    text = text_of(page)
    assert text.index("SIMULATED") < text.index("Findings")
    assert drives.NAME in text


def test_the_first_sentence_is_the_largest_error_with_its_cause():
    shown = drives.page("command")
    text = text_of(Page(html(shown)))
    (one,) = axes_in_runs(shown)
    error_um = (one.motion.reference_m - one.motion.table_m) * 1e6
    largest, rms = np.abs(error_um).max(), math.sqrt(np.mean(error_um**2))
    assert f"The table is off its command by up to {number_text(largest)} µm, most after " in text
    assert f"{number_text(rms)} µm root mean square" in text
    # without feed-forward a position loop lags
    assert "Most of it goes with the speed" in text
    assert "A limit of current or speed was reached" in text


def test_the_first_sentence_of_a_circle_is_its_roundness_and_what_is_behind_it():
    shown = drives.page("circle")
    text = text_of(Page(html(shown)))
    fastest = shown.summary.quantities[-1]
    assert f"At 6000 mm/min the circle is out of round by {number_text(fastest.both.circular_deviation_um)} µm" in text
    assert "Causes at 6000 mm/min, largest first: " in text
    assert "squareness" in text


def test_a_lag_that_is_that_of_the_gain_is_said_to_be():
    shown = drives.page("circle")
    for one in (one for one in axes_in_runs(shown) if one.run == "F3000 ccw"):
        said = cause_sentence(one.summary.parts, one.axis, one.measures)
        assert f"the position gain of {one.axis.servo.position_gain_per_s:.4g} 1/s" in said


def test_loops_channels_parameters_findings_and_origin_are_there(kind, page):
    shown = drives.page(kind)
    for channel in shown.recording.channels:
        assert channel.name in page.cells
    assert page.cells[page.cells.index("X_command") + 1] == "input"
    assert page.cells[page.cells.index("X_table") + 1] == "output"
    loop = shown.summary.loops["X"]
    assert number_text(loop.figures.bandwidth_hz) in page.cells
    assert {"<a>.toml", "said before </script>"} <= {*page.cells, *page.text}
    gain = page.cells.index("axes.X.servo.position_gain_per_s")
    assert page.cells[gain + 3] == "model file"


def test_where_a_number_is_from_is_told():
    cells = Page(html(drives.page("command"))).cells
    mass = cells.index("axes.X.parts.table.mass_kg")
    assert cells[mass + 3] == "catalogue values of thc6350-x"
    forward = cells.index("axes.X.servo.velocity_feedforward")
    assert cells[forward + 3] == "left out: default"
    command_limit = cells.index("axes.X.servo.command_limit")
    assert (cells[command_limit + 1], cells[command_limit + 3]) == ("20", "model file")


def test_what_varies_is_shown_with_the_instants_of_its_loop(kind, page):
    kinds = [kind for kind, _ in page.scripts]
    # course, stiffness and damping, and the loop; two circles and two loops
    figures = {"command": 3, "state": 3, "circle": 4}[kind]
    assert (kinds.count(None), kinds.count("application/json")) == (2, figures)
    text = text_of(page)
    assert ("axial stiffness" in text) == (kind != "circle")


def test_stiffness_of_the_state_is_that_of_position_and_load():
    shown = drives.page("state")
    (one,) = axes_in_runs(shown)
    course = course_of(shown.simulated.model, "X", shown.simulated.details.axes[one.run]["X"].recorded)
    k = int(np.argmax(np.abs(one.motion.axial_force_n)))
    expected = axial_stiffness_n_per_m(
        thc6350_x_axis(), position_m=one.motion.table_m[k], load_n=one.motion.axial_force_n[k]
    )
    assert course.axial_stiffness_n_per_m[k] == pytest.approx(float(expected), rel=1e-9)  # Newton's last step
    low, high = one.summary.stiffness_n_per_m
    assert low < high


def test_nothing_runs_and_nothing_is_loaded(page):
    assert not [tag for tag in page.tags if tag in ("link", "img", "iframe", "object", "embed", "base", "form", "u")]
    assert not [name for _, name, _ in page.attributes if name.startswith("on") or name in ("src", "srcset")]
    assert "default-src 'none'" in page.policy


def test_equal_simulations_give_equal_bytes(tmp_path):
    one = write_account(account_of(drives.page("state"), drawn=True), tmp_path / "a.html").read_bytes()
    drives.page.cache_clear()
    assert write_account(account_of(drives.page("state"), drawn=True), tmp_path / "b.html").read_bytes() == one
    # the drawing program alone has 4.8 MB
    assert len(one) < 5.3 * MEGABYTE
