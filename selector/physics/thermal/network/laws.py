"""How heat and cooling depend on what the machine does: laws of sources and films, and what they give."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from selector.errors import InputError
from selector.physics.checks import keep_arrays
from selector.types import Array, Matrix, Vector


@dataclass(frozen=True)
class Conditions:
    """What is done to the machine: values at `time_s`, each held until the next time (C: stepwise load).

    What is given as one number stays the same for all times.
    """

    time_s: Vector  #: (n_samples,): Increasing [s]; the last is the end
    #: spindle_speed, torque, ambient_degc, coolant_on, coolant_degc and machine_on: (n_samples,): [r/min], [N·m], [°C],
    #: 0 or 1, [°C], 0 or 1
    spindle_speed: Vector = field(default_factory=lambda: np.array(0.0))
    torque: Vector = field(default_factory=lambda: np.array(0.0))
    ambient_degc: Vector = field(default_factory=lambda: np.array(20.0))
    coolant_on: Vector = field(default_factory=lambda: np.array(0.0))
    coolant_degc: Vector = field(default_factory=lambda: np.array(20.0))
    machine_on: Vector = field(default_factory=lambda: np.array(1.0))

    def __post_init__(self) -> None:
        for name, given in vars(self).items():
            object.__setattr__(self, name, np.broadcast_to(given, np.shape(self.time_s)))
        keep_arrays(self, *vars(self))


@dataclass(frozen=True)
class HeatLaw:
    """Heat of a source [W]; several laws of one source add up.

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
    """Film coefficient of a surface [W/(m²·K)] and the fluid that it meets; several laws of one surface add up.

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


def summed(names: Iterable[str], amounts: Iterable[float]) -> dict[str, float]:
    """Name → sum of the amounts of all laws that have it."""
    total: dict[str, float] = {}
    for name, amount in zip(names, amounts, strict=True):
        total[name] = total.get(name, 0.0) + float(amount)
    return total


def film_coefficients(laws: Laws, conditions: Conditions) -> Matrix:
    """Film coefficients [W/(m²·K)], shape (n_samples, n_film_laws), in the order of `laws.films`."""
    columns = [
        (law.still_w_per_m2_k + law.speed_w_per_m2_k * _power_of_speed(conditions, law))
        * (conditions.coolant_on if law.while_coolant else 1.0)
        for law in laws.films
    ]
    return _table(columns, len(conditions.time_s))


def fluid_degc(laws: Laws, conditions: Conditions) -> Matrix:
    """Temperatures [°C] of the fluids, shape (n_samples, n_film_laws), in the order of `laws.films`."""
    fluids = {"ambient": conditions.ambient_degc, "coolant": conditions.coolant_degc}
    columns = [fluids.get(law.fluid, np.full(len(conditions.time_s), law.fixed_degc)) for law in laws.films]
    return _table(columns, len(conditions.time_s))


def heat_parts(laws: Laws, conditions: Conditions) -> tuple[Matrix, Matrix]:
    """Heat [W] that does not depend on temperature, and the lubricant's at its reference temperature.

    Both of shape (n_samples, n_heat_laws), in the order of `laws.heat`.
    """
    turns_per_s = np.abs(conditions.spindle_speed) / 60.0
    firm = [
        law.on_w * conditions.machine_on
        + law.turning_w * (turns_per_s > 0)
        + law.coolant_w * conditions.coolant_on
        + law.torque_share * np.abs(conditions.torque) * 2.0 * np.pi * turns_per_s
        for law in laws.heat
    ]
    lubricant = [law.speed_w * _power_of_speed(conditions, law) for law in laws.heat]
    return _table(firm, len(turns_per_s)), _table(lubricant, len(turns_per_s))


def _power_of_speed(conditions: Conditions, law: HeatLaw | FilmLaw) -> Vector:
    """(n / reference)^exponent, 0 at standstill whatever the exponent."""
    speed = np.abs(conditions.spindle_speed)
    return np.where(speed > 0, (speed / law.reference_rpm) ** law.exponent, 0.0)


def _table(columns: list[Vector], rows: int) -> Matrix:
    return np.column_stack(columns) if columns else np.zeros((rows, 0))


@dataclass(frozen=True)
class Lubricants:
    """Where the lubricants of some sources are, and how they soften."""

    rows: Array  #: (n_soft, n): Row times state = temperature of the lubricant
    per_k: Vector  #: (n_soft,): Softening [1/K]
    zero_rise: Vector  #: (n_soft,): Rise [K] at which a lubricant makes its nominal heat

    def heat_w(self, nominal_w: Vector, rise: Vector) -> Vector:
        """Heat [W] of the lubricants at these rises [K]."""
        return np.asarray(nominal_w * np.exp(-self.per_k * (rise - self.zero_rise)))

    def settled_heat_w(self, nominal_w: Vector, without: Vector, per_watt: Array) -> Vector:
        """Heat q [W] that agrees with the rises without + per_watt·q [K] that it brings about itself.

        Newton's method on the rises, its step halved until the disagreement shrinks. One lubricant alone is reached
        from the cold side without overshooting, because heat falls convexly with temperature.

        Raises InputError if it finds no agreement.
        """
        rise = without
        heat = self.heat_w(nominal_w, rise)
        gap = without + per_watt @ heat - rise
        own, size = np.eye(len(rise)), math.sqrt(gap @ gap)
        with np.errstate(over="ignore", invalid="ignore"):
            for _ in range(200):
                change = np.linalg.solve(own + per_watt * (self.per_k * heat), gap)
                before, share = size, 1.0
                while share > 1e-9:
                    ahead = rise + share * change
                    heat = self.heat_w(nominal_w, ahead)
                    gap = without + per_watt @ heat - ahead
                    size = math.sqrt(gap @ gap)
                    # once rounding is all that is left, it need not shrink
                    if size <= max(before, 1e-12 * (1.0 + float(np.abs(ahead).max()))):
                        break
                    share *= 0.5
                rise = ahead
                # far below what a sensor tells; the error of the heat is the square of the last change
                if share == 1.0 and np.abs(change).max() <= 1e-7 * (1.0 + np.abs(rise).max()):
                    return heat
        raise InputError(
            "lubricants whose heat and temperature do not settle",
            expected="heat that falls as a lubricant warms",
            where="simulation",
            advice="check softening_per_k, softening_degc and the heat of the sources",
        )
