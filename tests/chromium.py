"""One browser for all tests of a folder that a process of the suite runs: its start takes 1.4 s of CPU."""

from __future__ import annotations

import shutil

import pytest

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")


# until the last test of the folder, which is a package for that: tests elsewhere have event loops of their own
@pytest.fixture(scope="package")
def browser():
    """The distribution's Chromium; the test skips where there is none, or no Playwright."""
    api = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")
    if CHROMIUM is None:
        pytest.skip("there is no Chromium on this machine")
    with api.sync_playwright() as playwright:
        opened = playwright.chromium.launch(
            executable_path=CHROMIUM, args=["--no-sandbox", "--disable-gpu-rasterization"]
        )
        yield opened
        opened.close()
