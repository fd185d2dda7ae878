"""Whether every channel is itself: no copy of another one, and not in another one's place in some run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from selector.findings import Finding, Where
from selector.quality.relations import Relations
from selector.quality.survey import THERMAL_ROLES, Floats, Survey
from selector.quality.wording import difference

_ALIKE = 1.0 - 2e-4
"""Correlation of block means from which two channels are compared sample by sample."""
_LEAST = {"degC": 0.6, "um": 4.0}
"""A mismatch below this does not prove a swap [K, µm]."""
_TIMES, _TIMES_ALONE = 2.5, 5.0
"""By so much the mismatches of both, or of one, exceed what is usual and what is left when the two change places."""


def duplicates(survey: Survey, relations: Relations) -> Iterator[Finding]:
    """Findings ``duplicate-channel``: two channels that are the same numbers, or one a scaled copy of the other.

    O(channels² · blocks) to find the pairs, then O(samples) for each pair.
    """
    alike = [_correlation(relations.movement(r)) > _ALIKE for r in range(len(relations.runs))]
    for i, j in combinations(range(len(relations.columns)), 2):
        if not any(near[i, j] for near in alike) or _kind(relations, i) != _kind(relations, j):
            continue
        both = np.flatnonzero(relations.present[i] & relations.present[j])
        a, b = (survey.channels[relations.columns[k]] for k in (i, j))
        copies = {r: _copy(survey, relations.runs[r], relations.columns[i], relations.columns[j]) for r in both}
        hits = [r for r in both if copies[r] is not None]
        told = [r for r in both if copies[r] is not None or _moves(relations, i, int(r))]
        if not hits:
            continue
        gain, offset = copies[hits[0]] or (1.0, 0.0)
        same = abs(gain - 1.0) < 1e-9 and abs(offset) < 1e-9
        how = "the same numbers" if same else f"{gain:.6g} times the same numbers plus {offset:.6g}"
        everywhere = len(hits) == len(told)
        if not everywhere and not same:
            continue
        where = "in all runs" if everywhere else "in run " + ", ".join(relations.runs[r] for r in hits)
        yield Finding(
            "duplicate-channel",
            "warning",
            f"{b.name} holds {how} as {a.name} {where}: two channels, one measurement.",
            Where(b.name, None if everywhere else relations.runs[hits[0]]),
            {"other": a.name, "gain": gain, "offset": offset, "runs": [relations.runs[r] for r in hits]},
            f"Check the wiring and the logger's channel list; exclude one with --never {b.name}. Nothing is left out.",
        )


def swapped(relations: Relations) -> Iterator[Finding]:
    """Findings ``swapped-channels``: in one run two channels of a kind stand in each other's place.

    After the exchange both must follow their siblings (the other one aside) as well as in the other runs; before it
    both must clearly not, or one very clearly. Two findings a swap. O(channels · runs) small systems.
    """
    count = len(relations.runs)
    if count < 2:
        return
    siblings = [relations.siblings(i) for i in range(len(relations.columns))]
    for r in range(count) if count > 2 else [1]:
        training = [o for o in range(count) if o != r]
        suspects = []
        for i, beside in enumerate(siblings):
            if beside and relations.present[i, r] and relations.present[i, training].any():
                weights = relations.weights(i, beside, training)
                if _mismatch(relations, i, beside, weights, r, i) > _least(relations, i):
                    suspects.append(i)
        pairs = []
        everyone = [i for i in range(len(relations.columns)) if siblings[i] and relations.present[i, r]]
        for i, j in combinations(everyone, 2):
            if (i in suspects or j in suspects) and _kind(relations, i) == _kind(relations, j):
                gains = _gains(relations, i, j, r, training)
                if gains is not None:
                    pairs.append((gains, i, j))
        taken: set[int] = set()
        for gains, i, j in sorted(pairs, key=lambda pair: -pair[0][0] / pair[0][1] * pair[0][2] / pair[0][3]):
            if not taken & {i, j}:
                taken |= {i, j}
                yield from _swap_findings(relations, i, j, r, gains, acts=count > 2)


def _gains(
    relations: Relations, i: int, j: int, r: int, training: list[int]
) -> tuple[float, float, float, float] | None:
    """(mismatch of i, after the swap, mismatch of j, after the swap) if they prove a swap, else None."""
    result: list[float] = []
    proofs = []
    for own, other in ((i, j), (j, i)):
        beside = relations.siblings(own, without=(other,))
        if len(beside) < 2:
            return None
        weights = relations.weights(own, beside, training)
        before = _mismatch(relations, own, beside, weights, r, own)
        after = _mismatch(relations, own, beside, weights, r, other)
        known = [o for o in training if relations.present[own, o]]
        usual = [0.3 * _least(relations, own)]
        for o in known:
            rest = [p for p in known if p != o]
            fitted = relations.weights(own, beside, rest) if rest else weights
            usual.append(_mismatch(relations, own, beside, fitted, o, own))
        if after > 2.0 * max(usual):
            return None
        # a near twin fits in every run: the other column must fit here as it does nowhere else
        cross = [_mismatch(relations, own, beside, weights, o, other) for o in known]
        fits_only_here = bool(cross) and after < 0.4 * float(np.median(cross))
        proved = before > _least(relations, own) and fits_only_here
        proofs.append(before / max(after, *usual) if proved else 0.0)
        result += [before, after]
    # one channel may be too independent of the rest to prove anything, if the other one proves it alone
    if min(proofs) < _TIMES and max(proofs) < _TIMES_ALONE:
        return None
    return result[0], result[1], result[2], result[3]


def _swap_findings(
    relations: Relations, i: int, j: int, r: int, gains: tuple[float, float, float, float], *, acts: bool
) -> Iterator[Finding]:
    run = relations.runs[r]
    channels = [relations.survey.channels[relations.columns[k]] for k in (i, j)]
    for (own, other), (before, after) in zip((channels, channels[::-1]), (gains[:2], gains[2:]), strict=True):
        yield Finding(
            "swapped-channels",
            "error" if acts else "warning",
            f"{own.name} and {other.name} have changed places in run {run}: what stands under {own.name} is off by "
            f"{difference(before, own)} from what its siblings say, what stands under {other.name} by only "
            f"{difference(after, own)}.",
            Where(own.name, run),
            {"other": other.name, "mismatch": before, "mismatch_after_swap": after},
            f"Swap the two columns in the file of run {run}, or give that run a machine file in which the column of "
            f"{own.name} is that of {other.name} and the other way round. "
            + ("Both channels are left out of this run." if acts else
               "With two runs it may be the other one: nothing is left out."),
            "leave-out-channel" if acts else "none",
        )  # fmt: skip


def _mismatch(relations: Relations, i: int, siblings: Sequence[int], weights: Floats, r: int, column: int) -> float:
    """Root mean square of (column standing for channel i) minus what the siblings say."""
    off = relations.movement(r)[column] - relations.prediction(siblings, weights, r)
    return float(np.sqrt(np.mean(off * off)))


def _copy(survey: Survey, run: str, i: int, j: int) -> tuple[float, float] | None:
    """(gain, offset) when channel j is gain · channel i + offset up to its rounding, else None."""
    x, y = survey.values[run][i], survey.values[run][j]
    both = np.isfinite(x) & np.isfinite(y)
    if both.sum() < 20:
        return None
    x, y = x[both], y[both]
    steps_x, steps_y = survey.scale(run, i).quantum, survey.scale(run, j).quantum
    if min(survey.scale(run, i).distinct, survey.scale(run, j).distinct) < 10:
        return None
    if np.array_equal(x, y):
        return 1.0, 0.0
    dx = x - x.mean()
    gain = float(dx @ y / max(float(dx @ dx), 1e-300))
    offset = float(y.mean() - gain * x.mean())
    rounding = 0.51 * max(steps_y, abs(gain) * steps_x) + 1e-9 * float(np.abs(y).max())
    if abs(gain) < 1e-9 or float(np.abs(y - gain * x - offset).max()) > rounding:
        return None
    # two sensors at one place round differently; a copy changes with its original
    moves = np.corrcoef(np.diff(x), np.diff(y))[0, 1] if min(np.ptp(np.diff(x)), np.ptp(np.diff(y))) > 0 else 0.0
    if abs(moves) < 0.9:
        return None
    return gain, offset


def _correlation(movement: Floats) -> Floats:
    size = np.sqrt(np.maximum((movement * movement).sum(axis=1), 1e-300))
    return np.asarray(np.abs(movement @ movement.T) / np.outer(size, size), dtype=np.float64)


def _moves(relations: Relations, i: int, r: int) -> bool:
    return bool(np.ptp(relations.movement(r)[i]) > 0)


def _kind(relations: Relations, i: int) -> bool:
    return relations.roles[i] in THERMAL_ROLES


def _least(relations: Relations, i: int) -> float:
    return _LEAST[relations.survey.channels[relations.columns[i]].unit]
