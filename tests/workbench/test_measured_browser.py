"""Pages of measured files in a browser: a tap test goes in and joints come out; a day tells its stops."""

from __future__ import annotations

import json
from pathlib import Path

from selector.workbench.bench import Bench
from selector.workbench.commands import prediction_command, taps_command
from selector.workbench.server import started

FIXTURES = Path(__file__).resolve().parents[2] / "fixtures"
PATIENCE_MS = 120_000
"""Far more than any step takes on two busy cores."""


def test_the_commands_say_what_was_asked_and_nothing_else(tmp_path):
    bench = Bench(tmp_path)
    bench.choose_taps(model=str(tmp_path / "models" / "lathe.toml"), point="2=workpiece 3=tool", axis="X")
    assert taps_command(tmp_path, bench.taps, [tmp_path / "tap-tests" / "a.uff"]) == (
        *("taps", "models/lathe.toml", "tap-tests/a.uff", "--point", "2=workpiece", "--point", "3=tool"),
        *("--axis", "X", "--out", "taps"),
    )
    bench.choose_prediction(
        nc="fanuc", invert="Z", order=True, readings=str(tmp_path / "recordings" / "day.csv"), observe=("T1", "T4")
    )
    asked = prediction_command(tmp_path, bench.prediction, [tmp_path / "recordings" / "a.csv"], None, bench.overrides)
    at = asked.index("--order")
    assert asked[at : at + 5] == ("--order", "--nc", "fanuc", "--invert", "Z")
    at = asked.index("--readings")
    assert asked[at : at + 6] == ("--readings", "recordings/day.csv", "--observe", "T1", "--observe", "T4")


def _opened_until(page, place, name):
    """Opens a list again until it offers what is still on its way; what arrives may close an open list."""
    from playwright.sync_api import TimeoutError  # noqa: A004 - its own name

    for patience in range(PATIENCE_MS // 10_000 - 1, -1, -1):
        page.locator(place).click()
        try:
            page.get_by_role("option", name=name).wait_for(timeout=10_000)
            return
        except TimeoutError:
            if not patience:
                raise
            page.keyboard.press("Escape")


def test_a_tap_test_goes_in_and_joints_come_out(tab, tmp_path):
    (tmp_path / "study").mkdir()
    bench = Bench((tmp_path / "study").resolve())
    server = started(bench)
    said: list[str] = []
    try:
        page = tab()
        page.set_default_timeout(PATIENCE_MS)
        page.on("pageerror", lambda error: said.append(str(error)))
        page.goto(server.access.address)
        page.locator("#to-taps").click()
        page.locator("#taps-start").click()
        page.locator("#notice").get_by_text("No taps").wait_for()
        with page.expect_file_chooser() as chooser:
            page.get_by_role("button", name="Choose measured taps …").click()
        chooser.value.set_files([str(FIXTURES / "vibration" / "taps.uff")])
        _opened_until(page, "#taps-files", "taps.uff")
        page.keyboard.press("Escape")
        page.locator("#taps-model").click()
        page.get_by_role("option", name="small-lathe").click()
        page.locator("#taps-point").fill("2=workpiece 3=tool")
        page.locator("#taps-start").click()
        page.locator("#taps-answer").get_by_role("link", name="Fitted model file").wait_for()
        page.frame_locator("#taps-answer iframe").get_by_text("tool").first.wait_for()
        page.close()
    finally:
        server.close()
    assert said == []
    answer = json.loads((bench.folder / "taps" / "taps.json").read_text(encoding="utf-8"))
    assert answer["left_after"] < answer["left_before"]
