"""All cases, rig by rig."""

from __future__ import annotations

from benchmarks.real.case import RealCase
from benchmarks.real.rigs import (
    anti_cogging,
    ball_beam,
    bath,
    bottle_tank,
    bridge,
    cart_pendulum,
    cart_rail,
    eighth,
    f16,
    fifth,
    fourth,
    friction_damper,
    heated_bar,
    heated_rod,
    incubator,
    known,
    odrive,
    pneumatic,
    probe_drift,
    quarter_drone,
    rosa,
    second,
    servo_play,
    seventh,
    sixth,
    station,
    telescope,
    third,
    two_pendulums,
    water_loop,
)

_RIGS = (
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
    odrive,
    probe_drift,
    cart_pendulum,
    f16,
    incubator,
    two_pendulums,
    water_loop,
    friction_damper,
    bottle_tank,
    heated_rod,
    known,
)

CASES: tuple[RealCase, ...] = (
    *(case for rig in _RIGS for case in rig.CASES), *second.CASES, *third.CASES, *fourth.CASES,
    *fifth.CASES, *sixth.CASES, *seventh.CASES, *eighth.CASES,
)  # fmt: skip
