"""Plain least-squares evidence for each drive effect: no whitening, no cross-validation, no selection."""

from __future__ import annotations

import numpy as np

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.catalogue import effect_of
from selector.diagnosis.effects.effect import Effect, Fitted

NAMES = (
    "asymmetric_friction",
    "backlash",
    "coulomb",
    "delay",
    "elasticity",
    "mass",
    "offset_force",
    "pitch_error",
    "ripple",
    "saturation",
    "stribeck",
    "varying_damping",
    "varying_stiffness",
    "viscous",
)
EFFECTS: tuple[Effect, ...] = tuple(effect_of(f"drive.{name}") for name in NAMES)


def best(
    comparison: Comparison, effect: Effect, response: str, *, viscous: bool = False
) -> tuple[float, Fitted | None]:
    """Largest gain of log-likelihood, less half of log n a column, over the shapes of an effect, and that fit.

    Beside offset, gain and delay of the simulation (with `viscous` a viscous coefficient, too), on rows that are not
    held out. 0 and None if no shape gains anything.
    """
    rows = ~comparison.held_out & np.isfinite(comparison.difference(response))
    own = _orthonormal(_own(comparison, response, viscous)[rows])
    target = comparison.difference(response)[rows]
    target = target - own @ (own.T @ target)
    n, power = len(target), float(target @ target)
    found: tuple[float, Fitted | None] = (0.0, None)
    for variant in effect.variants(comparison, response):
        columns = variant.columns[rows]
        size = np.linalg.norm(columns, axis=0)
        columns = columns - own @ (own.T @ columns)
        # what offset, gain and delay span already is nothing of its own
        live = np.linalg.norm(columns, axis=0) > 1e-6 * np.maximum(size, 1e-300)
        if not live.any():
            continue
        columns = columns[:, live] / size[live]
        inverse = np.linalg.pinv(columns.T @ columns, rcond=1e-10, hermitian=True)
        product = columns.T @ target
        left = max(power - float(product @ inverse @ product), 1e-12 * power)
        gain = 0.5 * n * np.log(power / left) - 0.5 * live.sum() * np.log(n)
        if gain > found[0]:
            coefficients, errors = np.zeros(len(size)), np.zeros(len(size))
            coefficients[live] = inverse @ product / size[live]
            errors[live] = np.sqrt(np.diag(inverse) * left / n) / size[live]
            course = variant.columns @ coefficients
            rms, largest = float(np.sqrt(np.mean(course**2))), float(np.abs(course).max())
            unit = comparison.channel(response).unit
            found = gain, Fitted(response, unit, variant, coefficients, errors, {}, rms, largest)
    return found


def evidence(comparison: Comparison, *, viscous: bool = False) -> dict[str, float]:
    """Effect → gain in all responses together; with `viscous` a viscous coefficient is free beside all others."""
    return {
        name: sum(
            best(comparison, effect, response, viscous=viscous and name != "viscous")[0]
            for response in comparison.responses
        )
        for name, effect in zip(NAMES, EFFECTS, strict=True)
    }


def _own(comparison: Comparison, response: str, viscous: bool) -> np.ndarray:
    simulated = comparison.simulated[response]
    slope = np.zeros(len(simulated))
    for _, rows in comparison.rows_of_runs():
        slope[rows] = np.gradient(simulated[rows], comparison.time_s[rows])
    columns = [np.ones(len(simulated)), simulated, slope]
    if viscous:
        columns += list(next(iter(effect_of("drive.viscous").variants(comparison, response))).columns.T)
    return np.column_stack(columns)


def _orthonormal(columns: np.ndarray) -> np.ndarray:
    size = np.linalg.norm(columns, axis=0)
    left, singular, _ = np.linalg.svd(columns[:, size > 0.0] / size[size > 0.0], full_matrices=False)
    return left[:, singular > 1e-8]
