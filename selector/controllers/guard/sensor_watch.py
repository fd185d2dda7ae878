"""One sensor, sample by sample: whether its reading is to be believed, and what the model gets of it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from selector.controllers.guard.codes import ANCHOR_S, FORGIVEN_S, LARGEST_NUMBER, LONGEST_S, SensorCode
from selector.controllers.model_file import Guard, Input
from selector.controllers.sensor_check import CODE_SLACK, RANGE_SLACK

Number = Callable[[float], Any]


class SensorWatch:
    """State of one sensor. All numbers are of the type `number`.

    Attributes
    ----------
    code : SensorCode
    x : number
        What the model gets (a rise or a reading, inside its valid range); as last believed.
    since_s : number
        Since x was believed last.
    start : number or None
        Start reading.
    """

    def __init__(self, item: Input, guard: Guard, number: Number, start: float | None) -> None:
        self._number = number
        self._zero = number(0.0)
        self._item = item
        self._lowest, self._highest = number(item.valid_min), number(item.valid_max)
        slack = RANGE_SLACK * (item.valid_max - item.valid_min)
        self._below, self._above = number(item.valid_min - slack), number(item.valid_max + slack)
        codes = guard.break_codes if item.unit == "degC" else ()
        slacks = [CODE_SLACK * abs(code) for code in codes]
        self._codes = [(number(code - s), number(code + s)) for code, s in zip(codes, slacks, strict=True)]
        self._reading_min = None if item.reading_min is None else number(item.reading_min)
        self._reading_max = None if item.reading_max is None else number(item.reading_max)
        rate = item.rate_limit_per_min
        self._rate_per_s = None if rate is None else number(rate / 60.0)
        stuck = guard.stuck_after_s if item.unit == "degC" else None
        self._stuck_after_s = None if stuck is None else number(stuck)
        self._limits_input = guard.outside_valid_range == "limit-input"
        self._recover_after_s = number(guard.recover_after_s)
        self._largest, self._longest_s = number(LARGEST_NUMBER), number(LONGEST_S)
        self._anchor_s, self._forgiven_s = number(ANCHOR_S), number(FORGIVEN_S)
        self.start = None if start is None else number(start)
        self.code = SensorCode.MISSING
        self.x = self._zero
        self.since_s = self._zero
        self._anchor: Any = None
        self._anchor_age_s = self._zero
        self._last: Any = None
        self._unchanged_s = self._zero
        self._good_for_s = number(guard.recover_after_s)

    @property
    def is_believed(self) -> bool:
        """Whether the model may use x."""
        return self.code <= SensorCode.LIMITED

    def sample(self, elapsed_s: Any, reading: Any) -> None:
        """Judges the next reading; `elapsed_s` since the sample before."""
        self._anchor_age_s = min(self._anchor_age_s + elapsed_s, self._forgiven_s)
        self._unchanged_s = min(self._unchanged_s + elapsed_s, self._longest_s)
        self.since_s = min(self.since_s + elapsed_s, self._longest_s)
        self.code = self._verdict(reading)
        if not self.is_believed:
            self._good_for_s = self._zero
            return
        self._good_for_s = min(self._good_for_s + elapsed_s, self._longest_s)
        if self._good_for_s < self._recover_after_s:
            self.code = SensorCode.RECOVERING
            return
        self._believe(reading)

    def forget_start(self) -> None:
        """The next reading that is believed is the start reading."""
        if self._item.reference == "rise":
            self.start = None

    def passed(self, standstill_s: Any) -> None:
        """Time went by without samples; what the reading did meanwhile is not judged."""
        self.since_s = min(self.since_s + standstill_s, self._longest_s)
        self._anchor = None
        self._last = None

    def _verdict(self, reading: Any) -> SensorCode:
        # written so that NaN fails
        if not (-self._largest <= reading <= self._largest):
            return SensorCode.MISSING
        for low, high in self._codes:
            if low <= reading <= high:
                return SensorCode.BREAK_CODE
        if self._reading_min is not None and reading < self._reading_min:
            return SensorCode.OUT_OF_LIMITS
        if self._reading_max is not None and reading > self._reading_max:
            return SensorCode.OUT_OF_LIMITS
        if self._rate_per_s is not None and self._jumps(reading):
            return SensorCode.JUMP
        if self._stuck_after_s is not None and self._is_stuck(reading):
            return SensorCode.STUCK
        if not self._limits_input:
            x = self._x(reading)
            if x < self._below or x > self._above:
                return SensorCode.OUTSIDE_VALID_RANGE
        return SensorCode.OK

    def _jumps(self, reading: Any) -> bool:
        if self._anchor is None:
            self._anchor, self._anchor_age_s = reading, self._zero
            return False
        allowed = self._rate_per_s * max(self._anchor_age_s, self._anchor_s)
        change = reading - self._anchor
        if change > allowed or change < -allowed:
            return True
        if self._anchor_age_s >= self._anchor_s:
            self._anchor, self._anchor_age_s = reading, self._zero
        return False

    def _is_stuck(self, reading: Any) -> bool:
        if self._last is None or reading != self._last:
            self._last, self._unchanged_s = reading, self._zero
        return bool(self._unchanged_s > self._stuck_after_s)

    def _x(self, reading: Any) -> Any:
        if self._item.reference == "absolute":
            return reading
        return self._zero if self.start is None else reading - self.start

    def _believe(self, reading: Any) -> None:
        if self.start is None and self._item.reference == "rise":
            self.start = reading
        x = self._x(reading)
        if x < self._below or x > self._above:
            self.code = SensorCode.LIMITED
        self.x = min(max(x, self._lowest), self._highest)
