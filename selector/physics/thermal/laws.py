"""How heat and cooling depend on what the machine does: laws of sources and films, and the operating conditions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from selector.errors import InputError

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

    Raises
    ------
    InputError
        If there are fewer than two times, if they do not increase, or a value is missing or has no meaning.
    """

    time_s: Vector
    spindle_speed: Vector
    torque: Vector
    ambient_degc: Vector
    coolant_on: Vector
    coolant_degc: Vector
    machine_on: Vector

    def __post_init__(self) -> None:
        time = np.array(self.time_s, dtype=np.float64)
        if time.ndim != 1 or len(time) < 2:
            _refuse(f"{time.size} times", "at least two: a start and an end", "add the time at which the run ends")
        for name in ("time_s", "spindle_speed", "torque", "ambient_degc", "coolant_on", "coolant_degc", "machine_on"):
            values = np.array(getattr(self, name), dtype=np.float64)
            if values.shape != time.shape:
                _refuse(f"{values.size} values of {name} for {time.size} times", "one value for every time", _FILL)
            if not np.isfinite(values).all():
                row = int(np.argmax(~np.isfinite(values))) + 1
                _refuse(f"no number for {name} in row {row}", "a number in every row", _FILL)
            # derivatives are taken at "off" and "on", a little to both sides
            odd = (values < -1e-4) | (values > 1 + 1e-4)
            if name in ("coolant_on", "machine_on") and odd.any():
                row = int(np.argmax(odd)) + 1
                _refuse(f"{name} = {values[row - 1]:g} in row {row}", "0 (off) to 1 (on)", "write 0 or 1")
            values.setflags(write=False)
            object.__setattr__(self, name, values)
        if (np.diff(time) <= 0).any():
            row = int(np.argmax(np.diff(time) <= 0)) + 2
            _refuse(
                f"time {time[row - 1]:g} s after {time[row - 2]:g} s",
                "times that increase",
                "keep one row a time, sorted",
            )

    @classmethod
    def held(
        cls,
        time_s: ArrayLike,
        *,
        spindle_speed: ArrayLike = 0.0,
        torque: ArrayLike = 0.0,
        ambient_degc: ArrayLike = 20.0,
        coolant_on: ArrayLike = 0.0,
        coolant_degc: ArrayLike = 20.0,
        machine_on: ArrayLike = 1.0,
    ) -> Conditions:
        """Conditions in which what is given as one number stays the same for all times."""
        time = np.array(time_s, dtype=np.float64)

        def column(value: ArrayLike) -> Vector:
            values = np.array(value, dtype=np.float64)
            return np.full(time.shape, values) if values.ndim == 0 else values

        return cls(
            time,
            column(spindle_speed),
            column(torque),
            column(ambient_degc),
            column(coolant_on),
            column(coolant_degc),
            column(machine_on),
        )


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


_FILL = "fill the gaps before simulating"


def _refuse(found: str, expected: str, advice: str) -> None:
    raise InputError(found, expected=expected, where="operating conditions", advice=advice)
