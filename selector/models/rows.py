"""Samples of a design side by side, for the few steps that need them: the final fit, its residuals, time constants."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from selector.models.design import Design
from selector.recording import RunSource


@dataclass(frozen=True)
class Rows:
    """Complete samples of some runs, one after the other.

    Attributes
    ----------
    runs : tuple of str
    run : ndarray of int of shape (n_samples,)
        Position in `runs`.
    time_s : ndarray of shape (n_samples,)
    variables : ndarray of shape (n_samples, n_variables)
    responses : ndarray of shape (n_samples, n_responses)
    """

    runs: tuple[str, ...]
    run: NDArray[np.int64]
    time_s: NDArray[np.float64]
    variables: NDArray[np.float64]
    responses: NDArray[np.float64]

    def only(self, keep: NDArray[np.bool_]) -> Rows:
        """The samples for which `keep` is true."""
        return Rows(self.runs, self.run[keep], self.time_s[keep], self.variables[keep], self.responses[keep])

    def blocks(self, n_blocks: int) -> NDArray[np.int64]:
        """Block of each sample within its run, −1 = purged at an edge; shape (n_samples,)."""
        labels = np.full(len(self.run), -1, dtype=np.int64)
        for r in range(len(self.runs)):
            at = np.flatnonzero(self.run == r)
            for i, (start, stop) in enumerate(block_bounds(len(at), n_blocks)):
                labels[at[start:stop]] = i
        return labels


def block_bounds(n: int, n_blocks: int) -> list[tuple[int, int]]:
    """(start, stop) of contiguous blocks; an eighth of a block is purged at each side that touches another.

    Neighbouring samples of a warming machine are all but copies of each other, so a block next to the one left out
    would give the answer away at the edge.
    """
    if n_blocks == 1:
        return [(0, n)]
    edges = np.linspace(0, n, n_blocks + 1).astype(int)
    purge = max((n // n_blocks) // 8, 1)
    return [
        (int(edges[i]) + (purge if i else 0), int(edges[i + 1]) - (purge if i < n_blocks - 1 else 0))
        for i in range(n_blocks)
    ]


def rows_of(source: RunSource, design: Design, runs: Sequence[str]) -> Rows:
    """The complete samples of some runs."""
    number: list[NDArray[np.int64]] = []
    parts: list[tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]] = []
    for r, run in enumerate(runs):
        for piece in design.pieces(source, run):
            parts.append((piece.time_s, piece.variables, piece.responses))
            number.append(np.full(len(piece.time_s), r, dtype=np.int64))
    empty = (np.zeros(0), np.zeros((0, len(design.variables))), np.zeros((0, len(design.responses))))
    time_s, variables, responses = (np.concatenate(column) for column in zip(*(parts or [empty]), strict=True))
    run_number = np.concatenate(number) if number else np.zeros(0, dtype=np.int64)
    return Rows(tuple(runs), run_number, time_s, variables, responses)
