"""How far the ripple of the smoothed voltage rises above its mean: there a quick relay already trips."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from selector.errors import InputError
from selector.physics.checks import require_positive

Vector = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class RippleCrest:
    """Peaks of the ripple over allowances that stay.

    Attributes
    ----------
    allowance_um, crest_v : ndarray of shape (n_points,)
        Increasing [µm]; highest smoothed voltage above its mean [V].
    time_constant_s : float
        T_Φ of the filter behind which that is [s].
    frequency_hz : float
        Of the rectified swing, at which the ripple is [Hz].
    """

    allowance_um: Vector
    crest_v: Vector
    time_constant_s: float
    frequency_hz: float

    def __post_init__(self) -> None:
        require_positive(self, "time_constant_s", "frequency_hz")
        allowance, crest = (np.array(values, dtype=np.float64) for values in (self.allowance_um, self.crest_v))
        if (
            allowance.ndim != 1 or allowance.shape != crest.shape or len(allowance) < 2
            or not np.isfinite([allowance, crest]).all() or (np.diff(allowance) <= 0).any() or (crest < 0).any()
        ):  # fmt: skip
            raise InputError(
                f"allowances of shape {allowance.shape} and crests of shape {crest.shape}",
                expected="two or more finite pairs, the allowances increasing, no crest below 0",
                where="crest_v",
                advice="sort the points and keep one an allowance",
            )
        for name, values in (("allowance_um", allowance), ("crest_v", crest)):
            values.flags.writeable = False
            object.__setattr__(self, name, values)

    def crest_at(self, allowance_um: ArrayLike, time_constant_s: float) -> Vector:
        """Peaks behind a filter of this T_Φ, shape of `allowance_um` [V]; beyond the points that of the nearest one.

        A ripple at ω passes a filter by 1/√(1 + (ω·T_Φ)²).
        """
        omega = 2 * math.pi * self.frequency_hz
        less = math.hypot(1.0, omega * self.time_constant_s) / math.hypot(1.0, omega * time_constant_s)
        return np.asarray(less * np.interp(np.asarray(allowance_um, dtype=np.float64), self.allowance_um, self.crest_v))
