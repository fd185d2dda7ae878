"""How do tool and workpiece move in time, at constant speeds or while shafts run up, for given phases of the sources.

At constant speeds every line is a sinusoid, exactly. While the speed of a shaft changes its lines are quasi-steady; how
far the truth is from that is told by modes that are solved in time.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from selector.errors import InputError
from selector.findings import Finding, Where
from selector.physics.vibration.finding_table import FINDINGS
from selector.physics.vibration.motion.final_motion import ChainMethod, final_motions, source_curve
from selector.physics.vibration.rounding import above, below
from selector.physics.vibration.structure.source import Line, ShaftCourse, Source, excitation, line_force_n
from selector.physics.vibration.structure.structure import Structure, StructureModes, structure_modes, unit_force
from selector.types import Complex, Matrix, Vector

_MOST_STEPS = 10_000_000  #: Samples × answers of one pole to one line, the largest first: about a second.
_NOTHING = 1e-3  #: Share of all changes below which that of one pole under one line is left out.
_GONE = 20.0  #: Decay within a sample, as an exponent, of what needs no time to follow.
_PASSED = 400
_JITTER = 0.125  #: Part of the time constant over which a speed is averaged, to tell its noise from a run-up.
_DETUNED = 1e-6


@dataclass(frozen=True)
class Answer:
    """One mode under one line: where they differ most from quasi-steady at one final."""

    line: int  #: Number of the line, from 0
    #: mode_hz and ring_s: Frequency of the mode [Hz], and the time in which it fades to 1/e [s]
    mode_hz: float
    ring_s: float
    steady_m: float  #: Largest quasi-steady motion of the mode on the way [m]


@dataclass(frozen=True, eq=False)
class LateMotion:
    """True minus quasi-steady motion, as an analytic signal."""

    time_s: Vector  #: (n_times,): Even [s]
    motion_m: Complex  #: (n_finals, n_times): [m]
    answers: tuple[Answer, ...]  #: What differs most, one a final


def late_motion(
    structure: Structure, source: Source, course: ShaftCourse, finals: Mapping[str, str], time_s: Vector
) -> LateMotion | None:
    """What the lines of `source` that follow its shaft make of the coupled structure, beyond quasi-steady.

    Steady at the first time. Where the course has many corners, as a recorded one, what is different only because the
    speed jitters, quicker than the mode could tell, does not count. None where nothing changes.

    Of the times, which increase, first and last and the median step count [s].
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


Beyond = Literal["refuse", "leave-out"]

HURRY = 0.1  #: Share of a final's largest motion from which on it is told that a run-up is too quick.
_ALIKE = 0.05  #: Share by which two peaks differ that are about as large.
_STRETCHES = 1000
_UM = 1e6


@dataclass(frozen=True, eq=False)
class Hurry:
    """How far the motion of one final by one source is from the true one, as the coupled structure tells."""

    final: str
    off_m: float  #: Largest difference [m]
    answer: Answer  #: Line and mode that differ most
    #: changed_hz and rate_hz_per_s: By how much the frequency of the line changes while the mode fades to 1/e, and at
    #: most how quickly
    changed_hz: float
    rate_hz_per_s: float
    #: simulated_m and true_m: Largest motion by the source, in whatever phase it is [m]
    simulated_m: float
    true_m: float
    from_s: Vector  #: (n_stretches,): Starts of stretches of the same length [s]
    stretch_off_m: Vector  #: (n_stretches,): Largest difference in each [m]
    stretch_s: float  #: Their length [s]


@dataclass(frozen=True, eq=False)
class RunUp:
    """What the lines of one source that follow its shaft do, as analytic signals whose imaginary parts are meant."""

    force_n: Complex  #: (n_times,): [N]
    motion_m: Complex  #: (n_finals, n_times): [m]
    findings: tuple[Finding, ...]  #: Lines that the sampling cannot carry, a change from one set of chains to the other
    hurries: tuple[Hurry, ...]  #: How far it is from the true motion, one a final; none where nothing has to swing up


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
) -> RunUp:
    """Force and motion by the lines of `source` that follow its shaft; see `motion_signal`.

    `half_rate_hz` is half the sampling rate, from which on a line is refused or left out [Hz].

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
    curves = [source_curve(structure, source, *one, finals, chains) for one in _joined(ranges)]
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
    late = late_motion(structure, source, course, finals, time_s)
    hurries = () if late is None else tuple(_hurries(late, source, course, tuple(finals), time_s, motion))
    return RunUp(force, motion, tuple(findings), hurries)


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
    source: Source, hurries: Sequence[Hurry], whole_m: Mapping[str, float], begin_s: float, by_chains: bool
) -> Finding | None:
    """The finding that the true motion differs much from the simulated one, of the final where it does so most.

    `whole_m` is final → the largest motion of the whole run, by all sources [m]; `begin_s` the time of the first sample
    [s]; `by_chains` says how the motion was simulated.
    """
    told = [one for one in hurries if one.off_m > HURRY * whole_m[one.final] > 0.0]
    if not told:
        return None
    worst = max(told, key=lambda one: one.off_m)
    answer, whole, order = worst.answer, whole_m[worst.final], source.lines[worst.answer.line].order or 0.0
    long = worst.from_s[worst.stretch_off_m > HURRY * whole]
    # 10 % of what the mode makes at 0.16 times the square of its half-power width, and then it comes to its peak
    beside = max(whole / answer.steady_m, 1.0)
    slower = min(HURRY * beside * 0.5 * np.pi / (np.pi * answer.ring_s) ** 2, worst.rate_hz_per_s)
    off, simulated, true = (_UM * one for one in (worst.off_m, worst.simulated_m, worst.true_m))
    evidence = {
        "source": source.name,
        "line": answer.line + 1,
        "resonance_hz": answer.mode_hz,
        "changed_hz": worst.changed_hz,
        "rate_hz_per_s": worst.rate_hz_per_s,
        "slower_than_hz_per_s": slower,
        "off_um": off,
        "largest_um": _UM * whole,
        "share": worst.off_m / whole,
    }
    said = (
        f"Order {order:g} of {source.name} changes by {worst.changed_hz:.3g} Hz in "
        + (f"the {answer.ring_s:.3g} s" if np.isfinite(answer.ring_s) else "less than the time")
        + f" that a vibration at the resonance of {answer.mode_hz:.4g} Hz needs to fade to 1/e: the motion of "
        f"{worst.final} differs from the simulated one by up to {off:.3g} µm, "
        + (
            f"{worst.off_m / whole:.0%} of its largest value."
            if worst.off_m < whole
            else "more than its largest value."
        )
    )
    advice = f"Let the frequency change by less than {slower:.3g} Hz/s there"
    if by_chains:
        said, advice = f"{said} So says the coupled structure.", f"{advice}."
    else:
        evidence |= {"true_um": true, "simulated_um": simulated}
        peaks = f"In its worst phase it comes to about {true:.3g} µm by this source instead of {simulated:.3g} µm"
        if true > (1.0 + _ALIKE) * simulated:
            said += f" {peaks}: what begins so suddenly overshoots."
            advice += f", or reckon with {true:.3g} µm."
        elif true < (1.0 - _ALIKE) * simulated:
            said += f" {peaks}, and later: it has no time to swing up."
            advice += ", or take the simulated peak as an upper limit."
        else:
            said += f" The largest value by this source stays about {true:.3g} µm."
            advice += ", or believe the peak alone, not the course."
    where = Where(
        channel=worst.final, from_s=float(long[0]) - begin_s, to_s=float(long[-1]) + worst.stretch_s - begin_s
    )
    return FINDINGS.finding("run-up-too-quick", said, where, evidence, advice)


def _hurries(
    late: LateMotion, source: Source, course: ShaftCourse, finals: tuple[str, ...], time_s: Vector, motion_m: Complex
) -> Iterator[Hurry]:
    step, even = float(late.time_s[1] - late.time_s[0]), late.time_s
    starts = np.unique(np.linspace(0, len(even), _STRETCHES, endpoint=False).astype(int))
    for row, (final, answer) in enumerate(zip(finals, late.answers, strict=True)):
        size = np.abs(late.motion_m[row])
        at_s, order = float(even[int(np.argmax(size))]), source.lines[answer.line].order or 0.0
        frequency = order * course.rpm_at(even[(even >= at_s - answer.ring_s) & (even <= at_s)]) / 60.0
        yield Hurry(
            final,
            float(size.max()),
            answer,
            float(np.ptp(frequency)),
            float(np.abs(np.diff(frequency)).max(initial=0.0)) / step,
            float(np.abs(motion_m[row]).max()),
            float(np.abs(motion_m[row] + np.interp(time_s, even, late.motion_m[row])).max()),
            even[starts],
            np.maximum.reduceat(size, starts),
            float(even[-1] - even[0]) / len(starts),
        )


def _joined(ranges: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Ranges that overlap as one, by frequency."""
    found: list[tuple[float, float]] = []
    for low, high in sorted(ranges):
        if found and low <= found[-1][1]:
            found[-1] = found[-1][0], max(found[-1][1], high)
        else:
            found.append((low, high))
    return found


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
            course = courses[source.shaft]
            moved = run_up(structure, source, course, finals, time, half_rate_hz=half_hz, chains=chains, beyond=beyond)
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
