"""How a thermal effect is hidden, besides the ways of `selector.proof.concealment`: axis, sign, chance, rarity."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

from selector.proof.case import Concealment
from selector.proof.concealment import Noise, fitted_starts
from selector.proof.world import Measure
from selector.types import Vector

Courses = Mapping[str, Vector]
OTHER_AXIS_SHARE = 0.01
OPPOSED_CORRELATION = -0.5
UNRELATED_CORRELATION = 0.6
LIKE_COSINE = 0.9
RARE_SHARE = 0.05


def one_axis(axis: str) -> Measure:
    """Share of the effect's energy, in units of the noise, in the other responses."""

    def measured(
        effect: Courses, _recorded: Courses, _simulated: Courses, noise: Mapping[str, Noise], starts: Sequence[int]
    ) -> Concealment:
        stop = fitted_starts(starts)[-1]
        energy = {name: float(np.sum((course[:stop] / noise[name].sd) ** 2)) for name, course in effect.items()}
        share = 1.0 - energy[axis] / sum(energy.values())
        return Concealment(f"only in {axis}: share elsewhere", share, OTHER_AXIS_SHARE, share <= OTHER_AXIS_SHARE)

    return measured


def opposed(
    effect: Courses, _recorded: Courses, _simulated: Courses, _noise: Mapping[str, Noise], starts: Sequence[int]
) -> Concealment:
    """Correlation of the effect in Z with that in Y."""
    stop = fitted_starts(starts)[-1]
    found = _correlation(effect["Z"][:stop], effect["Y"][:stop])
    return Concealment("opposed signs: correlation", found, OPPOSED_CORRELATION, found <= OPPOSED_CORRELATION)


def like_in_first_run(*channels: str) -> Measure:
    """Largest correlation of the effect, in the first run, with one of these channels or with the simulation."""

    def measured(
        effect: Courses, recorded: Courses, simulated: Courses, _noise: Mapping[str, Noise], starts: Sequence[int]
    ) -> Concealment:
        rows = slice(starts[0], starts[1])
        known = [recorded[name] for name in channels] if channels else list(simulated.values())
        found = max(abs(_correlation(course[rows], other[rows])) for course in effect.values() for other in known)
        which = " and ".join(channels) or "the simulation"
        return Concealment(
            f"confounded with {which} in the first run: cosine", found, LIKE_COSINE, found >= LIKE_COSINE
        )

    return measured


def unrelated(
    effect: Courses, recorded: Courses, simulated: Courses, _noise: Mapping[str, Noise], starts: Sequence[int]
) -> Concealment:
    """Largest correlation of the effect with any recorded channel in the fitted rows, offset and gain off both."""
    stop = fitted_starts(starts)[-1]
    others = np.column_stack([course[:stop] for name, course in recorded.items() if name not in effect])
    found = 0.0
    for name, course in effect.items():
        if np.any(course[:stop]):
            free = np.column_stack([np.ones(stop), simulated[name][:stop]])
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

    def measured(
        _effect: Courses, recorded: Courses, _simulated: Courses, _noise: Mapping[str, Noise], starts: Sequence[int]
    ) -> Concealment:
        fitted = recorded[channel][: fitted_starts(starts)[-1]]
        share = float(np.mean(fitted > above * float(fitted.max())))
        return Concealment(f"rare: share of the time with {channel}", share, RARE_SHARE, 0.0 < share <= RARE_SHARE)

    return measured


def cold_spells(
    _effect: Courses, recorded: Courses, _simulated: Courses, _noise: Mapping[str, Noise], starts: Sequence[int]
) -> Concealment:
    """Share of the fitted time in which the hall is 2 K below its median of the run."""
    spells = [
        recorded["Tamb"][a:b] < np.median(recorded["Tamb"][a:b]) - 2.0 for a, b in pairwise(fitted_starts(starts))
    ]
    share = float(np.mean(np.concatenate(spells)))
    return Concealment("rare: share of the time with a cold hall", share, RARE_SHARE, 0.0 < share <= RARE_SHARE)


def _correlation(first: Vector, second: Vector) -> float:
    a, b = first - first.mean(), second - second.mean()
    size = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(a @ b) / size if size > 0.0 else 0.0
