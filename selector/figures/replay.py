"""Figures of a replay: what the exported program does over a recorded run."""

from __future__ import annotations

import numpy as np
import plotly.graph_objects as go

from selector.figures import style

MOST_POINTS = 4000


def replayed_run(
    run: str,
    output: str,
    time_s: np.ndarray,
    correction_um: np.ndarray,
    recorded_um: np.ndarray,
) -> go.Figure:
    """Recorded displacement of one run and what is left of it with the correction of the program.

    Parameters
    ----------
    run, output : str
    time_s, correction_um, recorded_um : ndarray of shape (n_samples,)
        Recorded displacement NaN where there is none: then the correction alone is drawn.
    """
    stride = max(1, -(-len(time_s) // MOST_POINTS))
    hours, correction, recorded = (of[::stride] for of in (time_s / 3600.0, correction_um, recorded_um))
    drawn = style.figure(f"{style.label(output)} in run {style.label(run)}: as recorded, and with this program", 380)
    if np.isfinite(recorded).any():
        drawn.add_scatter(x=hours, y=recorded, name="recorded", line={"color": style.MEASURED, "width": 1.5})
        drawn.add_scatter(
            x=hours, y=recorded + correction, name="with the correction", line={"color": style.RESIDUAL, "width": 1.5}
        )
    drawn.add_scatter(x=hours, y=correction, name="correction", line={"color": style.PREDICTED, "width": 1.5})
    drawn.update_xaxes(title="time since the start of the run [h]")
    drawn.update_yaxes(title="[µm]")
    return drawn
