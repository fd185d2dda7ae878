"""How much of what was recorded was simulated as well."""

from __future__ import annotations

from collections.abc import Mapping

from selector.diagnosis.comparison import Mask
from selector.errors import InputError
from selector.findings import Finding, Where

_PART = 0.8
"""Share of a run below which it is said that the rest of it is not compared."""
_LEAST = 0.1
"""Share below which a simulation is not of this run: another unit of time or another programme."""


_TIME_UNITS = (60.0, 1e3, 3600.0, 6e4, 3.6e6)
"""How many times longer a run is in another unit of time."""
_SAME = 0.03
"""Part by which runs may differ that are the same in another unit."""


def require_same_time_unit(durations_s: Mapping[str, tuple[float, float]]) -> None:
    """Ends with an error when every simulated run is the recorded one in a smaller unit of time.

    Parameters
    ----------
    durations_s : mapping of str to tuple of float
        Run → duration of what was recorded and of what was simulated [s].

    Raises
    ------
    InputError
        Every run is longer by the same factor between units.
    """
    ratios = {run: simulated / recorded for run, (recorded, simulated) in durations_s.items() if recorded > 0.0}
    for factor in _TIME_UNITS:
        if ratios and all(abs(ratio / factor - 1.0) < _SAME for ratio in ratios.values()):
            run = next(iter(ratios))
            recorded_s, simulated_s = durations_s[run]
            raise InputError(
                f"run {run} was recorded for {recorded_s:.6g} s and simulated for {simulated_s:.6g} s, "
                f"{factor:g} times as long, and so was every other",
                expected="the same unit of time in both",
                where="simulation",
                advice="check the unit of time in both (--time-unit, --simulation-time-unit, the headers)",
            )


def partly_simulated(covered: Mapping[str, Mask]) -> list[Finding]:
    """Findings ``partly-simulated`` of runs that the simulation covers in part.

    Parameters
    ----------
    covered : mapping of str to ndarray of bool of shape (n_rows,)
        Run → recorded rows at which the simulation has a value.

    Raises
    ------
    InputError
        It covers less than a tenth of every run.
    """
    counts = {run: (int(rows.sum()), len(rows)) for run, rows in covered.items()}
    if counts and all(there < _LEAST * of for there, of in counts.values()):
        run, (there, of) = max(counts.items(), key=lambda item: item[1][0] / item[1][1])
        raise InputError(
            f"{there} of {of} recorded rows of run {run} ({there / of:.1%}) lie within the simulated time, fewer in "
            "the others"
            if len(counts) > 1
            else f"{there} of {of} recorded rows of run {run} ({there / of:.1%}) lie within the simulated time",
            expected=f"a simulation of at least {_LEAST:.0%} of a run",
            where="simulation",
            advice="check the unit of time in both (--time-unit, --simulation-time-unit), or give only the part of the "
            "recording that was simulated",
        )
    return [
        Finding(
            "partly-simulated",
            "warning",
            f"Run {run}: the simulation has a value at {there} of {of} recorded rows ({there / of:.0%}); only these "
            "are compared.",
            Where(run=run),
            {"rows": there, "of": of, "share": there / of},
            "simulate the whole run, or check the unit of time in both",
        )
        for run, (there, of) in counts.items()
        if there < _PART * of
    ]
