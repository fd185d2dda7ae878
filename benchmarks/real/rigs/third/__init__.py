"""Cases of the sixth exam, blind like those of the second set: same form as benchmarks/real/rigs."""

from __future__ import annotations

from benchmarks.real.case import RealCase
from benchmarks.real.rigs.third import (
    cell,
    dipped_probe,
    driven_beam,
    eccentric,
    machine_growth,
    open_arm,
    orbit_computer,
    printer_bed,
    rotation_servo,
    sensor_package,
    shaken_board,
    steam_rod,
    surgical_arm,
    throttle,
)

_RIGS = (
    throttle, open_arm, surgical_arm, eccentric, rotation_servo, dipped_probe, orbit_computer, printer_bed,
    machine_growth, cell, steam_rod, sensor_package, shaken_board, driven_beam,
)  # fmt: skip

CASES: tuple[RealCase, ...] = tuple(case for rig in _RIGS for case in rig.CASES)
