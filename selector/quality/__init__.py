"""What is wrong with a recording, as findings; and the recording without it.

Each file answers one question. The checks run one after the other, and what one leaves out is blank for the next:
a frozen stretch is not reported again as a step. Nothing is dropped in silence: `without_faults` leaves out exactly
what the findings name.
"""

from collections.abc import Callable, Iterable, Iterator

import numpy as np

from selector.findings import Finding
from selector.quality.broken_sensors import broken_sensors, frozen, out_of_range
from selector.quality.completeness import clock_jumps, empty_channels, few_values, gaps, late_gauges, short_runs, starts
from selector.quality.identity import duplicates, shared_rows, swapped
from selector.quality.jumps import spikes, steps
from selector.quality.leave_out import StreamWithoutFaults, bridged, stretches, without_faults
from selector.quality.siblings import leaving_group, relations_of, stuck_beside_siblings
from selector.quality.survey import Survey
from selector.quality.wrong_units import wrong_length_units, wrong_temperature_units
from selector.recording import Recording, at_pauses

__all__ = ["StreamWithoutFaults", "bridged", "inspect", "stretches", "usable", "without_faults"]

Check = Callable[[Survey], Iterator[Finding]]


def _copies_and_swaps(survey: Survey) -> Iterator[Finding]:
    yield from duplicates(survey, relations_of(survey))
    yield from swapped(relations_of(survey))


_CHECKS: tuple[Check, ...] = (
    short_runs,
    shared_rows,
    empty_channels,
    gaps,
    broken_sensors,
    wrong_temperature_units,
    out_of_range,
    wrong_length_units,
    clock_jumps,
    few_values,
    frozen,
    lambda survey: stuck_beside_siblings(survey, relations_of(survey)),
    spikes,
    steps,
    _copies_and_swaps,
    lambda survey: leaving_group(relations_of(survey)),
    starts,
    late_gauges,
)


def usable(recording: Recording) -> tuple[Recording, tuple[Finding, ...]]:
    """What a study uses of a recording, cut at pauses, lost readings filled in; what is wrong with it.

    Raises RecordingError if nothing would be left.
    """
    faults = inspect(recording)
    used, lost = bridged(without_faults(recording, faults), recording)
    return at_pauses(used), (*faults, *lost)


def inspect(recording: Recording, channels: Iterable[str] | None = None) -> tuple[Finding, ...]:
    """What is wrong with a recording: where, since when, with which numbers, and what will be left out.

    Of some `channels` only these are reported (and what concerns whole runs); the others still serve as siblings. The
    findings are sorted by run, channel, time and id; what they mean stands in `finding_table.py`. O(samples · log
    samples of a run), and O(channels²) for the comparison of channels.

    Raises RecordingError: a name in `channels` is not in the recording.
    """
    wanted = None if channels is None else {recording.channel(name).name for name in channels}
    found = Survey(recording).found_by(_CHECKS)
    runs = {name: k for k, name in enumerate(recording.runs)}
    order = {name: k for k, name in enumerate(recording.names)}

    def place(finding: Finding) -> tuple[int, int, float, float, str]:
        where = finding.where
        return (
            -1 if where.run is None else runs[where.run],
            -1 if where.channel is None else order[where.channel],
            -np.inf if where.from_s is None else where.from_s,
            -np.inf if where.to_s is None else where.to_s,
            finding.id,
        )

    return tuple(
        finding
        for finding in sorted(found, key=place)
        if wanted is None or finding.where.channel is None or finding.where.channel in wanted
    )
