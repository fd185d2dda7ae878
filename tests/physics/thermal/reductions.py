"""Heat systems with few states, and how far their answers are off."""

from __future__ import annotations

import numpy as np

from selector.physics.thermal.network.heat_system import HeatSystem, factorised, projected, reduced_basis


def reduced(system: HeatSystem, film_coefficients, **options) -> HeatSystem:
    """The system in the few fields of `reduced_basis`."""
    return projected(system, reduced_basis(system, film_coefficients, **options))


def reduction_error(system: HeatSystem, small: HeatSystem, film_coefficients, time_scales_s) -> dict[str, float]:
    """Per displacement and probe, the largest error of its responses at these time scales.

    A response is what an output does after a source has heated, or a fluid has been warmer, for about τ; errors are
    relative to the largest response of that output to anything of the same kind.
    """
    names = (*system.displacements, *system.probes)
    worst = np.zeros(len(names))
    for kind in ("sources", "film_loads"):
        pairs = [
            [_responses(each, kind, coefficients, tau_s) for each in (system, small)]
            for coefficients in film_coefficients
            for tau_s in time_scales_s
        ]
        error = np.max([np.abs(near - exact).max(axis=1) for exact, near in pairs], axis=0)
        largest = np.max([np.abs(exact).max(axis=1) for exact, _ in pairs], axis=0)
        worst = np.maximum(worst, error / np.where(largest > 0, largest, 1.0))
    return dict(zip(names, worst.tolist(), strict=True))


def _responses(system, kind, coefficients, tau_s):
    """Outputs (rows) of every input (columns) at one time scale."""
    loads = np.column_stack(list(getattr(system, kind).values()))
    rows = np.vstack([*system.displacements.values(), *system.probes.values()])
    return rows @ factorised(system, coefficients, tau_s)(loads)
