"""Whether there is enough in a recording: samples, values, different ones among them, and runs that are no copies."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from selector.findings import Finding, Where
from selector.quality.finding_table import FINDINGS
from selector.quality.survey import MEASURED_ROLES, Survey, difference, present_median, reading

_SHORT = 20
_FEW_LEVELS = 8
_COARSE = {"degC": 0.5, "um": 5.0}
"""A resolution like this is a warning; a finer one with few values only means that the channel hardly moves."""
_WARM_K = 4.0
_WARM_UM = 10.0


def short_runs(survey: Survey) -> Iterator[Finding]:
    """Findings ``short-run``: fewer than 20 samples."""
    for run in survey.runs:
        rows = survey.time[run].size
        if rows < _SHORT:
            yield FINDINGS.finding(
                "short-run",
                f"Run {run} has {rows} sample(s) only; fewer than {_SHORT} say little about a thermal process.",
                Where(run=run),
                {"samples": rows},
                level="warning",
            )


def empty_channels(survey: Survey) -> Iterator[Finding]:
    """Findings ``empty-channel``: no value in any run, or none in one run."""
    for column, channel in enumerate(survey.channels):
        empty = [run for run in survey.runs if not np.isfinite(survey.values[run][column]).any()]
        everywhere = len(empty) == len(survey.runs)
        for run in empty[:1] if everywhere else empty:
            yield FINDINGS.finding(
                "empty-channel",
                f"{channel.name} has no value in {'any run' if everywhere else 'run ' + run}.",
                Where(channel.name, None if everywhere else run),
                {"runs": len(empty)},
                level="warning" if everywhere else "info",
            )


def few_values(survey: Survey) -> Iterator[Finding]:
    """Findings ``constant-channel`` and ``few-values``: one value, or fewer than eight, over all runs."""
    for column, channel in enumerate(survey.channels):
        scales = [survey.scale(run, column) for run in survey.runs]
        scales = [scale for scale in scales if scale.count]
        if sum(scale.count for scale in scales) < 2:
            continue
        low, high = min(s.low for s in scales), max(s.high for s in scales)
        if high - low <= 1e-12 * max(abs(low), abs(high)):
            yield FINDINGS.finding(
                "constant-channel",
                f"{channel.name} is {reading(low, channel)} in every sample of every run.",
                Where(channel.name),
                {"value": low},
                f"{'Check the sensor and its wiring. ' * (channel.role in MEASURED_ROLES)}A constant is not used.",
            )
            continue
        if channel.role not in MEASURED_ROLES or sum(scale.count for scale in scales) < _SHORT:
            continue
        values = np.unique(np.concatenate([_values(survey, run, column) for run in survey.runs]))
        step = survey.quantum(column)
        coarse = step >= _COARSE[channel.unit]
        if max(scale.distinct for scale in scales) > _FEW_LEVELS and not (coarse and (high - low) < 12 * step):
            continue
        if values.size > _FEW_LEVELS and not coarse:
            continue
        yield FINDINGS.finding(
            "few-values",
            f"{channel.name} takes {values.size} different values only, {difference(step, channel)} apart, over a "
            f"range of {difference(high - low, channel)}.",
            Where(channel.name),
            {"distinct": int(values.size), "resolution": step, "range": high - low},
            "Record it with a finer resolution."
            if coarse
            else "It hardly moves; its resolution limits what it can say.",
            level="warning" if coarse else "info",
        )


def starts(survey: Survey) -> Iterator[Finding]:
    """Findings ``run-starts-warm``: a run that starts far from where the other runs start, ambient taken off."""
    if len(survey.runs) < 3:
        return
    ambient = survey.columns("ambient")
    temperatures, displacements = survey.columns("temperature"), survey.columns("displacement")
    level = {run: np.array([_start(survey, run, c) for c in range(len(survey.channels))]) for run in survey.runs}
    room = {run: present_median(level[run][ambient]) if ambient else 0.0 for run in survey.runs}
    for run in survey.runs:
        others = [other for other in survey.runs if other != run]
        warm: dict[str, float] = {}
        for columns, limit, thermal in ((temperatures, _WARM_K, True), (displacements, _WARM_UM, False)):
            if thermal and not ambient:
                continue  # without the room's temperature a warm day looks like a warm machine
            for c in columns:
                usual = present_median(np.array([level[o][c] - (room[o] if thermal else 0.0) for o in others]))
                off = level[run][c] - (room[run] if thermal else 0.0) - usual
                if np.isfinite(off) and abs(off) > limit:
                    warm[survey.channels[c].name] = float(off)
        if not warm:
            continue
        worst = max(warm, key=lambda name: abs(warm[name]))
        said = difference(warm[worst], survey.recording.channel(worst))
        yield FINDINGS.finding(
            "run-starts-warm",
            f"Run {run} does not start like the others: {len(warm)} channel(s) are off at its start, {worst} most "
            f"({said}).",
            Where(run=run, from_s=float(survey.time[run][0]), to_s=float(survey.time[run][0])),
            {"channels": warm},
        )


def _start(survey: Survey, run: str, column: int) -> float:
    """Level at the start of a run; NaN when nothing of the start is there."""
    rows = survey.series(run, column).rows
    there = rows.size > 0 and rows[0] <= 0.02 * survey.time[run].size
    return survey.scale(run, column).start if there else float("nan")


def _values(survey: Survey, run: str, column: int) -> np.ndarray:
    x = survey.series(run, column).x
    # a few values show in any part of a long run
    return np.unique(x) if survey.scale(run, column).distinct <= 64 else x[:64]


def file_copies(hashes: Mapping[str, str]) -> Iterator[Finding]:
    """Runs that are the same file again: leaving one out would prove nothing while its copy stays in."""
    first: dict[str, str] = {}
    for run, sha256 in hashes.items():
        original = first.setdefault(sha256, run)
        if original != run:
            yield FINDINGS.finding(
                "same-file-twice",
                f"Run {run} is the same file as run {original}; it is left out.",
                Where(run=run),
                {"sha256": sha256, "original": original},
                action="leave-out-run",
            )
