"""The check of one sensor as statements; statement by statement what `SensorWatch` does."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from selector.controllers.guard.codes import (
    ANCHOR_S,
    FORGIVEN_S,
    LARGEST_NUMBER,
    LEAST_GOOD_SAMPLES,
    LONGEST_S,
    SensorCode,
)
from selector.controllers.model_file import Guard, Input
from selector.controllers.program.language import Expression, Real, Variable, Writing, is_code
from selector.controllers.sensor_check import CODE_SLACK, RANGE_SLACK

NO_READING = 1e30
"""What an input holds that nobody has wired or read yet: missing, never a temperature of 0."""


class WatchedSensor:
    """Variables and statements of the k-th sensor (from 1)."""

    def __init__(self, w: Writing, item: Input, guard: Guard, k: int) -> None:
        self._w = w
        self._item = item
        self._guard = guard
        self._codes = guard.break_codes if item.unit == "degC" else ()
        self._stuck_after_s = guard.stuck_after_s if item.unit == "degC" else None
        self._reading = w.variable(f"reading_{k}", "real", "input", f"{item.name} [{item.unit}]", NO_READING)
        about = "0 ok, 1 limited, 2 recovering, 3 missing, 4 break code, 5 out of limits, 6 jump, 7 stuck, 8 range"
        self.code = w.variable(
            f"sensor_{k}", "code", "output", f"{item.name}: {about}" if k == 1 else item.name, float(SensorCode.MISSING)
        )
        self.x = w.variable(f"x_{k}", "real", "kept", f"{item.name} as the model gets it")
        self.since = w.variable(f"since_{k}", "real", "kept", "since it was believed last [s]")
        self._good_for = w.variable(f"good_for_{k}", "real", "kept", "good for so long [s]; -1: not good", -1.0)
        self.is_new = w.variable(f"is_new_{k}", "flag", "kept", "not believed since the control started", 1.0)
        self.has_memory = w.variable(f"has_memory_{k}", "flag", "retained", "memory has begun")
        if item.reference == "rise":
            self._start = w.variable(f"start_{k}", "real", "retained", f"start reading of {item.name}")
            self._has_start = w.variable(f"has_start_{k}", "flag", "retained", "start reading is taken")
        if item.rate_limit_per_min is not None:
            self._anchor = w.variable(f"anchor_{k}", "real", "kept", "reading about a minute ago")
            self._has_anchor = w.variable(f"has_anchor_{k}", "flag", "kept")
            self._anchor_age = w.variable(f"anchor_age_{k}", "real", "kept", "[s]")
        if self._stuck_after_s is not None:
            self._last = w.variable(f"last_{k}", "real", "kept", "last reading that differed")
            self._has_last = w.variable(f"has_last_{k}", "flag", "kept")
            self._unchanged = w.variable(f"unchanged_{k}", "real", "kept", "has not changed for so long [s]")

    @property
    def is_believed(self) -> Expression:
        """Condition: the model may use x."""
        return is_code(self.code, SensorCode.OK) | is_code(self.code, SensorCode.LIMITED)

    def passed(self, standstill: Variable) -> None:
        """Time went by without samples."""
        self._add(self.since, standstill)
        self._w.assign(self._good_for, -1.0)
        self._w.assign(self.is_new, True)
        if self._item.rate_limit_per_min is not None:
            self._w.assign(self._has_anchor, False)
        if self._stuck_after_s is not None:
            self._w.assign(self._has_last, False)

    def begins_anew(self) -> None:
        """The next good reading is the start reading once it is believed, and memory begins with it."""
        self._w.assign(self.has_memory, False)
        if self._item.reference == "rise":
            self._w.assign(self._has_start, False)

    def kept_checked(self, levels: Sequence[Variable]) -> None:
        """Drops a start that is no reading, and memory with a level out of range."""
        w, item = self._w, self._item
        if item.reference == "rise":
            low = -LARGEST_NUMBER if item.reading_min is None else item.reading_min
            high = LARGEST_NUMBER if item.reading_max is None else item.reading_max
            with w.when(~((self._start >= low) & (self._start <= high))):
                self.begins_anew()
        slack = RANGE_SLACK * (item.valid_max - item.valid_min)
        for level in levels:
            with w.when(~((level >= item.valid_min - slack) & (level <= item.valid_max + slack))):
                w.assign(self.has_memory, False)

    def sampled(self, elapsed: Variable, begin_memory: Callable[[], None]) -> None:
        """The next reading is judged; `begin_memory` writes that memory begins with x."""
        w, item = self._w, self._item
        w.remark(f"sensor {item.name}")
        cleared: Expression = ~self.has_memory
        if item.reference == "rise":
            cleared = cleared | ~self._has_start
        with w.when(cleared & ~self.is_new):
            # somebody wants a new start
            w.assign(self.has_memory, False)
            w.assign(self.is_new, True)
            w.assign(self._good_for, -1.0)
        if item.rate_limit_per_min is not None:
            self._credit(self._anchor_age, elapsed, ANCHOR_S, FORGIVEN_S)
        if self._stuck_after_s is not None:
            self._add(self._unchanged, elapsed)
        self._add(self.since, elapsed)
        self._verdict()
        with w.when(is_code(self.code, SensorCode.OK)):
            self._count_good(elapsed, begin_memory)
            with w.when(self._good_for < self._guard.recover_after_s):
                w.assign(self.code, SensorCode.RECOVERING)
            with w.otherwise():
                self._believe()
        with w.otherwise():
            w.assign(self._good_for, -1.0)

    def _count_good(self, elapsed: Variable, begin_memory: Callable[[], None]) -> None:
        """The first good reading is what a rise and memory begin with, if it is still believed at the end."""
        w, item = self._w, self._item
        if item.reference == "rise":
            change, width = w.variable("change"), item.valid_max - item.valid_min
            w.assign(change, self._reading - self._start)
            with w.when(~self._has_start & ((change > width) | (change < -width))):
                w.assign(self._good_for, -1.0)
        with w.when(self._good_for >= 0.0):
            self._credit(self._good_for, elapsed, self._guard.recover_after_s / LEAST_GOOD_SAMPLES)
        with w.otherwise():
            w.assign(self._good_for, 0.0)
            with w.when(~self.has_memory):
                if item.reference == "rise":
                    with w.when(~self._has_start):
                        w.assign(self._start, self._reading)
                self._take_x()
                w.assign(self.since, 0.0)
                begin_memory()

    def _verdict(self) -> None:
        w, r, code = self._w, self._reading, self.code
        w.assign(code, SensorCode.OK)
        # written so that NaN fails
        with w.when(~((r >= -LARGEST_NUMBER) & (r <= LARGEST_NUMBER))):
            w.assign(code, SensorCode.MISSING)
        for value in self._codes:
            slack = CODE_SLACK * abs(value)
            with w.when(is_code(code, SensorCode.OK) & (r >= value - slack) & (r <= value + slack)):
                w.assign(code, SensorCode.BREAK_CODE)
        low_limit, high_limit = self._item.reading_min, self._item.reading_max
        if low_limit is not None:
            with w.when(is_code(code, SensorCode.OK) & (r < low_limit)):
                w.assign(code, SensorCode.OUT_OF_LIMITS)
        if high_limit is not None:
            with w.when(is_code(code, SensorCode.OK) & (r > high_limit)):
                w.assign(code, SensorCode.OUT_OF_LIMITS)
        if self._item.rate_limit_per_min is not None:
            with w.when(is_code(code, SensorCode.OK)):
                self._jump(self._item.rate_limit_per_min / 60.0)
        if self._stuck_after_s is not None:
            with w.when(is_code(code, SensorCode.OK)):
                self._stuck(self._stuck_after_s)
        if self._guard.outside_valid_range == "fault":
            with w.when(is_code(code, SensorCode.OK)):
                x = self._fresh_x()
                with w.when(self._is_outside(x)):
                    w.assign(code, SensorCode.OUTSIDE_VALID_RANGE)

    def _jump(self, rate_per_s: float) -> None:
        w, r = self._w, self._reading
        allowed, change = w.variable("allowed"), w.variable("change")
        with w.when(~self._has_anchor):
            self._take_anchor()
        with w.otherwise():
            w.assign(allowed, self._anchor_age)
            w.at_least(allowed, ANCHOR_S)
            w.assign(allowed, Real(rate_per_s) * allowed)
            w.assign(change, r - self._anchor)
            with w.when((change > allowed) | (change < -allowed)):
                w.assign(self.code, SensorCode.JUMP)
                with w.when(self.is_new):
                    self._take_anchor()
            with w.otherwise(), w.when(self._anchor_age >= ANCHOR_S):
                self._take_anchor()

    def _take_anchor(self) -> None:
        self._w.assign(self._anchor, self._reading)
        self._w.assign(self._has_anchor, True)
        self._w.assign(self._anchor_age, 0.0)

    def _stuck(self, after_s: float) -> None:
        w, r = self._w, self._reading
        with w.when(~self._has_last | (r < self._last) | (r > self._last)):
            w.assign(self._last, r)
            w.assign(self._has_last, True)
            w.assign(self._unchanged, 0.0)
        with w.when(self._unchanged > after_s):
            w.assign(self.code, SensorCode.STUCK)

    def _fresh_x(self) -> Variable:
        w = self._w
        x = w.variable("x")
        if self._item.reference == "absolute":
            w.assign(x, self._reading)
            return x
        w.assign(x, 0.0)
        with w.when(self._has_start):
            w.assign(x, self._reading - self._start)
        return x

    def _is_outside(self, x: Variable) -> Expression:
        slack = RANGE_SLACK * (self._item.valid_max - self._item.valid_min)
        return (x < self._item.valid_min - slack) | (x > self._item.valid_max + slack)

    def _believe(self) -> None:
        w = self._w
        if self._item.reference == "rise":
            w.assign(self._has_start, True)
        x = self._take_x()
        with w.when(self._is_outside(x)):
            w.assign(self.code, SensorCode.LIMITED)

    def _take_x(self) -> Variable:
        """What the model gets, inside its valid range; before that it is returned."""
        w, item = self._w, self._item
        x = w.variable("x")
        w.assign(x, self._reading - self._start if item.reference == "rise" else self._reading)
        w.assign(self.x, x)
        w.limit(self.x, item.valid_min, item.valid_max)
        return x

    def _credit(self, clock: Variable, elapsed: Variable, most_s: float, longest_s: float = LONGEST_S) -> None:
        """A sample counts for so long at most."""
        credit = self._w.variable("credit_s")
        self._w.assign(credit, elapsed)
        self._w.at_most(credit, most_s)
        self._add(clock, credit, longest_s)

    def _add(self, clock: Variable, elapsed: Variable, longest_s: float = LONGEST_S) -> None:
        self._w.assign(clock, clock + elapsed)
        self._w.at_most(clock, longest_s)
