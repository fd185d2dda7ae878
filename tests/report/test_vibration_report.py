"""The page of a vibration says what the part keeps and where it comes from, then shows it, with its origin."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from selector.number_text import number_text
from selector.physics.channel_differences import ChannelDifference
from selector.physics.vibration.model_file import read_model_file
from selector.physics.vibration.structure import CarryingMode, carrying_mode, relative_parts
from selector.physics.vibration.vibration_model import RELATIVE, vibration_model
from selector.physics.vibration.vibration_summary import vibration_summary
from selector.telling.page import write_account
from selector.telling.simulated import account_of, vibration
from selector.telling.simulated.vibration import carried_text, motion_courses, source_shares
from tests.report import vibrations
from tests.report.simulated import html
from tests.report.test_selection_report import MEGABYTE, Page

ROOT = Path(__file__).resolve().parents[2]
FIGURES = {"cut": 4, "run-up": 2, "alone": 2}


def test_every_final_is_drawn_by_the_chains_of_every_source_that_have_a_way_to_it():
    model = vibration_model(read_model_file(ROOT / "fixtures" / "vibration" / "lathe.toml"))
    names = [source.name for source in model.sources]
    _, answers = vibration._answers(model, vibration_summary(model, model.simulation()), names)
    led = {(source, chain.final) for chain in model.chains for source in chain.sources}
    drawn = {
        (one.source, model.finals[final]): one.chains_um_per_n is not None
        for final, ones in answers.items()
        for one in ones
    }
    assert drawn == {case: case in led for case in drawn}
    assert len({source for source, _ in led}) > 1


@pytest.fixture(scope="module", params=FIGURES)
def kind(request) -> str:
    return request.param


@pytest.fixture(scope="module")
def page(kind) -> Page:
    return Page(html(vibrations.page(kind)))


def text_of(page: Page) -> str:
    return " ".join(" ".join(page.text).split())


def test_it_says_simulated_before_anything_else(page):
    text = text_of(page)
    assert text.index("SIMULATED") < text.index("Findings")
    assert vibrations.NAME in text


def test_the_first_sentence_is_the_highest_error_with_source_and_resonance():
    shown = vibrations.page("cut")
    text = text_of(Page(html(shown)))
    # 4 N at 90 Hz on the tool, whose mode is near 100 Hz, is far more than what the stiff workpiece does
    worst = max(shown.summary.errors, key=lambda one: one.kinematic_um)
    assert (worst.sources, worst.frequency_hz) == ((vibrations.SOURCE,), 90.0)
    assert f"The highest periodic error is {worst.kind} of {number_text(worst.kinematic_um)} µm" in text
    assert f"It comes from {vibrations.SOURCE} at 90 Hz, near the mode at" in text
    assert "in which the tool moves most: the resonance makes it" in text
    assert "The chain method is within 10 %" in text


def test_the_mode_that_carries_a_line_is_the_largest_part_of_the_motion():
    shown = vibrations.page("cut")
    source, line = shown.simulated.model.sources[0], shown.summary.lines[-1]
    said = {"tool": "tool", "workpiece": "workpiece"}
    parts = relative_parts(shown.simulated.model.structure, shown.summary.modes, source, 90.0, **said)
    # all modes together are the motion of the line, to the rounding of the modes
    assert abs(parts.sum()) * line.force_n * 1e6 == pytest.approx(line.coupled_um[RELATIVE], rel=1e-9)
    modes, k = shown.summary.modes, int(np.argmax(np.abs(parts)))
    carried = carrying_mode(shown.simulated.model.structure, modes, source, 90.0, **said)
    assert carried.frequency_hz == modes.frequency_hz[k]
    # an oscillator of that mode's frequency and loss factor, V eq. 4
    beside = 1.0 - (90.0 / carried.frequency_hz) ** 2
    assert carried.amplification == pytest.approx(1.0 / np.hypot(beside, modes.loss_factor[k]), rel=0.02)


def test_a_run_up_begins_with_the_largest_motion_and_its_speed():
    shown = vibrations.page("run-up")
    text = text_of(Page(html(shown)))
    whole = next(one for one in motion_courses(shown) if one.is_whole)
    k = int(np.argmax(np.abs(whole.motions_um[RELATIVE])))
    assert f"by up to {number_text(abs(whole.motions_um[RELATIVE][k]))} µm, after" in text
    assert f"with spindle at {whole.speeds_rpm['spindle'][k]:.4g} r/min" in text
    assert "What follows is about the mean speeds: spindle 600 r/min." in text


def test_shares_of_sources_make_a_whole():
    shares = source_shares(vibrations.page("cut").summary.lines)
    assert sum(shares.values()) == pytest.approx(1.0, rel=1e-12)
    assert next(iter(shares)) == vibrations.SOURCE


def test_what_there_is_is_drawn_and_what_there_is_not_is_not(kind, page):
    kinds = [kind for kind, _ in page.scripts]
    assert (kinds.count(None), kinds.count("application/json")) == (2, FIGURES[kind])
    text = text_of(page)
    assert ("What the part keeps" in text) == (kind == "cut")
    assert ("Where the chains are off" in text) == (kind == "cut")
    assert ("Where it chatters" in text) == (kind == "cut")
    assert "Structure and modes" in text


def test_channels_parameters_findings_and_origin_are_there(kind, page):
    shown = vibrations.page(kind)
    for channel in shown.recording.channels:
        assert channel.name in page.cells
    assert page.cells[page.cells.index("spindle_force") + 1] == "input"
    assert page.cells[page.cells.index("tool") + 1] is not None
    assert {"<a>.toml", "said before </script>"} <= {*page.cells, *page.text}
    mass = page.cells.index("members.tool.mass_kg")
    assert page.cells[mass + 1 : mass + 4] == ["10", "kg", "model file"]
    phase = page.cells.index("sources.spindle.lines.1.phase_rad")
    assert page.cells[phase + 3] == "left out: default"


def test_what_was_recorded_comes_first():
    shown = vibrations.page("cut")
    time_s = np.arange(100) * 0.01
    one = ChannelDifference("r1", "gauge", "um", time_s, np.sin(time_s), 1.1 * np.sin(time_s))
    content = html(replace(shown, simulated=replace(shown.simulated, differences=(one,))))
    first = re.search(r'<p class="first">(.*?)</p>', content)[1]
    assert first.startswith("Simulated and recorded gauge differ by")
    assert "those were measured" in content


def test_the_page_is_one_file_that_loads_nothing_and_is_always_the_same(tmp_path):
    shown = vibrations.page("cut")
    path = write_account(account_of(shown, drawn=True), tmp_path / "page.html")
    content = path.read_text(encoding="utf-8")
    assert content == html(shown)
    assert not re.search(r"""(?:src|href)=["'](?!#)""", re.sub(r"<script.*?</script>", "", content, flags=re.DOTALL))
    assert "default-src 'none'" in content
    # Plotly's program is most of it
    assert path.stat().st_size < 7 * MEGABYTE
    assert "<script>alert(1)" not in content


@pytest.mark.parametrize("kind", ["cut"])
def test_every_figure_is_drawn_in_a_browser_and_nothing_is_refused(kind, shown, tmp_path):
    path = write_account(account_of(vibrations.page(kind), drawn=True), tmp_path / "page.html")
    content, said = shown(path)
    assert len(re.findall(r'<div class="plot[^"]*" id="(figure-\d+)"', content)) == FIGURES[kind]
    drawn = re.sub(r"<script.*?</script>", "", content, flags=re.DOTALL)
    assert len(re.findall(r'<svg class="main-svg"', drawn)) >= FIGURES[kind]
    assert said == []


@pytest.mark.parametrize(
    ("frequency_hz", "said"),
    [
        (
            13.3,
            ". No resonance makes it large: it lies below the mode that has most of it (40 Hz, the tool moves most)",
        ),
        (90.0, ". No resonance makes it large: it lies above the mode"),
        (38.0, ", near the mode at 40 Hz, in which the tool moves most: the resonance makes it"),
    ],
)
def test_a_line_far_from_resonances_is_not_said_to_be_made_by_one(frequency_hz, said):
    mode = CarryingMode(40.0, "tool", 1.0 / abs(1.0 - (frequency_hz / 40.0) ** 2))
    assert carried_text(mode, frequency_hz).startswith(said)
