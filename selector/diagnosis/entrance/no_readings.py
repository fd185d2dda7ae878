"""Which samples of a recording are no readings: codes of broken sensors, and values that cannot be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd

from selector.findings import Finding
from selector.quality.break_codes import broken_sensors, out_of_range
from selector.quality.leave_out import left_out_rows
from selector.quality.survey import Survey
from selector.quality.wrong_units import wrong_temperature_units
from selector.recording import Recording

_CHECKS = (broken_sensors, wrong_temperature_units, out_of_range)
"""In the order of `selector.quality.inspect`: what one finds is blank for the next."""
_NO_READINGS = ("sensor-break", "out-of-range")
"""What is left out. A frozen or stepped reading is one, and a fault that a diagnosis can name."""


def without_codes(recording: Recording) -> tuple[Recording, tuple[Finding, ...]]:
    """The recording with missing samples where no reading stands, and what was left out, as findings.

    Every run and every channel stays, if only as missing samples. O(samples).

    Parameters
    ----------
    recording : Recording

    Returns
    -------
    tuple of Recording and tuple of Finding
        The recording itself and nothing if there are no such samples. Ids: ``sensor-break``, ``out-of-range``; all
        of them warnings, for what is left out does no more harm to the answer.
    """
    survey, found = Survey(recording), list[Finding]()
    with np.errstate(all="ignore"):
        for check in _CHECKS:
            new = list(check(survey))
            survey.leave_out(new)
            found += new
    found = [replace(finding, level="warning") for finding in found if finding.id in _NO_READINGS]
    if not found:
        return recording, ()
    tables: dict[str, pd.DataFrame] = {}
    for run in recording.runs:
        time_s, values = recording.time_s(run), np.array(recording.values(run, recording.names))
        for finding in found:
            if finding.where.run == run and finding.where.channel is not None:
                values[left_out_rows(finding, time_s), recording.names.index(finding.where.channel)] = np.nan
        tables[run] = pd.DataFrame(values, index=time_s, columns=list(recording.names))
    return Recording.from_runs(tables, recording.channels, recording.provenance), tuple(found)
