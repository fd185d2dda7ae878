"""Make the pictures of the documentation: `python docs/images/make_pictures.py` (needs Chromium).

The figures are those of the report; the recording is the real spindle of fixtures/spindle46.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import plotly.graph_objects as go
from plotly.offline import get_plotlyjs

from selector import figures
from selector.quality import inspect, without_faults
from selector.readers import read
from selector.selection import Options, Selection, select

ROOT = Path(__file__).resolve().parents[2]
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome", "msedge")
RESPONSE = "Y1"
WIDTH_PX, HEIGHT_PX, GAP_PX = 1180, 860, 10


def study() -> Selection:
    """The study of 16 thermometers on a real spindle."""
    spindle = ROOT / "fixtures" / "spindle46"
    reading = read([spindle / "tests.parquet"], machine=spindle / "machine.toml")
    recording = without_faults(reading.recording, inspect(reading.recording))
    return select(recording, Options(responses=("X1", RESPONSE, "Z"), memory=True))


def first_picture(selection: Selection) -> str:
    """Groups on the left; on the right the error against the number of sensors, and the run that fits worst."""
    half = (WIDTH_PX - GAP_PX) // 2
    worst = max(selection.proof.per_response[RESPONSE], key=lambda part: part.rmse_um).name
    tree = figures.sensor_tree(selection)
    curve = figures.error_against_sensors(selection, RESPONSE)
    run = figures.measured_and_predicted(selection, RESPONSE, [worst])
    columns = [[(tree, HEIGHT_PX - 30)], [(curve, 470), (run, HEIGHT_PX - 30 - 470)]]
    body = "".join(
        "<div>"
        + "".join(_drawn(drawn, half, height, f"f{i}{j}") for j, (drawn, height) in enumerate(column))
        + "</div>"
        for i, column in enumerate(columns)
    )
    return (
        "<!DOCTYPE html><meta charset='utf-8'><style>body{margin:0;background:#fff;font:13px 'DejaVu Sans',sans-serif}"
        f"main{{display:flex;gap:{GAP_PX}px}}p{{margin:6px 12px;color:#555}}</style>"
        f"<script>{get_plotlyjs()}</script><main>{body}</main>"
        "<p>From the report of a study on a real spindle, measured for 40 hours (fixtures/spindle46).</p>"
    )


def _drawn(drawn: go.Figure, width: int, height: int, name: str) -> str:
    drawn.update_layout(width=width, height=height, title={"font": {"size": 14}})
    text = drawn.layout.title.text.replace("<br>", " ")
    drawn.update_layout(title={"text": _wrapped(text, 66)})
    html: str = drawn.to_html(full_html=False, include_plotlyjs=False, div_id=name, config={"staticPlot": True})
    return html


def _wrapped(text: str, width: int) -> str:
    lines = [""]
    for word in text.split():
        if lines[-1] and len(lines[-1]) + len(word) >= width:
            lines.append("")
        lines[-1] = f"{lines[-1]} {word}".strip()
    return "<br>".join(lines)


def photograph(page: str, target: Path) -> None:
    """The page as PNG, by a headless browser that touches no profile of the user."""
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
                "--virtual-time-budget=8000", f"--window-size={WIDTH_PX},{HEIGHT_PX}", f"--screenshot={target}",
                source.as_uri(),
            ],
            check=True, timeout=120, capture_output=True,
        )  # fmt: skip


if __name__ == "__main__":
    picture = Path(__file__).with_name("first-picture.png")
    photograph(first_picture(study()), picture)
    print(f"wrote {picture.relative_to(ROOT)}")
