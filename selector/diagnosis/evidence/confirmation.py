"""Whether a named effect holds on rows that it was not fitted to, with another programme, or is refuted there."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.evidence.bench import Bench
from selector.diagnosis.evidence.noise import whitened
from selector.diagnosis.evidence.search import Search, numbers

Vector = NDArray[np.float64]
_SEEN = 10.0
"""Whitened sum of squares of an effect's course in the held-out rows below which nothing is said by no gain there.

A true effect gains about that much, with a standard deviation of twice its root. A loss of as much refutes whatever the
course: there what is left grows by what was taken for the effect.
"""
_RUINED = 1.5
"""Times the held-out error without an effect from which on it is another thing that was taken for it."""


@dataclass(frozen=True)
class Confirmation:
    """How a named effect, fitted elsewhere, stands on the held-out rows.

    Attributes
    ----------
    gain : float
        Fall of the whitened sum of squares.
    energy : float
        Whitened sum of squares of its course there.
    """

    gain: float
    energy: float

    @property
    def refutes(self) -> bool:
        """Whether it ought to gain there and does not."""
        return self.gain < -_SEEN or (self.gain <= 0.0 and self.energy > _SEEN)


def confirmation(comparison: Comparison, found: Search, id: str) -> Confirmation:  # noqa: A002 - the contract's word
    """Held-out rows without and with an effect, both models fitted to the other rows, all its responses together."""
    gain = energy = 0.0
    for response, v in found.named[id].items():
        bench = found.benches[response]
        rows = comparison.held_out & np.isfinite(bench.target)
        named = numbers(found.named, response)
        without = _white(bench, bench.residual([other for other in named if other != v]))[rows]
        with_it = _white(bench, bench.residual(named))[rows]
        energy += float(np.sum((with_it - without) ** 2))
        gain += float(np.sum(without**2) - np.sum(with_it**2))
    return Confirmation(gain, energy)


def not_ruinous(comparison: Comparison, found: Search) -> Search:
    """The search without names that make the error of unseen rows far larger; the least clear one goes first."""
    while True:
        ruinous = [id_ for id_ in found.named if _growth(comparison, found, id_) > _RUINED]
        if not ruinous:
            return found
        least = min(ruinous, key=lambda id_: found.standing[id_].score)
        found = replace(found, named={id_: of for id_, of in found.named.items() if id_ != least})


def _growth(comparison: Comparison, found: Search, id: str) -> float:  # noqa: A002 - the contract's word
    """By how much the held-out error grows with an effect, in the response in which it does so most.

    Compared with the simulation without it, recalibrated or as it was given, whichever is nearer.
    """
    growth = 0.0
    for response, v in found.named[id].items():
        bench, named = found.benches[response], numbers(found.named, response)
        without = bench.residual([other for other in named if other != v])
        rows = comparison.held_out & np.isfinite(without)
        squares = [float(np.sum(left[rows] ** 2)) for left in (bench.residual(named), without, bench.target)]
        if min(squares[1:]) > 0.0:
            growth = max(growth, float(np.sqrt(squares[0] / min(squares[1:]))))
    return growth


def _white(bench: Bench, left: Vector) -> Vector:
    seen = np.isfinite(left)
    return whitened(bench.noise, np.where(seen, left, 0.0)[:, None], bench.parts)[:, 0] * seen
