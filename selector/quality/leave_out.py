"""What the findings leave out of a recording, also of one that is read piece by piece; single readings filled in."""

import itertools
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np
import pandas as pd

from selector.errors import RecordingError
from selector.findings import Finding, Level, Where
from selector.quality.finding_table import FINDINGS, READINGS_LOST
from selector.recording import SENSOR_ROLES, Channel, Recording, RunSource
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


GAP_PERIODS = 3.5  #: A distance of more than so many usual ones is a gap; two lost rows in a row are none.
MOST_LOST, FEW_LOST = 0.1, 0.01  #: Share of readings: what loses more is not to be trusted; less is no warning.


def bridged(recording: Recording, raw: Recording) -> tuple[Recording, tuple[Finding, ...]]:
    """The recording with single lost readings of its thermometers filled in, and which these are.

    Up to two readings in a row are taken from the straight line between their neighbours, where the `raw` recording has
    none either: what was left out stays out. Longer gaps, gaps at the ends of a run (its start is the zero of a rise),
    and sensors that lose more than a tenth of their readings so stay as they are. O(samples).
    """
    frame, findings = recording.frame.copy(deep=False), []
    for name in recording.with_role(*SENSOR_ROLES):
        runs = {run: (recording.values(run, [name])[:, 0], raw.values(run, [name])[:, 0]) for run in recording.runs}
        filled = {run: _filled(recording.time_s(run), now, np.isnan(first)) for run, (now, first) in runs.items()}
        n = sum(int(np.isfinite(filled[run]).sum() - np.isfinite(now).sum()) for run, (now, _) in runs.items())
        share = n / len(frame)
        if not 0.0 < share <= MOST_LOST:
            continue
        frame[name] = np.concatenate(list(filled.values()))
        told = f"{name} has lost {100 * share:.2g} % of its readings one by one."
        level: Level = "warning" if share > FEW_LOST else "info"
        findings.append(FINDINGS.finding(READINGS_LOST, told, Where(name), {"share": share}, level=level))
    return (recording.with_values(frame) if findings else recording), tuple(findings)


def _filled(time_s: Array, values: Array, lost: Mask) -> Array:
    known = np.isfinite(values)
    at_s = time_s[known]
    if len(at_s) < 2 or not lost.any():
        return values
    longest_s = GAP_PERIODS * float(np.median(np.diff(time_s)))
    after = np.clip(np.searchsorted(at_s, time_s), 1, len(at_s) - 1)
    is_short = lost & ~known & (np.diff(at_s)[after - 1] <= longest_s)
    return np.where(is_short, np.interp(time_s, at_s, values[known], left=np.nan, right=np.nan), values)
