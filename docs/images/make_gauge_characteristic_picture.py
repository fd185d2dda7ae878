"""Make the picture of docs/explanation/vibrating-contact-gauge.md.

`python docs/images/make_gauge_characteristic_picture.py`; needs Chromium. The gauge is the example of the tests.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import plotly.graph_objects as go
from make_pictures import HEIGHT_PX, ROOT, WIDTH_PX, photograph
from plotly.offline import get_plotlyjs
from plotly.subplots import make_subplots

sys.path.insert(0, str(ROOT))

from selector.figures import style
from selector.physics.gauging.characteristic import characteristic, linear_gauge, simulate_transducer, steady_swing
from tests.physics.gauging.examples import TRANSDUCER
from tests.physics.gauging.published_line import published_gauge
from tests.physics.gauging.test_steady_swing import tuned

NOTE = (
    "A plausible gauge, not a measured one: 50 Hz mains, pull at 100 Hz, probe at 102 Hz, T_Γ = 2 ms, T_Φ = 0.1 s. "
    "Upper right: the same probe tuned to 80 to 400 Hz, quality 10, even pull."
)
TUNED = {0.8: style.RESIDUAL, 1.0: style.CHOSEN, 2.0: style.PREDICTED, 4.0: style.GROUPS[3]}
DARK, BLUE, RED, ORANGE = style.INK, style.PREDICTED, style.RESIDUAL, style.BASELINES["mean"]


def page() -> str:
    """Characteristic with lines, amplitudes, and two rounds of the chain, as HTML of the size of the picture."""
    drawn = make_subplots(
        rows=2, cols=2, vertical_spacing=0.13, horizontal_spacing=0.09,
        specs=[[{}, {}], [{"secondary_y": True}, {"secondary_y": True}]],
        subplot_titles=(
            "Mean smoothed voltage over the allowance", "Amplitude where contact takes a part of it away",
            "Tip and surface at allowance 0; force below", "Generator, rectified and smoothed, at allowance 0",
        ),
    )  # fmt: skip
    _characteristic(drawn)
    _amplitudes(drawn)
    _waveforms(drawn)
    drawn.update_layout(
        template=go.layout.Template(), plot_bgcolor="#fff", width=WIDTH_PX, height=HEIGHT_PX - 30, showlegend=False,
        margin={"l": 60, "r": 60, "t": 40, "b": 50}, font={"family": "DejaVu Sans", "size": 13},
    )  # fmt: skip
    drawn.update_xaxes(gridcolor="#e4e4e4", linecolor="#888", ticks="outside", zeroline=False)
    drawn.update_yaxes(gridcolor="#e4e4e4", linecolor="#888", ticks="outside", zeroline=False)
    body = drawn.to_html(full_html=False, include_plotlyjs=False, div_id="gauge", config={"staticPlot": True})
    return (
        "<!DOCTYPE html><meta charset='utf-8'><style>body{margin:0;background:#fff;font:13px 'DejaVu Sans',sans-serif}"
        f"p{{margin:0 12px;color:#555}}</style><script>{get_plotlyjs()}</script>{body}<p>{NOTE}</p>"
    )


def _line(
    drawn: go.Figure, x, y, colour: str, row: int, column: int, *, dash: str = "solid", second: bool = False
) -> None:
    drawn.add_scatter(
        x=x,
        y=y,
        mode="lines",
        line={"color": colour, "width": 2, "dash": dash},
        row=row,
        col=column,
        secondary_y=second,
    )


def _label(drawn: go.Figure, x: float, y: float, text: str, colour: str, panel: int, *, anchor: str = "left") -> None:
    # every panel of the lower row has two axes of y
    axis = {1: "", 2: "2", 3: "3", 4: "5"}[panel]
    drawn.add_annotation(
        x=x, y=y, text=text, showarrow=False, xanchor=anchor, font={"color": colour, "size": 12},
        xref=f"x{'' if panel == 1 else panel}", yref=f"y{axis}",
    )  # fmt: skip


def _characteristic(drawn: go.Figure) -> None:
    curve = characteristic(TRANSDUCER)
    allowance = np.linspace(-45.0, 175.0, 800)
    _line(drawn, allowance, curve.voltage_at(allowance), DARK, 1, 1)
    for line, colour, end in (
        (published_gauge(TRANSDUCER), RED, 130.0),
        (published_gauge(TRANSDUCER, slow_coil=False), ORANGE, 130.0),
        (linear_gauge(curve, 0.0, TRANSDUCER.smoothing.time_constant_s), BLUE, 130.0),
    ):
        x = np.array([-34.0, end])
        _line(drawn, x, line.bias_v + line.gain_v_per_um * x, colour, 1, 1, dash="dash")
    _label(drawn, 5.0, 3.2, "as published: slow coil, A = A0 − x", RED, 1)
    _label(drawn, 38.0, 2.25, "the same, coil exact", ORANGE, 1)
    _label(drawn, -40.0, 0.9, "tangent at 0 µm", BLUE, 1)
    _label(drawn, 100.0, 1.05, "simulated", DARK, 1)
    drawn.update_xaxes(title_text="allowance [µm]", row=1, col=1)
    drawn.update_yaxes(title_text="V", range=[0, 3.8], row=1, col=1)


def _amplitudes(drawn: go.Figure) -> None:
    shares = np.concatenate([np.linspace(-0.9, 0.1, 101), np.linspace(0.12, 0.95, 42)])
    for ratio, colour in TUNED.items():
        gauge = tuned(ratio, 10.0)
        free = steady_swing(gauge, None)
        touch_um, swing, found = 1e6 * gauge.rest_gap_m - free.highest_um, free, []
        # grinding: from large allowances to small ones
        for share in shares[::-1]:
            swing = steady_swing(gauge, touch_um + share * free.stroke_um / 2, start=swing.state)
            found.append(swing.stroke_um / free.stroke_um)
        _line(drawn, shares[::-1], found, colour, 1, 2)
    _line(drawn, [-0.9, 0.0, 1.0], [1.0, 1.0, 0.0], DARK, 1, 2, dash="dash")
    _label(drawn, 0.30, 0.45, "A = A0 − x", DARK, 2, anchor="right")
    for text, height, ratio in (
        ("200 Hz", 0.68, 2.0),
        ("400 Hz", 0.57, 4.0),
        ("80 Hz", 0.38, 0.8),
        ("100 Hz", 0.12, 1.0),
    ):
        _label(drawn, 0.97, height, text, TUNED[ratio], 2)
    _label(drawn, 0.0, 1.6, "below the pull's frequency: two swings", TUNED[0.8], 2)
    drawn.update_xaxes(title_text="allowance behind the first touch [share of A0]", range=[-0.9, 1.2], row=1, col=2)
    drawn.update_yaxes(title_text="share of A0", range=[0, 2.2], row=1, col=2)


def _waveforms(drawn: go.Figure) -> None:
    time = np.linspace(0.0, 0.03, 6001)
    motion = simulate_transducer(TRANSDUCER, 0.0, time, start=steady_swing(TRANSDUCER, 0.0).state)
    milliseconds = 1e3 * time
    _line(drawn, milliseconds, 1e6 * motion.probe_m, BLUE, 2, 1)
    _line(drawn, milliseconds[[0, -1]], np.full(2, 1e6 * TRANSDUCER.rest_gap_m), DARK, 2, 1, dash="dot")
    _line(drawn, milliseconds, motion.contact_n, RED, 2, 1, second=True)
    _label(drawn, 0.3, 195.0, "surface", DARK, 3)
    _label(drawn, 15.8, 60.0, "tip", BLUE, 3)
    _label(drawn, 12.0, -250.0, "contact force [N]", RED, 3)
    drawn.update_yaxes(
        title_text="µm", range=[-420, 230], tickvals=[-100, 0, 100, 200], row=2, col=1, secondary_y=False
    )
    drawn.update_yaxes(range=[0, 52], tickvals=[0, 5, 10, 15], showgrid=False, row=2, col=1, secondary_y=True)
    _line(drawn, milliseconds, motion.generator_v, BLUE, 2, 2)
    _line(drawn, milliseconds, np.abs(motion.generator_v), ORANGE, 2, 2, dash="dot")
    _line(drawn, milliseconds, motion.smoothed_v, DARK, 2, 2)
    _label(drawn, 17.9, -1.5, "generator", BLUE, 4)
    _label(drawn, 17.4, 4.1, "rectified", ORANGE, 4)
    _label(drawn, 20.2, 1.2, "smoothed", DARK, 4)
    drawn.update_xaxes(title_text="ms", row=2)
    drawn.update_yaxes(title_text="V", row=2, col=2, secondary_y=False)


if __name__ == "__main__":
    picture = Path(__file__).with_name("gauge-characteristic.png")
    photograph(page(), picture)
    print(f"wrote {picture.relative_to(ROOT)}")
