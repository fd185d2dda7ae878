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

        Newton's method on the rises. For one lubricant it comes from the cold side without overshooting and always
        ends, because heat falls convexly with temperature.

        Raises
        ------
        InputError
            If it finds no agreement.
        """
        rise = without
        for _ in range(200):
            heat = self.heat_w(nominal_w, rise)
            slope = np.eye(len(rise)) + per_watt * (self.per_k * heat)
            change = np.linalg.solve(slope, without + per_watt @ heat - rise)
            rise = rise + change
            # far below what a sensor tells; the error of the heat is the square of the last change
            if np.max(np.abs(change)) <= 1e-7 * (1.0 + np.max(np.abs(rise))):
                return self.heat_w(nominal_w, rise)
        raise InputError(
            "lubricants whose heat and temperature do not settle",
            expected="heat that falls as a lubricant warms",
            where="simulation",
            advice="check softening_per_k, softening_degc and the heat of the sources",
        )
