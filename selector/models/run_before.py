"""Which run went before which, as far as their clocks tell: the heat of the one is in the memory of the next."""

import itertools
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime

from selector.recording import RunSource
from selector.types import Array

Before = tuple[str, float]  #: The run before a run, and how much later than that one it starts [s].
MEMORY_REACH = 5.0  #: Time constants after which nothing is left of a state: e⁻⁵ is less than a hundredth.


def runs_before(source: RunSource, runs: Sequence[str]) -> dict[str, Before]:
    """The run before each of these runs, as far as the clocks of both are known and they do not overlap."""
    known = getattr(source, "provenance", {}).get("runs", {})
    spans = []
    for run in runs:
        start = known.get(run, {}).get("start")
        ends = [float(time_s[-1]) for time_s, _ in source.chunks(run, [source.channels[0].name]) if len(time_s)]
        if start is not None and ends:
            at = datetime.fromisoformat(start)
            spans.append(((at if at.tzinfo else at.replace(tzinfo=UTC)).timestamp(), ends[-1], run))
    spans.sort()
    return {
        run: (before, start - began)
        for (began, ended, before), (start, _, run) in itertools.pairwise(spans)
        if start > began + ended
    }


def chain_before(follows: Mapping[str, Before], run: str, tau_s: Array) -> list[Before]:
    """The runs whose heat a run still has, the earliest first, with how much later than each it starts [s]."""
    chain: list[Before] = []
    earlier, later_s = run, 0.0
    while earlier in follows and later_s < MEMORY_REACH * max(tau_s, default=0.0):
        earlier, step_s = follows[earlier]
        later_s += step_s
        chain.insert(0, (earlier, later_s))
    return chain
