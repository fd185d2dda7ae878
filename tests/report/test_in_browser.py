"""The report in a browser: every figure is drawn, under its own security policy, without a word on the console."""

from __future__ import annotations

import re
from dataclasses import replace

import pandas as pd
import plotly.graph_objects as go

from selector.findings import Finding
from selector.recording import Recording
from selector.selection import Options, Selection, select
from selector.telling.account import Account, Drawing, findings_section, section, sections
from selector.telling.page import write_account
from selector.telling.selected.account import write_report
from tests.report import studies


def test_every_figure_is_drawn_and_the_console_is_silent(shown, tmp_path):
    path = write_report(studies.small(), tmp_path / "report.html", title="Study")
    content, said = shown(path)
    figures = re.findall(r'<div class="plot[^"]*" id="(figure-\d+)"', content)
    assert len(figures) > 8
    # Plotly lays several drawings over each other, the first of a figure is the one with the plot
    assert content.count('class="main-svg"') >= len(figures)
    assert content.count("js-plotly-plot") >= len(figures)
    assert said == []


def test_a_table_is_copied_for_a_spreadsheet_and_pictures_are_smaller_on_paper(tab, tmp_path):
    path = write_report(studies.small(), tmp_path / "report.html", title="Study")
    page = tab()
    page.goto(path.as_uri())
    page.evaluate(
        "() => { window.was = []; "
        "addEventListener('copy', (event) => window.was.push(event.clipboardData.getData('text/plain'))); }"
    )
    table = page.locator(".advice .scroll")
    cells = ["=HYPERLINK(1)", "\u22121.5", "-1+1", "+2.5 %"]
    page.evaluate(
        "(texts) => { const row = document.querySelector('.advice .scroll table').rows[0];"
        " texts.forEach((text) => { row.insertCell().textContent = text; }); }",
        cells,
    )
    table.hover()
    table.locator(".copy").click()
    (copied,) = page.evaluate("window.was")
    before = page.evaluate("[...document.querySelectorAll('.plot')].map((plot) => plot.offsetHeight)")
    page.evaluate("window.dispatchEvent(new Event('beforeprint'))")
    paper = page.evaluate("[...document.querySelectorAll('.plot')].map((plot) => plot.offsetHeight)")
    page.evaluate("window.dispatchEvent(new Event('afterprint'))")
    after = page.evaluate("[...document.querySelectorAll('.plot')].map((plot) => plot.offsetHeight)")
    page.close()
    rows = [line.split("\t") for line in copied.split("\n")]
    assert rows[0][0] == "error of"
    assert [row[0] for row in rows[1:]] == ["Z", "Y"]
    assert rows[0][-4:] == ["'=HYPERLINK(1)", "-1.5", "'-1+1", "+2.5 %"]
    assert all(len(row) == len(rows[0]) - 4 for row in rows[1:])
    assert float(rows[1][1]) > 0
    assert after == before
    assert all(on <= off for on, off in zip(paper, before, strict=True))
    assert sum(paper) < 0.95 * sum(before)


def test_a_tall_picture_stands_on_the_first_page_and_nothing_prints_a_page_of_its_own(tab, tmp_path):
    """An answer of two lines, a picture of 700 px, what is only good to know: a page with room for all of it."""
    tall = Drawing(go.Figure(go.Scatter(y=[1, 2]), {"title": "Tall", "margin": {"t": 60}, "height": 700}))
    rests_on = "What it rests on, in a sentence that needs more than one line. " * 3
    found = sections(section("seen", "Seen", tall), findings_section([Finding("gap", "info", "Good to know.")]))
    path = write_account(Account("Study", ("The answer.", *[rests_on] * 9), found), tmp_path / "page.html")
    page = tab()
    page.goto(path.as_uri())
    page.locator(".main-svg").first.wait_for()
    assert page.locator("#findings h2").is_visible()
    printed = page.pdf(prefer_css_page_size=True)
    page.emulate_media(media="print")
    assert not page.locator("#findings h2").is_visible()
    page.close()
    assert printed.count(b"/Type /Page\n") == 1


_TOUCHING = """() => {
  const told = [];
  for (const plot of document.querySelectorAll('.plot')) {
    const within = plot.getBoundingClientRect();
    const texts = [...plot.querySelectorAll('.annotation-text, [class*="g-y"] text')];
    const boxes = texts.map((one) => [one.textContent, one.getBoundingClientRect()]);
    boxes.filter(([, box]) => box.width > 0 && box.right > within.right + 1).forEach(([text]) => told.push(text));
    boxes.forEach(([a, p], i) => boxes.slice(i + 1).forEach(([b, q]) => {
      if (Math.min(p.right, q.right) - Math.max(p.left, q.left) > 1
          && Math.min(p.bottom, q.bottom) - Math.max(p.top, q.top) > 1) told.push(`${a} | ${b}`);
    }));
  }
  return told;
}"""


def test_long_names_of_runs_and_displacements_do_not_run_into_each_other(tab, tmp_path):
    names = ["Lauf 3 Wechsel 12:30", "Lauf 2 Stufen morgens und nachmittags mit Pause, Halle offen", *"ab"]
    found = long_named(names, "Verlagerung Spindel Z")
    path = write_report(found, tmp_path / "report.html")
    page = tab()
    page.goto(path.as_uri())
    on_screen = page.evaluate(_TOUCHING)
    page.evaluate("window.dispatchEvent(new Event('beforeprint'))")
    on_paper = page.evaluate(_TOUCHING)
    page.close()
    assert on_screen == []
    assert on_paper == []


def long_named(runs: list[str], displacement: str) -> Selection:
    """A study of three sensors whose runs and displacement have these names."""
    source = studies.recording(5)
    wanted = [channel for channel in source.channels if channel.name.startswith(("T3", "T4", "T5", "Z"))]
    columns = [channel.name for channel in wanted]
    channels = [replace(one, name=displacement) if one.name == "Z" else one for one in wanted]
    tables = {
        name: pd.DataFrame(source.values(run, columns), source.time_s(run), [one.name for one in channels])
        for name, run in zip(runs, source.runs, strict=True)
    }
    return select(Recording.from_runs(tables, channels), Options(must=("T3", "T4", "T5")))
