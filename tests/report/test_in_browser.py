"""The report in a browser: every figure is drawn, under its own security policy, without a word on the console."""

from __future__ import annotations

import re
import shutil
import subprocess

import pytest

from selector.report import write_report
from tests.report import studies

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")


@pytest.mark.skipif(BROWSER is None, reason="no Chromium on this machine")
def test_every_figure_is_drawn_and_the_console_is_silent(tmp_path):
    path = write_report(studies.small(), tmp_path / "report.html", title="Study")
    run = subprocess.run(
        [
            BROWSER, "--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr", "--dump-dom",
            f"--user-data-dir={tmp_path / 'profile'}", "--virtual-time-budget=10000", path.as_uri(),
        ],
        capture_output=True, text=True, encoding="utf-8", timeout=120, check=True,
    )  # fmt: skip
    figures = re.findall(r'<div class="plot[^"]*" id="(figure-\d+)"', run.stdout)
    assert len(figures) > 8
    # Plotly lays several drawings over each other, the first of a figure is the one with the plot
    assert run.stdout.count('class="main-svg"') >= len(figures)
    assert run.stdout.count("js-plotly-plot") >= len(figures)
    said = [line for line in run.stderr.splitlines() if ":CONSOLE" in line]
    assert not said
