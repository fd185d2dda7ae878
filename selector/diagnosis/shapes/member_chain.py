"""Members of a vibrating chain: which channels they are, how one follows another, with what inertia they pull."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len
from scipy.signal import freqz

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.shapes.even_clock import even_runs
from selector.diagnosis.shapes.linear_response import LinearResponse, filter_between, linear_responses
from selector.diagnosis.shapes.signals import excited, filled, rate

Vector = NDArray[np.float64]

_MOTION = {"displacement": 0, "position": 0, "velocity": 1, "acceleration": 2}
_MOST = 3

_known: WeakKeyDictionary[Comparison, dict[tuple[str, str], LinearResponse | None]] = WeakKeyDictionary()


def members(comparison: Comparison, response: str) -> tuple[str, ...]:
    """Other channels that are motions of members: responses first."""
    names = [c.name for c in comparison.channels if c.role in _MOTION and c.name != response]
    names.sort(key=lambda name: name not in comparison.responses)
    return tuple(n for n in names if excited(filled(comparison, comparison.recorded[n])))[:_MOST]


def joints(comparison: Comparison, response: str) -> Iterator[tuple[str, LinearResponse, LinearResponse | None]]:
    """(member, path from a force to it, how the response follows it): the response itself, then simulated members."""
    for path in linear_responses(comparison, response):
        yield response, path, None
    for member in members(comparison, response):
        onward = transfer(comparison, member, response)
        if onward is not None:
            yield from (
                (member, path, onward) for path in linear_responses(comparison, member) if path.source is not None
            )


def transfer(comparison: Comparison, predecessor: str, follower: str) -> LinearResponse | None:
    """How one simulated motion follows another, both simulated; None if it does not, or is not simulated."""
    kept = _known.setdefault(comparison, {})
    if (predecessor, follower) not in kept:
        simulated = comparison.simulated
        both = predecessor in simulated and follower in simulated
        kept[predecessor, follower] = filter_between(comparison, predecessor, follower) if both else None
    return kept[predecessor, follower]


def inertia_force(comparison: Comparison, member: str, origin: str) -> Vector | None:
    """Acceleration of a member [unit of its channel, per s² where it is a displacement]; None if it is not there."""
    courses = comparison.simulated if origin == "simulated" else comparison.recorded
    if member not in courses:
        return None
    motion = filled(comparison, courses[member])
    order = _MOTION[comparison.channel(member).role]
    if order == 2:
        return motion
    return rate(comparison, motion) if order == 1 else curvature(comparison, motion)


def reactions(
    comparison: Comparison, path: LinearResponse, predecessor: str, successor: str
) -> tuple[Callable[[float], Vector], float]:
    """What the inertia m·ẍ of a simulated successor moves its predecessor by, as a function of m; loop gain at m = 1.

    The successor follows what it has moved, where the simulation shows how: δ = −m·G·s²·(x + H·δ), with G the path
    from a force to the predecessor and H from the predecessor to the successor. δ is in the predecessor's unit.
    """
    force = inertia_force(comparison, successor, "simulated")
    onward = transfer(comparison, predecessor, successor)
    if force is None:
        return lambda mass: np.zeros(len(comparison.time_s)), 0.0
    parts = []
    largest = 0.0
    for run in even_runs(comparison):
        part = run.on(force)
        size = next_fast_len(2 * len(part), real=True)
        angle = 2.0 * np.pi * np.arange(size // 2 + 1) / size
        g = _gain(path, angle)
        loop = g * _derivative(comparison, successor, angle)
        largest = max(largest, float(np.abs(loop if onward is None else loop * _gain(onward, angle)).max()))
        loop = loop * _gain(onward, angle) if onward is not None else 0.0 * loop
        parts.append((run, g * np.fft.rfft(part, size), loop, size))

    def moved(mass: float) -> Vector:
        result = np.zeros(len(comparison.time_s))
        for run, driven, loop, size in parts:
            course = np.fft.irfft(-mass * driven / (1.0 + mass * loop), size)
            result[run.rows] = run.back(course[: len(run.clock_s)])
        return result

    return moved, largest


def _gain(path: LinearResponse, angle: Vector) -> NDArray[np.complex128]:
    return np.asarray(freqz(path.numerator, path.denominator, angle)[1], dtype=np.complex128)


def _derivative(comparison: Comparison, member: str, angle: Vector) -> NDArray[np.complex128]:
    """From the channel of a member to its acceleration, by the same differences as `inertia_force`."""
    order = _MOTION[comparison.channel(member).role]
    period = comparison.period_s
    once = 1j * np.sin(angle) / period
    twice = (2.0 * np.cos(angle) - 2.0) / period**2 + 0j
    return np.asarray((twice, once, np.ones(len(angle)))[order], dtype=np.complex128)


def curvature(comparison: Comparison, values: Vector) -> Vector:
    """Second derivative in time of a course [unit/s²], by central differences on the even clock of every run."""
    result = np.zeros(len(values))
    for run in even_runs(comparison):
        part = run.on(values)
        second = np.zeros(len(part))
        second[1:-1] = (part[2:] - 2.0 * part[1:-1] + part[:-2]) / comparison.period_s**2
        result[run.rows] = run.back(second)
    return result


def displacement_of(comparison: Comparison, name: str, values: Vector) -> Vector:
    """A motion as a displacement: velocities and accelerations integrated, slow drift left out."""
    order = _MOTION.get(comparison.channel(name).role, 0)
    if order == 0:
        return values
    result = np.zeros(len(values))
    for run in even_runs(comparison):
        part = run.on(values)
        n = len(part)
        spectrum = np.fft.rfft(part - part.mean(), 2 * n)
        omega = 2.0 * np.pi * np.fft.rfftfreq(2 * n, comparison.period_s)
        slow = 2.0 * np.pi * 4.0 / (n * comparison.period_s)
        weight = (1j * omega) ** order / (omega**2 + slow**2) ** order * (-1.0) ** order
        result[run.rows] = run.back(np.fft.irfft(spectrum * weight, 2 * n)[:n])
    return result
