"""Samples that are no measurements: codes of broken sensors, values that cannot be, and what a wrong unit explains."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from selector.findings import Finding, Where
from selector.quality.finding_table import FINDINGS, OUT_OF_RANGE, WRONG_UNIT
from selector.quality.leave_out import WINDOWS
from selector.quality.survey import (
    IMPLAUSIBLE,
    THERMAL_ROLES,
    Floats,
    Series,
    Survey,
    difference,
    moment,
    reading,
    stretch,
)
from selector.units import convert

_CODES = (
    -127.0, -200.0, 200.0, -250.0, -270.0, 327.67, -327.68, 655.35, 850.0, -850.0, 999.0, 999.9, -999.0, -999.9,
    1372.0, 2000.0, 3276.7, -3276.8, 6553.5, 7999.0, 8888.0, -8888.0, 9999.0, -9999.0, 9999.9, -9999.9, 32767.0,
    -32767.0, -32768.0, 32768.0, 65535.0, 65536.0, 99999.0, -99999.0, 999999.0, -999999.0, 1e6, -1e6, 1e7, -1e7,
    8388607.0, -8388608.0, 2147483647.0, -2147483648.0,
)  # fmt: skip
"""Values that loggers, transmitters and bus couplers put in place of a reading: the end of a Pt100 or thermocouple
table (-200, 850, 1372), the end of a 16-, 24- or 32-bit number in steps of 1, 0.1 or 0.01, rows of nines."""

_SOFT_CODES = (0.0, 85.0)
"""Codes that could be readings: an open input, the power-on value of a DS18B20. Only believed after a clear jump."""

PLAUSIBLE = {"temperature": (-60.0, 250.0), "ambient": (-60.0, 80.0)}
"""Beyond these, a temperature on or around a machine tool is not one [°C]."""

_MEASURED = ("temperature", "ambient", "displacement", "size", "amplitude")
_FAR = {"degC": 50.0, "um": 200.0}
"""A code stands at least this far from every reading of its run."""
_SOFT_FAR = 8.0
"""The same for codes that could be readings [K]; no solid part of a machine cools or warms that fast."""
_FEW = 3
"""Up to so many stretches are reported one by one, more of them in one finding."""


def broken_sensors(survey: Survey) -> Iterator[Finding]:
    """Findings ``sensor-break``: codes in place of readings, and numbers that are not finite. O(samples)."""
    codes = {role: _codes_of(role) for role in _MEASURED}
    for run in survey.runs:
        for column, channel in enumerate(survey.channels):
            x = survey.values[run][column]
            wild = np.isinf(x) | (np.abs(x) >= IMPLAUSIBLE)
            broken = wild
            series = _tame(survey.series(run, column), wild)
            if channel.role in _MEASURED and series.x.size:
                broken = wild.copy()
                broken[series.rows[_coded(series, codes[channel.role])]] = True
            if broken.any():
                yield from _reported(survey, run, column, broken)


def out_of_range(survey: Survey) -> Iterator[Finding]:
    """Findings ``out-of-range``: temperatures that no machine tool has, and that are no known code. O(samples)."""
    for run in survey.runs:
        for column in survey.columns(*THERMAL_ROLES):
            channel = survey.channels[column]
            low, high = PLAUSIBLE[channel.role]
            x = survey.values[run][column]
            outside = (x < low) | (x > high)
            if not outside.any():
                continue
            windows = joined(survey.time[run], outside, np.isfinite(x))
            seen = x[outside]
            worst = float(seen[np.argmax(np.abs(seen - (low + high) / 2))])
            way = "up" if worst > high else "down"
            yield from told(
                FINDINGS.finding(
                    "out-of-range",
                    f"{channel.name} in run {run} reads {way} to {reading(worst, channel)} {{when}}; on a machine "
                    f"tool −{-low:g} to {high:g} °C can be.",
                    Where(channel.name, run),
                    {"samples": int(outside.sum()), "value": worst, "plausible": [low, high]},
                    action="leave-out-stretch",
                ),
                windows,
            )


def told(finding: Finding, windows: list[tuple[float, float]], few: int = _FEW) -> Iterator[Finding]:
    """The finding for every stretch; when there are more than a few, one that lists them in its evidence.

    ``{when}`` in the statement is replaced by the time.
    """
    groups = [[window] for window in windows] if len(windows) <= few else [windows]
    for group in groups:
        begin, end = group[0][0], group[-1][1]
        evidence = dict(finding.evidence)
        when = stretch(begin, end)
        if len(group) > 1:
            evidence[WINDOWS] = [[a, b] for a, b in group]
            when = f"in {len(group)} stretches between {moment(begin)} and {moment(end)}"
        where = replace(finding.where, from_s=begin, to_s=end)
        yield replace(finding, statement=finding.statement.replace("{when}", when), where=where, evidence=evidence)


def joined(time_s: Floats, bad: NDArray[np.bool_], present: NDArray[np.bool_]) -> list[tuple[float, float]]:
    """Stretches of bad samples [s], those next to each other (missing samples aside) joined."""
    rows = np.flatnonzero(bad)
    if rows.size == 0:
        return []
    # counting present samples up to each row: two bad ones with none good between them belong together
    good = np.cumsum(present & ~bad)[rows]
    first = np.flatnonzero(np.r_[True, good[1:] != good[:-1]])
    last = np.r_[first[1:] - 1, rows.size - 1]
    return [(float(time_s[rows[a]]), float(time_s[rows[b]])) for a, b in zip(first, last, strict=True)]


def _codes_of(role: str) -> Floats:
    """The codes as they look in a recording when the file held another unit, sorted."""
    plain = np.array(_CODES)
    if role in THERMAL_ROLES:
        looks = [plain, convert(plain, "degF", "degC"), convert(plain, "kelvin", "degC")]
    else:
        looks = [plain, plain * 1e3, plain * 25.4, plain * 25400.0]
    return np.unique(np.concatenate(looks))


def _tame(series: Series, wild: NDArray[np.bool_]) -> Series:
    keep = ~wild[series.rows]
    if keep.all():
        return series
    return Series(series.channel, series.column, series.run, series.time_s[keep], series.x[keep], series.rows[keep])


def _coded(series: Series, codes: Floats) -> NDArray[np.bool_]:
    """Which samples are codes: equal to one, and far from every sample that is none."""
    x, role = series.x, series.channel.role
    thermal = role in THERMAL_ROLES
    low, high = float(x.min()), float(x.max())
    coded = np.zeros(x.size, dtype=np.bool_)
    if max(abs(low), abs(high)) >= 85.0 or (thermal and low < -20.0):
        after = np.clip(np.searchsorted(codes, x), 1, codes.size - 1)
        nearest = np.where(x - codes[after - 1] < codes[after] - x, codes[after - 1], codes[after])
        coded = np.abs(x - nearest) <= 2e-6 * np.abs(nearest)  # the file may have held float32
        coded = _apart(x, coded, _FAR["degC" if thermal else "um"], role)
    if thermal and (low <= 85.0 <= high or low <= 0.0 <= high):
        soft = np.isin(x, _SOFT_CODES) & ~coded
        if soft.any() and not (soft | coded).all():
            coded[~coded] |= _apart(x[~coded], soft[~coded], _SOFT_FAR, role)
    return coded


def _apart(x: Floats, coded: NDArray[np.bool_], far: float, role: str) -> NDArray[np.bool_]:
    """The coded samples that stand at least `far` from every reading; readings that lead up to a code make it one."""
    readings = x[~coded]
    if not coded.any() or readings.size == 0:
        low, high = PLAUSIBLE.get(role, (-np.inf, np.inf))
        return np.asarray(coded & ((x < low) | (x > high)))
    if role not in THERMAL_ROLES:
        low, high = np.quantile(readings, [0.02, 0.98])
        far = max(far, 2.0 * float(high - low))
    kept = np.zeros(x.size, dtype=np.bool_)
    for code in np.unique(x[coded]):
        if np.abs(readings - code).min() >= far:
            kept |= x == code
    return kept


def _reported(survey: Survey, run: str, column: int, broken: NDArray[np.bool_]) -> Iterator[Finding]:
    channel, x = survey.channels[column], survey.values[run][column]
    present = ~np.isnan(x)
    share = float(broken.sum() / present.sum())
    seen, counts = np.unique(x[broken], return_counts=True)
    codes = [float(value) if np.isfinite(value) else str(value) for value in seen[np.argsort(-counts)][:5]]
    said = ", ".join(reading(float(code), channel) for code in codes)
    rest, away = x[present & ~broken], ""
    if rest.size and np.isfinite(seen).all():
        nearest = float(np.min(np.abs(seen - np.median(rest))))
        away = f", {difference(nearest, channel)} from its other readings"
    evidence = {"codes": codes, "samples": int(broken.sum()), "share": share}
    if share > 0.5:
        window = joined(survey.time[run], broken, present)
        yield FINDINGS.finding(
            "sensor-break",
            f"{channel.name} in run {run} holds the code of a broken sensor ({said}) in {share:.0%} of its samples.",
            Where(channel.name, run, window[0][0], window[-1][1]),
            evidence,
            "Check the sensor, its plug and its input. The channel is left out of this run.",
            "leave-out-channel",
            level="error",
        )
        return
    yield from told(
        FINDINGS.finding(
            "sensor-break",
            f"{channel.name} in run {run} holds {said} {{when}}{away}:"
            " the code of a broken or open sensor, not a reading.",
            Where(channel.name, run),
            evidence,
            "Check the sensor, its plug and its input. The stretch is left out.",
            "leave-out-stretch",
            level="error",
        ),
        joined(survey.time[run], broken, present),
    )


_NOTHING = "Nothing is left out."


def agreed(findings: Sequence[Finding]) -> list[Finding]:
    """The findings in their order; those about a wrong unit and the readings out of range that it explains agree."""
    told = list(findings)
    for i, unit in enumerate(told):
        if unit.id != WRONG_UNIT or unit.action != "none":
            continue
        explained = [k for k, other in enumerate(told) if other.id == OUT_OF_RANGE and _explains(unit, other)]
        for k in explained:
            advice = f"Its unit explains this ({unit.evidence['mistake']}): see wrong-unit. The stretch is left out."
            told[k] = replace(told[k], suggestion=advice)
        if explained:
            advice = unit.suggestion.replace(_NOTHING, "Until then the readings that are out of range are left out.")
            told[i] = replace(unit, suggestion=advice)
    return told


def _explains(unit: Finding, other: Finding) -> bool:
    """Whether the readings would be those of a machine tool in the other unit."""
    if unit.where.channel not in (None, other.where.channel) or unit.where.run not in (None, other.where.run):
        return False
    low, high = PLAUSIBLE["temperature"]
    gain, offset = unit.evidence["gain"], unit.evidence.get("offset", 0.0)
    return bool(low <= (other.evidence["value"] - offset) / gain <= high)
