"""Which sizes come off a grinder whose gauge decides when to stop: every part ground in time, step by step."""

from __future__ import annotations

import numpy as np
from numba import njit

from selector.types import Vector

STEP_S = 4e-3
"""Step of the grinding of a part [s]."""


GROOVE_SHARE = 0.3
"""Share of the time in which the finger falls in."""


def ground_sizes(allowance_um: Vector, feed_um_per_s: Vector, lag_s: float, groove_um: Vector) -> Vector:
    """Size of every part when the gauge let go [µm over the target], shape (n_parts,).

    The wheel comes in with four times the fine feed until the reading is 25 µm over the target, then with the fine
    feed `feed_um_per_s`; machine and part give way with a time constant of 0.3 s. The gauge reads through two lags in
    a row that delay it by `lag_s` altogether. Grooves pass 23 times a second: in `GROOVE_SHARE` of the time the finger
    falls in, by up to `groove_um`, and comes out again slowly, so that the reading is too low.
    """
    result: Vector = _ground(allowance_um, feed_um_per_s, lag_s, groove_um)
    return result


def read_course(allowance_um: float, feed_um_per_s: float, lag_s: float, n_rows: int, period_s: float) -> Vector:
    """What the gauge reads in time while a part is ground and 1 s after [µm over the target]; then it is held."""
    result: Vector = _course(allowance_um, feed_um_per_s, lag_s, n_rows, round(period_s / STEP_S))
    return result


@njit(cache=True, nogil=True)
def _ground(allowance, feed, lag_s, depth):  # type: ignore[no-untyped-def]
    result = np.empty(len(allowance))
    h = STEP_S
    pole = 1.0 - np.exp(-h / (0.5 * lag_s)) if lag_s > 0.0 else 1.0
    give = 1.0 - np.exp(-h / 0.3)
    for part in range(len(allowance)):
        if lag_s <= 0.0 and depth[part] <= 0.0:
            # a reading without fault stops at the target
            result[part] = 0.0
            continue
        size = allowance[part]
        rate = 0.0
        first = second = size
        finger = 0.0
        last_reading = size
        last_size = size
        k = 0
        while True:
            wanted = 4.0 * feed[part] if last_reading > 25.0 else feed[part]
            rate += give * (wanted - rate)
            last_size = size
            size -= h * rate
            turn = (k * h * 23.0 + 0.37 * part) % 1.0
            drop = depth[part] if turn < GROOVE_SHARE else 0.0
            finger += 0.85 * (drop - finger) if drop > finger else 0.2 * (drop - finger)
            seen = size - finger
            first += pole * (seen - first)
            second += pole * (first - second)
            reading = second
            k += 1
            if reading <= 0.0 or k > 10000:
                # where between the two steps the reading crossed the target
                over = last_reading - reading
                inside = last_reading / over if over > 0.0 else 1.0
                result[part] = last_size + min(max(inside, 0.0), 1.0) * (size - last_size)
                break
            last_reading = reading
    return result


@njit(cache=True, nogil=True)
def _course(allowance, feed, lag_s, n_rows, every):  # type: ignore[no-untyped-def]
    result = np.empty(n_rows)
    h = STEP_S
    pole = 1.0 - np.exp(-h / (0.5 * lag_s)) if lag_s > 0.0 else 1.0
    give = 1.0 - np.exp(-h / 0.3)
    size = first = second = allowance
    rate = 0.0
    for k in range(n_rows * every):
        if k % every == 0:
            result[k // every] = second
        wanted = 0.0 if size <= 0.0 else (4.0 * feed if size > 25.0 else feed)
        rate += give * (wanted - rate)
        size -= h * rate
        first += pole * (size - first)
        second += pole * (first - second)
    return result
