"""How fast a machine warms and cools: its slowest time constants, standing and at the fastest speed of a run."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from selector.physics.thermal.eigenmodes import eigenmodes
from selector.physics.thermal.law_values import film_coefficients
from selector.physics.thermal.laws import Conditions, Laws
from selector.physics.thermal.model_systems import HeatMachine
from selector.physics.thermal.modes import ModalModel

Vector = NDArray[np.float64]

SLOWEST = 6


def slowest_time_constants(machine: HeatMachine | ModalModel, conditions: Conditions) -> dict[str, Vector]:
    """What is held → the slowest time constants [s] then, longest first; infinite for a part that no fluid reaches.

    The machine stands without coolant, turns at the fastest speed of the conditions, and does so with coolant if that
    is ever on; states that have the same films are told once. Those of a reduced system are its slowest ones, which the
    reduction keeps. Thermal modes say theirs themselves.
    """
    if isinstance(machine, ModalModel):
        return {"standing": machine.tau_s[::-1][:SLOWEST]}
    fastest = float(conditions.spindle_speed.max())
    corners = {"standing": (0.0, 0.0), f"at {fastest:g} r/min": (fastest, 0.0)}
    if conditions.coolant_on.any():
        corners[f"at {fastest:g} r/min with coolant"] = (fastest, 1.0)
    found: dict[str, Vector] = {}
    seen = []
    for name, (speed, coolant) in corners.items():
        films = _films(machine.laws, conditions, speed, coolant)
        if films not in seen:
            found[name] = eigenmodes(machine.system, films).tau_s[:SLOWEST]
        seen.append(films)
    return found


def _films(laws: Laws, conditions: Conditions, speed_rpm: float, coolant_on: float) -> dict[str, float]:
    """Film → coefficient [W/(m²·K)] while this is held."""
    count = len(conditions.time_s)
    held = replace(conditions, spindle_speed=np.full(count, speed_rpm), coolant_on=np.full(count, coolant_on))
    total: dict[str, float] = {}
    for law, value in zip(laws.films, film_coefficients(laws, held)[0].tolist(), strict=True):
        total[law.film] = total.get(law.film, 0.0) + value
    return total
