"""What the model met: a few samples of some runs, for pictures of loops and of the range that was learnt."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from selector.models.hull import validity_hull
from selector.models.rows import Rows
from selector.selection.fitting import Part

READING_POINTS = 300
"""Samples of one run, evenly spaced; the extremes of every variable and displacement are kept beside them."""

MOST_RUNS = 20
MOST_JUDGED = 1200
"""Samples of all runs of which the distance to the other runs is computed: each costs about a millisecond."""

DIGITS = 4
"""Decimals [K, °C, rpm, µm, s]: they are for pictures, and results hold them as text."""


@dataclass(frozen=True)
class Readings:
    """Samples of one run, thinned.

    Attributes
    ----------
    run : str
    n_samples : int
        Of the run, before thinning.
    time_s : ndarray of shape (n_kept,)
    variables : ndarray of shape (n_kept, n_variables)
        Inputs and lags of the model, as its design has them (rises, or readings).
    displacement_um : ndarray of shape (n_kept, n_responses)
    beyond_others : ndarray of shape (n_kept,)
        Distance to the hull of all that is not left out together with the sample, in standard deviations of the inputs;
        0 inside, NaN where it was not computed.
    """

    run: str
    n_samples: int
    time_s: NDArray[np.float64]
    variables: NDArray[np.float64]
    displacement_um: NDArray[np.float64]
    beyond_others: NDArray[np.float64]

    def as_dict(self, variables: Sequence[str], responses: Sequence[str]) -> dict[str, Any]:
        """JSON form, with the names of the columns."""
        return {
            "run": self.run,
            "n_samples": self.n_samples,
            "time_s": self.time_s.tolist(),
            "variables": dict(zip(variables, self.variables.T.tolist(), strict=True)),
            "displacement_um": dict(zip(responses, self.displacement_um.T.tolist(), strict=True)),
            "beyond_others": self.beyond_others.tolist(),
        }


def kept_readings(rows: Rows, parts: Sequence[Part]) -> tuple[Readings, ...]:
    """At most `MOST_RUNS` runs: those with an extreme of any column, and others evenly between them.

    Parameters
    ----------
    rows : Rows
        The samples of the fit.
    parts : sequence of Part
        What is left out in turn.
    """
    columns = np.column_stack([rows.variables, rows.responses])
    present = np.unique(rows.run)
    extreme = np.unique(rows.run[_extremes(columns)])
    others = np.setdiff1d(present, extreme)
    runs = np.union1d(extreme, others[evenly(len(others), MOST_RUNS - len(extreme))])
    at_run = [at[telling_samples(columns[at], READING_POINTS)] for at in (np.flatnonzero(rows.run == r) for r in runs)]
    judged = [at[evenly(len(at), MOST_JUDGED // len(runs))] for at in at_run]
    beyond = _beyond_others(rows, parts, np.concatenate(judged))
    return tuple(
        Readings(
            rows.runs[r],
            int((rows.run == r).sum()),
            *(np.round(course[at], DIGITS) for course in (rows.time_s, rows.variables, rows.responses, beyond)),
        )
        for r, at in zip(runs.tolist(), at_run, strict=True)
    )


def telling_samples(columns: NDArray[np.float64], points: int) -> NDArray[np.int64]:
    """Positions of samples, evenly spaced, with the lowest and the highest of every column beside them."""
    return np.union1d(evenly(len(columns), points), _extremes(columns))


def evenly(n: int, most: int) -> NDArray[np.int64]:
    """At most so many of `n` positions, the first and the last among them."""
    return np.unique(np.linspace(0, n - 1, min(max(most, 0), n)).astype(np.int64))


def _extremes(columns: NDArray[np.float64]) -> NDArray[np.int64]:
    return np.unique(np.concatenate([columns.argmin(axis=0), columns.argmax(axis=0)]))


def _beyond_others(rows: Rows, parts: Sequence[Part], judged: NDArray[np.int64]) -> NDArray[np.float64]:
    distance = np.full(len(rows.run), np.nan)
    kept = {rows.runs[r] for r in np.unique(rows.run[judged]).tolist()}
    for part in parts:
        # of thousands of runs only some are kept, and to look for the samples of each takes a pass over all of them
        if kept.isdisjoint(part.runs):
            continue
        mine = np.intersect1d(judged, np.flatnonzero(part.unseen(rows)))
        training = part.training(rows)
        if len(mine) and training.any():
            distance[mine] = validity_hull(rows.variables[training]).distance(rows.variables[mine])
    return distance
