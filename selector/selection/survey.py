"""What there is to work with: length and period of every run, sensors that cannot be used, and why."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from selector.errors import OptionError
from selector.findings import Finding, Where
from selector.models.design import Columns, Datum, Design
from selector.models.moments import moments, scaling_of
from selector.models.reference import RunSource
from selector.models.terms import Term
from selector.selection.options import Question

FEW_MISSING = 0.01
REPLACEABLE_R2 = 0.98


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


def survey(source: RunSource, question: Question) -> Survey:
    """Decide which runs and sensors can be used.

    A sensor that is constant, that copies another one, or that is missing where others could stand in for it is not a
    candidate; every such decision is a finding.

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
        for time_s, values in source.chunks(run, names):
            found = np.isfinite(values)
            # samples without a displacement teach nothing, whatever the sensors say
            rows = found[:, n_sensors:].all(axis=1)
            absent += (~found[rows]).sum(axis=0)
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
    kept = _usable(RunsOf(source, runs), question, missing / total, low, high, findings)
    return Survey(
        tuple(runs),
        total,
        float(np.median(periods)) if periods else 1.0,
        float(max(durations)),
        replace(question, sensors=tuple(kept)),
        tuple(findings),
    )


def _usable(
    source: RunSource,
    question: Question,
    missing: NDArray[np.float64],
    low: NDArray[np.float64],
    high: NDArray[np.float64],
    findings: list[Finding],
) -> list[str]:
    must = set(question.options.must)
    reasons: dict[str, tuple[str, str, str]] = {}
    for j, name in enumerate(question.sensors):
        if not np.isfinite(low[j]) or missing[j] >= 1.0:
            reasons[name] = ("sensor-missing", "has no reading where the displacement is known", "check its wiring")
        elif high[j] - low[j] <= 1e-9 * max(1.0, abs(high[j])):
            reasons[name] = ("constant-sensor", f"always reads {high[j]:.6g} °C", "a constant cannot explain anything")
    gaps = {name: missing[j] for j, name in enumerate(question.sensors) if name not in reasons}
    patchy = [name for name, share in gaps.items() if share > FEW_MISSING]
    for name in sorted(patchy, key=lambda name: -gaps[name]):
        others = [other for other in gaps if other != name and other not in reasons and gaps[other] <= FEW_MISSING]
        likeness = _explained(source, name, others) if others else 0.0
        if (gaps[name] > 0.5 or likeness >= REPLACEABLE_R2) and name not in must:
            reasons[name] = (
                "sensor-missing",
                f"is missing in {100 * gaps[name]:.0f} % of the samples; others explain {100 * likeness:.1f} % of it",
                f"use --must {name} to keep it at the price of those samples",
            )
        else:
            findings.append(
                Finding(
                    "samples-lost",
                    "warning",
                    f"{name} is missing in {100 * gaps[name]:.0f} % of the samples and no other sensor can stand in "
                    f"for it; those samples are not used for sets with {name}, nor for comparing sensors.",
                    Where(channel=name),
                    {"missing_share": float(gaps[name]), "explained_by_others": likeness},
                    f"repair {name} and record again, or use --never {name}",
                    "leave-out-stretch",
                )
            )
    for name, (kind, why, advice) in reasons.items():
        if name in must:
            raise OptionError(
                f"{name} {why}",
                expected="a sensor that can be used",
                where="--must",
                advice=f"take {name} out of --must",
            )
        findings.append(
            Finding(
                kind,
                "warning",
                f"{name} {why}; it is not a candidate.",
                Where(channel=name),
                {},
                advice,
                "leave-out-channel",
            )
        )
    kept = [name for name in question.sensors if name not in reasons]
    if not kept:
        raise OptionError(
            "no usable sensor: " + "; ".join(f"{name} {why}" for name, (_, why, _) in reasons.items()),
            expected="at least one temperature that changes",
            where="recordings",
            advice="record a run in which the machine warms up, and check the sensors with `selector describe`",
        )
    return kept


def _explained(source: RunSource, name: str, others: Sequence[str]) -> float:
    """R² of a sensor on the others, where all are there."""
    design = Design((name, *others), (), Datum("absolute"))
    columns = Columns(scaling_of(source, design), tuple(Term(((one, 1),)) for one in design.inputs))
    cross, n = moments(source, design, columns).centred() if source.runs else (np.zeros((1, 1)), 0.0)
    if n <= len(others) + 2 or cross[0, 0] <= 0:
        return 0.0
    within = cross[1:, 1:] + 1e-10 * np.trace(cross[1:, 1:]) / len(others) * np.eye(len(others))
    explained = float(cross[0, 1:] @ np.linalg.solve(within, cross[1:, 0]))
    return min(max(explained / float(cross[0, 0]), 0.0), 1.0)


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
