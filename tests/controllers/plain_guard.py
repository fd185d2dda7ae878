"""The guard once more, written as a person reads it: nothing of it is used by the program that it is compared with.

`GuardedModel` executes the statements that every exported program is printed from. `PlainGuard` knows nothing of
statements; both have to give the same bits on any rows. Only + − × ÷ and comparisons, in one number type.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from selector.controllers.closed_values import Adaptation, OutputAdaptation
from selector.controllers.evaluator import Equations, axes_of, polynomial
from selector.controllers.guard.decided import (
    ANCHOR_S,
    CODE_SLACK,
    FORGIVEN_S,
    GAP_STEPS_LOG2,
    LARGEST_NUMBER,
    LEAST_GOOD_SAMPLES,
    LONGEST_S,
    LONGEST_STEP_S,
    RANGE_SLACK,
    SAMPLE_S,
    DecidedLimits,
    Mode,
    SensorCode,
    TouchCode,
    decided_limits,
    is_turned,
    longest_test_s,
    valid_positions_m,
)
from selector.controllers.guard.guarded_model import Corrected
from selector.controllers.model_file import Guard, Input, ModelFile, Output, State
from selector.controllers.replay.parts import Answers, Rows

Number = Callable[[float], Any]


class Adapted:
    """State of one output. All numbers are of the type `number`; displacements in µm."""

    def __init__(self, of: OutputAdaptation, block: Adaptation, number: Number) -> None:
        self._zero = number(0.0)
        self._walk, self._walk_of_gain = number(of.offset_um2_per_s), number(of.gain_per_s)
        self._start, self._start_of_gain = number(of.offset_start_um2), number(of.gain_start)
        self._noise = number(of.noise_um2)
        self._offset_limit, self._gain_limit = number(of.offset_limit_um), number(of.gain_limit)
        self._far = number(of.offset_limit_um * of.offset_limit_um)
        self._gate, self._agreeing = number(block.gate * block.gate), number(block.agreeing * block.agreeing)
        self._largest, self._longest_s = number(LARGEST_NUMBER), number(LONGEST_S)
        self._has_gain = of.gain_limit > 0.0
        self.code = TouchCode.NONE
        self._waits = False
        self._was_touch = False
        self._shown = self._shown_at = self._zero
        self.begin()

    def begin(self) -> None:
        """A new start: nothing is known of offset and gain."""
        self.offset = self.gain = self._covariance = self._age_s = self._doubted = self._zero
        self._variance, self._variance_of_gain = self._start, self._start_of_gain
        self._has_doubt = self._has_two = False

    def passed(self, seconds: Any) -> None:
        """Time went by."""
        self._age_s = min(self._age_s + seconds, self._longest_s)

    def stopped(self) -> None:
        """The control was off: a touch-off that waited is gone."""
        self._waits = False

    def take(self, is_touch: bool, is_number: bool, displacement: Any, place: Any) -> None:
        """A touch-off is taken with the call in which it becomes valid; what is no number is none.

        `displacement` is what the probe shows without the correction; `place` the position of the axis then [m].
        """
        if is_touch and not self._was_touch and is_number:
            self._waits = True
            self._shown, self._shown_at = displacement, place
        self._was_touch = is_touch

    def added(self, modelled: Any, slope: Any, reference: Any) -> Any:
        """The displacement of the model with offset and gain, after the touch-off that waits for it.

        `slope` is the model's position-dependent part [µm/m] about `reference`; 0 where it has none.
        """
        if self._waits and -self._largest <= modelled <= self._largest and -self._largest <= slope <= self._largest:
            self._waits = False
            self._touched(self._shown - slope * (self._shown_at - reference) - modelled, modelled)
        if self._has_gain:
            return modelled + self.offset + self.gain * modelled
        return modelled + self.offset

    def drop(self) -> None:
        """A touch-off that nothing could be compared with."""
        if self._waits:
            self._waits = False
            self.code = TouchCode.UNUSED

    def _touched(self, error: Any, m: Any) -> None:
        self._variance = min(self._variance + self._walk * self._age_s, self._largest)
        surprise = error - self.offset
        of_offset, variance = self._variance, self._variance + self._noise
        of_gain = self._zero
        if self._has_gain:
            self._variance_of_gain = min(self._variance_of_gain + self._walk_of_gain * self._age_s, self._largest)
            surprise = surprise - self.gain * m
            of_offset = self._variance + self._covariance * m
            of_gain = self._covariance + self._variance_of_gain * m
            variance = max(of_offset + of_gain * m + self._noise, self._noise)
        self._age_s = self._zero
        square = surprise * surprise
        if square > self._gate * variance:
            away = error - self._doubted
            agrees = bool(self._has_doubt and away * away <= self._agreeing * square)
            if not (agrees and (self._has_two or error * error <= self._far)):
                self._doubted, self._has_doubt, self._has_two = error, True, agrees
                self.code = TouchCode.DOUBTED
                return
            self._variance = self._variance + square
            of_offset = of_offset + square
            variance = variance + square
        self._has_doubt = self._has_two = False
        self.code = TouchCode.BELIEVED
        share = of_offset / variance
        self.offset = self._limited(self.offset + share * surprise, self._offset_limit)
        self._variance = self._limited(self._variance - share * of_offset, self._largest, self._zero)
        if self._has_gain:
            of = of_gain / variance
            self.gain = self._limited(self.gain + of * surprise, self._gain_limit)
            self._covariance = self._limited(self._covariance - share * of_gain, self._largest)
            self._variance_of_gain = self._limited(self._variance_of_gain - of * of_gain, self._largest, self._zero)

    @staticmethod
    def _limited(value: Any, high: Any, low: Any = None) -> Any:
        return min(max(value, -high if low is None else low), high)


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


class Correction:
    """From the displacement of one output to its correction: sign, clamp, dead band, slew."""

    def __init__(self, output: Output, limits: DecidedLimits, number: Number, adapted: Adapted | None = None) -> None:
        self.name = output.name
        self.is_rise = output.reference == "rise"
        self.adapted = adapted
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
        self._where = self._reference = self._zero
        if part is not None:
            self._where = number(part.reference_m)
            self._reach = number(limits.reach_m)
            self._reference = number(part.reference_m)
            self._from, self._to = number(part.valid_min_m), number(part.valid_max_m)
        self.stop()

    def stop(self) -> None:
        """The control was off: the correction begins at zero."""
        self._off()
        self._aim = self._slope_aim = self._zero

    def touch(self, is_touch: bool, shown: Any) -> None:
        """What the probe shows of the displacement while this correction acts."""
        if self.adapted is not None:
            own = shown + self.correction if self._is_turned else shown - self.correction
            self.adapted.take(is_touch, -self._largest <= shown <= self._largest, own, self._where)

    def aim(self, displacement: Any, slope: Any) -> None:
        """What the model, or a fallback, gives is where it moves to from now on."""
        if self.adapted is not None:
            displacement = self.adapted.added(displacement, slope, self._reference)
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


class PlainGuard:
    """A model with its guard and its state; ranges and references of its own inputs hold in its fallbacks, too.

    `number` is ``float`` (IEEE 754 binary64) or ``numpy.float32`` (binary32); `start_readings` are those that the
    control kept; default: the first reading that is good and stays so for `recover_after_s`.
    """

    def __init__(
        self, model: ModelFile, number: Number = float, start_readings: Mapping[str, float] | None = None
    ) -> None:
        self._number = number
        self._zero = number(0.0)
        self._guard = model.guard
        starts = start_readings or {}
        everything: tuple[Equations, ...] = (model, *model.fallbacks)
        self._watches = {
            item.name: SensorWatch(item, model.guard, number, starts.get(item.name)) for item in model.inputs
        }
        self._equations = [_Scaled(of, number) for of in everything]
        # memory is of a sensor and a time constant: model and fallbacks share it
        self._lagged: dict[tuple[str, float], Any] = {}
        self._taus = sorted({(state.source, state.tau_s) for of in everything for state in of.states})
        limits, _ = decided_limits(model)
        reference = {output.position.axis: output.position.reference_m for output in model.outputs if output.position}
        self._axes = {
            axis: AxisPosition(number(reference[axis]), number(low), number(high), number(LARGEST_NUMBER))
            for axis, (low, high) in valid_positions_m(model).items()
        }
        block = model.adaptation
        adapted = {of.output: Adapted(of, block, number) for of in block.outputs} if block else {}
        self._outputs = [
            Correction(output, limits[output.name], number, adapted.get(output.name)) for output in model.outputs
        ]
        self._rises = [item.name for item in model.inputs if item.reference == "rise"]
        self._largest, self._longest_s = number(LARGEST_NUMBER), number(LONGEST_S)
        self._longest_step_s, self._sample_s = number(LONGEST_STEP_S), number(SAMPLE_S)
        hold = model.guard.hold_at_most_s
        self._hold_at_most_s = None if hold is None else number(hold)
        self._longest_test_s = number(longest_test_s(model))
        self._since_sample_s = self._held_s = self._test_left_s = self._zero
        self._is_first = True
        self._follows = self._mode = int(Mode.HOLD)

    def step(
        self,
        dt_s: float,
        readings: Mapping[str, float],
        positions_m: Mapping[str, float] | None = None,
        *,
        is_ready: bool = True,
        is_wanted: bool = True,
        test_um: Mapping[str, float] | None = None,
        touch_um: Mapping[str, float] | None = None,
        is_touch_valid: bool = False,
    ) -> Corrected:
        """The correction after `dt_s` more seconds; what is no time, or more than 10⁶ s, counts as 0.

        Readings [unit of the input] may be anything, NaN and infinity included. A position [m] that is missing or no
        number stays where it was last. Without `is_ready` (drives on and axis referenced) there is no correction at
        once; without `is_wanted` (the operator's switch) it is ramped to zero.

        `test_um` is for the sign test: while one is a number other than 0 [µm], its output goes there, the others to
        zero, whatever sensors and operator say. Only after a call in which all were 0 and the axis was ready, and for
        `longest_test_s`: what was forgotten there ramps the correction to zero.

        `touch_um` is the displacement that a probe shows while the correction acts [µm], for outputs that are adapted;
        it is taken in the call in which `is_touch_valid` becomes true, and acts with the next sample of the readings.
        """
        number = self._number
        with np.errstate(all="ignore"):
            if self._is_first:
                self._check_kept()
            dt = self._passed(dt_s)
            for axis, position in self._axes.items():
                position.take(number((positions_m or {}).get(axis, float("nan"))))
            self._since_sample_s = min(self._since_sample_s + dt, self._longest_s)
            for output in self._outputs:
                output.touch(is_touch_valid, number((touch_um or {}).get(output.name, float("nan"))))
            if self._is_first or self._since_sample_s >= self._sample_s:
                self._sample(readings)
                self._is_first = False
                self._since_sample_s = self._zero
            tests = [self._tested((test_um or {}).get(output.name, 0.0)) for output in self._outputs]
            self._mode = self._followed_now(tests, is_ready=is_ready, is_wanted=is_wanted)
            slewed_s = min(dt, self._longest_step_s)
            for output, test in zip(self._outputs, tests, strict=True):
                output.move(self._mode, slewed_s, self._axes, test)
        return Corrected(
            {output.name: output.correction for output in self._outputs},
            {output.name: output.k0.now for output in self._outputs},
            {output.name: output.slope.now for output in self._outputs},
            self._mode,
            tuple(watch.code for watch in self._watches.values()),
            {axis: position.code for axis, position in self._axes.items()},
            {output.name: output.adapted.code for output in self._outputs if output.adapted is not None},
        )

    def restart(self, standstill_s: float) -> None:
        """The control was off for so long: memory goes on, the correction begins at zero.

        Start readings are kept or taken anew, as the guard of the model file says.
        """
        off = self._duration(standstill_s)
        limit = self._guard.new_start_after_s
        anew = self._guard.restart == "new-start" or (limit is not None and off > self._number(limit))
        for watch in self._watches.values():
            watch.passed(off)
            if anew:
                watch.forget_start()
        self._is_first = True
        self._since_sample_s = self._held_s = self._test_left_s = self._zero
        self._follows = int(Mode.HOLD)
        for output in self._outputs:
            output.stop()
            if output.adapted is not None:
                output.adapted.passed(off)
                output.adapted.stopped()

    @property
    def start_readings(self) -> dict[str, float]:
        """Start readings so far, for the control to keep."""
        return {
            name: float(watch.start_believed)
            for name, watch in self._watches.items()
            if watch.start_believed is not None
        }

    def _check_kept(self) -> None:
        for name, watch in self._watches.items():
            watch.check_kept(level for (source, _), level in self._lagged.items() if source == name)

    def _passed(self, seconds: float) -> Any:
        """What is no time counts as 0, and what is longer than clocks run is none."""
        passed = self._number(seconds)
        return passed if self._zero < passed <= self._longest_s else self._zero

    def _duration(self, seconds: float) -> Any:
        """What is no time counts as 0."""
        with np.errstate(all="ignore"):
            duration = self._number(seconds)
        return min(duration, self._longest_s) if duration > self._zero else self._zero

    def _tested(self, commanded_um: float) -> Any:
        """What is no number commands nothing."""
        test = self._number(commanded_um)
        return test if -self._largest <= test <= self._largest else self._zero

    def _followed_now(self, tests: Sequence[Any], *, is_ready: bool, is_wanted: bool) -> int:
        mode = self._follows if is_wanted else int(Mode.SWITCHED_OFF)
        if not any(tests):
            self._test_left_s = self._longest_test_s
        else:
            mode = int(Mode.TEST if self._test_left_s > self._zero else Mode.SWITCHED_OFF)
        if not is_ready:
            mode, self._test_left_s = int(Mode.OFF), self._zero
        return mode

    def _sample(self, readings: Mapping[str, float]) -> None:
        number = self._number
        if self._mode == Mode.TEST:
            self._test_left_s = max(self._test_left_s - self._since_sample_s, self._zero)
        is_new_start = bool(self._rises) and all(self._watches[name].start_believed is None for name in self._rises)
        for output in self._outputs:
            if output.adapted is not None:
                output.adapted.passed(self._since_sample_s)
                if output.is_rise and is_new_start:
                    output.adapted.begin()
        for name, watch in self._watches.items():
            watch.sample(self._since_sample_s, number(readings[name]))
        for source, tau_s in self._taus:
            watch = self._watches[source]
            if watch.begins:
                self._lagged[source, tau_s] = watch.x
            if watch.is_believed:
                level = self._lagged[source, tau_s]
                gain = self._gain(number(tau_s), watch.since_s, is_gap=watch.is_new and watch.has_memory)
                self._lagged[source, tau_s] = level + gain * (watch.x - level)
        for watch in self._watches.values():
            if watch.is_believed:
                watch.remember()
        self._follows = self._followed()
        if self._follows == Mode.RAMP_TO_ZERO:
            for output in self._outputs:
                output.aim_at_zero()
        elif self._follows != Mode.HOLD:
            at = max(0, self._follows - Mode.FALLBACK + 1)
            found = self._equations[at].displacements(self._watches, self._lagged)
            for output, (displacement, slope) in zip(self._outputs, found, strict=True):
                output.aim(displacement, slope)
        for output in self._outputs:
            if output.adapted is not None:
                output.adapted.drop()

    def _gain(self, tau_s: Any, since_s: Any, *, is_gap: bool) -> Any:
        """Share of the way to x that a memory goes (backward Euler); over a standstill in equal steps."""
        if not is_gap:
            return since_s / (tau_s + since_s)
        one, steps = self._number(1.0), self._number(float(2**GAP_STEPS_LOG2))
        left = one / (one + since_s / (steps * tau_s))
        for _ in range(GAP_STEPS_LOG2):
            left = left * left
        return one - left

    def _followed(self) -> int:
        if self._equations[0].can_be_used(self._watches):
            self._held_s = self._zero
            return int(Mode.MODEL)
        if self._guard.on_fault == "fallback":
            for k, equations in enumerate(self._equations[1:]):
                if equations.can_be_used(self._watches):
                    self._held_s = self._zero
                    return Mode.FALLBACK + k
        if self._guard.last_resort == "ramp-to-zero":
            return int(Mode.RAMP_TO_ZERO)
        self._held_s = min(self._held_s + self._since_sample_s, self._longest_s)
        if self._hold_at_most_s is not None and self._held_s > self._hold_at_most_s:
            return int(Mode.RAMP_TO_ZERO)
        return int(Mode.HOLD)


class _Scaled:
    """A model or a fallback, calculated in one number type."""

    def __init__(self, of: Equations, number: Number) -> None:
        self._of, self._number = of, number
        variables: tuple[Input | State, ...] = (*of.inputs, *of.states)
        self._scaling = {item.name: (number(item.centre), number(item.scale)) for item in variables}

    def can_be_used(self, watches: Mapping[str, SensorWatch]) -> bool:
        return all(watches[item.name].is_believed for item in self._of.inputs)

    def displacements(
        self, watches: Mapping[str, SensorWatch], lagged: Mapping[tuple[str, float], Any]
    ) -> list[tuple[Any, Any]]:
        """Per output, (at the reference position, slope)."""
        values = {item.name: watches[item.name].x for item in self._of.inputs}
        values |= {state.name: lagged[state.source, state.tau_s] for state in self._of.states}
        z = {name: (values[name] - centre) / scale for name, (centre, scale) in self._scaling.items()}
        found = []
        for output in self._of.outputs:
            part, slope = output.position, self._number(0.0)
            if part is not None:
                slope = polynomial(part.intercept, part.terms, z, self._number)
            found.append((polynomial(output.intercept, output.terms, z, self._number), slope))
        return found


def plain_answers(model: ModelFile, rows: Rows, number: Number = float) -> Answers:
    """What `PlainGuard` gives, row by row."""
    guarded = PlainGuard(model, number)
    names, axes = [item.name for item in model.inputs], axes_of(model)
    outputs = [output.name for output in model.outputs]
    answers = Answers.empty(len(rows), len(outputs), len(names), len(axes))
    table, where, tests = rows.readings.tolist(), rows.positions_m.tolist(), rows.tests_um(len(outputs)).tolist()
    valid, shown = rows.touches(len(outputs))
    for k, dt_s in enumerate(rows.dt_s.tolist()):
        # a switch that stays on is one restart
        if rows.is_restart[k] and not (k and rows.is_restart[k - 1]):
            guarded.restart(float(rows.standstill_s[k]))
        found = guarded.step(
            dt_s,
            dict(zip(names, table[k], strict=True)),
            dict(zip(axes, where[k], strict=True)),
            is_ready=bool(rows.is_ready[k]),
            is_wanted=bool(rows.is_wanted[k]),
            test_um=dict(zip(outputs, tests[k], strict=True)),
            touch_um=dict(zip(outputs, shown[k].tolist(), strict=True)),
            is_touch_valid=bool(valid[k]),
        )
        answers.correction_um[k] = [found.correction_um[name] for name in outputs]
        answers.k0_um[k] = [found.k0_um[name] for name in outputs]
        answers.slope_um_per_m[k] = [found.slope_um_per_m[name] for name in outputs]
        answers.mode[k], answers.sensors[k] = found.mode, found.sensors
        answers.axes[k] = [found.axes[axis] for axis in axes]
    return answers
