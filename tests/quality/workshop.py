"""Clean thermal recordings of machines drawn by chance, as a workshop records them.

Several heat sources are switched on and off; every place follows each of them through two first-order lags; the room
drifts over the day. Sensors add noise and rounding. Everything that a check could take for a fault although it is none
is in it: standing still for hours at equilibrium, coolant that comes on suddenly beside a thin sensor, growth at once
when the spindle changes its speed, warm starts, lost rows, uneven sampling, a channel that is logged more seldom.
"""

from __future__ import annotations

import numpy as np
import pandas as pd
from scipy.signal import lfilter

from selector.recording import Channel, Recording


def clean_recording(seed: int, *, runs: int | None = None, thermal: int | None = None) -> Recording:
    """A recording without faults; everything about it is drawn from the seed."""
    rng = np.random.default_rng(seed)
    period = float(rng.choice([1.0, 2.0, 5.0, 10.0, 30.0, 60.0]))
    samples = int(min(rng.uniform(2.5, 8.0) * 3600 / period, 5000))
    runs = int(rng.integers(1, 7)) if runs is None else runs
    thermal = int(rng.integers(3, 11)) if thermal is None else thermal
    machine = _Machine(rng, thermal, period)
    tables = {f"r{k + 1}": machine.run(rng, samples if rng.random() < 0.7 else samples * 3 // 4) for k in range(runs)}
    return Recording.from_runs(tables, machine.channels)


class _Machine:
    def __init__(self, rng: np.random.Generator, thermal: int, period: float) -> None:
        self.period = period
        self.has_speed, self.has_coolant_bit = rng.random() < 0.7, rng.random() < 0.5
        self.has_ambient, self.axes = rng.random() < 0.8, int(rng.integers(1, 3))
        # sources: spindle, second spindle effect (motor), feed drives, hydraulics, coolant (cools)
        zones = rng.integers(0, 3, thermal)
        strength = rng.uniform(0.15, 1.0, (thermal, 5)) * np.array([10.0, 5.0, 4.0, 3.0, -1.5])
        near = np.array([[1, 0.6, 0.15, 0.2, 0.3], [0.25, 0.2, 1, 0.3, 0.3], [0.1, 0.1, 0.2, 0.5, 0.2]])[zones]
        self.gain = strength * near
        self.fast = rng.exponential(1.0, (thermal, 5)) * 400 + 60
        self.slow = rng.uniform(1500, 9000, thermal)
        self.slow_share = rng.uniform(0.2, 0.7, thermal)
        self.room_tau = rng.uniform(600, 7200, thermal)
        if rng.random() < 0.5:  # a thin sensor in the splash of the coolant
            self.gain[-1] = [1.0, 0.5, 0.2, 0.2, -rng.uniform(2.0, 5.0)]
            self.fast[-1, 4], self.slow_share[-1] = rng.uniform(8.0, 60.0), 0.1
        self.noise = rng.choice([0.02, 0.05, 0.1], thermal + 1)
        self.grid = np.full(thermal + 1, rng.choice([0.1, 0.01, 0.05, 0.0]))
        self.grow = rng.uniform(1.0, 6.0, (self.axes, thermal)) * (rng.random((self.axes, thermal)) < 0.6)
        self.at_once = rng.uniform(2.0, 8.0, self.axes) * (rng.random() < 0.4)
        self.gauge_noise, self.gauge_ar = rng.choice([0.3, 0.6, 1.0]), rng.choice([0.0, 0.0, 0.85])
        self.gauge_grid = rng.choice([0.1, 0.01, 0.001])
        self.room = rng.uniform(18, 25)
        self.uneven, self.lossy, self.seldom = rng.random() < 0.2, rng.random() < 0.3, rng.random() < 0.1
        names = [Channel(f"T{i + 1}", "temperature", "degC") for i in range(thermal)]
        names += [Channel("Tamb", "ambient", "degC")] * self.has_ambient
        names += [Channel("n", "spindle_speed", "rpm")] * self.has_speed
        names += [Channel("coolant", "state", "1")] * self.has_coolant_bit
        names += [Channel(axis, "displacement", "um", axis=axis) for axis in "ZY"[: self.axes]]
        self.channels = tuple(names)

    def run(self, rng: np.random.Generator, samples: int) -> pd.DataFrame:
        dt, thermal = self.period, len(self.gain)
        time = np.arange(samples) * dt
        speed = _switched(rng, samples, dt, [0, 500, 1000, 2000, 3000, 4500])
        coolant = _switched(rng, samples, dt, [0, 1]) * (speed > 0) * (rng.random() < 0.7)
        load = speed / 4500
        sources = np.stack(
            [load**1.3, load, _switched(rng, samples, dt, [0, 0.5, 1]), np.full(samples, rng.random()), coolant]
        )
        warm = rng.random() < 0.25
        start = rng.uniform(0.2, 0.8) if warm else 0.0
        daily = self.room + rng.normal(0, 1.5)
        ambient = daily + rng.uniform(0.3, 2.0) * np.sin(2 * np.pi * (time / 86400 + rng.random()))
        ambient += 0.15 * np.cumsum(rng.normal(0, 1, samples)) * np.sqrt(dt / 3600)
        table: dict[str, np.ndarray] = {}
        places = np.empty((thermal, samples))
        for i in range(thermal):
            course = _lag(ambient, dt, self.room_tau[i], ambient[0])
            for s, source in enumerate(sources):
                quick = _lag(source, dt, self.fast[i, s], start * source.mean())
                slow = _lag(quick, dt, self.slow[i], start * source.mean())
                course = course + self.gain[i, s] * ((1 - self.slow_share[i]) * quick + self.slow_share[i] * slow)
            places[i] = course
            table[f"T{i + 1}"] = self._read(rng, course, i)
        if self.has_ambient:
            table["Tamb"] = self._read(rng, ambient, thermal)
            if self.seldom:
                table["Tamb"][np.arange(samples) % 10 != 0] = np.nan
        if self.has_speed:
            table["n"] = np.round(speed + rng.normal(0, 1.5, samples) * (speed > 0))
        if self.has_coolant_bit:
            table["coolant"] = coolant
        rise = places - ambient[0]
        for k, axis in enumerate("ZY"[: self.axes]):
            noise = lfilter([np.sqrt(1 - self.gauge_ar**2)], [1, -self.gauge_ar], rng.normal(0, 1, samples))
            moved = self.grow[k] @ rise + self.at_once[k] * (load * 4.5 / 3) ** 2
            moved = moved - moved[0] * (rng.random() < 0.9)
            table[axis] = np.round((moved + self.gauge_noise * noise) / self.gauge_grid) * self.gauge_grid
        frame = pd.DataFrame(table, index=time, columns=[channel.name for channel in self.channels])
        if self.uneven:
            keep = np.sort(rng.choice(samples, int(samples * 0.8), replace=False))
            frame = frame.iloc[keep]
            frame.index = frame.index + rng.uniform(0, 0.4 * dt, len(frame))
        elif self.lossy:
            frame = frame[rng.random(len(frame)) > 0.002]
            hole = int(rng.integers(0, max(1, len(frame) - 40)))
            frame = frame.drop(frame.index[hole : hole + int(rng.integers(1, 30))])
        return frame

    def _read(self, rng: np.random.Generator, course: np.ndarray, i: int) -> np.ndarray:
        noisy = course + rng.normal(0, self.noise[i], course.size)
        return np.round(noisy / self.grid[i]) * self.grid[i] if self.grid[i] else noisy


def _switched(rng: np.random.Generator, samples: int, dt: float, levels: list[float]) -> np.ndarray:
    """A source that is switched at random times, off at first and often for long."""
    course, at, level = np.zeros(samples), int(rng.uniform(60, 900) / dt) + 1, 0.0
    scale = rng.choice([600.0, 1800.0, 5400.0])
    while at < samples:
        level = float(rng.choice([x for x in levels if x != level]))
        until = at + int((rng.exponential(scale) + 5 * dt) / dt) + 1
        course[at:until] = level
        at = until
    return course


def _lag(source: np.ndarray, dt: float, tau: float, start: float) -> np.ndarray:
    keep = np.exp(-dt / tau)
    out, _ = lfilter([1 - keep], [1, -keep], source, zi=[keep * start])
    return np.asarray(out)


def plain_tables(runs: int = 4, samples: int = 720, dt: float = 20.0) -> dict[str, pd.DataFrame]:
    """Tables of a plain machine: six thermal channels, spindle speed, Z and Y; each run heats at another speed."""
    rng = np.random.default_rng(7)
    time = np.arange(samples) * dt
    tables = {}
    for k in range(runs):
        speed = np.where((time > 900) & (time < (0.5 + 0.04 * k) * time[-1]), 1500.0 + 500 * (k % 3), 0.0)
        speed[time > 0.8 * time[-1]] = 1000.0
        room = 21.0 + 0.3 * k + 0.4 * np.sin(time / 9000 + k)
        table = {"Tamb": room}
        for i, (gain, tau) in enumerate([(9, 900), (8, 1100), (5, 2500), (3, 4000), (6, 700)]):
            table[f"T{i + 1}"] = room + gain * _lag(speed / 2500, dt, tau, 0.0)
        table["Z"] = 6.0 * (table["T1"] - room) + 2.0 * (table["T3"] - room)
        table["Y"] = 3.0 * (table["T4"] - room) - 1.0 * (table["T5"] - room)
        for name in table:
            fine = 0.01 if name.startswith("T") else 0.1
            noise = 0.03 if name.startswith("T") else 0.5
            table[name] = np.round((table[name] + rng.normal(0, noise, samples)) / fine) * fine
        tables[f"r{k + 1}"] = pd.DataFrame({**table, "n": speed}, index=time)
    return tables


def plain_recording(tables: dict[str, pd.DataFrame]) -> Recording:
    """A recording of such tables."""
    names = next(iter(tables.values())).columns
    roles = {"Tamb": ("ambient", "degC"), "n": ("spindle_speed", "rpm"), "Z": ("displacement", "um")}
    roles["Y"] = roles["Z"]
    channels = [Channel(name, *roles.get(name, ("temperature", "degC"))) for name in names]
    return Recording.from_runs(tables, channels)
