"""How far do tool and workpiece move, line by line or over a range: by the coupled structure, or by the chains."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from selector.errors import InputError
from selector.physics.vibration.chains import Chain, chain_receptance, force_sign, in_range
from selector.physics.vibration.rounding import SAME, above
from selector.physics.vibration.structure.source import Excitation, Source
from selector.physics.vibration.structure.structure import Structure, known_place, receptances, unit_force
from selector.types import Complex, ComplexMatrix, Indices, Mask, Vector

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
