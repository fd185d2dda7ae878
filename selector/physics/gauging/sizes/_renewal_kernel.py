"""The equation of first passage, solved step by step (compiled)."""

# mypy: disable-error-code="no-untyped-def, untyped-decorator, no-untyped-call"

import math

from numba import njit


@njit(cache=True, nogil=True, error_model="numpy")
def passed_shares(distance, below, start, keep, through, deviation, weight, pull, memory, passed):
    """Fills `passed`, the share that falls through in each step: below(t) = Σ passed(s)·P(below at t | through at s).

    Steps s lie between the times t. At t the mean course is `distance` above the threshold and the share `below` would
    be below it; `start` is the noise at the middle of a step that just reaches the threshold. Parts fall through with
    several speeds, of `weight` (n_steps, n_speeds), at which T_Φ times the rate of the noise is `pull`; so many steps
    and a half later their noise has the mean start·(keep + through) + pull·through and the standard deviation
    `deviation`; after `memory` steps the noise does not know any more.
    """
    total, forgotten = below[0], 0.0
    for i in range(1, len(below)):
        first = max(i - memory, 0)
        if first > 0:
            forgotten += passed[first - 1]
        rest = below[i] * (1.0 - forgotten) - below[0]
        last = 1.0
        for j in range(first, i):
            lag = i - 1 - j
            if j < i - 1 and passed[j] == 0.0:
                continue
            mean = distance[i] + (keep[lag] + through[lag]) * start[j]
            scale = 1.0 / (math.sqrt(2.0) * deviation[lag])
            share = 0.0
            for v in range(weight.shape[1]):
                share += weight[j, v] * math.erfc((mean + through[lag] * pull[j, v]) * scale)
            share *= 0.5
            if j < i - 1:
                rest -= passed[j] * share
            else:
                last = share
        # what rounding makes negative is none; nobody falls through twice
        passed[i - 1] = min(max(rest / last, 0.0), 1.0 - total)
        total += passed[i - 1]
        if total >= 1.0:
            return
