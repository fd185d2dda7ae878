"""Stiffness and damping that change while an axis moves, given as courses in time (F eq. 5, 6)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from selector.errors import InputError

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class ParameterCourse:
    """Parameters on the grid of the reference, straight between; they replace the constants of the mechanics.

    Attributes
    ----------
    period_s : float
        Distance of the samples [s], that of the reference.
    axial_stiffness_n_per_m : ndarray of shape (n_samples,) or None
        Ke [N/m]; None: the constant of the mechanics (a rigid axis has no other choice).
    guide_damping_ns_per_m : ndarray of shape (n_samples,) or None
        Ct [N·s/m]; None: the constant of the mechanics.

    Raises
    ------
    InputError
        If a stiffness is not above 0, a damping is negative, or a value is missing.
    """

    period_s: float
    axial_stiffness_n_per_m: Vector | None = None
    guide_damping_ns_per_m: Vector | None = None

    def __post_init__(self) -> None:
        for name, least in (("axial_stiffness_n_per_m", "above 0"), ("guide_damping_ns_per_m", "0 or more")):
            given = getattr(self, name)
            if given is None:
                continue
            values = np.array(given, dtype=np.float64)
            fits = values.ndim == 1 and np.isfinite(values).all()
            if not fits or (values < 0).any() or (least == "above 0" and (values == 0).any()):
                raise InputError(
                    f"{name} from {np.min(values, initial=np.inf):g} to {np.max(values, initial=-np.inf):g}",
                    expected=f"one row of finite numbers {least}",
                    where="course of parameters",
                    advice="check the parts and the load that the course was made from",
                )
            values.setflags(write=False)
            object.__setattr__(self, name, values)
