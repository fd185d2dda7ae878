"""What the findings leave out of a recording, also of one that is read piece by piece."""

import itertools
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np
import pandas as pd

from selector.errors import RecordingError
from selector.findings import Finding
from selector.recording import Channel, Recording, RunSource
from selector.types import Array, Mask

WINDOWS = "windows_s"  #: Key in the evidence of a finding that speaks of several stretches: a list of (from_s, to_s).


def stretches(finding: Finding) -> list[tuple[float, float]]:
    """The stretches of time that a finding leaves out in a run, both ends included [s]; empty if it has no action.

    A finding that sums up several stretches lists them in its evidence under ``"windows_s"``; only these are left
    out, not what lies between them.
    """
    if finding.action == "none":
        return []
    if finding.action != "leave-out-stretch":
        return [(-np.inf, np.inf)]
    listed: Any = finding.evidence.get(WINDOWS)
    if listed:
        return [(float(begin), float(end)) for begin, end in listed]
    where = finding.where
    return [(-np.inf if where.from_s is None else where.from_s, np.inf if where.to_s is None else where.to_s)]


def left_out_rows(finding: Finding, time_s: Array) -> Mask:
    """Which samples of a run a finding leaves out, shape (n_samples,)."""
    out = np.zeros(time_s.size, dtype=np.bool_)
    for begin, end in stretches(finding):
        out[np.searchsorted(time_s, begin, "left") : np.searchsorted(time_s, end, "right")] = True
    return out


def without_faults(recording: Recording, findings: Iterable[Finding]) -> Recording:
    """The recording with exactly that left out which the findings name in their action.

    ``leave-out-stretch``: the samples of the channel (of every channel, if none is named) in the stretch become
    missing. ``leave-out-run``: the run is removed. ``leave-out-channel``: the channel becomes missing in the run named;
    it is removed if it is left out of every run, or if no run is named. Others change nothing. O(samples) and
    O(findings · log samples).

    Raises RecordingError if nothing would be left.
    """
    acting = [finding for finding in findings if finding.action != "none"]
    if not acting:
        return recording
    runs = StreamWithoutFaults(recording, acting).runs
    gone = {(finding.where.channel, finding.where.run) for finding in acting if finding.action == "leave-out-channel"}
    channels = tuple(
        channel
        for channel in recording.channels
        if any(gone.isdisjoint(itertools.product((None, channel.name), (None, run))) for run in runs)
    )
    if not runs or not channels:
        raise RecordingError(
            f"nothing of {len(recording.runs)} run(s) and {len(recording.channels)} channel(s) is left",
            expected="at least one run and one channel without a fault that leaves it out",
            where="faults found in the recording",
            advice="look at the findings, correct the files, or keep some of what they leave out",
        )
    return blanked(recording, acting, runs, channels)


def blanked(
    recording: Recording, findings: Sequence[Finding], runs: Sequence[str], channels: Sequence[Channel]
) -> Recording:
    """These runs and channels of a recording; the samples that the findings leave out are missing."""
    names, source = [channel.name for channel in channels], StreamWithoutFaults(recording, findings)
    parts = {run: pd.DataFrame(values, time_s, names) for run in runs for time_s, values in source.chunks(run, names)}
    return Recording.from_runs(parts, tuple(channels), recording.provenance)


class StreamWithoutFaults:
    """A source with exactly that left out which the findings name in their action, see `without_faults`."""

    def __init__(self, source: RunSource, findings: Iterable[Finding]) -> None:
        self._source = source
        self._findings: Sequence[Finding] = [finding for finding in findings if finding.action != "none"]
        gone = {f.where.run for f in self._findings if f.action == "leave-out-run"}
        self.runs: tuple[str, ...] = tuple(run for run in source.runs if gone.isdisjoint((None, run)))
        self.channels: tuple[Channel, ...] = tuple(source.channels)
        self.provenance = getattr(source, "provenance", {})

    def chunks(self, run: str, names: Iterable[str]) -> Iterator[tuple[Array, Array]]:
        """(time_s, values) pieces of a run; what is left out is NaN."""
        wanted = list(names)
        here = [f for f in self._findings if f.where.run in (None, run) and f.where.channel in (None, *wanted)]
        for time_s, values in self._source.chunks(run, wanted):
            cleaned = values.copy() if here else values
            for finding in here:
                columns = np.array([finding.where.channel in (None, name) for name in wanted])
                cleaned[np.ix_(left_out_rows(finding, time_s), columns)] = np.nan
            yield time_s, cleaned
