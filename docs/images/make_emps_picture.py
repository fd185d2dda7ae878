"""Make the picture of docs/explanation/emps-drive.md: `python docs/images/make_emps_picture.py` (needs Chromium).

Recorded: fixtures/emps, the record with pulses. Simulated with the parameters identified on the other record.
"""

from __future__ import annotations

import sys
from pathlib import Path

import plotly.graph_objects as go
from make_pictures import HEIGHT_PX, ROOT, WIDTH_PX, photograph
from plotly.offline import get_plotlyjs
from plotly.subplots import make_subplots

sys.path.insert(0, str(ROOT))

from benchmarks.bench_emps import PERIOD_S, PULSE_V, RECORDED, axis_of, records
from proving_ground.real.identification import identified_axis_of_servo
from selector.figures import style
from selector.physics.drive.simulation import simulate_axis

NOTE = (
    "Recorded: EMPS, record with pulses (Janot, Gautier, Brunot 2019). Simulated: rigid axis with friction, parameters "
    "from the record without pulses."
)
COLOURS = {"recorded": style.MEASURED, "true speed, now": style.RESIDUAL, RECORDED: style.PREDICTED}
LABELS = {"true speed, now": "simulated, control sees the true speed", RECORDED: "simulated, speed over two samples"}


def page() -> str:
    """A pulse and the difference of positions over a round, as an HTML page of the size of the picture."""
    nominal, pulses = records()
    fit = identified_axis_of_servo(PERIOD_S, nominal.position_m, nominal.voltage_v, nominal.servo)
    time_s = pulses.reference.time_s
    flank, turn = slice(325, 420), slice(0, 6240)
    pulse_v = pulses.voltage_v - pulses.output_v
    drawn = make_subplots(
        rows=2,
        cols=1,
        vertical_spacing=0.13,
        subplot_titles=(
            f"Voltage at a pulse of {PULSE_V} V",
            "Simulated minus recorded position over the first of four rounds",
        ),
    )
    drawn.add_scatter(
        x=time_s[flank], y=pulses.voltage_v[flank], name="recorded", line={"color": COLOURS["recorded"], "width": 3}
    )
    for law, label in LABELS.items():
        motion = simulate_axis(
            axis_of(fit.values, pulses.servo, law), pulses.reference, step_s=PERIOD_S, start=pulses.start
        )
        colour = COLOURS[law]
        drawn.add_scatter(x=time_s[flank], y=(motion.command + pulse_v)[flank], name=label, line={"color": colour})
        error_um = 1e6 * (motion.measured_m - pulses.position_m)
        drawn.add_scatter(
            x=time_s[turn], y=error_um[turn], line={"color": colour, "width": 1.2}, showlegend=False, row=2, col=1
        )
    drawn.update_yaxes(title_text="voltage [V]", row=1, col=1)
    drawn.update_yaxes(title_text="difference [µm]", row=2, col=1)
    drawn.update_xaxes(title_text="time [s]", row=2, col=1)
    drawn.update_layout(
        template=go.layout.Template(),
        plot_bgcolor="#fff",
        width=WIDTH_PX,
        height=HEIGHT_PX - 30,
        margin={"l": 60, "r": 20, "t": 40, "b": 50},
        legend={"x": 0.99, "y": 0.99, "xanchor": "right"},
        font={"family": "DejaVu Sans", "size": 13},
    )
    drawn.update_xaxes(gridcolor="#e4e4e4", linecolor="#888", ticks="outside")
    drawn.update_yaxes(gridcolor="#e4e4e4", linecolor="#888", zerolinecolor="#bbb", ticks="outside")
    body = drawn.to_html(full_html=False, include_plotlyjs=False, div_id="emps", config={"staticPlot": True})
    return (
        "<!DOCTYPE html><meta charset='utf-8'><style>body{margin:0;background:#fff;font:13px 'DejaVu Sans',sans-serif}"
        f"p{{margin:0 12px;color:#555}}</style><script>{get_plotlyjs()}</script>{body}<p>{NOTE}</p>"
    )


if __name__ == "__main__":
    picture = Path(__file__).with_name("emps.png")
    photograph(page(), picture)
    print(f"wrote {picture.relative_to(ROOT)}")
