"""From readings to the columns of a regression: rises, lags, scaled products, run by run and piece by piece."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from selector.models.memory import Lag, lagged
from selector.models.reference import gauge_start, start_readings
from selector.models.terms import Scaling, Term, design_matrix
from selector.recording import RunSource

Reference = Literal["rise", "absolute"]


@dataclass(frozen=True)
class Datum:
    """What is subtracted from every reading of a run: {run: {channel: level}}; nothing for `absolute`."""

    reference: Reference
    levels: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

    def level(self, run: str, channel: str) -> float:
        """The level of one channel in one run: 0 if it has no datum, NaN if it needs one and its start is missing."""
        return self.levels.get(run, {}).get(channel, 0.0)


def datum_of(source: RunSource, inputs: Sequence[str], responses: Sequence[str], reference: Reference) -> Datum:
    """The datum of every run.

    Temperatures count from the start of the run; one that has no reading there has no rise in that run. A displacement
    counts from the start too, unless its gauge was zeroed already (`gauge_start`). A speed is never a rise.
    """
    if reference == "absolute":
        return Datum("absolute")
    found = start_readings(source, (*inputs, *responses))
    levels = {
        run: {name: gauge_start(*reading) if name in responses else reading[0] for name, reading in readings.items()}
        for run, readings in found.items()
    }
    return Datum("rise", levels)


@dataclass(frozen=True)
class Piece:
    """Some consecutive samples of a run.

    Attributes
    ----------
    time_s : ndarray of shape (n_samples,)
    variables : ndarray of shape (n_samples, n_variables)
        Rises (or absolute readings), then lags; NaN = missing.
    responses : ndarray of shape (n_samples, n_responses)
        Displacements [µm].
    """

    time_s: NDArray[np.float64]
    variables: NDArray[np.float64]
    responses: NDArray[np.float64]


@dataclass(frozen=True)
class Design:
    """Which variables are made from which channels, and against which datum."""

    inputs: tuple[str, ...]
    responses: tuple[str, ...]
    datum: Datum
    lags: tuple[Lag, ...] = ()

    @property
    def variables(self) -> tuple[str, ...]:
        """Names of the variables: inputs, then lags."""
        return (*self.inputs, *(lag.name for lag in self.lags))

    def pieces(self, source: RunSource, run: str, *, complete: bool = True) -> Iterator[Piece]:
        """Samples of a run in order; with `complete` only those at which nothing is missing."""
        channels = (*self.inputs, *self.responses)
        levels = np.array([self.datum.level(run, name) for name in channels])
        n_inputs = len(self.inputs)
        source_of_lag = [self.inputs.index(lag.source) for lag in self.lags]
        tau_s = np.array([lag.tau_s for lag in self.lags])
        state = np.full(len(self.lags), np.nan)
        last_s = np.full(len(self.lags), np.nan)
        for time_s, raw in source.chunks(run, channels):
            values = raw - levels
            variables = values[:, :n_inputs]
            if self.lags:
                past, state, last_s = lagged(variables[:, source_of_lag], time_s, tau_s, state, last_s)
                variables = np.concatenate([variables, past], axis=1)
            piece = Piece(time_s, variables, values[:, n_inputs:])
            if complete:
                whole = np.isfinite(piece.variables).all(axis=1) & np.isfinite(piece.responses).all(axis=1)
                if not whole.all():
                    piece = Piece(time_s[whole], piece.variables[whole], piece.responses[whole])
            if len(piece.time_s):
                yield piece


@dataclass(frozen=True)
class Columns:
    """Regression columns over the variables of a design."""

    scaling: Scaling
    terms: tuple[Term, ...]

    def matrix(self, variables: NDArray[np.float64]) -> NDArray[np.float64]:
        """Column per term, shape (n_samples, n_terms), from unscaled variables in the order of `scaling`."""
        return design_matrix(self.scaling.scaled(variables), self.scaling.variables, self.terms)
