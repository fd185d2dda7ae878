"""How far is a structure from quasi-steady while a shaft changes its speed: its modes, solved in time.

Each mode has the poles s = √λ and −s̄ [rad/s]: 1/(λ − ω²) ≈ 1/((s − ω)·(s̄ + ω)), the same resonance with a viscous
damper, which can be solved in time. For a force F of the phase θ, θ' = ω, a pole p answers with y' = i·p·y − i·F; as
long as F keeps its frequency, that is F/(p − ω). The difference of the two, over the poles, is what is late.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from selector.physics.vibration.coupled import unit_force
from selector.physics.vibration.modes import StructureModes, structure_modes
from selector.physics.vibration.shaft_course import ShaftCourse
from selector.physics.vibration.source import Line, Source
from selector.physics.vibration.spectrum import line_force_n
from selector.physics.vibration.structure import Structure

Vector = NDArray[np.float64]
Complex = NDArray[np.complex128]

_MOST_STEPS = 10_000_000
"""Samples × answers of one pole to one line, the largest first: about a second."""
_NOTHING = 1e-3
"""Share of all changes below which that of one pole under one line is left out."""
_GONE = 20.0
"""Decay within a sample, as an exponent, of what needs no time to follow."""
_PASSED = 400
_JITTER = 0.125
"""Part of the time constant over which a speed is averaged, to tell its noise from a run-up."""
_DETUNED = 1e-6


@dataclass(frozen=True)
class Answer:
    """One mode under one line: where they differ most from quasi-steady at one final.

    Attributes
    ----------
    line : int
        Number of the line, from 0.
    mode_hz, ring_s : float
        Frequency of the mode [Hz], and the time in which it fades to 1/e [s].
    steady_m : float
        Largest quasi-steady motion of the mode on the way [m].
    """

    line: int
    mode_hz: float
    ring_s: float
    steady_m: float


@dataclass(frozen=True, eq=False)
class LateMotion:
    """True minus quasi-steady motion, as an analytic signal.

    Attributes
    ----------
    time_s : ndarray of shape (n_times,)
        Even [s].
    motion_m : complex ndarray of shape (n_finals, n_times)
        [m].
    answers : tuple of Answer
        What differs most, one a final.
    """

    time_s: Vector
    motion_m: Complex
    answers: tuple[Answer, ...]


def late_motion(
    structure: Structure, source: Source, course: ShaftCourse, finals: Mapping[str, str], time_s: Vector
) -> LateMotion | None:
    """What the lines of `source` that follow its shaft make of the coupled structure, beyond quasi-steady.

    Steady at the first time. Where the course has many corners, as a recorded one, what is different only because the
    speed jitters, quicker than the mode could tell, does not count. None where nothing changes.

    Parameters
    ----------
    time_s : ndarray of shape (n_times,)
        Increasing; first and last and the median step count [s].
    """
    lines = [(number, line) for number, line in enumerate(source.lines) if line.order is not None]
    modes = _complete_modes(structure)
    step = float(np.median(np.diff(time_s)))
    time = np.linspace(time_s[0], time_s[-1], max(round((time_s[-1] - time_s[0]) / step), 1) + 1)
    step = float(time[1] - time[0])
    places = [structure.position(member) for member in finals.values()]
    taken = modes.shapes.T @ unit_force(structure, source.member, source.against)
    chosen = _changes(modes, modes.shapes[places] * taken, lines, course, time)
    chosen = chosen[: max(_MOST_STEPS // len(time), 1)]
    if not chosen:
        return None
    middle = 0.5 * (time[1:] + time[:-1])
    halfway, between, turns = course.rpm_at(middle) / 60.0, course.turns_at(middle), course.turns_at(time)
    speeds = _speeds(course, time, chosen[0].ring_s)
    late = np.zeros((len(speeds), len(places), len(time)), dtype=np.complex128)
    worst: list[tuple[float, Answer]] = [(-1.0, one) for one in map(chosen[0].answer, range(len(places)))]
    for number, line in lines:
        poles = [one for one in chosen if one.line == number]
        if not poles:
            continue
        order = line.order or 0.0
        turning = np.exp(2j * np.pi * np.mod(order * turns, 1.0))
        steady = [(2.0 * np.pi * order * one, line_force_n(line, order * one) * turning) for one in speeds]
        pulse = line_force_n(line, order * halfway) * np.exp(2j * np.pi * np.mod(order * between, 1.0))
        omega = 2.0 * np.pi * order * halfway
        for one in poles:
            moved = _followed(one.pole, omega, pulse, steady[0][1][0] / (one.pole - steady[0][0][0]), step)
            off = np.array([moved - force / (one.pole - rate) for rate, force in steady])
            least = float(np.abs(off).min(axis=0).max())
            for row, share in enumerate(one.shares):
                late[:, row] += share * off
                worst[row] = max(worst[row], (abs(share) * least, one.answer(row)), key=lambda case: case[0])
    smaller = late[0] if len(late) == 1 else np.where(np.abs(late[0]) <= np.abs(late[1]), late[0], late[1])
    return LateMotion(time, smaller, tuple(answer for _, answer in worst))


def _speeds(course: ShaftCourse, time: Vector, ring_s: float) -> list[Vector]:
    """Speeds to be quasi-steady at [r/s]: of the instant and, if recorded, around it, where there is less noise."""
    speeds = [course.rpm_at(time) / 60.0]
    around = max(_JITTER * min(ring_s, (time[-1] - time[0]) / 4.0), 0.5 * float(time[1] - time[0]))
    if len(course.time_s) > 1 and np.median(np.diff(course.time_s)) < around:
        speeds.append((course.turns_at(time + around) - course.turns_at(time - around)) / (2.0 * around))
    return speeds


@dataclass(frozen=True)
class _Change:
    """One pole under one line: what the finals take of it, and how much it changes on the way."""

    line: int
    pole: complex
    shares: tuple[complex, ...]
    steady: float
    size: float

    @property
    def ring_s(self) -> float:
        return 1.0 / self.pole.imag if self.pole.imag > 0 else float("inf")

    def answer(self, row: int) -> Answer:
        return Answer(self.line, abs(self.pole.real) / (2.0 * np.pi), self.ring_s, abs(self.shares[row]) * self.steady)


def _changes(
    modes: StructureModes, weights: Complex, lines: list[tuple[int, Line]], course: ShaftCourse, time: Vector
) -> list[_Change]:
    """Poles and lines whose quasi-steady answer changes between the lowest speed and the highest, largest first."""
    low, high = course.range_rpm(float(time[0]), float(time[-1]))
    step = float(time[1] - time[0])
    roots = np.sqrt(modes.eigenvalues_per_s2)
    found = []
    for number, line in lines:
        order = line.order or 0.0
        lowest, highest = order * low / 60.0, order * high / 60.0
        passed = np.concatenate(
            (np.linspace(lowest, highest, _PASSED), np.clip(roots.real / (2.0 * np.pi), lowest, highest))
        )
        force = line_force_n(line, passed)
        for mode, root in enumerate(roots.tolist()):
            damped = complex(root.real, max(root.imag, 0.0))
            if damped.imag * step > _GONE:
                continue
            for pole, sign in ((damped, 1.0), (-damped.conjugate(), -1.0)):
                beside = pole - 2.0 * np.pi * passed
                answer = force / np.where(beside == 0.0, np.inf, beside)
                shares = tuple((sign * weights[:, mode] / (2.0 * damped.real)).tolist())
                changed = float(np.abs(answer - answer[0]).max())
                found.append(_Change(number, pole, shares, float(np.abs(answer).max()), changed))
    total = np.array([sum(abs(one.shares[row]) * one.size for one in found) for row in range(len(weights))])
    ranked = [
        (float(np.max(np.abs(one.shares) * one.size / np.where(total > 0.0, total, 1.0))), number)
        for number, one in enumerate(found)
    ]
    return [found[number] for size, number in sorted(ranked, reverse=True) if size > _NOTHING]


def _followed(pole: complex, omega: Vector, force: Complex, start: complex, step: float) -> Complex:
    """Y at every sample; within a step, whose middle `omega` and `force` are of, the frequency stays: exact then."""
    from scipy.signal import lfilter

    half = 0.5 * step
    angle = (omega - pole) * half
    near = np.abs(angle) < 1e-6
    gain = np.sin(angle) / np.where(near, 1.0, angle)
    gain[near] = 1.0
    pushed = -2j * half * np.exp(1j * pole * half) * gain * force
    fade = np.exp(1j * pole * step)
    return np.concatenate(([start], lfilter([1.0], [1.0, -fade], pushed, zi=[fade * start])[0]))


def _complete_modes(structure: Structure) -> StructureModes:
    """Modes that span all motions: where two fall together, those of joints that differ by next to nothing."""
    modes = structure_modes(structure)
    if modes.complete:
        return modes
    joints = tuple(
        replace(joint, dissipation=joint.dissipation * (1.0 + _DETUNED * number) + _DETUNED * number)
        for number, joint in enumerate(structure.joints)
    )
    return structure_modes(replace(structure, joints=joints))
