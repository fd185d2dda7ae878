"""Is a model still true? A self-starting CUSUM chart of the errors of one run after the other.

The few runs that a model was proved on say how large its errors are, but not well. So every later run is judged by all
that came before it: Student's t of a new value among n known ones, turned into a standard normal deviate, keeps its
distribution for any n as long as nothing changes, and a cumulative sum of these deviates finds a small change that
stays (Hawkins 1987; Siegmund 1985 for the mean number of runs between false alarms).
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from scipy.stats import norm, t

from selector.types import Array

FEWEST_KNOWN = 3  #: Fewer errors on unseen runs than these tell nothing of their spread.
SLACK = 0.5  #: Half of the change that is found soonest, in standard deviations from run to run.
#: One run alone is never an alarm, however wild it is: a chip under the probe is no change of the machine.
LARGEST_DEVIATE = 4.0


@dataclass(frozen=True)
class Chart:
    """What a chart says of the runs after those that were known."""

    highest: float  #: Cumulative sum at its highest, in standard deviations; of either sign on a two-sided chart
    limit: float  #: Beyond it there is an alarm
    alarm_at: int | None  #: Which new run raised the alarm
    changed_at: int | None  #: From which new run on the values are others, as far as the sum tells


def alarm_limit(runs_between_alarms: float) -> float:
    """Limit of a one-sided sum with SLACK so that false alarms are so many runs apart in the mean (Siegmund 1985)."""

    def excess(limit: float) -> float:
        reach = 2.0 * SLACK * (limit + 1.166)
        return float((np.exp(reach) - reach - 1.0) / (2.0 * SLACK**2)) - runs_between_alarms

    return float(brentq(excess, 0.0, 60.0)) if excess(0.0) < 0.0 else 0.0


def deviates(known: Array, new: Array) -> Array:
    """Each new value among all values before it, as a standard normal deviate; shape (n_new,).

    A value that equals others that are all alike is 0; `known` holds at least two.
    """
    values = np.concatenate([known, new])
    found = np.zeros(len(new))
    for i in range(len(new)):
        before = values[: len(known) + i]
        spread = float(np.std(before, ddof=1)) * np.sqrt(1.0 + 1.0 / len(before))
        step = float(values[len(before)] - np.mean(before))
        if step:
            ratio = step / spread if spread > 0.0 else np.copysign(np.inf, step)
            # the smaller tail keeps its digits
            found[i] = -np.sign(ratio) * norm.ppf(t.cdf(-abs(ratio), len(before) - 1))
    return np.clip(found, -LARGEST_DEVIATE, LARGEST_DEVIATE)


def charted(known: Array, new: Array, runs_between_alarms: float, *, is_two_sided: bool) -> Chart:
    """The chart of new values, oldest first, after those that are known.

    An upward sum, and on a two-sided chart a downward one, too, each with the limit of `runs_between_alarms`.
    """
    deviate, limit = deviates(known, new), alarm_limit(runs_between_alarms)
    charts = [_one_sided(sign * deviate, limit) for sign in ((1.0, -1.0) if is_two_sided else (1.0,))]
    return min(charts, key=lambda one: (len(new) if one.alarm_at is None else one.alarm_at, -one.highest))


def _one_sided(deviate: Array, limit: float) -> Chart:
    total, start, highest = 0.0, 0, 0.0
    for i, value in enumerate(deviate):
        if total == 0.0:
            start = i
        total = max(0.0, total + float(value) - SLACK)
        highest = max(highest, total)
        if total > limit:
            return Chart(highest, limit, i, start)
    return Chart(highest, limit, None, None)
