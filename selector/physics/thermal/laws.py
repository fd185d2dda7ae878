"""How heat and cooling depend on what the machine does: laws of sources and films, and the operating conditions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Conditions:
    """What is done to the machine: values at `time_s`, each held until the next time (C: stepwise load).

    Attributes
    ----------
    time_s : ndarray of shape (n_samples,)
        Increasing [s]; the last is the end.
    spindle_speed, torque, ambient_degc, coolant_on, coolant_degc, machine_on : ndarray of shape (n_samples,)
        [r/min], [N·m], [°C], 0 or 1, [°C], 0 or 1.
    """

    time_s: Vector
    spindle_speed: Vector
    torque: Vector
    ambient_degc: Vector
    coolant_on: Vector
    coolant_degc: Vector
    machine_on: Vector


@dataclass(frozen=True)
class HeatLaw:
    """Heat of a source [W].

    q = on_w·on + turning_w·[n > 0] + coolant_w·coolant + speed_w·(n / reference_rpm)^exponent·s
        + torque_share·M·2πn/60,   s = exp(−softening_per_k·(T_at − softening_degc))

    The factor s is the lubricant that grows thinner as it warms; `at` names the probe whose temperature T_at it has.
    """

    source: str
    on_w: float = 0.0
    turning_w: float = 0.0
    coolant_w: float = 0.0
    speed_w: float = 0.0
    reference_rpm: float = 1000.0
    exponent: float = 1.0
    torque_share: float = 0.0
    softening_per_k: float = 0.0
    softening_degc: float = 20.0
    at: str = ""


@dataclass(frozen=True)
class FilmLaw:
    """Film coefficient of a surface [W/(m²·K)] and the fluid that it meets.

    h = still_w_per_m2_k + speed_w_per_m2_k·(n / reference_rpm)^exponent, times the coolant's state if `while_coolant`.
    `fluid` is ``"ambient"``, ``"coolant"`` or ``"fixed"`` (then `fixed_degc`).
    """

    film: str
    still_w_per_m2_k: float
    speed_w_per_m2_k: float = 0.0
    reference_rpm: float = 1000.0
    exponent: float = 1.0
    while_coolant: bool = False
    fluid: str = "ambient"
    fixed_degc: float = 20.0


@dataclass(frozen=True)
class Laws:
    """The laws of all sources and films of a machine; a source or film without a law gives no heat."""

    heat: tuple[HeatLaw, ...]
    films: tuple[FilmLaw, ...]
