"""How do tool and workpiece move: line by line, over a range, and in time, by the coupled structure or by the chains.

In time for given phases of the sources. At constant speeds every line is a sinusoid, exactly. While the speed of a
shaft changes its lines are quasi-steady; where a resonance is passed too quickly for that, it is told.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from selector.errors import InputError
from selector.findings import Finding, Where
from selector.physics.ranges import SAME, above, below, joined
from selector.physics.vibration.chains import Chain, chain_receptance, force_sign, in_range
from selector.physics.vibration.finding_table import FINDINGS
from selector.physics.vibration.structure import (
    Excitation,
    ShaftCourse,
    Source,
    Structure,
    excitation,
    known_place,
    line_force_n,
    receptances,
    structure_modes,
    unit_force,
)
from selector.types import Complex, ComplexMatrix, Indices, Mask, Matrix, Vector

TOLERANCE = 1e-6  #: Largest difference between curve and response, as a share of the largest response in the range.
_MOST_POINTS = 50_000
_LEAST_POINTS = 9
_LEAST_SHARE = 1e-4
_LEAST_STEP = 1e-8
_WIDTHS = (1e-3, 0.05)


@dataclass(frozen=True, eq=False)
class ResponseCurve:
    """A complex response of several outputs from one frequency to another."""

    #: lowest_hz and highest_hz: Range of the curve [Hz]
    lowest_hz: float
    highest_hz: float
    #: By frequency; a frequency belongs to the first piece that reaches it
    pieces: tuple[CubicSpline[np.complex128], ...]
    ends_hz: Vector  #: (n_pieces,): Highest frequency of every piece [Hz]
    points: int  #: Frequencies at which the response was solved and kept

    def at(self, frequency_hz: Vector) -> ComplexMatrix:
        """The response, shape (n_outputs, n_freq)."""
        piece = np.minimum(np.searchsorted(self.ends_hz, frequency_hz), len(self.pieces) - 1)
        parts = [np.flatnonzero(piece == number) for number in range(len(self.pieces))]
        found = np.concatenate(
            [spline(frequency_hz[rows]) for spline, rows in zip(self.pieces, parts, strict=True)], axis=1
        )
        if len(parts) == 1:
            return np.asarray(found, dtype=np.complex128)
        sorted_back = np.empty_like(found)
        sorted_back[:, np.concatenate(parts)] = found
        return np.asarray(sorted_back, dtype=np.complex128)


def response_curve(
    solved: Callable[[Vector], ComplexMatrix],
    lowest_hz: float,
    highest_hz: float,
    *,
    loss_factor: float,
    jump_hz: float | None = None,
) -> ResponseCurve:
    """The curve of a response between two frequencies, within `TOLERANCE` of it at every midpoint.

    `solved` is frequencies of shape (n_freq,) [Hz] → responses of shape (n_outputs, n_freq). `loss_factor` is the
    smallest η of a resonance: no peak is narrower than its share η of its frequency, so none is stepped over. Above
    `jump_hz` another response holds.

    InputError: the response has a peak without end in the range, or that of `solved`.
    """
    ranges = [(lowest_hz, highest_hz)]
    if jump_hz is not None and not above(lowest_hz, jump_hz) and above(highest_hz, jump_hz):
        # what is at the jump but for rounding is not above it
        ranges = [
            (lowest_hz, max(jump_hz, lowest_hz)),
            (float(np.nextafter(jump_hz * (1.0 + SAME), np.inf)), highest_hz),
        ]
    pieces = [_piece(solved, begin, end, loss_factor) for begin, end in ranges]
    ends = [*(float(np.nextafter(begin, 0.0)) for begin, _ in ranges[1:]), highest_hz]
    return ResponseCurve(lowest_hz, highest_hz, tuple(pieces), np.array(ends), sum(len(one.x) for one in pieces))


def _piece(
    solved: Callable[[Vector], ComplexMatrix], low: float, high: float, loss_factor: float
) -> CubicSpline[np.complex128]:
    if high - low <= 1e-9 * high:
        # one frequency, but for rounding
        level: ComplexMatrix = np.repeat(solved(np.array([high])), 2, axis=1)
        return CubicSpline(np.array([low, low + max(high, 1.0)]), level, axis=1)
    frequency = _starting_grid(low, high, loss_factor)
    value = solved(frequency)
    doubtful = np.ones(len(frequency) - 1, dtype=np.bool_)
    while doubtful.any():
        steps = np.diff(frequency)[doubtful]
        if len(frequency) > _MOST_POINTS or (steps <= _LEAST_STEP * frequency[1:][doubtful]).any():
            raise InputError(
                f"a response without end near {frequency[1:][doubtful][np.argmin(steps)]:.6g} Hz",
                expected="joints with dissipation wherever a run-up goes through a resonance",
                where="joints",
                advice="give the dissipation of every joint, or keep the speed away from this frequency",
            )
        spline = CubicSpline(frequency, value, axis=1)
        middle = 0.5 * (frequency[:-1] + frequency[1:])[doubtful]
        exact = solved(middle)
        largest = np.maximum(np.abs(value).max(axis=1), np.abs(exact).max(axis=1))[:, None]
        bad = (np.abs(spline(middle) - exact) > TOLERANCE * largest).any(axis=0)
        frequency = np.concatenate((frequency, middle))
        value = np.concatenate((value, exact), axis=1)
        order = np.argsort(frequency, kind="stable")
        # both halves of an interval that was off, and what lies beside it
        near = np.concatenate((np.zeros(len(frequency) - len(middle), dtype=np.bool_), bad))[order]
        frequency, value = frequency[order], value[:, order]
        doubtful = near[:-1] | near[1:]
    return CubicSpline(frequency, value, axis=1)


def _starting_grid(low: float, high: float, loss_factor: float) -> Vector:
    """Steps in proportion to the frequency, so that every resonance has a point within its width."""
    width = min(max(loss_factor, _WIDTHS[0]), _WIDTHS[1])
    begin = max(low, high * _LEAST_SHARE)
    count = max(_LEAST_POINTS, int(np.ceil(np.log(high / begin) / width)) + 1)
    grid = np.geomspace(begin, high, count)
    grid[-1] = high
    if low < begin:
        return np.concatenate((np.linspace(low, begin, 5)[:-1], grid))
    grid[0] = low
    return grid


@dataclass(frozen=True)
class ChainMethod:
    """The published method (V), in the place of the coupled structure: its chains, and what parts their ranges."""

    chains: tuple[Chain, ...]
    #: Above it those of the high range hold, at and below it those of the low one [Hz]; None: all are of one range,
    #: which holds everywhere
    split_hz: float | None = None


@dataclass(frozen=True, eq=False)
class FinalReceptance:
    """Motion of the finals per unit force of one source."""

    #: motion_m_per_n and moment_kg_m_per_n: (n_finals, n_freq): X/F [m/N], and m·X/F [kg·m/N] with the mass that the
    #: method takes as that of the final
    motion_m_per_n: ComplexMatrix
    moment_kg_m_per_n: ComplexMatrix
    #: (n_finals, n_freq): Whether the method has a way from the source to the final; 0 stands where it has none
    carried: Mask


@dataclass(frozen=True, eq=False)
class FinalMotions:
    """Motion Im(X·e^{iωt}) of the finals by every line of the excitation."""

    finals: tuple[str, ...]  #: Their names, "tool" and "workpiece" as a rule
    frequency_hz: Vector  #: (n_lines,): [Hz]
    source: Indices  #: (n_lines,): Position of each line's source in `sources`
    motion_m: ComplexMatrix  #: (n_finals, n_lines): X [m]
    #: (n_finals, n_lines): m·X, by which the inertia force of V eq. 1 is ω²·|m·X| [kg·m]: m of the final member, with
    #: chains of its group
    moment_kg_m: ComplexMatrix
    sources: tuple[str, ...]  #: Names of all sources
    #: (n_finals, n_lines): Whether the method has a way from the source to the final; where it has none, X is 0
    carried: Mask

    def of(self, final: str, against: str | None = None) -> Complex:
        """X of one final, or of one against another, shape (n_lines,) [m]; ValueError for an unknown name."""
        motion = self.motion_m[self.finals.index(final)]
        return motion if against is None else motion - self.motion_m[self.finals.index(against)]


def final_motions(
    structure: Structure,
    sources: Sequence[Source],
    excitation: Excitation,
    finals: Mapping[str, str],
    chains: ChainMethod | None = None,
) -> FinalMotions:
    """Motion of the finals by every line; `excitation` must be that of these `sources`.

    Coupled: every member moves, the source pushes its member and, the other way, what it pushes against. By `chains`:
    those of the range summed over all that name the source and end at the final. `finals` is name → member.

    InputError: an unknown member, or a resonance that nothing damps.
    """
    shape = len(finals), len(excitation.frequency_hz)
    motion, moment = np.zeros(shape, dtype=np.complex128), np.zeros(shape, dtype=np.complex128)
    carried = np.zeros(shape, dtype=np.bool_)
    for position, source in enumerate(sources):
        rows = np.flatnonzero(excitation.source == position)
        if not len(rows):
            continue
        found = final_receptance(structure, source, excitation.frequency_hz[rows], finals, chains)
        force = excitation.force_n[rows]
        motion[:, rows] = found.motion_m_per_n * force
        moment[:, rows] = found.moment_kg_m_per_n * force
        carried[:, rows] = found.carried
    for values in (motion, moment, carried):
        values.setflags(write=False)
    return FinalMotions(
        tuple(finals), excitation.frequency_hz, excitation.source, motion, moment, excitation.sources, carried
    )


def final_receptance(
    structure: Structure,
    source: Source,
    frequency_hz: Vector,
    finals: Mapping[str, str],
    chains: ChainMethod | None = None,
) -> FinalReceptance:
    """Motion of the finals per unit force of one source at frequencies of shape (n_freq,); see `final_motions`."""
    places = [known_place(structure, member, "finals") for member in finals.values()]
    frequency = np.asarray(frequency_hz, dtype=np.float64)
    if chains is not None:
        return _by_chains(structure, source, frequency, finals, chains)
    force = unit_force(structure, source.member, source.against)
    motion = receptances(structure, frequency, force[None])[0][:, places].T
    mass = np.array([structure.members[place].mass_kg for place in places])
    return FinalReceptance(motion, motion * mass[:, None], np.ones(motion.shape, dtype=np.bool_))


def source_curve(
    structure: Structure,
    source: Source,
    lowest_hz: float,
    highest_hz: float,
    finals: Mapping[str, str],
    chains: ChainMethod | None = None,
) -> ResponseCurve:
    """Motion of the finals per unit force of one source as a curve between two frequencies; see `final_motions`."""

    def solved(frequency_hz: Vector) -> ComplexMatrix:
        return final_receptance(structure, source, frequency_hz, finals, chains).motion_m_per_n

    least = min((joint.loss_factor for joint in structure.joints), default=0.0)
    jump_hz = None if chains is None else chains.split_hz
    return response_curve(solved, lowest_hz, highest_hz, loss_factor=least, jump_hz=jump_hz)


def _by_chains(
    structure: Structure, source: Source, frequency: Vector, finals: Mapping[str, str], chains: ChainMethod
) -> FinalReceptance:
    mass = {member.name: member.mass_kg for member in structure.members}
    shape = len(finals), len(frequency)
    motion, moment = np.zeros(shape, dtype=np.complex128), np.zeros(shape, dtype=np.complex128)
    carried = np.zeros(shape, dtype=np.bool_)
    for row, member in enumerate(finals.values()):
        for chain in chains.chains:
            if chain.final != member or source.name not in chain.sources:
                continue
            held = in_range(chain.range, frequency, chains.split_hz)
            if not held.any():
                continue
            final = force_sign(chain, source) * chain_receptance(structure, chain, frequency[held]).final
            group = chain.branch[-1] if chain.branch else chain.path[0]
            motion[row, held] += final
            moment[row, held] += final * sum(mass[name] for name in group)
            carried[row, held] = True
    return FinalReceptance(motion, moment, carried)


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
    courses = {name: one for name, one in shaft_rpm.items() if isinstance(one, ShaftCourse) and not one.is_level}
    steady = {name: one for name, one in shaft_rpm.items() if name not in courses}
    constant = {name: float(one.rpm[0]) if isinstance(one, ShaftCourse) else one for name, one in steady.items()}
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
