"""Make the picture of docs/how-to/use-the-workbench.md: `python docs/images/make_workbench_picture.py`.

The page is that of a study of two runs of fixtures/vmc37 with the machine file of that folder.
"""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path

from make_pictures import ROOT
from playwright.sync_api import sync_playwright

from selector.workbench.bench import Bench
from selector.workbench.server import started

PICTURE = Path(__file__).with_name("workbench.png")
WIDTH_PX, HEIGHT_PX = 1280, 860


def photograph() -> None:
    """The page of recordings, as the browser shows it."""
    with tempfile.TemporaryDirectory() as place, sync_playwright() as playwright:
        # the name of the folder is in the picture
        folder = Path(place) / "selector-study"
        (folder / "recordings").mkdir(parents=True)
        for name in ("r1.csv", "r2.csv"):
            shutil.copy(ROOT / "fixtures" / "vmc37" / name, folder / "recordings")
        shutil.copy(ROOT / "fixtures" / "vmc37" / "machine.toml", folder)
        server = started(Bench(folder.resolve()))
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": WIDTH_PX, "height": HEIGHT_PX})
        page.goto(server.access.address)
        page.get_by_text("The first lines of the file").wait_for()
        page.evaluate("document.querySelector('header .folder code').textContent = 'selector-study'")
        page.screenshot(path=PICTURE)
        browser.close()
        server.close()


if __name__ == "__main__":
    photograph()
    print(f"wrote {PICTURE.relative_to(ROOT)}")
