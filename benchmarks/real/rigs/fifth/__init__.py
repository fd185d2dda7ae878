"""Cases of the eighth exam, blind like those of the other sets: same form as benchmarks/real/rigs."""

from __future__ import annotations

from benchmarks.real.case import RealCase
from benchmarks.real.rigs.fifth import (
    discharged_cell,
    heater_board,
    hung_payload,
    infrared_cell,
    made_spring,
    motor_kit,
    ruler_robot,
    soccer_robot,
    straw_house,
    tank_pair,
    two_rooms,
    water_cup,
)

_RIGS = (
    soccer_robot, motor_kit, made_spring, tank_pair, ruler_robot, hung_payload,
    heater_board, discharged_cell, infrared_cell, water_cup, two_rooms, straw_house,
)  # fmt: skip

CASES: tuple[RealCase, ...] = tuple(case for rig in _RIGS for case in rig.CASES)
