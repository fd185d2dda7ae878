"""The search for the non-linear parameters of thermal modes: time constants, exponents, film."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from selector.physics.thermal.mode_data import ModeData
from selector.physics.thermal.mode_fit import (
    STEP,
    USUAL_EXPONENT,
    USUAL_FILM_EXPONENT,
    Fit,
    ModeSpec,
    alike_weights,
    columns,
    fit_at,
    scales,
    solved,
    without_nuisances,
)

Vector = NDArray[np.float64]
CLOSEST = {"none": 1.4, "growing": 2.2}
"""Neighbouring time constants in a fit have at least this ratio: nearer ones are one mode with enormous gains. A film
lets modes imitate each other, so that only modes further apart predict unseen courses."""
LONGEST_TAU = 2.0
"""Longest time constant in lengths of the longest run: of a slower mode the tests show a straight line."""
LEAST_EXPONENT, LARGEST_EXPONENT = 0.8, 2.5
"""Losses grow at least nearly in proportion to the speed. A smaller exponent only imitates heat that does not depend on
the speed, and is wrong below the slowest tested speed."""
STRONGEST = 2.5
"""Bound of the film's vector (its square is the growth of a mode's rate) and of the logarithms of the drives."""


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

    def residual(part: Vector) -> Vector:
        theta = at(part)
        found = solved(spec, data, theta, weights)
        shrunk = -found.shrinkage * found.coefficients
        return np.r_[found.residual.ravel(), shrunk.ravel(), expectations(spec, theta)]

    def derivative(part: Vector) -> Vector:
        theta, known = at(part), []
        for i in free:
            moved = theta.copy()
            moved[i] += STEP
            known.append((expectations(spec, moved) - expectations(spec, theta)) / STEP)
        return np.vstack([derivative_of(spec, data, theta, weights, free), np.column_stack(known)])

    result = least_squares(
        residual, start[free], jac=derivative, bounds=(low[free], high[free]), x_scale=1.0, ftol=1e-6, xtol=1e-5,
        gtol=1e-9, max_nfev=max_steps,
    )  # fmt: skip
    theta = start.copy()
    theta[free] = result.x
    return fit_at(spec, data, theta, weights)


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


def with_film(fit: Fit, data: ModeData, smaller: Fit | None = None) -> Fit:
    """The fit with a film that grows with the speed: from these modes, a film of one mode less, and an even spread."""
    spec = replace(fit.spec, film="growing")
    modes, powers = spec.n_modes, fit.theta[fit.spec.n_modes : fit.spec.n_modes + fit.spec.n_powers]
    starts = []
    for sign in (1.0, -1.0) if modes > 1 else (1.0,):
        vector = 0.7 * np.resize([1.0, sign], modes)
        log_tau = np.sort(fit.theta[:modes])
        starts.append(np.r_[log_tau, powers, vector, np.zeros(modes - 1), USUAL_FILM_EXPONENT[0]])
    if smaller is not None:
        starts += _one_more(smaller, spec, data)
        spread = np.linspace(np.log(data.longest_s / 80.0), np.log(data.longest_s / 1.7), modes)
        vector = 0.7 * np.resize([1.0, -1.0], modes)
        starts.append(np.r_[spread, powers, vector, np.zeros(modes - 1), USUAL_FILM_EXPONENT[0]])
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


def derivative_of(spec: ModeSpec, data: ModeData, theta: Vector, weights: Vector, free: Vector) -> Vector:
    """Derivative of weighted residuals and shrunk coefficients, (n_rows·n_responses, n_free), with gains that follow.

    Kaufman's form of variable projection: the part of the derivative that the columns cannot describe.
    """
    states, left = columns(spec, data, theta)
    design = states.reshape(len(states), -1)
    solution = solved(spec, data, theta, weights).coefficients
    changes = []
    for i in free:
        moved = theta.copy()
        moved[i] += STEP
        changes.append((columns(spec, data, moved)[0].reshape(len(states), -1) - design) @ solution / STEP)
    out = np.zeros((len(states) + design.shape[1], weights.shape[1], len(free)))
    for alike in alike_weights(weights):
        w = weights[:, alike[0]]
        moves = np.concatenate([change[:, alike] for change in changes], axis=1)
        both = without_nuisances(spec, data, left, w, np.column_stack([design, moves])) * w[:, None]
        scale, common = scales(spec, data, weights, alike)
        extended = np.vstack([both[:, : design.shape[1]], common * np.eye(design.shape[1])])
        basis = np.linalg.qr(extended)[0]
        part = np.vstack([both[:, design.shape[1] :], np.zeros((design.shape[1], moves.shape[1]))])
        part = part - basis @ (basis.T @ part)
        out[:, alike] = -part.reshape(len(out), len(free), len(alike)).transpose(0, 2, 1) * scale[:, None]
    return out.reshape(-1, len(free))
