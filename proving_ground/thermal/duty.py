"""What a machine is asked to do in a run, what the hall does meanwhile, and what a simulation leaves out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.signal import lfilter

from proving_ground.thermal.machine import Heat, Machine
from selector.types import Matrix, Vector

STEP_S = 5.0
"""Step of the truth [s]."""
STYLES = ("warm-up", "steps", "intermittent", "cooling", "staircase", "one speed")


@dataclass(frozen=True, eq=False)
class Duty:
    """One run of a machine."""

    run: str
    style: str  #: One of `STYLES`
    time_s: Vector  #: (n_steps,): Steps of `STEP_S` from the start of the run
    #: (n_steps,): ``"speed"`` [rpm], ``"feed"`` [mm/min], ``"coolant"`` (0 or 1), ``"flow"`` [L/min],
    #: ``"coolant_degc"``, ``"hall"`` [°C] and what a scenario adds
    courses: Mapping[str, Vector]

    def __getitem__(self, name: str) -> Vector:
        return self.courses[name]

    def having(self, **courses: Vector) -> Duty:
        """The same run with these courses."""
        return replace(self, courses={**self.courses, **courses})


def held(generator: np.random.Generator, n: int, low_min: float, high_min: float, levels: Vector) -> Vector:
    """A course of n steps that keeps a drawn level for a drawn while and never the same twice in a row."""
    result = np.empty(n)
    at, last = 0, -1
    while at < n:
        span = max(1, int(60.0 * generator.uniform(low_min, high_min) / STEP_S))
        choice = int(generator.integers(len(levels)))
        if choice == last:
            choice = (choice + 1) % len(levels)
        result[at : at + span] = levels[choice]
        at, last = at + span, choice
    return result


def wandering(generator: np.random.Generator, n: int, tau_s: float) -> Vector:
    """A smooth random course of unit standard deviation with a memory of about `tau_s`, second order."""
    e = np.exp(-STEP_S / tau_s)
    lead = int(4.0 * tau_s / STEP_S)
    course = lfilter([1.0], [1.0, -2.0 * e, e * e], generator.standard_normal(n + lead))[lead:]
    # long-run variance of the filter, not that of this stretch, or a short stretch would lose its trend
    variance = (1.0 + e * e) / ((1.0 - e * e) ** 3)
    return np.asarray(course / np.sqrt(variance))


def speed_programme(generator: np.random.Generator, style: str, n: int, highest_rpm: float) -> Vector:
    """Spindle speed [rpm] of a run."""
    speed = np.zeros(n)
    wait = int(60.0 * generator.uniform(5.0, 12.0) / STEP_S)
    high = highest_rpm * float(generator.uniform(0.7, 0.95))
    if style == "warm-up":
        speed[wait : int(n * generator.uniform(0.72, 0.82))] = high
    elif style == "steps":
        ladder = highest_rpm * np.array([0.0, 0.25, 0.4, 0.55, 0.7, 0.85, 1.0])
        speed[wait:] = held(generator, n - wait, 18.0, 55.0, ladder)
    elif style == "intermittent":
        on = held(generator, n - wait, 8.0, 30.0, np.array([0.0, 1.0]))
        speed[wait:] = on * held(generator, n - wait, 45.0, 90.0, highest_rpm * np.array([0.45, 0.65, 0.9]))
    elif style == "cooling":
        speed[wait : int(n * generator.uniform(0.30, 0.42))] = high
    elif style == "staircase":
        for k, share in enumerate((0.2, 0.4, 0.6, 0.8, 1.0)):
            speed[wait + int(k * 0.17 * (n - wait)) : wait + int((k + 1) * 0.17 * (n - wait))] = share * highest_rpm
    elif style == "one speed":
        speed[wait:] = 0.7 * highest_rpm
    else:
        raise ValueError(f"style {style!r}")
    return np.round(speed, -1)


def hall_course(generator: np.random.Generator, n: int, level_degc: float, swing_k: float, drift_k: float) -> Vector:
    """Hall temperature [°C]: a heater that switches, a slow drift, the day."""
    time = STEP_S * np.arange(n)
    period = float(generator.uniform(1100.0, 2400.0))
    tooth = 2.0 * np.abs(((time + generator.uniform(0.0, period)) / period) % 1.0 - 0.5) - 0.5
    day = np.sin(2 * np.pi * time / 86400.0 + generator.uniform(0, 2 * np.pi))
    slow = wandering(generator, n, 3500.0)
    course = swing_k * tooth + drift_k * (0.7 * slow + 0.9 * (day - day[0]))
    return np.asarray(level_degc + course - course[0])


def duty(
    generator: np.random.Generator,
    run: str,
    style: str,
    hours: float,
    highest_rpm: float,
    hall: tuple[float, float, float] = (21.0, 0.5, 0.4),
) -> Duty:
    """A run of this style; feed, coolant and hall have programmes of their own, see `hall_course`."""
    n = int(hours * 3600.0 / STEP_S)
    speed = speed_programme(generator, style, n, highest_rpm)
    feed = held(generator, n, 4.0, 28.0, np.array([0.0, 0.0, 2500.0, 5000.0, 9000.0]))
    coolant = held(generator, n, 12.0, 45.0, np.array([0.0, 1.0]))
    flow = coolant * held(generator, n, 15.0, 40.0, np.array([6.0, 12.0, 20.0]))
    air = hall_course(generator, n, *hall)
    tank = np.asarray(air[0] + generator.uniform(-3.0, 1.0) + 1.2 * wandering(generator, n, 2400.0), dtype=np.float64)
    courses: dict[str, Vector] = {
        "speed": speed,
        "feed": feed,
        "coolant": coolant,
        "flow": flow,
        "coolant_degc": tank,
        "hall": air,
    }
    return Duty(run, style, np.asarray(STEP_S * np.arange(n), dtype=np.float64), courses)


def lagged(course: Vector, lag_s: float, step_s: float) -> Vector:
    """A course behind a first-order lag, from its first value; as it is without one."""
    if lag_s <= 0.0:
        return course
    e = float(np.exp(-step_s / lag_s))
    return np.asarray(lfilter([1.0 - e], [1.0, -e], course, zi=[e * course[0]])[0])


BOTH: Mapping[str, float] = {"Z": 1.0, "Y": 1.0}


@dataclass(frozen=True, eq=False)
class Omission:
    """One thing that happens in the machine and not in its simulation, at any size (0 = not at all)."""

    id: str  #: Of the catalogue, or ``"hidden.…"``
    accept: tuple[str, ...] = ()  #: Ids that are right; empty = `id` alone
    place: str | None = None
    #: (Machine, Heat, Duty, size) -> Heat: The heat of the true machine, from that of the simulation
    heated: Callable[[Machine, Heat, Duty, float], Heat] = lambda _tool, heat, _duty, _size: heat
    #: (Machine, rises, Duty) -> mapping of str to ndarray: Axis → displacement at size 1 [µm] on the grid of the rises
    #: of the volumes (n_times, n_volumes) [K]
    shifted: Callable[[Machine, Matrix, Duty], Mapping[str, Vector]] | None = None
    #: (Machine, rises of every run) -> sequence of mapping of str to ndarray: What the simulation has in the place of
    #: `shifted` at size 1, fitted by its author
    stand_in: Callable[[Machine, Sequence[Matrix]], Sequence[Mapping[str, Vector]]] | None = None
    #: By what the response of an axis is multiplied, e.g. ``{"Z": 1, "Y": -0.7}``; an axis that is lacking: 0.
    axes: Mapping[str, float] = field(default_factory=lambda: BOTH)
    brief: bool = False  #: It shows for a part of the time only: windows are stated


Maker = Callable[[np.random.Generator, Sequence[Duty]], Omission]
"""Draws an omission for some duties."""
Change = Callable[[np.random.Generator, Sequence[Duty]], Sequence[Duty]]


def changed(**courses: Callable[[np.random.Generator, Duty], Vector]) -> Change:
    """Duties with other courses, each drawn from the generator and the duty as it is."""

    def change(generator: np.random.Generator, duties: Sequence[Duty]) -> list[Duty]:
        result = []
        for one in duties:
            for name, course in courses.items():
                one = one.having(**{name: course(generator, one)})
            result.append(one)
        return result

    return change


def once(generator: np.random.Generator, one: Duty, low: float, high: float, minutes: tuple[float, float]) -> Vector:
    """A course that is 1 for drawn minutes once in a run, from between these shares of it on, and never in the first.

    It is 0 besides.
    """
    course = np.zeros(len(one.time_s))
    if one.run != "r1":
        at = int(len(course) * generator.uniform(low, high))
        course[at : at + int(60.0 * generator.uniform(*minutes) / STEP_S)] = 1.0
    return course


def load(one: Duty) -> Vector:
    """Spindle speed as a share of its highest in the run."""
    return one["speed"] / max(1.0, float(one["speed"].max()))


def with_power(heat: Heat, inlet: str, watts: Vector) -> Heat:
    """The heat with more of it at an inlet."""
    power = dict(heat.power_w)
    power[inlet] = power.get(inlet, 0.0) + watts
    return replace(heat, power_w=power)


def with_bath(heat: Heat, bath: str, degc: Vector, factor: Vector) -> Heat:
    """The heat with a bath of this temperature whose films are multiplied by `factor`."""
    return replace(heat, bath_degc={**heat.bath_degc, bath: degc}, bath_factor={**heat.bath_factor, bath: factor})


def gated(
    generator: np.random.Generator, n: int, off_steps: tuple[float, float], on_steps: tuple[float, float]
) -> Vector:
    """A course of n steps that is 0 and 1 by turns for drawn numbers of steps, 0 first."""
    result = np.zeros(n)
    at = int(generator.uniform(*off_steps))
    while at < n:
        span = max(1, int(generator.uniform(*on_steps)))
        result[at : at + span] = 1.0
        at += span + max(1, int(generator.uniform(*off_steps)))
    return result
