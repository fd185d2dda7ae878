"""How heat goes through a body cut into volumes: explicit finite volumes, links between them, baths around them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numba import njit
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Body:
    """Volumes of uniform temperature and what links them.

    Attributes
    ----------
    capacity_j_per_k : ndarray of shape (n_volumes,)
    links : ndarray of int of shape (n_links, 2)
    conductance_w_per_k : ndarray of shape (n_links,)
    film_w_per_k : mapping of str to ndarray of shape (n_volumes,)
        Bath → how strongly it holds every volume, film coefficient times surface.
    inlets : mapping of str to ndarray of shape (n_volumes,)
        Place of a source → share of its heat that every volume takes.
    """

    capacity_j_per_k: Vector
    links: NDArray[np.int64]
    conductance_w_per_k: Vector
    film_w_per_k: Mapping[str, Vector]
    inlets: Mapping[str, Vector]

    def quickest_s(self) -> float:
        """Shortest time constant of a volume whose neighbours stand still [s], baths at twice their strength."""
        hold = np.zeros_like(self.capacity_j_per_k)
        for k in (0, 1):
            np.add.at(hold, self.links[:, k], self.conductance_w_per_k)
        hold += 2.0 * np.sum(list(self.film_w_per_k.values()), axis=0)
        return float(np.min(self.capacity_j_per_k / hold))


@dataclass(frozen=True, eq=False)
class Heat:
    """What happens to a body in a run, on a fine grid of equal steps.

    Attributes
    ----------
    power_w : mapping of str to ndarray of shape (n_steps,)
        Inlet → heat that flows in.
    bath_degc, bath_factor : mapping of str to ndarray of shape (n_steps,)
        Bath → its temperature, and by what its films are multiplied.
    natural : mapping of str to float
        Bath → by what share its films grow with every 10 K between surface and bath.
    """

    power_w: Mapping[str, Vector]
    bath_degc: Mapping[str, Vector]
    bath_factor: Mapping[str, Vector]
    natural: Mapping[str, float] = field(default_factory=dict)


def temperatures(body: Body, heat: Heat, start_degc: float, step_s: float, stride: int) -> Matrix:
    """Temperatures of the volumes [°C], shape (n_steps // stride, n_volumes), of a body that starts evenly warm.

    C·T' = Σ G·(T_neighbour − T) + Σ film·factor·(1 + natural·|ΔT|/10 K)·ΔT + inflow, explicit Euler steps.

    Raises
    ------
    ValueError
        If a step is longer than half the quickest time constant.
    """
    if step_s > 0.5 * body.quickest_s():
        raise ValueError(f"step of {step_s:g} s, quickest volume {body.quickest_s():.3g} s")
    baths = [name for name in heat.bath_degc if name in body.film_w_per_k]
    places = [name for name, course in heat.power_w.items() if np.any(course)]
    n_steps = len(next(iter(heat.bath_degc.values())))
    return np.asarray(
        _march(
            start_degc,
            step_s / body.capacity_j_per_k,
            body.links,
            body.conductance_w_per_k,
            _stacked([body.film_w_per_k[name] for name in baths]),
            _stacked([heat.bath_degc[name] for name in baths]),
            _stacked([heat.bath_factor[name] for name in baths]),
            np.array([heat.natural.get(name, 0.0) for name in baths]),
            _stacked([body.inlets[name] for name in places]) if places else np.zeros((0, len(body.capacity_j_per_k))),
            _stacked([heat.power_w[name] for name in places]) if places else np.zeros((0, n_steps)),
            stride,
        )
    )


def _stacked(rows: list[Vector]) -> Matrix:
    return np.ascontiguousarray(np.stack(rows), dtype=np.float64)


@njit(cache=True, nogil=True)
def _march(start, per_capacity, links, conductance, film, bath, factor, natural, inlet, power, stride):  # type: ignore[no-untyped-def]
    n_volumes = len(per_capacity)
    n_steps = bath.shape[1]
    now = np.full(n_volumes, start)
    flux = np.zeros(n_volumes)
    result = np.empty((n_steps // stride, n_volumes))
    for k in range(n_steps // stride * stride):
        if k % stride == 0:
            result[k // stride] = now
        flux[:] = 0.0
        for e in range(len(links)):
            a, b = links[e, 0], links[e, 1]
            q = conductance[e] * (now[b] - now[a])
            flux[a] += q
            flux[b] -= q
        for j in range(len(bath)):
            strength, level, curl = factor[j, k], bath[j, k], 0.1 * natural[j]
            if strength > 0.0:
                for i in range(n_volumes):
                    gap = level - now[i]
                    flux[i] += strength * film[j, i] * (1.0 + curl * abs(gap)) * gap
        for j in range(len(power)):
            watts = power[j, k]
            if watts != 0.0:
                for i in range(n_volumes):
                    flux[i] += inlet[j, i] * watts
        for i in range(n_volumes):
            now[i] += per_capacity[i] * flux[i]
    return result
