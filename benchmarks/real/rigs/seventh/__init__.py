"""Cases of the tenth exam, blind like those of the other sets: same form as benchmarks/real/rigs."""

from __future__ import annotations

from benchmarks.real.case import RealCase
from benchmarks.real.rigs.seventh import (
    active_suspension,
    direct_drive,
    double_pendulum,
    driven_pendulum,
    hot_water,
    lab_motor,
    laser_beam,
    office_tower,
    roaster,
    solar_plant,
    two_capacitors,
)

_RIGS = (
    lab_motor, driven_pendulum, double_pendulum, direct_drive, office_tower, laser_beam, active_suspension,
    two_capacitors, roaster, hot_water, solar_plant,
)  # fmt: skip

CASES: tuple[RealCase, ...] = tuple(case for rig in _RIGS for case in rig.CASES)
