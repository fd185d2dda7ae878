"""How balls in grooves give way: Hertz contact, and two such contacts preloaded against each other."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import optimize, special

from selector.physics.checks import require_positive

Vector = NDArray[np.float64]
POISSON = 0.3


@dataclass(frozen=True)
class PreloadedContact:
    """Two equal contacts, force κ·δ^(3/2) each, pressed against each other by a preload.

    A load F deflects them by δ: ``F = κ·(δ0 + δ)₊^1.5 − κ·(δ0 − δ)₊^1.5`` with δ0 = (preload/κ)^(2/3); odd in F. The
    stiffness falls from 3·preload/(2·δ0)·2 at F = 0 to 1/√2 of it at F = 2^1.5·preload, where one side lets go, and
    grows with F^(1/3) from there on.

    Attributes
    ----------
    load_per_deflection : float
        κ of one side [N/m^1.5].
    preload_n : float
        Preload [N].
    """

    load_per_deflection: float
    preload_n: float

    def __post_init__(self) -> None:
        require_positive(self, "load_per_deflection", "preload_n")

    @classmethod
    def from_rigidity(cls, stiffness_n_per_m: float, at_preload_n: float, preload_n: float) -> PreloadedContact:
        """That which has this stiffness, unloaded, at `at_preload_n`; K = 3·κ^(2/3)·preload^(1/3)."""
        return cls((stiffness_n_per_m / (3.0 * at_preload_n ** (1.0 / 3.0))) ** 1.5, preload_n)

    @property
    def preload_deflection_m(self) -> float:
        """δ0, by which the preload alone deflects each side [m]."""
        return math.cbrt(self.preload_n / self.load_per_deflection) ** 2

    @property
    def release_n(self) -> float:
        """Load at which one side lets go: 2^1.5·preload [N]."""
        return 2.0 * math.sqrt(2.0) * self.preload_n

    def deflection_m(self, load_n: ArrayLike) -> Vector:
        """Deflection under an axial load [m], shape of `load_n` [N]; closed form."""
        load = np.asarray(load_n, dtype=np.float64)
        return np.asarray(np.sign(load) * self.preload_deflection_m * self._ratio(load))

    def stiffness_n_per_m(self, load_n: ArrayLike) -> Vector:
        """dF/dδ [N/m], shape of `load_n` [N]."""
        ratio = self._ratio(np.asarray(load_n, dtype=np.float64))
        unloaded = 1.5 * self.preload_n / self.preload_deflection_m
        return np.asarray(unloaded * (np.sqrt(1.0 + ratio) + np.sqrt(np.maximum(1.0 - ratio, 0.0))))

    def _ratio(self, load: Vector) -> Vector:
        # with a = √(1+u), b = √(1−u), d = a − b the law is the cubic 3d − d³/2 = |F|/P
        share = np.abs(load) / self.preload_n
        d = 2.0 * math.sqrt(2.0) * np.sin(np.arcsin(np.minimum(share / (2.0 * math.sqrt(2.0)), 1.0)) / 3.0)
        both = d * np.sqrt(1.0 - d * d / 4.0)
        return np.where(share < 2.0 * math.sqrt(2.0), both, share ** (2.0 / 3.0) - 1.0)


def groove_approach(
    ball_diameter_m: float, conformity: float, pitch_circle_m: float, contact_angle_rad: float, modulus_pa: float
) -> float:
    """How much two grooves approach that press one ball by Q along the contact: c of δ = c·Q^(2/3) [m/N^(2/3)].

    Hertz contact of ball and inner groove and of ball and outer groove in series; steel on steel, ν = 0.3. Curvatures
    as in Harris, Rolling Bearing Analysis, ch. 2 and 6: across the rolling direction the groove has the radius
    conformity·ball diameter, along it the inner one is convex and the outer one hollow.
    """
    gamma = ball_diameter_m * math.cos(contact_angle_rad) / pitch_circle_m
    return sum(
        _approach(2.0 / ball_diameter_m, -1.0 / (conformity * ball_diameter_m), along, modulus_pa)
        for along in (
            2.0 * gamma / (ball_diameter_m * (1.0 - gamma)),
            -2.0 * gamma / (ball_diameter_m * (1.0 + gamma)),
        )
    )


def axial_load_per_deflection(approach: float, balls: float, contact_angle_rad: float, helix_rad: float = 0.0) -> float:
    """κ of an axial load on a row of balls, F = κ·δ^1.5 [N/m^1.5], from `groove_approach`'s c [m/N^(2/3)].

    F = Z·Q·sin α·cos φ and δ = c·Q^(2/3)/(sin α·cos φ), so κ = Z·(sin α·cos φ)^(5/2)/c^(3/2).
    """
    return float(balls * (math.sin(contact_angle_rad) * math.cos(helix_rad)) ** 2.5 / approach**1.5)


def _approach(ball: float, across: float, along: float, modulus_pa: float) -> float:
    total = 2.0 * ball + across + along
    difference = abs(along - across) / total
    # the ellipse's axes a/b = 1/√(1−m) are those whose integrals give this difference of curvatures
    m = optimize.brentq(lambda value: _difference(value) - difference, 1e-12, 1.0 - 1e-14, xtol=1e-15)
    axes = 1.0 / math.sqrt(1.0 - m)
    k, e = float(special.ellipk(m)), float(special.ellipe(m))
    factor = 2.0 * k / math.pi * (math.pi / (2.0 * axes**2 * e)) ** (1.0 / 3.0)
    compliance = 2.0 * (1.0 - POISSON**2) / modulus_pa
    return float(factor * (1.5 / total * compliance) ** (2.0 / 3.0) * total / 2.0)


def _difference(m: float) -> float:
    axes2 = 1.0 / (1.0 - m)
    k, e = float(special.ellipk(m)), float(special.ellipe(m))
    return ((axes2 + 1.0) * e - 2.0 * k) / ((axes2 - 1.0) * e)
