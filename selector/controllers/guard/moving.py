"""Where an axis stands, and a number that follows its aim no faster than its limit."""

from __future__ import annotations

from typing import Any

from selector.controllers.guard.decided import SensorCode


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
