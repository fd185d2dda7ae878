"""In which runs, and from which moments of a run on, a fault of the data may act, and how it is said."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.effect import Quantity, Variant
from selector.number_text import span_text
from selector.types import Mask, Vector

_MOST_MOMENTS = 40
_ALL_MOMENTS = 160
_FEW_RUNS = 8  #: Beyond them what goes on is as well told from its first whole run on.
_LEAST_ROWS = 8  #: Rows of a run before and after a moment, without which nothing tells the two apart.


@dataclass(frozen=True, eq=False)
class Part:
    """Rows in which a fault acts; the run if it is one, in words, and the window [s] if it is not the whole run."""

    rows: Mask
    run: str | None
    words: str
    from_s: float | None = None
    to_s: float | None = None

    def over(self, values: Vector) -> Vector:
        """The course in this part, 0 elsewhere."""
        return np.where(self.rows, values, 0.0)

    @property
    def shape(self) -> dict[str, Quantity]:
        """The window as shape parameters; empty if it is whole runs."""
        if self.from_s is None or self.to_s is None:
            return {}
        return {"from_s": Quantity(self.from_s, "s"), "to_s": Quantity(self.to_s, "s")}

    def variant(
        self, course: Vector, name: str, place: str, shape: Mapping[str, Quantity] = {}, **also: Any
    ) -> Variant:
        """The course in this part as a shape of a fault; `shape` beside the window, `also` as of `Variant`."""
        columns, regime = self.over(course)[:, None], self.words or self.run
        return Variant(columns, (name,), {**self.shape, **shape}, place, run=self.run, regime=regime, **also)

    def also_going_on(self, comparison: Comparison) -> Iterator["Part"]:
        """The end of a run as it is, and the same going on in all later runs, if there are any."""
        yield self
        if self.run != comparison.runs[-1] and len(comparison.runs) <= _FEW_RUNS:
            rows = np.arange(len(self.rows)) >= int(np.argmax(self.rows))
            yield replace(self, rows=rows, run=None, words=f"{self.words} and in all later runs")


def everywhere(comparison: Comparison) -> Part:
    """All rows of all runs."""
    return Part(np.ones(len(comparison.time_s), dtype=bool), None, "")


def in_one_run(comparison: Comparison, run: str) -> Part:
    """All rows of a run."""
    return Part(comparison.run_index == comparison.runs.index(run), run, f"run {run}")


def fitted_runs(comparison: Comparison) -> tuple[str, ...]:
    """Runs with rows that are not held out."""
    return tuple(run for run, rows in comparison.rows_of_runs() if not comparison.held_out[rows].all())


def single_runs(comparison: Comparison) -> list[Part]:
    """Every run with rows that are not held out, by itself; none where there is but one."""
    runs = fitted_runs(comparison)
    return [in_one_run(comparison, run) for run in runs if len(runs) > 1]


def whole_runs(comparison: Comparison, oddness: Callable[[slice], float] | None = None) -> Iterator[Part]:
    """Single runs, and runs from one on, that can be told apart while all runs together may be recalibrated.

    `oddness` says how far the run of these rows is off by itself. Of two runs, "the one" and "the other" are the same
    fit beside what all runs share: if unseen rows do not tell, the one that is farther off is meant. None: nothing that
    all runs share resembles the fault, so that every run counts, and all of them together.
    """
    runs = fitted_runs(comparison)
    if oddness is None:
        yield everywhere(comparison)
    if len(runs) < 2:
        return
    lasting = runs[-1] != comparison.runs[-1]
    singles: list[str] = list(runs)
    if oddness is not None and len(runs) == 2:
        far = {run: abs(oddness(rows)) for run, rows in comparison.rows_of_runs() if run in runs}
        singles.sort(key=lambda run: -far[run])
        singles = singles if lasting else singles[:1]
    # from the second on is all but the first, beside what all runs share
    onwards = runs[1:-1] if oddness is None else runs[2:-1]
    for run in singles:
        yield in_one_run(comparison, run)
        # unseen rows say whether what begins in the last fitted run goes on, and which of two runs it is
        if run in onwards or (lasting and run == runs[-1]):
            yield Part(comparison.run_index >= comparison.runs.index(run), None, f"from run {run} on")


def later_parts(
    comparison: Comparison,
    most: int = _MOST_MOMENTS,
    total: int = _ALL_MOMENTS,
    between: tuple[float, float] = (0.04, 0.96),
) -> Iterator[Part]:
    """Every run from each of some moments on to its end; the moments stand at fixed shares of the run.

    Moments chosen from the residual would fit noise better than noise drawn anew does. `between` are the first and the
    last of them: nearer to a run's start it is the whole run, nearer to its end a few stray readings.
    """
    runs = fitted_runs(comparison)
    per_run = int(np.clip(total // max(len(runs), 1), 3, most))
    for run, rows in comparison.rows_of_runs():
        n = rows.stop - rows.start
        if run not in runs or n < 3 * _LEAST_ROWS:
            continue
        low, high = max(_LEAST_ROWS, int(between[0] * n)), min(n - _LEAST_ROWS, int(between[1] * n))
        firsts = np.unique(np.linspace(low, high, min(per_run, n // _LEAST_ROWS)).astype(int))
        for first in firsts + rows.start:
            part = window(comparison, run, first, rows.stop - 1)
            yield replace(part, words=f"run {run} from {span_text(part.from_s or 0.0)} on")


def window(comparison: Comparison, run: str, first: int, last: int) -> Part:
    """The rows from `first` to `last` of all rows, both included, that lie in one run."""
    index = np.arange(len(comparison.time_s))
    from_s, to_s = float(comparison.time_s[first]), float(comparison.time_s[last])
    words = f"run {run} from {span_text(from_s)} to {span_text(to_s)}"
    return Part((index >= first) & (index <= last), run, words, from_s, to_s)


def step_unit(unit: str) -> str:
    """The unit of a difference of two readings."""
    return "K" if unit == "degC" else unit


def amount(value: float, unit: str) -> str:
    """The size of a difference with its unit."""
    return Quantity(value, step_unit(unit)).words(amount=True)
