"""Make the picture of docs/explanation/vibration-chains.md: `python docs/images/make_chain_error_picture.py`.

Needs Chromium. The marks are neighbours in the chains of fixtures/vibration/lathe.toml.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from itertools import pairwise
from pathlib import Path

import numpy as np
import plotly.graph_objects as go
from chain_error_map import Kind, chain_error_map, two_member_ratio
from make_pictures import HEIGHT_PX, ROOT, WIDTH_PX, photograph
from plotly.offline import get_plotlyjs
from plotly.subplots import make_subplots

sys.path.insert(0, str(ROOT))

from selector.figures import style
from selector.physics.vibration.chains import Link, chain_links
from selector.physics.vibration.model_file import read_model_file
from selector.physics.vibration.vibration_model import vibration_model

PSI = 0.3
"""ψ of both joints, that of the lathe's tighter ones."""
BAND = np.geomspace(0.1, 3.0, 600)
"""ω/p1 over which the share is taken."""
MASS, FREQUENCY = np.geomspace(1e-3, 10.0, 121), np.geomspace(0.1, 10.0, 121)
KINDS: tuple[tuple[Kind, str], ...] = (
    ("first", "First kind: force on 1, motion of 1"),
    ("second", "Second kind: force on 2, motion of its branch 1"),
)
COLOURS = {0.001: style.CHOSEN, 0.01: style.PREDICTED, 0.1: style.BASELINES["mean"], 1.0: style.RESIDUAL}
NOTE = (
    "Two members 1 – 2 – ground, ψ = 0.3 in both joints, as published. Circles: neighbours in the chains of "
    "fixtures/vibration/lathe.toml, whose numbers are plausible, not measured."
)


def page() -> str:
    """Maps of the share of the band within 10 % above, errors over frequency below, as HTML of the picture's size."""
    drawn = make_subplots(
        rows=2,
        cols=2,
        row_heights=[0.56, 0.44],
        vertical_spacing=0.14,
        horizontal_spacing=0.09,
        subplot_titles=[*(text for _, text in KINDS), *["Error over frequency, p1/p2 = 3"] * 2],
    )
    neighbours = dict(zip(("first", "second"), lathe_neighbours(), strict=True))
    for column, (kind, _) in enumerate(KINDS, start=1):
        found = chain_error_map(MASS, FREQUENCY, dissipation=(PSI, PSI), forcing_ratio=BAND, kind=kind)
        drawn.add_contour(
            x=np.log10(FREQUENCY), y=np.log10(MASS), z=100 * found.share_within,
            contours={"start": 0, "end": 100, "size": 10}, line={"width": 0.4, "color": "#888"}, zmin=0, zmax=100,
            colorscale=[[0, "#b34a00"], [0.5, "#f6e8c3"], [1, "#1b7a43"]], showscale=column == 2,
            colorbar={
                "title": {"text": "of the band<br>within 10 %"}, "ticksuffix": " %",
                "len": 0.53, "y": 0.76, "thickness": 14,
            },
            row=1, col=column,
        )  # fmt: skip
        masses, frequencies = np.array(sorted(neighbours[kind])).T
        drawn.add_scatter(
            x=np.log10(frequencies), y=np.log10(masses), mode="markers",
            marker={"size": 9, "color": "rgba(255,255,255,0.75)", "line": {"color": "#222", "width": 1.4}},
            showlegend=False, row=1, col=column,
        )  # fmt: skip
        for mass, colour in COLOURS.items():
            error = np.abs(two_member_ratio(mass, 3.0, BAND, dissipation=(PSI, PSI), kind=kind) - 1)
            drawn.add_scatter(
                x=BAND, y=100 * error, name=f"m1/m2 = {mass:g}", line={"color": colour, "width": 2},
                showlegend=column == 1, row=2, col=column,
            )  # fmt: skip
        drawn.add_hrect(y0=0.01, y1=10, fillcolor="#1b7a43", opacity=0.12, line_width=0, row=2, col=column)
        decades = {"tickvals": [-1, -0.5229, 0, 0.4771, 1], "ticktext": ["0.1", "0.3", "1", "3", "10"]}
        drawn.update_xaxes(
            title_text="frequency ratio p1/p2", title_standoff=4, **decades, range=[-1, 1], row=1, col=column
        )
        drawn.update_yaxes(
            tickvals=[-3, -2, -1, 0, 1], ticktext=["0.001", "0.01", "0.1", "1", "10"], range=[-3, 1], row=1, col=column
        )
        drawn.update_xaxes(
            type="log", title_text="ω/p1", title_standoff=4,
            tickvals=[0.1, 1 / 3, 1, 3], ticktext=["0.1", "1/3 (ω = p2)", "1", "3"],
            row=2, col=column,
        )  # fmt: skip
        drawn.update_yaxes(
            type="log", range=[-1, 3], tickvals=[0.1, 1, 10, 100, 1000],
            ticktext=["0.1 %", "1 %", "10 %", "100 %", "1000 %"], row=2, col=column,
        )  # fmt: skip
    drawn.update_yaxes(title_text="mass ratio m1/m2", row=1, col=1)
    drawn.update_yaxes(title_text="error of the chain", row=2, col=1)
    drawn.update_layout(
        template=go.layout.Template(),
        plot_bgcolor="#fff",
        width=WIDTH_PX,
        height=HEIGHT_PX - 30,
        margin={"l": 75, "r": 20, "t": 40, "b": 50},
        legend={"x": 1.01, "y": 0.2, "yanchor": "middle"},
        font={"family": "DejaVu Sans", "size": 13},
    )
    drawn.update_xaxes(gridcolor="#e4e4e4", linecolor="#888", ticks="outside", zeroline=False)
    drawn.update_yaxes(gridcolor="#e4e4e4", linecolor="#888", ticks="outside", zeroline=False)
    body = drawn.to_html(full_html=False, include_plotlyjs=False, div_id="chains", config={"staticPlot": True})
    return (
        "<!DOCTYPE html><meta charset='utf-8'><style>body{margin:0;background:#fff;font:13px 'DejaVu Sans',sans-serif}"
        f"p{{margin:0 12px;color:#555}}</style><script>{get_plotlyjs()}</script>{body}<p>{NOTE}</p>"
    )


def lathe_neighbours() -> tuple[set[tuple[float, float]], set[tuple[float, float]]]:
    """(m1/m2, p1/p2) of neighbours in the lathe's paths, and of branches with what carries them; each pair once."""
    model = vibration_model(read_model_file(ROOT / "fixtures" / "vibration" / "lathe.toml"))
    paths, branches = set[tuple[float, float]](), set[tuple[float, float]]()
    for chain in model.chains:
        path, branch = chain_links(model.structure, chain)
        paths |= set(_ratios(pairwise(path)))
        by_group = {link.group: link for link in (*path, *branch)}
        branches |= set(_ratios((link, by_group[link.on]) for link in branch))
    return paths, branches


def _ratios(pairs: Iterable[tuple[Link, Link]]) -> list[tuple[float, float]]:
    return [(one.mass_kg / other.mass_kg, one.natural_hz / other.natural_hz) for one, other in pairs]


if __name__ == "__main__":
    picture = Path(__file__).with_name("vibration-chain-error.png")
    photograph(page(), picture)
    print(f"wrote {picture.relative_to(ROOT)}")
