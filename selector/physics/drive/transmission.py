"""Where the travel differs from lead × turns: backlash, pitch errors, and a spring that is not one number."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from selector.errors import InputError
from selector.physics.checks import require_finite, require_not_negative, require_positive

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Transmission:
    """Where the travel differs from lead × turns.

    Attributes
    ----------
    backlash_m : float
        Lost motion at reversal, the whole gap [m]; three-mass axis only.
    pitch_amplitude_m, pitch_phase_rad : float
        Error that repeats with the lead: amplitude·sin(θl + phase) [m]; of a rigid axis θl is 2π a `ripple_period`.
    pitch_slope : float
        Cumulative pitch error, travel per travel (1e-6: 1 µm/m).
    pitch_position_m, pitch_error_m : tuple of float
        Table of cumulative pitch error over the nominal travel R·θl [m], straight between,
        constant beyond; may be empty.
    """

    backlash_m: float = 0.0
    pitch_amplitude_m: float = 0.0
    pitch_phase_rad: float = 0.0
    pitch_slope: float = 0.0
    pitch_position_m: tuple[float, ...] = ()
    pitch_error_m: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        require_not_negative(self, "backlash_m", "pitch_amplitude_m")
        require_finite(self, "pitch_phase_rad", "pitch_slope")
        x, e = np.array(self.pitch_position_m), np.array(self.pitch_error_m)
        if len(x) != len(e) or not (np.isfinite(x).all() and np.isfinite(e).all()) or (np.diff(x) <= 0).any():
            raise InputError(
                f"{len(x)} positions and {len(e)} errors of pitch",
                expected="as many errors as positions, positions that increase",
                where="pitch_position_m",
                advice="sort the table of the pitch error and give one error a position",
            )


@dataclass(frozen=True)
class AxialCompliance:
    """How the axial spring gives way under load and along the travel, instead of one stiffness Ke.

    Deflection = force·shaft(x) + joints(force). `shaft(x)` is x'/(E·A) of a screw held at one end, or of two lengths
    in parallel held at both, with x' = `origin_m` + table position.

    Attributes
    ----------
    force_n, joint_deflection_m : ndarrays of shape (n_points,)
        Deflection of nut and bearings together [m] at axial forces [N], both increasing through (0, 0).
    shaft_n : float
        E·A of the screw shaft [N].
    length_m, origin_m : float
        Distance of the bearings; that of the nut from the fixed one at table position 0 [m].
    both_ends : bool
        Whether the screw is held axially at both ends.
    """

    force_n: Vector
    joint_deflection_m: Vector
    shaft_n: float
    length_m: float
    origin_m: float
    both_ends: bool = True

    def __post_init__(self) -> None:
        require_positive(self, "shaft_n", "length_m", "origin_m")
        for name in ("force_n", "joint_deflection_m"):
            values = np.array(getattr(self, name), dtype=np.float64)
            values.setflags(write=False)
            object.__setattr__(self, name, values)
        force, deflection = self.force_n, self.joint_deflection_m
        rising = len(force) >= 2 and force.shape == deflection.shape
        if not rising or (np.diff(force) <= 0).any() or (np.diff(deflection) <= 0).any():
            raise InputError(
                f"{force.shape} forces and {deflection.shape} deflections",
                expected="two increasing rows of the same length",
                where="axial compliance",
                advice="give the deflection of the joints at increasing axial forces",
            )

    def shaft_m_per_n(self, table_m: float) -> float:
        """Deflection of the shaft alone per force with the table there [m/N]; constant beyond the bearings."""
        free = min(max(self.origin_m + table_m, 0.0), self.length_m)
        share = free * (self.length_m - free) / self.length_m if self.both_ends else free
        return share / self.shaft_n
