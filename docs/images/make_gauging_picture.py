"""Make the picture of finished-sizes.md: `python docs/images/make_gauging_picture.py` (needs Chromium).

All simulated, the two-stage grinding of benchmarks/bench_gauging.py. Above: error of the size against T_Φ, ground with
other filters. Below: sizes with noise that trips early.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import plotly.graph_objects as go
from make_pictures import HEIGHT_PX, ROOT, WIDTH_PX, photograph
from plotly.offline import get_plotlyjs
from plotly.subplots import make_subplots

sys.path.insert(0, str(ROOT))

from benchmarks.bench_gauging import BASE, GRINDING
from selector.figures import style
from selector.physics.gauging.gauged_grinding import finished_sizes
from selector.physics.gauging.sizes import sizes_by_formula
from selector.physics.gauging.transducer import Noise
from selector.telling.simulated.gauging import size_density

PARTS, FILTERS = 4000, 30
BIAS, VARIANCE, TOTAL, SIMULATED = style.RESIDUAL, style.PREDICTED, style.INK, style.BEFORE
NOTE = (
    "Simulated: line of 10 mV/µm, last feed 5 µm/s, relay 20 ms late. Above: noise 0.5 µm, 30/s, feed ± 5 %. "
    "Below: noise 2 µm, 100/s, T_Φ 50 ms."
)


def page() -> str:
    """Trade-off and sizes one above the other, as an HTML page of the size of the picture."""
    setup = replace(BASE, grinding=replace(GRINDING, feed_sd=0.05), noise=Noise(0.5, 30.0))
    at = np.geomspace(0.003, 0.8, FILTERS)
    wrong_um = [
        finished_sizes(replace(setup, gauge=replace(setup.gauge, time_constant_s=one), thresholds_v=()), PARTS, seed=1)
        .finished_um - setup.wanted_um
        for one in at.tolist()
    ]  # fmt: skip
    bias2, variance = (np.array([value(one) for one in wrong_um]) for value in (lambda one: one.mean() ** 2, np.var))
    squares = bias2 + variance
    best = int(squares.argmin())
    restless = replace(BASE, noise=Noise(2.0, 100.0))
    sizes = finished_sizes(restless, 20_000, seed=1).size_um
    drawn = make_subplots(
        rows=2,
        cols=1,
        vertical_spacing=0.15,
        subplot_titles=(
            f"Mean square error of the size: best at {1e3 * at[best]:.0f} ms, {np.sqrt(squares[best]):.2f} µm",
            "Restless noise: parts too large, and not normal",
        ),
    )
    for name, values, colour, dash in (
        ("bias²", bias2, BIAS, "dash"),
        ("variance", variance, VARIANCE, "dot"),
        ("sum", squares, TOTAL, "solid"),
    ):
        line = {"color": colour, "width": 2.5, "dash": dash}
        drawn.add_scatter(x=1e3 * at, y=values, name=name, line=line, row=1, col=1)
    drawn.add_scatter(
        x=[1e3 * at[best]], y=[squares[best]], mode="markers", name="best", row=1, col=1,
        marker={"color": "#e9a800", "size": 16, "symbol": "star", "line": {"color": "#fff", "width": 1}},
    )  # fmt: skip
    drawn.add_histogram(
        x=sizes - 2.0, histnorm="probability density", nbinsx=70, marker_color=SIMULATED, name="Monte Carlo, 20 000",
        legend="legend2", row=2, col=1,
    )  # fmt: skip
    size, density = size_density(sizes_by_formula(restless))
    drawn.add_scatter(
        x=size - 2.0, y=density, name="G eq. 25", line={"color": BIAS, "width": 2.5, "dash": "dash"}, legend="legend2",
        row=2, col=1,
    )  # fmt: skip
    drawn.update_xaxes(type="log", title_text="T_Φ [ms]", dtick=1, row=1, col=1)
    drawn.update_yaxes(type="log", title_text="µm²", range=[-4, 0.2], dtick=1, exponentformat="power", row=1, col=1)
    drawn.update_xaxes(title_text="finished size less the wanted one [µm]", range=[-2.6, 3.2], row=2, col=1)
    drawn.update_yaxes(title_text="density [1/µm]", row=2, col=1)
    drawn.update_layout(
        template=go.layout.Template(),
        plot_bgcolor="#fff",
        width=WIDTH_PX,
        height=HEIGHT_PX - 30,
        margin={"l": 70, "r": 20, "t": 40, "b": 55},
        legend={"x": 0.01, "y": 0.6, "yanchor": "bottom", "bgcolor": "rgba(255,255,255,.8)"},
        legend2={"x": 0.99, "y": 0.41, "yanchor": "top", "xanchor": "right", "bgcolor": "rgba(255,255,255,.8)"},
        font={"family": "DejaVu Sans", "size": 13},
        bargap=0,
    )
    drawn.update_xaxes(gridcolor="#e4e4e4", linecolor="#888", ticks="outside")
    drawn.update_yaxes(gridcolor="#e4e4e4", linecolor="#888", zerolinecolor="#bbb", ticks="outside")
    body = drawn.to_html(full_html=False, include_plotlyjs=False, div_id="gauging", config={"staticPlot": True})
    return (
        "<!DOCTYPE html><meta charset='utf-8'><style>body{margin:0;background:#fff;font:13px 'DejaVu Sans',sans-serif}"
        f"p{{margin:0 12px;color:#555}}</style><script>{get_plotlyjs()}</script>{body}<p>{NOTE}</p>"
    )


if __name__ == "__main__":
    picture = Path(__file__).with_name("gauging-trade-off.png")
    photograph(page(), picture)
    print(f"wrote {picture.relative_to(ROOT)}")
