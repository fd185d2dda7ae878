"""How a thermal effect is hidden, besides the ways of `selector.proof.concealment`: axis, sign, chance, rarity."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from selector.proof.case import Concealment
from selector.proof.concealment import LIKE_COSINE, RARE_SHARE, fitted_starts
from selector.proof.world import Measure, Shown
from selector.types import Vector

OTHER_AXIS_SHARE = 0.01
OPPOSED_CORRELATION = -0.5
UNRELATED_CORRELATION = 0.6


def one_axis(axis: str) -> Measure:
    """Share of the effect's energy, in units of the noise, in the other responses."""

    def measured(shown: Shown) -> Concealment:
        stop = fitted_starts(shown.starts)[-1]
        energy = {n: float(np.sum((course[:stop] / shown.noise[n].sd) ** 2)) for n, course in shown.effect.items()}
        share = 1.0 - energy[axis] / sum(energy.values())
        return Concealment(f"only in {axis}: share elsewhere", share, OTHER_AXIS_SHARE, share <= OTHER_AXIS_SHARE)

    return measured


def opposed(shown: Shown) -> Concealment:
    """Correlation of the effect in Z with that in Y."""
    stop = fitted_starts(shown.starts)[-1]
    found = _correlation(shown.effect["Z"][:stop], shown.effect["Y"][:stop])
    return Concealment("opposed signs: correlation", found, OPPOSED_CORRELATION, found <= OPPOSED_CORRELATION)


def like_in_first_run(shown: Shown) -> Concealment:
    """Largest correlation of the effect, in the first run, with the simulation."""
    rows, known = slice(*shown.starts[:2]), shown.simulated.values()
    found = max(abs(_correlation(course[rows], other[rows])) for course in shown.effect.values() for other in known)
    kind = "confounded with the simulation in the first run: cosine"
    return Concealment(kind, found, LIKE_COSINE, found >= LIKE_COSINE)


def unrelated(shown: Shown) -> Concealment:
    """Largest correlation of the effect with any recorded channel in the fitted rows, offset and gain off both."""
    stop = fitted_starts(shown.starts)[-1]
    others = np.column_stack([course[:stop] for name, course in shown.recorded.items() if name not in shown.effect])
    found = 0.0
    for name, course in shown.effect.items():
        if np.any(course[:stop]):
            free = np.column_stack([np.ones(stop), shown.simulated[name][:stop]])
            both = np.column_stack([course[:stop], others])
            left = both - free @ np.linalg.lstsq(free, both, rcond=None)[0]
            sizes = np.linalg.norm(left, axis=0)
            seen = sizes[1:] > 1e-9 * np.linalg.norm(others, axis=0)
            found = max(found, float(np.max(np.abs(left[:, 0] @ left[:, 1:])[seen] / (sizes[0] * sizes[1:][seen]))))
    return Concealment(
        "unrelated to channels: correlation", found, UNRELATED_CORRELATION, found <= UNRELATED_CORRELATION
    )


def seldom(channel: str, above: float = 0.0) -> Measure:
    """Share of the fitted time in which a recorded channel is above this share of its largest value."""

    def measured(shown: Shown) -> Concealment:
        fitted = shown.recorded[channel][: fitted_starts(shown.starts)[-1]]
        share = float(np.mean(fitted > above * float(fitted.max())))
        return Concealment(f"rare: share of the time with {channel}", share, RARE_SHARE, 0.0 < share <= RARE_SHARE)

    return measured


def cold_spells(shown: Shown) -> Concealment:
    """Share of the fitted time in which the hall is 2 K below its median of the run."""
    halls = [shown.recorded["Tamb"][a:b] for a, b in pairwise(fitted_starts(shown.starts))]
    share = float(np.mean(np.concatenate([hall < np.median(hall) - 2.0 for hall in halls])))
    return Concealment("rare: share of the time with a cold hall", share, RARE_SHARE, 0.0 < share <= RARE_SHARE)


def _correlation(first: Vector, second: Vector) -> float:
    a, b = first - first.mean(), second - second.mean()
    size = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(a @ b) / size if size > 0.0 else 0.0
