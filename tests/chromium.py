"""One browser for all tests of a folder that a process of the suite runs: its start takes 1.4 s of CPU.

`time` and `getrusage` leave out what its renderers compute, for which no parent waits: of 36 tests in a browser, busy
machine, they told 134 s of CPU, of 409 s, 259 s of them in renderers. So `make test` takes longer than half of what
they tell; a group of processes (cgroup) counts all. A page of the workbench costs 0.9 s before its test begins, and
what a command costs that is started there: claims of one page are cheaper in one test.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.patience import PATIENCE_S

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


@pytest.fixture(scope="package")
def tab(browser) -> Iterator[Callable[..., Any]]:
    """A new tab of one window, without the cookies of those before: at most one is open, beside an empty one.

    The process of the empty one makes the others, too, and has compiled their scripts before: a page of the workbench
    costs 0.9 s of CPU, in a window of its own 1.6 s. With `bypass_csp` a test may put scripts into a page, which its
    policy forbids to everybody.
    """
    windows: dict[bool, Any] = {}

    def opened(*, bypass_csp: bool = False) -> Any:
        if bypass_csp not in windows:
            windows[bypass_csp] = browser.new_context(bypass_csp=bypass_csp)
            windows[bypass_csp].new_page()
        window = windows[bypass_csp]
        for left in window.pages[1:]:
            left.close()
        window.clear_cookies()
        page = window.new_page()
        page.set_viewport_size({"width": 1280, "height": 900})
        return page

    yield opened
    for window in windows.values():
        window.close()


@pytest.fixture
def shown(tab) -> Callable[[Path], tuple[str, list[str]]]:
    """A file as the browser has it when all of its figures are drawn, and all that its console said."""
    api = pytest.importorskip("playwright.sync_api")

    def opened(path: Path) -> tuple[str, list[str]]:
        page, said = tab(), []
        page.on("console", lambda line: said.append(line.text))
        page.on("pageerror", lambda error: said.append(str(error)))
        page.goto(path.as_uri())
        api.expect(page.locator(".plot:not(:has(.main-svg))")).to_have_count(0, timeout=1000 * PATIENCE_S)
        content = page.content()
        page.close()
        return content, said

    return opened
