"""Thermal modes that speed and hall drive, upon a drift that nobody measured: fit, left-out tests, what to expect.

For recordings in which the hall moves the machine, and for long ones in which it never begins cold.

The model of one response, y = Φ·c + w(t) + v(t) + e, stands in docs/explanation/thermal-modes.md; it is fitted by
maximum marginal likelihood (Rasmussen, Williams, Gaussian Processes for Machine Learning, 2006, eq. 5.8).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np
from numba import njit
from scipy.optimize import Bounds, minimize

from selector.physics.thermal.modes.fit import USUAL_EXPONENT, Law, ModeSpec, columns, expectations, film_starts, limits
from selector.physics.thermal.modes.thermal_test import ModeData
from selector.recording import restarts
from selector.types import Indices, Mask, Vector

MOST_MODES, MOST_WITH_FILM = 6, 4
#: A mixture of two sources; what runs at any speed (pumps, axes), dry and viscous friction.
LAWS: tuple[Law, ...] = ("powers", "turning-squares")
LOOSE = 1.2  #: A standard error of log τ above this is no bound: the interval spans more than a factor of 100.
_STEP = 0.02
_FLAT = 3e-8  #: Share of the loss: what gains less is the last step. Of some thousands it is a ten-thousandth.
COST = 2.0  #: What a searched parameter has to add to the logarithm of the likelihood: Akaike's 1, and once more.
#: A likelihood that is flatter than this in a logarithm bounds nothing: half of what is expected within e².
FLATTEST = 0.25
APART = 2.2  #: Neighbouring time constants have at least this ratio: a walk and a ripple leave no more to be told.
FURTHEST = 5.0  #: Spreads stay within so many of the widths that are expected of them.
#: What is left of the square of an error, at least, when the noise of the gauge is taken off.
LEAST_SHARE = 0.25
PRIOR_TESTS = 2.0  #: As many tests as expected are counted to those that were left out.


@dataclass(frozen=True)
class DrivenFit:
    """A fit, with what is known of its coefficients."""

    spec: ModeSpec
    theta: Vector  #: Logarithms of time constants [s], then exponents
    #: (n_responses, 7): Logarithms of the standard deviations of gains [µm], per kelvin [µm/K], starts [µm],
    #: of the walk [µm/√s], the rows and the ripple [µm]; and of the time in which this forgets itself [s]
    spreads: Vector
    coefficients: Vector  #: (n_columns, n_responses): Most likely ones
    covariance: Vector  #: (n_responses, n_columns, n_columns): Their covariance
    loss: float  #: Negative logarithm of the marginal likelihood, with what is expected of exponents

    @property
    def tau_s(self) -> Vector:
        """Time constants [s]."""
        return np.exp(self.theta[: self.spec.n_modes])


def design(spec: ModeSpec, data: ModeData, theta: Vector) -> tuple[Vector, Indices]:
    """Columns (n_blocks, n_columns), and of which kind each is: 0 speed, 1 hall, 2 start of a run."""
    states, left = columns(spec, data, theta)
    halls = data.ambient_k.shape[1] if spec.with_hall and data.ambient_k is not None else 0
    terms = states.shape[2] - halls
    starts = []
    for begin, end in data.bounds:
        own = np.zeros_like(left)
        own[begin:end] = left[begin:end]
        starts.append(own)
    parts = [states[:, :, :terms].reshape(len(states), -1), states[:, :, terms:].reshape(len(states), -1), *starts]
    kinds = np.repeat([0, 1, *[2] * len(starts)], [part.shape[1] for part in parts])
    return np.hstack(parts), kinds


def _noise_um2(data: ModeData, there: Mask) -> list[Vector]:
    """Variance of the mean reading of every block, response by response; infinite where none may be seen."""
    return [
        np.where(there & (count > 0), noise_um**2 / np.maximum(count, 1.0), np.inf)
        for noise_um, count in zip(data.noise_um, data.counts.T, strict=True)
    ]


def _loss(
    values: Vector, kinds: Indices, spreads: Vector, data: ModeData, noise_um2: Vector
) -> tuple[float, Vector, Vector]:
    """`_evidence` of a response; `values` (n_blocks, n_columns + 1) with the response last, `noise_um2` as above."""
    size, square = np.exp(spreads), np.exp(2.0 * spreads)
    rows, logs = _whitened(values, data.middle_s, square[4] + noise_um2, square[3], square[5], size[6], data.first)
    return _evidence(rows, logs, size[kinds])


def _limits(spec: ModeSpec, data: ModeData) -> tuple[Vector, Vector]:
    """Bounds of the searched parameters; what is slower than half of a run is the walk's."""
    low, high = limits(spec, data)
    high[: spec.n_modes] = np.log(data.longest_s / 2.0)
    return low, high


def _spreads(values: Vector, kinds: Indices, data: ModeData, r: int, noise_um2: Vector, start: Vector) -> Vector:
    """The spreads of one response that make its readings most likely; each is expected within factors of e² or so."""
    span = max(float(np.ptp(data.displacement_um[np.isfinite(noise_um2), r])), 1e-6)
    usual = np.log([span, 0.3 * span, 0.3 * span, 0.003 * span / 60.0, 0.01 * span, 0.03 * span, 1200.0])
    width = np.array([1.5, 1.5, 1.5, 1.5, 2.0, 1.5, 1.0])

    def lost(spreads: Vector) -> float:
        far = (spreads - usual) / width
        return _loss(values, kinds, spreads, data, noise_um2)[0] + 0.5 * float(far @ far)

    low, high = usual - FURTHEST * width, usual + FURTHEST * width
    begin = usual if not np.isfinite(start).all() else np.clip(start, low, high)
    return np.asarray(minimize(lost, begin, bounds=Bounds(low, high), options={"maxiter": 60, "ftol": _FLAT}).x)


def _lost(spec: ModeSpec, data: ModeData, theta: Vector, spreads: Vector, noise_um2: list[Vector]) -> float:
    """The loss of a fit with these time constants, exponents and spreads."""
    phi, kinds = design(spec, data, theta)
    # what is known without the tests: as for other modes, and that they are further apart
    gap = np.diff(np.sort(theta[: spec.n_modes])) - np.log(APART)
    far = np.concatenate([expectations(spec, theta), 30.0 * np.minimum(gap, 0.0)])
    rows = (np.column_stack([phi, course]) for course in data.displacement_um.T)
    losses = (_loss(values, kinds, spreads[r], data, noise_um2[r])[0] for r, values in enumerate(rows))
    return sum(losses) + 0.5 * float(far @ far)


def fitted(
    spec: ModeSpec,
    data: ModeData,
    theta: Vector,
    *,
    there: Mask | None = None,
    spreads: Vector | None = None,
    rounds: int = 3,
) -> DrivenFit:
    """Time constants, exponents and spreads in turn, from these on; `there` (n_blocks,) are rows that may be seen."""
    seen = np.ones(len(data.speed_rpm), np.bool_) if there is None else there
    responses, noise_um2 = range(data.displacement_um.shape[1]), _noise_um2(data, seen)
    known = np.full((len(responses), 7), np.nan) if spreads is None else spreads.copy()
    low, high = _limits(spec, data)

    def filled(at: Vector) -> tuple[list[Vector], Indices]:
        phi, kinds = design(spec, data, at)
        return [np.column_stack([phi, data.displacement_um[:, r]]) for r in responses], kinds

    theta = np.clip(theta, low + 1e-6, high - 1e-6)
    for _ in range(rounds):
        values, kinds = filled(theta)
        known = np.array([_spreads(values[r], kinds, data, r, noise_um2[r], known[r]) for r in responses])
        lost = partial(_lost, spec, data, spreads=known, noise_um2=noise_um2)
        theta = minimize(lost, theta, bounds=Bounds(low, high), options={"maxiter": 25, "eps": 1e-4, "ftol": _FLAT}).x
    values, kinds = filled(theta)
    coefficients, covariance = [], []
    for r in responses:
        _, root, half = _loss(values[r], kinds, known[r], data, noise_um2[r])
        inverse = np.linalg.inv(root) * np.exp(known[r][kinds])
        coefficients.append(inverse.T @ half)
        covariance.append(inverse.T @ inverse)
    loss = _lost(spec, data, theta, known, noise_um2)
    return DrivenFit(spec, theta, known, np.column_stack(coefficients), np.array(covariance), loss)


def chosen(data: ModeData, *, with_hall: bool) -> tuple[DrivenFit, ...]:
    """The best fit, and what else might be true: another law of the speed, convection that grows or does not.

    The law is taken with three modes, then the number of modes with that law, then whether convection grows. The
    likelihood decides, less `COST` for every parameter that is searched.
    """
    laws = LAWS if len(data.levels_rpm) > 2 else LAWS[:1]
    of_spec = cache(partial(_of_size, data=data))
    plain, *other = sorted((of_spec(ModeSpec(3, law, with_hall=with_hall)) for law in laws), key=worth)
    plain = _climbed(plain, lambda size: of_spec(replace(plain.spec, n_modes=size)), MOST_MODES)

    def with_film(size: int) -> DrivenFit:
        fit, spec = of_spec(replace(plain.spec, n_modes=size)), replace(plain.spec, n_modes=size, film="growing")
        # from films that act on all modes alike or on every other
        starts = film_starts(fit.theta, size)
        return min((fitted(spec, data, start, spreads=fit.spreads) for start in starts), key=lambda one: one.loss)

    film = _climbed(with_film(min(plain.spec.n_modes, MOST_WITH_FILM)), with_film, MOST_WITH_FILM)
    return tuple(sorted((plain, film, *other), key=worth))


def _climbed(best: DrivenFit, of_size: Callable[[int], DrivenFit], most: int) -> DrivenFit:
    """The fit with fewer or more modes than this one, as long as each is better than the one before."""
    for direction in (-1, 1):
        while 0 < (size := best.spec.n_modes + direction) <= most:
            other = of_size(size)
            if worth(other) >= worth(best):
                break
            best = other
    return best


def worth(fit: DrivenFit) -> float:
    """Negative logarithm of the marginal likelihood, with what its searched parameters cost; less is better."""
    return fit.loss + COST * fit.spec.n_searched


def _of_size(spec: ModeSpec, data: ModeData) -> DrivenFit:
    spread = np.linspace(
        np.log(max(5.0 * data.period_s, data.longest_s / 500.0)), np.log(data.longest_s / 7.0), spec.n_modes
    )
    return fitted(spec, data, np.r_[spread, np.full(spec.n_powers, USUAL_EXPONENT[0])])


def tau_intervals(fit: DrivenFit, data: ModeData) -> tuple[Vector, Vector]:
    """95 % intervals of the time constants [s] by the curvature of the likelihood; NaN where there is no bound."""
    modes, n = fit.spec.n_modes, len(fit.theta)
    seen = np.ones(len(data.speed_rpm), np.bool_)
    lost = partial(_lost, fit.spec, data, spreads=fit.spreads, noise_um2=_noise_um2(data, seen))
    steps = _STEP * np.eye(n)
    curvature = np.empty((n, n))
    for i in range(n):
        for j in range(i + 1):
            corners = [lost(fit.theta + a * steps[i] + b * steps[j]) for a, b in ((1, 1), (1, -1), (-1, 1), (-1, -1))]
            curvature[i, j] = curvature[j, i] = (corners[0] - corners[1] - corners[2] + corners[3]) / (4.0 * _STEP**2)
    value, vector = np.linalg.eigh(curvature)
    # a direction without curvature is one that the tests say nothing about
    variance = (vector**2 / np.maximum(value, FLATTEST)).sum(axis=1)[:modes]
    low, high = _limits(fit.spec, data)
    error = np.sqrt(variance)
    inside = (fit.theta[:modes] > low[:modes] + 0.01) & (fit.theta[:modes] < high[:modes] - 0.01)
    error[(error > LOOSE) | ~inside] = np.nan
    return fit.tau_s * np.exp(-1.96 * error), fit.tau_s * np.exp(1.96 * error)


@dataclass(frozen=True)
class Part:
    """A test: a part of a run that begins when the spindle has rested."""

    run: int  #: Position of the run
    begin: int  #: begin and end: First block, and the one behind the last
    end: int
    from_s: float  #: from_s and to_s: Where in its run it is [s]
    to_s: float


def parts_of(data: ModeData) -> tuple[Part, ...]:
    """The tests of all runs, cut as `restarts` says."""
    found = []
    still = data.speed_rpm < 0.01 * data.fastest_rpm
    length = data.before_s + data.after_s
    for run, (begin, end) in enumerate(data.bounds):
        edges = np.r_[0.0, np.cumsum(length[begin:end])]
        # the last block at rest is the zero of the test
        cuts = restarts(still[begin:end], length[begin:end])
        found += [
            Part(run, begin + a, begin + b, float(edges[a]), float(edges[b]))
            for a, b in zip(cuts, [*cuts[1:], end - begin], strict=True)
        ]
    return tuple(found)


@dataclass(frozen=True)
class LeftOut:
    """What tests that were left out say of the error, counted from their start as that of a duty cycle is."""

    #: (n_parts, n_responses): Root mean square less the noise of the gauge [µm]; NaN for tests that were not judged
    error_um: Vector
    expected_um: Vector  #: (n_parts, n_responses): What the fit without the test expected [µm]

    @property
    def factor(self) -> Vector:
        """(n_responses,): Errors as multiples of what was expected, at least 1; few tests say little: drawn to 1."""
        ratio = (self.error_um / self.expected_um) ** 2
        known = np.isfinite(ratio).sum(axis=0)
        # that tests were off by less may be because their starts, which only they tell, were not as unlike as feared
        return np.asarray(np.sqrt(np.maximum((np.nansum(ratio, axis=0) + PRIOR_TESTS) / (known + PRIOR_TESTS), 1.0)))


def left_out(fit: DrivenFit, data: ModeData, parts: Sequence[Part]) -> LeftOut:
    """Every test predicted by a fit to the others, and again from every change of its speed on (composed duty cycles).

    A test at the fastest speed alone is not counted, because nobody asks beyond it; nor is the first of a run, whose
    state at the start only it can tell, unless every run is one test: then each begins as a cold duty cycle does.
    """
    n_responses = data.displacement_um.shape[1]
    error, expected = (np.full((len(parts), n_responses), np.nan) for _ in range(2))
    has_several = len(parts) > len(data.bounds)
    for k, part in enumerate(parts):
        rows = np.zeros(len(data.speed_rpm), np.bool_)
        rows[part.begin : part.end] = True
        rest = data.speed_rpm[~rows]
        if not rest.size or rest.max() < 0.9 * data.speed_rpm[rows].max() or not (data.speed_rpm[rows] > 0).any():
            continue
        if len(parts) > 3 and has_several and part.begin == data.bounds[part.run][0]:
            continue
        without = fitted(fit.spec, data, fit.theta, there=~rows, spreads=fit.spreads, rounds=1)
        phi, _ = design(fit.spec, data, without.theta)
        squares, variances = [], []
        for first in _beginnings(data, part):
            at = slice(first, part.end)
            there = data.counts[at] > 0
            time = data.middle_s[at] - data.middle_s[first]
            if not there[0].all() or len(time) < 5:
                continue
            weight = (data.before_s + data.after_s)[at][:, None] * there
            moved = phi[at] - phi[first]
            off = data.displacement_um[at] - data.displacement_um[first] - moved @ without.coefficients
            # readings scatter, and so does the one that all count from
            counts = np.maximum(data.counts[at], 1.0)
            noise = data.noise_um**2 * ((weight / counts).sum(axis=0) / weight.sum(axis=0) + 1.0 / counts[0])
            square = (weight * off**2).sum(axis=0) / weight.sum(axis=0)
            squares.append(np.maximum(square - noise, LEAST_SHARE * square))
            spread = expected_um(without, moved, time) ** 2
            variances.append((weight * spread).sum(axis=0) / weight.sum(axis=0))
        if squares:
            error[k], expected[k] = np.sqrt(np.mean(squares, axis=0)), np.sqrt(np.mean(variances, axis=0))
    return LeftOut(error, expected)


def _beginnings(data: ModeData, part: Part) -> list[int]:
    """Blocks at which the test, or another speed in it, begins."""
    speed = data.speed_rpm[part.begin : part.end]
    changed = 1 + np.flatnonzero(np.abs(np.diff(speed)) > 0.05 * data.fastest_rpm)
    return [part.begin, *(part.begin + changed[1:] - 1).tolist()]


def expected_um(fit: DrivenFit, moved: Vector, time_s: Vector) -> Vector:
    """Standard deviation of what columns (n_times, n_columns) describe after so long [µm], (n_times, n_responses).

    Of the coefficients, of the walk since time 0, and of the ripple then and now.
    """
    known = np.stack([np.einsum("ij,jk,ik->i", moved, one, moved) for one in fit.covariance], axis=1)
    walk = np.exp(2.0 * fit.spreads[:, 3]) * time_s[:, None]
    faded = 1.0 - np.exp(-time_s[:, None] / np.exp(fit.spreads[:, 6]))
    return np.asarray(np.sqrt(np.maximum(known + walk + 2.0 * np.exp(2.0 * fit.spreads[:, 5]) * faded, 0.0)))


# What is compiled: rows made independent of each other, and how likely they are.


def _whitened_loop(
    values: Vector, time_s: Vector, variance: Vector, walk: float, ripple: float, ripple_s: float, first: Mask
) -> tuple[Vector, float]:
    """Values (n, n_columns) less what the rows before predict, per standard deviation, and the sum of its logarithms.

    Every run begins (`first`) with a zero of which nothing is known, which then walks by `walk` [µm²/s]. Upon it is a
    ripple of variance `ripple` [µm²] that forgets itself within `ripple_s` [s], and white noise of `variance` (n,)
    [µm²]; where that is infinite the row tells nothing and becomes 0. So does the first row that tells something: it
    is the zero. A Kalman filter of two states.
    """
    n, columns = values.shape
    out = np.zeros((n, columns))
    zero, wave = np.zeros(columns), np.zeros(columns)
    a, b, c = 0.0, 0.0, 0.0  # covariance of zero and ripple: [[a, b], [b, c]]
    logs, known = 0.0, False
    for i in range(n):
        if first[i]:
            zero[:] = 0.0
            wave[:] = 0.0
            a, b, c, known = 0.0, 0.0, ripple, False
        else:
            since = time_s[i] - time_s[i - 1]
            kept = np.exp(-since / ripple_s)
            a += walk * since
            b *= kept
            c = ripple + (c - ripple) * kept * kept
            for j in range(columns):
                wave[j] *= kept
        if not np.isfinite(variance[i]):
            continue
        if known:
            total = a + 2.0 * b + c + variance[i]
            gain, other, scale = (a + b) / total, (b + c) / total, 1.0 / np.sqrt(total)
            for j in range(columns):
                ahead = values[i, j] - zero[j] - wave[j]
                out[i, j] = ahead * scale
                zero[j] += gain * ahead
                wave[j] += other * ahead
            ab, bc = a + b, b + c
            a -= gain * ab
            b -= gain * bc
            c -= other * bc
            logs += 0.5 * np.log(total)
        else:
            for j in range(columns):  # as a slice it would take two seconds more to compile
                zero[j] = values[i, j]
            a, b, known = c + variance[i], -c, True
    return out, logs


_whitened: Callable[..., tuple[Vector, float]] = njit(cache=True)(_whitened_loop)


def _evidence_loop(rows: Vector, logs: float, gain: Vector) -> tuple[float, Vector, Vector]:
    """Negative log marginal likelihood of the last of the `_whitened` columns (n, n_columns + 1) given the others.

    Their coefficients are normal about 0 with standard deviations `gain` (n_columns,); `logs` is of `_whitened`.
    Also the lower root L of the precision of coefficients / `gain`, and L⁻¹ times their products with the last column.
    """
    n = len(gain)
    # all products of columns, the last column included, in one matrix; then Cholesky, whose last row is the half
    root = rows.T @ rows
    for j in range(n):
        for i in range(n + 1):
            root[i, j] *= gain[j]
            root[j, i] *= gain[j]
        root[j, j] += 1.0
    for j in range(n):
        for i in range(j, n + 1):
            total = root[i, j]
            for k in range(j):
                total -= root[i, k] * root[j, k]
            root[i, j] = np.sqrt(total) if i == j else total / root[j, j]
        logs += np.log(root[j, j])
        for i in range(j):
            root[i, j] = 0.0
    half = root[n, :n].copy()
    return logs + 0.5 * (root[n, n] - (half * half).sum()), root[:n, :n].copy(), half


_evidence: Callable[..., tuple[float, Vector, Vector]] = njit(cache=True)(_evidence_loop)
