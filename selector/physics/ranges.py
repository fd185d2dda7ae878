"""Ranges of frequencies, lengths, times or rows: those that overlap, in which something holds; and what is at a limit.

Frequencies are products of orders, speeds and limits: order 15 at 1290 r/min, divided by the speed again, may be
15.000000000000002. What is within 10⁻⁹ of a limit is at the limit, so that rounding does not decide on which side.
"""

from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike

from selector.types import Indices, Mask


def true_stretches(mask: Mask) -> Indices:
    """First row, and the one behind the last, of every stretch in which a mask holds; shape (n_stretches, 2)."""
    return np.flatnonzero(np.diff(np.r_[False, mask, False])).reshape(-1, 2)


def joined(ranges: Iterable[tuple[float, float]], apart: float = 0.0) -> list[tuple[float, float]]:
    """Ranges that overlap, or are no farther `apart`, as one each; ascending."""
    found: list[tuple[float, float]] = []
    for low, high in sorted(ranges):
        if found and low <= found[-1][1] + apart:
            found[-1] = found[-1][0], max(found[-1][1], high)
        else:
            found.append((low, high))
    return found


#: Share by which numbers above 0 differ that are the same; rounding leaves some 10⁻¹⁵, of sampled times up to 10⁻¹⁰.
SAME = 1e-9


def above(values: ArrayLike, limit: float) -> Mask:
    """Whether values lie above a limit by more than rounding."""
    return np.asarray(values, dtype=np.float64) > limit * (1.0 + SAME)


def below(values: ArrayLike, limit: float) -> Mask:
    """Whether values lie below a limit by more than rounding."""
    return np.asarray(values, dtype=np.float64) < limit * (1.0 - SAME)
