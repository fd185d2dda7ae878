"""The Sensors page as a person meets it: keyboard, click on a point, a pin that is dragged."""

from __future__ import annotations

import pytest

from selector.readers import machine as machine_file
from selector.workbench.bench import Bench
from selector.workbench.server import started
from tests.workbench import studies

api = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")

PATIENCE_MS = 300_000
"""The first search may have to be compiled."""

POINT = """([name, trace, number, axis]) => {
  const graph = document.querySelector(`#sensors-${name} .js-plotly-plot`);
  const box = graph.getBoundingClientRect();
  const [x, y] = [graph._fullLayout[axis], graph._fullLayout.yaxis];
  const points = graph._fullData[trace];
  return [box.left + x._offset + x.d2p(points.x[number]), box.top + y._offset + y.d2p(points.y[number])];
}"""
ANSWERED = """async (asked) => {
  const headers = { "Content-Type": "application/json" };
  const answer = await fetch("/sensors/move", { method: "POST", headers, body: JSON.stringify(asked) });
  window.dash_clientside.sensors.show(await answer.json());
}"""
HAS_PLACE = "(text) => [...document.querySelectorAll('#sensors-wishes .place input')].some((one) => one.value === text)"
VALUES = "([name, trace]) => Array.from(document.querySelector(`#sensors-${name} .js-plotly-plot`).data[trace].x)"
TOLD = """fetch("/sensors/move", {method: "POST", headers: {"Content-Type": "application/json"}, body: "{}"})
  .then((answer) => answer.json())"""
#: How many names stand in each of the two views of the machine.
N_NAMED = "document.querySelectorAll('#sensors-machine .textpoint text').length / 2"
N_SHOWN = "document.querySelector('#sensors-facts dd').textContent.split(',').length"


@pytest.fixture
def bench(tmp_path):
    recordings = tmp_path / "recordings"
    recordings.mkdir()
    folder = tmp_path / "study"
    folder.mkdir()
    files = studies.written(recordings)
    return Bench(folder.resolve(), files, recordings / "machine.toml")


@pytest.fixture
def page(tab, bench):
    server = started(bench)
    said: list[str] = []
    opened = tab()
    opened.set_default_timeout(PATIENCE_MS)
    opened.on("pageerror", lambda error: said.append(str(error)))
    opened.on("console", lambda line: said.append(line.text) if line.type == "error" else None)
    opened.goto(server.access.address)
    opened.locator("#to-sensors").click()
    opened.locator("#sensors-facts dd").first.wait_for()
    for name in ("tree", "machine", "sets", "runs"):
        opened.locator(f"#sensors-{name} .main-svg").first.wait_for()
    yield opened
    opened.close()
    server.close()
    assert said == []


def point(page, name, trace, number, axis="xaxis"):
    page.locator(f"#sensors-{name}").scroll_into_view_if_needed()
    before = None
    while (now := page.evaluate(POINT, [name, trace, number, axis])) != before:
        before = now
        page.wait_for_timeout(300)
    return now


def test_the_keyboard_moves_groups_errors_and_command_together(page, bench):
    def shown():
        return {
            "groups": page.locator("#sensors-groups tbody tr").count(),
            "set": page.locator("#sensors-facts dd").first.inner_text(),
            "errors": page.evaluate(VALUES, ["runs", 1]),
            "command": page.locator("#command").inner_text(),
        }

    page.get_by_text("--lambda").wait_for()
    page.locator("#sensors-slider").focus()
    page.keyboard.press("Home")
    page.locator("#sensors-groups tbody tr").first.wait_for()
    page.get_by_text("1 group", exact=True).wait_for()
    page.wait_for_function(N_SHOWN + " === 1")
    coarse = shown()
    page.keyboard.press("End")
    page.get_by_text("7 groups", exact=True).wait_for()
    page.wait_for_function(N_SHOWN + " > 1")
    page.locator("#command").get_by_text("--lambda 1.0").wait_for()
    page.wait_for_function(f"{N_NAMED} === {N_SHOWN}")
    fine = shown()
    assert (coarse["groups"], fine["groups"]) == (1, 7)
    assert coarse["errors"] != fine["errors"]
    assert coarse["command"] != fine["command"]
    assert "--lambda 1.0" in fine["command"]

    page.locator("#sensors-level").fill("0.9")
    page.locator("#sensors-level").press("Enter")
    page.get_by_text("--lambda 0.9 ").wait_for()
    assert page.locator("#sensors-slider").input_value() not in ("0", "6")

    # the command that is shown is that of the page, also after the slider has written it
    page.locator("#to-recordings").click()
    page.locator("#command").get_by_text("describe").wait_for()
    page.locator("#to-sensors").click()
    page.get_by_text("--lambda 0.9 ").wait_for()

    page.locator("#sensors-level").fill("7")
    page.locator("#sensors-level").press("Enter")
    page.locator("#notice").get_by_text("“7” was typed. Expected: a number from 0 to 1").wait_for()
    # it stays, and nothing is started with the λ that counted before
    assert page.locator("#sensors-level").input_value() == "7"
    page.get_by_role("button", name="Run this selection").click()
    page.wait_for_timeout(1000)
    assert page.locator("#notice").get_by_text("“7” was typed").is_visible()
    assert bench.jobs.all == ()
    page.locator("#sensors-level").fill("0,95")
    page.locator("#sensors-level").press("Enter")
    page.get_by_text("--lambda 0.95 ").wait_for()
    page.get_by_text("of linear models without memory").wait_for()


def test_a_dial_stands_where_it_was_moved_to_though_the_page_was_drawn_anew_meanwhile(page):
    held = []
    # one dial takes the other with it: the second goes to the other end
    for dial, key, end in (("slider", "Home", "min"), ("count", "End", "max")):
        told = page.evaluate(TOLD)
        page.route("**/sensors/move", lambda route: held.append(route))
        moved = page.locator(f"#sensors-{dial}")
        moved.focus()
        with page.expect_request("**/sensors/move"):
            page.keyboard.press(key)
        # with what was before the move, which the server has not answered yet
        page.evaluate("(told) => window.dash_clientside.sensors.show(told)", told)
        last = moved.get_attribute(end)
        assert moved.input_value() != last
        held.pop().continue_()
        api.expect(moved).to_have_value(last, timeout=PATIENCE_MS)
        page.unroute("**/sensors/move")


def test_a_click_on_a_point_takes_its_set_and_typing_is_left_alone(page):
    x, y = point(page, "sets", 1, 1)
    # a hand comes from somewhere: Plotly looks for points under it while it moves
    page.mouse.move(x - 20, y - 5)
    page.mouse.move(x, y, steps=3)
    page.wait_for_timeout(300)
    page.mouse.click(x, y)
    page.get_by_text("taken by hand").wait_for()
    names = page.locator("#sensors-facts dd").first.inner_text().split(", ")
    assert len(names) == 2
    page.locator("#command").get_by_text(f"--max-sensors 2 --must {names[0]} --must {names[1]}").wait_for()
    page.get_by_role("button", name="Back to the set of λ").click()
    page.get_by_text("--lambda").wait_for()

    # an answer that comes while somebody types leaves the typing alone
    page.locator("#sensors-level").fill("7")
    page.evaluate(ANSWERED, {"step": 1})
    assert page.locator("#sensors-level").input_value() == "7"
    page.locator("#sensors-level").press("Enter")
    page.locator("#notice").get_by_text("“7” was typed").wait_for()
    page.locator("#to-recordings").click()
    page.locator("#notice").get_by_text("“7” was typed").wait_for(state="detached")


def test_a_pin_is_dragged_into_the_machine_file(page, bench):
    x, y = point(page, "machine", 0, 2)
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 30, y - 40, steps=4)
    page.wait_for_timeout(200)
    page.mouse.up()
    path = bench.folder / "machine.toml"
    for _ in range(PATIENCE_MS // 50):
        if path.exists():
            break
        page.wait_for_timeout(50)
    found = machine_file(path).channels["T3"].xyz
    before = studies.PLACES_M["T3"]
    assert found[0] > before[0]
    assert found[1] == pytest.approx(before[1])
    assert found[2] > before[2]
    page.get_by_text("Must, never, cost and place").click()
    page.locator("#sensors-wishes tr", has_text="T3").locator(".place input").wait_for()
    text = f"{found[0]:g}, {found[1]:g}, {found[2]:g}"
    page.wait_for_function(HAS_PLACE, arg=text)


#: The lowest edge of the head, the dial that sticks below it, the right edges of nine tabs and that of their row.
STUCK = """() => {
  const box = (one) => document.querySelector(one).getBoundingClientRect();
  const row = box("#workbench header nav").right;
  const tabs = [...document.querySelectorAll("#workbench header .tab")].map((one) => one.getBoundingClientRect().right);
  return [box("#workbench header").bottom, box(".lambda input").top, Math.max(...tabs), row];
}"""


def test_the_head_of_the_page_hides_no_dial_that_sticks_below_it(page, bench):
    assert len(str(bench.folder)) > 60  # a folder so long as to push the tabs, where it may
    for width in (1280, 800, 400):
        page.set_viewport_size({"width": width, "height": 900})
        page.evaluate("window.scrollTo(0, 900)")
        page.wait_for_timeout(300)
        head, dial, tabs, row = page.evaluate(STUCK)
        assert head <= dial, width
        assert tabs <= row or width < 800
