"""Whether a named effect holds on rows that it was not fitted to, with another programme, or is refuted there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.evidence.bench import Bench
from selector.diagnosis.evidence.noise import whitened
from selector.diagnosis.evidence.search import Search, numbers

Vector = NDArray[np.float64]
_BLOCKS = 12
_SEEN = 10.0
"""Whitened sum of squares of an effect's course in the held-out rows below which nothing is said by no gain there.

A true effect gains about that much, with a standard deviation of twice its root.
"""


@dataclass(frozen=True)
class Confirmation:
    """How a named effect, fitted elsewhere, stands on the held-out rows.

    Attributes
    ----------
    gain : float
        Fall of the whitened sum of squares.
    steadiness : float
        The gain in units of its spread over blocks of the held-out rows, about normal if it is noise.
    shows : bool
        Whether the effect is excited there at all.
    """

    gain: float
    steadiness: float
    shows: bool


def confirmation(comparison: Comparison, found: Search, id: str) -> Confirmation:  # noqa: A002 - the contract's word
    """Held-out rows without and with an effect, both models fitted to the other rows, all its responses together."""
    gains: list[Vector] = []
    energy = 0.0
    for response, v in found.named[id].items():
        bench = found.benches[response]
        rows = np.flatnonzero(comparison.held_out & np.isfinite(bench.target))
        if len(rows) < 2 * _BLOCKS:
            continue
        named = numbers(found.named, response)
        without = _white(bench, bench.residual([other for other in named if other != v]))
        with_it = _white(bench, bench.residual(named))
        energy += float(np.sum((with_it - without)[rows] ** 2))
        for block in np.array_split(rows, _BLOCKS):
            gains.append(np.array(np.sum(without[block] ** 2) - np.sum(with_it[block] ** 2)))
    if not gains:
        return Confirmation(0.0, 0.0, False)
    gain = float(np.sum(gains))
    spread = float(np.sqrt(np.sum(np.square(gains))))
    return Confirmation(gain, gain / spread if spread > 0.0 else 0.0, energy > _SEEN)


def _white(bench: Bench, left: Vector) -> Vector:
    seen = np.isfinite(left)
    return whitened(bench.noise, np.where(seen, left, 0.0)[:, None], bench.parts)[:, 0] * seen
