"""At which temperatures lubricants settle whose heat falls as they warm."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from selector.errors import InputError

Vector = NDArray[np.float64]
Array = NDArray[np.float64]


@dataclass(frozen=True)
class Lubricants:
    """Where the lubricants of some sources are, and how they soften.

    Attributes
    ----------
    rows : ndarray of shape (n_soft, n)
        Row times state = temperature of the lubricant.
    per_k : ndarray of shape (n_soft,)
        Softening [1/K].
    zero_rise : ndarray of shape (n_soft,)
        Rise [K] at which a lubricant makes its nominal heat.
    """

    rows: Array
    per_k: Vector
    zero_rise: Vector

    def heat_w(self, nominal_w: Vector, rise: Vector) -> Vector:
        """Heat [W] of the lubricants at these rises [K]."""
        return np.asarray(nominal_w * np.exp(-self.per_k * (rise - self.zero_rise)))

    def settled_heat_w(self, nominal_w: Vector, without: Vector, per_watt: Array) -> Vector:
        """Heat q [W] that agrees with the rises without + per_watt·q [K] that it brings about itself.

        Newton's method on the rises, its step halved until the disagreement shrinks. One lubricant alone is reached
        from the cold side without overshooting, because heat falls convexly with temperature.

        Raises
        ------
        InputError
            If it finds no agreement.
        """
        rise = without
        heat = self.heat_w(nominal_w, rise)
        gap = without + per_watt @ heat - rise
        for _ in range(200):
            change = np.linalg.solve(np.eye(len(rise)) + per_watt * (self.per_k * heat), gap)
            size, share = float(np.linalg.norm(gap)), 1.0
            while share > 1e-9:
                ahead = rise + share * change
                with np.errstate(over="ignore", invalid="ignore"):
                    heat = self.heat_w(nominal_w, ahead)
                    gap = without + per_watt @ heat - ahead
                    # once rounding is all that is left, it need not shrink
                    if np.linalg.norm(gap) <= max(size, 1e-12 * (1.0 + float(np.max(np.abs(ahead))))):
                        break
                share *= 0.5
            rise = ahead
            # far below what a sensor tells; the error of the heat is the square of the last change
            if share == 1.0 and np.max(np.abs(change)) <= 1e-7 * (1.0 + np.max(np.abs(rise))):
                return heat
        raise InputError(
            "lubricants whose heat and temperature do not settle",
            expected="heat that falls as a lubricant warms",
            where="simulation",
            advice="check softening_per_k, softening_degc and the heat of the sources",
        )
