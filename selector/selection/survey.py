"""What there is to work with: length and period of every run, sensors that cannot be used, and why."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from selector.errors import OptionError
from selector.findings import Finding, Where
from selector.models.design import Datum
from selector.recording import RunSource
from selector.selection.options import Question
from selector.selection.usable import usable_sensors

MOST_CREDIBLE = 1e12
"""Beyond this a reading is broken whatever its unit, and its squares would drown all others."""


@dataclass(frozen=True)
class Survey:
    """One pass over the samples.

    Attributes
    ----------
    runs : tuple of str
        Runs that have displacements.
    n_samples : int
    period_s, duration_s : float
        Median sampling period and longest run.
    question : Question
        With the sensors that can be used.
    findings : tuple of Finding
    """

    runs: tuple[str, ...]
    n_samples: int
    period_s: float
    duration_s: float
    question: Question
    findings: tuple[Finding, ...]


class RunsOf:
    """A source restricted to some of its runs."""

    def __init__(self, source: RunSource, runs: Sequence[str]) -> None:
        self._source = source
        self._runs = tuple(runs)
        self.channels = source.channels
        self.chunks = source.chunks

    @property
    def runs(self) -> tuple[str, ...]:
        """The runs kept."""
        return self._runs


def survey(source: RunSource, question: Question, datum: Datum, found_before: Iterable[Finding] = ()) -> Survey:
    """Decide which runs and sensors can be used.

    A sensor that is constant, that copies another one, or that is missing where others could stand in for it is not a
    candidate; every such decision is a finding, which names what was `found_before` as the cause.

    Raises
    ------
    OptionError
        Nothing usable is left, or a sensor that must be kept cannot be.
    """
    names = (*question.sensors, *question.responses)
    n_sensors = len(question.sensors)
    findings: list[Finding] = []
    missing = np.zeros(len(names))
    low, high = np.full(len(names), np.inf), np.full(len(names), -np.inf)
    total, runs, periods, durations = 0, [], [], []
    for run in source.runs:
        n, with_response, first_s, last_s, steps = 0, 0, np.nan, np.nan, []
        absent = np.zeros(len(names))
        no_start = np.flatnonzero([np.isnan(datum.level(run, name)) for name in names])
        for time_s, values in source.chunks(run, names):
            found = np.isfinite(values)
            # samples without a displacement teach nothing, whatever the sensors say
            rows = found[:, n_sensors:].all(axis=1)
            absent += (~found[rows]).sum(axis=0)
            absent[no_start] += found[rows][:, no_start].sum(axis=0)
            with_response += int(rows.sum())
            n += len(time_s)
            if np.isnan(first_s) and len(time_s):
                first_s = float(time_s[0])
            last_s = float(time_s[-1]) if len(time_s) else last_s
            steps.append(float(np.median(np.diff(time_s)))) if len(time_s) > 1 else None
            if rows.any():
                low = np.fmin(low, np.nanmin(np.where(found, values, np.inf), axis=0))
                high = np.fmax(high, np.nanmax(np.where(found, values, -np.inf), axis=0))
        if with_response < 2:
            findings.append(_run_without_displacement(run, question.responses))
            continue
        runs.append(run)
        missing += absent
        total += with_response
        durations.append(last_s - first_s)
        periods.extend(steps)
    if not runs:
        raise OptionError(
            "no run has two samples with " + " and ".join(question.responses),
            expected="recordings of the displacement that the model is to predict",
            where="--response",
            advice="check the column and the unit of the displacement with `selector describe`",
        )
    for name, lowest, highest in zip(names, low, high, strict=True):
        if max(-lowest, highest) > MOST_CREDIBLE and np.isfinite(lowest):
            raise OptionError(
                f"{name} reads from {lowest:.3g} to {highest:.3g}",
                expected=f"readings within ±{MOST_CREDIBLE:g} in the unit of the channel",
                where="recordings",
                advice=f"mark broken readings as missing, or use --never {name}",
            )
    for name, lowest, highest in zip(question.responses, low[n_sensors:], high[n_sensors:], strict=True):
        if highest - lowest <= 1e-12 * max(1.0, abs(highest)):
            raise OptionError(
                f"{name} always reads {highest:.6g} µm",
                expected="a displacement that moves",
                where="--response",
                advice="leave it out (a direction that stays put needs no model), or check the gauge",
            )
    kept, about_sensors = usable_sensors(RunsOf(source, runs), question, missing / total, low, high, found_before)
    return Survey(
        tuple(runs),
        total,
        float(np.median(periods)) if periods else 1.0,
        float(max(durations)),
        replace(question, sensors=tuple(kept)),
        (*findings, *about_sensors),
    )


def _run_without_displacement(run: str, responses: Sequence[str]) -> Finding:
    return Finding(
        "run-without-displacement",
        "warning",
        f"Run {run} has no samples of {' and '.join(responses)}; it is left out.",
        Where(run=run),
        {},
        "check the displacement column of this file, or choose another --response",
        "leave-out-run",
    )
