"""What a fit of thermal modes is: at given time constants, everything that enters linearly is solved for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from selector.physics.thermal._mode_filter import filtered
from selector.physics.thermal.mode_data import ModeData
from selector.physics.thermal.modes import ModalModel
from selector.physics.thermal.speed_law import SpeedLaw

Vector = NDArray[np.float64]
Law = Literal["levels", "power", "powers", "turning", "turning-powers", "mode-powers"]
Film = Literal["none", "growing"]
SHRINKAGE: dict[Film, float] = {"none": 2.0, "growing": 20.0}
"""Gains are drawn to 0 as if each were known to be 0 ± the displacement divided by this: little beside what thousands
of samples say, but it keeps modes that nearly cancel from growing enormous, for which unseen courses would pay. Modes
that a film couples cancel more easily."""
USUAL_EXPONENT = 1.2, 0.5
"""Heat of bearings and drives grows with n^1 to n^1.5: where tests say nothing, exponents stay near this (±)."""
USUAL_FILM_EXPONENT = 0.8, 0.01
"""Forced convection grows with n^0.5 (laminar) to n^0.8 (turbulent), windage up to n^1 (±)."""
STEP = 1e-4
"""Step of numerical derivatives in logarithms of time constants and in exponents."""


@dataclass(frozen=True)
class ModeSpec:
    """What is fitted.

    Attributes
    ----------
    n_modes : int
        Number of modes.
    law_kind : {"levels", "power", "powers", "turning", "turning-powers", "mode-powers"}
        Gains: free at every tested level; c·n^p with one p; c·n^p + d·n^(p + 1/2); c·n^p + d·[n > 0];
        c·n + d·n^1.5 + e·[n > 0]; c_k·n^(p_k) with a p for every mode.
    film : {"none", "growing"}
        Convection that does not depend on the speed, or one film that grows with it and couples the modes.
    level_exponent : float
        Exponent between the levels of the first law.
    with_hall : bool
        Whether the hall temperature drives the same modes.
    free_starts : tuple of int
        Runs that do not begin at rest and cold.
    """

    n_modes: int
    law_kind: Law = "levels"
    film: Film = "none"
    level_exponent: float = 1.2
    with_hall: bool = False
    free_starts: tuple[int, ...] = ()

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
    """Linear part of a fit at given searched parameters.

    Attributes
    ----------
    coefficients : ndarray of shape (n_columns, n_responses)
        Mode by mode: the terms of the law, then the hall temperature [µm, µm/K].
    residual : ndarray of shape (n_blocks, n_responses)
        Weighted residuals: of variance 1 where the noise is what it was taken to be.
    left_out_um : ndarray of shape (n_blocks, n_responses)
        Residuals [µm], all blocks, also those without weight.
    shrinkage : ndarray of shape (n_responses,)
        What coefficients are multiplied with to be counted as residuals.
    """

    coefficients: Vector
    residual: Vector
    left_out_um: Vector
    shrinkage: Vector


def columns(spec: ModeSpec, data: ModeData, theta: Vector) -> tuple[Vector, Vector]:
    """Columns of the gains (n_blocks, n_modes, n_terms [+ 1]), and what is left of a start (n_blocks, n_modes)."""
    modes = spec.n_modes
    inputs = spec.speed_law(theta, data).terms(data.speed_rpm)
    film, drive, exponent = spec.films(theta)
    rate = np.exp(-theta[:modes])
    drives = np.eye(modes) if spec.law_kind == "mode-powers" else np.tile(drive, (inputs.shape[1], 1))
    if spec.with_hall and data.ambient_k is not None:
        inputs, drives = np.column_stack([inputs, data.ambient_k]), np.vstack([drives, drive])
    first = np.zeros(len(inputs), dtype=np.bool_)
    first[[begin for begin, _ in data.bounds]] = True
    share = np.where(data.speed_rpm > 0, (data.speed_rpm / data.fastest_rpm) ** exponent, 0.0)
    return filtered(
        data.before_s, data.after_s, data.speed_rpm, share, rate, film, drives * rate, inputs, first,
        0.01 * data.fastest_rpm,
    )  # fmt: skip


def solved(spec: ModeSpec, data: ModeData, theta: Vector, weights: Vector) -> Solution:
    """The best gains, zeros and starts for these searched parameters; weights (n_blocks, n_responses)."""
    states, left = columns(spec, data, theta)
    design = states.reshape(len(states), -1)
    coefficients = np.zeros((design.shape[1], weights.shape[1]))
    left_out, shrinkage = np.zeros(weights.shape), np.zeros(weights.shape[1])
    for alike in alike_weights(weights):
        w = weights[:, alike[0]]
        scale, common = scales(spec, data, weights, alike)
        both = without_nuisances(spec, data, left, w, np.column_stack([design, data.displacement_um[:, alike]]))
        plain, aim = both[:, : design.shape[1]], both[:, design.shape[1] :]
        coefficients[:, alike] = found = _best(plain * w[:, None], aim * w[:, None], common)
        left_out[:, alike] = aim - plain @ found
        shrinkage[alike] = common * scale
    return Solution(coefficients, left_out * weights, left_out, shrinkage)


def scales(spec: ModeSpec, data: ModeData, weights: Vector, alike: list[int]) -> tuple[Vector, float]:
    """Weights of responses relative to the first of them, and the shrinkage that they share."""
    scale = np.array([weights[:, r].max() for r in alike]) / max(float(weights[:, alike[0]].max()), 1e-300)
    peaks = np.ptp(data.displacement_um[:, alike], axis=0)
    return scale, SHRINKAGE[spec.film] / max(float(np.median(peaks * scale)), 1e-9)


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


def alike_weights(weights: Vector) -> list[list[int]]:
    """Responses whose weights are the same up to a factor can be solved for together."""
    groups: list[list[int]] = []
    for r in range(weights.shape[1]):
        mine = weights[:, r] / max(weights[:, r].max(), 1e-300)
        for group in groups:
            other = weights[:, group[0]] / max(weights[:, group[0]].max(), 1e-300)
            if np.allclose(mine, other, rtol=1e-9, atol=0.0):
                group.append(r)
                break
        else:
            groups.append([r])
    return groups


@dataclass(frozen=True)
class Fit:
    """A fit and what it was fitted with.

    Attributes
    ----------
    spec, theta, weights, solution
        What was asked for; the searched parameters; weights; the linear part there.
    """

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
