"""The same for recordings that are read piece by piece: inspected thinned, left out as they stream by."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from selector.findings import Finding
from selector.quality.leave_out import left_out_rows
from selector.recording import Channel, RunSource


class StreamWithoutFaults:
    """A source with exactly that left out which the findings name in their action, see `without_faults`."""

    def __init__(self, source: RunSource, findings: Iterable[Finding]) -> None:
        self._source = source
        self._findings: Sequence[Finding] = [finding for finding in findings if finding.action != "none"]
        gone = {f.where.run for f in self._findings if f.action == "leave-out-run"}
        self.runs: tuple[str, ...] = tuple(run for run in source.runs if run not in gone)
        self.channels: tuple[Channel, ...] = tuple(source.channels)

    def chunks(self, run: str, names: Iterable[str]) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64]]]:
        """(time_s, values) pieces of a run; what is left out is NaN."""
        wanted = list(names)
        here = [f for f in self._findings if f.where.run in (None, run) and f.where.channel in (None, *wanted)]
        for time_s, values in self._source.chunks(run, wanted):
            cleaned = values.copy() if here else values
            for finding in here:
                columns = np.array([finding.where.channel in (None, name) for name in wanted])
                cleaned[np.ix_(left_out_rows(finding, time_s), columns)] = np.nan
            yield time_s, cleaned
