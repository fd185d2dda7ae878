"""The workbench as a person, and as a hostile page, meets it: in the distribution's Chromium."""

from __future__ import annotations

import contextlib
import http.server
import json
import threading
import time
from pathlib import Path

import pytest

from selector.shipped import shipped
from selector.workbench.access import MOST_REQUEST_BYTES
from selector.workbench.bench import Bench
from selector.workbench.server import started
from tests.patience import wait_for

api = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")

PATENT, DIAGNOSIS = shipped("patent8"), shipped("diagnosis")
PATIENCE_MS = 120_000
"""Far more than any step takes on two busy cores."""


@pytest.fixture
def study(tmp_path):
    folder = tmp_path / "study"
    folder.mkdir()
    return folder.resolve()


@pytest.fixture
def bench(study):
    return Bench(study)


@pytest.fixture
def served(bench):
    server = started(bench)
    yield server
    server.close()


@pytest.fixture
def page(tab, served):
    """The opened workbench; whatever a script says is wrong fails the test, and so does any dialog."""
    opened = tab()
    opened.set_default_timeout(PATIENCE_MS)
    said: list[str] = []
    opened.on("pageerror", lambda error: said.append(str(error)))
    opened.on("console", lambda line: said.append(line.text) if line.type == "error" else None)
    opened.on("dialog", lambda dialog: (said.append(f"dialog {dialog.message}"), dialog.dismiss()))
    opened.goto(served.access.address)
    opened.get_by_role("button", name="Choose recordings …").wait_for()
    yield opened
    opened.close()
    assert said == []


def send(page, *paths: Path) -> None:
    with page.expect_file_chooser() as chooser:
        page.get_by_role("button", name="Choose recordings …").click()
    chooser.value.set_files([str(path) for path in paths])


def test_from_a_file_to_a_report(page, bench, study, tmp_path):
    text = (PATENT / "recording.csv").read_text(encoding="utf-8").replace("t_min", "t [min]")
    (tmp_path / "warm up.csv").write_text(text, encoding="utf-8")
    send(page, tmp_path / "warm up.csv")
    page.get_by_text("The first lines of the file").wait_for()
    assert page.get_by_role("cell", name="warm up.csv", exact=True).is_visible()
    told = "selector describe 'recordings/warm up.csv'"
    api.expect(page.locator("#command")).to_contain_text(told, timeout=PATIENCE_MS)

    # what was guessed is said where it can be corrected, not by the way of the command line
    page.locator("table.channels .about", has_text="role *").first.wait_for()
    assert page.get_by_text("No machine file says").count() == 0
    # a wrong unit is refused, the right one is written and read
    unit = page.locator("table.channels tr", has_text="T1").first.locator(".unit input")
    unit.fill("furlong")
    page.get_by_role("button", name="Use these corrections").click()
    page.get_by_role("alert").get_by_text("furlong").first.wait_for()
    assert not (study / "machine.toml").exists()
    # what was typed stays, and is refused again
    bench.changed()
    page.locator("#notice > *").wait_for(state="detached")
    page.get_by_role("button", name="Use these corrections").click()
    page.get_by_role("alert").get_by_text("furlong").first.wait_for()
    unit.fill(" degF ")
    page.get_by_role("button", name="Use these corrections").click()
    page.get_by_text("1 file(s) read with it").wait_for()
    assert 'unit = "degF"' in (study / "machine.toml").read_text(encoding="utf-8")
    assert bench.inspection.reading.recording.values("warm up", ["T1"])[0, 0] == pytest.approx((20.4 - 32) / 1.8)

    page.locator("#to-selection").click()
    page.locator("#selection-max_sensors").fill("2")
    page.locator("#selection-max_sensors").press("Enter")
    page.get_by_text("--max-sensors 2").wait_for()
    page.locator("#selection-start").click()
    page.get_by_text("The answer").wait_for()
    frame = page.frame_locator("iframe.sheet")
    frame.get_by_text("the model has not seen").first.wait_for()
    assert frame.locator(".plot svg").count() > 0
    with page.expect_download() as saved:
        page.get_by_role("link", name="Report").click()
    assert saved.value.suggested_filename == "report.html"
    assert Path(saved.value.path()).read_bytes() == (study / "selection" / "report.html").read_bytes()
    asked = json.loads((study / "selection" / "selection.json").read_text(encoding="utf-8"))
    assert len(asked["chosen"]["sensors"]) <= 2


def marks_a_stretch(page, sheet) -> None:
    """What is marked in one picture over time is marked in all of them, with the mouse and with the keyboard."""
    plots = sheet.locator("[aria-label^='Picture over time']")
    plots.first.locator(".main-svg").first.wait_for()
    assert plots.count() >= 2
    plots.first.scroll_into_view_if_needed()
    box = plots.first.bounding_box()
    shapes = "(plots) => plots.map((plot) => plot.layout.shapes.filter((one) => one.layer === 'above').length)"
    page.mouse.move(box["x"] + 0.4 * box["width"], box["y"] + 0.5 * box["height"])
    page.mouse.down()
    page.mouse.move(box["x"] + 0.6 * box["width"], box["y"] + 0.5 * box["height"], steps=4)
    page.mouse.up()
    wait_for(lambda: plots.evaluate_all(shapes) == [1] * plots.count())
    plots.first.focus()
    page.keyboard.press("Escape")
    wait_for(lambda: plots.evaluate_all(shapes) == [0] * plots.count())
    page.keyboard.press("ArrowRight")
    wait_for(lambda: plots.evaluate_all(shapes) == [1] * plots.count())


def test_a_diagnosis_and_an_export(page, bench, study):
    """Simulated runs are sent, compared, and the model that comes out is exported."""
    for run in ("r1", "r2", "r3"):
        bench.add(DIAGNOSIS / f"{run}.csv")
    page.locator("#to-diagnosis").click()
    with page.expect_file_chooser() as chooser:
        page.get_by_role("button", name="Choose simulated runs …").click()
    chooser.value.set_files([str(path) for path in sorted((DIAGNOSIS / "sim").glob("*.csv"))])
    page.get_by_role("button", name="Remove").nth(2).wait_for()
    page.get_by_text("--simulation simulation").wait_for()
    page.locator("#page-diagnosis").get_by_role("button", name="Start").click()
    page.locator("#page-diagnosis").get_by_text("memory of past heating").first.wait_for()
    sheet = page.frame_locator("#page-diagnosis iframe.sheet")
    sheet.get_by_role("cell", name="Z").first.wait_for()
    marks_a_stretch(page, sheet)

    # how a command ended stands on its own page, not below all others
    api.expect(page.locator("#status")).to_have_text("Diagnosis: done.", timeout=PATIENCE_MS)
    page.locator("#to-export").click()
    api.expect(page.locator("#status")).to_have_text("Ready.", timeout=PATIENCE_MS)
    page.get_by_text("export diagnosis/model.json --for c").wait_for()
    # all are replayed, unless others are chosen
    api.expect(page.locator("#command")).to_contain_text("r3.csv", timeout=PATIENCE_MS)
    page.locator("#export-replayed").click()
    for name in ("r1.csv", "r3.csv"):
        page.get_by_role("option", name=name).click()
    api.expect(page.locator("#command")).not_to_contain_text("r3.csv", timeout=PATIENCE_MS)
    page.keyboard.press("Escape")
    limits = page.locator("#export-outputs input.dash-input-element")
    limits.nth(0).fill("45,5")
    limits.nth(0).press("Enter")
    page.get_by_text("Z=45.5").wait_for()
    limits.nth(1).fill("fast")
    limits.nth(1).press("Enter")
    page.locator("#notice").get_by_text("fastest change of Z").wait_for()
    page.locator("#export-outputs input[type=checkbox]").first.click()
    page.get_by_text("--invert").wait_for()
    page.locator("#export-margin").fill("12,5 %")
    page.locator("#export-margin").press("Enter")
    api.expect(page.locator("#command")).to_contain_text("--margin 12.5", timeout=PATIENCE_MS)
    # what is replayed is a file, not a place in the list: another list keeps it
    bench.use([DIAGNOSIS / "r2.csv", DIAGNOSIS / "r3.csv"])
    page.get_by_text("The sign test was passed").click()
    page.get_by_text("--sign-verified").wait_for()
    assert bench.export.replayed == (DIAGNOSIS / "r2.csv",)
    assert bench.export.slew_um_per_s == {}
    # what was refused stays, and nothing is exported with what counted before
    export = page.get_by_role("button", name="Export")
    export.click()
    page.locator("#notice").get_by_text("“fast” was typed").wait_for()
    limits.nth(1).fill("fifty")
    export.click()
    page.locator("#notice").get_by_text("“fifty” was typed").wait_for()
    page.wait_for_timeout(1000)  # longer than the page waits until it looks at the bench again
    assert page.locator("#notice").get_by_text("fastest change of Z").is_visible()
    assert limits.nth(1).input_value() == "fifty"
    assert [job.title for job in bench.jobs.all] == ["Diagnosis"]
    limits.nth(1).fill("0,5 µm/s")
    export.click()
    page.get_by_role("heading", name="Files in export-c").wait_for()
    page.locator("summary", has_text="thermal_correction.c").click()
    program = (study / "export-c" / "thermal_correction.c").read_text(encoding="utf-8")
    assert page.locator("#page-export pre", has_text="#include").first.inner_text().strip() == program.strip()
    sheet = page.frame_locator("#page-export iframe")
    sheet.get_by_text("Sign test").first.wait_for()
    assert bench.jobs.all[-1].command[-2:] == ("--sign-verified", "--json")
    page.get_by_text("it differs from the model by at most").wait_for()
    assert {"Z=0.5", "--margin"} <= {*bench.jobs.all[-1].command}


def test_what_is_typed_counts_or_is_refused_in_the_words_of_the_field(page, bench):
    bench.add(PATENT / "recording.csv")
    page.locator("#to-selection").click()
    level, most = page.locator("#selection-level"), page.locator("#selection-max_sensors")
    target = page.locator("#selection-target")

    def typed(box, text):
        box.fill(text)
        box.press("Enter")

    typed(level, "0,98")
    page.get_by_text("--lambda 0.98 ").wait_for()
    for box, counts, text, said in (
        (level, "0.98", "98", "“98”"),
        (level, "0.98", "fine", "“fine”"),
        (most, "5", "many", "“many”"),
        (most, "5", "0", "a whole number of at least 1"),
    ):
        typed(box, text)
        page.locator("#notice").get_by_text(said).wait_for()
        assert "--" not in page.locator("#notice").inner_text()
        # a change elsewhere does not take away what was typed
        bench.changed()
        page.wait_for_timeout(900)
        assert box.input_value() == text
        typed(box, text + " ")
        page.locator("#notice").get_by_text("was typed").or_(page.locator("#notice").get_by_text(said)).first.wait_for()
        # what counts already changes nothing, and what was refused is no longer told
        typed(box, counts)
        page.locator("#notice > *").first.wait_for(state="detached")
    assert (bench.options.level, bench.options.max_sensors) == (0.98, 5)
    # several λ ask for as many rounds, and give them back
    rounds = page.locator("#selection-rounds")
    typed(level, "0,99, 0,95")
    api.expect(rounds).to_have_value("2", timeout=PATIENCE_MS)
    assert bench.options.rounds == 2
    typed(level, "0,98")
    api.expect(rounds).to_have_value("1", timeout=PATIENCE_MS)
    assert bench.options.rounds == 1
    # an empty field is what counts when nothing is said
    typed(level, "")
    api.expect(level).to_have_value("auto", timeout=PATIENCE_MS)
    assert bench.options.level is None
    start = page.locator("#selection-start")
    typed(target, "2,5")
    page.get_by_text("--target 2.5").wait_for()
    typed(target, "-1")
    page.locator("#notice").get_by_text("“-1” was typed").wait_for()
    start.click()
    page.wait_for_timeout(900)
    assert page.locator("#notice").get_by_text("“-1” was typed").is_visible()
    assert page.locator("#notice").bounding_box()["y"] >= 0
    assert target.input_value() == "-1"
    assert bench.jobs.all == ()
    # typing that ends with the click
    target.fill("3")
    most.fill("drei")
    start.click()
    page.locator("#notice").get_by_text("“drei”").wait_for()
    assert bench.jobs.all == ()
    most.fill("2")
    start.click()
    page.get_by_text("The answer").wait_for()
    command = " ".join(bench.jobs.all[0].command)
    assert "--max-sensors 2" in command
    assert "--target 3.0 " in command


def test_what_was_typed_last_counts_also_where_the_server_is_slow_with_what_was_typed_before(page, bench, monkeypatch):
    bench.add(PATENT / "recording.csv")
    page.locator("#to-selection").click()
    choose, takes = bench.choose, []

    def slowly(**changes):
        takes.append(changes["level"])
        if len(takes) == 1:
            time.sleep(2.0)
        return choose(**changes)

    monkeypatch.setattr(bench, "choose", slowly)
    for name, text in (("max_sensors", "4"), ("level", "0.97")):
        box = page.locator(f"#selection-{name}")
        box.fill(text)
        box.press("Enter")
    page.get_by_text("--lambda 0.97 ").wait_for()
    page.wait_for_timeout(1_000)
    assert takes[:2] == [None, 0.97]
    assert (bench.options.level, bench.options.max_sensors) == (0.97, 4)
    assert page.locator("#selection-level").input_value() == "0.97"


def test_a_wrong_file_says_why_and_the_others_stay_and_one_that_is_dropped_joins_them(page, bench, study, tmp_path):
    (tmp_path / "photo.csv").write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(range(256)) * 50)
    (tmp_path / "empty.csv").write_bytes(b"")
    send(page, PATENT / "recording.csv", tmp_path / "photo.csv", tmp_path / "empty.csv")
    page.get_by_role("alert").nth(1).wait_for()
    assert page.get_by_role("alert").count() == 2
    assert "What to do" in page.get_by_role("alert").first.inner_text()
    page.get_by_text("The first lines of the file").wait_for()
    assert [run.name for run in bench.inspection.reading.runs] == ["recording"]
    # another is tried again: that one was refused is said of it all the same
    page.get_by_role("checkbox", name="use empty.csv").check()
    wait_for(lambda: not bench.is_reading)
    page.locator("tr", has_text="photo.csv").get_by_text("cannot be read").wait_for()
    # the page may still show the one that is being tried
    api.expect(page.get_by_text("cannot be read, see below")).to_have_count(2, timeout=PATIENCE_MS)
    for left, name in ((1, "photo.csv"), (0, "empty.csv")):
        page.locator("tr", has_text=name).get_by_role("button", name="Remove").click()
        wait_for((study / "removed" / name).exists)
        assert not (study / "recordings" / name).exists()
        api.expect(page.get_by_role("alert")).to_have_count(left, timeout=PATIENCE_MS)
        # whoever uses the keyboard goes on in the table
        api.expect(page.locator("table.files input:focus")).to_have_count(1, timeout=PATIENCE_MS)
    assert page.get_by_role("button", name="Remove").count() == 0
    assert [one.path.name for one in bench.loaded] == ["recording.csv"]

    # one that is dropped beside the zone is not taken
    held = page.evaluate_handle(
        """text => {
          const held = new DataTransfer();
          held.items.add(new File([text], "día 1.csv"));
          return held;
        }""",
        (PATENT / "recording.csv").read_text(encoding="utf-8"),
    )
    drop = "{bubbles: true, cancelable: true, dataTransfer: held}"
    at = f"([zone, held]) => zone.dispatchEvent(new DragEvent('drop', {drop}))"
    # true would mean that the browser goes on to show the file in place of the page
    assert page.evaluate(at, [page.locator("h1").first.element_handle(), held]) is False
    zone = page.locator("#page-recordings .drop")
    zone.dispatch_event("dragover", {"dataTransfer": held})
    page.locator("#page-recordings .drop.over").wait_for()
    zone.dispatch_event("drop", {"dataTransfer": held})
    page.get_by_role("cell", name="día 1.csv", exact=True).wait_for()
    assert page.locator(".drop.over").count() == 0
    assert (study / "recordings" / "día 1.csv").read_bytes() == (PATENT / "recording.csv").read_bytes()


def test_a_page_at_rest_asks_for_the_beat_alone_and_hears_of_a_change(page, bench):
    """Dash goes through the whole page at whatever is set in it: a fifth of a processor at every beat."""
    asked = []
    page.on("request", lambda one: asked.append(one.url.rpartition("/")[2]))
    for _ in range(100):  # until what the first look has set off is over
        asked.clear()
        for _ in range(3):
            with page.expect_request("**/beat"):
                pass
        if set(asked) == {"beat"}:
            break
    assert set(asked) == {"beat"}
    with page.expect_request("**/_dash-update-component*"):
        bench.changed()


def test_a_workbench_that_was_ended_says_so_where_it_said_what_it_does(tab, served, bench):
    bench.choose_simulation(kind="thermal", model=next(iter(bench.models("thermal"))))
    page = tab()
    page.goto(served.access.address + "#simulation")
    api.expect(page.locator("#command")).to_contain_text("simulate thermal", timeout=PATIENCE_MS)
    status = page.locator("#status")
    api.expect(status).to_have_text("Ready.", timeout=PATIENCE_MS)
    page.route("**/beat", lambda asked: asked.fulfill(status=403, body="another token"))
    status.get_by_text("was started anew").wait_for(timeout=PATIENCE_MS)
    page.unroute("**/beat")
    api.expect(status).to_have_text("Ready.", timeout=PATIENCE_MS)
    served.close()
    status.get_by_text("does not answer").wait_for(timeout=PATIENCE_MS)
    # nor does the command of the page before stand there as that of this one
    page.locator("#to-export").click()
    page.locator("#by-hand").wait_for(state="hidden", timeout=PATIENCE_MS)
    page.close()


def test_names_are_text(page, bench, tmp_path):
    bad = [
        "<img src=x onerror=alert(1)>", "=cmd|' /C calc'!A0", "<script>alert(2)</script>", "+1", "**T**",
        "T[x](javascript:1)",
    ]  # fmt: skip
    values = [[f"{20 + k * (j + 1) / 90:.3f}" for j in range(len(bad))] for k in range(60)]
    rows = "".join(",".join([str(k), *row]) + "\n" for k, row in enumerate(values))
    file = tmp_path / "<img src=x onerror=alert(3)>.csv"
    file.write_text(",".join(["time_s", *bad]) + "\n" + rows, encoding="utf-8")
    send(page, file)
    page.get_by_text("The first lines of the file").wait_for()
    assert page.get_by_text(bad[0]).first.is_visible()
    assert page.get_by_text(bad[1]).first.is_visible()
    assert page.locator("img").count() == 0
    assert page.locator("main script").count() == 0
    assert page.locator("main a[href^=javascript]").count() == 0
    page.wait_for_timeout(300)  # a dialog would have come by now; the fixture asserts that none did


def test_a_file_that_is_larger_than_any_other_request_may_be(page, bench, study, tmp_path):
    line = "," + ",".join(f"{20 + k / 7:.4f}" for k in range(20)) + "\n"
    with (tmp_path / "large.csv").open("w", encoding="utf-8") as file:
        file.write("time_s," + ",".join(f"T{k}" for k in range(20)) + "\n")
        count = 0
        while file.tell() < 1.2 * MOST_REQUEST_BYTES:
            file.write("".join(f"{count + k}{line}" for k in range(5000)))
            count += 5000
    send(page, tmp_path / "large.csv")
    page.get_by_text("The first lines of the file").wait_for()
    assert bench.inspection.reading.runs[0].rows == count
    # the page still answers
    page.locator("#to-selection").click()
    page.locator("#selection-start").wait_for()


def test_without_the_token_there_is_a_sentence_and_nothing_else(tab, served):
    opened = tab()
    answer = opened.goto(f"http://127.0.0.1:{served.access.port}/")
    assert answer.status == 403
    assert "token" in opened.inner_text("body")


def test_a_foreign_page_cannot_use_the_cookie(page, served, study, tmp_path):
    """Another server at 127.0.0.1 is the same site for a browser: the cookie is sent, and must not be enough."""
    own = f"http://127.0.0.1:{served.access.port}"
    (tmp_path / "index.html").write_text(
        f"<iframe src='{own}/'></iframe><img src='{own}/results/machine.toml'><script>\n"
        f"fetch('{own}/upload/recordings?name=evil.csv', {{method: 'POST', mode: 'no-cors', credentials: 'include',"
        " body: 't,T1\\n0,20\\n'}).then(() => { document.title = 'sent'; }, () => { document.title = 'sent'; });\n"
        "</script>",
        encoding="utf-8",
    )
    with foreign_server(tmp_path) as address:
        other = page.context.new_page()
        outcomes = []
        other.on("response", lambda answer: outcomes.append(answer.status) if answer.url.startswith(own) else None)
        other.on("requestfailed", lambda asked: outcomes.append("kept from the page"))
        other.goto(address)
        other.wait_for_function("document.title === 'sent'")
        other.wait_for_load_state("networkidle")
        assert len(outcomes) >= 3
        assert set(outcomes) <= {403, "kept from the page"}
        assert 403 in outcomes
    assert not (study / "recordings").exists()


def test_an_empty_workbench_by_keyboard_and_a_running_command_is_cancelled(page, bench, study):
    # pages are made when they are shown: what nobody looks at costs nothing
    assert page.locator("main > div:not(:empty)").count() == 1
    page.locator("#to-selection").focus()
    page.keyboard.press("Enter")
    page.get_by_role("heading", name="Selection of sensors").wait_for()
    for _ in range(30):
        page.keyboard.press("Tab")
        if page.evaluate("document.activeElement.id") == "selection-start":
            break
    assert page.evaluate("document.activeElement.id") == "selection-start"
    page.keyboard.press("Enter")
    page.get_by_text("Expected: recordings that can be read").wait_for()

    bench.start("Long work", ("prove", "--jobs", "1", "--out", "proof"), study / "proof")
    page.get_by_role("button", name="Cancel").click()
    page.get_by_text("Long work: cancelled").wait_for()
    assert bench.jobs.all[0].state == "cancelled"


@contextlib.contextmanager
def foreign_server(folder: Path):
    """Another web server on this computer, with the files of a folder."""

    class Quiet(http.server.SimpleHTTPRequestHandler):
        def __init__(self, *arguments, **options):
            super().__init__(*arguments, directory=str(folder), **options)

        def log_message(self, *_):
            return

    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Quiet)
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_port}/index.html"
    finally:
        server.shutdown()
        thread.join()
        server.server_close()
