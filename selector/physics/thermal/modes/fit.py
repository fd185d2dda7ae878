"""The fit of thermal modes: what enters linearly is solved for, time constants, exponents and film are searched."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal

import numpy as np
from numba import njit
from scipy.optimize import least_squares

from selector.physics.thermal.modes.modes import ModalModel, SpeedLaw
from selector.physics.thermal.modes.thermal_test import ModeData
from selector.types import Mask, Vector

Law = Literal["levels", "power", "powers", "turning", "turning-powers", "turning-squares", "mode-powers"]
Film = Literal["none", "growing"]
#: Gains are drawn to 0 as if each were known to be 0 ± the displacement divided by this: little beside what thousands
#: of samples say, but it keeps modes that nearly cancel from growing enormous, for which unseen courses would pay.
#: Modes that a film couples cancel more easily.
SHRINKAGE: dict[Film, float] = {"none": 2.0, "growing": 20.0}
#: Heat of bearings and drives grows with n^1 to n^1.5: where tests say nothing, exponents stay near this (±).
USUAL_EXPONENT = 1.2, 0.5
#: Forced convection grows with n^0.5 (laminar) to n^0.8 (turbulent), windage up to n^1 (±).
USUAL_FILM_EXPONENT = 0.8, 0.01
STEP = 1e-4  #: Step of numerical derivatives in logarithms of time constants and in exponents.


@dataclass(frozen=True)
class ModeSpec:
    """What is fitted."""

    n_modes: int  #: Number of modes
    #: {"levels", "power", "powers", "turning", "turning-powers", "turning-squares", "mode-powers"}: Gains: free at
    #: every tested level; c·n^p with one p; c·n^p + d·n^(p + 1/2); c·n^p + d·[n > 0]; c·n + d·n^1.5 + e·[n > 0];
    #: c·n + d·n² + e·[n > 0]; c_k·n^(p_k) with a p for every mode
    law_kind: Law = "levels"
    #: {"none", "growing"}: Convection that does not depend on the speed, or one film that grows with it and couples the
    #: modes
    film: Film = "none"
    level_exponent: float = 1.2  #: Exponent between the levels of the first law
    with_hall: bool = False  #: Whether the hall temperature drives the same modes
    free_starts: tuple[int, ...] = ()  #: Runs that do not begin at rest and cold

    @property
    def n_powers(self) -> int:
        """How many exponents are searched."""
        searched_powers = {"power": 1, "powers": 1, "turning": 1, "mode-powers": self.n_modes}
        return searched_powers.get(self.law_kind, 0)

    @property
    def n_films(self) -> int:
        """How many parameters of the film are searched: a vector, the drive of the modes, and the exponent."""
        return 2 * self.n_modes if self.film == "growing" else 0

    @property
    def n_searched(self) -> int:
        """How many parameters are searched."""
        return self.n_modes + self.n_powers + self.n_films

    def speed_law(self, theta: Vector, data: ModeData) -> SpeedLaw:
        """The law with the exponents among the searched parameters."""
        powers = theta[self.n_modes : self.n_modes + self.n_powers]
        if self.law_kind == "levels":
            return SpeedLaw((self.level_exponent,), data.fastest_rpm, data.levels_rpm)
        if self.law_kind == "powers":
            return SpeedLaw((float(powers[0]), float(powers[0]) + 0.5), data.fastest_rpm)
        if self.law_kind == "turning":
            return SpeedLaw((0.0, float(powers[0])), data.fastest_rpm)
        if self.law_kind == "turning-powers":
            return SpeedLaw((0.0, 1.0, 1.5), data.fastest_rpm)
        if self.law_kind == "turning-squares":
            return SpeedLaw((0.0, 1.0, 2.0), data.fastest_rpm)
        return SpeedLaw(tuple(float(p) for p in powers), data.fastest_rpm)

    def films(self, theta: Vector) -> tuple[Vector, Vector, float]:
        """Film matrix V [1/s], symmetric; drive of every mode (the first is 1); exponent of the speed.

        Orthonormal modes of a machine obey x' = −(1/τ + s(n)·V)·x + drive·q(n)/τ with V of as many ranks as there are
        films; this is one.
        """
        modes = self.n_modes
        if self.film == "none":
            return np.zeros((modes, modes)), np.ones(modes), USUAL_FILM_EXPONENT[0]
        part = theta[modes + self.n_powers :]
        vector = part[:modes] * np.exp(-0.5 * theta[:modes])
        return np.outer(vector, vector), np.exp(np.r_[0.0, part[modes : 2 * modes - 1]]), float(part[-1])


@dataclass(frozen=True)
class Solution:
    """Linear part of a fit at given searched parameters."""

    #: (n_columns, n_responses): Mode by mode: the terms of the law, then the hall temperature [µm, µm/K]
    coefficients: Vector
    #: (n_blocks, n_responses): Weighted residuals: of variance 1 where the noise is what it was taken to be
    residual: Vector
    left_out_um: Vector  #: (n_blocks, n_responses): Residuals [µm], all blocks, also those without weight
    shrinkage: Vector  #: (n_responses,): What coefficients are multiplied with to be counted as residuals


@lru_cache(maxsize=4)
def _of_speeds(data: ModeData, law: SpeedLaw, exponent: float) -> tuple[Vector, Vector]:
    """Terms of the law and growth of the film in every block. The last are kept: most steps move no exponent."""
    share = np.where(data.speed_rpm > 0, (data.speed_rpm / data.fastest_rpm) ** exponent, 0.0)
    return law.terms(data.speed_rpm), share


def columns(spec: ModeSpec, data: ModeData, theta: Vector) -> tuple[Vector, Vector]:
    """Columns of the gains (n_blocks, n_modes, n_terms [+ 1]), and what is left of a start (n_blocks, n_modes)."""
    modes = spec.n_modes
    film, drive, exponent = spec.films(theta)
    inputs, share = _of_speeds(data, spec.speed_law(theta, data), exponent)
    rate = np.exp(-theta[:modes])
    drives = np.eye(modes) if spec.law_kind == "mode-powers" else np.tile(drive, (inputs.shape[1], 1))
    if spec.with_hall and data.ambient_k is not None:
        halls = np.tile(drive, (data.ambient_k.shape[1], 1))
        inputs, drives = np.column_stack([inputs, data.ambient_k]), np.vstack([drives, halls])
    return _filtered(
        data.before_s, data.after_s, data.speed_rpm, share, rate, film, np.ascontiguousarray(drives * rate),
        np.ascontiguousarray(inputs), data.first, 0.01 * data.fastest_rpm,
    )  # fmt: skip


def solved(spec: ModeSpec, data: ModeData, theta: Vector, weights: Vector) -> Solution:
    """The best gains, zeros and starts for these searched parameters; weights (n_blocks, n_responses)."""
    states, left = columns(spec, data, theta)
    design = states.reshape(len(states), -1)
    coefficients = np.zeros((design.shape[1], weights.shape[1]))
    left_out, shrinkage = np.zeros(weights.shape), np.zeros(weights.shape[1])
    for alike, scale, common in _alike(spec.film, data, weights.tobytes()):
        w = weights[:, alike[0]]
        both = without_nuisances(spec, data, left, w, np.column_stack([design, data.displacement_um[:, alike]]))
        plain, aim = both[:, : design.shape[1]], both[:, design.shape[1] :]
        coefficients[:, alike] = found = _best(plain * w[:, None], aim * w[:, None], common)
        left_out[:, alike] = aim - plain @ found
        shrinkage[alike] = common * scale
    return Solution(coefficients, left_out * weights, left_out, shrinkage)


def without_nuisances(spec: ModeSpec, data: ModeData, left: Vector, w: Vector, values: Vector) -> Vector:
    """Columns less what the zero (and start, if it is free) of every run describes, with weights w (n_blocks,)."""
    begins = [begin for begin, _ in data.bounds]
    lengths = [end - begin for begin, end in data.bounds]
    square = (w**2)[:, None]
    mean = np.add.reduceat(values * square, begins) / np.maximum(np.add.reduceat(square, begins), 1e-300)
    values = values - np.repeat(mean, lengths, axis=0)
    for run in spec.free_starts:
        begin, end = data.bounds[run]
        nuisance = np.column_stack([np.ones(end - begin), left[begin:end]])
        values[begin:end] -= nuisance @ _best(nuisance * w[begin:end, None], values[begin:end] * w[begin:end, None])
    return values


def _best(design: Vector, aim: Vector, shrinkage: float = 0.0) -> Vector:
    """Least squares by QR, with as much ridge as columns without any weight need to get 0."""
    size = np.sqrt((design**2).sum(axis=0))
    size[size == 0.0] = 1.0
    q, r = np.linalg.qr(np.vstack([design / size, np.diag(1e-9 + shrinkage / size)]))
    full = q[: len(design)].T @ aim
    return np.linalg.solve(r, full) / size[:, None]


@lru_cache(maxsize=2)  # a search asks for the same at every step
def _alike(film: Film, data: ModeData, weights: bytes) -> list[tuple[list[int], Vector, float]]:
    """Responses whose weights are the same up to a factor can be solved for together: groups of them.

    With the weights of each relative to the first one, and the shrinkage that they share.
    """
    of = np.frombuffer(weights).reshape(len(data.displacement_um), -1)
    groups: list[list[int]] = []
    for r in range(len(of.T)):
        mine = of[:, r] / max(of[:, r].max(), 1e-300)
        for group in groups:
            other = of[:, group[0]] / max(of[:, group[0]].max(), 1e-300)
            if np.allclose(mine, other, rtol=1e-9, atol=0.0):
                group.append(r)
                break
        else:
            groups.append([r])
    found = []
    for group in groups:
        scale = np.array([of[:, r].max() for r in group]) / max(float(of[:, group[0]].max()), 1e-300)
        peaks = np.ptp(data.displacement_um[:, group], axis=0)
        found.append((group, scale, SHRINKAGE[film] / max(float(np.median(peaks * scale)), 1e-9)))
    return found


@dataclass(frozen=True)
class Fit:
    """A fit and what it was fitted with."""

    #: spec, theta, weights and solution: What was asked for; the searched parameters; weights; the linear part there
    spec: ModeSpec
    theta: Vector
    weights: Vector
    solution: Solution

    @property
    def cost(self) -> float:
        """Weighted sum of squares, shrinkage of the gains included."""
        shrunk = self.solution.shrinkage * self.solution.coefficients
        return float((self.solution.residual**2).sum() + (shrunk**2).sum())

    @property
    def tau_s(self) -> Vector:
        """Time constants [s]."""
        return np.exp(self.theta[: self.spec.n_modes])

    def model(self, data: ModeData, responses: Sequence[str]) -> ModalModel:
        """The fit as a model."""
        modes = self.spec.n_modes
        law = self.spec.speed_law(self.theta, data)
        film, drive, exponent = self.spec.films(self.theta)
        per_mode = self.solution.coefficients.reshape(modes, -1, len(responses))
        if self.spec.law_kind == "mode-powers":
            gains = np.stack([np.where(np.arange(modes)[:, None] == j, per_mode[:, j], 0.0) for j in range(modes)])
        else:
            gains = per_mode[:, : law.size].transpose(1, 0, 2) * drive[:, None]
        order = np.argsort(self.tau_s)
        growth = self.tau_s[:, None] * film * drive / drive[:, None]
        return ModalModel(
            tuple(responses), self.tau_s[order], gains[:, order], law, data.fastest_rpm, growth[np.ix_(order, order)],
            exponent,
        )  # fmt: skip


def fit_at(spec: ModeSpec, data: ModeData, theta: Vector, weights: Vector) -> Fit:
    """The fit with these searched parameters."""
    return Fit(spec, theta, weights, solved(spec, data, theta, weights))


def block_weights(data: ModeData, fit: Fit | None = None) -> Vector:
    """Reciprocal standard deviation of every block, shape (n_blocks, n_responses); 0 where nothing was read.

    At first σ²/samples. With a fit, the part of its residuals that more samples do not average away (slow wander,
    what the modes leave out) is added, the same share for all responses, so that long blocks do not outvote short ones.
    """
    samples = np.maximum(data.counts, 1.0)
    there = data.counts > 0
    if fit is None:
        return np.where(there, np.sqrt(samples) / data.noise_um, 0.0)
    squares = (fit.solution.left_out_um / data.noise_um) ** 2
    share, low, high = 0.0, 0.0, 1e6
    for _ in range(60):
        if float(np.mean((squares / (1.0 / samples + share))[there])) > 1.0:
            low = share
        else:
            high = share
        share = 0.5 * (low + high)
    scale = np.sqrt(
        [np.mean((squares[:, r] / (1.0 / samples[:, r] + low))[there[:, r]]) for r in range(there.shape[1])]
    )
    return np.where(there, 1.0 / (data.noise_um * scale * np.sqrt(1.0 / samples + low)), 0.0)


#: Neighbouring time constants in a fit have at least this ratio: nearer ones are one mode with enormous gains. A film
#: lets modes imitate each other, so that only modes further apart predict unseen courses.
CLOSEST = {"none": 1.4, "growing": 2.2}
#: Longest time constant in lengths of the longest run: of a slower mode the tests show a straight line.
LONGEST_TAU = 2.0
#: Losses grow at least nearly in proportion to the speed. A smaller exponent only imitates heat that does not depend on
#: the speed, and is wrong below the slowest tested speed.
LEAST_EXPONENT, LARGEST_EXPONENT = 0.8, 2.5
#: Bound of the film's vector (its square is the growth of a mode's rate) and of the logarithms of the drives.
STRONGEST = 2.5


def limits(spec: ModeSpec, data: ModeData) -> tuple[Vector, Vector]:
    """Bounds of the searched parameters."""
    modes, films = spec.n_modes, spec.n_films
    low = np.r_[
        np.full(modes, np.log(data.period_s)), np.full(spec.n_powers, LEAST_EXPONENT), np.full(films, -STRONGEST)
    ]
    high = np.r_[
        np.full(modes, np.log(LONGEST_TAU * data.longest_s)),
        np.full(spec.n_powers, LARGEST_EXPONENT),
        np.full(films, STRONGEST),
    ]
    if films:
        low[-1], high[-1] = 0.2, 2.0
    return low, high


def searched(
    spec: ModeSpec, data: ModeData, start: Vector, weights: Vector, *, held: int | None = None, max_steps: int = 40
) -> Fit:
    """The fit that is reached from this start; one parameter may be held."""
    low, high = limits(spec, data)
    start = np.clip(start, low + 1e-6, high - 1e-6)
    free = np.array([i for i in range(len(start)) if i != held])
    if not len(free):
        return fit_at(spec, data, start, weights)

    def at(part: Vector) -> Vector:
        theta = start.copy()
        theta[free] = part
        return theta

    @lru_cache(maxsize=1)  # a derivative is asked for where the residual was
    def solution(theta: bytes) -> Solution:
        return solved(spec, data, np.frombuffer(theta), weights)

    def residual(part: Vector) -> Vector:
        theta = at(part)
        found = solution(theta.tobytes())
        shrunk = -found.shrinkage * found.coefficients
        return np.r_[found.residual.ravel(), shrunk.ravel(), expectations(spec, theta)]

    def derivative(part: Vector) -> Vector:
        theta = at(part)
        known = slopes(lambda moved: expectations(spec, moved), theta, free)
        slope = derivative_of(spec, data, theta, weights, free, solution(theta.tobytes()).coefficients)
        return np.vstack([slope, np.column_stack(known)])

    result = least_squares(
        residual, start[free], jac=derivative, bounds=(low[free], high[free]), x_scale=1.0, ftol=1e-6, xtol=1e-5,
        gtol=1e-9, max_nfev=max_steps,
    )  # fmt: skip
    return Fit(spec, at(result.x), weights, solution(at(result.x).tobytes()))


def slopes(function: Callable[[Vector], Vector], theta: Vector, free: Iterable[int]) -> list[Vector]:
    """Derivatives of a function of the searched parameters by some of them, by forward differences."""
    here, found = function(theta), []
    for i in free:
        moved = theta.copy()
        moved[i] += STEP
        found.append((function(moved) - here) / STEP)
    return found


def expectations(spec: ModeSpec, theta: Vector) -> Vector:
    """What is known without the tests: modes are apart, exponents near the usual ones."""
    modes, powers = spec.n_modes, spec.n_powers
    gap = np.diff(np.sort(theta[:modes])) - np.log(CLOSEST[spec.film])
    parts = [1e3 * np.minimum(gap, 0.0), (theta[modes : modes + powers] - USUAL_EXPONENT[0]) / USUAL_EXPONENT[1]]
    if spec.n_films:
        parts.append((theta[-1:] - USUAL_FILM_EXPONENT[0]) / USUAL_FILM_EXPONENT[1])
        parts.append(theta[modes + powers : -1])
    return np.concatenate(parts)


def grown(fit: Fit | None, spec: ModeSpec, data: ModeData, weights: Vector) -> Fit:
    """A fit with one mode more than this one (None: the first): tried at many places, searched from the best two."""
    low, high = limits(ModeSpec(1), data)
    places = np.linspace(low[0] + np.log(3.0), high[0] - np.log(4.0), 14)
    have = np.empty(0) if fit is None else fit.theta[: fit.spec.n_modes]
    tail = np.full(spec.n_powers, USUAL_EXPONENT[0])
    starts = [
        np.r_[np.sort(np.r_[have, place]), tail]
        for place in places
        if not len(have) or np.abs(have - place).min() > np.log(1.3)
    ]
    if not starts:  # short runs have room for few time constants
        widest = max(places, key=lambda place: float(np.abs(have - place).min()))
        starts = [np.r_[np.sort(np.r_[have, widest]), tail]]
    costs = [fit_at(spec, data, theta, weights).cost for theta in starts]
    best = [starts[i] for i in np.argsort(costs)[:2]]
    return min((searched(spec, data, theta, weights) for theta in best), key=lambda one: one.cost)


def film_starts(theta: Vector, modes: int) -> list[Vector]:
    """Films beside these time constants and powers: one that acts on all modes alike, one on every other."""
    return [
        np.r_[theta, 0.7 * np.resize(signs, modes), np.zeros(modes - 1), USUAL_FILM_EXPONENT[0]]
        for signs in ([1.0, 1.0], [1.0, -1.0])[: 2 if modes > 1 else 1]
    ]


def with_film(fit: Fit, data: ModeData, smaller: Fit | None = None) -> Fit:
    """The fit with a film that grows with the speed: from these modes, a film of one mode less, and an even spread."""
    spec = replace(fit.spec, film="growing")
    modes, powers = spec.n_modes, fit.theta[fit.spec.n_modes : fit.spec.n_modes + fit.spec.n_powers]
    starts = film_starts(np.r_[np.sort(fit.theta[:modes]), powers], modes)
    if smaller is not None:
        starts += _one_more(smaller, spec, data)
        spread = np.linspace(np.log(data.longest_s / 80.0), np.log(data.longest_s / 1.7), modes)
        starts.append(film_starts(np.r_[spread, powers], modes)[-1])
    found = [searched(spec, data, theta, fit.weights, max_steps=25) for theta in starts]
    return min(found, key=lambda one: one.cost)


def _one_more(fit: Fit, spec: ModeSpec, data: ModeData) -> list[Vector]:
    """The best places for one mode more, with the film's other parameters as they are."""
    modes, low, high = fit.spec.n_modes, *limits(ModeSpec(1), data)
    tail = fit.theta[modes:]
    powers, vector, drive = np.split(tail[:-1], [fit.spec.n_powers, fit.spec.n_powers + modes])
    starts = []
    for place in np.linspace(low[0] + np.log(3.0), high[0] - np.log(4.0), 14):
        if np.abs(fit.theta[:modes] - place).min() > np.log(1.3):
            # the new mode stands last, so that the drive of the first one stays the unit
            taus = np.r_[fit.theta[:modes], place]
            starts.append(np.r_[taus, powers, vector, 0.2, drive, 0.0, tail[-1]])
    costs = [fit_at(spec, data, theta, fit.weights).cost for theta in starts]
    return [starts[i] for i in np.argsort(costs)[:1]]


def derivative_of(
    spec: ModeSpec, data: ModeData, theta: Vector, weights: Vector, free: Vector, solution: Vector
) -> Vector:
    """Derivative of weighted residuals and shrunk coefficients, (n_rows·n_responses, n_free), with gains that follow.

    Kaufman's form of variable projection: the part of the derivative that the columns cannot describe. `solution` are
    the coefficients at `theta`.
    """
    states, left = columns(spec, data, theta)
    design = states.reshape(len(states), -1)
    changes = []
    for i in free:
        moved = theta.copy()
        moved[i] += STEP
        changes.append((columns(spec, data, moved)[0].reshape(len(states), -1) - design) @ solution / STEP)
    out = np.zeros((len(states) + design.shape[1], weights.shape[1], len(free)))
    for alike, scale, common in _alike(spec.film, data, weights.tobytes()):
        w = weights[:, alike[0]]
        moves = np.concatenate([change[:, alike] for change in changes], axis=1)
        both = without_nuisances(spec, data, left, w, np.column_stack([design, moves])) * w[:, None]
        extended = np.vstack([both[:, : design.shape[1]], common * np.eye(design.shape[1])])
        basis = np.linalg.qr(extended)[0]
        part = np.vstack([both[:, design.shape[1] :], np.zeros((design.shape[1], moves.shape[1]))])
        part = part - basis @ (basis.T @ part)
        out[:, alike] = -part.reshape(len(out), len(free), len(alike)).transpose(0, 2, 1) * scale[:, None]
    return out.reshape(-1, len(free))


def _filtered_loop(
    before_s: Vector,
    after_s: Vector,
    speed: Vector,
    share: Vector,
    rate: Vector,
    film: Vector,
    drive: Vector,
    inputs: Vector,
    first: Mask,
    same_rpm: float,
) -> tuple[Vector, Vector]:
    """Modes x_j' = −(diag(rate) + share·film)·x_j + drive_j·input_j, from rest, at the mean time of every block.

    Shapes: before_s, after_s, speed, share, first (n,), rate (n_modes,) [1/s], film (n_modes, n_modes) symmetric [1/s],
    drive (n_terms, n_modes) [1/s], inputs (n, n_terms); `first` marks the blocks with which a run begins; speeds that
    differ by less than same_rpm share their eigenvectors. Returns the states (n, n_modes, n_terms), and the share
    (n, n_modes) that is left of a start that is not at rest (coupling left out).
    """
    n, modes, terms = len(speed), len(rate), inputs.shape[1]
    out = np.empty((n, modes, terms))
    left = np.empty((n, modes))
    remaining = np.ones(modes)
    # of the eigenvectors q: the state, what a unit of each input leads to in the end, and states at mean times
    q, w, z = np.eye(modes), rate.copy(), np.zeros((modes, terms))
    aims, mean = (drive / rate).T.copy(), np.zeros((modes, terms))
    kept, rest, kept_alone, rest_alone = np.ones((4, modes))
    coupled = np.abs(film).max() > 0.0
    last = -1.0
    for i in range(n):
        if first[i]:
            z[:] = 0.0
            remaining[:] = 1.0
            last = -1.0
        if coupled and (last < 0.0 or abs(speed[i] - last) > same_rpm):
            last = speed[i]
            matrix = share[i] * film
            for k in range(modes):
                matrix[k, k] += rate[k]
            before = q
            w, q = np.linalg.eigh(matrix)
            for j in range(terms):
                for k in range(modes):
                    mean[k, j] = 0.0
                    for m in range(modes):
                        mean[k, j] += before[k, m] * z[m, j]
                for k in range(modes):
                    z[k, j] = aims[k, j] = 0.0
                    for m in range(modes):
                        z[k, j] += q[m, k] * mean[m, j]
                        aims[k, j] += q[m, k] * drive[j, m] / w[k]
        # most blocks are as long as the one before, at the same speed
        if first[i] or before_s[i] != before_s[i - 1] or after_s[i] != after_s[i - 1] or share[i] != share[i - 1]:
            for k in range(modes):
                own = rate[k] + share[i] * film[k, k]
                kept[k], rest[k] = np.exp(-before_s[i] * w[k]), np.exp(-after_s[i] * w[k])
                kept_alone[k], rest_alone[k] = np.exp(-before_s[i] * own), np.exp(-after_s[i] * own)
        for k in range(modes):
            left[i, k] = remaining[k] * kept_alone[k]
            remaining[k] = left[i, k] * rest_alone[k]
            for j in range(terms):
                aim = aims[k, j] * inputs[i, j]
                mean[k, j] = aim + (z[k, j] - aim) * kept[k]
                z[k, j] = aim + (mean[k, j] - aim) * rest[k]
        for k in range(modes):
            for j in range(terms):
                out[i, k, j] = mean[k, j]
                if coupled:
                    out[i, k, j] = 0.0
                    for m in range(modes):
                        out[i, k, j] += q[k, m] * mean[m, j]
    return out, left


_filtered: Callable[..., tuple[Vector, Vector]] = njit(cache=True)(_filtered_loop)
