"""How the simulation itself heats: the law of the spindle speed and the time constants that its course shows."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.shapes.cooling import cooled
from selector.diagnosis.shapes.heating import (
    heats,
    simulated_rise,
    sources,
    speed_power,
    switched_on,
    temperature_rise,
)
from selector.diagnosis.shapes.signals import lagged, time_constants

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

EXPONENTS = (0.5, 0.75, 1.0, 1.25, 1.5, 1.75, 2.0, 2.5, 3.0)
_RIDGE = 1e-6
_MOST_ROWS = 1500
_OWN_LAGS = 10
_OTHER_LAGS = 4
_CALM_S = 1800.0
_MOST_SENSORS = 8
_LEFT_BY_SENSORS = 0.01


@dataclass(frozen=True, eq=False)
class SpindleLaw:
    """A simulated course as Σ w_j · lag of (n / n_max)^p with time constant τ_j, found by ridge regression.

    Attributes
    ----------
    channel : str
        The channel of the speed.
    exponent : float
        p.
    tau_s : ndarray of shape (n_lags,)
        Time constants tried [s]; 0 = follows at once.
    weights : ndarray of shape (n_lags,)
        w_j [unit of the response].
    share : float
        Part of the simulated course that only the speed explains, 0 to 1.
    """

    channel: str
    exponent: float
    tau_s: Vector
    weights: Vector
    share: float

    def course(self, comparison: Comparison, source: Vector) -> Vector:
        """What the simulation would make of another source, in place of (n / n_max)^p."""
        result = np.zeros(len(source))
        for tau_s, weight in zip(self.tau_s, self.weights, strict=True):
            result += weight * lagged(comparison, source, float(tau_s))
        return result

    def cooled_course(
        self, comparison: Comparison, source: Vector, gate: Vector, extra_per_s: float | None, share: float
    ) -> Vector:
        """The same when every mode loses heat faster while the `gate` (0 to 1) is open.

        By `extra_per_s` [1/s] in every mode alike, or if that is None by the part `share` of its own rate.
        """
        result = np.zeros(len(source))
        for tau_s, weight in zip(self.tau_s, self.weights, strict=True):
            if tau_s > 0.0:
                extra = share / float(tau_s) if extra_per_s is None else extra_per_s
                result += weight * cooled(comparison, source, gate, float(tau_s), extra)
            else:
                result += weight * source
        return result

    @property
    def typical_s(self) -> float:
        """The time constant about which the weights lie: their mean logarithm [s]."""
        slow = self.tau_s > 0.0
        size = np.abs(self.weights[slow])
        return float(np.exp(np.sum(size * np.log(self.tau_s[slow])) / max(float(size.sum()), 1e-300)))


@lru_cache(maxsize=32)
def spindle_law(comparison: Comparison, response: str) -> SpindleLaw | None:
    """The law of speed in the simulated course of this response; None without a speed, or if it knows none."""
    name = sources(comparison, response).spindle
    target = simulated_rise(comparison, response)
    if name is None or float(np.std(target)) <= 0.0:
        return None
    others = _surroundings(comparison, response)
    without = _misfit(others, target, _every(comparison))
    tau_s = np.concatenate([[0.0], time_constants(comparison, _OWN_LAGS)])
    tried = {p: _fit(comparison, name, p, tau_s, others, target) for p in EXPONENTS}
    best = _between({p: misfit for p, (misfit, _) in tried.items()})
    misfit, weights = _fit(comparison, name, best, tau_s, others, target)
    if without <= 0.0 or misfit > 0.5 * without:
        return None
    return SpindleLaw(name, best, tau_s, weights, 1.0 - misfit / without)


@lru_cache(maxsize=32)
def follows_sensors(comparison: Comparison, response: str) -> bool:
    """Whether the simulated course is a function of recorded temperatures at the same instant: a regression on them.

    Its steps from sample to sample then follow the sensors' noise and resolution, which no physical course does.
    """
    known = sources(comparison, response)
    names = [*known.machine, *known.hall, *known.coolant_temperatures][:_MOST_SENSORS]
    if not names:
        return False
    rises = [temperature_rise(comparison, name) for name in names]
    products = [a * b for k, a in enumerate(rises) for b in rises[k:]]
    within = np.diff(comparison.run_index) == 0
    steps = np.diff(np.column_stack([*rises, *products]), axis=0)[within]
    target = np.diff(simulated_rise(comparison, response))[within]
    if len(target) < 4 * steps.shape[1]:
        return False
    left = target - steps @ np.linalg.lstsq(steps, target, rcond=None)[0]
    return bool(np.sum(left**2) < _LEFT_BY_SENSORS * np.sum(target**2))


def spindle_part(comparison: Comparison, response: str, name: str) -> Vector:
    """A recorded temperature's rise [K] without what hall, coolant and other sources explain of it, and calm.

    What follows the speed, or with no speed recorded the simulated course, stays in it.
    """
    return _parts(comparison, response, name).spindle


def calm_rise(comparison: Comparison, response: str, name: str) -> Vector:
    """A recorded temperature's rise [K] without the steps of its resolution.

    What the recorded sources explain of it is kept as it is, the rest as its mean over half an hour.
    """
    parts = _parts(comparison, response, name)
    return parts.spindle + parts.others


def free_part(comparison: Comparison, response: str, name: str) -> tuple[Vector, float]:
    """What neither the spindle nor hall nor coolant explains of a rise [K], calm, and its share of variance."""
    parts = _parts(comparison, response, name)
    return parts.free, parts.free_share


@dataclass(frozen=True, eq=False)
class _Parts:
    spindle: Vector
    others: Vector
    free: Vector
    free_share: float


@lru_cache(maxsize=64)
def _parts(comparison: Comparison, response: str, name: str) -> _Parts:
    values = temperature_rise(comparison, name)
    spindle = _spindle_columns(comparison, response)
    others = np.column_stack([_surroundings(comparison, response), *_cooled_by_coolant(comparison, response)])
    rows = _every(comparison)
    coefficients = _ridge(np.column_stack([spindle, others])[rows], values[rows])
    by_spindle = spindle @ coefficients[: spindle.shape[1]]
    by_others = others @ coefficients[spindle.shape[1] :]
    free = values - by_spindle - by_others
    calm = _smoothed(comparison, free)
    variance = float(np.var(values))
    share = float(np.var(calm)) / variance if variance > 0.0 else 0.0
    return _Parts(by_spindle + calm, by_others, calm, share)


def _smoothed(comparison: Comparison, values: Vector) -> Vector:
    """Mean over half an hour about every sample, run by run."""
    result = np.empty(len(values))
    samples = max(3, round(_CALM_S / comparison.period_s) | 1)
    for _, rows in comparison.rows_of_runs():
        result[rows] = uniform_filter1d(values[rows], samples, mode="nearest")
    return result


@lru_cache(maxsize=32)
def _spindle_columns(comparison: Comparison, response: str) -> Matrix:
    """Lags of two powers of the speed, convection with it; with no speed, lags of the simulated courses."""
    name = sources(comparison, response).spindle
    taus = time_constants(comparison, 6)
    if name is None:
        courses = [simulated_rise(comparison, other) for other in comparison.responses]
        return np.column_stack([lagged(comparison, c, float(t)) for c in courses for t in (0.0, *taus)])
    linear = speed_power(comparison, name, 1.0)
    columns = [lagged(comparison, speed_power(comparison, name, p), float(t)) for p in (1.0, 2.0) for t in taus]
    columns += [lagged(comparison, linear * lagged(comparison, linear, float(t)), float(t)) for t in taus[1::2]]
    return np.column_stack(columns)


def _cooled_by_coolant(comparison: Comparison, response: str) -> list[Vector]:
    """What coolant takes of the warmth that the spindle brings: lags of its product with lags of the speed."""
    known = sources(comparison, response)
    warm = (
        simulated_rise(comparison, response) if known.spindle is None else speed_power(comparison, known.spindle, 1.0)
    )
    return [
        lagged(comparison, switched_on(comparison, name) * lagged(comparison, warm, float(tau_s)), float(tau_s))
        for name in known.coolant_switches
        for tau_s in time_constants(comparison, 6)[1::2]
    ]


@lru_cache(maxsize=32)
def _surroundings(comparison: Comparison, response: str) -> Matrix:
    """Lags of the hall, the coolant and other sources, and a constant: what else a course may follow."""
    known = sources(comparison, response)
    taus = (0.0, *time_constants(comparison, _OTHER_LAGS))
    courses = [temperature_rise(comparison, name) for name in (*known.hall, *known.coolant_temperatures)]
    courses += [switched_on(comparison, name) for name in known.coolant_switches]
    courses += [heats(comparison, name)[0][1] for name in known.other_heat[:6]]
    columns = [lagged(comparison, values, float(tau_s)) for values in courses for tau_s in taus]
    return np.column_stack([np.ones(len(comparison.time_s)), *columns])


def _fit(
    comparison: Comparison, name: str, exponent: float, tau_s: Vector, others: Matrix, target: Vector
) -> tuple[float, Vector]:
    source = speed_power(comparison, name, exponent)
    rows = _every(comparison)
    own = np.column_stack([lagged(comparison, source, float(tau))[rows] for tau in tau_s])
    design = np.column_stack([own, others[rows]])
    coefficients = _ridge(design, target[rows])
    misfit = float(np.mean((target[rows] - design @ coefficients) ** 2))
    return misfit, coefficients[: len(tau_s)]


def _misfit(design: Matrix, target: Vector, rows: slice) -> float:
    return float(np.mean((target[rows] - design[rows] @ _ridge(design[rows], target[rows])) ** 2))


def _ridge(design: Matrix, target: Vector) -> Vector:
    """Coefficients drawn to 0 a little: lags of near time constants are nearly the same course."""
    size = np.sqrt(np.mean(design**2, axis=0))
    size[size <= 0.0] = 1.0
    unit = design / size
    gram = unit.T @ unit
    gram[np.diag_indices_from(gram)] += _RIDGE * len(target)
    return np.asarray(np.linalg.solve(gram, unit.T @ target) / size)


def _every(comparison: Comparison) -> slice:
    return slice(None, None, max(1, len(comparison.time_s) // _MOST_ROWS))


def _between(misfits: dict[float, float]) -> float:
    """The exponent of least misfit, by a parabola through the logarithms of the best and its neighbours."""
    powers = sorted(misfits)
    k = min(range(len(powers)), key=lambda j: misfits[powers[j]])
    if not 0 < k < len(powers) - 1:
        return powers[k]
    x = np.array(powers[k - 1 : k + 2])
    y = np.sqrt([misfits[p] for p in x])
    a, b, _ = np.polyfit(x - x[1], y, 2)
    return float(np.clip(x[1] - b / (2.0 * a), x[0], x[2])) if a > 0.0 else powers[k]
