"""Recorded and simulated course of one channel over time, and their difference below."""

from __future__ import annotations

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from selector.figures import style
from selector.figures.panels import Line, Panel, stacked

Vector = NDArray[np.float64]
_UNITS = {"um": ("mm", 1e-3, "µm"), "urad": ("rad", 1e-6, "µrad")}


def recorded_and_simulated(time_s: Vector, recorded: Vector, simulated: Vector, name: str, unit: str) -> go.Figure:
    """Both courses, and simulated minus recorded; each stretch keeps its lowest and highest sample.

    Parameters
    ----------
    time_s, recorded, simulated : ndarray of shape (n_samples,)
        From the start of the run [s]; the courses [unit].
    name : str
        Of the channel.
    unit : str
        As of `physics.drive.comparison.Difference`; courses in µm are drawn in mm.
    """
    whole, times, text = _UNITS.get(unit, (unit, 1.0, unit))
    text, whole = ("", "") if unit == "1" else (text, whole)
    difference = simulated - recorded
    worst = int(np.argmax(np.abs(difference)))
    rms = float(np.sqrt(np.mean(difference**2)))
    span, seconds = style.time_unit(float(time_s[-1]))
    title = (
        f"{style.label(name)}: simulated and recorded differ by {style.number(rms)} {text} rms, at most "
        f"{style.number(abs(difference[worst]))} {text} (after {time_s[worst] / seconds:.3g} {span})"
    )
    panels = [
        Panel(
            _titled("course", whole),
            [
                Line("recorded", time_s, recorded * times, style.MEASURED, width=4.0),
                Line("simulated", time_s, simulated * times, style.PREDICTED),
            ],
            170,
        ),
        Panel(_titled("difference", text), [Line("", time_s, difference, style.RESIDUAL)], 230, least=0.0),
    ]
    return stacked(title, panels, float(time_s[-1]))


def _titled(what: str, unit: str) -> str:
    return f"{what} [{unit}]" if unit else what
