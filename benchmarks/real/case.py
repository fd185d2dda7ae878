"""What a case of the bench is: a real recording beside a simulation that a small fitted model gives."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from selector.recording import Channel, Recording

Vector = NDArray[np.float64]
Kind = Literal["positive", "control"]
SIMULATED = " simulated"
"""Ending of the column that stands beside a recorded one of the same name."""


class Pair(NamedTuple):
    """What the tool is given, and which run, or share of every run, is held out."""

    recording: Recording
    simulation: Recording
    holdout: str = "last"


@dataclass(frozen=True)
class RealCase:
    """One case; what is right was decided before the tool was asked, and is not changed afterwards."""

    name: str
    kind: Kind
    build: Callable[[Path], Pair]  #: From the folder of the rig
    model: str  #: The first simulation, what it is fitted to, and which runs are held out
    truth: str  #: What is documented, and where; or that it was read off the record
    right: tuple[str, ...] = ()  #: Ids that are right
    tolerated: tuple[str, ...] = ()  #: Ids that may stand in the answer without being counted for or against it
    verdicts: tuple[str, ...] = ()  #: Verdicts that are right without a name
    reading: str = ""  #: Units, clock and rows, where that is not plain

    @property
    def rig(self) -> str:
        """The rig, by which halves are drawn."""
        return self.name.split("/")[0]


def pair(runs: Mapping[str, pd.DataFrame], channels: Sequence[Channel], holdout: str = "last") -> Pair:
    """Runs with an index of seconds, recorded columns and simulated ones beside them."""
    given = tuple(one for one in channels if any(one.name + SIMULATED in table for table in runs.values()))
    names = {one.name + SIMULATED: one.name for one in given}
    simulated = {run: table[list(names)].rename(columns=names) for run, table in runs.items()}
    return Pair(Recording.from_runs(runs, channels), Recording.from_runs(simulated, given), holdout)


def table(time_s: Vector, **columns: Vector) -> pd.DataFrame:
    """Columns over the time from their start [s]; a simulated one is given as `name_simulated`."""
    named = {name.replace("_simulated", SIMULATED): values for name, values in columns.items()}
    return pd.DataFrame(named, index=pd.Index(time_s - time_s[0], name="time_s"))


def thinned(frame: pd.DataFrame, n: int) -> pd.DataFrame:
    """Means over n rows each, of the time as well."""
    rows = len(frame) // n * n
    times = frame.index.to_numpy()[:rows].reshape(-1, n).mean(axis=1)
    values = frame.to_numpy(dtype=np.float64)[:rows].reshape(-1, n, frame.shape[1]).mean(axis=1)
    return pd.DataFrame(values, columns=frame.columns, index=pd.Index(times - times[0], name="time_s"))


def least_squares(columns: Sequence[Vector | float], target: Vector) -> Vector:
    """Factors of the columns that leave least of the target; a number is a constant column."""
    matrix = np.column_stack([np.broadcast_to(column, target.shape) for column in columns])
    return np.asarray(np.linalg.lstsq(matrix, target, rcond=None)[0], dtype=np.float64)


def noisy(given: Pair, seed: int) -> Pair:
    """The pair with white noise on the compared channels, of the noise that each has in each run (`noise_of`)."""
    draw = np.random.default_rng(seed)
    frame = given.recording.frame.copy()
    for run in given.recording.runs:
        rows = frame.index.get_level_values("run") == run
        for name in given.simulation.names:
            values = frame.loc[rows, name].to_numpy(dtype=np.float64)
            frame.loc[rows, name] = values + noise_of(values) * draw.standard_normal(len(values))
    return given._replace(recording=given.recording.with_values(frame))


def noise_of(values: Vector) -> float:
    """Standard deviation of the noise by the median second difference; of a coarse reading that of its step.

    Never more than the course itself scatters, as the differences of a noise that alternates would give.
    """
    known = values[np.isfinite(values)]
    second = np.abs(np.diff(known, 2))
    steps = np.abs(np.diff(known))
    if not len(second) or not steps.any():
        return 0.0
    spread = float(np.median(second)) / (0.6745 * np.sqrt(6.0))
    return min(spread, float(known.std())) if spread > 0.0 else float(steps[steps > 0.0].min() / np.sqrt(12.0))
