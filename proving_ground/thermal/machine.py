"""A vertical machining centre cut into volumes: spindle, headstock, column, and how heat goes through them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

from selector.types import Matrix, Vector


@dataclass(frozen=True, eq=False)
class Body:
    """Volumes of uniform temperature and what links them."""

    capacity_j_per_k: Vector  #: (n_volumes,)
    links: NDArray[np.int64]  #: (n_links, 2)
    conductance_w_per_k: Vector  #: (n_links,)
    #: (n_volumes,): Bath → how strongly it holds every volume, film coefficient times surface
    film_w_per_k: Mapping[str, Vector]
    inlets: Mapping[str, Vector]  #: (n_volumes,): Place of a source → share of its heat that every volume takes

    def quickest_s(self) -> float:
        """Shortest time constant of a volume whose neighbours stand still [s], baths at twice their strength."""
        hold = np.zeros_like(self.capacity_j_per_k)
        for k in (0, 1):
            np.add.at(hold, self.links[:, k], self.conductance_w_per_k)
        hold += 2.0 * np.sum(list(self.film_w_per_k.values()), axis=0)
        return float(np.min(self.capacity_j_per_k / hold))


@dataclass(frozen=True, eq=False)
class Heat:
    """What happens to a body in a run, on a fine grid of equal steps."""

    power_w: Mapping[str, Vector]  #: (n_steps,): Inlet → heat that flows in
    #: bath_degc and bath_factor: (n_steps,): Bath → its temperature, and by what its films are multiplied
    bath_degc: Mapping[str, Vector]
    bath_factor: Mapping[str, Vector]
    #: Bath → by what share its films grow with every 10 K between surface and bath
    natural: Mapping[str, float] = field(default_factory=dict)


def temperatures(body: Body, heat: Heat, start_degc: float, step_s: float, stride: int) -> Matrix:
    """Temperatures of the volumes [°C], shape (n_steps // stride, n_volumes), of a body that starts evenly warm.

    C·T' = Σ G·(T_neighbour − T) + Σ film·factor·(1 + natural·|ΔT|/10 K)·ΔT + inflow, explicit Euler steps.

    Raises ValueError if a step is longer than half the quickest time constant.
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


STEEL = (7850.0, 460.0, 46.0)
CAST = (7200.0, 500.0, 48.0)
EXPANSION_UM_PER_M_K = 11.0
_SPINDLE, _ACROSS, _UP, _COLUMN = 12, 6, 5, 12


@dataclass(frozen=True, eq=False)
class Machine:
    """A machine whose sizes are drawn."""

    #: Volumes: spindle from nose to tail, headstock row by row from below (front to back), column front wall and rear
    #: wall from the foot upwards
    body: Body
    #: (n_volumes,): Member → axis → displacement by temperature [µm/K]. `"spindle"`, `"headstock"` and `"column"` make
    #: up the machine; the others (`"bed"`, `"scale"`) are there for machines that have them.
    members: Mapping[str, Mapping[str, Vector]]
    #: (n_volumes,): Temperature channel → place, weights of the volumes, lag [s]
    sensors: Mapping[str, tuple[str, Vector, float]]
    highest_rpm: float  #: Highest speed of the spindle

    def displacement(self, members: tuple[str, ...] = ("spindle", "headstock", "column")) -> dict[str, Vector]:
        """Axis → displacement by temperature [µm/K] of these members together, shape (n_volumes,)."""
        return {axis: np.sum([self.members[name][axis] for name in members], axis=0) for axis in ("Z", "Y")}


def machine(generator: np.random.Generator) -> Machine:
    """A machine of drawn sizes: spindle 0.36–0.54 m, headstock 0.45–0.7 m × 0.4–0.55 m, column 1.3–1.8 m."""

    def between(low: float, high: float) -> float:
        return float(generator.uniform(low, high))

    spindle_m, across_m, up_m, column_m = (
        between(0.36, 0.54),
        between(0.45, 0.70),
        between(0.40, 0.55),
        between(1.3, 1.8),
    )
    diameter_m, wall_m, width_m, depth_m = (
        between(0.07, 0.09),
        between(0.022, 0.032),
        between(0.36, 0.5),
        between(0.4, 0.6),
    )
    n = _SPINDLE + _ACROSS * _UP + 2 * _COLUMN
    spindle = np.arange(_SPINDLE)
    head = _SPINDLE + np.arange(_ACROSS * _UP).reshape(_UP, _ACROSS)
    front = _SPINDLE + head.size + np.arange(_COLUMN)
    rear = front + _COLUMN
    capacity, surface = np.zeros(n), np.zeros(n)
    links: list[tuple[int, int, float]] = []

    cell = spindle_m / _SPINDLE
    section = 0.25 * np.pi * diameter_m**2
    capacity[spindle] = STEEL[0] * STEEL[1] * section * cell
    surface[spindle] = 0.2 * np.pi * diameter_m * cell
    links += [(int(a), int(a) + 1, STEEL[2] * section / cell) for a in spindle[:-1]]

    # two side walls and ribs: the effective thickness of the box seen from the side
    dy, dz, thick = across_m / _ACROSS, up_m / _UP, 3.5 * wall_m
    capacity[head] = CAST[0] * CAST[1] * dy * dz * thick
    surface[head] = 2.0 * dy * dz
    surface[head[0]] += 0.3 * dy
    links += [
        (int(a), int(b), CAST[2] * thick * dz / dy) for a, b in zip(head[:, :-1].flat, head[:, 1:].flat, strict=True)
    ]
    links += [(int(a), int(b), CAST[2] * thick * dy / dz) for a, b in zip(head[:-1].flat, head[1:].flat, strict=True)]

    dx = column_m / _COLUMN
    for wall in (front, rear):
        capacity[wall] = CAST[0] * CAST[1] * dx * wall_m * (width_m + depth_m)
        surface[wall] = dx * (width_m + depth_m)
        links += [(int(a), int(a) + 1, CAST[2] * wall_m * (width_m + depth_m) / dx) for a in wall[:-1]]
    links += [(int(a), int(b), CAST[2] * 2.0 * wall_m * dx / depth_m) for a, b in zip(front, rear, strict=True)]

    low, high = round(0.22 * _SPINDLE), round(0.72 * _SPINDLE)
    bearing = between(9.0, 16.0)
    for volume, row in ((low, 0), (low + 1, 1), (high, _UP - 2), (high + 1, _UP - 1)):
        links.append((volume, int(head[row, 0]), bearing))
        links.append((volume, int(head[row, 1]), 0.3 * bearing))
    guide = between(25.0, 45.0)
    for row in range(_UP):
        links.append((int(head[row, -1]), int(front[_COLUMN - _UP - 1 + row]), guide))

    film = between(8.0, 13.0)
    air = film * surface
    foot = np.zeros(n)
    foot[[front[0], rear[0]]] = between(15.0, 30.0)
    jets = np.zeros(n)
    jets[spindle[:2]], jets[head[0, :3]], jets[front[:3]] = 1.5, 12.0, 8.0
    draught = np.zeros(n)
    draught[front[:5]], draught[rear[:2]] = 10.0, 3.0

    def at(*parts: tuple[int, float]) -> Vector:
        weights = np.zeros(n)
        for volume, weight in parts:
            weights[volume] += weight
        return weights / weights.sum()

    windage = np.zeros(n)
    windage[spindle], windage[head] = 3.0 * air[spindle], air[head]

    inlets = {
        "front bearing": at((low, 0.55), (int(head[0, 0]), 0.3), (int(head[1, 0]), 0.15)),
        "rear bearing": at((high, 0.5), (int(head[-2, 0]), 0.3), (int(head[-1, 1]), 0.2)),
        "motor": at((int(head[-1, 2]), 0.5), (int(head[-1, 3]), 0.5)),
        "nut": at((int(front[6]), 0.4), (int(front[8]), 0.4), (int(front[9]), 0.2)),
        "hydraulics": at((int(rear[1]), 0.5), (int(rear[2]), 0.3), (int(front[1]), 0.2)),
        "rear wall": at(*((int(volume), 1.0) for volume in rear[3:10])),
        "foot": at((int(front[0]), 0.6), (int(front[1]), 0.4)),
    }
    a = EXPANSION_UM_PER_M_K
    members = {
        name: {"Z": np.zeros(n), "Y": np.zeros(n)} for name in ("spindle", "headstock", "column", "bed", "scale")
    }
    members["spindle"]["Z"][: low + 1] = a * cell
    members["headstock"]["Z"][head[: _UP // 2 + 1, :2]] = 0.5 * a * dz
    members["headstock"]["Y"][head] = a * dy / _UP
    height = (np.arange(_COLUMN) + 0.5) * dx
    reach = np.clip(1.0 - height / (height[-1] * 0.85), 0.0, 1.0)
    members["column"]["Z"][front], members["column"]["Z"][rear] = -0.30 * a * dx, -0.30 * a * dx
    members["column"]["Y"][front], members["column"]["Y"][rear] = a * dx * reach, -a * dx * reach
    members["bed"]["Z"][front[:8]], members["bed"]["Y"][rear[:8]] = a * dx, a * dx
    members["scale"]["Z"][front[4:9]], members["scale"]["Y"][head[1, 2:]] = a * dx, a * dy

    def felt(place: str, volume: int, low_s: float = 15.0, high_s: float = 70.0) -> tuple[str, Vector, float]:
        weights = np.zeros(n)
        weights[volume] = 1.0
        return place, weights, between(low_s, high_s)

    sensors = {
        "T1": felt("front bearing", int(head[0, 0])),
        "T2": felt("rear bearing", int(head[-2, 0])),
        "T3": felt("spindle motor flange", int(head[-1, 2])),
        "T4": felt("column front, upper", int(front[8])),
        "T5": felt("column rear, lower", int(rear[2])),
        "T6": felt("headstock nose", int(head[0, 1])),
    }
    body = Body(
        capacity,
        np.array([(p, q) for p, q, _ in links], dtype=np.int64),
        np.array([g for _, _, g in links]),
        {"hall": air, "floor": foot, "coolant": jets, "draught": draught, "windage": windage},
        inlets,
    )
    return Machine(body, members, sensors, float(generator.choice([6000.0, 8000.0, 10000.0, 12000.0])))


def slightly_off(values: Mapping[str, float], share: float, generator: np.random.Generator) -> dict[str, float]:
    """The same values, each wrong by a share that is drawn: normal, of this standard deviation, cut."""
    return {name: value * (1.0 + share * _drawn(generator)) for name, value in values.items()}


def guessed(body: Body, share: float, generator: np.random.Generator) -> Body:
    """A body as somebody has it who knows its parts and what joins them, each value wrong by such a share."""
    part = np.searchsorted([_SPINDLE, _SPINDLE + _ACROSS * _UP], np.arange(len(body.capacity_j_per_k)), side="right")
    heavy = np.array([1.0 + share * _drawn(generator) for _ in range(3)])
    joined = np.array([[1.0 + share * _drawn(generator) for _ in range(3)] for _ in range(3)])
    first, second = part[body.links].T
    return replace(
        body,
        capacity_j_per_k=body.capacity_j_per_k * heavy[part],
        conductance_w_per_k=body.conductance_w_per_k * joined[np.minimum(first, second), np.maximum(first, second)],
        film_w_per_k={
            name: film * np.array([1.0 + share * _drawn(generator) for _ in range(3)])[part]
            for name, film in body.film_w_per_k.items()
        },
    )


def _drawn(generator: np.random.Generator) -> float:
    return float(np.clip(generator.standard_normal(), -1.6, 1.6))
