"""Which readings are computed with: none beyond all measure, and rows at which responses were read at all."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np

from selector.diagnosis.comparison import Comparison, Mask, Vector, read_only
from selector.findings import Finding, Where

LARGEST = 1e30
"""Beyond this a number is no reading in any unit, and its fourth power may be no number at all."""
SELDOM = 3.5
"""Sampling periods between two readings of a response from which on it was read more rarely than the rest."""
_MOST_ROWS_BETWEEN = 12.0
"""Beyond this other responses lose too much when all are compared at the readings of the one that was read seldom."""
_ROWS = 60
"""Readings to be fitted to that must be left then."""


def without_extremes(comparison: Comparison) -> Comparison:
    """Numbers beyond 1e30 are missing readings, recorded or simulated; which, is said."""
    recorded, told = _measurable(comparison, comparison.recorded, "recorded")
    simulated, also = _measurable(comparison, comparison.simulated, "simulated")
    return dataclasses.replace(
        comparison, recorded=recorded, simulated=simulated, findings=(*comparison.findings, *told, *also)
    )


def at_readings(comparison: Comparison) -> Comparison:
    """The rows at which responses were read, where some were read more rarely than the rows follow each other.

    A response that was read in every fifth row, as a slower logger writes it, says nothing about the four between. All
    responses are compared at its readings. Where others would lose too much by that, it is left out instead, with a
    finding that says how to compare it by itself.
    """
    every = {name: _rows_between(comparison, name) for name in comparison.responses}
    seldom = {name: count for name, count in every.items() if count > SELDOM}
    if not seldom:
        return comparison
    read = np.any([_compared(comparison, name) for name in seldom], axis=0)
    is_enough = max(seldom.values()) <= _MOST_ROWS_BETWEEN and int(np.sum(read & ~comparison.held_out)) >= _ROWS
    if len(seldom) < len(every) and (not is_enough or read.all()):
        told = [_more_rarely(name, count) for name, count in seldom.items()]
        kept = tuple(name for name in every if name not in seldom)
        return dataclasses.replace(comparison, responses=kept, findings=(*comparison.findings, *told))
    if read.all():
        return comparison
    counts = ", ".join(f"{name} has a value in every {_nth(count)} row" for name, count in seldom.items())
    alone = len(seldom) == len(every)
    said = Finding(
        "read-seldom",
        "info" if alone else "warning",
        f"{counts}: responses are compared at {'its' if len(seldom) == 1 else 'their'} readings only.",
        evidence={"rows_between": seldom},
        suggestion=""
        if alone
        else "diagnose the other responses by themselves, with --response, to use all their rows",
    )
    thinned = _only(comparison, read)
    return at_readings(dataclasses.replace(thinned, findings=(*thinned.findings, said)))


def rows_in_stretches(comparison: Comparison, seen: Mask) -> int:
    """Rows in stretches of more than 8 that are `seen` and follow each other without a hole."""
    total = 0
    for _, rows in comparison.rows_of_runs():
        here = comparison.time_s[rows][seen[rows]]
        cuts = np.flatnonzero(np.diff(here) > SELDOM * comparison.period_s) + 1
        total += sum(len(part) for part in np.split(here, cuts) if len(part) > 8)
    return total


def _measurable(
    comparison: Comparison, courses: Mapping[str, Vector], kind: str
) -> tuple[dict[str, Vector], list[Finding]]:
    result, findings = {}, []
    for name, values in courses.items():
        beyond = np.abs(values) > LARGEST
        result[name] = values
        if not beyond.any():
            continue
        result[name] = np.where(beyond, np.nan, values)
        first = int(np.flatnonzero(beyond)[0])
        run = comparison.runs[int(comparison.run_index[first])]
        findings.append(
            Finding(
                "beyond-measure",
                "warning",
                f"{int(beyond.sum())} {kind} value(s) of {name} are beyond {LARGEST:g}, the first {values[first]:.4g} "
                f"in run {run} at {comparison.time_s[first]:.6g} s: they count as missing.",
                Where(channel=name, run=run),
                {"count": int(beyond.sum()), "value": float(values[first]), "kind": kind},
                "correct or remove these values, or the unit",
            )
        )
    return result, findings


def _rows_between(comparison: Comparison, name: str) -> float:
    """Median number of sampling periods from one compared reading of a response to the next; 1 if there is one only."""
    compared = _compared(comparison, name)
    steps = [np.diff(comparison.time_s[rows][compared[rows]]) for _, rows in comparison.rows_of_runs()]
    known = np.concatenate(steps)
    return float(np.median(known)) / comparison.period_s if len(known) else 1.0


def _compared(comparison: Comparison, name: str) -> Mask:
    return np.asarray(np.isfinite(comparison.difference(name)), dtype=np.bool_)


def _only(comparison: Comparison, kept: Mask) -> Comparison:
    """The comparison with some of its rows; runs without any are gone."""
    counts = [(run, int(kept[rows].sum())) for run, rows in comparison.rows_of_runs()]
    counts = [(run, count) for run, count in counts if count]
    return dataclasses.replace(
        comparison,
        runs=tuple(run for run, _ in counts),
        starts=(0, *np.cumsum([count for _, count in counts]).tolist()),
        time_s=read_only(comparison.time_s[kept]),
        recorded={name: read_only(values[kept]) for name, values in comparison.recorded.items()},
        simulated={name: read_only(values[kept]) for name, values in comparison.simulated.items()},
        held_out=comparison.held_out[kept],
    )


def _more_rarely(name: str, every: float) -> Finding:
    return Finding(
        "not-compared",
        "warning",
        f"{name} is not compared: it has a value in every {_nth(every)} row only, more rarely than other responses.",
        Where(channel=name),
        {"rows_between": every},
        f"diagnose it by itself: --response {name}",
    )


def _nth(count: float) -> str:
    whole = round(count)
    ending = "th" if 10 <= whole % 100 <= 20 else {1: "st", 2: "nd", 3: "rd"}.get(whole % 10, "th")
    return f"{whole}{ending}"
