"""How large is a motion of unknown phases, which periodic errors it leaves on the part, and where the cut chatters.

Every source is shifted by one of P equal steps of a turn, which makes N = P^n realisations (V eq. 10, 11) of the
analytic signal Z(t) = Σ_s e^{iφ_s}·z_s(t), z_s(t) = Σ_k X_k·e^{iω_k·t}. Why the "mean amplitude" of V is taken for the
mean of |Z| stands in docs/explanation/periodic-errors.md; there, under *Where it chatters*, the limit of regenerative
chatter of the whole structure, k = ∂P/∂S and G (Tlusty; Altintas, Manufacturing Automation, 2012, ch. 4).
"""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from selector.errors import InputError
from selector.physics.checks import Above0, Checked, Finite
from selector.physics.ranges import SAME, above, below
from selector.physics.vibration.final_motion import FinalMotions
from selector.physics.vibration.structure import Structure, StructureModes, receptances, unit_force
from selector.types import Array, Complex, ComplexMatrix, Indices, Mask, Vector

MOST_VALUES = 2_000_000_000  #: Realisations that differ × sections: some fifteen seconds.
MOST_REALISATIONS = 1 << 22
_DRAWN = 1 << 14  #: Realisations that are drawn where there are more: a mean of them is within half a percent.
_BLOCK = 1 << 15
_GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0


@dataclass(frozen=True, eq=False)
class Realisations:
    """Amounts of a motion over all realisations, in the unit of the motion (m)."""

    expected_m: float  #: A_m0: expectation of |Z|, mean over the sections (V eq. 10, 11)
    mean_abs_m: float  #: Expectation of |x|, mean over the sections
    rms_m: float  #: Root of the mean of x² over realisations and sections, in closed form (`mean_square`)
    largest_m: float  #: Largest |Z| of any realisation at any section
    count: int  #: How many were gone through: N, or fewer that were drawn of them


def realisation_amounts(
    motion_m: ArrayLike,
    frequency_hz: ArrayLike,
    source: ArrayLike,
    time_s: ArrayLike,
    *,
    n_sources: int,
    phases: int = 4,
) -> Realisations:
    """Amounts of the motion by these lines over all realisations and sections.

    N/P realisations are added up, and the P common shifts of each taken for |x| only. Sources without motion here are
    left out of the sum, but counted in N.

    `motion_m` is X of every line [m], at `frequency_hz` [Hz] and of `source`, the position of one of all `n_sources`:
    each of shape (n_lines,). `time_s` are the times of the sections [s], see `section_times`; `phases` is P ≥ 1.

    Where there are too many they are drawn (the same ones every time); `mean_square` needs none.
    """
    motion = np.asarray(motion_m, dtype=np.complex128)
    frequency, owner = np.asarray(frequency_hz, dtype=np.float64), np.asarray(source, dtype=np.int64)
    time = np.asarray(time_s, dtype=np.float64)
    moving = [motion[rows] for rows in (owner == s for s in range(n_sources))]
    turning = [frequency[owner == s] for s in range(n_sources)]
    active = [s for s in range(n_sources) if np.any(moving[s])]
    # logarithms: the powers may have thousands of digits
    most = min(MOST_REALISATIONS, max(MOST_VALUES // len(time), 1))
    are_few = max(len(active) - 1, 0) * math.log(phases) <= math.log(most) + SAME
    different = phases ** max(len(active) - 1, 0) if are_few else min(_DRAWN, most)
    step = np.exp(2j * np.pi * np.arange(phases) / phases)
    # all shifts of the later half of the sources beside all of the earlier: two small sums and one outer one
    half = max((len(active) + 1) // 2, 1)
    drawn = step[np.random.default_rng(0).integers(phases, size=(0 if are_few else len(active), different))]
    section = np.empty((3, len(time)))
    square = 0.0
    width = max(1, _BLOCK // different)
    for begin in range(0, len(time), width):
        block = slice(begin, begin + width)
        z = np.zeros((max(len(active), 1), len(time[block])), dtype=np.complex128)
        for row, s in enumerate(active):
            z[row] = moving[s] @ np.exp(2j * np.pi * np.outer(turning[s], time[block]))
        # a section a row, so that what is added up lies side by side
        if are_few:
            one, other = _shifted(z[:half], step, fixed=True), _shifted(z[half:], step, fixed=False)
            total = (one[:, :, None] + other[:, None, :]).reshape(-1, different)
        else:
            total = z.T @ drawn
        size = np.sqrt(total.real**2 + total.imag**2)
        section[0, block] = size.mean(axis=1)
        section[1, block] = _mean_ordinate(total, step if are_few else step[:1])
        section[2, block] = size.max(axis=1)
        square += float(np.sum(mean_square(z, phases=phases)))
    expected, mean_abs, largest = float(section[0].mean()), float(section[1].mean()), float(section[2].max())
    count = phases**n_sources if are_few else different
    return Realisations(expected, mean_abs, math.sqrt(max(square / len(time), 0.0)), largest, count)


def mean_square(z_m: ArrayLike, *, phases: int = 4) -> Vector:
    """E x² over all realisations at every section, in closed form; shape (n_sections,) [m²].

    For P ≥ 3 it is ½·Σ_s |z_s|², for P = 2 Σ_s (Im z_s)²: products of different sources cancel. For P = 1 there is one
    realisation, and nothing cancels: (Im Σ_s z_s)². E|Z|² is Σ_s |z_s|² for P ≥ 2.

    `z_m` is z_s at every section [m], shape (n_sources, n_sections).
    """
    z = np.atleast_2d(np.asarray(z_m, dtype=np.complex128))
    if phases == 1:
        return np.asarray(z.sum(axis=0).imag ** 2)
    if phases == 2:
        return np.asarray((z.imag**2).sum(axis=0))
    return np.asarray(0.5 * (z.real**2 + z.imag**2).sum(axis=0))


def section_times(sections: int, duration_s: float) -> Vector:
    """Times that lie evenly in (0, `duration_s`) without being a grid; ascending, shape (sections,) [s].

    Multiples of the golden ratio: a grid whose step is a multiple of a line's period would meet the line always at
    the same phase. The duration should hold several periods of the smallest difference between lines of one source.
    """
    return np.sort(np.mod((np.arange(sections) + 0.5) * _GOLDEN, 1.0)) * duration_s


def _shifted(z: ComplexMatrix, step: Complex, *, fixed: bool) -> ComplexMatrix:
    """Sums of these sources with all shifts, (n_sections, n_combinations); `fixed`: the first is not shifted."""
    sections = z.shape[1]
    total = z[0][:, None] if fixed else np.zeros((sections, 1), dtype=np.complex128)
    for row in z[1:] if fixed else z:
        total = (total[:, :, None] + (row[:, None] * step)[:, None, :]).reshape(sections, -1)
    return total


def _mean_ordinate(total: ComplexMatrix, step: Complex) -> Vector:
    """Mean of |Im(Z·e^{iφ})| over realisations and the common shifts φ; opposite shifts have the same amount."""
    phases = len(step)
    used = step[: phases // 2] if phases % 2 == 0 else step
    sums = np.zeros(len(total))
    for shift in used:
        if shift.imag == 0.0:
            sums += np.abs(total.imag).sum(axis=1)
        else:
            sums += np.abs(total.imag * shift.real + total.real * shift.imag).sum(axis=1)
    return np.asarray(sums / (len(used) * total.shape[1]))


@dataclass(frozen=True)
class Cutting(Checked):
    """Turning on a lathe.

    The law of the force is P = 10·C_p·t^x·S^y·V^n·K_p [N] with t in mm, S in mm/rev, V in m/min (V eq. 2).
    """

    diameter_mm: Above0  #: Diameter of the workpiece at the cut [mm]
    workpiece_rpm: Above0  #: Speed of the workpiece [r/min]
    feed_mm_per_rev: Above0  #: S [mm/rev]
    #: force_coefficient, depth_exponent, feed_exponent, speed_exponent and force_correction: C_p, x, y, n, K_p
    force_coefficient: Above0
    depth_exponent: Above0
    feed_exponent: Finite
    speed_exponent: Finite
    force_correction: Above0 = 1.0

    @property
    def speed_m_per_min(self) -> float:
        """V, cutting speed [m/min]."""
        return math.pi * self.diameter_mm * 1e-3 * self.workpiece_rpm


Kind = Literal["roughness", "waviness", "lobing", "runout"]
KINDS: tuple[Kind, ...] = ("roughness", "waviness", "lobing", "runout")
Direction = Literal["cut", "feed"]
_FINALS = ("tool", "workpiece")

_LEAST_LOBES = 1.5
_LEAST_TURNING = 0.5
_MOST_LOG = 600.0
_NO_FORCE_LOG = 200.0  #: Forces that are smaller yet leave no height by themselves, whatever the exponent.


@dataclass(frozen=True)
class Surface(Checked):
    """Where one kind of periodic error ends and the next begins."""

    #: Wavelength below which an error is roughness [mm]: the cut-off (ISO 21920-3, ISO 4288)
    roughness_below_mm: Above0 = 0.8
    #: Waves per revolution up to which an error belongs to the form of the cross-section
    lobing_up_to_upr: Above0 = 15.0


@dataclass(frozen=True)
class PeriodicError:
    """What the lines at one frequency leave on the surface."""

    frequency_hz: float  #: [Hz]
    sources: tuple[str, ...]  #: Sources that have a line there
    kind: Kind  #: {"roughness", "waviness", "lobing", "runout"}: See `error_kind`
    direction: Direction  #: {"cut", "feed"}: Along which `wavelength_mm` is measured
    wavelength_mm: float  #: V/f along the cut, S·n/f along the feed [mm]
    waves_per_revolution: float  #: f/n
    #: Turns by which the pattern is ahead after one revolution, −0.5 … 0.5: at 0 the waves of all turns lie side by
    #: side and make straight lines along the axis, otherwise they spiral
    advance: float
    #: S/|advance|, what a stylus that runs along the axis meets [mm]; None for straight lines
    axial_wavelength_mm: float | None
    amplitude_um: Mapping[str, float]  #: Final → expectation of its amplitude over the phases of the sources [µm]
    force_n: Mapping[str, float]  #: Final → m·ω²·A (V eq. 1) [N]
    height_um: Mapping[str, float]  #: Final → W (V eq. 2) [µm]
    published_um: float  #: Sum of W over tool and workpiece [µm]
    kinematic_um: float  #: 2·|X_tool − X_workpiece|, expectation over the phases of the sources [µm]
    realisations: int = 1  #: Combinations of phases that the expectations are over


@dataclass(frozen=True)
class KindHeight:
    """Height of all errors of one kind together."""

    kind: Kind  #: {"roughness", "waviness", "lobing", "runout"}
    #: W of the inertia forces of all lines of the kind added up, sum over tool and workpiece [µm]: all crests meet
    published_um: float
    #: Root of the sum of the squared heights `PeriodicError.published_um` [µm]: lines that know nothing of each other
    rms_um: float
    kinematic_um: float  #: The same root of the kinematic heights [µm]
    lines: int  #: Number of frequencies


def periodic_errors(
    motions: FinalMotions, cutting: Cutting, *, surface: Surface | None = None, phases: int = 4
) -> tuple[PeriodicError, ...]:
    """Periodic errors of the first revolution, one a frequency, by frequency; lines without motion leave none.

    Lines of one source at one frequency are added with their phases; several sources there by the expectation of the
    amplitude over P phase shifts of each.

    InputError: an exponent that makes a number too large.
    """
    limits, found = surface or Surface(), []
    relative = motions.of(*_FINALS)
    for rows in _same_frequency(motions.frequency_hz):
        frequency, owner = float(motions.frequency_hz[rows[0]]), motions.source[rows]
        if not np.any(motions.motion_m[:, rows]):
            continue
        force, amplitude = {}, {}
        for name in _FINALS:
            place = motions.finals.index(name)
            amplitude[name] = 1e6 * _expected(motions.motion_m[place, rows], owner, phases)[0]
            moment, _ = _expected(motions.moment_kg_m[place, rows], owner, phases)
            force[name] = moment * (2.0 * math.pi * frequency) ** 2
        height = {name: published_height_um(newton, cutting) for name, newton in force.items()}
        kind, direction, wavelength = error_kind(frequency, cutting, limits)
        upr = waves_per_revolution(frequency, cutting)
        # half a turn is ahead, also where rounding has it behind
        advance = min(upr - math.ceil(upr * (1.0 - SAME) - 0.5), 0.5)
        straight = abs(advance) <= SAME * upr
        apart, count = _expected(relative[rows], owner, phases)
        found.append(
            PeriodicError(
                frequency_hz=frequency,
                sources=tuple(motions.sources[s] for s in sorted(set(owner.tolist()))),
                kind=kind,
                direction=direction,
                wavelength_mm=wavelength,
                waves_per_revolution=upr,
                advance=0.0 if straight else advance,
                axial_wavelength_mm=None if straight else cutting.feed_mm_per_rev / abs(advance),
                amplitude_um=amplitude,
                force_n=force,
                height_um=height,
                published_um=sum(height.values()),
                kinematic_um=2e6 * apart,
                realisations=count,
            )
        )
    return tuple(found)


def kind_heights(errors: Iterable[PeriodicError], cutting: Cutting) -> tuple[KindHeight, ...]:
    """Height of every kind that occurs among these errors."""
    kept, totals = tuple(errors), []
    for kind in KINDS:
        same = [error for error in kept if error.kind == kind]
        if not same:
            continue
        forces = [sum(error.force_n[final] for error in same) for final in same[0].force_n]
        totals.append(
            KindHeight(
                kind=kind,
                published_um=sum(published_height_um(force, cutting) for force in forces),
                rms_um=math.hypot(*(error.published_um for error in same)),
                kinematic_um=math.hypot(*(error.kinematic_um for error in same)),
                lines=len(same),
            )
        )
    return tuple(totals)


def published_height_um(force_n: float, cutting: Cutting) -> float:
    """W [µm] of an inertia force [N] (V eq. 2): twice the depth of cut that the law of the force gives for it."""
    slope = _log_force_per_depth(cutting)
    if force_n == 0.0:
        return 0.0
    # logarithms: single powers may leave the range of numbers though the height does not
    ratio = math.log(force_n) - slope
    depth = ratio / cutting.depth_exponent
    if not (abs(slope) < _MOST_LOG and depth < _MOST_LOG and (depth > -_MOST_LOG or ratio < -_NO_FORCE_LOG)):
        raise InputError(
            f"no height in numbers for {force_n:g} N with the exponents x = {cutting.depth_exponent:g}, "
            f"y = {cutting.feed_exponent:g}, n = {cutting.speed_exponent:g}",
            expected="exponents of a law of the cutting force: x near 1, y near 0.75, n from −0.5 to 0",
            where="cutting.depth_exponent",
            advice="correct the exponents and C_p (t in mm, S in mm/rev, V in m/min)",
        )
    return 2e3 * math.exp(depth)


def error_kind(frequency_hz: float, cutting: Cutting, surface: Surface) -> tuple[Kind, Direction, float]:
    """Kind of the error at this frequency, along what its wavelength is measured, and the wavelength [mm].

    From 1.5 waves per revolution on a wave lies along the cut, V/f: lobing up to `lobing_up_to_upr`, however short the
    waves of a thin part are; beyond that roughness below the cut-off and waviness from it on. About one wave per
    revolution (0.5 to 1.5) moves the centre of the cross-section: runout. Slower ones differ from turn to turn and lie
    along the feed, S·n/f: roughness or waviness. At a limit is what differs from it by rounding alone.
    """
    upr = waves_per_revolution(frequency_hz, cutting)
    if below(upr, _LEAST_TURNING):
        along_feed = cutting.feed_mm_per_rev / upr
        return ("roughness" if below(along_feed, surface.roughness_below_mm) else "waviness"), "feed", along_feed
    along_cut = math.pi * cutting.diameter_mm / upr
    if below(upr, _LEAST_LOBES):
        return "runout", "cut", along_cut
    if above(frequency_hz, split_frequency_hz(cutting, surface)):
        return "roughness", "cut", along_cut
    return ("waviness" if above(upr, surface.lobing_up_to_upr) else "lobing"), "cut", along_cut


def waves_per_revolution(frequency_hz: float, cutting: Cutting) -> float:
    """f/n, n the speed of the workpiece."""
    upr = 60.0 * frequency_hz / cutting.workpiece_rpm
    if not (math.isfinite(upr) and upr > 0):
        raise InputError(
            f"{frequency_hz:g} Hz at {cutting.workpiece_rpm:g} r/min",
            expected="a frequency above 0 and a workpiece that turns",
            where="cutting.workpiece_rpm",
            advice="correct the speed of the workpiece [r/min]",
        )
    return upr


def split_frequency_hz(cutting: Cutting, surface: Surface) -> float:
    """Frequency above which waves along the cut are roughness, and chains of the high range hold [Hz].

    Where the wavelength is the cut-off; of a thin part, where `lobing_up_to_upr` waves a turn are shorter than that, at
    these, since V gives lobing to the low chains.
    """
    fine = cutting.speed_m_per_min * 1e3 / 60.0 / surface.roughness_below_mm
    return max(fine, surface.lobing_up_to_upr * cutting.workpiece_rpm / 60.0)


def _log_force_per_depth(cutting: Cutting) -> float:
    """Logarithm of 10·C_p·S^y·V^n·K_p."""
    return (
        math.log(10.0)
        + math.log(cutting.force_coefficient)
        + math.log(cutting.force_correction)
        + cutting.feed_exponent * math.log(cutting.feed_mm_per_rev)
        + cutting.speed_exponent * math.log(cutting.speed_m_per_min)
    )


def _same_frequency(frequency_hz: Array) -> list[Indices]:
    """Rows by frequency, together where they differ by rounding alone."""
    order = np.argsort(frequency_hz, kind="stable")
    ordered = frequency_hz[order]
    cuts = np.flatnonzero(np.diff(ordered) > SAME * ordered[1:]) + 1
    return [rows for rows in np.split(order, cuts) if len(rows)]


def _expected(amplitude_m: Complex, owner: Indices, phases: int) -> tuple[float, int]:
    """Expectation of the amplitude of lines at one frequency over the phases of their sources, and of how many."""
    names, source = np.unique(owner, return_inverse=True)
    if len(names) == 1:
        return float(abs(amplitude_m.sum())), phases
    still = np.zeros(len(amplitude_m))
    amounts = realisation_amounts(amplitude_m, still, source, [0.0], n_sources=len(names), phases=phases)
    return amounts.expected_m, amounts.count


#: Frequencies about every mode, evenly over so many of its half widths, beside as many over all modes.
_NEAR, _HALF_WIDTHS, _WIDE = 120, 6.0, 600
LEAST_LOSS = 1e-5  #: Loss factor below which a mode has no width that could be looked through: nothing damps it.
_STILL = 1e-20  #: Of the largest square of a mode between tool and workpiece: rounding.
_SPEEDS = 400
_HARDLY_LESS = 1.05  #: Between two frequencies k is less than at both by a share below this.
_HALVINGS = 40  #: Of the distance between two frequencies, to find where a lobe, or a negative real part, ends.


@dataclass(frozen=True, eq=False)
class StabilityLimit:
    """Depths of cut at which chatter begins, for a structure and a law of the cutting force."""

    frequency_hz: Vector  #: (n_frequencies,): Those at which the compliance has a negative real part, ascending [Hz]
    #: (n_frequencies,): Whether the next frequency belongs to the same stretch of negative real parts
    joined: Mask
    compliance: Callable[[Vector], Complex]  #: Frequencies [Hz] → G of the tool against the workpiece [m/N]
    cutting: Cutting

    def depth_mm(self, stiffness_n_per_m: Vector, speed_rpm: Vector) -> Vector:
        """Depth t at which the cut has this stiffness: k = y·10·C_p·t^x·S^(y−1)·V^n·K_p [mm]; shapes broadcast."""
        cut = self.cutting
        speed_m_per_min = math.pi * cut.diameter_mm * 1e-3 * np.asarray(speed_rpm)
        log_slope = (
            math.log(10.0 * cut.force_coefficient * cut.force_correction * cut.feed_exponent)
            + (cut.feed_exponent - 1.0) * math.log(cut.feed_mm_per_rev)
            + cut.speed_exponent * np.log(speed_m_per_min)
        )
        # of a law that is no law of a cut the depth may leave the range of numbers
        with np.errstate(over="ignore", under="ignore"):
            return np.asarray(np.exp((np.log(np.asarray(stiffness_n_per_m) * 1e-3) - log_slope) / cut.depth_exponent))

    def turns(self, frequency_hz: Vector, speed_rpm: Vector) -> Vector:
        """Waves between two turns: m where one of these frequencies is a limit at its speed; shapes broadcast."""
        # (3π + 2·arg G)/2π, by which a wave is ahead of the one before, is 0.5 to 1
        return np.asarray(60.0 * frequency_hz / speed_rpm - 1.5 - np.angle(self.compliance(frequency_hz)) / math.pi)

    def at_speed(self, speed_rpm: float) -> tuple[float, float]:
        """Least depth at which it chatters at this speed of the workpiece [mm], and the frequency there [Hz].

        Infinite, and NaN, where that is more than the radius of the workpiece.
        """
        depth, frequency = self.at_speeds(np.array([speed_rpm]))
        return float(depth[0]), float(frequency[0])

    def at_speeds(self, speed_rpm: Vector) -> tuple[Vector, Vector]:
        """As `at_speed` of each speed, (n_speeds,)."""
        turns = self.turns(self.frequency_hz, speed_rpm[:, None])
        whole = np.floor(turns)
        level = np.maximum(whole[:, 1:], whole[:, :-1])
        row, cell = np.nonzero(self.joined[:-1] & (whole[:, 1:] != whole[:, :-1]) & (level >= 0))
        # only those that may be the least of their speed
        ends = limit_stiffness(self.compliance(self.frequency_hz))
        surely = np.full(len(speed_rpm), np.inf)
        np.minimum.at(surely, row, np.maximum(ends[cell], ends[cell + 1]))
        maybe = np.minimum(ends[cell], ends[cell + 1]) <= _HARDLY_LESS * surely[row]
        row, cell = row[maybe], cell[maybe]
        level, rises = level[row, cell], turns[row, cell + 1] > turns[row, cell]
        low, high = self.frequency_hz[cell], self.frequency_hz[cell + 1]
        # where Re G goes to 0 the depth grows without bound: no straight line between two frequencies tells it
        for _ in range(_HALVINGS):
            middle = (low + high) / 2.0
            is_beyond = (self.turns(middle, speed_rpm[row]) >= level) == rises
            low, high = np.where(is_beyond, low, middle), np.where(is_beyond, middle, high)
        frequency = (low + high) / 2.0
        depth = self.depth_mm(limit_stiffness(self.compliance(frequency)), speed_rpm[row])
        depth[depth > self.cutting.diameter_mm / 2.0] = np.inf
        order = np.lexsort((depth, row))
        rows, first = np.unique(row[order], return_index=True)
        least, at_hz = np.full(len(speed_rpm), np.inf), np.full(len(speed_rpm), np.nan)
        least[rows], at_hz[rows] = depth[order][first], frequency[order][first]
        at_hz[np.isinf(least)] = np.nan
        return least, at_hz

    @property
    def least(self) -> tuple[float, float]:
        """Least stiffness of a cut that chatters at some speed [N/m], and the frequency there [Hz]."""
        stiffness = limit_stiffness(self.compliance(self.frequency_hz))
        at = int(np.argmin(stiffness))
        return float(stiffness[at]), float(self.frequency_hz[at])

    @cached_property
    def lobes(self) -> tuple[Vector, Vector]:
        """Speeds from a quarter of that of the workpiece to four times it [r/min], and the least depth at each [mm]."""
        speed = self.cutting.workpiece_rpm * np.geomspace(0.25, 4.0, _SPEEDS)
        parts = np.array_split(speed, max(1, len(speed) * len(self.frequency_hz) // 1_000_000))
        return speed, np.concatenate([self.at_speeds(part)[0] for part in parts])


def limit_stiffness(compliance: Complex) -> Vector:
    """Stiffness of the cut at the limit [N/m] of compliances [m/N]; infinite where their real part is not negative."""
    with np.errstate(divide="ignore"):
        return np.asarray(np.where(compliance.real < 0.0, -0.5 / compliance.real, np.inf))


def least_loss(structure: Structure, modes: StructureModes, *, tool: str, workpiece: str) -> float:
    """Least loss factor of the modes in which tool and workpiece move against each other."""
    gain = (modes.shapes.T @ unit_force(structure, tool, workpiece)) ** 2
    return float(modes.loss_factor[gain > _STILL * gain.max()].min(initial=math.inf))


def stability_limit(
    structure: Structure, modes: StructureModes, cutting: Cutting, *, tool: str, workpiece: str
) -> StabilityLimit | None:
    """Where chatter begins between two members.

    None if no frequency has a negative real part of the compliance, nothing damps a mode in which the two move against
    each other (any cut chatters in it), or the force does not grow with the thickness of the chip.
    """
    loss = least_loss(structure, modes, tool=tool, workpiece=workpiece)
    if cutting.feed_exponent <= 0.0 or loss < LEAST_LOSS:
        return None
    width = np.maximum(modes.loss_factor, loss) / 2.0
    steps = np.linspace(-_HALF_WIDTHS, _HALF_WIDTHS, _NEAR)
    near = modes.frequency_hz[:, None] * np.maximum(1.0 + width[:, None] * steps, 0.1)
    wide = np.geomspace(modes.frequency_hz[0] / 2.0, 2.0 * modes.frequency_hz[-1], _WIDE)
    force = unit_force(structure, tool, workpiece)
    gain = (modes.shapes.T @ force) ** 2

    def compliance(frequency_hz: Vector) -> Complex:
        if not modes.complete:
            return np.asarray(receptances(structure, frequency_hz, force[None])[0] @ force)
        beside = modes.eigenvalues_per_s2 - (2.0 * math.pi * np.asarray(frequency_hz)[..., None]) ** 2
        return np.asarray((gain / beside).sum(axis=-1))

    frequency = np.unique(np.concatenate([near.ravel(), wide]))
    negative = compliance(frequency).real < 0.0
    # to the very ends of the stretches
    ends = np.flatnonzero(negative[1:] != negative[:-1])
    here, there = frequency[ends], frequency[ends + 1]
    inside, outside = np.where(negative[ends], here, there), np.where(negative[ends], there, here)
    for _ in range(_HALVINGS):
        middle = (inside + outside) / 2.0
        is_inside = compliance(middle).real < 0.0
        inside, outside = np.where(is_inside, middle, inside), np.where(is_inside, outside, middle)
    frequency = np.unique(np.concatenate([frequency, inside]))
    at = np.flatnonzero(compliance(frequency).real < 0.0)
    if not len(at):
        return None
    return StabilityLimit(frequency[at], np.r_[np.diff(at) == 1, False], compliance, cutting)
