"""Samples that are no measurements: codes of broken sensors, values that cannot be, channels that stand still."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import erf

from selector.findings import Finding, Where
from selector.number_text import span_text
from selector.quality.finding_table import FINDINGS
from selector.quality.leave_out import WINDOWS
from selector.quality.survey import (
    IMPLAUSIBLE,
    MEASURED_ROLES,
    THERMAL_ROLES,
    Ints,
    Series,
    Survey,
    difference,
    moment,
    reading,
    stretch,
)
from selector.types import Array, Mask
from selector.units import convert

#: Values that loggers, transmitters and bus couplers put in place of a reading: the end of a Pt100 or thermocouple
#: table (-200, 850, 1372), the end of a 16-, 24- or 32-bit number in steps of 1, 0.1 or 0.01, rows of nines.
_CODES = (
    -127.0, -200.0, 200.0, -250.0, -270.0, 327.67, -327.68, 655.35, 850.0, -850.0, 999.0, 999.9, -999.0, -999.9,
    1372.0, 2000.0, 3276.7, -3276.8, 6553.5, 7999.0, 8888.0, -8888.0, 9999.0, -9999.0, 9999.9, -9999.9, 32767.0,
    -32767.0, -32768.0, 32768.0, 65535.0, 65536.0, 99999.0, -99999.0, 999999.0, -999999.0, 1e6, -1e6, 1e7, -1e7,
    8388607.0, -8388608.0, 2147483647.0, -2147483648.0,
)  # fmt: skip

#: Codes that could be readings: an open input, the power-on value of a DS18B20. Only believed after a clear jump.
_SOFT_CODES = (0.0, 85.0)
#: Beyond these, a temperature on or around a machine tool is not one [°C].
PLAUSIBLE = {"temperature": (-60.0, 250.0), "ambient": (-60.0, 80.0)}
_MEASURED = ("temperature", "ambient", "displacement", "size", "amplitude")
_FAR = {"degC": 50.0, "um": 200.0}  #: A code stands at least this far from every reading of its run.
_SOFT_FAR = 8.0  #: The same for codes that could be readings [K]; no solid part of a machine cools or warms that fast.
_FEW = 3  #: Up to so many stretches are reported one by one, more of them in one finding.


def broken_sensors(survey: Survey) -> Iterator[Finding]:
    """Findings ``sensor-break``: codes in place of readings, and numbers that are not finite. O(samples)."""
    codes = {role: _codes_of(role) for role in _MEASURED}
    for run in survey.runs:
        # codes and wild numbers lie there only, whatever the role
        lowest, highest = (ends.reduce(survey.values[run], axis=1) for ends in (np.fmin, np.fmax))
        for column in np.flatnonzero((lowest <= 0.0) | (highest >= 85.0)).tolist():
            channel, x = survey.channels[column], survey.values[run][column]
            wild = np.isinf(x) | (np.abs(x) >= IMPLAUSIBLE)
            broken = wild
            series = survey.series(run, column)
            if wild.any():
                keep = ~wild[series.rows]
                series = replace(series, time_s=series.time_s[keep], x=series.x[keep], rows=series.rows[keep])
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
            said = f"{channel.name} in run {run} reads {way} to {reading(worst, channel)} {{when}}; on a machine tool "
            said += f"−{-low:g} to {high:g} °C can be."
            evidence = {"samples": int(outside.sum()), "value": worst, "plausible": [low, high]}
            place = Where(channel.name, run)
            found = FINDINGS.finding("out-of-range", said, place, evidence, action="leave-out-stretch")
            yield from told(found, windows)


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


def joined(time_s: Array, bad: Mask, present: Mask) -> list[tuple[float, float]]:
    """Stretches of bad samples [s], those next to each other (missing samples aside) joined."""
    rows = np.flatnonzero(bad)
    if rows.size == 0:
        return []
    # counting present samples up to each row: two bad ones with none good between them belong together
    good = np.cumsum(present & ~bad)[rows]
    first = np.flatnonzero(np.r_[True, good[1:] != good[:-1]])
    last = np.r_[first[1:] - 1, rows.size - 1]
    return [(float(time_s[rows[a]]), float(time_s[rows[b]])) for a, b in zip(first, last, strict=True)]


def _codes_of(role: str) -> Array:
    """The codes as they look in a recording when the file held another unit, sorted."""
    plain = np.array(_CODES)
    if role in THERMAL_ROLES:
        looks = [plain, convert(plain, "degF", "degC"), convert(plain, "kelvin", "degC")]
    else:
        looks = [plain, plain * 1e3, plain * 25.4, plain * 25400.0]
    return np.unique(np.concatenate(looks))


def _coded(series: Series, codes: Array) -> Mask:
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


def _apart(x: Array, coded: Mask, far: float, role: str) -> Mask:
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


def _reported(survey: Survey, run: str, column: int, broken: Mask) -> Iterator[Finding]:
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
            f"{channel.name} in run {run} holds the code of a broken sensor ({said}) in {100 * share:.0f} % of rows.",
            Where(channel.name, run, window[0][0], window[-1][1]),
            evidence,
            "Check the sensor, its plug and its input. The channel is left out of this run.",
            "leave-out-channel",
            level="error",
        )
        return
    found = FINDINGS.finding(
        "sensor-break",
        f"{channel.name} in run {run} holds {said} {{when}}{away}: the code of a broken or open sensor, not a reading.",
        Where(channel.name, run),
        evidence,
        "Check the sensor, its plug and its input. The stretch is left out.",
        "leave-out-stretch",
        level="error",
    )
    yield from told(found, joined(survey.time[run], broken, present))


#: -log of the probability (7e-13) below which standing still cannot be chance; a recording has some 1e6 samples.
_SURE = 28.0
_PER_TRY = 4.0  #: What each further stretch that is counted at a rail must add to the evidence on its own.
#: Noise over resolution; a trend without noise looks like at most 0.62 in the second differences.
_ABOVE_ROUNDING = 0.75
_OFTEN = 0.2  #: Share of equal neighbours from which on a channel is taken to stand on a grid.
_LEAST = 10  #: Samples that must agree at least.


@dataclass(frozen=True)
class Still:
    """Stretches of equal samples: first and last position, and the value."""

    first: Ints
    last: Ints
    value: Array

    @property
    def length(self) -> Ints:
        """Samples in each stretch."""
        return self.last - self.first + 1


def still_stretches(x: Array, quantum: float) -> Still:
    """The stretches of equal samples of a series, single samples included; O(n)."""
    tolerance = 1e-9 * max(float(np.abs(x).max(initial=0.0)), quantum)
    change = np.flatnonzero(np.abs(np.diff(x)) > tolerance)
    first = np.r_[0, change + 1].astype(np.intp)
    last = np.r_[change, x.size - 1].astype(np.intp)
    return Still(first, last, x[first])


def longest_still(survey: Survey, run: str, columns: list[int], quanta: list[float]) -> NDArray[np.intp]:
    """Samples in the longest of the `still_stretches` of some channels in a run, shape (n_columns,); O(n)."""
    longest, place = np.zeros(len(columns), dtype=np.intp), {column: k for k, column in enumerate(columns)}
    for alike, x in survey.together(run, columns):
        if x.shape[1]:
            at = [place[column] for column in alike]
            tolerance = 1e-9 * np.maximum(np.abs(x).max(axis=1), np.array(quanta)[at])
            is_edge = np.ones((len(x), x.shape[1] + 1), dtype=np.bool_)
            is_edge[:, 1:-1] = np.abs(np.diff(x, axis=1)) > tolerance[:, None]
            series, edges = np.nonzero(is_edge)
            # from the end of one series to the start of the next the distance is negative
            longest[at] = np.maximum.reduceat(np.diff(edges), np.searchsorted(series, np.arange(len(x))))
    return longest


def frozen(survey: Survey) -> Iterator[Finding]:
    """Findings ``stuck`` and ``saturated`` of channels whose noise alone makes equal samples impossible; O(samples).

    The noise is the lower fifth over all blocks of the channel in all runs, the stretch itself aside, and those of a
    thermometer in other runs in which it may be dead as well; it must exceed what rounding a trend can look like.
    Then k equal samples have at most the probability p^(k-1), p = the largest share of the noise that fits into one
    step of the resolution, or how often neighbours are equal elsewhere. Channels with a coarser resolution stand still
    lawfully; see `siblings.stuck_beside_siblings`.
    """
    columns = survey.columns(*MEASURED_ROLES)
    quanta = {run: [survey.quantum(column, run) for column in columns] for run in survey.runs}
    longest = {run: longest_still(survey, run, columns, quanta[run]) for run in survey.runs}
    for k, column in enumerate(columns):
        scales = {run: scale for run in survey.runs if (scale := survey.scale(run, column)).count}
        if not scales or max(scale.distinct for scale in scales.values()) < 2:
            continue
        extremes = (min(scale.low for scale in scales.values()), max(scale.high for scale in scales.values()))
        long = {
            run: still_stretches(survey.series(run, column).x, quanta[run][k])
            for run in scales
            if longest[run][k] >= _LEAST
        }
        # where two or more long stretches rest
        values = [still.value[still.length >= _LEAST] for still in long.values()]
        rails = [end for end in extremes if sum(int(np.sum(value == end)) for value in values) >= 2]
        # long stretches at the very ends of the channel's range may be a rail: left aside in every run
        aside = {run: (still.length >= _LEAST) & np.isin(still.value, extremes) for run, still in long.items()}
        clear = {run: scale.block_noise for run, scale in scales.items() if scale.count >= _LEAST}
        clear |= _noises_beside(survey, column, long, aside)
        seen = np.concatenate([np.empty(0), *clear.values()])
        if survey.channels[column].role in THERMAL_ROLES and _hides(seen, max(quanta[run][k] for run in scales)):
            aside |= {
                run: aside[run] | ((still.length >= _LEAST) & _is_lively_beside(survey, run, column, still))
                for run, still in long.items()
            }
            clear |= _noises_beside(survey, column, long, aside)
        every = np.sort(np.concatenate([np.empty(0), *clear.values()]))
        usual = float(np.quantile(every, 0.2)) if every.size >= 2 else None
        for run, noise in clear.items() if every.size else ():
            # what else is left aside in a run lifts the lower fifth of the rest by so many ranks at most
            highest = every[min(every.size // 5 + 1 + noise.size, every.size - 1)]
            if longest[run][k] >= 4 and highest >= _ABOVE_ROUNDING * quanta[run][k]:
                still = long.get(run) or still_stretches(survey.series(run, column).x, quanta[run][k])
                yield from _frozen_in(survey, run, column, still, clear, usual, extremes, rails)


def _frozen_in(
    survey: Survey,
    run: str,
    column: int,
    still: Still,
    clear: dict[str, Array],
    usual: float | None,
    extremes: tuple[float, float],
    rails: list[float],
) -> Iterator[Finding]:
    series, quantum = survey.series(run, column), survey.quantum(column, run)
    length, noise = still.length, usual
    aside = (length >= max(_LEAST, int(length.max()) // 4)) | ((length >= _LEAST) & np.isin(still.value, extremes))
    own = _noise_beside(survey, run, column, still, aside)
    if own.size < clear[run].size:
        every = np.concatenate([own, *(elsewhere for other, elsewhere in clear.items() if other != run)])
        noise = float(np.quantile(every, 0.2)) if every.size >= 2 else None
    if noise is None or noise < _ABOVE_ROUNDING * quantum or noise == 0.0:
        return
    pure = np.sqrt(noise**2 - quantum**2 / 12.0)
    surprise = -np.log(float(erf(max(quantum, 1e-3 * pure) / (2.0 * np.sqrt(2.0) * pure))))
    elsewhere = length[~aside & ~np.isin(still.value, extremes)]
    equal = float(np.sum(elsewhere - 1)) / max(float(np.sum(elsewhere)), 1.0)
    # means of readings on a grid are off it, and stand still as lawfully as these readings do
    if equal > _OFTEN and noise < _ABOVE_ROUNDING * float(np.quantile(np.abs(np.diff(still.value)), 0.1)):
        return
    surprise = min(surprise, -np.log(max(equal, 1e-300)))
    evidence = (still.length - 1) * surprise
    channel, time = series.channel, series.time_s
    railed = np.zeros(still.first.size, dtype=np.bool_)
    for rail in extremes:
        # noise lets a healthy channel touch its own extreme, but not again and again
        at = np.isclose(still.value, rail, rtol=1e-9, atol=0.1 * quantum)
        counted = at & (evidence > _PER_TRY)
        if not counted.any() or float((evidence[counted] - _PER_TRY).sum()) < _SURE or evidence[counted].max() < 10.0:
            continue
        if counted.sum() < 2 and rail not in rails:
            continue
        railed |= counted
        found = FINDINGS.finding(
            "saturated",
            f"{channel.name} in run {run} is pinned at {reading(rail, channel)}, the "
            f"{'lowest' if rail == extremes[0] else 'highest'} value that it ever has, {{when}}; its noise of "
            f"{difference(noise, channel)} is gone there.",
            Where(channel.name, run),
            {"rail": float(rail), "samples": int(still.length[counted].sum()), "noise": noise},
            action="leave-out-stretch",
            level="error",
        )
        yield from told(
            found, list(zip(time[still.first[counted]].tolist(), time[still.last[counted]].tolist(), strict=True))
        )
    for k in np.flatnonzero((evidence >= _SURE) & (still.length >= _LEAST) & ~railed):
        begin, end = float(time[still.first[k]]), float(time[still.last[k]])
        to_end = bool(still.last[k] == series.x.size - 1)
        yield FINDINGS.finding(
            "stuck",
            f"{channel.name} in run {run} is frozen at {reading(float(still.value[k]), channel)} for "
            f"{span_text(end - begin)}, {stretch(begin, end)}{', the end of the run' if to_end else ''}: "
            f"{int(still.length[k])} equal samples, although its noise elsewhere is {difference(noise, channel)}.",
            Where(channel.name, run, begin, end),
            {"samples": int(still.length[k]), "value": float(still.value[k]), "noise": noise, "resolution": quantum},
            action="leave-out-stretch",
            level="error",
        )


def _hides(noise: Array, quantum: float) -> bool:
    """Whether blocks without any noise are so many that they hide what the others have."""
    moving = noise[noise > 0.0]
    least = _ABOVE_ROUNDING * quantum
    return bool(moving.size and np.quantile(noise, 0.2) < least <= np.quantile(moving, 0.2))


def _is_lively_beside(survey: Survey, run: str, column: int, still: Still) -> Mask:
    """Stretches of a thermometer in which the others keep their noise, so that it is not the machine that rests."""
    lively = []
    for other in survey.columns(*THERMAL_ROLES):
        noise = survey.scale(run, other).block_noise
        if other != column and noise.size:
            first, end = (np.array([still.first, still.last + 1]) * noise.size / (still.last[-1] + 1)).astype(np.intp)
            kept = np.r_[0, np.cumsum(noise > 0.0)]
            lively.append((kept[end] - kept[first]) / np.maximum(end - first, 1))
    return np.asarray(np.mean(lively or [np.zeros(still.first.size)], axis=0) > 0.5)


def _noises_beside(
    survey: Survey, column: int, stretches: Mapping[str, Still], aside: Mapping[str, Mask]
) -> dict[str, Array]:
    """Run → the block noise of a channel outside some of its stretches of equal samples."""
    return {run: _noise_beside(survey, run, column, still, aside[run]) for run, still in stretches.items()}


def _noise_beside(survey: Survey, run: str, column: int, still: Still, aside: Mask) -> Array:
    """The block noise of a channel in a run outside some of its stretches of equal samples."""
    noise = survey.scale(run, column).block_noise
    if noise.size == 0 or not aside.any():
        return noise
    width = max(1, (int(still.last[-1]) - 1) // noise.size)
    covered = np.zeros(noise.size, dtype=np.bool_)
    for k in np.flatnonzero(aside):
        covered[max(0, still.first[k] - 2) // width : still.last[k] // width + 1] = True
    return noise[~covered]
