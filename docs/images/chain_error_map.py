"""How far a chain of two members is from its coupled solution, over all ratios of their masses and frequencies."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from selector.errors import InputError
from selector.physics.vibration.chains import WITHIN, decibel
from selector.types import Complex, Vector

Kind = Literal["first", "second"]


@dataclass(frozen=True)
class ChainErrorMap:
    """Error of a chain of two members over a band, one row a mass ratio and one column a frequency ratio."""

    mass_ratio: Vector  #: (n_mass,): m1/m2: forced or hanging member over the one on the ground
    frequency_ratio: Vector  #: (n_freq,): p1/p2, each alone on its joint
    #: share_within, rms_db and largest_error: (n_mass, n_freq): As in `Agreement`
    share_within: Vector
    rms_db: Vector
    largest_error: Vector


def two_member_ratio(
    mass_ratio: ArrayLike,
    frequency_ratio: ArrayLike,
    forcing_ratio: ArrayLike,
    *,
    dissipation: tuple[float, float],
    kind: Kind = "first",
    dampers_carry: bool = False,
) -> Complex:
    """Motion of member 1 by the chain over the coupled one, for members 1 – 2 – ground; the arguments broadcast.

    With dampers that carry it is 1 − ε, ε = (1 + iη1)·m1/m2·(ω/p2)²·H1·H2 with H = μ·e^{−iφ}: of both kinds alike.

    The ratios are m1/m2, p1/p2 and ω/p1; `dissipation` is ψ of the joint 1 – 2 and of that of 2 with the ground. Of the
    first kind the force acts on member 1, of the second on member 2, of which member 1 is the branch.

    InputError at an undamped resonance, and for ratios that are not above 0.
    """
    mass, frequency, forcing = (
        np.asarray(ratio, dtype=np.float64) for ratio in (mass_ratio, frequency_ratio, forcing_ratio)
    )
    for name, ratio, allowed in (
        ("mass_ratio", mass, mass > 0.0),
        ("frequency_ratio", frequency, frequency > 0.0),
        ("forcing_ratio", forcing, forcing >= 0.0),
    ):
        if not (np.isfinite(ratio) & allowed).all():
            raise InputError(
                "a ratio of masses or frequencies that cannot be",
                expected="numbers above 0; 0 is allowed for forcing at rest",
                where=name,
                advice="correct the ratios",
            )
    first, second = (np.complex128(complex(1.0, psi / (2.0 * math.pi))) for psi in dissipation)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        answer_1, answer_2 = 1.0 / (first - forcing**2), 1.0 / (second - (forcing * frequency) ** 2)
        # exact: what member 1 does to member 2 comes back as this share of the motion
        found = 1.0 - first * mass * (forcing * frequency) ** 2 * answer_1 * answer_2
        # X2/F·j1 of V, without the force of the damper
        behind = mass * frequency**2 * answer_2
        if not dampers_carry:
            found = found * (1.0 + behind) / (1.0 + first * behind) if kind == "first" else found / first
    if not np.isfinite(found).all():
        raise InputError(
            "a force at a resonance that nothing damps",
            expected="ψ above 0, or forcing off the resonances",
            where="dissipation",
            advice="give both joints a dissipation",
        )
    return np.asarray(found)


def chain_error_map(
    mass_ratio: ArrayLike,
    frequency_ratio: ArrayLike,
    *,
    dissipation: tuple[float, float],
    forcing_ratio: ArrayLike,
    kind: Kind = "first",
) -> ChainErrorMap:
    """Errors of the chain of two members over all mass ratios and frequency ratios, each over a band of ω/p1.

    `forcing_ratio` holds the frequencies of the band, in the spacing in which they shall count; one of them alone
    gives the error there. Else as `two_member_ratio`.
    """
    mass, frequency, forcing = (
        np.atleast_1d(np.asarray(values, np.float64)) for values in (mass_ratio, frequency_ratio, forcing_ratio)
    )
    ratio = two_member_ratio(mass[:, None, None], frequency[:, None], forcing, dissipation=dissipation, kind=kind)
    error = np.abs(ratio - 1.0)
    return ChainErrorMap(
        mass_ratio=mass,
        frequency_ratio=frequency,
        share_within=(error <= WITHIN).mean(axis=2),
        rms_db=np.sqrt((decibel(ratio) ** 2).mean(axis=2)),
        largest_error=error.max(axis=2),
    )
