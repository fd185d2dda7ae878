"""What do thermometers and gauges make of the true course: lag, noise and resolution."""

from __future__ import annotations

import zlib

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]


def lagged(time_s: Vector, values: Vector, tau_s: float) -> Vector:
    """Response of a first-order sensor y' = (x − y)/τ that starts settled, shape (n_times,).

    Exact for a course that is straight between its samples; a lag of 0 changes nothing.
    """
    if tau_s <= 0.0 or len(values) < 2:
        return np.array(values)
    step = np.diff(time_s)
    left = np.exp(-step / tau_s)
    # over one step the input is x0 + slope·t: y = x1 − slope·τ + (y0 − x0 + slope·τ)·left
    offset = np.diff(values) / step * tau_s
    answer = np.array(values)
    for i, keep in enumerate(left):
        answer[i + 1] = values[i + 1] - offset[i] + (answer[i] - values[i] + offset[i]) * keep
    return answer


def read_out(values: Vector, *, noise: float, resolution: float, seed: int, channel: str) -> Vector:
    """Values with Gaussian noise of this standard deviation, rounded to multiples of the resolution; 0 = none.

    The noise depends on the seed and the channel's name only: another sensor in the list does not change it.
    """
    random = np.random.default_rng([seed, zlib.crc32(channel.encode())])
    answer = values + noise * random.standard_normal(len(values)) if noise else np.array(values)
    # twelve decimals: 20.31 and not 20.310000000000002; adding zero turns −0.0 into 0.0
    return np.round(np.round(answer / resolution) * resolution, 12) + 0.0 if resolution else answer


def seed_of_run(seed: int, run: str) -> int:
    """A seed for one of several runs, so that their noise differs whatever their order."""
    return int(np.random.SeedSequence([seed, zlib.crc32(run.encode())]).generate_state(1)[0])
