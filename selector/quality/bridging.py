"""Single readings that were lost: between its neighbours a temperature is better known than missed."""

import numpy as np
import pandas as pd

from selector.findings import Finding, Level, Where
from selector.quality.finding_table import FINDINGS
from selector.recording import SENSOR_ROLES, Recording
from selector.types import Array

GAP_PERIODS = 3.5  #: A distance of more than so many usual ones is a gap; two lost rows in a row are none.
MOST_LOST = 0.1  #: A sensor that loses a larger share of its readings is not to be trusted with the others.
FEW_LOST = 0.01  #: Below this share it is no warning.
_AT_START = 3  #: Readings through which a line is drawn back to the start of a run.


def bridged(recording: Recording) -> tuple[Recording, tuple[Finding, ...]]:
    """The recording with single lost readings of its thermometers filled in, and which these are.

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
            values[rows, k] = filled(time_s[rows], values[rows, k])
    found = (lost & np.isfinite(values)).mean(axis=0)
    findings = []
    for k in np.flatnonzero(found).tolist():
        name, part = recording.names[k], float(found[k])
        told = f"{name} has lost {100 * part:.2g} % of its readings, one or two in a row."
        level: Level = "warning" if part > FEW_LOST else "info"
        findings.append(FINDINGS.finding("readings-lost", told, Where(name), {"share": part}, level=level))
    return recording.with_values(pd.DataFrame(values, index=frame.index, columns=frame.columns)), tuple(findings)


def filled(time_s: Array, values: Array) -> Array:
    """Readings of a thermometer in a run, single ones that were lost filled in; shapes (n_samples,)."""
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
