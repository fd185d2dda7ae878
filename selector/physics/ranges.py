"""Ranges of frequencies, lengths or times that overlap."""

from collections.abc import Iterable


def joined(ranges: Iterable[tuple[float, float]], apart: float = 0.0) -> list[tuple[float, float]]:
    """Ranges that overlap, or are no farther `apart`, as one each; ascending."""
    found: list[tuple[float, float]] = []
    for low, high in sorted(ranges):
        if found and low <= found[-1][1] + apart:
            found[-1] = found[-1][0], max(found[-1][1], high)
        else:
            found.append((low, high))
    return found
