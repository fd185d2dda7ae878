"""Cases of the eleventh exam, blind like those of the other sets: same form as benchmarks/real/rigs."""

from __future__ import annotations

from benchmarks.real.case import RealCase
from benchmarks.real.rigs.eighth import (
    brick_wall,
    chirped_motor,
    current_heater,
    glass_furnace,
    heated_box,
    hung_pendulum,
    loaded_oven,
    magnet,
    shaking_table,
    shuttle_car,
    three_thermometers,
    twisted_string,
)

_RIGS = (
    shaking_table, chirped_motor, twisted_string, shuttle_car, hung_pendulum, magnet, current_heater,
    heated_box, loaded_oven, three_thermometers, brick_wall, glass_furnace,
)  # fmt: skip

CASES: tuple[RealCase, ...] = tuple(case for rig in _RIGS for case in rig.CASES)
