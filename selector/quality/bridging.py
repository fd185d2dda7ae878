"""Single readings that were lost: between its neighbours a temperature is better known than missed."""

import numpy as np

from selector.findings import Finding, Level, Where
from selector.quality.finding_table import FINDINGS, READINGS_LOST
from selector.recording import SENSOR_ROLES, Recording
from selector.types import Array, Mask

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
