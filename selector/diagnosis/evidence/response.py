"""One response on the bench: what recalibration explains, every candidate shape, the noise filter, blocks of rows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.ndimage import minimum_filter1d
from scipy.optimize import minimize_scalar

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.effect import Effect, Variant
from selector.diagnosis.evidence.moments import Moments, all_moderated, beside, inverse_of, moments, plain_fit
from selector.diagnosis.evidence.noise import NoiseModel, filled_rows, noise_model, stretches, whitened, with_past
from selector.diagnosis.matching.usable import repeats, rms, rounding_of
from selector.diagnosis.shapes.machine_cycle import MachineCycle, machine_cycle
from selector.diagnosis.shapes.residual import least_squares
from selector.diagnosis.shapes.signals import by_run, rate
from selector.types import Matrix, Vector

_BLOCKS, _ROUNDS = 24, 4
_CHANGES = 0.1  #: Of a course: what differs between cycles by less is taken to come back with them.
_HIGHEST = np.array([1.0, -3.0, 3.0, -1.0]) / np.sqrt(20.0)
_FEW_SAMPLES, _LESS, _CLEARLY_LESS = 2.0, 0.75, 0.15
_SHIFTS = np.arange(-100.0, 101.0)  #: Samples that a course is late by in a first look.
#: Samples that a delay is told to; delays that are looked at closely; times the least that one of them leaves.
_NEAR, _MOST_TRIED, _AS_LITTLE = 1e-2, 20, 1.1
#: Gain, and delay in samples: a simulation that would need more to move as much as the mismatch does stands still.
_MOST = 1e6
#: Candidates that are whitened together: one by one the calls take longer than the numbers, all at once need memory.
_AT_ONCE = 32
#: The same of a delay, and of an own parameter: below, it may be exchanged for a gain many times as large.
_OF_ITS_OWN, _OF_ANOTHER = 0.02, 0.1
_APART = 1e-4  #: Part of a column that is not the columns before it, without which it is no other one.
OF_MODEL = "model: "  #: Begins the name of a column that is a parameter of a simulation that can be run again.


@dataclass(frozen=True, eq=False)
class Candidate:
    """One shape of one effect in one response, and where its columns stand among all columns."""

    effect: Effect
    variant: Variant
    first: int

    @property
    def columns(self) -> slice:
        """Its columns among those of all candidates."""
        return slice(self.first, self.first + len(self.variant.names))


@dataclass(frozen=True, eq=False)
class Bench:
    """All that is needed to test effects in one response."""

    response: str
    target: Vector  #: (n_rows,): Recorded minus simulated [unit]; NaN where one is missing
    fitted: NDArray[np.bool_]  #: (n_rows,): Rows that are fitted to: seen, not held out
    #: (n_rows, p): What recalibration may change; `nuisance_names` says what each is. First offset, gain and delay, as
    #: far as they are excited, then the parameters in `own`.
    nuisance: Matrix
    nuisance_names: tuple[str, ...]
    #: (m,): Root mean square of every candidate column over the fitted rows; columns are used divided by it
    scales: Vector
    candidates: tuple[Candidate, ...]
    noise: NoiseModel
    parts: list[slice]  #: Stretches without gaps
    runs: NDArray[np.intp]  #: (n_rows,): Number of the run of every row
    resolution: float  #: Step of the readings [unit]; 0 = none was seen
    rounding: float  #: Standard deviation [unit] that noise has at least
    own: Mapping[str, slice]  #: Effect → its columns in `nuisance`: parameters that every such simulation has
    repeats: tuple[tuple[slice, slice], ...] = ()  #: Rows of pairs of runs of one programme
    cycle: MachineCycle | None = None  #: What the machine repeats
    is_off_cycle: bool = False  #: Whether what comes back with every cycle is taken for noise, and taken off
    is_misfit: bool = False  #: Whether more is left than noise
    #: (len(rows),): Takes the place of the whitened target, where its noise has heavy tails
    pseudo_target: Vector | None = None

    def without_own(self, id: str) -> Bench:  # noqa: A002 - the word of the contract
        """The same with an own parameter as a candidate instead."""
        if id not in self.own:
            return self
        gone = self.own[id]
        width = gone.stop - gone.start
        own = {
            name: slice(part.start - width, part.stop - width) if part.start > gone.start else part
            for name, part in self.own.items()
            if name != id
        }
        kept = np.r_[: gone.start, gone.stop : self.nuisance.shape[1]]
        names = (*self.nuisance_names[: gone.start], *self.nuisance_names[gone.stop :])
        return replace(self, nuisance=self.nuisance[:, kept], nuisance_names=names, own=own)

    def of_all_rows(self, kept: Sequence[int]) -> Bench:
        """The same with some of the candidates alone, and the unseen rows fitted, too."""
        some = [self.candidates[v] for v in kept]
        firsts = np.cumsum([0, *(self.counts[v] for v in kept)])
        moved = tuple(replace(one, first=int(first)) for one, first in zip(some, firsts, strict=False))
        scales = np.concatenate([self.scales[one.columns] for one in some])
        return replace(self, candidates=moved, scales=scales, fitted=self.fitted | self.unseen, pseudo_target=None)

    def with_noise(self, noise: NoiseModel) -> Bench:
        """The same with another noise filter."""
        other = replace(self, noise=noise, pseudo_target=None)
        if len(noise.phi) == 0 == len(self.noise.phi) and "white_columns" in vars(self):
            # white before and after: only the size differs
            vars(other)["white_columns"] = self.white_columns * (self.noise.sd / noise.sd)
        return other

    def first_candidate(self, id: str) -> int:  # noqa: A002 - the word of the contract
        """Number of the first shape of an effect."""
        return next(k for k, candidate in enumerate(self.candidates) if candidate.effect.id == id)

    @cached_property
    def white_columns(self) -> Matrix:
        """Candidate columns behind the noise filter, fitted rows only, shape (len(rows), m)."""
        result = np.empty((len(self.rows), len(self.scales)))
        for first in range(0, len(self.candidates), _AT_ONCE):
            some = self.candidates[first : first + _AT_ONCE]
            columns = slice(some[0].columns.start, some[-1].columns.stop)
            raw = np.empty((len(self.target), columns.stop - columns.start))
            np.concatenate([one.variant.columns for one in some], axis=1, out=raw)
            raw /= self.scales[columns]
            result[:, columns] = whitened(self.noise, raw, self.parts)[self.rows]
        return self._single(result)

    def _single(self, white: Matrix) -> Matrix:
        """Whitened columns (fitted rows) less what comes back with every cycle, if that counts as noise."""
        if self.cycle is None or not self.is_off_cycle:
            return white
        values = np.zeros((len(self.target), white.shape[1]))
        values[self.rows] = white
        return np.asarray(white - self.cycle.repeated(values, self.rows)[self.rows])

    def raw(self, v: int) -> Matrix:
        """Columns of candidate `v`, all rows, each of root mean square 1 over the fitted ones."""
        return self.candidates[v].variant.columns / self.scales[self.candidates[v].columns]

    @cached_property
    def white_nuisance(self) -> Matrix:
        """Columns of the recalibration behind the noise filter, fitted rows only."""
        return self.behind_filter(self.nuisance)

    def behind_filter(self, columns: Matrix) -> Matrix:
        """Courses (n_rows, p) behind the noise filter, fitted rows only."""
        return self._single(whitened(self.noise, columns, self.parts)[self.rows])

    @cached_property
    def white_target(self) -> Vector:
        """The target behind the noise filter, fitted rows only; 0 where it is missing."""
        if self.pseudo_target is not None:
            return self.pseudo_target
        whole = filled_rows(self.target, self.parts)[:, None]
        return self.behind_filter(whole)[:, 0]

    @cached_property
    def rows(self) -> NDArray[np.intp]:
        """The fitted rows that have a past within their stretch."""
        return np.flatnonzero(with_past(self.noise, self.parts, len(self.target)) & self.fitted)

    @cached_property
    def unseen(self) -> NDArray[np.bool_]:
        """Rows that are compared and not fitted to, shape (n_rows,)."""
        return np.isfinite(self.target) & ~self.fitted

    @cached_property
    def blocks(self) -> list[slice]:
        """About 24 blocks of `rows`, none over the end of a run, none shorter than the noise remembers."""
        run = self.runs[self.rows]
        size = max(len(self.rows) / _BLOCKS, 4.0 * self.noise.correlation_samples, 8.0)
        found = []
        edges = np.flatnonzero(np.r_[True, np.diff(run) != 0, True])
        for first, last in pairwise(edges):
            n = max(1, round((last - first) / size))
            cuts = np.linspace(first, last, n + 1).round().astype(int)
            found += [slice(int(a), int(b)) for a, b in pairwise(cuts)]
        return found

    @cached_property
    def block_runs(self) -> NDArray[np.intp]:
        """Which run every block lies in."""
        return np.array([self.runs[self.rows[block.start]] for block in self.blocks])

    @cached_property
    def counts(self) -> list[int]:
        """Number of columns of every candidate."""
        return [len(candidate.variant.names) for candidate in self.candidates]

    @cached_property
    def bounds(self) -> Matrix:
        """Between what the coefficient of every (scaled) column may lie, shape (m, 2)."""
        limits = np.tile([-np.inf, np.inf], (len(self.scales), 1))
        for candidate in self.candidates:
            if candidate.variant.bounds is not None:
                limits[candidate.columns] = np.array(candidate.variant.bounds)
        return limits * self.scales[:, None]

    def base(self, named: Sequence[int]) -> Matrix:
        """Whitened columns of the recalibration and of the candidates `named`, fitted rows."""
        parts = [self.white_nuisance, *(self.white_columns[:, self.candidates[v].columns] for v in named)]
        return np.column_stack(parts)

    @cached_property
    def _sums(self) -> Moments:
        return moments(self.white_columns, self.white_target, self.blocks, self.counts, self.bounds)

    def moments(self, base: Matrix) -> Moments:
        """Sums of products of all candidates beside whitened `base` columns."""
        return beside(self._sums, base, self.white_columns, self.white_target, self.blocks)

    def raw_base(self, named: Sequence[int]) -> Matrix:
        """Columns of the recalibration and of the candidates `named`, all rows, not whitened."""
        return np.column_stack([self.nuisance, *(self.raw(v) for v in named)])

    def coefficients(self, named: Sequence[int]) -> tuple[Vector, Matrix]:
        """Generalised least squares on the fitted rows: coefficients and their covariance, shapes (p,), (p, p).

        Those of a candidate with several columns are `moderated`. Those of the recalibration are then fitted once more
        by plain least squares to what the named candidates leave: behind the filter of a noise that wanders the level
        says next to nothing, and may come out anywhere; so it may where what comes back with every cycle is taken off.
        """
        base, own = self.base(named), self.nuisance.shape[1]
        inverse = inverse_of(base.T @ base)
        counts = [self.counts[v] for v in named]
        if self.is_misfit:
            return plain_fit(self.raw_base(named)[self.fitted], self.target[self.fitted], own, counts), inverse
        beta = inverse @ (base.T @ self.white_target)
        beta = all_moderated(beta, inverse, own, counts)
        rest = (self.target - self.raw_base(named)[:, own:] @ beta[own:])[self.fitted]
        beta[:own] = least_squares(self.nuisance[self.fitted], rest)
        if self.cycle is not None and self.is_off_cycle:
            left = np.zeros((len(self.target), 1))
            left[self.fitted, 0] = rest - self.nuisance[self.fitted] @ beta[:own]
            beta[:own] += self._of_what_changes @ (left - self.cycle.repeated(left, self.fitted))[self.fitted, 0]
        return beta, inverse

    @cached_property
    def _of_what_changes(self) -> Matrix:
        """What recalibration makes of what cycles differ by, shape (p, n_fitted), as far as its own columns do.

        What comes back with every cycle is taken for noise, and would be fitted by a gain or a delay.
        """
        assert self.cycle is not None
        changes = (self.nuisance - self.cycle.repeated(self.nuisance, self.fitted))[self.fitted]
        size = np.maximum(np.linalg.norm(self.nuisance[self.fitted], axis=0), 1e-300)
        left, values, right = np.linalg.svd(changes / size, full_matrices=False)
        kept = values > _CHANGES
        return np.asarray((right[kept].T / values[kept]) @ left[:, kept].T / size[:, None])

    def residual(self, named: Sequence[int]) -> Vector:
        """The target less recalibration and named candidates [unit], all rows; NaN where the target is missing.

        Less what comes back with every cycle, too, where that counts as noise.
        """
        left = self.target - self.raw_base(named) @ self.coefficients(named)[0]
        if self.cycle is None or not self.is_off_cycle:
            return left
        return np.asarray(left - self.cycle.repeated(left[:, None], self.fitted)[:, 0])

    @property
    def given(self) -> Vector:
        """The target [unit], all rows, less what comes back with every cycle where that counts as noise."""
        return np.asarray(self.residual([]) + self.explained([]))

    def mean_square(self, named: Sequence[int]) -> float:
        """Of the residual beside the candidates `named`, over the fitted rows [unit²]."""
        return float(np.mean(self.residual(named)[self.fitted] ** 2))

    def share(self, named: Sequence[int], v: int) -> float:
        """Share of what recalibration leaves of the fitted rows that candidate `v` explains beside those `named`."""
        alone = self.mean_square([])
        return (self.mean_square(named) - self.mean_square([*named, v])) / alone if alone > 0.0 else 0.0

    def quick(self, left: Vector) -> float:
        """Root mean square of third differences of what is left [unit]: of white noise its own; NaN in short parts.

        Of what bends slowly it is next to nothing.
        """
        parts = [np.convolve(left[part], _HIGHEST, mode="valid") for part in self.parts if part.stop - part.start > 3]
        return rms(np.concatenate(parts)) if parts else float("nan")

    def place(self, named: Sequence[int], v: int) -> slice:
        """Where the coefficients of candidate `v`, one of the `named`, stand among all `coefficients`."""
        first = self.nuisance.shape[1] + sum(self.counts[other] for other in named[: list(named).index(v)])
        return slice(first, first + self.counts[v])

    def course(self, named: Sequence[int], v: int) -> Vector:
        """What candidate `v`, one of the `named`, explains [unit], all rows."""
        return np.asarray(self.raw(v) @ self.coefficients(named)[0][self.place(named, v)])

    def explained(self, named: Sequence[int]) -> Vector:
        """What recalibration and named candidates explain [unit], all rows."""
        return np.asarray(self.raw_base(named) @ self.coefficients(named)[0])

    def white_residual(self, named: Sequence[int]) -> Vector:
        """The residual behind the noise filter, all rows; NaN where there is none, or no past."""
        left = self.residual(named)
        told = with_past(self.noise, self.parts, len(left)) & np.isfinite(left)
        return np.where(told, self.white(left), np.nan)

    def white(self, left: Vector) -> Vector:
        """A course behind the noise filter, all rows; 0 where it is missing or has no past."""
        seen = np.isfinite(left)
        return whitened(self.noise, np.where(seen, left, 0.0)[:, None], self.parts)[:, 0] * seen

    def refitted_noise(self, named: Sequence[int]) -> Bench:
        """The same with the noise that is left beside the candidates `named`."""
        left = np.where(self.fitted, self.residual(named), np.nan)
        parts = []
        for part in self.parts:
            here = part.start + np.flatnonzero(self.fitted[part])
            if len(here) > 2 and here[-1] - here[0] >= 8:
                parts.append(slice(int(here[0]), int(here[-1]) + 1))
        lost = self.nuisance.shape[1] + sum(self.counts[v] for v in named)
        lost += self.cycle.samples if self.cycle is not None and self.is_off_cycle else 0
        return self.with_noise(noise_model(left, parts, lost=lost, rounding=self.rounding))


def bench_of(comparison: Comparison, response: str, effects: Sequence[Effect]) -> tuple[Bench, dict[str, str]]:
    """The bench of a response, and for every effect that cannot be tested in it, why."""
    target = comparison.difference(response)
    seen = np.isfinite(target)
    fitted = seen & ~comparison.held_out
    candidates: list[Candidate] = []
    scales: list[Vector] = []
    untested: dict[str, str] = {}
    nuisance, names = recalibration_columns(comparison, response, fitted)
    own: dict[str, slice] = {}
    first = 0
    for effect in effects:
        reason = effect.testable(comparison, response)
        if reason is not None:
            untested[effect.id] = reason
            continue
        added: list[tuple[Variant, Vector]] = []
        for variant in effect.variants(comparison, response):
            scale = np.sqrt(np.mean(variant.columns[fitted] ** 2, axis=0))
            if np.isfinite(variant.columns).all() and (scale > 0.0).all():
                added.append((variant, scale))
        if not added:
            untested[effect.id] = "nothing in the fitted runs excites it"
            continue
        if effect.absorbs:
            columns = added[0][0].columns / added[0][1]
            # of a force it is one that the simulation has of its own, and a position may have it beside a delay
            if comparison.channel(response).role == "velocity" and any(
                _beside(nuisance[fitted], one) <= _OF_ANOTHER * np.std(one) for one in columns[fitted].T
            ):
                untested[effect.id] = "in this response it is another gain of the simulation"
                continue
            own[effect.id] = slice(nuisance.shape[1], nuisance.shape[1] + columns.shape[1])
            nuisance = np.column_stack([nuisance, columns])
            names = (*names, *(f"{effect.id}: {name}" for name in added[0][0].names))
        for variant, scale in added:
            candidates.append(Candidate(effect, variant, first))
            scales.append(scale)
            first += len(variant.names)
    parts = stretches(comparison, seen)
    bench = Bench(
        response=response,
        target=target,
        fitted=fitted,
        nuisance=nuisance,
        nuisance_names=names,
        scales=np.concatenate(scales) if scales else np.empty(0),
        candidates=tuple(candidates),
        noise=NoiseModel(np.zeros(0), float(np.nanstd(target[fitted])) or 1.0),
        parts=parts,
        runs=comparison.run_index,
        resolution=comparison.resolution.get(response, 0.0),
        rounding=rounding_of(comparison, response),
        own=own,
        repeats=repeats(comparison, response),
        cycle=machine_cycle(comparison),
    )
    return bench.refitted_noise([]), untested


def recalibration_columns(
    comparison: Comparison, response: str, fitted: NDArray[np.bool_]
) -> tuple[Matrix, tuple[str, ...]]:
    """What the simulation's user may put right without new physics: offset, gain and delay of the simulated course.

    Columns are scaled to root mean square 1 over the fitted rows, but the offset, which is 1. A simulation that stands
    still, for all that the recording does, has no gain and no delay; and a single exponential has no delay, which is
    another gain of it.
    """
    simulated = comparison.simulated_course(response)
    found, names = [np.ones(len(simulated))], ["offset"]
    delayed = _delayed(comparison, response, simulated, fitted)
    mismatch = float(np.std(comparison.difference(response)[fitted]))
    for name, column, most in (("gain", simulated, _MOST), ("delay", delayed, _MOST * comparison.period_s)):
        spread = float(np.std(column[fitted]))
        moves = spread > 1e-9 * max(float(np.abs(column[fitted]).max()), 1e-300) and most * spread > mismatch
        if moves and _beside(np.column_stack(found)[fitted], column[fitted]) > _OF_ITS_OWN * spread:
            found.append(column)
            names.append(name)
    for name, column in comparison.tangents.get(response, {}).items():
        size = float(np.sqrt(np.mean(column[fitted] ** 2)))
        # what is the same as an offset, gain or delay (a force per ampere) would make each of them come out anywhere
        if size > 0.0 and _beside(np.column_stack(found)[fitted], column[fitted]) > _APART * size:
            found.append(column / size)
            names.append(f"{OF_MODEL}{name}")
    return np.column_stack(found), tuple(names)


def _beside(known: Matrix, column: Vector) -> float:
    """Root mean square of what known columns leave of another."""
    return rms(column - known @ least_squares(known, column))


def _delayed(comparison: Comparison, response: str, simulated: Vector, fitted: NDArray[np.bool_]) -> Vector:
    """What a delay changes in the simulated course, per second of it; a derivative where no delay fits.

    A delay of many samples has to leave clearly less beside noise, or a lag would be exchanged for it.
    """
    slope, difference = -rate(comparison, simulated), comparison.difference(response)[fitted]
    known = np.column_stack([np.ones(len(simulated)), simulated])
    # a thermometer that is late by more has a clock of its own, which is a fault and no calibration
    is_thermometer = comparison.channel(response).role == "temperature"
    delay_s = 0.0 if is_thermometer else _long_delay(comparison, response, simulated, fitted)
    if delay_s:
        column = (_late_by(comparison, simulated, delay_s) - simulated) / delay_s
        by_slope, late = (_beside(np.column_stack([known, one])[fitted], difference) ** 2 for one in (slope, column))
        noise = min(float(np.mean(np.convolve(difference, _HIGHEST, mode="valid") ** 2)), late)
        if late < _LESS * by_slope and late - noise < _CLEARLY_LESS * (by_slope - noise):
            return column
    column = slope
    for _ in range(_ROUNDS):
        columns = np.column_stack([known, column])
        delay_s = float(least_squares(columns[fitted], difference)[-1])
        if not 1e-3 < abs(delay_s) / comparison.period_s < _FEW_SAMPLES:
            return slope
        column = (_late_by(comparison, simulated, delay_s) - simulated) / delay_s
    return column


def _long_delay(comparison: Comparison, response: str, simulated: Vector, fitted: NDArray[np.bool_]) -> float:
    """The shortest delay [s] of those that leave least beside a gain above 0; 0 where a part of a sample does."""
    recorded = comparison.difference(response)[fitted] + simulated[fitted]

    def left(samples: float) -> float:
        def late(time: Vector, part: Vector) -> Vector:
            return np.interp(time - samples * comparison.period_s, time, part) if len(time) else part

        (own, along), (_, whole) = np.cov(by_run(comparison, late, comparison.time_s, simulated)[fitted], recorded)
        return float(whole - max(along, 0.0) ** 2 / own if own > 0.0 else whole)

    squares = np.array([left(samples) for samples in _SHIFTS])
    lowest = np.flatnonzero(squares == minimum_filter1d(squares, 3))
    near = _SHIFTS[lowest[np.argsort(squares[lowest])[:_MOST_TRIED]]]
    told = [minimize_scalar(left, bounds=(at - 1.0, at + 1.0), options={"xatol": _NEAR}) for at in near]
    as_little = _AS_LITTLE * min((one.fun for one in told), default=0.0)
    samples = min((float(one.x) for one in told if one.fun <= as_little), key=abs, default=0.0)
    return samples * comparison.period_s if abs(samples) > 1.0 else 0.0


def _late_by(comparison: Comparison, course: Vector, delay_s: float) -> Vector:
    def late(time: Vector, part: Vector) -> Vector:
        return CubicSpline(time, part)(np.clip(time - delay_s, time[0], time[-1])) if len(time) > 1 else part

    return by_run(comparison, late, comparison.time_s, course)
