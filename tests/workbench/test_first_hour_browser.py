"""The workbench as somebody meets it who has never seen it: an example, faults, a set, a program; and every page."""

from __future__ import annotations

import contextlib
import dataclasses
import os
import shutil
import threading
from pathlib import Path

import pandas as pd
import pytest

from selector.readers import machine as machine_file
from selector.shipped import shipped, shipped_models
from selector.workbench.bench import Bench
from selector.workbench.page import PAGES
from selector.workbench.pages import simulation
from selector.workbench.server import started
from tests.patience import wait_for

api = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")

PATIENCE_MS = 120_000
AXE = Path(os.environ.get("AXE_CORE", "node_modules/axe-core/axe.min.js"))
"""Of the npm package axe-core, which is not a part of this repository."""

TITLES = """Object.fromEntries([["sets", "yaxis"], ["runs", "xaxis"]].map(
  ([name, axis]) => [name, document.querySelector(`#sensors-${name} .js-plotly-plot`).layout[axis].title.text]))"""
HANDLE = """([trace, number]) => {
  const graph = document.querySelector("#prediction-cycle .js-plotly-plot");
  const box = graph.getBoundingClientRect();
  const { xaxis, yaxis } = graph._fullLayout;
  const { x, y } = graph._fullData[trace];
  return [box.left + xaxis._offset + xaxis.d2p(x[number]), box.top + yaxis._offset + yaxis.d2p(y[number])];
}"""
COVERED = """() => {
  const at = document.activeElement;
  const { left, right, top, bottom } = at.getBoundingClientRect();
  const shown = document.elementFromPoint((left + right) / 2, (top + bottom) / 2);
  return { [at.id || at.outerHTML.slice(0, 80)]: !(shown && (at.contains(shown) || shown.contains(at))) };
}"""
SERIOUS = """async () => (await axe.run(document, { resultTypes: ["violations"], iframes: false })).violations
  .filter((one) => ["serious", "critical"].includes(one.impact))
  .map((one) => [one.id, one.nodes.slice(0, 5).map((node) => node.html.slice(0, 200))])"""


@pytest.fixture
def bench(tmp_path):
    (tmp_path / "study").mkdir()
    return Bench((tmp_path / "study").resolve())


@pytest.fixture
def page(tab, bench, tmp_path):
    """The workbench as the file opens it that the command names to the browser; what a script complains of fails."""
    server = started(bench)
    opener = tmp_path / "opener.html"
    opener.write_text(server.access.opener(), encoding="utf-8")
    said: list[str] = []
    # axe is put into the page
    opened = tab(bypass_csp=True)
    opened.set_default_timeout(PATIENCE_MS)
    opened.on("pageerror", lambda error: said.append(str(error)))
    opened.on("console", lambda line: said.append(line.text) if line.type == "error" else None)
    opened.goto(opener.as_uri())
    opened.get_by_role("button", name="Choose recordings …").wait_for()
    yield opened
    opened.close()
    server.close()
    assert said == []


def reach(page, name: str) -> None:
    """Goes on with Tab until the focus is at the element with this id."""
    for _ in range(400):
        if page.evaluate("document.activeElement.id") == name:
            return
        page.keyboard.press("Tab")
    raise AssertionError(f"{name} is not reached")


def handle(page, trace: int, number: int) -> tuple[float, float]:
    """Where a handle of the duty cycle is, when the picture has come to rest."""
    before = None
    while (now := page.evaluate(HANDLE, [trace, number])) != before:
        before = now
        page.wait_for_timeout(300)
    return now


def test_the_first_page_complains_of_nothing_and_every_page_is_seen_from_its_top(page):
    page.reload()
    page.get_by_role("button", name="Choose recordings …").wait_for()
    page.wait_for_timeout(2000)
    assert page.locator("#notice").inner_text() == ""
    page.set_viewport_size({"width": 800, "height": 300})
    page.get_by_role("link", name="Predict").click()
    page.get_by_text("The duty cycle", exact=True).wait_for()
    page.evaluate("window.scrollTo(0, 400)")
    assert page.evaluate("window.scrollY") > 0
    page.get_by_role("link", name="Export").click()
    page.get_by_role("heading", name="Program for a control").wait_for()
    assert page.evaluate("window.scrollY") == 0


def test_from_an_example_to_a_program_by_keyboard_alone(page, bench):
    page.get_by_role("button", name="Simulated: a machining centre").focus()
    page.keyboard.press("Enter")
    page.get_by_text("The first lines of the file").wait_for()
    # the fields of 39 channels are gone past with one key
    past = page.get_by_role("button", name="Go past the channels")
    past.focus()
    page.keyboard.press("Enter")
    assert page.evaluate("document.activeElement.id") == "recordings-correct"
    reach(page, "to-sensors")
    page.keyboard.press("Enter")
    page.locator("#sensors-facts dd").first.wait_for()
    # the smallest set that is good enough
    reach(page, "sensors-target")
    page.keyboard.type("5")
    page.keyboard.press("Enter")
    page.get_by_text("within the target").wait_for()
    first = page.locator("#sensors-facts dd").first
    fewest = first.inner_text().count(",") + 1
    assert page.locator("#sensors-count").input_value() == str(fewest)
    reach(page, "sensors-count")
    page.keyboard.press("ArrowRight")
    page.wait_for_function(
        "(n) => document.querySelector('#sensors-facts dd').textContent.split(',').length === n", arg=fewest + 1
    )
    assert "error of Y_lower" in page.evaluate(TITLES)["sets"]
    page.locator("#sensors-response").select_option("Z")
    page.wait_for_function(f"({TITLES}).sets.includes('error of Z,')")
    page.wait_for_function(f"({TITLES}).runs.includes('error of Z')")
    # what is looked at stays when the page is loaded again
    shown = first.inner_text()
    page.reload()
    first.wait_for()
    assert (first.inner_text(), page.locator("#sensors-response").input_value()) == (shown, "Z")
    reach(page, "sensors-start")
    page.keyboard.press("Enter")
    answer = page.locator("#page-selection").get_by_role("heading", name="The answer")
    answer.wait_for()
    assert page.evaluate("location.hash") == "#selection"
    page.wait_for_function("document.querySelector('#selection-answer').getBoundingClientRect().top < innerHeight / 2")
    assert bench.result("selection/selection.json")["chosen"]["sensors"] == shown.split(", ")
    # the answer is none of the fields above it, nor of the command below; nothing was changed since
    other = page.locator("#selection-earlier", has_text="was started on another page")
    assert "must be kept" in other.inner_text()
    assert "Start again" not in other.inner_text()
    page.get_by_role("link", name="the program for your control").focus()
    page.keyboard.press("Enter")
    reach(page, "export-start")
    page.keyboard.press("Enter")
    page.get_by_role("heading", name="Files in export-c").wait_for()
    page.get_by_text("it differs from the model by at most").wait_for()
    assert page.locator("#page-export table.files").get_by_text("thermal_correction.c", exact=True).is_visible()
    assert page.locator("#export-answer").get_by_text("What the command said").count() == 0
    # a menu is searched by typing, though the focus is at what is chosen
    reach(page, "export-target")
    page.keyboard.press("Enter")
    page.get_by_role("option", name="C99").wait_for()
    page.keyboard.type("sinu")
    page.get_by_role("option", name="C99").wait_for(state="hidden")
    page.keyboard.press("Enter")
    api.expect(page.locator("#command")).to_contain_text("--for sinumerik", timeout=PATIENCE_MS)


def test_faults_are_told_first_and_repaired_with_a_click(page, bench, tmp_path):
    """Two cables that changed places in one run."""
    folder = tmp_path / "recorded"
    shutil.copytree(shipped("vmc37"), folder)
    table = pd.read_csv(folder / "r3.csv")
    table[["T01", "T30"]] = table[["T30", "T01"]].to_numpy()
    table.to_csv(folder / "r3.csv", index=False)
    bench.add(*sorted(folder.glob("*.csv")), machine=folder / "machine.toml")
    page.get_by_role("heading", name="What is wrong with the data").wait_for()
    tops = [page.get_by_role("heading", name=name).bounding_box()["y"] for name in
            ("What is wrong with the data", "How they were read", "What was recorded")]  # fmt: skip
    assert tops == sorted(tops)
    # the courses begin with the run in which something is wrong
    page.locator("#recordings-courses").get_by_text("Run r3").wait_for()
    row = page.locator("table.files tr", has_text="r3.csv")
    assert "fault" in row.inner_text()
    assert "fault" not in page.locator("table.files tr", has_text="r2.csv").inner_text()
    page.locator("#recordings-run").click()
    page.get_by_role("option", name="r3").click()
    page.locator("#recordings-courses").get_by_text("T01, T30").first.wait_for()
    page.get_by_role("button", name="Repair: exchange T01 and T30 in r3").first.click()
    page.get_by_role("button", name="Take the repair of r3 back").wait_for()
    assert machine_file(bench.folder / "machine.toml").runs["r3"].swap == (("T01", "T30"),)
    assert not machine_file(folder / "machine.toml").runs
    row.filter(has_not_text="fault").wait_for()
    page.locator("#recordings-faults").get_by_text("as the machine file repairs it").wait_for()
    assert page.locator("#recordings-findings").get_by_text("as the machine file repairs it").count() == 0  # said once
    page.get_by_role("button", name="Take the repair of r3 back").click()
    page.get_by_role("button", name="Repair: exchange T01 and T30 in r3").first.wait_for()
    assert machine_file(bench.folder / "machine.toml").runs == {}


def test_a_file_is_left_out_and_used_again_by_keyboard(page, bench):
    bench.add(*sorted(shipped("vmc37").glob("r*.csv")), machine=shipped("vmc37") / "machine.toml")
    row = page.locator("table.files tr", has_text="r2.csv")
    row.filter(has_text="min").or_(row.filter(has_text=" h")).first.wait_for()
    tick = page.get_by_role("checkbox", name="use r2.csv")
    tick.focus()
    page.keyboard.press("Space")
    row.filter(has_text="left out").wait_for()
    wait_for(lambda: "r2" not in {run.name for run in bench.inspection.reading.runs})
    assert [path.name for path in bench.used] == [one.path.name for one in bench.loaded if one.path.name != "r2.csv"]
    # who works with the keyboard stays where he is
    assert page.evaluate("document.activeElement.getAttribute('aria-label')") == "use r2.csv"
    page.keyboard.press("Space")
    row.filter(has_not_text="left out").wait_for()
    wait_for(lambda: len(bench.used) == len(bench.loaded))


def test_files_of_two_loggers_become_runs_with_a_click(page, bench, tmp_path):
    for k in range(1, 4):
        table = pd.read_csv(shipped("vmc37") / f"r{k}.csv")
        moved = [name for name in table.columns if name.startswith(("Y", "Z"))]
        table.drop(columns=moved).to_csv(tmp_path / f"temperatures{k}.csv", index=False)
        table[[table.columns[0], *moved]].to_csv(tmp_path / f"gauge{k}.csv", index=False)
    bench.add(*sorted(tmp_path.glob("*.csv")))
    page.get_by_role("button", name="Read these pairs as 3 runs").click()
    page.get_by_role("button", name="Take the repair of temperatures1 back").wait_for()
    assert machine_file(bench.folder / "machine.toml").runs["temperatures2"].beside == ("gauge2",)
    assert [run.name for run in bench.inspection.reading.runs] == [f"temperatures{k}" for k in range(1, 4)]
    assert page.locator("table.files tr", has_text="gauge3.csv").get_by_role("cell").nth(2).inner_text() != ""


def test_a_duty_cycle_is_dragged_typed_and_predicted(page, bench):
    tests = Path(__file__).parents[2] / "fixtures" / "dutycycle"
    bench.add(*sorted((tests / "tests").glob("*.csv")), machine=tests / "machine.toml")
    page.locator("#to-prediction").click()
    page.locator("#prediction-cycle .main-svg").first.wait_for()
    api.expect(page.locator("#command")).to_contain_text("selector predict", timeout=PATIENCE_MS)
    steps = page.locator("#prediction-steps")
    for trace, number, by in ((1, 0, (0, -40)), (2, 0, (50, 0))):
        before = steps.input_value()
        x, y = handle(page, trace, number)
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x + by[0], y + by[1], steps=3)
        page.mouse.up()
        api.expect(steps).not_to_have_value(before, timeout=PATIENCE_MS)
        page.wait_for_timeout(1000)  # the picture is drawn again
    first, second = bench.cycle.steps[:2]
    assert first.speed_rpm > 2000
    assert first.minutes > 60
    assert second.minutes == 30
    assert steps.input_value() == "; ".join(f"{m:.6g} at {rpm:.6g}" for m, rpm in bench.cycle.steps)
    steps.fill("60 at 2000; 30 at fast")
    steps.press("Enter")
    page.locator("#notice").get_by_text("“fast” was typed").wait_for()
    steps.fill("60 at 2000; 60 at 1250")
    steps.press("Enter")
    page.locator("#prediction-operations").fill("60,60")
    page.locator("#prediction-tolerance").fill("10")
    page.locator("#prediction-start").click()
    page.locator("#prediction-answer").get_by_role("heading", name="The answer").wait_for()
    assert (bench.folder / "cycle.csv").read_text().splitlines()[1:3] == ["0.0,2000.0", "3600.0,1250.0"]
    assert page.locator("#prediction-answer .main-svg").count() > 0
    blocks = page.locator("#prediction-answer pre", has_text="operation").all_inner_texts()
    # the page may leave the heading of the file to its own
    assert any(
        len(text) > 40 and text.strip() in (bench.folder / "prediction" / "program.txt").read_text() for text in blocks
    )
    # a program for another cycle than that above it is told
    assert page.locator("#prediction-earlier").inner_text() == ""
    steps.fill("60 at 2000; 60 at 1000")
    steps.press("Enter")
    page.locator("#prediction-earlier").get_by_text("made before this changed: cycle.csv").wait_for()


def test_a_machine_is_picked_and_the_pictures_follow_its_parameters(page, bench, monkeypatch):
    read, is_let_go = simulation._parameters, threading.Event()
    monkeypatch.setattr(simulation, "_parameters", lambda asked: is_let_go.wait(60) and read(asked))
    page.locator("#to-simulation").click()
    for kind in ("thermal", "drive", "gauging", "vibration"):
        assert shipped_models(kind)
    page.locator("#simulation-kind").click()
    page.get_by_role("option", name="vibration").click()
    page.locator("#simulation-model").click()
    page.get_by_role("option", name="two-members").click()
    # a file that takes long to read is told
    page.wait_for_function(
        "(({ content, visibility }) => content.includes('Reading') && visibility === 'visible')"
        "(getComputedStyle(document.querySelector('#simulation-pictures'), '::before'))"
    )
    is_let_go.set()
    page.locator("#simulation-pictures .main-svg").first.wait_for()
    said = page.locator("#simulation-pictures .advice").inner_text()
    page.locator("#simulation-parameters summary").first.click()
    mass = page.locator("#simulation-parameters input").first
    value = float(mass.input_value())
    mass.fill("heavy")
    mass.press("Enter")
    page.locator("#notice").get_by_text("“heavy” was typed").wait_for()
    mass.fill(f"{2 * value:g}")
    mass.press("Enter")
    page.wait_for_function(
        "(said) => document.querySelector('#simulation-pictures .advice')?.innerText !== said", arg=said
    )
    # the fields are the same ones: what was unfolded is open, and the next value can be typed at once
    assert mass.is_visible()
    assert mass.evaluate("(field) => field === document.activeElement")
    page.locator("#simulation-start").click()
    page.locator("#simulation-answer").get_by_role("link", name="Recording", exact=True).wait_for()
    assert (bench.folder / "simulated" / "run.csv").is_file()
    assert f"{2 * value:g}" in (bench.folder / "models" / "changed-two-members.toml").read_text()


def test_recordings_are_compared_with_the_machine_of_the_page_simulate(page, bench):
    """A mesh stands beside its model, and both are taken away again."""
    bench.add(shipped("patent8") / "recording.csv")
    shown = next(one for one in shipped_models("thermal") if one.stem == "c-frame")
    (bench.folder / "models").mkdir()
    model = bench.folder / "models" / shown.name
    # without nodes in the middle of edges a machine is made of the mesh in half a second, not in seven
    model.write_text(shown.read_text(encoding="utf-8").replace("order = 2", "order = 1"), encoding="utf-8")
    shutil.copy(shown.with_suffix(".msh"), model.parent)
    assert page.locator("#diagnosis-machine").count() == 0
    bench.choose_simulation(kind="thermal", model=str(model))
    name = next(name for name in simulation._parameters(bench.simulation) if name.startswith("films."))
    value = 2 * simulation._parameters(bench.simulation)[name].value
    bench.choose_simulation(values={name: value})
    page.locator("#to-diagnosis").click()
    page.get_by_role("button", name="Compare with c-frame of the page Simulate").click()
    table = page.locator("#diagnosis-stored table")
    table.get_by_text("the mesh of the model").wait_for()
    table.get_by_text("a model, run by the diagnosis").wait_for()
    api.expect(page.locator("#command")).to_contain_text("--model simulation/c-frame.toml", timeout=PATIENCE_MS)
    taken = simulation._parameters(dataclasses.replace(bench.simulation, model=str(bench.simulated[1])))
    assert [path.name for path in bench.simulated] == ["c-frame.msh", "c-frame.toml"]
    assert taken[name].value == pytest.approx(value, rel=1e-9)  # nine digits are shown
    for left in (1, 0):
        page.get_by_role("button", name="Remove").first.click()
        api.expect(page.get_by_role("button", name="Remove")).to_have_count(left, timeout=PATIENCE_MS)
    assert bench.simulated == ()


def test_neither_a_refusal_nor_the_focus_is_hidden_by_head_or_foot(page):
    """Both stick to the window, and are as many lines high as its width and the command make them."""
    page.get_by_role("button", name="Simulated: a machining centre").click()
    page.get_by_text("The first lines of the file").wait_for()
    page.locator("#to-prediction").click()
    page.locator("#prediction-cycle .main-svg").first.wait_for()
    for width in (1280, 800):
        page.set_viewport_size({"width": width, "height": 700})
        reach(page, "prediction-operations")
        seen = {}
        for _ in range(12):
            page.keyboard.press("Tab")
            page.wait_for_timeout(100)
            seen |= page.evaluate(COVERED)
        assert len(seen) >= 8, width
        assert [name for name, is_covered in seen.items() if is_covered] == [], width
    for width, typed in ((1280, "fast"), (800, "slow")):
        page.set_viewport_size({"width": width, "height": 700})
        steps = page.locator("#prediction-steps")
        steps.fill(f"60 at {typed}")
        steps.press("Enter")
        said = page.locator("#notice").get_by_text(f"“{typed}” was typed")
        said.wait_for()
        page.evaluate("scrollTo(0, document.body.scrollHeight)")
        assert said.evaluate(
            "(it) => { const { left, top } = it.getBoundingClientRect();"
            " return it.contains(document.elementFromPoint(left + 5, top + 5)); }"
        ), width


@pytest.mark.skipif(not AXE.is_file(), reason="axe-core is not there: npm install axe-core, or AXE_CORE names its file")
def test_no_page_has_a_serious_violation_of_accessibility(page, bench):
    page.add_script_tag(path=str(AXE.resolve()))
    found = {}

    def judged(name: str) -> None:
        for width in (1280, 800):
            page.set_viewport_size({"width": width, "height": 900})
            page.wait_for_timeout(1500)
            found[name, width] = page.evaluate(SERIOUS)
            if pictures := os.environ.get("PICTURES"):
                page.screenshot(path=f"{pictures}/{name}-{width}.png", full_page=True)

    judged("empty")
    page.get_by_role("button", name="Simulated: 3 runs, and a simulation").click()
    page.get_by_text("The first lines of the file").wait_for()
    for one in PAGES:
        page.locator(f"#to-{one.ID}").click()
        if one.ID == "sensors":
            page.locator("#sensors-facts dd").first.wait_for()
        judged(one.ID)
    assert {at: violations for at, violations in found.items() if violations} == {}
    assert len(found) == 2 * (1 + len(PAGES))


@pytest.mark.parametrize("example", ["Simulated: a machining centre", "Simulated: 3 runs, and a simulation"])
def test_no_page_is_wider_than_the_window(page, bench, example):
    page.get_by_role("button", name=example).click()
    page.get_by_text("The first lines of the file").wait_for()
    found = {}
    for one in PAGES:
        page.locator(f"#to-{one.ID}").click()
        if one.ID == "sensors":
            page.locator("#sensors-facts dd").first.wait_for()
        for width in (1280, 800):
            page.set_viewport_size({"width": width, "height": 900})
            with contextlib.suppress(api.TimeoutError):  # pictures follow the window when they are drawn again
                page.wait_for_function("document.documentElement.scrollWidth <= innerWidth", timeout=PATIENCE_MS)
            found[one.ID, width] = page.evaluate("document.documentElement.scrollWidth")
    assert {at: wide for at, wide in found.items() if wide > at[1]} == {}
    assert len(found) == 2 * len(PAGES)
