"""Where the last stage begins and how the smoothed reading falls in it, on average: what the formulas of sizes go by.

All in micrometres of allowance: the voltage less its bias over the gain. A command is given where the reading falls to
its threshold.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from selector.errors import InputError
from selector.physics.gauging.gauge.threshold import mean_allowance_um, mean_voltage_v
from selector.physics.gauging.gauge.transducer import LinearGauge
from selector.physics.gauging.grinding.gauged_grinding import GaugedGrinding
from selector.physics.gauging.process import Surface, ripple_bound_um, smoothed_surface
from selector.types import Vector

_ROUNDS, _PER_ROUND, _DEPTHS, _DIED = 3, 129, 4, 700.0
_BRACKETS = 2.0 ** np.arange(-16, 40)
_PER_WAVE, _POINTS, _MOST_POINTS = 48, 200, 40_000


@dataclass(frozen=True)
class MeanCourse:
    """One feed that begins at `allowance_um` with the smoothed reading `reading_um` and the removal `start_rate`.

    The reading is that of a whole surface at its mean; what grooves and run-out add to it is `ripple`.
    """

    unit: LinearGauge  #: Of gain 1, with T_Φ
    #: allowance_um and reading_um: [µm]
    allowance_um: float
    reading_um: float
    #: rate_um_per_s, start_rate and lag_s: [µm/s], [µm/s], [s]
    rate_um_per_s: float
    start_rate: float
    lag_s: float
    surface: Surface
    turn: float  #: Turns of the workpiece when the feed begins

    @property
    def is_whole(self) -> bool:
        """Whether nothing on the surface disturbs the reading."""
        surface = self.surface
        return surface.runout_um == 0 and (surface.grooves == 0 or surface.groove_depth_um == 0)

    def allowance(self, time_s: ArrayLike) -> Vector:
        """True allowance, shape of `time_s` [µm]."""
        return mean_allowance_um(
            time_s, self.allowance_um, self.rate_um_per_s, lag_s=self.lag_s, start_rate=self.start_rate
        )

    def reading(self, time_s: ArrayLike) -> Vector:
        """Smoothed reading of a whole surface, shape of `time_s` [µm]."""
        return mean_voltage_v(
            self.unit, time_s, self.allowance_um, self.rate_um_per_s,
            start_v=self.reading_um, lag_s=self.lag_s, start_rate=self.start_rate,
        )  # fmt: skip

    def removal(self, time_s: ArrayLike) -> Vector:
        """Rate at which the allowance falls, shape of `time_s` [µm/s]."""
        t = np.asarray(time_s, dtype=np.float64)
        left = np.exp(-np.minimum(t, _DIED * self.lag_s) / self.lag_s) if self.lag_s > 0 else np.zeros_like(t)
        return np.asarray(self.rate_um_per_s + (self.start_rate - self.rate_um_per_s) * left)

    def ripple(self, time_s: ArrayLike) -> tuple[Vector, Vector]:
        """What the surface adds to the reading, and its rate, shapes of `time_s` [µm], [µm/s]."""
        per_s = self.surface.workpiece_rpm / 60.0
        turn = self.turn + per_s * np.asarray(time_s, dtype=np.float64)
        return smoothed_surface(self.surface, self.unit.time_constant_s, turn)

    def window_s(self, reading_um: float, beyond_um: float) -> tuple[float, float]:
        """From when to when the reading, ripple and `beyond_um` of noise included, can be at this level [s]."""
        room = ripple_bound_um(self.surface, self.unit.time_constant_s)
        begin = self._whole_time(reading_um + room + beyond_um)
        return begin, self._whole_time(reading_um - room - beyond_um)

    def shortest_s(self) -> float:
        """A quarter of a turn, or what is shorter of a groove and the way to the next [s]; infinite if whole."""
        if self.is_whole:
            return math.inf
        surface, per_s = self.surface, self.surface.workpiece_rpm / 60.0
        if surface.grooves == 0 or surface.groove_depth_um == 0:
            return 0.25 / per_s
        return min(surface.groove_share, 1.0 - surface.groove_share, 0.25 * surface.grooves) / (surface.grooves * per_s)

    def time_of(self, reading_um: float) -> float:
        """When the reading with its ripple first comes down to this level [s]; 0 if it begins there or below."""
        if self.is_whole:
            return self._whole_time(reading_um)
        begin, end = self.window_s(reading_um, 0.0)
        count = int(np.clip((end - begin) / self.shortest_s() * _PER_WAVE, _POINTS, _MOST_POINTS))
        time = np.linspace(begin, end, count)
        above = self.reading(time) + self.ripple(time)[0] - reading_um
        first = int(np.argmax(above <= 0.0)) if (above <= 0.0).any() else count - 1
        if first == 0:
            return begin
        share = above[first - 1] / (above[first - 1] - above[first]) if above[first] < 0 else 1.0
        return float(time[first - 1] + share * (time[first] - time[first - 1]))

    def _whole_time(self, reading_um: float) -> float:
        if self.reading_um <= reading_um:
            return 0.0
        grid = self.unit.time_constant_s * _BRACKETS
        down = self.reading(grid) <= reading_um
        if not down.any():
            raise InputError(
                f"a reading that takes more than {grid[-1]:.3g} s to come down to {reading_um:g} µm",
                expected="a threshold that the mean course reaches",
                where="thresholds_v",
                advice="set the thresholds within what is ground",
            )
        first = int(np.argmax(down))
        low, high = (float(grid[first - 1]) if first else 0.0), float(grid[first])
        for _ in range(_ROUNDS):
            grid = np.linspace(low, high, _PER_ROUND)
            above = self.reading(grid) - reading_um
            first = max(int(np.argmax(above <= 0.0)), 1)
            low, high = float(grid[first - 1]), float(grid[first])
        fall = float(above[first - 1] - above[first])
        return low + (high - low) * float(above[first - 1]) / fall if fall > 0 else high

    def next_stage(self, after_s: float, rate_um_per_s: float) -> MeanCourse:
        """The feed that follows when this one has acted for so long."""
        return replace(
            self,
            allowance_um=float(self.allowance(after_s)),
            reading_um=float(self.reading(after_s)),
            rate_um_per_s=rate_um_per_s,
            start_rate=float(self.removal(after_s)),
            turn=self.turn + after_s * self.surface.workpiece_rpm / 60.0,
        )

    def size(self, time_s: ArrayLike, delay_s: float) -> Vector:
        """What is left when the last command is given at `time_s` and the springs have relaxed, same shape [µm]."""
        stop = np.asarray(time_s, dtype=np.float64) + delay_s
        return np.asarray(self.allowance(stop) - self.lag_s * self.removal(stop))


def threshold_readings_um(setup: GaugedGrinding) -> list[float]:
    """Mean readings at which the relay acts, peaks of a ripple being at the thresholds [µm]."""
    return [(volts - setup.gauge.bias_v) / setup.gauge.gain_v_per_um for volts in setup.mean_thresholds_v]


def on_line(setup: GaugedGrinding) -> GaugedGrinding:
    """The same without its characteristic; grooves are as deep as the line makes of the voltage in them at the stop.

    Where grooves are deeper than the probe swings the characteristic stays at the voltage of its free swing.
    """
    surface, curve = setup.surface, setup.characteristic
    if curve is None or surface.grooves == 0 or surface.groove_depth_um == 0:
        return replace(setup, characteristic=None)
    gain, depth = setup.gauge.gain_v_per_um, surface.groove_depth_um
    wanted = setup.wanted_um + setup.rates_um_per_s[-1] * setup.ahead_s
    seen = depth
    for _ in range(_DEPTHS):
        # what is left when the relay is tripped early by what the grooves take off the mean
        around = wanted + surface.groove_share * seen
        ends = curve.voltage_at(np.array([around, around - depth]))
        seen = min(max(float(ends[0] - ends[1]) / gain, 0.0), depth)
    return replace(setup, characteristic=None, surface=replace(surface, groove_depth_um=seen))


def last_stage(setup: GaugedGrinding, pace: float = 1.0, turn: float = 0.0) -> MeanCourse:
    """The last feed of a part whose allowance falls `pace` times as fast as with the mean feed and a fresh wheel.

    By the line and without noise; the workpiece begins the first stage at `turn`.
    """
    return stage_courses(setup, pace, turn)[-1]


def stage_courses(setup: GaugedGrinding, pace: float = 1.0, turn: float = 0.0) -> list[MeanCourse]:
    """The same of all feeds, the first one first."""
    levels, rates = threshold_readings_um(setup), setup.rates_um_per_s
    unit = LinearGauge(1.0, 0.0, setup.gauge.time_constant_s)
    lag_s, x = setup.grinding.lag_s, setup.grinding.allowance_um
    first = rates[0] * pace
    courses = [MeanCourse(unit, x, x, first, 0.0 if lag_s > 0 else first, lag_s, setup.surface, turn)]
    for level, rate in zip(levels[:-1], rates[1:], strict=True):
        courses.append(courses[-1].next_stage(courses[-1].time_of(level) + setup.relay.delay_s, rate * pace))
    return courses
