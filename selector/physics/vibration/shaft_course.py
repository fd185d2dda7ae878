"""How fast does a shaft turn, and how far has it turned, if its speed runs straight between corners."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from selector.errors import InputError

Vector = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ShaftCourse:
    """Speed of a shaft over time: straight between corners, level before the first and after the last.

    Attributes
    ----------
    time_s, rpm : array-likes of shape (n_corners,)
        Corners: increasing times [s], and speeds of 0 or more [r/min].

    Raises
    ------
    InputError
        No corner, times that do not increase, or a speed that is missing or below 0.
    """

    time_s: Vector
    rpm: Vector

    def __post_init__(self) -> None:
        time, rpm = (np.array(values, dtype=np.float64) for values in (self.time_s, self.rpm))
        shaped = time.ndim == 1 and time.shape == rpm.shape and len(time) > 0
        if not shaped or not np.isfinite(time).all() or (np.diff(time) <= 0).any():
            raise InputError(
                f"times of shape {time.shape} and speeds of shape {rpm.shape}"
                if not shaped
                else "times that do not increase",
                expected="one speed a time, each time after the one before",
                where="shaft_rpm",
                advice="give the corners in the order of their times; make a jump a short slope",
            )
        if not (np.isfinite(rpm) & (rpm >= 0)).all():
            first = int(np.flatnonzero(~(np.isfinite(rpm) & (rpm >= 0)))[0])
            raise InputError(
                f"{rpm[first]:g} r/min at {time[first]:g} s",
                expected="speeds of 0 or more; orders are the same in both directions",
                where="shaft_rpm",
                advice="fill what is missing; split a run where the shaft turns back",
            )
        for name, values in (("time_s", time), ("rpm", rpm)):
            values.setflags(write=False)
            object.__setattr__(self, name, values)

    @property
    def is_level(self) -> bool:
        """Whether the speed never changes."""
        return bool((self.rpm == self.rpm[0]).all())

    def rpm_at(self, time_s: ArrayLike) -> Vector:
        """Speed at these times [r/min], shape (n_times,)."""
        return np.asarray(np.interp(np.asarray(time_s, dtype=np.float64), self.time_s, self.rpm))

    def turns_at(self, time_s: ArrayLike) -> Vector:
        """Turns since time 0, the exact integral of the speed, shape (n_times,)."""
        time = np.asarray(time_s, dtype=np.float64)
        return self._turns(time) - self._turns(np.zeros(1))

    def range_rpm(self, from_s: float, to_s: float) -> tuple[float, float]:
        """Lowest and highest speed from one time to another [r/min]."""
        inside = self.rpm[(self.time_s > from_s) & (self.time_s < to_s)]
        speeds = np.concatenate((inside, self.rpm_at([from_s, to_s])))
        return float(speeds.min()), float(speeds.max())

    def _turns(self, time: Vector) -> Vector:
        """Turns since the first corner."""
        whole = np.concatenate(([0.0], np.cumsum(np.diff(self.time_s) * (self.rpm[1:] + self.rpm[:-1]) / 2.0)))
        corner = np.clip(np.searchsorted(self.time_s, time, side="right") - 1, 0, len(self.time_s) - 1)
        since = time - self.time_s[corner]
        return (whole[corner] + since * (self.rpm[corner] + self.rpm_at(time)) / 2.0) / 60.0
