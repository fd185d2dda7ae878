"""Cases of the blind exam, rig by rig: same form as benchmarks/real/rigs."""

from __future__ import annotations

from benchmarks.real.case import RealCase
from benchmarks.real.rigs.second import (
    cooled_water,
    electric,
    exchanger,
    flexible_arm,
    hydraulic,
    lab_pendulum,
    magnetic_damper,
    robot_joints,
    rotary_pendulum,
    servos,
    temperature_lab,
    two_motors,
    weather_loggers,
)

_RIGS = (
    robot_joints, magnetic_damper, temperature_lab, two_motors, lab_pendulum, rotary_pendulum, hydraulic,
    cooled_water, exchanger, flexible_arm, servos, electric, weather_loggers,
)  # fmt: skip

CASES: tuple[RealCase, ...] = tuple(case for rig in _RIGS for case in rig.CASES)
