"""A duty cycle: its speeds, the displacement that is predicted, and what the corrections leave of it."""

from collections.abc import Sequence

import numpy as np
import plotly.graph_objects as go

from selector.figures import style
from selector.figures.panels import Line, Panel, Traced, beside_each_other, common_ranges, stacked, telling_samples
from selector.number_text import number_text
from selector.physics.thermal.prediction.answer import RepeatedTest
from selector.physics.thermal.prediction.correction_program import CorrectionProgram
from selector.physics.thermal.prediction.prediction import Prediction
from selector.types import Vector

POINTS_PER_TEST = 600


def duty_cycle(prediction: Prediction, response: str) -> go.Figure:
    """Speed, displacement with the corrections as steps, and the drift that is left with the tolerance as a band."""
    displacement = prediction.displacement_um[:, prediction.responses.index(response)]
    cyclogram, end_s = prediction.cyclogram, float(prediction.time_s[-1])
    program = prediction.programs.get(response)
    largest = int(np.argmax(np.abs(displacement)))
    at_s = float(prediction.time_s[largest])
    unit, seconds = style.time_unit(end_s)
    moved = f"{number_text(float(displacement[largest]))} {prediction.unit(response)}"
    title = f"{style.label(response)} moves by up to {moved}, after {at_s / seconds:.2g} {unit}"
    if program is not None:
        allowed = " and ".join(dict.fromkeys(f"{one:g}" for one in program.tolerances_um))
        title += f"; {_corrections(program)} keep it within {allowed} µm"
    lines = [Line("predicted", prediction.time_s, displacement, style.PREDICTED, width=2.2)]
    if prediction.observed is not None:
        day, r = prediction.observed, prediction.responses.index(response)
        lines.append(Line("by the readings", day.time_s, day.displacement_um[:, r], style.MEASURED, width=2.2))
        end_s = max(end_s, float(day.time_s[-1]))
    panels = []
    if cyclogram is not None:
        held = np.r_[cyclogram.speed_rpm, cyclogram.speed_rpm[-1]]
        speed = Line("", np.r_[cyclogram.start_s, end_s], held, style.INK, steps=True)
        panels.append(Panel("speed [r/min]", [speed], height_px=110, least=0.0))
    panels.append(Panel(f"{style.label(response, 12)} [{prediction.unit(response)}]", lines, height_px=260, least=0.0))
    marks: list[float] = []
    if program is not None:
        lines.append(_taken_off(program, prediction.time_s, displacement))
        drift_s, drift = program.drift_left_um(prediction.time_s, displacement)
        band = (-max(program.tolerances_um), max(program.tolerances_um))
        panels.append(Panel("drift left [µm]", [Line("", drift_s, drift, style.RESIDUAL)], height_px=130, band=band))
        marks = [operation.start_s for operation in program.operations[1:]]
    drawn = stacked(title, panels, end_s, marks)
    if program is not None and len(program.operations) > 1:
        for number, operation in enumerate(program.operations, start=1):
            text, place = f"operation {number}" if number == 1 else f"{number}", {"yref": "paper", "yanchor": "bottom"}
            at = operation.start_s / seconds
            drawn.add_annotation(style.words(text, at, 1.0, style.MUTED, 11, xanchor="left", **place))
    return drawn


def drawn_cycle(steps: Sequence[tuple[float, float]]) -> go.Figure:
    """A duty cycle with handles to be dragged: steps are minutes and speeds [r/min], in their order."""
    ends = np.cumsum([0.0, *(minutes for minutes, _ in steps)])
    speeds = [speed for _, speed in steps]
    drawn = style.figure("", 300)
    style.curve(drawn, ends, [*speeds, *speeds[-1:]], style.INK, width=2, line={"shape": "hv"}, showlegend=False)
    for x, symbol, text in (((ends[1:] + ends[:-1]) / 2, "circle", "speed"), (ends[1:], "diamond", "end")):
        look = {"size": 13, "marker": {"symbol": symbol}, "showlegend": False, "cliponaxis": False}
        style.points(drawn, x, speeds, style.PREDICTED, None, f"{text}: %{{x:.4g}} min, %{{y:.5g}} r/min", **look)
    drawn.update_layout(margin={"t": 16, "b": 48, "r": 24}, dragmode=False)
    drawn.update_xaxes(title_text="time [min]", range=[0.0, 1.05 * float(ends[-1])])
    drawn.update_yaxes(title_text="speed [r/min]", range=[0.0, 1.25 * max(*speeds, 1000.0)])
    return drawn


def prediction_of_tests(prediction: Prediction, response: str, repeats: tuple[RepeatedTest, ...]) -> go.Figure:
    """The tests beside what the method makes of them, the residual below; `repeats` are those of the prediction."""
    r = prediction.responses.index(response)
    worst = max(repeats, key=lambda one: float(one.rmse_um[r]))
    how = {"modal": "the thermal modes repeat", "piecewise": "the pieces of the characteristics repeat"}
    unit = prediction.unit(response)
    title = (
        f"{style.label(response)}: {how[prediction.method]} the tests within "
        f"{number_text(float(worst.rmse_um[r]), 2)} {unit}, root mean square ({style.label(worst.run)} is the worst)"
    )
    traced = []
    for one in repeats:
        residual = one.measured_um[:, r] - one.predicted_um[:, r]
        kept = telling_samples(residual, POINTS_PER_TEST)
        speeds = [f"{speed:.4g}" for speed in dict.fromkeys(one.speed_rpm.tolist()) if speed > 0]
        turning = f"{speeds[0]} r/min: " if len(speeds) == 1 else ""
        rms, largest = float(one.rmse_um[r]), float(np.nanmax(np.abs(residual)))
        text = f"{turning}rms {number_text(rms, 2)} {unit}, largest {number_text(largest, 2)} {unit}"
        courses = one.measured_um[kept, r], one.predicted_um[kept, r]
        traced.append(Traced(one.run, text, one.time_s[kept], *courses))
    ranges = common_ranges([one.measured_um[:, r] for one in repeats], [one.predicted_um[:, r] for one in repeats])
    return beside_each_other(title, traced, response, *ranges)


def _taken_off(program: CorrectionProgram, time_s: Vector, displacement_um: Vector) -> Line:
    """What zeros and corrections take off [µm]: the displacement at the zero of each operation, and its offsets."""
    several = program.operations
    times = np.r_[np.concatenate([one.times_s for one in several]), several[-1].end_s]
    zeros = [float(np.interp(one.start_s, time_s, displacement_um)) for one in several]
    values = np.concatenate([zero + one.offsets_um for zero, one in zip(zeros, several, strict=True)])
    return Line("zero and corrections", times, np.r_[values, values[-1]], style.CHOSEN, steps=True)


def _corrections(program: CorrectionProgram) -> str:
    count = sum(len(operation.times_s) - 1 for operation in program.operations)
    zeros = len(program.operations)
    new = f"the zero{'s' * (zeros > 1)} of {zeros} operation{'s' * (zeros > 1)}"
    return f"{count} correction{'s' * (count != 1)} and {new}" if count else f"{new} alone"
