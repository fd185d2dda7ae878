"""Day-to-day regimes: something that the displacement depends on and the recording does not hold."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from selector.findings import Finding, Where
from selector.selection.result import Proof, Selection

MIN_RUNS = 6
MIN_LENGTH = 2
MAX_REGIMES = 5
FALSE_ALARM = 0.01
N_PERMUTATIONS = 1999


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

    Binary segmentation: the split that explains most is kept while shuffled values explain as much in fewer than 1 %
    of the cases. Every stretch holds at least two values, so a single odd run is no regime.
    """
    n = len(means)
    whole = [(0, n)]
    if n < MIN_RUNS or np.ptp(means) == 0:
        return whole, 1.0, 0.0
    rng = np.random.default_rng(seed)
    # ranks would lose sizes and raw values let one odd run decide: pull outliers in to three robust deviations
    centre = np.median(means)
    deviation = max(1.4826 * float(np.median(np.abs(means - centre))), 1e-12)
    values = np.clip(means, centre - 3 * deviation, centre + 3 * deviation)
    bounds = whole
    first_p = 1.0
    while len(bounds) < MAX_REGIMES:
        found = [(*_best_split(values[a:b]), a, b) for a, b in bounds if b - a >= 2 * MIN_LENGTH]
        if not found:
            break
        gain, split, a, b = max(found)
        part = values[a:b]
        shuffled = np.array([_best_split(rng.permutation(part))[0] for _ in range(N_PERMUTATIONS)])
        p_value = float((1 + np.sum(shuffled >= gain - 1e-12)) / (N_PERMUTATIONS + 1))
        if len(bounds) == 1:
            first_p = p_value
        if p_value > FALSE_ALARM:
            break
        bounds = sorted([*(one for one in bounds if one != (a, b)), (a, a + split), (a + split, b)])
    within = sum(float(((values[a:b] - values[a:b].mean()) ** 2).sum()) for a, b in bounds)
    total = float(((values - values.mean()) ** 2).sum())
    return bounds, first_p, 1.0 - within / total if total > 0 else 0.0


def _best_split(values: NDArray[np.float64]) -> tuple[float, int]:
    n = len(values)
    sums = np.cumsum(values)
    at = np.arange(MIN_LENGTH, n - MIN_LENGTH + 1)
    left, right = sums[at - 1] / at, (sums[-1] - sums[at - 1]) / (n - at)
    gain = at * (n - at) / n * (left - right) ** 2
    best = int(np.argmax(gain))
    return float(gain[best]), int(at[best])


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
        f"The unseen error of {name} falls into {len(bounds)} regimes of consecutive runs ({listed}): {name} depends on "
        "something that changed between them and is not in the recording.",
        Where(channel=name),
        {
            "regimes": [{"runs": names[a:b], "mean_error_um": float(means[a:b].mean())} for a, b in bounds],
            "p_value": p_value,
            "explained": explained,
        },
        "find out what differed (setup, tool, coolant, spindle programme, season) and record it as a channel, or build "
        "one model per regime",
    )
