"""The page of a simulation in a browser: every figure is drawn, the field in space too, under the page's own policy."""

from __future__ import annotations

import re
import shutil
import subprocess

import pytest

from selector.telling.page import write_account
from tests.report import predictions

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")


@pytest.mark.skipif(BROWSER is None, reason="no Chromium on this machine")
def test_every_figure_is_drawn_and_nothing_is_refused(tmp_path):
    path = write_account(predictions.field_account(), tmp_path / "page.html")
    run = subprocess.run(
        [
            BROWSER, "--headless", "--no-sandbox", "--use-gl=swiftshader", "--enable-unsafe-swiftshader",
            "--ignore-gpu-blocklist", "--enable-logging=stderr", "--dump-dom",
            f"--user-data-dir={tmp_path / 'profile'}", "--virtual-time-budget=10000", path.as_uri(),
        ],
        capture_output=True, text=True, encoding="utf-8", timeout=300, check=True,
    )  # fmt: skip
    figures = re.findall(r'<div class="plot[^"]*" id="(figure-\d+)"', run.stdout)
    assert len(figures) == 3
    assert run.stdout.count("js-plotly-plot") >= 3
    drawn = re.sub(r"<script.*?</script>", "", run.stdout, flags=re.DOTALL)
    # two scenes in space
    assert drawn.count("<canvas") >= 2
    # the graphics driver of a machine without a screen talks of its speed
    said = [line for line in run.stderr.splitlines() if ":CONSOLE" in line and "ReadPixels" not in line]
    assert not [line for line in said if "willReadFrequently" not in line]
