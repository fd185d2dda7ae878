"""A simulation that is written more rarely than the machine was recorded: which readings it can be compared at."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from selector.diagnosis.comparison import Vector
from selector.findings import Finding, Where

Rows = NDArray[np.intp]
_SEEN = 0.1
"""Of the usual change from reading to reading: lines that cut off less do not matter."""
_COARSE = 1.6
"""Recorded steps in a simulated one from which a line between two simulated values may be no longer the simulation."""


def comparable_rows(at_s: Vector, stamps_s: Vector, recorded: Sequence[Vector], simulated: Sequence[Vector]) -> Rows:
    """Recorded rows at which a run can be compared: all, or those at which the simulation has a value of its own.

    Between two stamps a line stands for what the simulation did; what it cuts off looks like a lag of the machine. That
    is an eighth of h²·y'' at most, a fourth of what a line over two steps is off in the middle.

    Parameters
    ----------
    at_s : ndarray of shape (n_rows,)
        Recorded times on the simulation's clock [s].
    stamps_s : ndarray of shape (n_stamps,)
        Stamps of the simulation [s].
    recorded, simulated : sequences of ndarray of shapes (n_rows,), (n_stamps,)
        The responses.
    """
    everything = np.arange(len(at_s))
    if len(at_s) < 3 or len(stamps_s) < 3:
        return everything
    step_s = float(np.median(np.diff(at_s)))
    if float(np.median(np.diff(stamps_s))) < _COARSE * step_s:
        return everything
    if not any(
        _cut_off(stamps_s, course) > _SEEN * _noise(values) for values, course in zip(recorded, simulated, strict=True)
    ):
        return everything
    inside = stamps_s[(stamps_s >= at_s[0] - 0.5 * step_s) & (stamps_s <= at_s[-1] + 0.5 * step_s)]
    after = np.clip(np.searchsorted(at_s, inside), 1, len(at_s) - 1)
    nearest = np.where(inside - at_s[after - 1] <= at_s[after] - inside, after - 1, after)
    return np.unique(nearest)


def _cut_off(stamps_s: Vector, course: Vector) -> float:
    """Root mean square of what lines between the samples of a course cut off, at most."""
    share = (stamps_s[1:-1] - stamps_s[:-2]) / (stamps_s[2:] - stamps_s[:-2])
    bend = course[1:-1] - (1.0 - share) * course[:-2] - share * course[2:]
    bend = bend[np.isfinite(bend)]
    return 0.25 * float(np.sqrt(np.mean(bend**2))) if len(bend) else 0.0


def _noise(values: Vector) -> float:
    steps = np.abs(np.diff(values[np.isfinite(values)]))
    return float(np.median(steps)) if len(steps) else 0.0


def told(run: str, rows: Rows, at_s: Vector, stamps_s: Vector) -> Finding:
    """That only some readings of a run are compared."""
    recorded, simulated = float(np.median(np.diff(at_s))), float(np.median(np.diff(stamps_s)))
    return Finding(
        "coarse-simulation",
        "warning",
        f"Run {run}: the simulation has a value every {simulated:.6g} s, the recording every {recorded:.6g} s; "
        f"compared are the {len(rows)} of {len(at_s)} readings at which the simulation has a value.",
        Where(run=run),
        {"simulated_step_s": simulated, "recorded_step_s": recorded, "rows": len(rows), "of": len(at_s)},
        "write the simulation as often as the machine was recorded",
    )
