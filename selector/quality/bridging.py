"""Single readings that were lost: between its neighbours a temperature is better known than missed."""

import numpy as np
import pandas as pd

from selector.findings import Finding, Where
from selector.quality.finding_table import FINDINGS
from selector.recording import SENSOR_ROLES, Recording
from selector.types import Array

MOST_IN_A_ROW = 2  #: Rows without a reading that are bridged; what is longer may hide what the machine did.
MOST_LOST = 0.1  #: A sensor that loses a larger share of its readings is not to be trusted with the others.
FEW_LOST = 0.01  #: Below this share nobody needs to know.
_GAP_PERIODS = 3.5  #: So many usual sampling periods between two readings are no pause of the recording.
_AT_START = 3  #: Readings through which a line is drawn back to the start of a run.


def bridged(recording: Recording) -> tuple[Recording, tuple[Finding, ...]]:
    """The recording with single lost readings of its thermometers filled in, and which of them lose many.

    Up to two readings in a row are taken from the straight line between their neighbours, at the start of a run from
    that through the three readings that follow; longer gaps, gaps at an end, and sensors that lose more than a tenth of
    their readings stay as they are. O(samples).
    """
    lost = recording.frame.isna().to_numpy()
    share = lost.mean(axis=0)
    bridgeable = [c.role in SENSOR_ROLES and 0.0 < share[k] <= MOST_LOST for k, c in enumerate(recording.channels)]
    if not any(bridgeable):
        return recording, ()
    values, findings = recording.frame.to_numpy(copy=True), []
    time_s = recording.frame.index.get_level_values(1).to_numpy()
    runs = recording.frame.groupby(level=0, sort=False).indices.values()
    for column in np.flatnonzero(bridgeable):
        for rows in runs:
            values[rows, column] = _filled(time_s[rows], values[rows, column])
        found, name = float(np.mean(lost[:, column] & np.isfinite(values[:, column]))), recording.names[column]
        if found > FEW_LOST:
            told = f"{name} has lost {100 * found:.0f} % of its readings, at most {MOST_IN_A_ROW} in a row."
            findings.append(FINDINGS.finding("readings-lost", told, Where(name), {"share": found}))
    whole = pd.DataFrame(values, index=recording.frame.index, columns=recording.frame.columns)
    return recording.with_values(whole), tuple(findings)


def _filled(time_s: Array, values: Array) -> Array:
    at = np.flatnonzero(np.isfinite(values))
    if len(at) <= _AT_START:
        return values
    found = values.copy()
    steps, usual_s = np.diff(at), float(np.median(np.diff(time_s)))
    is_short = (steps > 1) & (steps <= MOST_IN_A_ROW + 1) & (np.diff(time_s[at]) <= _GAP_PERIODS * usual_s)
    for k in np.flatnonzero(is_short):
        rows = slice(at[k] + 1, at[k + 1])
        found[rows] = np.interp(time_s[rows], time_s[at[k : k + 2]], values[at[k : k + 2]])
    first = at[:_AT_START]
    if 0 < first[0] <= MOST_IN_A_ROW and time_s[first[-1]] - time_s[0] <= (first[0] + _GAP_PERIODS) * usual_s:
        line = np.polynomial.Polynomial.fit(time_s[first], values[first], 1)
        found[: first[0]] = line(time_s[: first[0]])
    return found
