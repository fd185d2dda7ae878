"""The Ball-bar page: files in, polar plot and causes out; what is missing or refused is said."""

from __future__ import annotations

import json

from selector.workbench.bench import Bench
from selector.workbench.commands import ball_bar_command
from selector.workbench.server import started
from tests.physics.drive.planted_circles import PlantedCircles

PATIENCE_MS = 120_000
"""Far more than any step takes on two busy cores."""


def test_the_command_says_what_was_asked_and_nothing_else(tmp_path):
    bench = Bench(tmp_path)
    files = [tmp_path / "circles" / "a.csv"]
    assert ball_bar_command(tmp_path, bench.ball_bar, files) == ("ballbar", "circles/a.csv", "--out", "ballbar")
    bench.choose_ball_bar(radius=100.0, lead="X=10 Y=5", reset_time="X=20")
    words = (
        "ballbar",
        "circles/a.csv",
        "--radius",
        "100.0",
        "--lead",
        "X=10",
        "--lead",
        "Y=5",
        "--reset-time",
        "X=20",
        "--out",
        "ballbar",
    )
    assert ball_bar_command(tmp_path, bench.ball_bar, files) == words


def test_a_measured_file_goes_in_and_its_causes_come_out(tab, tmp_path):
    (tmp_path / "study").mkdir()
    bench = Bench((tmp_path / "study").resolve())
    file = PlantedCircles(5).write(tmp_path / "test of may.txt")
    server = started(bench)
    said: list[str] = []
    try:
        page = tab()
        page.set_default_timeout(PATIENCE_MS)
        page.on("pageerror", lambda error: said.append(str(error)))
        page.goto(server.access.address)
        page.locator("#to-ballbar").click()
        page.locator("#ballbar-start").click()
        page.locator("#notice").get_by_text("No circles").wait_for()
        with page.expect_file_chooser() as chooser:
            page.get_by_role("button", name="Choose measured circles …").click()
        stranger = tmp_path / "another.txt"
        stranger.write_text("nothing measured", encoding="utf-8")
        chooser.value.set_files([str(file), str(stranger)])
        # what is there is seen, and can be taken away
        stored = page.locator("#ballbar-stored table")
        stored.get_by_text("test of may.txt").wait_for()
        stored.locator("tr", has_text="another.txt").get_by_role("button", name="Remove").click()
        stored.get_by_text("another.txt").wait_for(state="detached")
        assert [one.name for one in (bench.folder / "circles").iterdir()] == ["test of may.txt"]
        page.locator("#command").get_by_text("circles/test of may.txt").wait_for()
        page.locator("#ballbar-radius").fill("thin")
        page.locator("#ballbar-start").click()
        page.locator("#notice").get_by_text("“thin” was typed").wait_for()
        page.locator("#ballbar-radius").fill("")
        page.locator("#ballbar-lead").fill("X=10 Y=10")
        page.locator("#ballbar-start").click()
        page.locator("#ballbar-answer").get_by_role("link", name="Report", exact=True).wait_for()
        frame = page.frame_locator("#ballbar-answer iframe")
        frame.locator(".polar").first.wait_for()
        frame.get_by_text("Through all feeds").first.wait_for()
        page.close()
    finally:
        server.close()
    assert said == []
    answer = json.loads((bench.folder / "ballbar" / "ballbar.json").read_text(encoding="utf-8"))
    assert answer["causes"]["through_feeds"]["squareness"]["found"]
