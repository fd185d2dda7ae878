"""Whether a recording is sampled as those that a model was fitted on, or its clock looks like a wrong unit of time."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from selector.controllers.model_file import ModelFile
from selector.findings import Finding, Where
from selector.quality.wording import duration
from selector.recording import Recording, RunSource

FAR = 3.0
"""Ratio of two sampling periods from which they are no longer alike."""

_UNITS_OF_TIME = (60.0, 1000.0, 3600.0, 1440.0, 60_000.0, 86_400.0, 1e6)
"""Ratios of units of time that are taken for each other: min and s, s and ms, h and s, d and min …"""
_NEAR = 0.03


def period_of(source: RunSource) -> float | None:
    """Median over the runs of the time between two samples [s]; None: no run has two."""
    first = [channel.name for channel in source.channels][:1]
    steps = []
    for run in source.runs:
        pieces = [float(np.median(np.diff(time_s))) for time_s, _ in source.chunks(run, first) if len(time_s) > 1]
        steps += [float(np.median(pieces))] if pieces else []
    period_s = float(np.median(steps)) if steps else 0.0
    return period_s if period_s > 0.0 else None


def other_sampling(model: ModelFile, recording: Recording, *, is_guarded: bool = False) -> Iterator[Finding]:
    """Runs that are sampled otherwise than those of the model; none where its file does not say how these were.

    Parameters
    ----------
    is_guarded : bool
        Whether the model is run with its guard, whose limits of change are in seconds, too.
    """
    fitted_s = model.provenance.period_s
    if fitted_s is None:
        return
    rests_on = _on_the_clock(model, is_guarded=is_guarded)
    for run in recording.runs:
        time_s = recording.time_s(run)
        period_s = float(np.median(np.diff(time_s))) if len(time_s) > 1 else 0.0
        if period_s <= 0.0 or max(period_s / fitted_s, fitted_s / period_s) < FAR:
            continue
        ratio = max(period_s / fitted_s, fitted_s / period_s)
        is_unit = any(abs(ratio / of - 1.0) < _NEAR for of in _UNITS_OF_TIME)
        is_guessed = "unit" in (recording.provenance.get("runs", {}).get(run, {}).get("time_guessed") or ())
        doubt = " That looks like a wrong unit of time" if is_unit else ""
        guess = ", which was only guessed here" if is_unit and is_guessed else ""
        yield Finding(
            "other-sampling",
            "info" if not rests_on else "error" if guess else "warning",
            f"Run {run} has a sample every {duration(period_s)}, the model was fitted on one every "
            f"{duration(fitted_s)}: a factor of {ratio:.3g}.{doubt}{guess}{'.' if doubt else ''} "
            + (f"On the clock depend {rests_on}." if rests_on else "This model's answers do not depend on the clock."),
            Where(run=run),
            {"period_s": period_s, "fitted_period_s": fitted_s, "looks_like_unit": is_unit, "unit_guessed": is_guessed},
            "say the unit of the time: --time-unit min (or s, ms, h), or unit under [time] in the machine file"
            if is_unit
            else "check the unit of the time; if the logger was set otherwise, all is well",
        )


def _on_the_clock(model: ModelFile, *, is_guarded: bool) -> str:
    """What of a model depends on the time between two calls, in words; nothing: empty."""
    parts = ["the model's memory"] if model.states else []
    if is_guarded and any(limit.slew_um_per_s is not None for limit in model.guard.limits):
        parts.append("the slew of the correction")
    if is_guarded and any(item.rate_limit_per_min is not None for item in model.inputs):
        parts.append("the fastest change that is believed of a sensor")
    return ", ".join(parts[:-1]) + (" and " if len(parts) > 1 else "") + "".join(parts[-1:])
