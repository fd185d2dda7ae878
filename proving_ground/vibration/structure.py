"""How does the true structure swing, and what says a linear simulation of it: two members in a row, one more mode."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from scipy.linalg import expm

from selector.types import Matrix, Vector

STEP_S = 1e-4
"""Step of both [s]; forces are given twice as often."""


class Structure(NamedTuple):
    """Two members in a row: the first on the ground, the second on the first; in SI units.

    `back` is how much of the force between them the first one feels (1 = all of it, 0 = the second one is light). The
    first has a spring that grows with the square of its deflection (`hardening_per_m2`) and `sliders_n_per_m` of
    springs that slip at several deflections around `slip_m`. Besides, a mode of its own that the force excites too.
    """

    mass_kg: float = 40.0
    stiffness_n_per_m: float = 1.0e7
    damping_ns_per_m: float = 800.0
    second_kg: float = 8.0
    second_n_per_m: float = 4.0e6
    second_ns_per_m: float = 300.0
    back: float = 0.0
    hardening_per_m2: float = 0.0
    sliders_n_per_m: float = 0.0
    slip_m: float = 1e-6
    mode_hz: float = 150.0
    mode_damping: float = 0.02
    mode_kg: float = 1e12


def true_swing(structure: Structure, force_n: Vector) -> Matrix:
    """Deflection of the first member, of the second and acceleration of the first, every `STEP_S`, [m, m, m/s²].

    `force_n` acts on the first member, every half step; shape (2·n_steps + 1,). Result of shape (n_steps, 3).
    """
    result: Matrix = _swing(structure, force_n)
    return result


@njit(cache=True, nogil=True)
def _rates(p, x, sliders, stiffness, limits, force):  # type: ignore[no-untyped-def]
    y, v, z, w, q, u = x
    between = p.second_n_per_m * (y - z) + p.second_ns_per_m * (v - w)
    held = p.stiffness_n_per_m * y * (1.0 + p.hardening_per_m2 * y * y) + p.damping_ns_per_m * v
    for i in range(len(sliders)):
        held += stiffness[i] * min(max(y - sliders[i], -limits[i]), limits[i])
    omega = 2.0 * np.pi * p.mode_hz
    return np.array(
        [
            v,
            (force - held - p.back * between) / p.mass_kg,
            w,
            between / p.second_kg,
            u,
            force / p.mode_kg - 2.0 * p.mode_damping * omega * u - omega * omega * q,
        ]
    )


@njit(cache=True, nogil=True)
def _swing(p, force):  # type: ignore[no-untyped-def]
    h = STEP_S
    n = (len(force) - 1) // 2
    result = np.empty((n, 3))
    x = np.zeros(6)
    limits = p.slip_m * np.array([0.3, 0.6, 1.0, 1.5, 2.2])
    stiffness = p.sliders_n_per_m * np.array([0.3, 0.25, 0.2, 0.15, 0.1])
    sliders = np.zeros(5)
    for k in range(n):
        first = _rates(p, x, sliders, stiffness, limits, force[2 * k])
        result[k, 0] = x[0] + x[4]
        result[k, 1] = x[2]
        result[k, 2] = first[1] + first[5]
        second = _rates(p, x + 0.5 * h * first, sliders, stiffness, limits, force[2 * k + 1])
        third = _rates(p, x + 0.5 * h * second, sliders, stiffness, limits, force[2 * k + 1])
        fourth = _rates(p, x + h * third, sliders, stiffness, limits, force[2 * k + 2])
        x = x + h / 6.0 * (first + 2.0 * second + 2.0 * third + fourth)
        for i in range(5):
            # a spring that is stretched beyond its limit takes its foot along
            sliders[i] = min(max(sliders[i], x[0] - limits[i]), x[0] + limits[i])
    return result


def given_swing(structure: Structure, force_n: Vector) -> Matrix:
    """The same of a linear simulation, exact for a force that is straight between steps; no sliders, no hardening."""
    p = structure
    omega = 2.0 * np.pi * p.mode_hz
    a, b = np.zeros((6, 6)), np.zeros(6)
    a[0, 1] = a[2, 3] = a[4, 5] = 1.0
    a[1, :2] = -p.stiffness_n_per_m / p.mass_kg, -p.damping_ns_per_m / p.mass_kg
    pull = np.array([p.second_n_per_m, p.second_ns_per_m, -p.second_n_per_m, -p.second_ns_per_m])
    a[1, :4] -= p.back * pull / p.mass_kg
    a[3, :4] = pull / p.second_kg
    a[5, 4:] = -(omega**2), -2.0 * p.mode_damping * omega
    b[1], b[5] = 1.0 / p.mass_kg, 1.0 / p.mode_kg
    h = STEP_S
    whole = np.zeros((8, 8))
    whole[:6, :6], whole[:6, 6], whole[6, 7] = a * h, b * h, 1.0
    grown = expm(whole)
    states = _linear(np.ascontiguousarray(grown[:6, :6]), grown[:6, 6].copy(), grown[:6, 7].copy(), force_n[::2].copy())
    accelerations = states @ (a[1] + a[5]) + (b[1] + b[5]) * force_n[:-1:2]
    return np.column_stack([states[:, 0] + states[:, 4], states[:, 2], accelerations])


@njit(cache=True, nogil=True)
def _linear(step, held, ramp, force):  # type: ignore[no-untyped-def]
    n = len(force) - 1
    states = np.empty((n, 6))
    states[0] = 0.0
    for k in range(n - 1):
        rise = force[k + 1] - force[k]
        for i in range(6):
            total = held[i] * force[k] + ramp[i] * rise
            for j in range(6):
                total += step[i, j] * states[k, j]
            states[k + 1, i] = total
    return states
