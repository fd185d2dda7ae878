"""The pages of feed drives in a browser: every figure is drawn, polar ones too, under the page's own policy."""

from __future__ import annotations

import re
import subprocess

import pytest

from selector.telling.page import write_account
from selector.telling.simulated import account_of
from tests.report import drives
from tests.report.test_thermal_in_browser import BROWSER


@pytest.mark.skipif(BROWSER is None, reason="no Chromium on this machine")
@pytest.mark.parametrize(("kind", "figures"), [("state", 3), ("circle", 4)])
def test_every_figure_is_drawn_and_nothing_is_refused(kind, figures, tmp_path):
    path = write_account(account_of(drives.page(kind), drawn=True), tmp_path / "page.html")
    run = subprocess.run(
        [
            BROWSER, "--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr", "--dump-dom",
            f"--user-data-dir={tmp_path / 'profile'}", "--virtual-time-budget=10000", path.as_uri(),
        ],
        capture_output=True, text=True, encoding="utf-8", timeout=300, check=True,
    )  # fmt: skip
    assert len(re.findall(r'<div class="plot[^"]*" id="(figure-\d+)"', run.stdout)) == figures
    drawn = re.sub(r"<script.*?</script>", "", run.stdout, flags=re.DOTALL)
    assert len(re.findall(r'<svg class="main-svg"', drawn)) >= figures
    assert ("polarlayer" in drawn and 'class="polar"' in drawn) == (kind == "circle")
    assert not [line for line in run.stderr.splitlines() if ":CONSOLE" in line]
