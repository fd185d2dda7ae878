"""One sensor, sample by sample: whether its reading is to be believed, and what the model gets of it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from selector.controllers.guard.codes import (
    ANCHOR_S,
    FORGIVEN_S,
    LARGEST_NUMBER,
    LEAST_GOOD_SAMPLES,
    LONGEST_S,
    SensorCode,
)
from selector.controllers.model_file import Guard, Input
from selector.controllers.sensor_check import CODE_SLACK, RANGE_SLACK

Number = Callable[[float], Any]


class SensorWatch:
    """State of one sensor. All numbers are of the type `number`.

    `x` is what the model gets (a rise or a reading, inside its valid range), as last believed `since_s` ago; `start` is
    taken with the first good reading, and again until it is believed. `has_memory`: believed since its start; `begins`:
    memory begins with the x of this sample; `is_new`: not believed since the control started.
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
        self._most_credit_s = number(guard.recover_after_s / LEAST_GOOD_SAMPLES)
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
        self._width = number(item.valid_max - item.valid_min)
        self._good_for_s: Any = None
        self._has_start = start is not None
        self.has_memory = False
        self.begins = False
        self.is_new = True

    @property
    def is_believed(self) -> bool:
        """Whether the model may use x."""
        return self.code <= SensorCode.LIMITED

    def sample(self, elapsed_s: Any, reading: Any) -> None:
        """Judges the next reading; `elapsed_s` since the sample before."""
        self._anchor_age_s = min(self._anchor_age_s + min(elapsed_s, self._anchor_s), self._forgiven_s)
        self._unchanged_s = min(self._unchanged_s + elapsed_s, self._longest_s)
        self.since_s = min(self.since_s + elapsed_s, self._longest_s)
        self.begins = False
        self.code = self._verdict(reading)
        if not self.is_believed:
            self._good_for_s = None
            return
        if not self._has_start and self.start is not None and self._is_elsewhere(reading - self.start):
            self._good_for_s = None
        if self._good_for_s is not None:
            self._good_for_s = min(self._good_for_s + min(elapsed_s, self._most_credit_s), self._longest_s)
        else:
            self._good_for_s = self._zero
            self._begin(reading)
        if self._good_for_s < self._recover_after_s:
            self.code = SensorCode.RECOVERING
            return
        self._believe(reading)

    @property
    def start_believed(self) -> Any:
        """The start reading, None before it is believed."""
        return self.start if self._has_start else None

    def forget_start(self) -> None:
        """The next good reading is the start reading once it is believed, and memory begins with it."""
        self.has_memory = self._has_start = False

    def check_kept(self, levels: Iterable[Any]) -> None:
        """Drops what was kept over a restart and cannot be: a start that is no reading, a level out of range."""
        low = -self._largest if self._reading_min is None else self._reading_min
        high = self._largest if self._reading_max is None else self._reading_max
        if self._has_start and not (low <= self.start <= high):
            self.forget_start()
        if not all(self._below <= level <= self._above for level in levels):
            self.has_memory = False

    def remember(self) -> None:
        """X was believed, and memory has gone on with it."""
        self.has_memory, self.is_new = True, False
        self.since_s = self._zero

    def passed(self, standstill_s: Any) -> None:
        """Time went by without samples; what the reading did meanwhile is not judged."""
        self.since_s = min(self.since_s + standstill_s, self._longest_s)
        self._anchor = None
        self._last = None
        self._good_for_s = None
        self.is_new = True

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
            if self.is_new:
                self._anchor, self._anchor_age_s = reading, self._zero
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
        return reading - self.start if self._has_start else self._zero

    def _is_elsewhere(self, change: Any) -> bool:
        """The first reading and this one cannot both be good: the model has never seen so large a rise."""
        return bool(change > self._width or change < -self._width)

    def _begin(self, reading: Any) -> None:
        """The first good reading is what a rise and memory begin with, if it is still believed at the end."""
        if self.has_memory:
            return
        x = reading
        if self._item.reference == "rise":
            if not self._has_start:
                self.start = reading
            x = reading - self.start
        self.x = min(max(x, self._lowest), self._highest)
        self.since_s = self._zero
        self.begins = True

    def _believe(self, reading: Any) -> None:
        self._has_start = self._item.reference == "rise"
        x = self._x(reading)
        if x < self._below or x > self._above:
            self.code = SensorCode.LIMITED
        self.x = min(max(x, self._lowest), self._highest)
