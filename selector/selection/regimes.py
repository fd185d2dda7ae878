"""Day-to-day regimes: something that the displacement depends on and the recording does not hold."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from selector.findings import Finding, Where
from selector.selection.result import Proof, Selection

MIN_RUNS = 6
MIN_LENGTH = 2
MAX_REGIMES = 5
FALSE_ALARM = 0.01
N_PERMUTATIONS = 999
PENALTY = 3.0
"""Parameters that a split counts as: its level, its place, and one for the search of the place (as in the modified BIC
of Zhang and Siegmund, 2007). With 2, four in ten clear regimes were cut once more; with 3 it is one in eight, and a
single change of two deviations among 18 runs is found in 70 instead of 53 %."""


def regime_findings(selection: Selection) -> list[Finding]:
    """Stretches of consecutive runs whose unseen errors share a sign and a size that neighbours do not have.

    The mean held-out error of each run is segmented in the order of recording; the gain in squared error is compared
    with that of shuffled runs, so that scatter from day to day is no regime.
    """
    proof = selection.proof
    if proof.left_out != "run":
        return []
    findings = []
    for name in selection.models:
        parts = proof.per_response[name]
        means = np.array([part.mean_um for part in parts])
        bounds, p_value, explained = regimes(means, selection.options.seed)
        if len(bounds) < 2:
            continue
        spread = float(means.std())
        if spread < 0.5 * proof.rmse_um(name):
            continue
        findings.append(_finding(name, proof, means, bounds, p_value, explained))
    return findings


def regimes(means: NDArray[np.float64], seed: int) -> tuple[list[tuple[int, int]], float, float]:
    """Consecutive (start, stop) stretches of alike values, p-value of one split or more, share of variance explained.

    The best segmentation into k = 2…5 stretches is found exactly (dynamic programming), k by BIC with `PENALTY`
    parameters a split; its BIC gain is compared with that of shuffled values, which repeats the whole search. Every
    stretch holds at least two values, so a single odd run is no regime.
    """
    n = len(means)
    whole = [(0, n)]
    if n < MIN_RUNS or np.ptp(means) == 0:
        return whole, 1.0, 0.0
    rng = np.random.default_rng(seed)
    # ranks would lose sizes and raw values let one odd run decide: pull outliers in to three robust deviations
    centre = np.median(means)
    deviation = max(1.4826 * float(np.median(np.abs(means - centre))), 1e-9 * float(np.ptp(means)))
    values = np.clip(means, centre - 3 * deviation, centre + 3 * deviation)
    total = float(((values - values.mean()) ** 2).sum())
    gain, bounds, within = _best_segmentation(values, total)
    shuffled = np.array([_best_segmentation(rng.permutation(values), total)[0] for _ in range(N_PERMUTATIONS)])
    p_value = float((1 + np.sum(shuffled >= gain - 1e-12)) / (N_PERMUTATIONS + 1))
    if gain <= 0 or p_value > FALSE_ALARM:
        return whole, p_value, 0.0
    return bounds, p_value, 1.0 - within / total


def _best_segmentation(values: NDArray[np.float64], total: float) -> tuple[float, list[tuple[int, int]], float]:
    """(BIC gain over one stretch, stretches, squared error within them) of the best segmentation."""
    n = len(values)
    sums = np.r_[0.0, np.cumsum(values)]
    squares = np.r_[0.0, np.cumsum(values**2)]
    start, stop = np.arange(n + 1)[:, None], np.arange(n + 1)[None, :]
    length = np.maximum(stop - start, 1)
    cost = squares[None, :] - squares[:, None] - (sums[None, :] - sums[:, None]) ** 2 / length
    cost = np.where(stop - start >= MIN_LENGTH, cost, np.inf)
    error = cost[0]
    origins: list[NDArray[np.int64]] = []
    best = (0.0, [(0, n)], total)
    for k in range(2, min(MAX_REGIMES, n // MIN_LENGTH) + 1):
        candidates = error[:, None] + cost
        origins.append(candidates.argmin(axis=0))
        error = candidates.min(axis=0)
        within = max(float(error[n]), 1e-12 * total)
        gain = n * np.log(total / within) - PENALTY * (k - 1) * np.log(n)
        if gain > best[0]:
            edges = [n]
            for origin in reversed(origins):
                edges.append(int(origin[edges[-1]]))
            edges = [0, *sorted(edges[:-1]), n] if edges[-1] == 0 else [0, *sorted(edges)]
            best = (float(gain), list(itertools.pairwise(edges)), within)
    return best


def _finding(
    name: str,
    proof: Proof,
    means: NDArray[np.float64],
    bounds: Sequence[tuple[int, int]],
    p_value: float,
    explained: float,
) -> Finding:
    names = [part.name for part in proof.per_response[name]]
    listed = "; ".join(f"{names[a]} to {names[b - 1]}: {means[a:b].mean():+.1f} µm" for a, b in bounds)
    return Finding(
        "regimes",
        "warning",
        f"The unseen error of {name} falls into {len(bounds)} regimes of consecutive runs ({listed}): {name} depends "
        "on something that changed between them and is not in the recording.",
        Where(channel=name),
        {
            "regimes": [{"runs": names[a:b], "mean_error_um": float(means[a:b].mean())} for a, b in bounds],
            "p_value": p_value,
            "explained": explained,
        },
        "find out what differed (setup, tool, coolant, spindle programme, season) and record it as a channel, or build "
        "one model per regime",
    )
