"""The cut that turns vibration into a surface: speeds, feed, and the law of the cutting force."""

from __future__ import annotations

import math
from dataclasses import dataclass

from selector.physics.checks import require_finite, require_positive


@dataclass(frozen=True)
class Cutting:
    """Turning on a lathe.

    The law of the force is P = 10·C_p·t^x·S^y·V^n·K_p [N] with t in mm, S in mm/rev, V in m/min (V eq. 2).

    Attributes
    ----------
    diameter_mm : float
        Diameter of the workpiece at the cut [mm].
    workpiece_rpm : float
        Speed of the workpiece [r/min].
    feed_mm_per_rev : float
        S [mm/rev].
    force_coefficient, depth_exponent, feed_exponent, speed_exponent, force_correction : float
        C_p, x, y, n, K_p.
    """

    diameter_mm: float
    workpiece_rpm: float
    feed_mm_per_rev: float
    force_coefficient: float
    depth_exponent: float
    feed_exponent: float
    speed_exponent: float
    force_correction: float = 1.0

    def __post_init__(self) -> None:
        require_positive(
            self,
            "diameter_mm",
            "workpiece_rpm",
            "feed_mm_per_rev",
            "force_coefficient",
            "depth_exponent",
            "force_correction",
        )
        require_finite(self, "feed_exponent", "speed_exponent")

    @property
    def speed_m_per_min(self) -> float:
        """V, cutting speed [m/min]."""
        return math.pi * self.diameter_mm * 1e-3 * self.workpiece_rpm
