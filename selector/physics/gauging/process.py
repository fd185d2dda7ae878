"""What is gauged: grinding with its feed and wear, the surface under the probe, what size is wanted."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike
from scipy.signal import lfilter

from selector.errors import Misfit
from selector.physics.checks import FROM_0, Above0, Checked, Finite, From0
from selector.physics.model_fields import Fit, Limits, Unit, Usual
from selector.types import Vector

_SECONDS = {"ms": 1e-3, "µs": 1e-6}
_TURNING, _CHANGING = Usual(2.0, 5e3, {"1/s": 60.0}), Usual(0.05, 1e5, {"1/ms": 1e3})
_SIZE = {"mm": 1e3, "nm": 1e-3, "m": 1e6}
_FEED = {"mm/min": 1e3 / 60, "µm/min": 1 / 60, "mm/s": 1e3, "m/s": 1e6}


@dataclass(frozen=True)
class Stage(Checked):
    """A feed that holds until the gauge gives the next command."""

    #: Infeed of the wheel, on the same count as the allowance [µm/s]
    feed_um_per_s: Annotated[Above0, Unit("µm/s"), Limits(1e-6, 1e6), Fit(), Usual(0.3, 300.0, _FEED)]
    #: Allowance at which the next stage, or the end, is wanted [µm]
    until_um: Annotated[Finite, Unit("µm"), Limits(0.0, 1e6), Fit(either_sign=50.0), Usual(0.0, 1e3, _SIZE)]


@dataclass(frozen=True)
class Grinding(Checked):
    """How the allowance of a part falls."""

    #: allowance_um and allowance_sd_um: Mean and standard deviation over the parts at the start [µm]
    allowance_um: Annotated[Above0, Unit("µm"), Limits(0.0, 1e6), Fit(), Usual(3.0, 3e3, _SIZE)]
    stages: tuple[Stage, ...]  #: The last one's `until_um` is x_k, the size at which the feed is to stop
    allowance_sd_um: Annotated[From0, Unit("µm"), Limits(0.0, 1e6), Fit(up_to=50.0)] = 0.0
    #: Standard deviation of the feed from part to part, as a share; with more some parts would not be fed at all
    feed_sd: Annotated[From0, Limits(0.0, 0.25), Fit(up_to=0.2)] = 0.0
    #: Time constant with which removal follows infeed: springs of the machine over sharpness of the wheel [s]
    lag_s: Annotated[From0, Unit("s"), Limits(1e-9, 1e4), Fit(up_to=5.0), Usual(0.0, 20.0, _SECONDS)] = 0.0
    #: Radius that the wheel loses, as a share of what it removes, when freshly dressed: the allowance falls slower
    wheel_wear: Annotated[From0, Limits(0.0, 1e3), Fit(up_to=0.5), Usual(0.0, 0.95, {"%": 0.01})] = 0.0
    #: wear_growth_per_part and dress_every: The share grows by this with every part, as a share of itself, and is as at
    #: first again after so many parts; 0: never dressed
    wear_growth_per_part: Annotated[From0, Unit("1/part"), Limits(0.0, 10.0), Fit(up_to=0.1)] = 0.0
    dress_every: Annotated[int, FROM_0, Limits(0, 1000000000)] = 0
    #: Length that the tip loses: the gauge sees so much less allowance than there is, stops earlier, and leaves each
    #: part larger by it than the one before [µm]
    probe_wear_um_per_part: Annotated[Finite, Unit("µm/part"), Limits(0.0, 1e3), Fit(either_sign=0.1)] = 0.0

    def _misfits(self) -> Iterator[Misfit]:
        ends = [self.allowance_um, *(stage.until_um for stage in self.stages)]
        if not self.stages or any(b >= a for a, b in pairwise(ends)):
            until = ", ".join(f"{end:g}" for end in ends[1:]) or "nowhere"
            expected = "at least one stage, each ending at less allowance than the one before"
            advice = "sort the stages; the first begins at allowance_um"
            yield f"stages until {until} µm of {self.allowance_um:g} µm", expected, "stages", advice
        if self.wheel_wear >= 1.0:
            found = f"{self.wheel_wear:g}: the wheel loses more than it removes"
            yield found, "a share below 1", "wheel_wear", "give the loss of radius over the removed allowance"


@dataclass(frozen=True)
class Surface(Checked):
    """What the probe meets on a turn of the workpiece: grooves, keyways or holes, and run-out."""

    #: [r/min]
    workpiece_rpm: Annotated[From0, Unit("r/min"), Limits(0.0, 1e6), Fit(), _TURNING] = 0.0
    grooves: Annotated[int, FROM_0, Limits(0, 10000)] = 0  #: Interruptions on the circumference; 0: a whole surface
    #: Part of the circumference that they take
    groove_share: Annotated[From0, Limits(0.0, 1.0), Fit(low=0.0, high=0.95)] = 0.0
    #: How much deeper the probe reaches in them [µm]
    groove_depth_um: Annotated[From0, Unit("µm"), Limits(0.0, 1e6), Fit(up_to=1e3), Usual(0.0, 3e4, {"nm": 1e-3})] = 0.0
    #: Amplitude of the once-per-turn change of the allowance [µm]
    runout_um: Annotated[From0, Unit("µm"), Limits(0.0, 1e6), Fit(up_to=20.0), Usual(0.0, 200.0, {"nm": 1e-3})] = 0.0

    def _misfits(self) -> Iterator[Misfit]:
        expected = "a share between 0 and 1, and a speed, where the surface has grooves or run-out"
        advice = "correct it, or leave grooves and run-out at 0"
        if self.groove_share >= 1.0 or (self.grooves > 0 and self.groove_share == 0):
            yield f"grooves on {self.groove_share:g} of the circumference", expected, "groove_share", advice
        if (self.grooves > 0 or self.runout_um > 0) and self.workpiece_rpm == 0:
            yield "a workpiece that stands still", expected, "workpiece_rpm", advice


@dataclass(frozen=True)
class Noise(Checked):
    """What the gauge sees besides the allowance: centred, Gaussian, R(τ) = D·exp(−β|τ|) (G eq. 2)."""

    #: √D_x [µm]
    sd_um: Annotated[From0, Unit("µm"), Limits(0.0, 1e6), Fit(up_to=5.0), Usual(0.0, 20.0, {"nm": 1e-3})] = 0.0
    #: β [1/s]
    rate_per_s: Annotated[Above0, Unit("1/s"), Limits(1e-6, 1e7), Fit(), _CHANGING] = 100.0


@dataclass(frozen=True)
class Correction(Checked):
    """Finished parts are measured, and the zero of the gauge follows what they are off."""

    share: Annotated[Above0, Limits(1e-6, 1.0)]  #: Of what a part is off, by which the zero is then moved
    #: Standard deviation of the measurement of a finished part [µm]
    gauge_sd_um: Annotated[From0, Unit("µm"), Limits(0.0, 1e6), Usual(0.0, 20.0, {"nm": 1e-3})] = 0.0
    parts_late: Annotated[int, FROM_0, Limits(0, 1000)] = 0  #: Parts that are ground while one waits to be measured

    def _misfits(self) -> Iterator[Misfit]:
        # Levin and May (1976), J. Math. Biol. 3, 323–324
        most = 2.0 * math.sin(0.5 * math.pi / (2 * self.parts_late + 1))
        if self.share >= most:
            found = f"{self.share:g} of what a part is off, {self.parts_late} parts late"
            expected = f"less than {most:.3g}: from there on each correction overshoots the one before"
            yield found, expected, "share", "correct by a smaller share, or measure sooner"

    def followed_um(self, off_um: Vector) -> Vector:
        """What parts are off that would be off by `off_um`, shape (n_parts,), measured without noise [µm]."""
        steps = np.zeros(self.parts_late + 2)
        steps[:2] = 1.0, -1.0
        fed_back = steps.copy()
        fed_back[-1] += self.share
        return np.asarray(lfilter(steps, fed_back, off_um))


@dataclass(frozen=True)
class Tolerance(Checked):
    """Limits of the finished size, counted from the nominal size."""

    #: lower_um and upper_um: [µm]
    lower_um: Annotated[Finite, Unit("µm"), Limits(0.0, 1e6), Usual(0.05, 500.0, _SIZE)]
    upper_um: Annotated[Finite, Unit("µm"), Limits(0.0, 1e6), Usual(0.05, 500.0, _SIZE)]

    def _misfits(self) -> Iterator[Misfit]:
        if self.lower_um >= self.upper_um:
            found = f"[{self.lower_um:g}, {self.upper_um:g}] µm"
            yield found, "a lower and an upper limit", "lower_um", "exchange the two numbers"


def surface_um(surface: Surface, turn: ArrayLike) -> Vector:
    """What is seen besides the allowance after so many turns: −depth in grooves, and a sine of the run-out [µm]."""
    at = np.asarray(turn, dtype=np.float64)
    seen = surface.runout_um * np.sin(2 * math.pi * at)
    if surface.grooves:
        seen = seen - surface.groove_depth_um * (np.mod(surface.grooves * at, 1.0) < surface.groove_share)
    return np.asarray(seen)


def mean_surface_um(surface: Surface) -> float:
    """Mean of `surface_um` over a turn: a linear gauge sees so much less allowance than there is [µm]."""
    return -surface.groove_depth_um * surface.groove_share if surface.grooves else 0.0


def smoothed_surface(surface: Surface, time_constant_s: float, turn: ArrayLike) -> tuple[Vector, Vector]:
    """`surface_um` behind a filter of T_Φ when it has settled, and its rate; shapes of `turn` [µm], [µm/s].

    Sine by its amplitude and phase; grooves exactly, as pieces of exponentials that repeat.
    """
    at = np.asarray(turn, dtype=np.float64)
    value, rate = np.zeros_like(at), np.zeros_like(at)
    per_s = surface.workpiece_rpm / 60.0
    if surface.runout_um > 0:
        omega = 2 * math.pi * per_s
        size, behind = surface.runout_um / math.hypot(1.0, omega * time_constant_s), math.atan(omega * time_constant_s)
        value = value + size * np.sin(2 * math.pi * at - behind)
        rate = rate + size * omega * np.cos(2 * math.pi * at - behind)
    if surface.grooves and surface.groove_depth_um > 0:
        pitch = 1.0 / (surface.grooves * per_s) / time_constant_s
        share = surface.groove_share
        # from 0 towards 1 within a groove, and back to 0 until the next; in the unit −depth
        deepest = -math.expm1(-share * pitch) / -math.expm1(-pitch)
        least = deepest * math.exp(-(1.0 - share) * pitch)
        within = np.mod(surface.grooves * at, 1.0)
        inside = within < share
        filled = np.where(
            inside, 1.0 - (1.0 - least) * np.exp(-within * pitch), deepest * np.exp(-(within - share) * pitch)
        )
        value = value - surface.groove_depth_um * filled
        rate = rate - surface.groove_depth_um * (inside - filled) / time_constant_s
    return value, rate
