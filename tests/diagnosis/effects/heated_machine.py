"""A machine of bars with finite differences of heat, made for tests: no lag, no mode and no column of the catalogue."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np

from selector.diagnosis.comparison import Comparison
from selector.recording import Channel
from selector.units import CANONICAL_UNITS

TOP_RPM = 4000.0
STEP_S = 30.0
SAMPLE_S = 60.0
ALPHA = 11.5  # µm/(m·K), steel and cast iron


@dataclass(frozen=True)
class Physics:
    """What the machine does; the defaults are the simplest machine, every field one effect more."""

    law: tuple[tuple[float, float], ...] = ((1.0, 1.4),)  # (watts per top speed, exponent) added up
    power_w: float = 260.0
    hall: float = 0.0
    coolant_w_per_m2k: float = 0.0
    feed_w: float = 0.0
    hydraulics_w: float = 0.0
    fan: float = 0.0
    free: float = 0.0
    column: bool = True
    product: float = 0.0
    instant_um: float = 0.0
    instant_exponent: float = 2.0
    cells: int = 24
    film: float = 9.0


@dataclass(frozen=True)
class Programme:
    """Inputs at every step of one run."""

    speed: np.ndarray
    hall: np.ndarray
    coolant: np.ndarray
    feed: np.ndarray
    hydraulics: np.ndarray


@dataclass
class Net:
    """Nodes with capacity, air film area and conductances."""

    capacity: list[float] = field(default_factory=list)
    area: list[float] = field(default_factory=list)
    links: list[tuple[int, int, float]] = field(default_factory=list)

    def bar(self, length_m: float, section_m2: float, edge_m: float, cells: int, conductivity: float = 48.0) -> range:
        start, step = len(self.capacity), length_m / cells
        for k in range(cells):
            self.capacity.append(7200.0 * 480.0 * section_m2 * step)
            self.area.append(edge_m * step)
            if k:
                self.links.append((start + k - 1, start + k, conductivity * section_m2 / step))
        return range(start, start + cells)


def machine(cells: int, column: bool) -> tuple[Net, dict[str, range]]:
    net = Net()
    parts = {"spindle": net.bar(0.45, 0.006, 0.28, cells), "head": net.bar(0.55, 0.02, 0.6, cells)}
    parts["front"] = net.bar(0.9, 0.022, 0.55, cells)
    parts["back"] = net.bar(0.9, 0.022, 0.75, cells)
    for at in (0.2, 0.8):  # the two bearings
        net.links.append((at_(parts["spindle"], at), at_(parts["head"], at), 28.0))
    if column:
        for at in (0.55, 0.75, 0.95):  # slide between head and column
            net.links.append((parts["head"][-1 - int(cells * (0.95 - at))], at_(parts["front"], at), 9.0))
        for at in (0.1, 0.35, 0.6, 0.85):  # ribs
            net.links.append((at_(parts["front"], at), at_(parts["back"], at), 3.0))
    return net, parts


def at_(part: range, share: float) -> int:
    return part[min(int(share * len(part)), len(part) - 1)]


def heat_law(speed: np.ndarray, law: tuple[tuple[float, float], ...]) -> np.ndarray:
    return sum(part * (speed / TOP_RPM) ** exponent for part, exponent in law)


def temperatures(physics: Physics, programme: Programme) -> tuple[np.ndarray, dict[str, range]]:
    """Rises of every node at every step, implicit Euler."""
    net, parts = machine(physics.cells, physics.column)
    n = len(net.capacity)
    capacity, area = np.array(net.capacity), np.array(net.area)
    conduction = np.zeros((n, n))
    for a, b, g in net.links:
        conduction[[a, b], [a, b]] += g
        conduction[[a, b], [b, a]] -= g
    film = physics.film * area
    blown = np.zeros(n)
    blown[[*parts["spindle"], *parts["head"]]] = area[[*parts["spindle"], *parts["head"]]]
    wet = np.zeros(n)
    nose = [*parts["spindle"][: len(parts["spindle"]) // 3], *parts["head"][: len(parts["head"]) // 4]]
    wet[nose] = physics.coolant_w_per_m2k * area[nose]
    theta, result, solvers = np.zeros(n), np.zeros((len(programme.speed), n)), {}
    heat = physics.power_w * heat_law(programme.speed, physics.law)
    for k in range(len(programme.speed)):
        fan = round(physics.fan * (programme.speed[k] / TOP_RPM) ** 0.8, 3)
        key = (fan, programme.coolant[k])
        if key not in solvers:
            loss = film + physics.film * fan * blown + wet * programme.coolant[k]
            solvers[key] = np.linalg.inv(np.diag(capacity / STEP_S + loss) + conduction)
        air = physics.hall * programme.hall[k]
        source = (film + physics.film * fan * blown) * air - 1.5 * wet * programme.coolant[k]
        source[at_(parts["spindle"], 0.2)] += 0.6 * heat[k]
        source[at_(parts["spindle"], 0.8)] += 0.4 * heat[k]
        source[at_(parts["front"], 0.15)] += physics.feed_w * programme.feed[k]
        source[at_(parts["back"], 0.1)] += physics.hydraulics_w * programme.hydraulics[k]
        over = theta - air
        if physics.free:
            source -= physics.free * film * over * np.abs(over) ** 0.25
        theta = solvers[key] @ (capacity / STEP_S * theta + source)
        result[k] = theta
    return result, parts


def displacements(
    physics: Physics, theta: np.ndarray, parts: dict[str, range], speed: np.ndarray
) -> dict[str, np.ndarray]:
    mean = {name: theta[:, list(part)].mean(axis=1) for name, part in parts.items()}
    z = ALPHA * (0.35 * mean["spindle"] + 0.1 * mean["head"] + 0.3 * mean["front"])
    tilt = ALPHA * 0.9 * (mean["front"] - mean["back"])
    y = 0.5 * tilt + ALPHA * 0.25 * mean["head"]
    nose = theta[:, at_(parts["spindle"], 0.2)]
    z = z + 0.4 * tilt + physics.product * nose * mean["front"]
    y = y + 0.5 * physics.product * nose * mean["front"]
    shift = physics.instant_um * (speed / TOP_RPM) ** physics.instant_exponent
    return {"Z": z + shift, "Y": y - 0.4 * shift}


def programmes(seed: int, hours: float = 6.0) -> list[Programme]:
    """A warm-up with cooling, an intermittent and a mixed run; hall, coolant, feed and hydraulics on their own."""
    rng = np.random.default_rng(seed)
    n = int(hours * 3600 / STEP_S)
    time_h = np.arange(n) * STEP_S / 3600
    result = []
    for kind in range(3):
        speed = np.zeros(n)
        if kind == 0:
            levels = rng.permutation([1200.0, 2400.0, 4000.0])
            for k, level in enumerate(levels):
                speed[(time_h >= 1.2 * k) & (time_h < 1.2 * (k + 1))] = level
        else:
            at = 0
            while at < n:
                stay = int(rng.uniform(10, 60 if kind == 1 else 45) * 60 / STEP_S)
                levels = [0, 0, 3200.0] if kind == 1 else [0, 800.0, 1600.0, 2400.0, 3200.0, 4000.0]
                speed[at : at + stay] = rng.choice(levels)
                at += stay
        phase = rng.uniform(0, 2 * np.pi)
        hall = 1.4 * np.sin(2 * np.pi * time_h / rng.uniform(5, 12) + phase) + 0.5 * (time_h > rng.uniform(2, 4))
        hall = hall - hall[0]
        result.append(
            Programme(
                speed, hall, switching(rng, n, 15, 60), switching(rng, n, 5, 40, levels=True), switching(rng, n, 30, 90)
            )
        )
    return result


def switching(rng: np.random.Generator, n: int, low_min: float, high_min: float, levels: bool = False) -> np.ndarray:
    result, at, on = np.zeros(n), 0, bool(rng.integers(2))
    while at < n:
        stay = int(rng.uniform(low_min, high_min) * 60 / STEP_S)
        result[at : at + stay] = on * (rng.choice([0.3, 0.6, 1.0]) if levels else 1.0)
        at, on = at + stay, not on
    return result


@cache
def recorded(physics: Physics, seed: int) -> dict[str, np.ndarray]:
    """Channels of all runs: displacements, sensors with lag and steps of 0.1 K, inputs as recorded."""
    every = int(SAMPLE_S / STEP_S)
    columns: dict[str, list[np.ndarray]] = {}
    for programme in programmes(seed):
        theta, parts = temperatures(physics, programme)
        moved = displacements(physics, theta, parts, programme.speed)
        places = {"T1": at_(parts["head"], 0.2), "T2": at_(parts["head"], 0.8), "T6": at_(parts["spindle"], 0.05)}
        places["T4"] = at_(parts["front"], 0.7)
        places["T9"] = at_(parts["back"], 0.1)
        read = {name: 22.0 + sensor(theta[:, node]) for name, node in places.items()}
        read["Tamb"] = 22.0 + sensor(programme.hall)
        read = {name: np.round(values / 0.1) * 0.1 for name, values in read.items()}
        read |= {
            "coolant": programme.coolant,
            "F": 9000.0 * programme.feed,
            "hyd": programme.hydraulics,
            "n": programme.speed,
        }
        for name, values in (read | moved).items():
            columns.setdefault(name, []).append(values[::every])
    return {name: np.concatenate(parts) for name, parts in columns.items()}


def sensor(values: np.ndarray, lag_s: float = 60.0) -> np.ndarray:
    result, state = np.empty(len(values)), values[0]
    for k, value in enumerate(values):
        state += STEP_S / lag_s * (value - state)
        result[k] = state
    return result


PLACES = {
    "T1": ("temperature", "front bearing"),
    "T2": ("temperature", "rear bearing"),
    "T4": ("temperature", "column front, upper"),
    "T6": ("temperature", "headstock nose"),
    "T9": ("temperature", "column back, oil tank"),
    "Tamb": ("ambient", "hall"),
    "coolant": ("state", "coolant pump"),
    "F": ("feed_rate", "X axis"),
    "hyd": ("state", "hydraulic unit"),
    "n": ("spindle_speed", None),
    "Z": ("displacement", None),
    "Y": ("displacement", None),
}


def comparison_of(record: dict, simulated: dict, n_runs: int = 3, *, drop: tuple[str, ...] = ()) -> Comparison:
    rows = len(record["Z"]) // n_runs
    names = [name for name in PLACES if name in record and name not in drop]
    channels = tuple(
        Channel(name, PLACES[name][0], CANONICAL_UNITS[PLACES[name][0]], PLACES[name][1]) for name in names
    )
    time_s = np.tile(np.arange(rows) * SAMPLE_S, n_runs)
    return Comparison(
        runs=tuple(f"r{k + 1}" for k in range(n_runs)),
        starts=tuple(k * rows for k in range(n_runs + 1)),
        time_s=time_s,
        channels=channels,
        recorded={name: record[name] for name in names},
        simulated={name: np.round(simulated[name], 3) for name in ("Z", "Y")},
        responses=("Z", "Y"),
        held_out=np.arange(len(time_s)) >= (n_runs - 1) * rows,
        resolution={name: 0.1 for name in names if name.startswith("T")},
    )


def simulation(physics: Physics, seed: int, record: dict) -> dict:
    """Another mesh of the machine as somebody believes it to be, its gain and offset fitted to the recording."""
    raw = recorded(replace(physics, cells=14), seed)
    return {name: refitted(raw[name], record[name]) for name in ("Z", "Y")}


def regression(record: dict, sensors: tuple[str, ...], until: int) -> dict:
    """A static regression of the displacements on sensors, fitted to the first rows."""
    design = np.column_stack([np.ones(len(record["Z"])), *(record[name] - 22.0 for name in sensors)])
    return {n: design @ np.linalg.lstsq(design[:until], record[n][:until], rcond=None)[0] for n in ("Z", "Y")}


def refitted(values: np.ndarray, target: np.ndarray) -> np.ndarray:
    if float(np.std(values)) < 1e-6:
        return values
    gain, offset = np.polyfit(values, target, 1)
    return gain * values + offset
