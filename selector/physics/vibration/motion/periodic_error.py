"""Which periodic errors the vibration leaves on the first revolution of the cut."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from selector.errors import InputError
from selector.physics.checks import require_finite, require_positive
from selector.physics.vibration.motion.final_motion import FinalMotions
from selector.physics.vibration.motion.realisations import any_phase_amplitude, are_countable, realisation_amounts
from selector.physics.vibration.rounding import SAME, above, below


@dataclass(frozen=True)
class Cutting:
    """Turning on a lathe.

    The law of the force is P = 10·C_p·t^x·S^y·V^n·K_p [N] with t in mm, S in mm/rev, V in m/min (V eq. 2).
    """

    diameter_mm: float  #: Diameter of the workpiece at the cut [mm]
    workpiece_rpm: float  #: Speed of the workpiece [r/min]
    feed_mm_per_rev: float  #: S [mm/rev]
    #: force_coefficient, depth_exponent, feed_exponent, speed_exponent and force_correction: C_p, x, y, n, K_p
    force_coefficient: float
    depth_exponent: float
    feed_exponent: float
    speed_exponent: float
    force_correction: float = 1.0

    def __post_init__(self) -> None:
        require_positive(
            self,
            "diameter_mm",
            "workpiece_rpm",
            "feed_mm_per_rev",
            "force_coefficient",
            "depth_exponent",
            "force_correction",
        )
        require_finite(self, "feed_exponent", "speed_exponent")

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
_NO_FORCE_LOG = 200.0
"""Forces that are smaller yet leave no height by themselves, whatever the exponent."""


@dataclass(frozen=True)
class Surface:
    """Where one kind of periodic error ends and the next begins."""

    #: Wavelength below which an error is roughness [mm]: the cut-off (ISO 21920-3, ISO 4288)
    roughness_below_mm: float = 0.8
    #: Waves per revolution up to which an error belongs to the form of the cross-section
    lobing_up_to_upr: float = 15.0

    def __post_init__(self) -> None:
        require_positive(self, "roughness_below_mm", "lobing_up_to_upr")


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
    #: Combinations of phases that the expectations are over; 0 where they are too many: then these are over phases that
    #: are anything instead of P steps of a turn (`any_phase_amplitude`)
    realisations: int = 1


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
    motions: FinalMotions,
    cutting: Cutting,
    *,
    surface: Surface | None = None,
    phases: int = 4,
) -> tuple[PeriodicError, ...]:
    """Periodic errors of the first revolution, one a frequency, by frequency; lines without motion leave none.

    Lines of one source at one frequency are added with their phases; several sources there by the expectation of the
    amplitude over P phase shifts of each, or over all phases where the combinations are too many to go through.

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
            amplitude[name] = 1e6 * _expected(motions.motion_m[place, rows], owner, phases)
            moment = _expected(motions.moment_kg_m[place, rows], owner, phases)
            force[name] = moment * (2.0 * math.pi * frequency) ** 2
        height = {name: published_height_um(newton, cutting) for name, newton in force.items()}
        kind, direction, wavelength = error_kind(frequency, cutting, limits)
        upr = waves_per_revolution(frequency, cutting)
        # half a turn is ahead, also where rounding has it behind
        advance = min(upr - math.ceil(upr * (1.0 - SAME) - 0.5), 0.5)
        straight = abs(advance) <= SAME * upr
        together = len(set(owner.tolist()))
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
                kinematic_um=2e6 * _expected(relative[rows], owner, phases),
                realisations=phases**together if are_countable(together, phases=phases) else 0,
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
    split = max(fine, surface.lobing_up_to_upr * cutting.workpiece_rpm / 60.0)
    if not (math.isfinite(split) and split > 0):
        raise InputError(
            f"{split:g} Hz",
            expected="a frequency above 0",
            where="cutting.diameter_mm",
            advice="correct diameter, speed of the workpiece, or the cut-off [mm]",
        )
    return split


def _log_force_per_depth(cutting: Cutting) -> float:
    """Logarithm of 10·C_p·S^y·V^n·K_p."""
    return (
        math.log(10.0)
        + math.log(cutting.force_coefficient)
        + math.log(cutting.force_correction)
        + cutting.feed_exponent * math.log(cutting.feed_mm_per_rev)
        + cutting.speed_exponent * math.log(cutting.speed_m_per_min)
    )


def _same_frequency(frequency_hz: NDArray[np.float64]) -> list[NDArray[np.int64]]:
    """Rows by frequency, together where they differ by rounding alone."""
    order = np.argsort(frequency_hz, kind="stable")
    ordered = frequency_hz[order]
    cuts = np.flatnonzero(np.diff(ordered) > SAME * ordered[1:]) + 1
    return [rows for rows in np.split(order, cuts) if len(rows)]


def _expected(amplitude_m: NDArray[np.complex128], owner: NDArray[np.int64], phases: int) -> float:
    """Expectation of the amplitude of lines at one frequency over the phases of their sources."""
    names, source = np.unique(owner, return_inverse=True)
    if len(names) == 1:
        return float(abs(amplitude_m.sum()))
    if not are_countable(len(names), phases=phases):
        together = [amplitude_m[source == number].sum() for number in range(len(names))]
        return any_phase_amplitude(np.abs(together))
    still = np.zeros(len(amplitude_m))
    amounts = realisation_amounts(amplitude_m, still, source, [0.0], n_sources=len(names), phases=phases)
    return amounts.expected_m
