"""How do tool and workpiece move in time, at constant speeds or while shafts run up, for given phases of the sources.

At constant speeds every line is a sinusoid, exactly. While the speed of a shaft changes its lines are quasi-steady;
where a resonance is passed too quickly for that, it is told.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from selector.errors import InputError
from selector.findings import Finding, Where
from selector.physics.ranges import joined
from selector.physics.vibration.finding_table import FINDINGS
from selector.physics.vibration.motion.final_motion import ChainMethod, final_motions, source_curve
from selector.physics.vibration.rounding import above, below
from selector.physics.vibration.structure.source import ShaftCourse, Source, excitation, line_force_n
from selector.physics.vibration.structure.structure import Structure, structure_modes, unit_force
from selector.types import Complex, Matrix, Vector

Beyond = Literal["refuse", "leave-out"]

HURRY = 0.1  #: Share of a final's largest motion from which on it is told that a run-up is too quick.
_MOST_MOMENTS = 20_000
_JITTER = 0.125  #: Part of the time constant over which a speed is averaged, to tell its noise from a run-up.


def run_up(
    structure: Structure,
    source: Source,
    course: ShaftCourse,
    finals: Mapping[str, str],
    time_s: Vector,
    *,
    half_rate_hz: float,
    chains: ChainMethod | None = None,
    beyond: Beyond = "refuse",
) -> tuple[Complex, Complex, list[Finding]]:
    """Force, motion and findings by the lines of `source` that follow its shaft; see `motion_signal`.

    The force [N] has the shape (n_times,), the motion [m] (n_finals, n_times); both are analytic signals whose
    imaginary parts are meant. `half_rate_hz` is half the sampling rate, from which on a line is refused or left out
    [Hz].

    InputError: a line that the sampling cannot carry, a resonance without dissipation, or the errors of
    `final_receptance`.
    """
    lines = [(number, line, line.order) for number, line in enumerate(source.lines) if line.order is not None]
    force = np.zeros(len(time_s), dtype=np.complex128)
    motion = np.zeros((len(finals), len(time_s)), dtype=np.complex128)
    findings: list[Finding] = []
    turns, rpm = course.turns_at(time_s), course.rpm_at(time_s)
    for number, _, order in lines:
        rows = np.flatnonzero(~below(order * rpm / 60.0, half_rate_hz))
        if len(rows):
            highest = order * float(rpm.max()) / 60.0
            findings.append(
                beyond_sampling(source, number, highest, half_rate_hz, beyond, from_s=float(time_s[rows[0]]))
            )
    low, high = course.range_rpm(float(time_s[0]), float(time_s[-1]))
    # a hair wider, so that rounding does not lead out of a curve
    ranges = [(order * low / 60.0 * (1.0 - 1e-12), order * high / 60.0 * (1.0 + 1e-12)) for _, _, order in lines]
    curves = [source_curve(structure, source, *one, finals, chains) for one in joined(ranges)]
    for (_, line, order), (_, highest) in zip(lines, ranges, strict=True):
        curve = next(one for one in curves if highest <= one.highest_hz)
        frequency = order * rpm / 60.0
        turning = line_force_n(line, frequency) * np.exp(2j * np.pi * np.mod(order * turns, 1.0))
        turning[~below(frequency, half_rate_hz)] = 0.0
        force += turning
        motion += curve.at(frequency) * turning
    jump_hz = None if chains is None else chains.split_hz
    if jump_hz is not None and any(
        not above(one.lowest_hz, jump_hz) and above(one.highest_hz, jump_hz) for one in curves
    ):
        told = FINDINGS.finding(
            "line-changes-chains",
            f"Lines of {source.name} pass {jump_hz:.4g} Hz, where the chains of the other range take over: the motion "
            "jumps there, which no machine does.",
            evidence={"source": source.name, "split_hz": jump_hz},
        )
        findings.append(told)
    return force, motion, findings


def beyond_sampling(
    source: Source,
    number: int,
    frequency_hz: float,
    half_rate_hz: float,
    beyond: Beyond,
    *,
    from_s: float | None = None,
) -> Finding:
    """The finding that a line, counted from 0, is left out from a time on; InputError if it is to be refused."""
    when = "" if from_s is None else f" from {from_s:.4g} s on"
    if beyond == "refuse":
        raise InputError(
            f"a line at {frequency_hz:.6g} Hz{when}",
            expected=f"lines below half the sampling rate, {half_rate_hz:.6g} Hz",
            where=f"sources.{source.name}.lines[{number + 1}]",
            advice=f"sample more often than every {0.5 / frequency_hz:.2g} s, or leave the line out",
        )
    return FINDINGS.finding(
        "line-beyond-sampling",
        f"Line {number + 1} of {source.name} comes to {frequency_hz:.4g} Hz{when}, the sampling carries less than "
        f"{half_rate_hz:.4g} Hz: where it is beyond that, it is left out.",
        Where(from_s=from_s),
        {"source": source.name, "line": number + 1, "frequency_hz": frequency_hz, "half_rate_hz": half_rate_hz},
    )


def too_quick(
    structure: Structure,
    source: Source,
    course: ShaftCourse,
    finals: Mapping[str, str],
    time_s: Vector,
    whole_m: Mapping[str, float],
) -> Finding | None:
    """The finding that a mode of the coupled structure cannot follow a line of `source`; of the worst one.

    The motion of a mode that fades to 1/e in the time τ is quasi-steady but for about what its steady motion changes by
    within τ: passing a resonance with the half-power width B at r [Hz/s] r/(½π·B²) of its peak. What is small beside
    `whole_m`, final → largest motion of the whole run by all sources [m], is not told.
    """
    modes, lasts_s = structure_modes(structure), float(time_s[-1] - time_s[0])
    places = [structure.position(member) for member in finals.values()]
    shares = np.abs(modes.shapes[places] * (modes.shapes.T @ unit_force(structure, source.member, source.against)))
    shares /= np.array([whole_m[name] or np.inf for name in finals])[:, None]
    worst, said = HURRY, None
    for number, root in enumerate(np.sqrt(modes.eigenvalues_per_s2).tolist()):
        ring_s = min(1.0 / max(root.imag, 1e-300), lasts_s)
        # the mean speed around each moment, in which there is less of the noise of a recorded one
        around_s = max(_JITTER * ring_s, lasts_s / _MOST_MOMENTS)
        moments_s = np.arange(-ring_s, lasts_s, 0.5 * around_s) + time_s[0]
        later = int(np.ceil(ring_s / (0.5 * around_s)))
        speed = (course.turns_at(moments_s + around_s) - course.turns_at(moments_s - around_s)) / (2.0 * around_s)
        for line in source.lines:
            if line.order is None:
                continue
            frequency = line.order * speed
            beside = root - 2.0 * np.pi * frequency
            steady = line_force_n(line, frequency) / (2.0 * root.real * np.where(beside == 0.0, np.inf, beside))
            # off resonance it follows sooner than it fades
            follows = np.minimum(np.ceil(2.0 / (np.maximum(np.abs(beside), 1e-300) * around_s)), later).astype(np.int64)
            places_before = np.maximum(np.arange(len(steady)) - follows, 0)
            off = np.abs(steady - steady[places_before])
            at, final = int(np.argmax(off)), int(np.argmax(shares[:, number]))
            if (share := float(shares[final, number] * off[at])) > worst:
                worst, before = share, slice(places_before[at], at + 1)
                rate = float(np.abs(np.diff(frequency[before])).max() / (0.5 * around_s))
                said = FINDINGS.finding(
                    "run-up-too-quick",
                    f"Order {line.order:g} of {source.name} changes at up to {rate:.3g} Hz/s, too quickly for the "
                    f"resonance at {root.real / (2.0 * np.pi):.4g} Hz, which fades to 1/e in {ring_s:.3g} s: the true "
                    f"motion is later, and higher or lower, by about {100 * min(share, 1.0):.0f} % of its maximum.",
                    Where(
                        channel=list(finals)[final],
                        from_s=max(float(moments_s[at] - time_s[0]) - ring_s, 0.0),
                        to_s=min(float(moments_s[at] - time_s[0]) + ring_s, lasts_s),
                    ),
                    {
                        "source": source.name,
                        "resonance_hz": root.real / (2.0 * np.pi),
                        "rate_hz_per_s": rate,
                        "slower_than_hz_per_s": rate * HURRY / share,
                        "share": share,
                    },
                    f"let the frequency change by less than {rate * HURRY / share:.3g} Hz/s there",
                )
    return said


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

    InputError: lines that the sampling cannot carry, or the errors of `final_motions`.
    """
    time = np.array(time_s, dtype=np.float64)
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
    for position, source in enumerate(sources):
        rows = np.flatnonzero(lines.source == position)
        if len(rows):
            amplitudes = np.vstack((still.motion_m[:, rows], lines.force_n[rows][None]))
            signal = _sinusoids(amplitudes * shift[position], lines.frequency_hz[rows], time)
            motion += signal[:-1]
            force[position] = signal[-1]
        if source.shaft in courses:
            course = courses[source.shaft]
            pushed, moved, odd = run_up(
                structure, source, course, finals, time, half_rate_hz=half_hz, chains=chains, beyond=beyond
            )
            motion += (moved * shift[position]).imag
            force[position] += (pushed * shift[position]).imag
            findings += odd
    speeds = {
        name: np.full(len(time), constant[name]) if name in constant else courses[name].rpm_at(time)
        for name in shaft_rpm
    }
    whole_m = dict(zip(finals, np.abs(motion).max(axis=1).tolist(), strict=True))
    for source in sources:
        if source.shaft in courses:
            told = too_quick(structure, source, courses[source.shaft], finals, time, whole_m)
            findings += [] if told is None else [told]
    for values in (time, motion, force, *speeds.values()):
        values.setflags(write=False)
    return MotionSignal(
        time, tuple(finals), tuple(source.name for source in sources), motion, force, speeds, tuple(findings)
    )


def _parted(shaft_rpm: Mapping[str, float | ShaftCourse]) -> tuple[dict[str, float], dict[str, ShaftCourse]]:
    """Shafts of constant speed, and those that change it."""
    courses = {name: one for name, one in shaft_rpm.items() if isinstance(one, ShaftCourse) and not one.is_level}
    others = {name: one for name, one in shaft_rpm.items() if name not in courses}
    return {name: float(one.rpm[0]) if isinstance(one, ShaftCourse) else one for name, one in others.items()}, courses


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
