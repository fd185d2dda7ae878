"""How an effect is concealed: the noise beside it, how strong it is, and by which numbers it is hidden."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.signal import lfilter

from proving_ground.case import Concealment, HeldOut
from selector.types import Matrix, Vector


@dataclass(frozen=True)
class Noise:
    """Stationary noise, sample by sample, independent from run to run."""

    sd: float  #: Standard deviation of the coloured part [unit of the response]
    phi: float = 0.0  #: Correlation from one sample to the next, AR(1): 0 = white, 0.85, 0.995 = almost a random walk
    tails: float | None = None  #: Degrees of freedom of Student's t of the innovations (more than 2); None = normal
    step: float = 0.0  #: What the readings are rounded to [unit]; adds the variance step²/12
    #: cycle_samples and cycle_sd: A course of that many samples and that standard deviation [unit] that every run
    #: repeats from its start
    cycle_samples: int = 0
    cycle_sd: float = 0.0

    def drawn(self, generator: np.random.Generator, starts: Sequence[int]) -> Vector:
        """One realisation over runs that begin at `starts` (last: the number of rows), before rounding."""
        result = np.empty(starts[-1])
        for first, stop in pairwise(starts):
            if self.tails is None:
                innovations = generator.standard_normal(stop - first)
            else:
                innovations = generator.standard_t(self.tails, stop - first) * np.sqrt(1.0 - 2.0 / self.tails)
            innovations[1:] *= np.sqrt(1.0 - self.phi**2)
            result[first:stop] = self.sd * lfilter([1.0], [1.0, -self.phi], innovations)
        if self.cycle_samples:
            course, order = generator.standard_normal(self.cycle_samples), np.arange(self.cycle_samples)
            harmonics = np.minimum(order, self.cycle_samples - order)
            smooth = np.real(np.fft.ifft(np.fft.fft(course) / (1.0 + harmonics)))
            smooth -= smooth.mean()
            result += self.cycle_sd * (smooth / smooth.std())[self._phase(starts)]
        return result

    def rounded(self, values: Vector) -> Vector:
        """The values as they are read: in multiples of `step`."""
        return np.asarray(np.round(values / self.step) * self.step) if self.step > 0.0 else values

    def whitened(self, columns: Matrix, starts: Sequence[int]) -> Matrix:
        """Columns in units of the noise of a sample, innovations of AR(1) plus white noise of the rounding.

        Of shape (n_rows, n_columns); a repeated course is not whitened but projected off, see `repeated`.
        """
        result = np.empty_like(columns, dtype=np.float64)
        rounding = self.step**2 / 12.0
        for first, stop in pairwise(starts):
            part = np.ascontiguousarray(columns[first:stop], dtype=np.float64)
            result[first:stop] = _innovations(part, self.sd**2, self.phi, rounding)
        return result

    def repeated(self, starts: Sequence[int]) -> Matrix:
        """A column for every sample of the cycle that runs repeat, shape (n_rows, cycle_samples); none without one."""
        if not self.cycle_samples:
            return np.empty((starts[-1], 0))
        return np.asarray(np.eye(self.cycle_samples)[self._phase(starts)])

    def _phase(self, starts: Sequence[int]) -> NDArray[np.intp]:
        lengths = np.diff(np.asarray(starts))
        return np.concatenate([np.arange(length) % self.cycle_samples for length in lengths])


def coloured(colour: str, sd: float, step: float, phi: float = 0.5) -> Noise:
    """Noise of about this standard deviation: white, ar, heavy-tailed, or quantised in steps above its spread."""
    if colour == "quantised":
        return Noise(0.5 * sd, step=1.5 * sd)
    return Noise(sd, phi if colour == "ar" else 0.0, 3.0 if colour == "heavy-tailed" else None, step)


@njit(cache=True, nogil=True)
def _innovations(columns, variance, phi, rounding):  # type: ignore[no-untyped-def]
    n, m = columns.shape
    result = np.empty((n, m))
    state = np.zeros(m)
    spread = variance
    for k in range(n):
        total = spread + rounding
        gain = spread / total
        for j in range(m):
            surprise = columns[k, j] - state[j]
            result[k, j] = surprise / np.sqrt(total)
            state[j] = phi * (state[j] + gain * surprise)
        spread = phi * phi * spread * (1.0 - gain) + (1.0 - phi * phi) * variance
    return result


def recalibration(simulated: Vector, time_s: Vector, starts: Sequence[int]) -> Matrix:
    """What a user may set right without new physics, all runs alike: offset, gain, delay; shape (n_rows, 3)."""
    slope = np.concatenate([np.gradient(simulated[a:b], time_s[a:b]) for a, b in pairwise(starts)])
    return np.column_stack([np.ones_like(simulated), simulated, slope])


def fitted_starts(starts: Sequence[int], share: float = 0.7) -> tuple[int, ...]:
    """First rows, and last of all the number, of the fitted rows: all runs but the last, or `share` of a single one."""
    return tuple(starts[:-1]) if len(starts) > 2 else (starts[0], starts[0] + int(share * (starts[1] - starts[0])))


def d_prime(
    effect_courses: Mapping[str, Vector],
    noise: Mapping[str, Noise],
    nuisances: Mapping[str, Matrix],
    starts: Sequence[int],
) -> float:
    """Norm of an effect in units of the noise, over the fitted rows (`fitted_starts`) of all responses together.

    d′² = Σ |(I − P) W e|², with W the whitening of the response's noise and P the projection on its whitened nuisances
    (what may be fitted without new physics, e.g. `recalibration`, and the repeated course of cycle-locked noise): the
    separation, in standard deviations, of the statistic of a matched filter with the effect on and off (S. M. Kay,
    Fundamentals of Statistical Signal Processing II, section 4.4). Whitening goes by second moments, for heavy tails
    too.

    Courses, noise and nuisances are told by response, courses in its unit; `starts` are the first row of every run, and
    last of all the number of rows.
    """
    rows = fitted_starts(starts)
    total = 0.0
    for response, course in effect_courses.items():
        colour = noise[response]
        left = unabsorbed(course[:, None], nuisances[response], colour, rows)
        total += float(np.sum(left**2))
    return float(np.sqrt(total))


def unabsorbed(columns: Matrix, nuisances: Matrix, noise: Noise, starts: Sequence[int]) -> Matrix:
    """Whitened columns in the rows of `starts`, with the nuisances projected off; shape (starts[-1], n_columns)."""
    stop = starts[-1]
    basis = whitened_basis(np.column_stack([nuisances[:stop], noise.repeated(starts)]), noise, starts)
    white = noise.whitened(columns[:stop], starts)
    return np.asarray(white - basis @ (basis.T @ white))


def whitened_basis(free: Matrix, noise: Noise, starts: Sequence[int]) -> Matrix:
    """An orthonormal basis of these columns, whitened."""
    lengths = np.linalg.norm(free, axis=0)
    white = noise.whitened(free / np.where(lengths > 0.0, lengths, 1.0), starts)
    basis, values, _ = np.linalg.svd(white, full_matrices=False)
    return np.asarray(basis[:, values > 1e-10 * values.max(initial=0.0)])


def scale_for(
    target: float, strength: Callable[[float], float], *, first: float = 1.0, tolerance: float = 0.01
) -> float:
    """The size of an effect at which its `strength` (d′ as a function of size) is `target`, by secants of logarithms.

    Raises ValueError if no size within 12 steps gives the target to `tolerance` (relative).
    """
    size, found = first, strength(first)
    slope = 1.0
    for _ in range(12):
        if not np.isfinite(found) or found <= 0.0:
            break
        if abs(found / target - 1.0) <= tolerance:
            return size
        last_size, last = size, found
        size = size * float(np.clip((target / found) ** (1.0 / slope), 1e-3, 1e3))
        found = strength(size)
        if size != last_size and found > 0.0 and found != last:
            slope = float(np.clip(np.log(found / last) / np.log(size / last_size), 0.2, 5.0))
    if np.isfinite(found) and found > 0.0 and abs(found / target - 1.0) <= tolerance:
        return size
    raise ValueError(f"d′ {found:.3g} at size {size:.3g}, wanted {target:g}")


def held_out_errors(
    recorded: Vector,
    simulated: Vector,
    effect: Vector,
    errors: Vector,
    noise: Noise,
    time_s: Vector,
    starts: Sequence[int],
) -> HeldOut:
    """Root mean square errors of a response in the held-out rows: as given, recalibrated, by the oracle, noise alone.

    The oracle adds the true course of the effect to the simulation and recalibrates; `errors` is recorded minus truth.
    All courses of shape (n_rows,), NaN in `recorded` = missing.
    """
    rows = fitted_starts(starts)
    kept = np.arange(starts[-1]) >= rows[-1]
    kept &= np.isfinite(recorded)

    def rest(model: Vector) -> Vector:
        free = recalibration(model, time_s, starts)
        difference = recorded - model
        seen = np.isfinite(difference)
        both = noise.whitened(np.column_stack([free, np.where(seen, difference, 0.0)])[: rows[-1]], rows)
        both = both[seen[: rows[-1]]]
        lengths = np.linalg.norm(both[:, :3], axis=0)
        lengths = np.where(lengths > 0.0, lengths, 1.0)
        coefficients = np.linalg.lstsq(both[:, :3] / lengths, both[:, 3], rcond=1e-10)[0] / lengths
        return np.asarray(difference - free @ coefficients)

    def rms(values: Vector) -> float:
        return float(np.sqrt(np.mean(values[kept] ** 2)))

    return HeldOut(rms(recorded - simulated), rms(rest(simulated)), rms(rest(simulated + effect)), rms(errors))


BELOW_NOISE_DB = -10.0
"""An effect is below the noise of a sample if its root mean square is at most this, against the noise [dB]."""
ERROR_RISE = 0.05
"""An effect is absorbed if it raises the error of the recalibrated simulation by at most this share."""
RARE_SHARE = 0.05
"""An effect is rare if at most this share of the time has more than a third of its largest value."""
LIKE_COSINE = 0.9
"""An effect is confounded if its cosine with a known course is at least this."""
RULED_OUT_SHARE = 0.2
"""An effect is ruled out by the loop in a response if that has at most this share of its d′²."""
RIVAL_COSINE = 0.85
"""Two effects are not told apart if their cosine is at least this, whitened and without what recalibration absorbs."""
FAITHFUL_D_PRIME = 2.0
"""A simulation is faithful if what it lacks besides the effect could be detected at most this well."""
OTHER_AXIS_SHARE, OPPOSED_CORRELATION, UNRELATED_CORRELATION = 0.01, -0.5, 0.6
"""Limits of the energy in other axes, of the correlation of two axes, and of that with any recorded channel."""


class Shown(NamedTuple):
    """Courses of a case without their noise, all runs one after the other, which begin at `starts`."""

    effect: Mapping[str, Vector]  #: In every response
    recorded: Mapping[str, Vector]
    simulated: Mapping[str, Vector]
    without: Mapping[str, Vector]  #: What the simulation says where there is no effect
    noise: Mapping[str, Noise]
    alone: Mapping[str, float]  #: d′ of every response by itself
    time_s: Vector
    starts: Sequence[int]

    @property
    def stop(self) -> int:
        """Number of the fitted rows."""
        return fitted_starts(self.starts)[-1]

    @property
    def channels(self) -> dict[str, Vector]:
        """What is recorded beside the responses."""
        return {name: course for name, course in self.recorded.items() if name not in self.effect}


Measure = Callable[[Shown], Concealment]
"""One way in which an effect is hidden, measured on a case."""


def spread_of(noise: Noise) -> float:
    """Standard deviation of a reading: noise, rounding and what every cycle repeats."""
    return float(np.sqrt(noise.sd**2 + noise.cycle_sd**2 + noise.step**2 / 12.0))


def below_noise(shown: Shown) -> Concealment:
    """Level of the effect against the noise of one sample in the fitted rows, highest of the responses [dB]."""
    levels = []
    for name, course in shown.effect.items():
        spread = spread_of(shown.noise[name])
        centred = course[: shown.stop] - course[: shown.stop].mean()
        levels.append(20.0 * np.log10(max(float(np.sqrt(np.mean(centred**2))), 1e-12 * spread) / spread))
    return Concealment("below the noise of a sample [dB]", max(levels), BELOW_NOISE_DB, max(levels) <= BELOW_NOISE_DB)


def absorbed(shown: Shown) -> Concealment:
    """By which share the effect raises the error of the recalibrated simulation in the fitted rows, most of all."""
    rows = fitted_starts(shown.starts)
    rises = []
    for name, course in shown.effect.items():
        free = recalibration(shown.without[name], shown.time_s, shown.starts)
        left = unabsorbed(course[:, None], free, Noise(spread_of(shown.noise[name])), rows)
        rises.append(float(np.sqrt(1.0 + np.sum(left**2) / rows[-1])) - 1.0)
    return Concealment("absorbed: rise of the error", max(rises), ERROR_RISE, max(rises) <= ERROR_RISE)


def rare(shown: Shown) -> Concealment:
    """Share of the fitted time in which a response has more than a third of the effect's largest value there."""
    courses = [np.abs(course[: shown.stop]) for course in shown.effect.values()]
    shares = [float(np.mean(course > course.max() / 3.0)) for course in courses if np.any(course)]
    share = min(shares, default=0.0)
    return Concealment("rare: share of the time", share, RARE_SHARE, share <= RARE_SHARE)


def like_known(response: str) -> Measure:
    """Largest cosine of the effect in a response with a known course (both from their mean), in the fitted rows."""

    def measured(shown: Shown) -> Concealment:
        known = {f"simulated {name}": course for name, course in shown.without.items()} | shown.channels
        course = shown.effect[response][: shown.stop] - shown.effect[response][: shown.stop].mean()
        best, which = 0.0, ""
        for name, other in known.items():
            part = other[: shown.stop] - other[: shown.stop].mean()
            size = float(np.linalg.norm(part) * np.linalg.norm(course))
            cosine = abs(float(part @ course)) / size if size > 0.0 else 0.0
            if cosine > best:
                best, which = cosine, name
        return Concealment(f"confounded with {which}: cosine", best, LIKE_COSINE, best >= LIKE_COSINE)

    return measured


def ruled_out(response: str) -> Measure:
    """Share of d′² that the effect has in a response."""

    def measured(shown: Shown) -> Concealment:
        total = sum(value**2 for value in shown.alone.values())
        share = shown.alone[response] ** 2 / total if total > 0.0 else 0.0
        kind = f"ruled out by the loop: share of d′² in {response}"
        return Concealment(kind, share, RULED_OUT_SHARE, share <= RULED_OUT_SHARE)

    return measured


def one_axis(axis: str) -> Measure:
    """Share of the effect's energy, in units of the noise, in the other responses."""

    def measured(shown: Shown) -> Concealment:
        courses = {name: course[: shown.stop] / shown.noise[name].sd for name, course in shown.effect.items()}
        energy = {name: float(np.sum(course**2)) for name, course in courses.items()}
        share = 1.0 - energy[axis] / sum(energy.values())
        return Concealment(f"only in {axis}: share elsewhere", share, OTHER_AXIS_SHARE, share <= OTHER_AXIS_SHARE)

    return measured


def opposed(shown: Shown) -> Concealment:
    """Correlation of the effect in Z with that in Y."""
    found = _correlation(shown.effect["Z"][: shown.stop], shown.effect["Y"][: shown.stop])
    return Concealment("opposed signs: correlation", found, OPPOSED_CORRELATION, found <= OPPOSED_CORRELATION)


def like_in_first_run(shown: Shown) -> Concealment:
    """Largest correlation of the effect, in the first run, with the simulation."""
    rows, known = slice(*shown.starts[:2]), shown.simulated.values()
    found = max(abs(_correlation(course[rows], other[rows])) for course in shown.effect.values() for other in known)
    kind = "confounded with the simulation in the first run: cosine"
    return Concealment(kind, found, LIKE_COSINE, found >= LIKE_COSINE)


def unrelated(shown: Shown) -> Concealment:
    """Largest correlation of the effect with any recorded channel in the fitted rows, offset and gain off both."""
    stop = shown.stop
    others = np.column_stack([course[:stop] for course in shown.channels.values()])
    found = 0.0
    for name, course in shown.effect.items():
        if np.any(course[:stop]):
            free = np.column_stack([np.ones(stop), shown.simulated[name][:stop]])
            both = np.column_stack([course[:stop], others])
            left = both - free @ np.linalg.lstsq(free, both, rcond=None)[0]
            sizes = np.linalg.norm(left, axis=0)
            seen = sizes[1:] > 1e-9 * np.linalg.norm(others, axis=0)
            found = max(found, float(np.max(np.abs(left[:, 0] @ left[:, 1:])[seen] / (sizes[0] * sizes[1:][seen]))))
    return Concealment(
        "unrelated to channels: correlation", found, UNRELATED_CORRELATION, found <= UNRELATED_CORRELATION
    )


def seldom(channel: str, above: float = 0.0) -> Measure:
    """Share of the fitted time in which a recorded channel is above this share of its largest value."""

    def measured(shown: Shown) -> Concealment:
        fitted = shown.recorded[channel][: shown.stop]
        share = float(np.mean(fitted > above * float(fitted.max())))
        return Concealment(f"rare: share of the time with {channel}", share, RARE_SHARE, 0.0 < share <= RARE_SHARE)

    return measured


def cold_spells(shown: Shown) -> Concealment:
    """Share of the fitted time in which the hall is 2 K below its median of the run."""
    halls = [shown.recorded["Tamb"][a:b] for a, b in pairwise(fitted_starts(shown.starts))]
    share = float(np.mean(np.concatenate([hall < np.median(hall) - 2.0 for hall in halls])))
    return Concealment("rare: share of the time with a cold hall", share, RARE_SHARE, 0.0 < share <= RARE_SHARE)


def _correlation(first: Vector, second: Vector) -> float:
    a, b = first - first.mean(), second - second.mean()
    size = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(a @ b) / size if size > 0.0 else 0.0


def like_rival(cosine: float) -> Concealment:
    """Cosine of the effect with another effect of the same strength, whitened, without what recalibration absorbs."""
    return Concealment("like another effect: cosine", cosine, RIVAL_COSINE, cosine >= RIVAL_COSINE)


def faithful(d_prime: float) -> Concealment:
    """How well an oracle could detect what the simulation lacks besides the effect."""
    return Concealment("simulation true but for the effect: d′", d_prime, FAITHFUL_D_PRIME, d_prime <= FAITHFUL_D_PRIME)


_WAYS: Mapping[str, Measure] = {"small": below_noise, "absorbed": absorbed, "rare": rare}
"""Those that a plan says by a word."""


def concealed(how: str | Measure, shown: Shown) -> Concealment:
    """How well an effect is hidden in a way that a plan says."""
    return (_WAYS[how] if isinstance(how, str) else how)(shown)


def stacked(parts: Sequence[Vector]) -> tuple[Vector, tuple[int, ...]]:
    """Courses of runs one after the other, with the first row of every run and the number of rows."""
    starts = (0, *np.cumsum([len(part) for part in parts]).tolist())
    return np.concatenate(parts), starts


def split(values: NDArray[Any], starts: Sequence[int]) -> list[NDArray[Any]]:
    """Stacked rows as one course per run."""
    return [values[a:b] for a, b in pairwise(starts)]
