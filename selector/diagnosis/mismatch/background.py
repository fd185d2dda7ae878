"""What in a residual is noise: its spectrum, the filters that make it white and back, and sets of noise alone."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import fft
from scipy.signal.windows import tukey
from scipy.stats import norm, rankdata

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.shapes.residual import basis
from selector.diagnosis.shapes.signals import rate
from selector.types import Matrix, Vector

LONGEST_NOISE_PERIOD = 45.0  #: Samples: slower than this is judged against the noise, not part of it.
_SHORTEST_FITTED = 6.5  #: Samples: periods from here to the longest decide how much memory the noise has.
#: Cycles per sample: below the first the noise has the memory that was fitted, above the second any smooth spectrum.
_FREE = (0.03, 0.045)
_SHORT = 8.0  #: Samples: the longest memory of noise beside which all that is slower stands out.
_BAND = 1.05  #: Frequencies whose ratio is below this are one band where the noise that wanders is fitted.
_STEPS = 60
_ROUNDS = 3
_CLIPPED = 6.0
_OCTAVE_PART = 1.15
_UNTOLD = 12  #: First samples of a run, whose past is not known.
_SHORTEST_RUN = 48


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Fourier bins of all runs of one response."""

    frequency: Vector  #: (n_bins,): [cycles per sample]
    run: NDArray[np.intp]  #: (n_bins,): The run that a bin is of
    #: (n_sets, n_bins): Scaled so that white noise of variance 1 has the mean square 1
    amplitudes: NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class Background:
    """Noise of several residuals."""

    levels: Matrix  #: (n_sets, n_points): Power at n_points frequencies, even from 0 to 1/2 cycle per sample

    def density(self, frequency: Vector) -> Matrix:
        """Power at these frequencies [cycles per sample], shape (n_sets, n_frequencies)."""
        at = np.clip(frequency, 0.0, 0.5) * 2.0 * (self.levels.shape[1] - 1)
        low = np.minimum(at.astype(np.intp), self.levels.shape[1] - 2)
        part = at - low
        return np.asarray(self.levels[:, low] * (1.0 - part) + self.levels[:, low + 1] * part)

    def innovations(self, residuals: Matrix, rows: Sequence[NDArray[np.intp]]) -> Matrix:
        """What each reading brings that those before it do not say, shape as `residuals`.

        The past of a run is its mirror image; its first samples, of which that says too little, are 0.
        """
        result = np.zeros_like(residuals)
        responses = {
            length: self._response(length)
            for length in {_even_length(len(here)) for here in rows if len(here) > _UNTOLD}
        }
        for here in rows:
            n = len(here)
            if n <= _UNTOLD:
                continue
            length = _even_length(n)
            part = residuals[:, here]
            bins = fft.rfft(np.concatenate([part[:, length - n - 1 :: -1], part], axis=1), axis=1) / responses[length]
            left = fft.irfft(bins, length, axis=1)[:, length - n :]
            left[:, :_UNTOLD] = 0.0
            result[:, here] = left
        return result

    def coloured(self, innovations: Matrix, length: int) -> Matrix:
        """The last `length` samples of noise that is made of these innovations, shape (n_sets, length).

        The first innovations are its past; as many as a fast transform has no use for are left out.
        """
        n = _even_length(length)
        bins = fft.rfft(innovations[:, -n:], axis=1) * self._response(n)
        return np.asarray(fft.irfft(bins, n, axis=1)[:, n - length :])

    def _response(self, n: int) -> NDArray[np.complex128]:
        """Transfer function of minimum phase from innovations to noise at the frequencies of n samples (n even)."""
        logs = 0.5 * np.log(self.density(np.arange(n // 2 + 1) / n))
        cepstrum = fft.irfft(logs, n, axis=1)
        cepstrum[:, 0] = 0.0
        cepstrum[:, 1 : n // 2] *= 2.0
        cepstrum[:, n // 2 + 1 :] = 0.0
        return np.asarray(np.exp(fft.rfft(cepstrum, axis=1)))


def _even_length(n: int) -> int:
    """Length of a run and of a past that is nearly as long, such that its transform is fast."""
    return 2 * fft.prev_fast_len(n, real=True)


def seen_rows(comparison: Comparison, residual: Vector) -> list[NDArray[np.intp]]:
    """Rows of every run in which the residual is there; runs too short for a spectrum are empty."""
    rows = [part.start + np.flatnonzero(np.isfinite(residual[part])) for _, part in comparison.rows_of_runs()]
    return _long_enough(rows)


def seen_in_both(first: Sequence[NDArray[np.intp]], second: Sequence[NDArray[np.intp]]) -> list[NDArray[np.intp]]:
    """Rows of every run in which two residuals are there."""
    return _long_enough([np.intersect1d(one, other) for one, other in zip(first, second, strict=True)])


def _long_enough(rows: list[NDArray[np.intp]]) -> list[NDArray[np.intp]]:
    return [here if len(here) >= _SHORTEST_RUN else here[:0] for here in rows]


def spectrum(residuals: Matrix, rows: Sequence[NDArray[np.intp]]) -> Spectrum:
    """Spectra of residuals of shape (n_sets, n_rows), run by run, ends tapered; frequency 0 is left out.

    A run loses its last few samples where its length has no fast transform.
    """
    frequency, run, amplitudes = [], [], []
    for k, here in enumerate(rows):
        if len(here) == 0:
            continue
        n = fft.prev_fast_len(len(here), real=True)
        window = tukey(n, 0.2)
        part = residuals[:, here[:n]]
        part = (part - part.mean(axis=1, keepdims=True)) * window
        bins = fft.rfft(part, axis=1)[:, 1 : (n + 1) // 2] / np.sqrt(np.sum(window**2))
        frequency.append(np.arange(1, bins.shape[1] + 1) / n)
        run.append(np.full(bins.shape[1], k))
        amplitudes.append(bins)
    return Spectrum(np.concatenate(frequency), np.concatenate(run), np.concatenate(amplitudes, axis=1))


def background(of: Spectrum, *, wanders: bool = True) -> Background:
    """Noise of every set of a spectrum.

    Periods below 22 samples: the smoothed periodogram, lines clipped. Above 33: the noise that wanders, as fitted to
    all periods above 6.5 samples (`wandering`); or else what has a memory of a few samples beside a white part, as
    fitted to periods of 6.5 to 45 samples, and beside which all that is slower stands out.
    """
    order = np.argsort(of.frequency, kind="stable")
    frequency, power = of.frequency[order], np.abs(of.amplitudes[:, order]) ** 2
    smooth = _smooth(frequency, power, frequency)
    smooth = _smooth(frequency, np.minimum(power, 4.0 * smooth), frequency)
    longest = 1.0 / max(float(frequency[0]), 1e-9)
    grid = np.linspace(0.0, 0.5, 1 + 2 ** max(9, int(np.ceil(np.log2(longest)))))
    weights, memories = wandering(of) if wanders else wandering(of, longest=_SHORT, slowest=LONGEST_NOISE_PERIOD)
    slow = weights @ _memories(memories, grid)
    free = np.clip((grid - _FREE[0]) / (_FREE[1] - _FREE[0]), 0.0, 1.0)
    measured = _smooth(frequency, np.minimum(power, 4.0 * smooth), grid)
    floor = 1e-6 * np.maximum(measured.mean(axis=1, keepdims=True), 1e-300)
    logs = (1.0 - free) * np.log(np.maximum(slow, floor)) + free * np.log(np.maximum(measured, floor))
    return Background(np.exp(logs))


def wandering(of: Spectrum, *, longest: float = np.inf, slowest: float = np.inf) -> tuple[Matrix, Vector]:
    """(variance of every part, its memory [samples]): noise as a sum of white (memory 0) and first-order wanderings.

    Of memories up to the `longest`, by periods up to the `slowest` [samples], where there are enough.

    Shapes (n_sets, n_parts), (n_parts,). The likeliest variances (Whittle 1953) by multiplicative updates that never
    lower the likelihood (Itakura–Saito divergence; C. Févotte, J. Idier, Neural Computation 23, 2011). Lines are
    clipped.
    """
    order = np.argsort(of.frequency, kind="stable")
    frequency, power = of.frequency[order], np.abs(of.amplitudes[:, order]) ** 2
    known = frequency >= 1.0 / slowest
    fitted = known & (frequency <= 1.0 / _SHORTEST_FITTED)
    fitted = fitted if fitted.sum() >= 12 else known
    frequency, power = frequency[fitted], power[:, fitted]
    most = max(1, int(np.ceil(np.log2(min(1.0 / float(frequency[0]), longest)))))
    memories = np.concatenate([[0.0], 2.0 ** np.arange(most + 1)])
    parts = _memories(memories, frequency)
    edges = np.flatnonzero(np.diff(np.floor(np.log(frequency) / np.log(_BAND)), prepend=-np.inf))
    count = np.diff([*edges, len(frequency)])
    banded = np.add.reduceat(parts, edges, axis=1) / count
    weights = np.full((len(power), len(memories)), 1.0 / len(memories)) * power.mean(axis=1, keepdims=True)
    clipped = power
    for _ in range(_ROUNDS):
        mean = np.add.reduceat(clipped, edges, axis=1)
        for _ in range(_STEPS):
            level = np.maximum(weights @ banded, 1e-300)
            weights = weights * ((mean / level**2) @ banded.T) / np.maximum((count / level) @ banded.T, 1e-300)
        clipped = np.minimum(power, _CLIPPED * np.maximum(weights @ parts, 1e-300))
    return weights, memories


def _memories(samples: Vector, frequency: Vector) -> Matrix:
    """Spectra of variance 1 that forget within so many samples, shape (n_parts, n_frequencies)."""
    kept = np.where(samples > 0.0, np.exp(-1.0 / np.maximum(samples, 1e-9)), 0.0)[:, None]
    return np.asarray((1.0 - kept**2) / np.abs(1.0 - kept * np.exp(-2j * np.pi * frequency)) ** 2)


def _smooth(frequency: Vector, power: Matrix, at: Vector) -> Matrix:
    """Mean power within 15 % of each frequency, of 20 bins at least; `frequency` in order."""
    n = len(frequency)
    least = min(20, n)
    low = np.searchsorted(frequency, at / _OCTAVE_PART)
    high = np.searchsorted(frequency, at * _OCTAVE_PART, side="right")
    middle = np.clip(np.searchsorted(frequency, at), least // 2, n - (least - least // 2))
    narrow = high - low < least
    low, high = np.where(narrow, middle - least // 2, low), np.where(narrow, middle - least // 2 + least, high)
    sums = np.concatenate([np.zeros((len(power), 1)), np.cumsum(power, axis=1)], axis=1)
    return np.asarray((sums[:, high] - sums[:, low]) / (high - low))


_CACHED = 2**18  #: Readings of a block of sets.


def recalibrated_away(comparison: Comparison, response: str, rows: Sequence[NDArray[np.intp]]) -> Matrix:
    """Orthonormal columns of what a recalibration takes: an offset a run, gain and delay; shape (n_rows, p)."""
    n = len(comparison.time_s)
    seen = np.concatenate(rows)
    simulated = comparison.simulated_course(response)
    columns = [(comparison.run_index == k).astype(np.float64) for k in range(len(comparison.runs))]
    columns += [simulated, rate(comparison, simulated)]
    table = np.zeros((n, len(columns)))
    table[seen] = np.column_stack(columns)[seen]
    return basis(table, least=1e-6)


def noise_alone(
    comparison: Comparison,
    residuals: Mapping[str, Vector],
    n_sets: int,
    rng: np.random.Generator,
    *,
    sized: Callable[[Vector], Vector] = np.ones_like,
    wanders: bool = True,
) -> dict[str, Matrix]:
    """Residuals as noise alone would make them: innovations in another order, the same for all responses.

    `sized` tells of innovations, shape (n_rows,), how large they are where they stand, as the noise of a machine that
    turns is larger: this stays in its place.

    Response → shape (1 + n_sets, n_rows): the first is the residual itself, all with the recalibration taken off.
    Readings are rounded as the recorded ones are (`Comparison.resolution`). Missing rows are 0. A response without
    enough readings, or without any residual, is not in the result. `wanders`: as of `background`.
    """
    n = len(comparison.time_s)
    parts = [np.arange(part.start, part.stop) for _, part in comparison.rows_of_runs()]
    noises: dict[str, _Noise] = {}
    stacks: dict[str, Matrix] = {}
    for response, residual in residuals.items():
        rows = seen_rows(comparison, residual)
        seen = np.concatenate(rows)
        taken = recalibrated_away(comparison, response, rows) if len(seen) else np.zeros((n, 0))
        own = _without(np.where(np.isin(np.arange(n), seen), residual, 0.0)[None, :], taken, seen)
        spread = float(np.std(own[0, seen])) if len(seen) else 0.0
        if spread <= 1e-9 * float(np.nanmax(np.abs(comparison.recorded[response]), initial=0.0)) or spread == 0.0:
            continue
        model = background(spectrum(own, rows), wanders=wanders)
        bringing = model.innovations(own, rows)[0]
        untold = bringing == 0.0
        bringing[untold] = rng.choice(bringing[~untold], int(untold.sum()))
        step = comparison.resolution.get(response, 0.0)
        if step > 0.7 * spread:
            # Readings of a few steps say little of the noise before it was rounded: normal values in the same order.
            ranks = rankdata(bringing + 1e-6 * spread * rng.standard_normal(len(bringing)))
            bringing = float(np.std(bringing)) * norm.ppf((ranks - 0.5) / len(ranks))
        course = comparison.filled(comparison.recorded[response] - residual)
        size = sized(bringing)
        noises[response] = _Noise(model, bringing / size, size, taken, seen, step, spread, course)
        stacks[response] = np.empty((1 + n_sets, n))
        stacks[response][0] = own[0]
    for block in blocks(1, 1 + n_sets, n):
        drawn = np.tile(np.arange(n), (block.stop - block.start, 1))
        mixed = [rng.permuted(drawn[:, part], axis=1) for part in parts]
        earlier = [rng.permuted(part, axis=1) for part in mixed]
        for response, noise in noises.items():
            stacks[response][block] = noise.sets(parts, earlier, mixed)
    return stacks


@dataclass(frozen=True, eq=False)
class _Noise:
    """Noise of one response: its model, innovations of one size, (n_rows,), and what its readings are made of."""

    model: Background
    bringing: Vector
    size: Vector  #: (n_rows,): Of the innovations there
    taken: Matrix
    seen: NDArray[np.intp]
    step: float
    spread: float
    course: Vector

    def sets(
        self, parts: Sequence[NDArray[np.intp]], earlier: Sequence[NDArray[np.intp]], mixed: Sequence[NDArray[np.intp]]
    ) -> Matrix:
        """Residuals of innovations in these orders, run by run, shape (n_sets, n_rows)."""
        shaped = np.empty((len(mixed[0]), len(self.bringing)))
        for part, before, after in zip(parts, earlier, mixed, strict=True):
            drawn = np.concatenate([self.bringing[before], self.bringing[after] * self.size[part]], axis=1)
            shaped[:, part] = self.model.coloured(drawn, len(part))
        if self.step > 0.0:
            shaped *= np.sqrt(max(1.0 - self.step**2 / 12.0 / self.spread**2, 0.05))
            shaped = self.step * np.round((self.course + shaped) / self.step) - self.course
        return _without(shaped, self.taken, self.seen)


def blocks(first: int, stop: int, n_rows: int) -> list[slice]:
    """Sets from `first` to `stop` in blocks that stay in a processor's cache."""
    size = max(1, _CACHED // n_rows)
    return [slice(at, min(at + size, stop)) for at in range(first, stop, size)]


def _without(values: Matrix, taken: Matrix, seen: NDArray[np.intp]) -> Matrix:
    """Readings without the recalibration; 0 where there are none."""
    result = np.zeros_like(values)
    result[:, seen] = values[:, seen] - (values[:, seen] @ taken[seen]) @ taken[seen].T
    return result
