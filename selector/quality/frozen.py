"""Channels that stand still although they should not: stuck, or pinned at the end of their range."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import erf

from selector.findings import Finding, Where
from selector.quality.break_codes import told
from selector.quality.finding_table import FINDINGS
from selector.quality.survey import MEASURED_ROLES, Floats, Ints, Survey, difference, duration, reading, stretch

_SURE = 28.0
"""-log of the probability (7e-13) below which standing still cannot be chance; a recording has some 1e6 samples."""
_PER_TRY = 4.0
"""What each further stretch that is counted at a rail must add to the evidence on its own."""
_ABOVE_ROUNDING = 0.75
"""Noise over resolution; a trend without noise looks like at most 0.62 in the second differences."""
_LEAST = 10
"""Samples that must agree at least."""


@dataclass(frozen=True)
class Still:
    """Stretches of equal samples: first and last position, and the value."""

    first: Ints
    last: Ints
    value: Floats

    @property
    def length(self) -> Ints:
        """Samples in each stretch."""
        return self.last - self.first + 1


def still_stretches(x: Floats, quantum: float) -> Still:
    """The stretches of equal samples of a series, single samples included; O(n)."""
    tolerance = 1e-9 * max(float(np.abs(x).max(initial=0.0)), quantum)
    change = np.flatnonzero(np.abs(np.diff(x)) > tolerance)
    first = np.r_[0, change + 1].astype(np.intp)
    last = np.r_[change, x.size - 1].astype(np.intp)
    return Still(first, last, x[first])


def frozen(survey: Survey) -> Iterator[Finding]:
    """Findings ``stuck`` and ``saturated`` of channels whose noise alone makes equal samples impossible; O(samples).

    The noise is the lower fifth over all blocks of the channel in all runs, the stretch itself aside; it must exceed
    what rounding a trend can look like. Then k equal samples have at most the probability p^(k-1), p = the largest
    share of the noise that fits into one step of the resolution. Channels with a coarser resolution stand still
    lawfully; see `siblings.stuck_beside_siblings`.
    """
    for column in survey.columns(*MEASURED_ROLES):
        scales = [scale for scale in (survey.scale(run, column) for run in survey.runs) if scale.count]
        if not scales or max(scale.distinct for scale in scales) < 2:
            continue
        extremes = (min(scale.low for scale in scales), max(scale.high for scale in scales))
        stills = {}
        for run in survey.runs:
            x = survey.series(run, column).x
            if x.size >= _LEAST:
                stills[run] = still_stretches(x, survey.quantum(column, run))
        rails = [end for end in extremes if sum(_rests_at(still, end) for still in stills.values()) >= 2]
        # long stretches at the very ends of the channel's range may be a rail: left aside in every run
        clear = {
            run: _noise_beside(survey, run, column, still, (still.length >= _LEAST) & np.isin(still.value, extremes))
            for run, still in stills.items()
        }
        for run, still in stills.items():
            if int(still.length.max()) >= 4:
                yield from _frozen_in(survey, run, column, still, clear, extremes, rails)


def _frozen_in(
    survey: Survey,
    run: str,
    column: int,
    still: Still,
    clear: dict[str, Floats],
    extremes: tuple[float, float],
    rails: list[float],
) -> Iterator[Finding]:
    series, quantum = survey.series(run, column), survey.quantum(column, run)
    length = still.length
    aside = (length >= max(_LEAST, int(length.max()) // 4)) | ((length >= _LEAST) & np.isin(still.value, extremes))
    blocks = [noise for other, noise in clear.items() if other != run]
    every = np.concatenate([*blocks, _noise_beside(survey, run, column, still, aside)])
    noise = float(np.quantile(every, 0.2)) if every.size >= 4 else None
    if noise is None or noise < _ABOVE_ROUNDING * quantum or noise == 0.0:
        return
    pure = np.sqrt(noise**2 - quantum**2 / 12.0)
    surprise = -np.log(float(erf(max(quantum, 1e-3 * pure) / (2.0 * np.sqrt(2.0) * pure))))
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
        windows = [
            (float(time[a]), float(time[b])) for a, b in zip(still.first[counted], still.last[counted], strict=True)
        ]
        yield from told(
            FINDINGS.finding(
                "saturated",
                f"{channel.name} in run {run} is pinned at {reading(rail, channel)}, the "
                f"{'lowest' if rail == extremes[0] else 'highest'} value that it ever has, {{when}}; its noise of "
                f"{difference(noise, channel)} is gone there.",
                Where(channel.name, run),
                {"rail": float(rail), "samples": int(still.length[counted].sum()), "noise": noise},
                action="leave-out-stretch",
                level="error",
            ),
            windows,
        )
    for k in np.flatnonzero((evidence >= _SURE) & (still.length >= _LEAST) & ~railed):
        begin, end = float(time[still.first[k]]), float(time[still.last[k]])
        to_end = bool(still.last[k] == series.x.size - 1)
        yield FINDINGS.finding(
            "stuck",
            f"{channel.name} in run {run} is frozen at {reading(float(still.value[k]), channel)} for "
            f"{duration(end - begin)}, {stretch(begin, end)}{', the end of the run' if to_end else ''}: "
            f"{int(still.length[k])} equal samples, although its noise elsewhere is {difference(noise, channel)}.",
            Where(channel.name, run, begin, end),
            {"samples": int(still.length[k]), "value": float(still.value[k]), "noise": noise, "resolution": quantum},
            action="leave-out-stretch",
            level="error",
        )


def _rests_at(still: Still, value: float) -> int:
    """How many long stretches of equal samples have this value."""
    return int(np.sum((still.length >= _LEAST) & (still.value == value)))


def _noise_beside(survey: Survey, run: str, column: int, still: Still, aside: NDArray[np.bool_]) -> Floats:
    """The block noise of a channel in a run outside some of its stretches of equal samples."""
    noise = survey.scale(run, column).block_noise
    if noise.size == 0 or not aside.any():
        return noise
    width = max(1, (int(still.last[-1]) - 1) // noise.size)
    covered = np.zeros(noise.size, dtype=np.bool_)
    for k in np.flatnonzero(aside):
        covered[max(0, still.first[k] - 2) // width : still.last[k] // width + 1] = True
    return noise[~covered]
