"""Make the picture of the README: `python docs/images/make_pictures.py` (needs Chromium).

It is the first page of the report of a study on the real spindle of fixtures/spindle46.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from selector.cli import exit_status

ROOT = Path(__file__).resolve().parents[2]
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome", "msedge")
WIDTH_PX, HEIGHT_PX = 1180, 860


def report() -> str:
    """The report of the study that `selector demo` begins with."""
    spindle = ROOT / "fixtures" / "spindle46"
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder, "study")
        asked = ["--response", "Y1", "--memory", "--out", out]
        given = [spindle / "tests.parquet", "--machine", spindle / "machine.toml", *asked]
        if exit_status(["select", *map(str, given)]) != 0:
            sys.exit("the study failed; its message stands above")
        return (out / "report.html").read_text(encoding="utf-8")


def photograph(page: str, target: Path, *, width_px: int = WIDTH_PX, height_px: int = HEIGHT_PX) -> None:
    """The top of a page as PNG, by a headless browser that touches no profile of the user."""
    browser = next((path for name in BROWSERS if (path := shutil.which(name))), None)
    if browser is None:
        sys.exit("No Chromium found; install it, or set PATH so that one of these is found: " + ", ".join(BROWSERS))
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "page.html"
        source.write_text(page, encoding="utf-8")
        subprocess.run(  # noqa: S603 (a browser found on PATH, and arguments of our own)
            [
                browser, "--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars",
                "--force-device-scale-factor=1.5", f"--user-data-dir={Path(folder) / 'profile'}",
                "--virtual-time-budget=8000", f"--window-size={width_px},{height_px}", f"--screenshot={target}",
                source.as_uri(),
            ],
            check=True, timeout=300, capture_output=True,
        )  # fmt: skip


if __name__ == "__main__":
    picture = Path(__file__).with_name("first-picture.png")
    photograph(report(), picture, width_px=1080, height_px=1150)
    print(f"wrote {picture.relative_to(ROOT)}")
