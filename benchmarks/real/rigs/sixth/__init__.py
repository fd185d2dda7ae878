"""Cases of the ninth exam, blind like those of the other sets: same form as benchmarks/real/rigs."""

from __future__ import annotations

from benchmarks.real.case import RealCase
from benchmarks.real.rigs.sixth import (
    buck_converter,
    excavator,
    hot_phone,
    lecture_rooms,
    load_cells,
    passive_house,
    pilot_crane,
    random_cell,
    resonant_circuit,
    speed_servo,
    toy_tower,
    winder,
)

_RIGS = (
    excavator, winder, load_cells, speed_servo, buck_converter, pilot_crane, resonant_circuit, toy_tower,
    hot_phone, random_cell, lecture_rooms, passive_house,
)  # fmt: skip

CASES: tuple[RealCase, ...] = tuple(case for rig in _RIGS for case in rig.CASES)
