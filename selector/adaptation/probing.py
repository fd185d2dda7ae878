"""When to probe so that the error stays within a limit, found by simulating each rate of probing on unseen runs."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from selector.adaptation.drift import Course
from selector.adaptation.judged import Judged, judged
from selector.json_text import fields_of

SHARE = 0.95  #: Of the time that the error has to stay within the limit.
DAY_S = 86_400.0
#: Periods of probing that a shop can keep, the rarest first; nobody probes more often than every five minutes.
RATES_S = (86400.0, 43200.0, 28800.0, 21600.0, 14400.0, 10800.0, 7200.0, 5400.0, 3600.0, 2700.0, 1800.0, 1200.0, 900.0,
           600.0, 300.0)  # fmt: skip


@dataclass(frozen=True)
class Policy:
    """When to probe."""

    within_um: float
    every_s: float | None  #: None: not at all
    #: Smallest share of the samples of any response within the limit, with this period, on runs that did not teach
    share_within: float
    share_within_unseen: float  #: The same where each run's period was chosen by the other runs
    is_reached: bool

    @property
    def touch_offs_per_day(self) -> float:
        """Probings in 24 h of running."""
        return 0.0 if self.every_s is None else DAY_S / self.every_s

    def as_dict(self) -> dict[str, object]:
        """The object of the contract."""
        names = ("within_um", "touch_offs_per_day", "share_within", "share_within_unseen", "every_s", "is_reached")
        return fields_of(self, *names)


def policy_within(
    within_um: float, courses: Mapping[str, Sequence[Course]], say: Callable[[str], None] | None = None
) -> tuple[Policy, dict[str, Judged]]:
    """The rarest period of probing that holds every response within ± `within_um`, and what it leaves of the errors.

    It has to whichever run is left out: a period that only one quiet day allows is none for the next. If none does,
    the period that held most.
    """
    nothing = np.zeros(0, dtype=np.intp)
    untouched = {name: [one.touched(nothing, np.zeros(0)) for one in several] for name, several in courses.items()}
    found: list[tuple[float | None, dict[str, Judged]]] = []
    shares: list[dict[str, np.ndarray]] = []
    is_reached = False
    for period in _periods(courses):
        if say is not None:
            say("without touch-offs" if period is None else f"a touch-off every {period / 60.0:g} min")
        of = {name: judged(several, period) for name, several in untouched.items()}
        found.append((period, of))
        shares.append({name: _inside(one, within_um) for name, one in of.items()})
        if is_reached := _holds(shares[-1]):
            break
    at = len(found) - 1 if is_reached else max(range(len(found)), key=lambda k: _share(shares[k]))
    period, of = found[at]
    return Policy(within_um, period, _share(shares[at]), _share_unseen(shares), is_reached), of


def _periods(courses: Mapping[str, Sequence[Course]]) -> list[float | None]:
    """None, and the rates that fall into the runs and are not faster than their samples."""
    runs = [one for several in courses.values() for one in several if len(one.judged) > 1]
    longest_s = max((float(one.time_s[-1] - one.time_s[0]) for one in runs), default=0.0)
    step_s = max((float(np.median(np.diff(one.time_s))) for one in runs), default=np.inf)
    return [None, *(rate for rate in RATES_S if 2.0 * step_s <= rate <= longest_s)]


def _inside(one: Judged, within_um: float) -> np.ndarray:
    """Per run, samples within and samples in all; of shape (n_runs, 2)."""
    counts = [(int(np.sum(np.abs(run.error_um) <= within_um)), len(run.time_s)) for run in one.runs]
    return np.array(counts).reshape(-1, 2)


def _share(of: Mapping[str, np.ndarray], left_out: int = -1) -> float:
    """The smallest share of any response, over all runs, or all but one."""
    sums = [counts[np.arange(len(counts)) != left_out].sum(axis=0) for counts in of.values()]
    return min((float(inside / n) if n else 0.0 for inside, n in sums), default=0.0)


def _holds(of: Mapping[str, np.ndarray]) -> bool:
    """Whether the share is enough over all runs, and over all but any one of them."""
    n_runs = max(map(len, of.values()), default=0)
    return all(_share(of, left_out=k) >= SHARE for k in [-1, *range(n_runs if n_runs > 1 else 0)])


def _share_unseen(shares: Sequence[Mapping[str, np.ndarray]]) -> float:
    """The smallest share of any response, each run probed as often as the other runs ask for.

    A run whose others ask for more than was looked at is probed as often as was looked at.
    """
    names = list(shares[0])
    n_runs = {name: len(shares[0][name]) for name in names}
    total = {name: np.zeros(2) for name in names}
    for k in range(max(n_runs.values(), default=0)):
        enough = [i for i, of in enumerate(shares) if _share(of, left_out=k) >= SHARE]
        best = enough[0] if enough else max(range(len(shares)), key=lambda i: _share(shares[i], left_out=k))
        for name in names:
            if k < n_runs[name]:
                total[name] += shares[best][name][k]
    return min((float(inside / n) for inside, n in total.values() if n), default=0.0)
