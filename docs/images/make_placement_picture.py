"""Make the picture of docs/how-to/place-sensors-before-drilling.md: `python docs/images/make_placement_picture.py`.

The study is that of the page: candidates on the simulated machine, driven by the runs of fixtures/vmc37.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

from make_pictures import HEIGHT_PX, ROOT, WIDTH_PX, photograph
from plotly.offline import get_plotlyjs

from selector import figures
from selector.physics.thermal.field import machine_outline
from selector.quality import inspect, without_faults
from selector.readers import read
from selector.selection import Options, select

NOTE = (
    "A placement study on a simulated machine (fixtures/thermal/candidates.toml, driven by fixtures/vmc37). "
    "Not a measurement. Grey: its edges."
)


def page() -> str:
    """The machine with its candidates, as an HTML page of the size of the picture."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "virtual"
        model, inputs = ROOT / "fixtures" / "thermal" / "candidates.toml", ROOT / "fixtures" / "vmc37"
        arguments = ["simulate", "thermal", str(model), "--inputs", str(inputs), "--seed", "1", "--out", str(out)]
        subprocess.run([sys.executable, "-m", "selector", *arguments], check=True, capture_output=True)  # noqa: S603
        recording = read([out], machine=out / "machine.toml").recording
    recording = without_faults(recording, inspect(recording))
    selection = select(recording, Options(responses=("Z", "Y"), max_sensors=4))
    places = {channel.name: channel.xyz_m for channel in recording.channels if channel.xyz_m is not None}
    drawn = figures.sensor_places(selection, places, machine_outline())
    drawn.update_layout(width=WIDTH_PX, height=HEIGHT_PX - 30)
    body = drawn.to_html(full_html=False, include_plotlyjs=False, div_id="places", config={"staticPlot": True})
    return (
        "<!DOCTYPE html><meta charset='utf-8'><style>body{margin:0;background:#fff;font:13px 'DejaVu Sans',sans-serif}"
        f"p{{margin:0 12px;color:#555}}</style><script>{get_plotlyjs()}</script>{body}<p>{NOTE}</p>"
    )


if __name__ == "__main__":
    picture = Path(__file__).with_name("placement.png")
    photograph(page(), picture)
    print(f"wrote {picture.relative_to(ROOT)}")
