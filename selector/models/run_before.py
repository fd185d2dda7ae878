"""Which run went before which, where a run begins, and one long record as the runs that it consists of."""

import itertools
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime

import numpy as np
import pandas as pd

from selector.quality.completeness import is_late
from selector.recording import Recording, RunSource, Windows, at_pauses, parted, restarts, thinned
from selector.types import Array

Before = tuple[str, float]  #: The run before a run, and how much later than that one it starts [s].
FEWEST_PARTS = 3  #: Parts of a record that prove more, left out in turn, than stretches of it do.
AT_RESTS = "at_rests"  #: In the provenance of one record that was cut at rests of its spindle.
UNGAUGED = " before its gauge"  #: Ends the name of what was read in a run before its gauge began.
MEMORY_REACH = 5.0  #: Time constants after which nothing is left of a state: e⁻⁵ is less than a hundredth.


def in_parts(source: RunSource) -> RunSource:
    """A recording with its runs cut at pauses (`at_pauses`); one of a single run without any is cut where the spindle
    turns again after a rest (`restarts`), if that makes `FEWEST_PARTS`.
    """
    if not isinstance(source, Recording):
        return source
    cut, run = at_pauses(source), source.runs[0]
    speeds = source.with_role("spindle_speed")
    if len(cut.runs) > 1 or not speeds:
        return cut
    time_s, turning = source.time_s(run), pd.Series(np.abs(source.values(run, speeds[:1])[:, 0])).ffill().fillna(0.0)
    rests = (turning < 0.01 * turning.max()).to_numpy()
    first = np.r_[0, 1 + np.flatnonzero(rests[1:] != rests[:-1])]
    begun = restarts(rests[first], np.diff(time_s[first], append=time_s[-1]))
    if len(begun) < FEWEST_PARTS:
        return source
    # the last sample at rest is the zero of a part
    begins_s = time_s[[0, *(first[i + 1] - 1 for i in begun[1:])]].tolist()
    return thinned(parted(source, {run: begins_s}, at_rests=True), 1)


class Begun(Windows):
    """A source whose runs begin with the first reading of a displacement, for those in which it comes late.

    What was read before, on the same clock, is a run that it follows.
    """

    def __init__(self, source: RunSource, begins_s: Mapping[str, float]) -> None:
        ending = UNGAUGED
        while any(f"{run}{ending}" in source.runs for run in begins_s):
            ending += "'"
        self.follows: dict[str, Before] = {run: (f"{run}{ending}", 0.0) for run in begins_s}
        before = {f"{run}{ending}": (run, -np.inf, begin_s, 0.0) for run, begin_s in begins_s.items()}
        spans = {run: (run, begins_s.get(run, -np.inf), np.inf, 0.0) for run in source.runs}
        super().__init__(source, spans | before)
        self.runs = tuple(source.runs)


def begun(source: RunSource, responses: Sequence[str]) -> RunSource:
    """The source whose runs begin where these displacements read something, where that is late in a run.

    What a gauge shows then is its zero, and rises of temperatures count from there too: what the machine did before
    is in none of them. A displacement that reads nothing in a run does not count there.
    """
    begins_s: dict[str, float] = {}
    for run in source.runs:
        read = [of for of in responses if any(np.isfinite(values).any() for _, values in source.chunks(run, (of,)))]
        begin_s = _together_s(source, run, read) if read else None
        if begin_s is not None:
            begins_s[run] = begin_s
    return Begun(source, begins_s) if begins_s else source


def _together_s(source: RunSource, run: str, names: Sequence[str]) -> float | None:
    """When the first of the readings comes that lie near to one another, one of each channel [s].

    None: at the start of the run, or there are none.
    """
    n, start_s, last = 0, 0.0, np.full((len(names), 2), -np.inf)
    for time_s, values in source.chunks(run, names):
        start_s = start_s if n else float(time_s[0])
        stamps = np.column_stack([n + np.arange(len(time_s)), time_s])
        # (n_samples, n_channels, 2): Row and time of the last reading so far
        known = np.where(np.isfinite(values)[:, :, np.newaxis], stamps[:, np.newaxis], last)
        seen = np.maximum.accumulate(np.concatenate([last[np.newaxis], known]))[1:]
        oldest = seen.min(axis=1)
        near = ~is_late(*(stamps - oldest).T)
        if near.any():
            row, begin_s = oldest[int(np.argmax(near))]
            return float(begin_s) if is_late(row, begin_s - start_s) else None
        n, last = n + len(time_s), seen[-1]
    return None


def runs_before(source: RunSource, runs: Sequence[str], most_pause: float = np.inf) -> dict[str, Before]:
    """The run before each of these runs, as far as the clocks of both are known and they do not overlap.

    Of a run that begins with its gauge it is what was read before that; this follows the run before. A pause longer
    than `most_pause` times that run parts the two.
    """
    known = getattr(source, "provenance", {}).get("runs", {})
    spans = []
    for run in runs:
        start = known.get(run, {}).get("start")
        pieces = source.chunks(run, [source.channels[0].name]) if start is not None else ()
        if ends := [float(time_s[-1]) for time_s, _ in pieces if len(time_s)]:
            at = datetime.fromisoformat(start)
            spans.append(((at if at.tzinfo else at.replace(tzinfo=UTC)).timestamp(), ends[-1], run))
    spans.sort()
    follows: dict[str, Before] = {run: one for run, one in getattr(source, "follows", {}).items() if run in runs}
    for (began, ended, before), (start, _, run) in itertools.pairwise(spans):
        if began + ended < start <= began + (1.0 + most_pause) * ended:
            follows[follows[run][0] if run in follows else run] = (before, start - began)
    return follows


def chain_before(follows: Mapping[str, Before], run: str, tau_s: Array) -> list[Before]:
    """The runs whose heat a run still has, the earliest first, with how much later than each it starts [s]."""
    chain: list[Before] = []
    earlier, later_s = run, 0.0
    while earlier in follows and later_s < MEMORY_REACH * max(tau_s, default=0.0):
        earlier, step_s = follows[earlier]
        later_s += step_s
        chain.insert(0, (earlier, later_s))
    return chain


def another_before(follows: Mapping[str, Before], run: str) -> str | None:
    """The run that a run follows; what was read in it before its gauge began is no other run. None: there is none."""
    return follows.get(before_gauge(follows, run) or run, (None,))[0]


def before_gauge(follows: Mapping[str, Before], run: str) -> str | None:
    """The name of what was read in a run before its gauge began; None: nothing."""
    earlier, later_s = follows.get(run, ("", 0.0))
    return None if later_s else earlier or None


def with_ungauged(source: RunSource, run: str, names: Sequence[str]) -> tuple[Array, Array]:
    """(time_s, values) of a run, and of what was read in it before its gauge began."""
    before = before_gauge(getattr(source, "follows", {}), run)
    pieces = [piece for one in (before, run) if one for piece in source.chunks(one, names)]
    return np.concatenate([time_s for time_s, _ in pieces]), np.concatenate([values for _, values in pieces])
