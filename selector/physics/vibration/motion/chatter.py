"""From which depth of cut on does turning become unstable, at every speed: regenerative chatter of the whole structure.

The limit, k = ∂P/∂S and G are those of *Where it chatters* in docs/explanation/periodic-errors.md (Tlusty; Altintas,
Manufacturing Automation, 2012, ch. 4; the law of the cutting force P: V eq. 2).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from selector.physics.vibration.motion.periodic_error import Cutting
from selector.physics.vibration.structure.structure import Structure, StructureModes, receptances, unit_force
from selector.types import Complex, Mask, Vector

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
