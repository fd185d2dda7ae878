"""Whether there is structure left in the residual that nothing explains; of what kind, and where; and what wanders."""

from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.stats import gamma, norm

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.finding_table import FINDINGS
from selector.diagnosis.mismatch.background import (
    LONGEST_NOISE_PERIOD,
    Background,
    Spectrum,
    background,
    blocks,
    noise_alone,
    seen_in_both,
    seen_rows,
    spectrum,
    wandering,
)
from selector.diagnosis.mismatch.location import Variable, variables
from selector.diagnosis.wording import amount
from selector.findings import Finding, Where
from selector.number_text import span_text
from selector.types import Matrix, Vector

Rows = Sequence[NDArray[np.intp]]
Kind = Literal["slow", "line", "cycle", "state", "burst", "spells", "common", "switched", "unlike", "refuted"]
_BINS = 8
_WIDEST = 3.0  #: Ends of a band, as a ratio: the noise is fitted to what is wider.
#: Sum of squares between bins, in variances, from which noise is taken to differ by state (7 are expected).
_TELLING = 30.0


@dataclass(frozen=True, eq=False)
class Tested:
    """A statistic, larger when there is structure, shape (n_sets,), and where the first of them found it.

    `run` is a number, `rows` (first, last) of the window, `frequency` (low, high) [cycles per sample], `words` a state
    of the machine; None where it does not apply.
    """

    kind: Kind
    statistic: Vector
    run: int | None = None
    rows: tuple[int, int] | None = None
    frequency: tuple[float, float] | None = None
    words: str | None = None


def spectral(of: Spectrum, ratio: Matrix) -> list[Tested]:
    """More power than noise has, in bands of every width: slow (below the scale of noise), a line, a wandering cycle.

    `ratio` is the power over the density of the noise, shape (n_sets, n_bins). Each run by itself, and all together.
    """
    slow_limit = 1.0 / LONGEST_NOISE_PERIOD
    order = np.argsort(of.frequency, kind="stable")
    runs = np.unique(of.run)
    groups: list[tuple[int | None, NDArray[np.intp]]] = [(None, order)]
    if len(runs) > 1:
        groups += [(int(k), order[of.run[order] == k]) for k in runs]
    found: list[Tested] = []
    for run, bins in groups:
        frequency, power = of.frequency[bins], ratio[:, bins]
        narrow = len(runs) if run is None else 1
        sums, width = _running(power), narrow
        while width <= len(bins):
            step = 1 if width <= 4 * narrow else width // 4
            first = np.arange(0, len(bins) - width + 1, step)
            # a unit exponential is half a sum of two squares
            unusual = _normal_of_squares(2.0 * (sums[:, first + width] - sums[:, first]), 2 * width)
            slow = frequency[first + width - 1] < slow_limit
            narrow_enough = frequency[first + width - 1] <= _WIDEST * frequency[first]
            other: Kind = "line" if width <= 2 * narrow else "cycle"
            kinds: tuple[tuple[Kind, NDArray[np.bool_]], ...] = (("slow", slow), (other, ~slow & narrow_enough))
            for kind, part in kinds:
                if part.any():
                    here = first[part][int(np.argmax(unusual[0, part]))]
                    band = (float(frequency[here]), float(frequency[here + width - 1]))
                    found.append(Tested(kind, unusual[:, part].max(axis=1), run=run, frequency=band))
            width *= 2
    return found


def joined(parts: Sequence[Tested]) -> Tested:
    """The same test of several blocks of a stack, the first block of which has the residual in question."""
    return replace(parts[0], statistic=np.concatenate([part.statistic for part in parts]))


def largest(found: Sequence[Tested]) -> Tested:
    """One statistic of several of the same kind: the largest, each measured by its own spread under noise."""
    score = np.array([standardised(one.statistic) for one in found])
    first = found[int(np.argmax(score[:, 0]))]
    return Tested(first.kind, score.max(axis=0), first.run, first.rows, first.frequency, first.words)


def standardised(statistic: Vector) -> Vector:
    """The statistic in units of its upper spread under noise (sets 1 and on): 0 at the median, 1 at the 90 % point."""
    middle, high = np.quantile(statistic[1:], (0.5, 0.9))
    return np.asarray((statistic - middle) / max(high - middle, 1e-12))


def in_common(first: Spectrum, second: Spectrum, *, wanders: bool) -> Tested:
    """More in common between two responses at long scales than their noise has; whitened spectra of the same rows.

    Where noise `wanders` its power says nothing, and it is the coherence that does; otherwise the common power.
    """
    frequency = first.frequency
    slow = np.flatnonzero(frequency < 2.0 / LONGEST_NOISE_PERIOD)
    slow = slow[np.argsort(frequency[slow], kind="stable")]
    one, other = first.amplitudes[:, slow], second.amplitudes[:, slow]
    product, own, others = (_running(of) for of in (one * np.conj(other), np.abs(one) ** 2, np.abs(other) ** 2))
    found, width = [], 4
    while width <= len(slow):
        start = np.arange(0, len(slow) - width + 1, max(1, width // 4))
        amount = np.abs(product[:, start + width] - product[:, start]) / np.sqrt(width)
        if wanders:
            powers = [of[:, start + width] - of[:, start] for of in (own, others)]
            coherence = width * amount**2 / np.maximum(powers[0] * powers[1], 1e-300)
            # Of noise, 1 less the coherence of n bins has the distribution of the (n − 1)th root of a uniform value.
            amount = -(width - 1.0) * np.log(np.maximum(1.0 - coherence, 1e-12))
        at = start[int(np.argmax(amount[0]))]
        band = (float(frequency[slow[at]]), float(frequency[slow[at + width - 1]]))
        found.append(Tested("common", amount.max(axis=1), frequency=band))
        width *= 2
    return largest(found) if found else Tested("common", np.zeros(len(first.amplitudes)))


@dataclass(frozen=True, eq=False)
class ColumnsOfState:
    """One variable of the machine's state on the n_seen rows with a reading."""

    variable: Variable
    bins: NDArray[np.intp]  #: (n_seen,)
    members: Matrix  #: (n_seen, n_bins): 1 in the column of a row's bin
    columns: Matrix  #: (n_seen, p): Orthonormal: bins behind the noise filter


def columns_of_states(noise: Background, rows: Rows, states: Sequence[Variable]) -> list[ColumnsOfState]:
    """What means that differ by state can look like behind the filter of a single residual's noise."""
    found = []
    seen = np.concatenate(rows)
    for variable in states:
        bins = variable.bins(_BINS)
        if bins.max() == 0:
            continue
        table = _members(bins)
        filtered = noise.innovations(table.T, rows)[:, seen].T
        left, values, _ = np.linalg.svd(filtered - filtered.mean(axis=0), full_matrices=False)
        left = left[:, values > 1e-6 * values[0]] if values[0] > 0 else left[:, :0]
        if left.shape[1]:
            found.append(ColumnsOfState(variable, bins[seen], table[seen], left))
    return found


def by_state(clipped: Matrix, rows: Rows, states: Sequence[ColumnsOfState]) -> list[Tested]:
    """Means that differ between states of the machine: largest over the variables of the sum of squares explained.

    `clipped` is whitened, far values clipped.
    """
    found = []
    seen = np.concatenate(rows)
    readings = clipped[:, seen]
    for state in states:
        explained = np.sum((readings @ state.columns) ** 2, axis=1)
        count = np.bincount(state.bins)
        means = np.bincount(state.bins, weights=readings[0]) / np.maximum(count, 1)
        there = state.variable.values[seen][state.bins == int(np.argmax(np.abs(means)))]
        words = f"{state.variable.words} {there.min():.4g} to {there.max():.4g} {state.variable.unit}".strip()
        found.append(Tested("state", _normal_of_squares(explained, state.columns.shape[1]), words=words))
    return found


def burst(even: Matrix, rows: Rows) -> list[Tested]:
    """More noise in one window than elsewhere, by ranks; `even` is whitened and of one size in all states."""
    seen = np.concatenate(rows)
    size = np.abs(even[:, seen])
    of_ranks = norm.ppf(0.5 + 0.5 * (np.arange(len(seen)) + 0.5) / len(seen)) ** 2 - 1.0
    stack = np.empty_like(size)
    np.put_along_axis(stack, np.argsort(size, axis=1), of_ranks[None, :], axis=1)
    found, start = [], 0
    for k, here in enumerate(rows):
        n = len(here)
        sums, length = _running(stack[:, start : start + n]), 8
        while length <= n // 2:
            first = np.arange(0, n - length + 1, max(1, length // 4))
            score = (sums[:, first + length] - sums[:, first]) / np.sqrt(2.0 * length)
            at = int(first[int(np.argmax(score[0]))])
            window = (int(here[at]), int(here[at + length - 1]))
            found.append(Tested("burst", score.max(axis=1), run=k, rows=window))
            length *= 2
        start += n
    return found


def spells(residuals: Matrix, even: Matrix, rows: Rows) -> list[Tested]:
    """Something that comes and goes: means over some samples, and their steps, have longer tails than noise's.

    Sums of noise are nearly normal, of whatever colour it is; of what acts now and then many are small and a few large.
    Means of `even` (whitened and of one size in all states) and steps between adjoining means of the residuals
    themselves, over 1 to 64 samples; statistic: logarithm of the kurtosis.
    """
    clipped = [_running(np.clip(even[:, here], -4.0, 4.0)) for here in rows]
    plain = [_running(residuals[:, here]) for here in rows]
    found = []
    for k in (1, 2, 4, 8, 16, 32, 64):
        long_enough = [j for j, here in enumerate(rows) if len(here) >= 4 * k]
        if not long_enough:
            break
        every = max(1, k // 4)
        if k > 1:
            found.append(_tails([(s[:, k:] - s[:, :-k])[:, ::every] for s in (clipped[j] for j in long_enough)]))
        if k < 64:
            steps = [
                s[:, 2 * k :: every] - 2.0 * s[:, k:-k:every] + s[:, : -2 * k : every]
                for s in (plain[j] for j in long_enough)
            ]
            found.append(_tails(steps))
    return found


def _running(values: Any) -> Any:
    return np.concatenate([np.zeros((len(values), 1)), np.cumsum(values, axis=1)], axis=1)


def _tails(parts: Sequence[Matrix]) -> Tested:
    count = sum(part.shape[1] for part in parts)
    squares = [part**2 for part in parts]
    power = np.maximum(np.sum([part.sum(axis=1) for part in squares], axis=0) / count, 1e-300)
    fourth = np.sum([np.einsum("sr,sr->s", part, part) for part in squares], axis=0) / count
    return Tested("spells", np.log(np.maximum(fourth / power**2, 1e-300)))


def of_one_size(white: Matrix, rows: Rows, states: Sequence[ColumnsOfState]) -> Matrix:
    """Whitened residuals whose size is the same in all states of the machine, as noise may differ by state."""
    seen = np.concatenate(rows)
    result = np.zeros_like(white)
    readings = white[:, seen]
    result[:, seen] = readings / _size_by_state(np.abs(readings), [(state.bins, state.members) for state in states])
    return result


def _members(bins: NDArray[np.intp]) -> Matrix:
    """1 in the column of a row's bin, shape (n_rows, n_bins)."""
    return np.asarray(bins[:, None] == np.arange(int(bins.max()) + 1), dtype=np.float64)


def _size_by_state(size: Matrix, states: Iterable[tuple[NDArray[np.intp], Matrix]]) -> Matrix:
    """Mean size in each bin of the one variable that tells most about it, set by set; 1 where none tells anything."""
    level, spread = size.mean(axis=1, keepdims=True), np.maximum(size.var(axis=1), 1e-300)
    best, scale = np.full(len(size), _TELLING), np.ones_like(size)
    for bins, members in states:
        count = members.sum(axis=0)
        mean = size @ members / np.maximum(count, 1.0)
        between = ((mean - level) ** 2 @ count) / spread
        better = between > best
        best[better] = between[better]
        scale[better] = np.maximum(mean / np.maximum(level, 1e-300), 0.05)[better][:, bins]
    return scale


def _normal_of_squares(total: Vector, count: int) -> Vector:
    """Standard normal value of a sum of `count` squares of standard normal values (Wilson–Hilferty)."""
    return np.asarray(((total / count) ** (1.0 / 3.0) - 1.0 + 2.0 / (9.0 * count)) * np.sqrt(4.5 * count))


_DRAWS = (99, 199)  #: Sets of noise: the fewest, and as many as there are where readings are not too many.
_LEAST_P = 1e-12  #: That is told.
_READINGS = 4_000_000  #: Of all sets of a response.


@dataclass(frozen=True)
class Structure:
    """Something in the residual that is no noise."""

    #: {"slow", "line", "cycle", "state", "burst", "spells", "common", "switched", "unlike", "refuted"}: Slower than
    #: noise · one frequency · a band of frequencies · by state of the machine · a burst · comes and goes in short
    #: spells · slow and seen in several responses · changes its level as by a switch · the runs ask for other
    #: calibrations · sure in the fitted rows, and in the unseen ones not as the effect that comes nearest
    kind: Kind
    channel: str  #: The response
    run: str | None  #: The run that shows it; None = several
    #: from_s and to_s: Window [s from the start of that run]
    from_s: float | None
    to_s: float | None
    frequency_hz: tuple[float, float] | None  #: The band
    regime: str | None  #: State of the machine in words
    size: float  #: Root mean square of what exceeds noise of short memory [unit of the response]
    unit: str
    p_value: float  #: Adjusted for all tests on all responses
    noise: float = float("nan")  #: Standard deviation of that noise [unit]; NaN of what was not found beside it

    @property
    def band_words(self) -> str | None:
        """The band in words; None where the structure has none."""
        if self.frequency_hz is None:
            return None
        ends = dict.fromkeys(f"{end:.3g}" for end in self.frequency_hz)
        return f"{' to '.join(ends)} Hz"


def of_whole_record(kind: Kind, comparison: Comparison, response: str, size: float, p_value: float) -> Structure:
    """Structure of no run, window or band; `size` in the unit of the response."""
    unit = comparison.channel(response).unit
    return Structure(kind, response, None, None, None, None, None, size, unit, max(p_value, _LEAST_P))


def unexplained(
    comparison: Comparison,
    residuals: Mapping[str, Vector],
    whitened: Mapping[str, Vector],
    *,
    seed: int,
    false_alarm: float,
    wanders: bool = True,
) -> tuple[Structure, ...]:
    """Structure left in residuals, the surest first; empty with probability 1 − `false_alarm` if all is noise.

    A bank of tests (spectrum, common part of two responses, states of the machine, bursts, spells) on every
    response; the largest of all statistics is compared with its distribution over 199 sets (of records beyond 20 000
    samples fewer, 99 at least) of noise that wanders as the residual does, with its own innovations in another order
    (Westfall & Young 1993, single-step maximum).

    `residuals` is response → what is left, shape (n_rows,) [its unit], NaN where missing, `whitened` the same after
    the noise filter; rows that are missing in it are not looked at. Unless noise `wanders`, all that is slower than a
    memory of a few samples is structure.
    """
    rng = np.random.default_rng(seed)
    draws = int(np.clip(_READINGS // len(comparison.time_s), *_DRAWS))
    seen = {name: np.where(np.isfinite(whitened[name]), values, np.nan) for name, values in residuals.items()}
    states = variables(comparison)
    of_states = [(bins, _members(bins)) for bins in (state.bins(_BINS) for state in states)]
    stacks = noise_alone(
        comparison, seen, draws, rng, sized=lambda of: _size_by_state(np.abs(of)[None], of_states)[0], wanders=wanders
    )
    found: list[tuple[str, Tested]] = []
    rows = {response: seen_rows(comparison, seen[response]) for response in stacks}
    noises: dict[str, Background] = {}
    spread: dict[str, float] = {}
    for response, stack in stacks.items():
        tests, noises[response], spread[response] = _tests(stack, rows[response], states, wanders=wanders)
        found += [(response, test) for test in tests]
    for one, other in combinations(stacks, 2):
        both = seen_in_both(rows[one], rows[other])
        if any(len(here) for here in both):
            spectra = [(spectrum(stacks[name], both), noises[name]) for name in (one, other)]
            white = (replace(of, amplitudes=of.amplitudes / np.sqrt(n.density(of.frequency))) for of, n in spectra)
            pair = in_common(*white, wanders=wanders)
            found.append((max((one, other), key=lambda name: _contrast(stacks[name][0])), pair))
    if not found:
        return ()
    scores = np.array([standardised(test.statistic) for _, test in found])
    of_noise = scores[:, 1:].max(axis=0)
    p_values = [_tail(of_noise, float(score)) for score in scores[:, 0]]
    structures = [
        _structure(comparison, response, test, p, stacks[response][0], spread[response])
        for (response, test), p in zip(found, p_values, strict=True)
        if p <= false_alarm
    ]
    return tuple(sorted(structures, key=lambda structure: structure.p_value))


def _tests(
    stack: Matrix, rows: Rows, states: tuple[Variable, ...], *, wanders: bool
) -> tuple[list[Tested], Background, float]:
    """Tests of one response, its noise, and the standard deviation of noise with the memory of its short scales."""
    own = spectrum(stack[:1], rows)
    columns = columns_of_states(background(own, wanders=wanders), rows, states)
    parts, levels = [], []
    for block in blocks(0, len(stack), stack.shape[1]):
        part, noise = _tests_of(stack[block], rows, columns, wanders=wanders)
        parts.append(part)
        levels.append(noise.levels)
    tests = [joined(same) for same in zip(*parts, strict=True)]
    short = background(own, wanders=False)
    spread = float(np.sqrt(short.density(np.linspace(0.001, 0.5, 500))[0].mean()))
    of_kind = [largest([one for one in tests if one.kind == kind]) for kind in dict.fromkeys(one.kind for one in tests)]
    return of_kind, Background(np.concatenate(levels)), spread


def _tests_of(
    stack: Matrix, rows: Rows, states: Sequence[ColumnsOfState], *, wanders: bool
) -> tuple[list[Tested], Background]:
    of = spectrum(stack, rows)
    noise = background(of, wanders=wanders)
    tests = spectral(of, np.abs(of.amplitudes) ** 2 / noise.density(of.frequency))
    seen = np.concatenate(rows)
    white = noise.innovations(stack, rows)
    white /= 1.4826 * np.median(np.abs(white[:, seen]), axis=1, keepdims=True) + 1e-300
    clipped = np.clip(white, -4.0, 4.0)
    even = of_one_size(white, rows, states)
    tests += [*by_state(clipped, rows, states), *burst(even, rows)]
    return [*tests, *spells(stack, even, rows)], noise


def _contrast(residual: Vector) -> float:
    """How much larger a residual is than its changes from sample to sample."""
    return float(np.std(residual) / max(float(np.median(np.abs(np.diff(residual[residual != 0.0])))), 1e-300))


def _tail(of_noise: Vector, score: float) -> float:
    """Share of noise that reaches a score; beyond the highest tenth an exponential tail."""
    start = float(np.quantile(of_noise, 0.9))
    if score <= start:
        return float((1 + np.sum(of_noise >= score)) / (1 + len(of_noise)))
    beyond = of_noise[of_noise > start] - start
    return float(max(0.1 * np.exp(-(score - start) / max(float(beyond.mean()), 1e-12)), 1e-12))


def _structure(
    comparison: Comparison, response: str, test: Tested, p_value: float, residual: Vector, spread: float
) -> Structure:
    run = None if test.run is None else comparison.runs[test.run]
    from_s, to_s, seen = None, None, residual[residual != 0.0]
    if test.rows is not None:
        seen = residual[test.rows[0] : test.rows[1] + 1]
        from_s, to_s = (float(comparison.time_s[row]) for row in test.rows)
    band = None if test.frequency is None else tuple(f / comparison.period_s for f in test.frequency)
    return Structure(
        kind=test.kind,
        channel=response,
        run=run,
        from_s=from_s,
        to_s=to_s,
        frequency_hz=band,  # type: ignore[arg-type]
        regime=test.words,
        size=float(np.sqrt(max(float(np.mean(seen**2)) - spread**2, 0.0))),
        unit=comparison.channel(response).unit,
        p_value=p_value,
        noise=spread,
    )


#: Share of the mean square below which structure is little beside the noise; lines that are asked for again, and the
#: probability that noise has one of them as well.
_LITTLE, _LINES, _BY_CHANCE = 0.25, 3, 0.01


def comes_again(comparison: Comparison, residual: Vector, of: Structure) -> bool:
    """Whether structure is more than a little beside noise, or is in unseen rows as well, at the same frequencies.

    Asked of what is slow and of frequencies alone: how large it is beside noise is not known of what is quick.
    `residual` (n_rows,) is that of its response [its unit], NaN where missing.
    """
    is_slow = of.frequency_hz is not None and of.frequency_hz[0] * comparison.period_s < 1.0 / LONGEST_NOISE_PERIOD
    is_asked = is_slow and of.kind in ("slow", "line", "cycle")
    if not is_asked or of.size**2 >= _LITTLE * (of.size**2 + of.noise**2):
        return True
    parts = []
    for looked in (~comparison.held_out, comparison.held_out):
        rows = seen_rows(comparison, np.where(looked, residual, np.nan))
        if not any(len(here) for here in rows):
            return True
        bins = spectrum(np.nan_to_num(residual)[None, :], rows)
        order = np.argsort(bins.frequency)
        ratio = np.abs(bins.amplitudes) ** 2 / background(bins).density(bins.frequency)
        parts.append((bins.frequency[order], _running(ratio[:, order])[0], max(len(here) for here in rows)))
    width = 1.01 / min(length for _, _, length in parts)

    def p_values(at: Vector, frequency: Vector, sums: Vector) -> Vector:
        first, last = (np.searchsorted(frequency, at + side * width) for side in (-1.0, 1.0))
        return np.where(last > first, gamma.sf(sums[last] - sums[first], np.maximum(last - first, 1)), 1.0)

    (frequency, sums, _), (other, sums_there, _) = parts
    lines = frequency[np.argsort(p_values(frequency, frequency, sums))[:_LINES]]
    return bool(np.min(p_values(lines, other, sums_there)) < _BY_CHANCE)


_SLOW = 12.0  #: Samples of memory from which noise is said to wander.
_TRIFLE = 0.1  #: Share of the variance that has to wander to be worth a word.


def told_of_wandering(
    comparison: Comparison, residuals: Mapping[str, Vector], structured: Set[str]
) -> tuple[Finding, ...]:
    """A finding for every response whose residual wanders slowly, but for those that are `structured` and no noise.

    `residuals` is response → what is left, shape (n_rows,) [its unit], NaN where missing.
    """
    found = []
    for response in residuals.keys() - structured:
        rows = seen_rows(comparison, residuals[response])
        if not any(len(here) for here in rows):
            continue
        parts = wandering(spectrum(np.nan_to_num(residuals[response])[None, :], rows))
        variance, memory = (values.ravel() for values in parts)
        slow = memory >= _SLOW
        share = float(variance[slow].sum() / max(float(variance.sum()), 1e-300))
        if share < _TRIFLE:
            continue
        logs = np.log(memory[slow]) @ variance[slow] / variance[slow].sum()
        time_s = min(float(np.exp(logs)) * comparison.period_s, 0.5 * comparison.longest_s)
        size = float(np.sqrt(variance[slow].sum()))
        unit = comparison.channel(response).unit
        said = (
            f"What is left in {response} wanders slowly: {amount(size, unit)} rms, correlation time about "
            f"{span_text(time_s)}. This record cannot tell noise that wanders from a slow effect that nobody "
            "recorded."
        )
        evidence = {"correlation_time_s": time_s, "rms": size, "unit": unit, "share_of_variance": share}
        found.append(FINDINGS.finding("slow-remainder", said, Where(channel=response), evidence))
    return tuple(sorted(found, key=lambda finding: finding.where.channel or ""))
