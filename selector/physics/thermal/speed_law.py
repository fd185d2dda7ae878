"""How the steady level of a thermal mode depends on the spindle speed: between the tested speeds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
STANDING = 0.002
"""Up to this share of the reference speed a spindle stands: noise of its sensor."""


@dataclass(frozen=True)
class SpeedLaw:
    """Functions of the speed that every gain is a linear combination of: none of them heats a spindle that stands.

    Without knots, term j is (n / reference_rpm)^exponents[j]; the exponent 0 is 1 while the spindle turns, for axes and
    pumps that run with it. With knots there is one exponent p, and term j is (n / reference_rpm)^p times the hat
    function of knot j: a power law whose factor is free at every tested speed, linear between them, constant beyond.

    Attributes
    ----------
    exponents : tuple of float
        Exponents, 0 or above.
    reference_rpm : float
        The speed at which powers are 1 [r/min]: the fastest tested one.
    knots_rpm : tuple of float
        Increasing speeds above 0 [r/min], or empty.
    """

    exponents: tuple[float, ...]
    reference_rpm: float
    knots_rpm: tuple[float, ...] = ()

    def terms(self, speed_rpm: Vector) -> Vector:
        """Values of the terms, shape (n_speeds, n_terms), at speeds [r/min] of shape (n_speeds,)."""
        speed = np.asarray(speed_rpm, dtype=np.float64)
        share = speed[:, None] / self.reference_rpm
        powers = np.where(share > STANDING, share ** np.array(self.exponents), 0.0)
        if not self.knots_rpm:
            return powers
        hats = [np.interp(speed, self.knots_rpm, row) for row in np.eye(len(self.knots_rpm))]
        return powers * np.column_stack(hats)

    @property
    def size(self) -> int:
        """Number of terms."""
        return len(self.knots_rpm) or len(self.exponents)

    @property
    def title(self) -> str:
        """The law in words."""
        powers = ", ".join(f"n^{exponent:.3g}" if exponent else "turning" for exponent in self.exponents)
        return f"{powers} with a factor at each of {len(self.knots_rpm)} tested speeds" if self.knots_rpm else powers
