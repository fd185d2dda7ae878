"""Cases of the seventh exam, blind like those of the second and third set: same form as benchmarks/real/rigs."""

from __future__ import annotations

from benchmarks.real.case import RealCase
from benchmarks.real.rigs.fourth import (
    aero_shield,
    balance_car,
    bob_pendulum,
    cell_18650,
    fermenter,
    heat_pad,
    heat_shield,
    link_shield,
    micromouse,
    moto_shield,
    odrive_chirp,
    rack_pinion,
    rc_filter,
    thrust_stand,
)

_RIGS = (
    odrive_chirp, rack_pinion, balance_car, micromouse, moto_shield, thrust_stand, link_shield, aero_shield,
    bob_pendulum, rc_filter, heat_shield, heat_pad, fermenter, cell_18650,
)  # fmt: skip

CASES: tuple[RealCase, ...] = tuple(case for rig in _RIGS for case in rig.CASES)
