"""By which numbers is an effect hidden: below the noise, absorbed, rare, like a known course, ruled out by the loop."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from selector.proof.case import Concealment
from selector.proof.noise import Noise
from selector.proof.strength import fitted_starts, recalibration, unabsorbed

Vector = NDArray[np.float64]

BELOW_NOISE_DB = -10.0
"""An effect is below the noise of a sample if its root mean square is at most this, against the noise [dB]."""
ERROR_RISE = 0.05
"""An effect is absorbed if it raises the error of the recalibrated simulation by at most this share."""
RARE_SHARE = 0.05
"""An effect is rare if at most this share of the time has more than a third of its largest value."""
LIKE_COSINE = 0.9
"""An effect is confounded if its cosine with a known course is at least this."""
RULED_OUT_SHARE = 0.2
"""An effect is ruled out by the loop in a response if that has at most this share of its d′²."""
RIVAL_COSINE = 0.85
"""Two effects are not told apart if their cosine is at least this, whitened and without what recalibration absorbs."""
FAITHFUL_D_PRIME = 2.0
"""A simulation is faithful if what it lacks besides the effect could be detected at most this well."""


def _rms(values: Vector) -> float:
    return float(np.sqrt(np.mean(values**2)))


def spread_of(noise: Noise) -> float:
    """Standard deviation of a reading: noise, rounding and what every cycle repeats."""
    return float(np.sqrt(noise.sd**2 + noise.cycle_sd**2 + noise.step**2 / 12.0))


def below_noise(effect: Mapping[str, Vector], noise: Mapping[str, Noise], starts: Sequence[int]) -> Concealment:
    """Level of the effect against the noise of one sample in the fitted rows, highest of the responses [dB]."""
    stop = fitted_starts(starts)[-1]
    levels = []
    for name, course in effect.items():
        spread = spread_of(noise[name])
        centred = course[:stop] - course[:stop].mean()
        levels.append(20.0 * np.log10(max(_rms(centred), 1e-12 * spread) / spread))
    return Concealment("below the noise of a sample [dB]", max(levels), BELOW_NOISE_DB, max(levels) <= BELOW_NOISE_DB)


def absorbed(
    effect: Mapping[str, Vector],
    simulated: Mapping[str, Vector],
    noise: Mapping[str, Noise],
    time_s: Vector,
    starts: Sequence[int],
) -> Concealment:
    """By which share the effect raises the error of the recalibrated simulation in the fitted rows, most of all."""
    rows = fitted_starts(starts)
    stop = rows[-1]
    rises = []
    for name, course in effect.items():
        plain = Noise(spread_of(noise[name]))
        free = recalibration(simulated[name], time_s, starts)
        left = unabsorbed(course[:, None], free, plain, rows)
        rises.append(float(np.sqrt(1.0 + np.sum(left**2) / stop)) - 1.0)
    return Concealment("absorbed: rise of the error", max(rises), ERROR_RISE, max(rises) <= ERROR_RISE)


def rare(effect: Mapping[str, Vector], starts: Sequence[int]) -> Concealment:
    """Share of the fitted time in which a response has more than a third of the effect's largest value there."""
    stop = fitted_starts(starts)[-1]
    shares = [
        float(np.mean(np.abs(course[:stop]) > np.abs(course[:stop]).max() / 3.0))
        for course in effect.values()
        if np.any(course[:stop])
    ]
    share = min(shares, default=0.0)
    return Concealment("rare: share of the time", share, RARE_SHARE, share <= RARE_SHARE)


def like_known(
    effect: Mapping[str, Vector], known: Mapping[str, Vector], response: str, starts: Sequence[int]
) -> Concealment:
    """Largest cosine of the effect in a response with a known course (both from their mean), in the fitted rows."""
    stop = fitted_starts(starts)[-1]
    course = effect[response][:stop] - effect[response][:stop].mean()
    best, which = 0.0, ""
    for name, other in known.items():
        part = other[:stop] - other[:stop].mean()
        size = float(np.linalg.norm(part) * np.linalg.norm(course))
        cosine = abs(float(part @ course)) / size if size > 0.0 else 0.0
        if cosine > best:
            best, which = cosine, name
    return Concealment(f"confounded with {which}: cosine", best, LIKE_COSINE, best >= LIKE_COSINE)


def ruled_out(strength: Mapping[str, float], response: str) -> Concealment:
    """Share of d′² that the effect has in a response; `strength` is d′ of every response by itself."""
    total = sum(value**2 for value in strength.values())
    share = strength[response] ** 2 / total if total > 0.0 else 0.0
    kind = f"ruled out by the loop: share of d′² in {response}"
    return Concealment(kind, share, RULED_OUT_SHARE, share <= RULED_OUT_SHARE)


def like_rival(cosine: float) -> Concealment:
    """Cosine of the effect with another effect of the same strength, whitened, without what recalibration absorbs."""
    return Concealment("like another effect: cosine", cosine, RIVAL_COSINE, cosine >= RIVAL_COSINE)


def faithful(d_prime: float) -> Concealment:
    """How well an oracle could detect what the simulation lacks besides the effect."""
    return Concealment("simulation true but for the effect: d′", d_prime, FAITHFUL_D_PRIME, d_prime <= FAITHFUL_D_PRIME)


def stacked(parts: Sequence[Vector]) -> tuple[Vector, tuple[int, ...]]:
    """Courses of runs one after the other, with the first row of every run and the number of rows."""
    starts = (0, *np.cumsum([len(part) for part in parts]).tolist())
    return np.concatenate(parts), starts


def split(values: NDArray[Any], starts: Sequence[int]) -> list[NDArray[Any]]:
    """Stacked rows as one course per run."""
    return [values[a:b] for a, b in pairwise(starts)]
