"""How far a fit of modes can be trusted: its error on left-out parts and tests, and intervals of its time constants."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri

from selector.physics.thermal.modes.fit import STEP, Fit, columns, expectations, limits, searched, slopes, solved
from selector.physics.thermal.modes.thermal_test import ModeData
from selector.types import Mask, Vector

FIRMEST = 1e-4  #: What is left of a direction in which only the part left out had a say; smaller is as good as unknown.


def jacobian(fit: Fit, data: ModeData, *, own_zeros: bool) -> Vector:
    """Derivative of the weighted prediction, rows block by block within response by response.

    Columns: searched parameters, then coefficients, then zeros and starts of the runs. With `own_zeros` these last are
    eliminated instead, so that a run left out as a whole may still choose its zero.
    """
    spec, theta, weights = fit.spec, fit.theta, fit.weights
    states, left = columns(spec, data, theta)
    design = states.reshape(len(states), -1)
    solution = fit.solution.coefficients
    searched = []
    for i in range(len(theta)):
        moved = theta.copy()
        moved[i] += STEP
        change = columns(spec, data, moved)[0].reshape(len(states), -1) - design
        searched.append((change @ solution) / STEP)
    nuisances = _nuisances(fit, data, left)
    pieces = []
    for r in range(weights.shape[1]):
        block = np.column_stack([np.column_stack([one[:, r] for one in searched]), design]) * weights[:, r : r + 1]
        zeros = nuisances * weights[:, r : r + 1]
        if own_zeros:
            basis = np.linalg.qr(zeros)[0]
            block = block - basis @ (basis.T @ block)
            zeros = zeros[:, :0]
        own = np.column_stack([block[:, len(theta) :], zeros])
        full = np.zeros((len(states), len(theta) + weights.shape[1] * own.shape[1]))
        full[:, : len(theta)] = block[:, : len(theta)]
        begin = len(theta) + r * own.shape[1]
        full[:, begin : begin + own.shape[1]] = own
        pieces.append(full)
    return np.vstack(pieces)


def _nuisances(fit: Fit, data: ModeData, left: Vector) -> Vector:
    parts = []
    for run, (begin, end) in enumerate(data.bounds):
        here = np.zeros((len(left), 1))
        here[begin:end] = 1.0
        parts.append(here)
        if run in fit.spec.free_starts:
            parts.append(here * left)
    return np.column_stack(parts)


def expected_rows(fit: Fit, width: int) -> Vector:
    """Derivative of what is known without the tests, shape (n_rows, width), for a `jacobian` of that many columns."""
    moves = slopes(lambda theta: expectations(fit.spec, theta), fit.theta, range(len(fit.theta)))
    usual = np.zeros((len(moves[0]), width))
    usual[:, : len(moves)] = np.column_stack(moves)
    n_columns, n_responses = fit.solution.coefficients.shape
    own = (width - len(moves)) // n_responses
    shrunk = np.zeros((n_responses * n_columns, width))
    for r in range(n_responses):
        rows = np.arange(n_columns)
        shrunk[r * n_columns + rows, len(moves) + r * own + rows] = fit.solution.shrinkage[r]
    return np.vstack([usual, shrunk])


def held_out_um(fit: Fit, data: ModeData, folds: Sequence[Mask], *, own_zeros: bool) -> Vector:
    """Root mean square error [µm] of every fold and response, shape (n_folds, n_responses)."""
    out = np.full((len(folds), fit.weights.shape[1]), np.nan)
    for number, errors in enumerate(held_out_blocks(fit, data, folds, own_zeros=own_zeros)):
        for r, error in enumerate(errors.T):
            keep = np.isfinite(error)
            if keep.any():
                samples = data.counts[keep, r]
                out[number, r] = np.sqrt((samples * error[keep] ** 2).sum() / samples.sum())
    return out


def held_out_blocks(fit: Fit, data: ModeData, folds: Sequence[Mask], *, own_zeros: bool) -> list[Vector]:
    """Error [µm] of every block that is left out, a fold each (n_blocks, n_responses); NaN where nothing is.

    For a linear fit with orthonormal columns Q, the error on the rows f when they are left out is
    r_f + Q_f (I − Q_fᵀ Q_f)⁻¹ Q_fᵀ r_f, exactly; a fit of modes is nearly linear around its optimum.
    """
    derivative = jacobian(fit, data, own_zeros=own_zeros)
    rows = np.vstack([derivative, expected_rows(fit, derivative.shape[1])])
    size = np.sqrt((rows**2).sum(axis=0))
    size[size == 0.0] = 1.0
    q = np.linalg.qr(np.vstack([rows / size, 1e-7 * np.eye(rows.shape[1])]))[0]
    n_blocks, n_responses = fit.weights.shape
    residual = fit.solution.residual.T.ravel()
    found = []
    for fold in folds:
        part = np.tile(fold, n_responses) & (fit.weights.T.ravel() > 0)
        mine = q[: len(residual)][part]
        value, vector = np.linalg.eigh(np.eye(q.shape[1]) - mine.T @ mine)
        push = vector @ ((vector.T @ (mine.T @ residual[part])) / np.maximum(value, FIRMEST))
        error = np.zeros(len(residual))
        error[part] = residual[part] + mine @ push
        weights = np.where(fold[:, None] & (fit.weights > 0), fit.weights, np.nan)
        found.append(error.reshape(n_responses, n_blocks).T / weights)
    return found


_FOLDS, _PIECES = 5, 4  #: Folds over time, and stretches of each run in each of them.


def time_folds(data: ModeData) -> list[Mask]:
    """Every run is cut into stretches of equally many blocks, which go to the folds in turn."""
    pieces = [np.arange(end - begin) * _FOLDS * _PIECES // (end - begin) for begin, end in data.bounds]
    fold_of = np.concatenate(pieces) % _FOLDS
    return [fold_of == fold for fold in range(_FOLDS)]


def run_folds(data: ModeData, runs: Sequence[Sequence[int]]) -> list[Mask]:
    """One fold for every group of runs."""
    folds = []
    for group in runs:
        fold = np.zeros(len(data.before_s), dtype=np.bool_)
        for run in group:
            begin, end = data.bounds[run]
            fold[begin:end] = True
        folds.append(fold)
    return folds


CONFIDENCE = 0.95
LOOSE = 1.2  #: A standard error of log τ above this is not followed: the interval spans more than a factor of 100.


def resemblance(fit: Fit, data: ModeData) -> float:
    """1 + 2 Σ ρ_k of the weighted residuals within runs, up to the first pair of lags that adds nothing; at least 1."""
    total = np.zeros(60)
    for begin, end in data.bounds:
        for r in range(fit.weights.shape[1]):
            here = fit.solution.residual[begin:end, r][fit.weights[begin:end, r] > 0]
            n = min(len(here), len(total))
            total[:n] += [float(here[lag:] @ here[: len(here) - lag]) for lag in range(n)]
    if total[0] <= 0.0:
        return 1.0
    pairs = (total / total[0]).reshape(-1, 2).sum(axis=1)
    last = int(np.argmax(pairs <= 0.0)) if (pairs <= 0.0).any() else len(pairs)
    return max(1.0, 2.0 * float(pairs[:last].sum()) - 1.0)


def tau_intervals(fit: Fit, data: ModeData) -> tuple[Vector, Vector]:
    """Bounds [s] between which the sum of squares stays within what chance explains, other parameters fitted anew.

    Lower and upper ones, of shape (n_modes,) in the order of the fit; NaN where the tests set none.
    """
    modes = fit.spec.n_modes
    derivative = jacobian(fit, data, own_zeros=False)
    rows = np.vstack([derivative, expected_rows(fit, derivative.shape[1])])
    size = np.sqrt((rows**2).sum(axis=0))
    size[size == 0.0] = 1.0
    scaled = rows / size
    covariance = np.linalg.inv(scaled.T @ scaled + 1e-12 * np.eye(len(size))) / np.outer(size, size)
    n_free = max(int((fit.weights > 0).sum()) - derivative.shape[1], 1)
    # neighbouring residuals that resemble each other widen it
    variance = max(fit.cost / n_free, 1e-12) * resemblance(fit, data)
    allowed = variance * float(chdtri(1, 1.0 - CONFIDENCE))
    low, high = np.full(modes, np.nan), np.full(modes, np.nan)
    bounds = limits(fit.spec, data)
    for k in range(modes):
        step = np.sqrt(allowed * covariance[k, k])
        if step > LOOSE * 1.96:
            continue
        slope = covariance[: len(fit.theta), k] / covariance[k, k]
        for sign, out in ((-1.0, low), (1.0, high)):
            edge = _edge(fit, data, k, sign * step, slope, allowed, (float(bounds[0][k]), float(bounds[1][k])))
            out[k] = np.exp(edge) if edge is not None else np.nan
    return low, high


def _edge(
    fit: Fit, data: ModeData, k: int, step: float, slope: Vector, allowed: float, bounds: tuple[float, float]
) -> float | None:
    """Where the sum of squares has risen by what is allowed; its square root is nearly linear: secant steps."""
    centre, distance = float(fit.theta[k]), abs(step)
    sign = 1.0 if step > 0 else -1.0
    inside, outside = 0.0, np.inf
    for _ in range(8):
        place = centre + sign * distance
        if not bounds[0] < place < bounds[1]:
            return None
        start = fit.theta + slope * (place - centre)
        start[k] = place
        moved = searched(fit.spec, data, start, fit.weights, held=k, max_steps=6)
        rise = np.sqrt(max(moved.cost - fit.cost, 0.0) / allowed)
        if 0.93 < rise < 1.08:
            return centre + sign * distance / rise
        if rise < 1.0:
            inside = distance
        else:
            outside = distance
        aim = distance / max(rise, 0.3)
        if not inside < aim < outside:
            aim = 0.5 * (inside + outside) if np.isfinite(outside) else 2.0 * distance
        distance = aim
    return centre + sign * distance if np.isfinite(outside) else None


STILL = 0.1  #: A test is at its start until it has moved by this share of what it moves at most.

#: Standard deviation of the logarithm of true ÷ claimed error by a single test (`benchmarks/bench_claims.py`).
SPREAD_OF_CLAIMS = 1.14
AT_MOST = 2.0  #: Times what is claimed from separate tests, the error is 19 times in 20 at most.


def few_factor(judged: int) -> float:
    """How many times what so many left-out tests were off an error is at most, 19 times in 20; never below 2."""
    return max(AT_MOST, float(np.exp(1.645 * SPREAD_OF_CLAIMS / np.sqrt(max(judged, 1)))))


@dataclass(frozen=True)
class SpeedFold:
    """Runs that are left out together: those that mainly ran at this level."""

    level_rpm: float  #: The level [r/min]
    fold: Mask  #: (n_blocks,): Blocks of these runs


def runs_by_level(data: ModeData) -> dict[int, list[int]]:
    """Level, by its number → runs that mainly ran at it."""
    levels = np.array(data.levels_rpm)
    length_s = data.before_s + data.after_s
    main: dict[int, list[int]] = {}
    for run, (begin, end) in enumerate(data.bounds):
        turning = data.speed_rpm[begin:end] > 0.01 * data.fastest_rpm
        if turning.any():
            nearest = np.abs(data.speed_rpm[begin:end, None] - levels).argmin(axis=1)[turning]
            time_s = np.bincount(nearest, length_s[begin:end][turning], minlength=len(levels))
            main.setdefault(int(np.argmax(time_s)), []).append(run)
    return main


def speed_folds(data: ModeData) -> list[SpeedFold]:
    """Left-out levels below the fastest (nobody asks beyond it), as far as other runs remain that turn."""
    main = runs_by_level(data)
    if len(main) < 2:
        return []
    return [
        SpeedFold(data.levels_rpm[level], run_folds(data, [runs])[0])
        for level, runs in sorted(main.items())
        if level < len(data.levels_rpm) - 1
    ]


def law_errors(fit: Fit, data: ModeData, folds: Sequence[SpeedFold]) -> Vector:
    """Root mean square error [µm] at left-out speeds, shape (n_folds, n_responses); the zero of a run is free."""
    if fit.spec.law_kind != "levels":
        return held_out_um(fit, data, [one.fold for one in folds], own_zeros=True)
    errors = np.zeros((len(folds), fit.weights.shape[1]))
    for i, one in enumerate(folds):
        left_out, total, samples = _without_level(fit, data, one), np.zeros(errors.shape[1]), np.zeros(errors.shape[1])
        for begin, end in data.bounds:
            if one.fold[begin]:
                count = np.where(fit.weights[begin:end] > 0, data.counts[begin:end], 0.0)
                own = left_out[begin:end]
                own = own - (own * count).sum(axis=0) / np.maximum(count.sum(axis=0), 1.0)
                total, samples = total + (count * own**2).sum(axis=0), samples + count.sum(axis=0)
        errors[i] = np.sqrt(total / np.maximum(samples, 1.0))
    return errors


def _without_level(fit: Fit, data: ModeData, fold: SpeedFold) -> Vector:
    """Error [µm] of all blocks by a fit without a level, (n_blocks, n_responses); the zero of each run is unknown."""
    # the factor at a left-out level is unknown: it must come from the levels beside it
    kept = tuple(level for level in data.levels_rpm if level != fold.level_rpm)
    return solved(fit.spec, replace(data, levels_rpm=kept), fit.theta, fit.weights * ~fold.fold[:, None]).left_out_um


@dataclass(frozen=True)
class LeftOutTests:
    """Tests that begin cold, each predicted as a duty cycle is: by the others, with the zero of its start.

    error_um and moved_um, of shape (n_tests, n_responses), are root mean squares [µm] from there.
    """

    runs: tuple[int, ...]
    error_um: Vector
    moved_um: Vector
    noise_um: Vector  #: (n_tests, n_responses): What the noise of the gauge adds to both

    @property
    def rmse_um(self) -> Vector:
        """(n_responses,): Over all these tests, less the noise of the gauge, as far as it does not hide the error."""
        noise = np.mean(self.noise_um**2, axis=0)
        square = np.mean(self.error_um**2, axis=0) - noise
        return np.asarray(np.sqrt(np.maximum(square, noise * np.sqrt(2.0 / len(self.runs)))))

    def claimed_um(self, moves_um: Vector) -> Vector:
        """The error to expect in a duty cycle that moves the responses by so much, RMS (n_responses,) [µm].

        The same part of the movement as in the tests, so that it does not shrink with the hours that a machine was
        recorded at rest; of less movement than theirs half-way, by ratio, to their error. Of few tests, so much
        more that it is twice the claim at most, 19 times in 20.
        """
        ratio = moves_um / np.maximum(np.sqrt(np.mean(self.moved_um**2, axis=0)), 1e-9)
        few = few_factor(len(self.runs)) / AT_MOST
        return np.asarray(few * self.rmse_um * np.maximum(ratio, np.sqrt(ratio)))


def left_out_tests(fit: Fit, data: ModeData) -> LeftOutTests | None:
    """Tests that others can predict: those at a level, for levels below the fastest; at the fastest each by itself."""
    levels = speed_folds(data)
    fastest = runs_by_level(data).get(len(data.levels_rpm) - 1, [])
    alone = run_folds(data, [[run] for run in fastest]) if len(fastest) > 1 else []
    folds = [*(one.fold for one in levels), *alone]
    blocks = held_out_blocks(fit, data, folds, own_zeros=True)
    if fit.spec.law_kind == "levels":
        blocks = [*(_without_level(fit, data, one) for one in levels), *blocks[len(levels) :]]
    found = [
        (run, *_from_start(errors, fit, data, run))
        for fold, errors in zip(folds, blocks, strict=True)
        for run, (begin, _) in enumerate(data.bounds)
        if fold[begin] and run not in fit.spec.free_starts
    ]
    if not found:
        return None
    runs, errors, moved, noise = zip(*found, strict=True)
    return LeftOutTests(tuple(runs), np.array(errors), np.array(moved), np.array(noise))


def _from_start(errors_um: Vector, fit: Fit, data: ModeData, run: int) -> tuple[Vector, Vector, Vector]:
    """Error, movement and what noise adds to them, each (n_responses,) [µm], with the zero of the start of a run."""
    begin, end = data.bounds[run]
    counts = np.where(fit.weights[begin:end] > 0, data.counts[begin:end], 0.0)
    predicted = data.displacement_um[begin:end] - fit.solution.left_out_um[begin:end]
    found = np.zeros((3, counts.shape[1]))
    for r, (count, noise) in enumerate(zip(counts.T, data.noise_um, strict=True)):
        there = np.flatnonzero(count)
        if len(there):
            moved = np.abs(predicted[there, r] - predicted[there[0], r])
            start = there[: max(int(np.argmax(moved > STILL * moved.max())), 1)]
            for k, values in enumerate((errors_um[begin:end, r], data.displacement_um[begin:end, r])):
                own = values[there] - np.average(values[start], weights=count[start])
                found[k, r] = np.sqrt(np.average(own**2, weights=count[there]))
            found[2, r] = noise * np.sqrt(1.0 / count[start].sum() + len(there) / count[there].sum())
    return found[0], found[1], found[2]
