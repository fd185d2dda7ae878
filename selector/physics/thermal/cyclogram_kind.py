"""Which of the basic kinds a duty cycle is: rising, intermittent, falling, or a combination of them."""

from __future__ import annotations

from typing import Literal

import numpy as np

from selector.physics.thermal.cyclogram import Cyclogram

Kind = Literal["idle", "continuous", "rising", "intermittent", "falling", "random"]


def cyclogram_kind(cyclogram: Cyclogram) -> Kind:
    """The kind of a duty cycle (C: three basic kinds, of which all others are combinations).

    ``continuous``: one speed; ``rising``, ``falling``: the speed only goes up, or only down, in steps;
    ``intermittent``: one speed and pauses; ``idle``: it never turns; ``random``: anything else.
    """
    speed = cyclogram.speed_rpm[np.r_[True, np.diff(cyclogram.speed_rpm) != 0]]
    turning = np.unique(speed[speed > 0])
    if not len(turning):
        return "idle"
    if len(speed) == 1:
        return "continuous"
    if len(turning) == 1 and (speed[1:] == 0).any():
        return "intermittent"
    if (np.diff(speed) > 0).all():
        return "rising"
    return "falling" if (np.diff(speed) < 0).all() else "random"
