"""How does a heated machine read, and what can be wrong with the readings of one channel in one run."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from proving_ground.case import Window
from proving_ground.concealment import Noise, coloured
from proving_ground.world import Runs
from selector.recording import Channel
from selector.types import Vector

Reading = Callable[[Vector, Vector, float], Vector]
"""(times [s], course, size) → what is read."""
RUNS = ("r1", "r2", "r3")


@dataclass(frozen=True)
class Fault:
    """A fault of one channel."""

    id: str  #: Of the catalogue
    reading: Reading  #: (times [s], course, size) -> course
    from_s: float  #: When it begins
    to_s: Callable[[float], float]  #: (size) -> float: When it ends

    def windows(self, runs: Sequence[int], size: float) -> tuple[Window, ...]:
        """When it acts, in these runs."""
        return tuple(Window(RUNS[run], self.from_s, self.to_s(size)) for run in runs)

    def read(
        self, time_s: Sequence[Vector], channels: Sequence[str], runs: Sequence[int]
    ) -> Callable[[Runs, float], Runs]:
        """What becomes of courses, by size, whose channels are read with it in some runs; `time_s` are of all runs."""

        def read(courses: Runs, size: float) -> Runs:
            if not size:
                return courses
            result = {name: list(parts) for name, parts in courses.items()}
            for name in channels:
                for run in runs:
                    result[name][run] = self.reading(time_s[run], result[name][run], size)
            return result

        return read


def late(length_s: float, unit_s: float, from_s: float = 0.0) -> Fault:
    """The clock is slow by size × `unit_s` from a moment on."""

    def reading(time_s: Vector, course: Vector, size: float) -> Vector:
        shifted = np.interp(time_s - size * unit_s, time_s, course)
        return np.where(time_s >= from_s, shifted, course)

    return Fault("data.clock", reading, from_s, lambda size: length_s)


def slow(length_s: float, unit_s: float) -> Fault:
    """The clock runs at another rate: size × `unit_s` are lost by the end of the run."""

    def reading(time_s: Vector, course: Vector, size: float) -> Vector:
        return np.interp(time_s * (1.0 - size * unit_s / length_s), time_s, course)

    return Fault("data.clock", reading, 0.0, lambda size: length_s)


def stretched(length_s: float, unit: float) -> Fault:
    """The scale is wrong by size × `unit`."""
    return Fault("data.gain", lambda time_s, course, size: course * (1.0 + size * unit), 0.0, lambda size: length_s)


def moved(length_s: float, unit: float) -> Fault:
    """The zero is off by size × `unit`."""
    return Fault("data.zero", lambda time_s, course, size: course + size * unit, 0.0, lambda size: length_s)


def running_away(length_s: float, unit: float, from_s: float, bend: float = 1.0) -> Fault:
    """The sensor runs away from a moment on, to size × `unit` at the end; with `bend` below 1 fast at first."""

    def reading(time_s: Vector, course: Vector, size: float) -> Vector:
        share = np.clip((time_s - from_s) / (length_s - from_s), 0.0, 1.0)
        return np.asarray(course + size * unit * share**bend)

    return Fault("data.drift", reading, from_s, lambda size: length_s)


def jumped(length_s: float, unit: float, from_s: float) -> Fault:
    """The sensor jumps by size × `unit` and stays."""

    def reading(time_s: Vector, course: Vector, size: float) -> Vector:
        return np.asarray(course + size * unit * (time_s >= from_s))

    return Fault("data.step", reading, from_s, lambda size: length_s)


def frozen(length_s: float, unit_s: float, from_s: float) -> Fault:
    """The reading freezes for size × `unit_s`, in steps of the recording; nothing before that is changed."""

    def end(size: float) -> float:
        return min(from_s + size * unit_s, length_s)

    def reading(time_s: Vector, course: Vector, size: float) -> Vector:
        first = int(np.searchsorted(time_s, from_s))
        last = int(np.searchsorted(time_s, end(size)))
        if last <= first:
            return course
        held = course.copy()
        held[first:last] = course[first]
        return held

    return Fault("data.stuck", reading, from_s, end)


PERIOD_S = 10.0
LENGTH_S = 5.0 * 3600.0
RESOLUTION_K = 0.002
SENSORS = ("T1", "T2", "T3", "T4")
CHANNELS = (
    Channel("T1", "temperature", "degC", place="front bearing"),
    Channel("T2", "temperature", "degC", place="rear bearing"),
    Channel("T3", "temperature", "degC", place="headstock"),
    Channel("T4", "temperature", "degC", place="column"),
    Channel("Tamb", "ambient", "degC", place="hall"),
    Channel("n", "spindle_speed", "rpm"),
    Channel("Z", "displacement", "um", axis="Z"),
    Channel("Y", "displacement", "um", axis="Y"),
)


@dataclass(frozen=True, eq=False)
class Heated:
    """A heated machine in three runs."""

    time_s: Vector  #: (n_rows,): The same in every run [s]
    #: Channel → true course in every run, sensors with their noise and resolution, displacements without
    courses: Mapping[str, Sequence[Vector]]
    true: Mapping[str, Sequence[Vector]]  #: Sensor → temperature of its place without noise and resolution
    gains: Mapping[str, Vector]  #: (4,): Response → growth per kelvin of the four places [µm/K]
    noise: Mapping[str, Noise]

    def grown(self, temperatures: Sequence[Sequence[Vector]], response: str) -> list[Vector]:
        """What temperatures make of a response, run by run [µm], from their rise over the start."""
        return [
            sum(
                (
                    gain * (part[run] - np.mean(part[run][:5]))
                    for gain, part in zip(self.gains[response], temperatures, strict=True)
                ),
                np.zeros(len(self.time_s)),
            )
            for run in range(len(RUNS))
        ]


def heated(generator: np.random.Generator, colour: str = "white") -> Heated:
    """A machine with its duty, drawn; its sensors read in steps of 2 mK."""
    draw = generator.uniform
    time = np.arange(0.0, LENGTH_S, PERIOD_S)
    # heat from body to body and to the hall [1/s]; heat of the bearings [K/s] at 10 000 r/min
    network = np.zeros((4, 4))
    for a, b, low, high in ((0, 2, 3e-4, 7e-4), (1, 2, 2e-4, 5e-4), (2, 3, 1e-4, 3e-4)):
        flow = draw(low, high)
        network[a, a] -= flow
        network[a, b] += flow
        network[b, b] -= 0.4 * flow
        network[b, a] += 0.4 * flow
    network -= np.diag(draw(1e-4, 3e-4, 4))
    heat = np.array([draw(8e-3, 1.4e-2), draw(5e-3, 9e-3), draw(0.0, 1e-3), 0.0])
    fine = 5.0
    step = expm(np.block([[network, np.eye(4)], [np.zeros((4, 8))]]) * fine)
    courses: dict[str, list[Vector]] = {channel.name: [] for channel in CHANNELS}
    true: dict[str, list[Vector]] = {name: [] for name in SENSORS}
    for run in range(len(RUNS)):
        speed = _duty(generator, time, monotonous=run == 0)
        # every morning alike, then another course: a run that is off as a whole is not the hall's doing
        hall = 20.5 + draw(-0.1, 0.1) + draw(0.6, 1.3) * np.sin(2 * np.pi * time / draw(14e3, 36e3)) * draw(-1.0, 1.0)
        rise = np.zeros(4)
        rises = np.empty((len(time), 4))
        for k in range(len(time)):
            rises[k] = rise
            for _ in range(round(PERIOD_S / fine)):
                rise = step[:4, :4] @ rise + step[:4, 4:] @ (heat * (speed[k] / 1e4) ** 1.5)
        for i, name in enumerate(SENSORS):
            read = hall + rises[:, i] + 0.002 * generator.standard_normal(len(time))
            courses[name].append(np.round(read / RESOLUTION_K) * RESOLUTION_K)
            true[name].append(hall + rises[:, i])
        courses["Tamb"].append(np.round(hall, 2))
        courses["n"].append(np.round(speed))
    gains = {
        "Z": np.array([draw(0.8, 1.6), draw(-1.2, -0.4), draw(0.6, 1.4), draw(0.8, 2.0)]),
        "Y": np.array([draw(-0.6, 0.2), draw(0.6, 1.4), draw(-1.0, -0.3), draw(-0.8, 1.2)]),
    }
    noise = {"T3": Noise(0.04, step=0.05)}
    for name in ("Z", "Y"):
        sd, rounding = draw(0.3, 0.7), 0.1 if colour == "white" else 0.01
        noise[name] = coloured(colour, sd, rounding, float(draw(0.5, 0.85)) if colour == "ar" else 0.0)
    machine = Heated(time, courses, true, gains, noise)
    for response in ("Z", "Y"):
        courses[response].extend(machine.grown([true[name] for name in SENSORS], response))
    return machine


def regressed(machine: Heated, courses: Mapping[str, Sequence[Vector]], response: str) -> list[Vector]:
    """What a user's simulation says of a response: a regression on the temperatures as they were read."""
    if response in SENSORS:
        return list(machine.true[response])
    return machine.grown([courses[name] for name in SENSORS], response)


def _duty(generator: np.random.Generator, time_s: Vector, *, monotonous: bool) -> Vector:
    """Speeds [r/min]: one warm-up with its cooling, or steps of many lengths."""
    if monotonous:
        stop = generator.uniform(0.5, 0.7) * LENGTH_S
        return np.where(time_s < stop, generator.uniform(5000.0, 9000.0), 0.0)
    ends = np.cumsum(generator.uniform(900.0, 3600.0, 30))
    levels = generator.choice([0.0, 2000.0, 4000.0, 6000.0, 8000.0, 10000.0], 31)
    levels[0] = 6000.0
    return np.asarray(levels[np.searchsorted(ends, time_s)])
