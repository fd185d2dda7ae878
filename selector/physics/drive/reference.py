"""What an axis is asked to do: sampled positions with their speed and acceleration, and forces from outside."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from selector.errors import InputError

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Reference:
    """A course that an axis is to follow, on an even grid.

    Attributes
    ----------
    period_s : float
        Distance of the samples [s].
    position_m, speed_m_per_s, acceleration_m_per_s2 : ndarrays of shape (n_samples,)
        Commanded table position and its two derivatives.
    force_n : ndarray of shape (n_samples,) or None
        Force on the table from outside, held over a period [N]; None: none.

    Raises
    ------
    InputError
        Fewer than two samples, different lengths, or a value that is not finite.
    """

    period_s: float
    position_m: Vector
    speed_m_per_s: Vector
    acceleration_m_per_s2: Vector
    force_n: Vector | None = None

    def __post_init__(self) -> None:
        count = len(np.atleast_1d(self.position_m))
        for name in ("position_m", "speed_m_per_s", "acceleration_m_per_s2", "force_n"):
            given = getattr(self, name)
            if given is None:
                continue
            values = np.array(given, dtype=np.float64)
            if values.shape != (count,) or count < 2 or not np.isfinite(values).all():
                raise InputError(
                    f"{name} of shape {values.shape}" + ("" if np.isfinite(values).all() else " with missing values"),
                    expected=f"{max(count, 2)} finite numbers",
                    where="reference of the axis",
                    advice="give position, speed and acceleration at the same times",
                )
            values.setflags(write=False)
            object.__setattr__(self, name, values)
        if not (np.isfinite(self.period_s) and self.period_s > 0):
            raise InputError(
                f"a period of {self.period_s:g} s",
                expected="a number above 0",
                where="reference of the axis",
                advice="give the distance of the samples in seconds",
            )

    @property
    def time_s(self) -> Vector:
        """Times of the samples [s], shape (n_samples,)."""
        return np.asarray(np.arange(len(self.position_m)) * self.period_s, dtype=np.float64)
