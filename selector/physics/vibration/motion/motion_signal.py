"""How do tool and workpiece move in time, at constant speeds or while shafts run up, for given phases of the sources.

At constant speeds every line is a sinusoid, exactly. While the speed of a shaft changes, its lines are quasi-steady
(`run_up`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from selector.errors import InputError
from selector.findings import Finding
from selector.physics.vibration.motion.final_motion import ChainMethod, final_motions
from selector.physics.vibration.motion.run_up import Beyond, Hurry, beyond_sampling, run_up, too_quick
from selector.physics.vibration.rounding import below
from selector.physics.vibration.structure.source import ShaftCourse, Source, excitation
from selector.physics.vibration.structure.structure import Structure
from selector.types import Complex, Matrix, Vector

_BLOCK = 512
_EVEN = 1e-8


@dataclass(frozen=True, eq=False)
class MotionSignal:
    """Motion of the finals and forces of the sources in time."""

    time_s: Vector  #: (n_times,): [s]
    #: finals and sources: Names of the rows
    finals: tuple[str, ...]
    sources: tuple[str, ...]
    motion_m: Matrix  #: (n_finals, n_times): [m]
    force_n: Matrix  #: (n_sources, n_times): What every source does to its member [N]
    shaft_rpm: Mapping[str, Vector]  #: (n_times,): Speed of every shaft [r/min]
    #: Lines that the sampling cannot carry, run-ups that are too quick, changes from one set of chains to the other
    findings: tuple[Finding, ...]


def source_phases_rad(sources: Sequence[Source], *, seed: int, phases: int = 4) -> dict[str, float]:
    """One of the `phases` equal shifts of a turn for every source, drawn with this seed: a realisation of V [rad]."""
    if phases < 1:
        raise InputError(
            f"{phases} phases", expected="at least 1", where="realisations.phases", advice="give at least one phase"
        )
    drawn = np.random.default_rng(seed).integers(phases, size=len(sources))
    return {source.name: float(2.0 * np.pi * step / phases) for source, step in zip(sources, drawn, strict=True)}


def motion_signal(
    structure: Structure,
    sources: Sequence[Source],
    shaft_rpm: Mapping[str, float | ShaftCourse],
    finals: Mapping[str, str],
    time_s: ArrayLike,
    *,
    phase_rad: Mapping[str, float] | None = None,
    chains: ChainMethod | None = None,
    beyond: Beyond = "refuse",
) -> MotionSignal:
    """Motion of the finals [m] and forces of the sources [N] at these times.

    A shaft that turns at constant speed has the angle 0 at time 0. One that stands still all the time shakes nothing;
    one that comes to a stop keeps the force of its last angle.

    Speeds are constant or courses [r/min]; `finals` is name → member; times increase [s]; `phase_rad` shifts all lines
    of a source [rad], by 0 where it is not named. Lines at or above half the sampling rate are an error, or, with
    `beyond` ``"leave-out"``, left out for as long as they are there, with a finding. They are never sampled as what
    they are not.

    InputError: times that do not increase, lines that the sampling cannot carry, or the errors of `final_motions`.
    """
    time = _checked_times(time_s)
    half_hz = 0.5 / float(np.median(np.diff(time)))
    constant, courses = _parted(shaft_rpm)
    shift = np.exp(1j * np.array([(phase_rad or {}).get(source.name, 0.0) for source in sources]))
    motion, force = np.zeros((len(finals), len(time))), np.zeros((len(sources), len(time)))
    lines = excitation(sources, {**constant, **dict.fromkeys(courses, 0.0)})
    findings = [
        beyond_sampling(
            sources[lines.source[row]], int(lines.line[row]), float(lines.frequency_hz[row]), half_hz, beyond
        )
        for row in np.flatnonzero(~below(lines.frequency_hz, half_hz))
    ]
    lines = lines.only(np.flatnonzero(below(lines.frequency_hz, half_hz)))
    still = final_motions(structure, sources, lines, finals, chains)
    changing: list[tuple[Source, tuple[Hurry, ...]]] = []
    for position, source in enumerate(sources):
        rows = np.flatnonzero(lines.source == position)
        if len(rows):
            amplitudes = np.vstack((still.motion_m[:, rows], lines.force_n[rows][None]))
            signal = _sinusoids(amplitudes * shift[position], lines.frequency_hz[rows], time)
            motion += signal[:-1]
            force[position] = signal[-1]
        if source.shaft in courses:
            moved = run_up(
                structure,
                source,
                courses[source.shaft],
                finals,
                time,
                half_rate_hz=half_hz,
                chains=chains,
                beyond=beyond,
            )
            motion += (moved.motion_m * shift[position]).imag
            force[position] += (moved.force_n * shift[position]).imag
            findings += moved.findings
            changing.append((source, moved.hurries))
    speeds = {
        name: np.full(len(time), constant[name]) if name in constant else courses[name].rpm_at(time)
        for name in shaft_rpm
    }
    if not (np.isfinite(motion).all() and np.isfinite(force).all()):
        raise InputError(
            "a motion or force beyond all numbers",
            expected="finite forces on a structure with dissipation",
            where="sources",
            advice="correct the forces, the unbalances or the speeds",
        )
    whole_m = dict(zip(finals, np.abs(motion).max(axis=1).tolist(), strict=True))
    hurried = (too_quick(one, hurries, whole_m, float(time[0]), chains is not None) for one, hurries in changing)
    findings += [one for one in hurried if one is not None]
    for values in (time, motion, force, *speeds.values()):
        values.setflags(write=False)
    return MotionSignal(
        time, tuple(finals), tuple(source.name for source in sources), motion, force, speeds, tuple(findings)
    )


def _parted(shaft_rpm: Mapping[str, float | ShaftCourse]) -> tuple[dict[str, float], dict[str, ShaftCourse]]:
    """Shafts of constant speed, and those that change it."""
    constant: dict[str, float] = {}
    courses: dict[str, ShaftCourse] = {}
    for name, speed in shaft_rpm.items():
        if not isinstance(speed, ShaftCourse):
            constant[name] = speed
        elif speed.is_level:
            constant[name] = float(speed.rpm[0])
        else:
            courses[name] = speed
    return constant, courses


def _sinusoids(amplitude: Complex, frequency_hz: Vector, time: Vector) -> Matrix:
    """Σ Im(X·e^{iωt}) over the lines, shape (n_rows, n_times); evenly spaced times need few exponentials."""
    step = (time[-1] - time[0]) / (len(time) - 1)
    even = np.abs(time - (time[0] + step * np.arange(len(time)))).max() <= _EVEN * step
    within = np.exp(2j * np.pi * np.outer(frequency_hz, step * np.arange(min(_BLOCK, len(time))))) if even else None
    found = np.empty((len(amplitude), len(time)))
    for begin in range(0, len(time), _BLOCK):
        block = time[begin : begin + _BLOCK]
        if within is None:
            turned = amplitude @ np.exp(2j * np.pi * np.outer(frequency_hz, block))
        else:
            start = time[0] + step * begin
            turned = (amplitude * np.exp(2j * np.pi * frequency_hz * start)) @ within[:, : len(block)]
        found[:, begin : begin + _BLOCK] = turned.imag
    return found


def _checked_times(time_s: ArrayLike) -> Vector:
    time = np.array(time_s, dtype=np.float64)
    if time.ndim != 1 or len(time) < 2 or not np.isfinite(time).all() or (np.diff(time) <= 0).any():
        raise InputError(
            "times that do not increase, or fewer than two",
            expected="at least two times, each after the one before",
            where="time_s",
            advice="sort the times and keep one row a time",
        )
    return time
