"""Cross-products of short stretches of every run: what a model and its robust intervals need after one pass."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from selector.models.design import Design
from selector.models.terms import Scaling
from selector.recording import RunSource

PER_BANDWIDTH = 4
MOST_BYTES = 64_000_000
"""Longer batches are taken rather than more memory than this."""


@dataclass(frozen=True)
class Batches:
    """Cross-products of W = [1, scaled variables, responses about their means] over batches of complete samples.

    Attributes
    ----------
    products : ndarray of shape (n_batches, k, k)
        W'W of every batch, the batches of a run together and in order of time.
    run : ndarray of int of shape (n_batches,)
        Position in `runs`.
    runs : tuple of str
    scaling : Scaling
        Of the variables.
    responses_at_um : ndarray of shape (n_responses,)
        What is subtracted from each response [µm].
    low, high : ndarray of shape (n_variables,)
        Smallest and largest value of each variable, in its own unit.
    width : int
        Batches in the bandwidth of a robust covariance.
    """

    products: NDArray[np.float64]
    run: NDArray[np.int64]
    runs: tuple[str, ...]
    scaling: Scaling
    responses_at_um: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    width: int

    @cached_property
    def whole(self) -> NDArray[np.float64]:
        """W'W over all samples, shape (k, k)."""
        return np.asarray(self.products.sum(axis=0))

    def of_run(self, run: str) -> NDArray[np.float64]:
        """W'W over the samples of one run, shape (k, k)."""
        return np.asarray(self.products[self.run == self.runs.index(run)].sum(axis=0))

    def about_means(self, total: NDArray[np.float64]) -> NDArray[np.float64]:
        """Cross-products of [1, scaled variables, responses] as they would be with responses about their means."""
        shift = np.eye(total.shape[-1])
        shift[-len(self.responses_at_um) :, 0] = -self.responses_at_um
        return np.asarray(shift @ total @ shift.T)

    def meat(self, columns: Sequence[int], response: int, beta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Long-run covariance of the scores of a fit, summed over all samples; the filling of the sandwich.

        Newey–West within each run with Bartlett weights, as `selector.models.least_squares.fit` has it: a triangle is
        a box run over a box, and here the box moves by a batch at a time and not by a sample.

        Parameters
        ----------
        columns : sequence of int
            Positions of the columns of the fit in W, the constant included.
        response : int
            Position of the response in W.
        beta : ndarray of shape (len(columns),)
        """
        at = np.asarray(columns)
        scores = self.products[:, at, response] - self.products[:, at[:, None], at] @ beta
        meat = np.zeros((len(at), len(at)))
        for r in range(len(self.runs)):
            part = scores[self.run == r]
            sums = np.cumsum(np.pad(part, ((self.width, self.width - 1), (0, 0))), axis=0)
            box = sums[self.width :] - sums[: -self.width]
            meat += box.T @ box / self.width
        return meat


def batches(
    source: RunSource, design: Design, scaling: Scaling, responses_at_um: NDArray[np.float64], *, most_rows: int
) -> Batches:
    """Read every run once and add up.

    Parameters
    ----------
    scaling : Scaling
        Centre and scale of the variables of the design.
    most_rows : int
        A fit on more samples than these would be made on every second, third, …; its bandwidth is that many longer.
    """
    lengths = {run: sum(len(piece.time_s) for piece in design.pieces(source, run)) for run in source.runs}
    runs = tuple(run for run, n in lengths.items() if n)
    size = 1 + len(design.variables) + len(design.responses)
    length, width = _batch_length([lengths[run] for run in runs], size, most_rows)
    low, high = np.full(len(design.variables), np.inf), np.full(len(design.variables), -np.inf)
    products: list[NDArray[np.float64]] = []
    for run in runs:
        of_run = np.zeros((-(-lengths[run] // length), size, size))
        for first, variables, responses in _slices(source, design, run, length):
            low, high = np.minimum(low, variables.min(axis=0)), np.maximum(high, variables.max(axis=0))
            rows = np.empty((len(variables), size))
            rows[:, 0] = 1.0
            rows[:, 1 : 1 + len(design.variables)] = scaling.scaled(variables)
            rows[:, 1 + len(design.variables) :] = responses - responses_at_um
            _add(of_run, first, rows, length)
        products.append(of_run)
    number = np.repeat(np.arange(len(runs)), [len(part) for part in products])
    stacked = np.concatenate(products) if products else np.zeros((0, size, size))
    return Batches(stacked, number, runs, scaling, responses_at_um, low, high, width)


def _batch_length(lengths: Sequence[int], size: int, most_rows: int) -> tuple[int, int]:
    """(samples in a batch, batches in a bandwidth)."""
    n = sum(lengths)
    stride = max(1, -(-n // most_rows))
    # the bandwidth of the fit: 0 is one sample wide
    bandwidth = max(min(int(np.sqrt(n / stride / len(lengths))), min(lengths) // stride - 1), 0)
    wide = (bandwidth + 1) * stride
    room = -(-n * size**2 * 8 // MOST_BYTES)
    length = max(1, round(wide / PER_BANDWIDTH), room)
    return length, max(1, round(wide / length))


def _slices(
    source: RunSource, design: Design, run: str, length: int
) -> Iterator[tuple[int, NDArray[np.float64], NDArray[np.float64]]]:
    """(position of the first row in the run, variables, responses), a few thousand rows at a time."""
    first, most = 0, length * max(1, 4096 // length)
    for piece in design.pieces(source, run):
        start = 0
        while start < len(piece.time_s):
            # to the end of a batch, so that the slice after it begins with one
            stop = min(start + most - (first + start) % length, len(piece.time_s))
            yield first + start, piece.variables[start:stop], piece.responses[start:stop]
            start = stop
        first += len(piece.time_s)


def _add(products: NDArray[np.float64], first: int, rows: NDArray[np.float64], length: int) -> None:
    """Add the products of consecutive rows, of which the first is row `first` of its run, to those of their batches."""
    head = min(-first % length, len(rows))
    if head:
        products[first // length] += rows[:head].T @ rows[:head]
    whole = (len(rows) - head) // length
    if whole:
        at = (first + head) // length
        stacked = rows[head : head + whole * length].reshape(whole, length, -1)
        products[at : at + whole] += stacked.transpose(0, 2, 1) @ stacked
    rest = rows[head + whole * length :]
    if len(rest):
        products[(first + len(rows) - 1) // length] += rest.T @ rest
