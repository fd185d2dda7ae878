"""Recordings made from formulas, whole or in pieces, for the tests of models and of the selection."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from selector.recording import Channel, Recording


def recording(runs: Mapping[str, tuple[NDArray[np.float64], Mapping[str, NDArray[np.float64]]]]) -> Recording:
    """From {run: (time_s, {channel: samples})}; T… and A… temperatures, n… speeds, the rest displacements."""
    tables = {run: pd.DataFrame(dict(values), index=time_s) for run, (time_s, values) in runs.items()}
    names = list(dict.fromkeys(name for table in tables.values() for name in table.columns))
    return Recording.from_runs(tables, [channel(name) for name in names])


def channel(name: str) -> Channel:
    if name.startswith(("T", "A")):
        return Channel(name, "temperature", "degC")
    if name.startswith("n"):
        return Channel(name, "spindle_speed", "rpm")
    return Channel(name, "displacement", "um", axis=name)


class InPieces:
    """A recording that gives its runs out a few samples at a time."""

    def __init__(self, whole: Recording, size: int) -> None:
        self.whole, self.size = whole, size
        self.runs, self.channels = whole.runs, whole.channels

    def chunks(self, run: str, names: Sequence[str]) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64]]]:
        time_s, values = self.whole.time_s(run), self.whole.values(run, names)
        for start in range(0, len(time_s), self.size):
            yield time_s[start : start + self.size], values[start : start + self.size]
