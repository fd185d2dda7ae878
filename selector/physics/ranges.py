"""Ranges of frequencies, lengths, times or rows: those that overlap, and those in which something holds."""

from collections.abc import Iterable

import numpy as np

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
