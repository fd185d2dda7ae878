"""From the displacement of one output to its correction: sign, clamp, dead band, slew, and where its axis stands."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from selector.controllers.guard.codes import LARGEST_NUMBER, Mode, SensorCode
from selector.controllers.guard.decided import DecidedLimits, is_turned
from selector.controllers.model_file import Output

Number = Callable[[float], Any]


class Correction:
    """From the displacement of one output to its correction: sign, clamp, dead band, slew."""

    def __init__(self, output: Output, limits: DecidedLimits, number: Number) -> None:
        self.name = output.name
        self._is_turned = is_turned(output)
        self._zero = number(0.0)
        self._largest = number(LARGEST_NUMBER)
        self._clamp, self._slope_clamp = number(limits.clamp_um), number(limits.slope_clamp_um_per_m)
        self.k0 = Slewed(number(limits.own_slew_um_per_s), self._zero)
        self.slope = Slewed(number(limits.slope_slew_um_per_m_s), self._zero)
        self._dead_band = number(limits.dead_band_um)
        part = output.position
        self._axis = None if part is None else part.axis
        self._back = Slewed(number(limits.slew_um_per_s), self._zero)
        self._is_back = False
        if part is not None:
            self._reach = number(limits.reach_m)
            self._where = number(part.reference_m)
            self._reference = number(part.reference_m)
            self._from, self._to = number(part.valid_min_m), number(part.valid_max_m)
        self.stop()

    def stop(self) -> None:
        """The control was off: the correction begins at zero."""
        self._off()
        self._aim = self._slope_aim = self._zero

    def aim(self, displacement: Any, slope: Any) -> None:
        """What the model, or a fallback, gives is where it moves to from now on."""
        own, steep = (displacement, slope) if self._is_turned else (-displacement, -slope)
        if not (-self._largest <= own <= self._largest) or not (-self._largest <= steep <= self._largest):
            return
        own = min(max(own, -self._clamp), self._clamp)
        change = own - self._aim
        if change >= self._dead_band or change <= -self._dead_band:
            self._aim = own
        if self._axis is not None and self._reach > self._zero:
            # the straight line keeps the clamp at the far end of the axis, too
            size = -self._aim if self._aim < self._zero else self._aim
            most = min((self._clamp - size) / self._reach, self._slope_clamp)
            self._slope_aim = min(max(steep, -most), most)

    def aim_at_zero(self) -> None:
        """Whatever comes, it goes to zero."""
        self._aim = self._slope_aim = self._zero

    def move(self, mode: int, slewed_s: Any, axes: Mapping[str, AxisPosition], test: Any) -> None:
        """One call goes by; `test` is what is commanded by hand."""
        if mode == Mode.OFF:
            self._off()
            return
        if self._axis is not None:
            self._carry(axes[self._axis])
        own, steep = self._aim, self._slope_aim
        if mode == Mode.SWITCHED_OFF:
            own = steep = self._zero
        if mode == Mode.TEST:
            own, steep = min(max(test, -self._clamp), self._clamp), self._zero
        self.k0.move(own, slewed_s)
        if self._axis is None:
            self.correction = self.k0.now
            return
        self.slope.move(steep, slewed_s)
        whole = self.k0.now + self.slope.now * (self._where - self._reference)
        whole = min(max(whole, -self._clamp), self._clamp)
        if self._is_back:
            self._back.now = self.correction
            self._back.move(whole, slewed_s)
            self.correction = self._back.now
            self._is_back = bool(self.correction != whole)
        else:
            self.correction = whole

    def _carry(self, position: AxisPosition) -> None:
        """The correction moves with its axis; after its position was lost, no faster than the slew limit."""
        where = min(max(position.at, self._from), self._to)
        if position.is_back:
            self._is_back = True
        else:
            moved = self.correction + self.slope.now * (where - self._where)
            self.correction = min(max(moved, -self._clamp), self._clamp)
        self._where = where

    def _off(self) -> None:
        self.k0.stop()
        self.slope.stop()
        self._back.stop()
        self._is_back = False
        self.correction = self._zero


class AxisPosition:
    """Where an axis stands, or stood when that was last known."""

    def __init__(self, reference: Any, low: Any, high: Any, largest: Any) -> None:
        self.at = reference
        self.code = SensorCode.MISSING
        self.is_back = False
        self._low, self._high, self._largest = low, high, largest

    def take(self, position: Any) -> None:
        """What is no position leaves it where it was last."""
        if not (-self._largest <= position <= self._largest):
            self.code, self.is_back = SensorCode.MISSING, False
            return
        self.is_back = self.code == SensorCode.MISSING
        self.at = position
        self.code = SensorCode.LIMITED if position < self._low or position > self._high else SensorCode.OK


class Slewed:
    """A number that follows its aim no faster than its limit a second.

    What rounding gives or takes of a step is made up for in the next: else single precision at 1 ms would be a quarter
    too slow at 0.003 µm/s, and stand still below.
    """

    def __init__(self, limit: Any, zero: Any) -> None:
        self._limit, self._zero = limit, zero
        self.stop()

    def stop(self) -> None:
        """It is zero at once."""
        self.now = self._rest = self._zero

    def move(self, aim: Any, slewed_s: Any) -> None:
        """One call goes by."""
        most = self._limit * slewed_s + self._rest
        reach = max(most, self._zero)
        low, high = self.now - reach, self.now + reach
        self._rest = self._zero
        if aim < low:
            aim, self._rest = low, most - (self.now - low)
        elif aim > high:
            aim, self._rest = high, most - (high - self.now)
        self.now = aim
