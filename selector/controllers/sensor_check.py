"""Which readings of a run the model does not know, and which sensor looks broken to it.

Only what the model file itself can tell: valid ranges, break codes, limits of readings and rates, and sensors that
stand still while the others move. `selector.quality` looks at a recording without a model.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from selector.controllers.finding_table import FINDINGS
from selector.controllers.model_file import Input, ModelFile
from selector.findings import Finding, Level, Where
from selector.types import Array, Mask

RANGE_SLACK = 1e-9
"""Of the width of a valid range: the rounding of a difference of two readings is not an excess."""

CODE_SLACK = 1e-6
"""Relative: break codes pass through float32 (6e-8) and decimal text on their way into a recording."""

SLIGHT_SHARE = 0.01
SLIGHT_EXCESS = 0.05
"""Shorter and less (of the width of the range) than both: noise at the edge, worth a note but no warning."""

MISSING_SHARE = 0.05
STUCK_SHARE_OF_RUN = 0.25
STUCK_SAMPLES = 20
OTHERS_MOVED_SHARE = 0.15
NOISE_SIGMAS = 6.0


def usable_readings(
    model: ModelFile, run: str, time_s: Array, readings: Mapping[str, Array]
) -> tuple[dict[str, Array], tuple[Finding, ...]]:
    """Readings per input with NaN where they are not temperatures (or speeds, …) at all, and what was found.

    Findings ``sensor-looks-broken`` (kinds missing, break-code, out-of-limits, jump, stuck) and ``missing-readings``.
    """
    usable: dict[str, Array] = {}
    findings: list[Finding] = []
    for item in model.inputs:
        values = np.where(np.isfinite(readings[item.name]), readings[item.name], np.nan)
        codes = _is_break_code(item, values, model.guard.break_codes)
        beyond = _is_beyond_limits(item, values) & ~codes
        findings.extend(_missing(item, run, time_s, np.isnan(values)))
        findings.extend(_broken(item, run, time_s, values, codes, "break-code"))
        findings.extend(_broken(item, run, time_s, values, beyond, "out-of-limits"))
        usable[item.name] = np.where(codes | beyond, np.nan, values)
    for item in model.inputs:
        findings.extend(_jumps(item, run, time_s, usable[item.name]))
        findings.extend(_stuck(item, model, run, time_s, usable))
    return usable, tuple(findings)


def outside_valid_range(
    model: ModelFile, run: str, time_s: Array, readings: Mapping[str, Array], start: Mapping[str, float]
) -> Iterator[Finding]:
    """One finding ``outside-valid-range`` for every input of a run that leaves what the model has seen."""
    for item in model.inputs:
        x = readings[item.name] - (start[item.name] if item.reference == "rise" else 0.0)
        slack = RANGE_SLACK * (item.valid_max - item.valid_min)
        excess = np.fmax(item.valid_min - x, x - item.valid_max)
        outside = excess > slack
        if not outside.any():
            continue
        worst = int(np.nanargmax(excess))
        share = time_share(time_s, outside)
        unit = unit_of_difference(item)
        what = "rise" if item.reference == "rise" else "reading"
        when = np.flatnonzero(outside)
        width = item.valid_max - item.valid_min
        slight = share < SLIGHT_SHARE and float(excess[worst]) < SLIGHT_EXCESS * width
        said = f"{share:.1%}" if share >= 0.001 else "less than 0.1%"
        yield FINDINGS.finding(
            "outside-valid-range",
            f"{item.name} in run {run}: the {what} leaves the valid range {item.valid_min:.4g} … {item.valid_max:.4g} "
            f"{unit} of the model since {time_s[when[0]]:.0f} s, by up to {excess[worst]:.3g} {unit}, for {said} "
            "of the time. There the model extrapolates.",
            Where(channel=item.name, run=run, from_s=float(time_s[when[0]]), to_s=float(time_s[when[-1]])),
            {
                "valid_min": item.valid_min,
                "valid_max": item.valid_max,
                "smallest": float(np.nanmin(x)),
                "largest": float(np.nanmax(x)),
                "largest_excess": float(excess[worst]),
                "unit": unit,
                "share_of_time": share,
            },
            level="info" if slight else "warning",
        )


def time_share(time_s: Array, where: Mask) -> float:
    """Share of the time of a run for which `where` holds, each sample lasting until the next one."""
    if len(time_s) == 1:
        return float(where[0])
    steps = np.diff(time_s)
    lasting = np.append(steps, np.median(steps))
    return float(np.sum(lasting[where]) / np.sum(lasting))


def unit_of_difference(item: Input) -> str:
    """The unit of a difference of readings, for people."""
    return "K" if item.unit == "degC" else item.unit


def _is_break_code(item: Input, values: Array, codes: tuple[float, ...]) -> Mask:
    found = np.zeros(len(values), dtype=np.bool_)
    if item.unit == "degC":
        for code in codes:
            found |= np.abs(values - code) <= CODE_SLACK * abs(code)
    return found


def _is_beyond_limits(item: Input, values: Array) -> Mask:
    low = -np.inf if item.reading_min is None else item.reading_min
    high = np.inf if item.reading_max is None else item.reading_max
    return (values < low) | (values > high)


def _broken_finding(
    item: Input, run: str, kind: str, level: Level, statement: str, window_s: tuple[float, float], **evidence: object
) -> Finding:
    left_out = kind in ("break-code", "out-of-limits", "missing")
    return FINDINGS.finding(
        "sensor-looks-broken",
        statement,
        Where(channel=item.name, run=run, from_s=window_s[0], to_s=window_s[1]),
        {"kind": kind, **evidence},
        action="leave-out-stretch" if left_out else "none",
        level=level,
    )


def _missing(item: Input, run: str, time_s: Array, missing: Mask) -> Iterator[Finding]:
    if not missing.any():
        return
    when = np.flatnonzero(missing)
    window = float(time_s[when[0]]), float(time_s[when[-1]])
    share = time_share(time_s, missing)
    ends_dead = bool(missing[-STUCK_SAMPLES:].all())
    said = "has no reading at all" if missing.all() else f"has no reading for {share:.1%} of the time"
    statement = f"{item.name} in run {run} {said}; there is no prediction there."
    if share > MISSING_SHARE or ends_dead:
        yield _broken_finding(item, run, "missing", "error", statement, window, share_of_time=share, samples=len(when))
    else:
        yield FINDINGS.finding(
            "missing-readings",
            statement,
            Where(channel=item.name, run=run, from_s=window[0], to_s=window[1]),
            {"share_of_time": share, "samples": len(when)},
            action="leave-out-stretch",
        )


def _broken(item: Input, run: str, time_s: Array, values: Array, where: Mask, kind: str) -> Iterator[Finding]:
    if not where.any():
        return
    when = np.flatnonzero(where)
    window = float(time_s[when[0]]), float(time_s[when[-1]])
    share = time_share(time_s, where)
    reading = float(values[when[0]])
    unit = item.unit.replace("degC", "°C")
    meaning = "the code of a broken sensor" if kind == "break-code" else "beyond the limits of its readings"
    yield _broken_finding(
        item, run, kind, "error",
        f"{item.name} in run {run} reads {reading:.6g} {unit} since {window[0]:.0f} s, which is {meaning}, for "
        f"{share:.1%} of the time; these readings are left out and there is no prediction there.",
        window, reading=reading, share_of_time=share, samples=len(when),
    )  # fmt: skip


def _jumps(item: Input, run: str, time_s: Array, values: Array) -> Iterator[Finding]:
    there = np.flatnonzero(~np.isnan(values))
    if item.rate_limit_per_min is None or len(there) < 2:
        return
    steps = np.diff(values[there])
    sizes = np.abs(steps)
    # noise and the resolution of the converter are no jumps, however fast the sampling; in a reading that changed
    # once only, the jump itself would pass for the resolution, hence the bound
    noise = NOISE_SIGMAS * 1.4826 * float(np.median(np.abs(steps - np.median(steps))))
    resolution = float(np.min(sizes[sizes > 0.0], initial=np.inf))
    slack = max(noise, min(2.0 * resolution, 0.1 * (item.valid_max - item.valid_min)))
    allowed = item.rate_limit_per_min / 60.0 * np.diff(time_s[there])
    jumps = np.flatnonzero(sizes > allowed + slack)
    if len(jumps) == 0:
        return
    worst = int(jumps[np.argmax(sizes[jumps] - allowed[jumps])])
    at_s, unit = float(time_s[there[worst + 1]]), unit_of_difference(item)
    yield _broken_finding(
        item, run, "jump", "warning",
        f"{item.name} in run {run} jumps by {steps[worst]:.3g} {unit} at {at_s:.0f} s; the rate limit of the model is "
        f"{item.rate_limit_per_min:.3g} {unit}/min ({len(jumps)} such {'step' if len(jumps) == 1 else 'steps'}).",
        (float(time_s[there[jumps[0] + 1]]), float(time_s[there[jumps[-1] + 1]])),
        largest_step=float(steps[worst]), at_s=at_s, rate_limit_per_min=item.rate_limit_per_min, steps=len(jumps),
    )  # fmt: skip


def _stuck(item: Input, model: ModelFile, run: str, time_s: Array, readings: Mapping[str, Array]) -> Iterator[Finding]:
    there = np.flatnonzero(~np.isnan(readings[item.name]))
    if len(there) < STUCK_SAMPLES or item.valid_max == item.valid_min:
        return
    values, times = readings[item.name][there], time_s[there]
    bounds = np.flatnonzero(np.r_[True, values[1:] != values[:-1], True])
    first, last = bounds[:-1], bounds[1:] - 1
    longest = int(np.argmax(times[last] - times[first]))
    a, b = int(first[longest]), int(last[longest])
    duration_s, run_s = float(times[b] - times[a]), float(time_s[-1] - time_s[0])
    if b - a + 1 < STUCK_SAMPLES or duration_s < STUCK_SHARE_OF_RUN * run_s:
        return
    changes = np.abs(np.diff(values))
    resolution = float(np.min(changes[changes > 0.0], initial=np.inf))
    if np.isfinite(resolution) and resolution > 0.1 * (item.valid_max - item.valid_min):
        return  # so coarse that standing still is normal
    moved = []
    for other in model.inputs:
        if other.name == item.name or other.unit != item.unit or other.valid_max == other.valid_min:
            continue
        part = readings[other.name][there[a] : there[b] + 1]
        if not np.isnan(part).all():
            moved.append(float(np.nanmax(part) - np.nanmin(part)) / (other.valid_max - other.valid_min))
    if not moved or float(np.median(moved)) < OTHERS_MOVED_SHARE:
        return
    unit = item.unit.replace("degC", "°C")
    yield _broken_finding(
        item, run, "stuck", "warning",
        f"{item.name} in run {run} stands at {values[a]:.6g} {unit} for {duration_s:.0f} s from {times[a]:.0f} s, "
        f"while the other sensors move by {float(np.median(moved)):.0%} of their valid range.",
        (float(times[a]), float(times[b])),
        reading=float(values[a]), duration_s=duration_s, others_moved_share=float(np.median(moved)),
    )  # fmt: skip
