"""What touch-offs leave of the error of a run, beside what the model alone leaves."""

import plotly.graph_objects as go

from selector.adaptation.judged import JudgedRun
from selector.figures import style
from selector.figures.panels import Line, Panel, shown_samples, stacked
from selector.number_text import number_text
from selector.types import Array


def adapted_run(run: JudgedRun, response: str, without_rmse_um: float, rmse_um: float) -> go.Figure:
    """The error with and without touch-offs, and the 90 % interval that was expected; dotted: touch-offs."""
    time_s = run.time_s - run.course.time_s[0]

    def line(name: str, values: Array, colour: str, dash: str = "solid") -> Line:
        shown = shown_samples(time_s, values)
        return Line(name, time_s[shown], values[shown], colour, dash=dash)

    lines = [
        line("model alone", run.recorded_um - run.modelled_um, style.BEFORE),
        line("with touch-offs", run.error_um, style.RESIDUAL),
    ]
    if run.kind != "none":
        ends = (("90 % interval", run.half_width_um), ("", -run.half_width_um))
        lines += [line(name, end, style.MUTED, "dot") for name, end in ends]
    touched = run.course.time_s[run.course.touched_at] - run.course.time_s[0]
    return stacked(
        f"{style.label(run.course.run)}: {number_text(rmse_um)} µm of {style.label(response)} are left with "
        f"{len(touched)} touch-offs, {number_text(without_rmse_um)} µm without",
        [Panel("error [µm]", lines, height_px=230, least=0.0)],
        float(time_s[-1]) if len(time_s) else 1.0,
        marks_s=touched.tolist(),
    )
