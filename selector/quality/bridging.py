"""Single readings that were lost: between its neighbours a temperature is better known than missed."""

import numpy as np
import pandas as pd

from selector.findings import Finding, Where
from selector.quality.completeness import GAP_PERIODS
from selector.quality.finding_table import FINDINGS
from selector.recording import SENSOR_ROLES, Recording
from selector.types import Array

MOST_LOST = 0.1  #: A sensor that loses a larger share of its readings is not to be trusted with the others.
FEW_LOST = 0.01  #: Below this share nobody needs to know.
_AT_START = 3  #: Readings through which a line is drawn back to the start of a run.


def bridged(recording: Recording) -> tuple[Recording, tuple[Finding, ...]]:
    """The recording with single lost readings of its thermometers filled in, and which of them lose many.

    Up to two readings in a row are taken from the straight line between their neighbours, at the start of a run from
    that through the three readings that follow; longer gaps, gaps at an end, and sensors that lose more than a tenth of
    their readings stay as they are. O(samples).
    """
    frame, lost = recording.frame, recording.frame.isna().to_numpy()
    share = lost.mean(axis=0)
    few = [k for k, one in enumerate(recording.channels) if one.role in SENSOR_ROLES and 0.0 < share[k] <= MOST_LOST]
    if not few:
        return recording, ()
    values, time_s = frame.to_numpy(copy=True), frame.index.get_level_values(1).to_numpy()
    for rows in frame.groupby(level=0, sort=False).indices.values():
        for k in few:
            values[rows, k] = _filled(time_s[rows], values[rows, k])
    found = (lost & np.isfinite(values)).mean(axis=0)
    findings = [
        FINDINGS.finding(
            "readings-lost",
            f"{name} has lost {100 * found[k]:.0f} % of its readings, one or two in a row.",
            Where(name),
            {"share": float(found[k])},
        )
        for k, name in enumerate(recording.names)
        if found[k] > FEW_LOST
    ]
    return recording.with_values(pd.DataFrame(values, index=frame.index, columns=frame.columns)), tuple(findings)


def _filled(time_s: Array, values: Array) -> Array:
    known = np.isfinite(values)
    at_s, readings = time_s[known], values[known]
    if len(at_s) <= _AT_START:
        return values
    longest_s = GAP_PERIODS * float(np.median(np.diff(time_s)))
    between = np.interp(time_s, at_s, readings, left=np.nan, right=np.nan)
    after = np.clip(np.searchsorted(at_s, time_s), 1, len(at_s) - 1)
    found = np.where(known | (np.diff(at_s)[after - 1] <= longest_s), between, np.nan)
    before, first = time_s < at_s[0], slice(_AT_START)
    # two rows at most, as between two readings
    if before.sum() < GAP_PERIODS - 1.0 and at_s[_AT_START - 1] - time_s[0] <= 2.0 * longest_s:
        found[before] = np.polynomial.Polynomial.fit(at_s[first], readings[first], 1)(time_s[before])
    return found
