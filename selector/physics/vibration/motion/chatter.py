"""From which depth of cut on does turning become unstable, at every speed: regenerative chatter of the whole structure.

The tip meets the waves of the turn before. With x the motion of the tool against the workpiece along the thickness of
the chip, G its compliance and T the time of a turn, the force of the cut changes by k·(x(t − T) − x(t)), and the limit
is where ``1 + k·G(iω)·(1 − e^(−iωT)) = 0`` has a solution (Tlusty; Altintas, Manufacturing Automation, 2012, ch. 4):

    k = −1/(2·Re G),    ω·T = 2π·m + 3π + 2·arg G,    m = 0, 1, 2, … waves between two turns, Re G < 0.

k = ∂P/∂S is what one more millimetre of chip thickness costs, of the law of the cutting force P (V eq. 2).
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from selector.physics.vibration.motion.periodic_error import Cutting
from selector.physics.vibration.structure.structure import Structure, StructureModes, receptances, unit_force
from selector.types import Vector

#: Frequencies about every mode, evenly over so many of its half widths, beside as many over all modes.
_NEAR, _HALF_WIDTHS, _WIDE = 120, 6.0, 600
_LEAST_LOSS = 1e-5  #: Loss factor below which a mode has no width that could be looked through: nothing damps it.
_SPEEDS = 400


@dataclass(frozen=True, eq=False)
class StabilityLimit:
    """Depths of cut at which chatter begins, for a structure and a law of the cutting force."""

    frequency_hz: Vector  #: (n_frequencies,): Those at which the compliance has a negative real part, ascending [Hz]
    stiffness_n_per_m: Vector  #: (n_frequencies,): k of the cut at the limit [N/m]
    advance: Vector  #: (n_frequencies,): (3π + 2·arg G)/2π, turns by which a wave is ahead of the one before, 0.5 … 1
    #: (n_frequencies,): Whether the next frequency belongs to the same stretch of negative real parts
    joined: NDArray[np.bool_]
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

    def at_speed(self, speed_rpm: float) -> tuple[float, float]:
        """Least depth at which it chatters at this speed of the workpiece [mm], and the frequency there [Hz].

        Infinite, and NaN, where that is more than the radius of the workpiece.
        """
        turns = 60.0 * self.frequency_hz / speed_rpm - self.advance
        whole = np.floor(turns)
        crossed = np.flatnonzero(
            self.joined[:-1] & (whole[1:] != whole[:-1]) & (np.maximum(whole[1:], whole[:-1]) >= 0)
        )
        if not len(crossed):
            return math.inf, math.nan
        level = np.maximum(whole[crossed], whole[crossed + 1])
        share = (level - turns[crossed]) / (turns[crossed + 1] - turns[crossed])
        stiffness, frequency = (
            values[crossed] + share * (values[crossed + 1] - values[crossed])
            for values in (self.stiffness_n_per_m, self.frequency_hz)
        )
        least = int(np.argmin(stiffness))
        depth = float(self.depth_mm(stiffness[least], np.array(speed_rpm)))
        return (depth, float(frequency[least])) if depth <= self.cutting.diameter_mm / 2.0 else (math.inf, math.nan)

    @cached_property
    def lobes(self) -> tuple[Vector, Vector]:
        """Speeds from a quarter of that of the workpiece to four times it [r/min], and the least depth at each [mm]."""
        speed = self.cutting.workpiece_rpm * np.geomspace(0.25, 4.0, _SPEEDS)
        return speed, np.array([self.at_speed(float(rpm))[0] for rpm in speed])


def stability_limit(
    structure: Structure, modes: StructureModes, cutting: Cutting, *, tool: str, workpiece: str
) -> StabilityLimit | None:
    """Where chatter begins between two members.

    None if no frequency has a negative real part of the compliance, nothing damps a mode (any cut chatters in it), or
    the force does not grow with the thickness of the chip. InputError as `receptances`.
    """
    if cutting.feed_exponent <= 0.0 or modes.loss_factor.min() < _LEAST_LOSS:
        return None
    width = modes.loss_factor / 2.0
    steps = np.linspace(-_HALF_WIDTHS, _HALF_WIDTHS, _NEAR)
    near = modes.frequency_hz[:, None] * np.maximum(1.0 + width[:, None] * steps, 0.1)
    wide = np.geomspace(modes.frequency_hz[0] / 2.0, 2.0 * modes.frequency_hz[-1], _WIDE)
    frequency = np.unique(np.concatenate([near.ravel(), wide]))
    force = unit_force(structure, tool, workpiece)
    compliance = receptances(structure, frequency, force[None])[0] @ force
    negative = compliance.real < 0.0
    if not negative.any():
        return None
    at = np.flatnonzero(negative)
    return StabilityLimit(
        frequency_hz=frequency[at],
        stiffness_n_per_m=-0.5 / compliance.real[at],
        advance=1.5 + np.angle(compliance[at]) / math.pi,
        joined=np.r_[np.diff(at) == 1, False],
        cutting=cutting,
    )
