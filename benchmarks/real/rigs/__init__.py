"""All cases, rig by rig."""

from __future__ import annotations

from benchmarks.real.case import RealCase
from benchmarks.real.rigs import (
    anti_cogging,
    ball_beam,
    bath,
    bridge,
    cart_rail,
    heated_bar,
    known,
    pneumatic,
    quarter_drone,
    rosa,
    servo_play,
    station,
    telescope,
)

_RIGS = (
    known,
    rosa,
    pneumatic,
    anti_cogging,
    quarter_drone,
    bridge,
    station,
    bath,
    telescope,
    cart_rail,
    ball_beam,
    servo_play,
    heated_bar,
)

CASES: tuple[RealCase, ...] = tuple(case for rig in _RIGS for case in rig.CASES)
