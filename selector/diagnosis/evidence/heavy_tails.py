"""What readings say where the noise has heavy tails: strays count for as much as they tell, not by their square."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from selector.diagnosis.evidence.bench import Bench
from selector.diagnosis.evidence.noise import NoiseModel
from selector.diagnosis.shapes.leftover import least_squares

_BEND = 1.345
"""Robust standard deviations beyond which a reading counts no more: 95 % efficient where the noise is normal."""
_WORTH = 0.9
"""Share of the noise's variance that must be saved; of normal noise nothing is."""


def with_pseudo_target(bench: Bench, chosen: Sequence[int]) -> Bench:
    """The bench with Huber's pseudo-values for the target, if its noise has heavy tails.

    Beside the `chosen` candidates a whitened residual r counts as ψ(r)/E ψ′, with ψ the residual up to a bend, whose
    variance is E ψ²/(E ψ′)² (P. J. Huber, Robust Statistics, 1981, sections 7.3 and 7.6). Least squares on these
    values is the robust estimate, to first order in what is still missing.
    """
    base = bench.base(chosen)
    if len(base) <= 2 * base.shape[1]:
        return bench
    fit = base @ least_squares(base, bench.white_target)
    left = bench.white_target - fit
    bend = _BEND * 1.4826 * float(np.median(np.abs(left - np.median(left))))
    inside = float(np.mean(np.abs(left) < bend))
    variance = float(np.mean(left**2))
    if bend <= 0.0 or inside <= 0.0 or variance <= 0.0:
        return bench
    pseudo = np.clip(left, -bend, bend) / inside
    saved = float(np.mean(pseudo**2)) / variance
    if saved >= _WORTH:
        return bench
    size = float(np.sqrt(saved))
    quieter = bench.with_noise(NoiseModel(bench.noise.phi, bench.noise.sd * size))
    return replace(quieter, pseudo_target=(fit + pseudo) / size)
