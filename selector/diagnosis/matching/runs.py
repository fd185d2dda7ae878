"""Which runs repeat one programme, how well the machine does so, and whether runs stand under each other's names."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.finding_table import FINDINGS
from selector.errors import InputError
from selector.findings import Finding
from selector.types import Vector

_MOST = 15
_SAME_LENGTH = 1.05
_ALIKE = 0.1  #: Of its root mean square: by how much a simulated course or an input differs between repeats at most.


def repeats(comparison: Comparison, response: str) -> tuple[tuple[slice, slice], ...]:
    """Rows, from the start of each, of pairs of runs that were asked the same; at most 15 pairs."""
    pairs: list[tuple[slice, slice]] = []
    inputs = [channel.name for channel in comparison.channels if channel.name not in comparison.simulated]
    for (_, one), (_, other) in combinations(comparison.rows_of_runs(), 2):
        lengths = one.stop - one.start, other.stop - other.start
        if max(lengths) > _SAME_LENGTH * min(lengths) or len(pairs) == _MOST:
            continue
        first, second = (slice(of.start, of.start + min(lengths)) for of in (one, other))
        courses = [comparison.simulated[response], *(comparison.recorded[name] for name in inputs)]
        if all(rms(of[first] - of[second]) <= _ALIKE * rms(of) for of in courses):
            pairs.append((first, second))
    return tuple(pairs)


def pure_error(comparison: Comparison, response: str) -> float | None:
    """Standard deviation of one reading between runs of one programme [unit]; None without any."""
    squares, n = 0.0, 0
    for first, second in repeats(comparison, response):
        apart = comparison.difference(response)[first] - comparison.difference(response)[second]
        apart = apart[np.isfinite(apart)]
        squares += 0.5 * float(np.sum(apart**2))
        n += len(apart)
    return float(np.sqrt(squares / n)) if n else None


def rms(values: Vector) -> float:
    """Root mean square of what is not missing; NaN where all is."""
    values = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(values**2))) if len(values) else float("nan")


_CERTAIN = 10.0  #: How many times smaller the residual variance of every exchanged run has to become to leave no doubt.
_LIKELY = 3.0  #: And to be worth a warning.
_LEAST = 40  #: Samples of a run to be compared.
_LOOKED_AT = 400  #: Samples of a run that are enough to tell one programme from another.
_COVERED = 0.9  #: Share of the samples that another run's simulation has to reach.
_NOT_THAT = 1e3  #: Logarithm of a residual that no assignment chooses.


def exchanged_runs(comparison: Comparison) -> tuple[Finding, ...]:
    """A finding ``runs-exchanged`` if the simulated runs fit far better under other names.

    Every recorded run is fitted by every simulated one, response by response, with offset and positive gain; the
    assignment of runs with the smallest sum of logarithms of the residual variances is compared with the names.

    Raises InputError: the residual variance of every run that changes its partner falls to less than a tenth.
    """
    parts = [rows for _, rows in comparison.rows_of_runs()]
    if len(parts) < 2 or not comparison.responses:
        return ()
    left = np.stack([_residuals(comparison, name, parts) for name in comparison.responses])
    own = np.einsum("rii->ri", left)
    # a response that was not compared in a run says nothing about that run
    known = np.isfinite(own)
    logs = np.where(known[:, :, None], np.where(np.isfinite(left), left, _NOT_THAT), 0.0)
    _, partner = linear_sum_assignment(logs.sum(axis=0))
    moved = np.flatnonzero(partner != np.arange(len(parts)))
    if not len(moved):
        return ()
    falls = np.where(known[:, moved], own[:, moved] - logs[:, moved, partner[moved]], 0.0)
    # the response that tells most; none may speak against it
    fall = float(np.exp(np.where(falls.min(axis=0) > -np.log(2.0), falls.max(axis=0), 0.0).min()))
    if fall < _LIKELY:
        return ()
    pairs = [(comparison.runs[k], comparison.runs[partner[k]]) for k in moved]
    said = "; ".join(f"run {other} of the simulation fits recording {run}" for run, other in pairs[:6])
    said += f"; and {len(pairs) - 6} more" if len(pairs) > 6 else ""
    advice = "name every simulated file like the recording that it was computed for"
    if fall > _CERTAIN:
        raise InputError(
            f"{said}: the residual variance is at least {fall:.3g} times smaller so",
            expected="every simulated run under the name of the recorded one",
            where="simulation",
            advice=advice,
        )
    said = f"Simulated runs may stand under each other's names: {said}; the residual variance is at least {fall:.2g} "
    evidence = {"fits": dict(pairs), "times_smaller": fall}
    return (FINDINGS.finding("runs-exchanged", f"{said}times smaller so.", None, evidence, advice),)


def _residuals(comparison: Comparison, name: str, parts: Sequence[slice]) -> NDArray[np.float64]:
    """Log residual variance of every recorded run (rows) with every simulated one; NaN where not comparable."""
    recorded, simulated, time = comparison.recorded[name], comparison.simulated[name], comparison.time_s
    floor = max(1e-12 * float(np.nanvar(recorded)), comparison.resolution.get(name, 0.0) ** 2 / 12.0, 1e-300)
    result = np.full((len(parts), len(parts)), np.nan)
    for i, rows in enumerate(parts):
        compared = np.flatnonzero(np.isfinite(comparison.difference(name)[rows])) + rows.start
        if len(compared) < _LEAST:
            continue
        looked = compared[np.unique(np.linspace(0, len(compared) - 1, _LOOKED_AT).astype(np.intp))]
        for j, other in enumerate(parts):
            there = np.isfinite(simulated[other])
            if there.sum() < 2:
                continue
            stamps = time[other][there]
            inside = (time[looked] >= stamps[0]) & (time[looked] <= stamps[-1])
            if i != j and inside.mean() < _COVERED:
                continue
            x = np.interp(time[looked][inside], stamps, simulated[other][there])
            result[i, j] = np.log(max(_left(recorded[looked][inside], x, either_sign=i == j), floor))
    return result


def _left(y: Vector, x: Vector, *, either_sign: bool) -> float:
    """Variance of what offset and gain leave; a run of another name has to go the same way, its own may be inverted."""
    x, y = x - x.mean(), y - y.mean()
    size, along = float(x @ x), float(x @ y)
    if size == 0.0 or (along <= 0.0 and not either_sign):
        return float(y @ y / len(y))
    return float((y @ y - along**2 / size) / len(y))
