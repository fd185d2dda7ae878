"""Which poles has the loop of an axis, and which of them grow."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from selector.physics.drive.axis import Axis
from selector.physics.drive.closed_loop import closed_loop, servo_of
from selector.physics.drive.sampled_loop import sampled_closed_loop, too_far_apart

_ROUNDING = 1e-9
"""Share of the fastest pole below which the sign of the slowest is rounding."""


def loop_poles(axis: Axis) -> NDArray[np.complex128]:
    """Poles of the closed loop [1/s], the slowest or growing ones first; of a sampled servo ln(z)/sample time.

    Raises
    ------
    InputError
        If the axis has no servo, or numbers too far apart to be calculated with.
    """
    servo = servo_of(axis)
    try:
        if servo.sample_s > 0:
            z = sampled_closed_loop(axis).poles
            # what decays within one sample has no logarithm and is of no interest here
            poles: NDArray[np.complex128] = np.asarray(np.log(np.where(np.abs(z) > 1e-12, z, 1e-12)) / servo.sample_s)
        else:
            poles = closed_loop(axis).poles
    except (np.linalg.LinAlgError, ValueError):
        # eigenvalues of what is not finite
        raise too_far_apart() from None
    return np.asarray(poles[np.argsort(-poles.real, kind="stable")])


def growing_poles(poles: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Those of the poles of a loop that do not decay.

    Poles at 0 up to rounding decay: the constant term of the characteristic polynomial is a product of gains and never
    0, so none comes through 0 from the side where all are while the gains are small.
    """
    slow = np.abs(poles) <= _ROUNDING * np.abs(poles).max()
    return np.asarray(poles[(poles.real >= 0.0) & ~slow])
