"""Free swings in pieces, and the pendulum that fits them: one law for all, each piece from a start of its own."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from numba import njit
from scipy.optimize import least_squares

from benchmarks.real.case import SIMULATED, Vector

_SUBSTEPS = 4
_LONGEST = 200


def with_swing(pieces: dict[str, pd.DataFrame], fitted: Sequence[str], name: str, *, linear: bool) -> None:
    """Adds the simulated swing: gravity by the angle or by its sine, viscous friction, fitted to some of the pieces."""
    known = [pieces[piece] for piece in fitted]

    def left(x: Vector) -> Vector:
        starts = x[2:].reshape(-1, 2)
        parts = [_swing(x[:2], start, frame, linear) - frame[name] for start, frame in zip(starts, known, strict=True)]
        return np.concatenate([part.to_numpy() for part in parts])

    guess = [2.0 * np.log(_rate(known[-1][name])), np.log(0.05)]
    guess += [value for frame in known for value in _start(frame, name)]
    x = least_squares(left, np.array(guess), x_scale="jac").x
    starts = dict(zip(fitted, x[2:].reshape(-1, 2), strict=True))
    for piece, frame in pieces.items():
        start = starts[piece] if piece in starts else _start_of(x[:2], frame, name, linear)
        frame[name + SIMULATED] = _swing(x[:2], start, frame, linear)


def _rate(course: pd.Series) -> float:
    """Angular frequency [1/s] from the crossings of zero."""
    crossings = course.index[1:][np.diff(np.sign(course.to_numpy())) != 0]
    return float(np.pi / np.median(np.diff(crossings)))


def _start(frame: pd.DataFrame, name: str) -> tuple[float, float]:
    first = frame.iloc[: max(10, len(frame) // 100)]
    slope, level = np.polyfit(first.index, first[name], 2)[1:]
    return float(level), float(slope)


def _start_of(law: Vector, frame: pd.DataFrame, name: str, linear: bool) -> Vector:
    first = frame.iloc[:_LONGEST]
    found = least_squares(
        lambda start: (_swing(law, start, first, linear) - first[name]).to_numpy(), np.array(_start(frame, name))
    )
    return np.asarray(found.x)


def _swing(law: Vector, start: Vector, frame: pd.DataFrame, linear: bool) -> Vector:
    square, damping = np.exp(law)
    return np.asarray(_free_run(square, damping, start[0], start[1], frame.index.to_numpy(), linear))


@njit(cache=True)
def _free_run(square, damping, angle, speed, times, linear):
    """Half kick, drift, half kick, four steps a row: a hundredth of a period or less each."""
    course = np.empty(len(times))
    for k in range(len(times)):
        course[k] = angle
        if k + 1 == len(times):
            break
        step = (times[k + 1] - times[k]) / _SUBSTEPS
        half = np.exp(-0.5 * damping * step)
        for _ in range(_SUBSTEPS):
            speed = half * speed - 0.5 * step * square * (angle if linear else np.sin(angle))
            angle = angle + step * speed
            speed = half * (speed - 0.5 * step * square * (angle if linear else np.sin(angle)))
    return course
