"""What is to be told of a recorded run that drives a model: of its clock, its gaps, and its beginning and end."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from selector.findings import Finding, Where
from selector.physics.vibration.recorded_clock import GAP, Stretch, gaps
from selector.physics.vibration.recorded_force import FADED
from selector.physics.vibration.stamped_force import StampedAnswer

Vector = NDArray[np.float64]

_EVEN = 1e-3
"""Share of a step by which the stamps of an even clock may stray untold."""
_NEARLY = 1.1
_MOST_GAPS = 10
_LONG = 0.5
"""Share of the run from which on its beginning is a warning."""
_UM = 1e6


def gap_findings(time_s: Vector, ring_s: float | None) -> tuple[Finding, ...]:
    """Gaps between stamps; `ring_s` is None where no force was recorded [s]."""
    found = gaps(time_s)
    told = []
    for number, (begin_s, end_s) in enumerate(found[:_MOST_GAPS]):
        until_s = float(end_s) if ring_s is None else min(float(end_s) + ring_s, float(time_s[-1]))
        more = len(found) - _MOST_GAPS if number == _MOST_GAPS - 1 else 0
        told.append(
            Finding(
                "recorded-gap",
                "warning",
                f"Nothing was recorded from {begin_s:.6g} to {end_s:.6g} s. "
                + (
                    "Speeds run straight across."
                    if ring_s is None
                    else "What the force did there is not known: the motion is not to be believed before "
                    f"{until_s:.6g} s, when what it left has faded; the rest is not touched. Speeds run straight "
                    "across."
                )
                + (f" There are {more} more gaps." if more > 0 else ""),
                Where(from_s=float(begin_s), to_s=until_s),
                {"gap_s": float(end_s - begin_s), "gaps": len(found)},
                "leave this stretch out when you compare, or cut the run at its gaps",
            )
        )
    return tuple(told)


def clock_findings(time_s: Vector, parts: Sequence[Stretch]) -> tuple[Finding, ...]:
    """Stamps that stray from an even grid, those that have none, and rows that were lost; for recorded forces."""
    told = []
    steps = np.diff(time_s)
    uneven = [part for part in parts if not part.even]
    strayed = [part for part in parts if part.even and part.stray > _EVEN]
    if uneven:
        good_hz = min(part.good_to_hz for part in uneven)
        told.append(
            Finding(
                "recorded-clock-uneven",
                "info" if all(part.widest_s < _NEARLY * np.median(steps) for part in uneven) else "warning",
                f"The clock is uneven: steps from {steps.min():.4g} to {max(part.widest_s for part in uneven):.4g} s. "
                f"Recorded forces are brought to even times by cubic splines, good to 1 % up to {good_hz:.4g} Hz; what "
                "is quicker is answered too weakly, or as another frequency.",
                evidence={"good_to_hz": good_hz},
                suggestion="record with an even clock, or give the true one",
            )
        )
    if strayed:
        stray, good_hz = max(part.stray for part in strayed), min(part.good_to_hz for part in strayed)
        told.append(
            Finding(
                "recorded-clock-jitter",
                "info" if stray < 0.1 else "warning",
                f"Stamps stray by up to {100 * stray:.3g} % of a sample from an even clock, whose ticks count as the "
                "times of the forces. Had those been recorded when the stamps say, they would be good to 1 % up to "
                f"{good_hz:.4g} Hz.",
                evidence={"stray": stray, "good_to_hz": good_hz},
                suggestion="if the clock was even, give its times",
            )
        )
    missing = np.concatenate([np.diff(part.at) - 1.0 for part in parts if part.even] or [np.zeros(0)])
    lost = int(missing[missing <= GAP - 1.0].sum())
    if lost:
        told.append(
            Finding(
                "recorded-rows-lost",
                "info",
                f"{lost} row{'s' if lost > 1 else ''} of the clock lack{'' if lost > 1 else 's'}: put in as the force "
                "went before and after.",
                evidence={"lost": lost},
            )
        )
    return tuple(told)


def end_findings(
    motions: Sequence[StampedAnswer],
    finals: Sequence[str],
    motion_m: NDArray[np.float64],
    ring_s: float,
    duration_s: float,
) -> tuple[Finding, ...]:
    """By how much the motion may differ where the recorded forces begin and end; `motion_m` is that by them all."""
    left = max(one.left for one in motions)
    told: list[Finding] = []
    if left > FADED:
        told.append(
            Finding(
                "ring-longer-than-run",
                "warning",
                f"A free vibration takes {ring_s:.3g} s to fade: {100 * left:.2g} % of one at the end of the recorded "
                "forces laps over to their beginning.",
                evidence={"ring_s": ring_s, "left": left},
                suggestion="give every joint its dissipation",
            )
        )
    begin = sum(one.begin_m[0] for one in motions)
    end = sum(one.end_m[-1] for one in motions)
    moves = np.ptp(motion_m, axis=1) / 2.0
    share = np.divide(begin, moves, out=np.zeros_like(moves), where=moves > 0.0)
    worst = int(np.argmax(begin))
    until_s = min(ring_s, duration_s)
    told.append(
        Finding(
            "steady-before-recording",
            "warning" if until_s > _LONG * duration_s and share[worst] > FADED else "info",
            "Recorded forces are taken to have gone on before and after the run as they went at its ends. What really "
            f"acted is not known: at the beginning the motion of {finals[worst]} may differ by about "
            f"{_UM * begin[worst]:.3g} µm ({100 * share[worst]:.2g} % of its swing), {100 * FADED:.2g} % of that after "
            f"{ring_s:.3g} s, and at the last sample by {_UM * end.max():.2g} µm.",
            Where(from_s=0.0, to_s=until_s),
            {
                "ring_s": ring_s,
                "begin_um": {name: _UM * float(one) for name, one in zip(finals, begin, strict=True)},
                "end_um": {name: _UM * float(one) for name, one in zip(finals, end, strict=True)},
            },
            "leave this stretch out when you compare",
        )
    )
    return tuple(told)
