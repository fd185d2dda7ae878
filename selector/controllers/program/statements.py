"""The check of one sensor, the correction of one output and what touch-offs add to it as statements."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from selector.controllers.closed_values import Adaptation, OutputAdaptation
from selector.controllers.guard.decided import (
    ANCHOR_S,
    CODE_SLACK,
    FORGIVEN_S,
    LARGEST_NUMBER,
    LEAST_GOOD_SAMPLES,
    LONGEST_S,
    RANGE_SLACK,
    DecidedLimits,
    Mode,
    SensorCode,
    TouchCode,
    is_turned,
)
from selector.controllers.model_file import Guard, Input, Output, PositionPart
from selector.controllers.program.language import Expression, Operation, Real, Variable, Writing, is_code
from selector.controllers.program.steps import is_number, polynomial, towards

NO_READING = 1e30  #: What an input holds that nobody has wired or read yet: missing, never a temperature of 0.


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
            self.has_start = w.variable(f"has_start_{k}", "flag", "retained", "start reading is taken")
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
            self._w.assign(self.has_start, False)

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
            cleared = cleared | ~self.has_start
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
                if item.reference == "rise":
                    w.assign(self.has_start, True)
                x = self._take_x()
                with w.when(self._is_outside(x)):
                    w.assign(self.code, SensorCode.LIMITED)
        with w.otherwise():
            w.assign(self._good_for, -1.0)

    def _count_good(self, elapsed: Variable, begin_memory: Callable[[], None]) -> None:
        """The first good reading is what a rise and memory begin with, if it is still believed at the end."""
        w, item = self._w, self._item
        if item.reference == "rise":
            change, width = w.variable("change"), item.valid_max - item.valid_min
            w.assign(change, self._reading - self._start)
            is_far = (change > width) | (change < -width)
            with w.when(~self.has_start & is_far):
                w.assign(self._good_for, -1.0)
        with w.when(self._good_for >= 0.0):
            self._credit(self._good_for, elapsed, self._guard.recover_after_s / LEAST_GOOD_SAMPLES)
        with w.otherwise():
            w.assign(self._good_for, 0.0)
            with w.when(~self.has_memory):
                if item.reference == "rise":
                    with w.when(~self.has_start):
                        w.assign(self._start, self._reading)
                self._take_x()
                w.assign(self.since, 0.0)
                begin_memory()

    def _verdict(self) -> None:
        w, r, code = self._w, self._reading, self.code
        w.assign(code, SensorCode.OK)
        # written so that NaN fails
        with w.when(~is_number(r)):
            w.assign(code, SensorCode.MISSING)
        for value in self._codes:
            slack = CODE_SLACK * abs(value)
            low, high = value - slack, value + slack
            with w.when(is_code(code, SensorCode.OK) & (r >= low) & (r <= high)):
                w.assign(code, SensorCode.BREAK_CODE)
        for limit, sign in ((self._item.reading_min, "<"), (self._item.reading_max, ">")):
            if limit is not None:
                with w.when(is_code(code, SensorCode.OK) & Operation(sign, r, Real(limit))):
                    w.assign(code, SensorCode.OUT_OF_LIMITS)
        if self._item.rate_limit_per_min is not None:
            with w.when(is_code(code, SensorCode.OK)):
                self._jump(self._item.rate_limit_per_min)
        if self._stuck_after_s is not None:
            with w.when(is_code(code, SensorCode.OK)):
                self._stuck(self._stuck_after_s)
        if self._guard.outside_valid_range == "fault":
            with w.when(is_code(code, SensorCode.OK)):
                x = self._fresh_x()
                with w.when(self._is_outside(x)):
                    w.assign(code, SensorCode.OUTSIDE_VALID_RANGE)

    def _jump(self, rate_per_min: float) -> None:
        w, r = self._w, self._reading
        allowed, change = w.variable("allowed"), w.variable("change")
        with w.when(~self._has_anchor):
            self._take_anchor()
        with w.otherwise():
            w.assign(allowed, self._anchor_age, least=ANCHOR_S)
            w.assign(allowed, Real(rate_per_min / 60.0) * allowed)
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
        with w.when(self.has_start):
            w.assign(x, self._reading - self._start)
        return x

    def _is_outside(self, x: Variable) -> Expression:
        slack = RANGE_SLACK * (self._item.valid_max - self._item.valid_min)
        low = self._item.valid_min - slack
        return (x < low) | (x > self._item.valid_max + slack)

    def _take_x(self) -> Variable:
        """What the model gets, inside its valid range; before that it is returned."""
        w, item = self._w, self._item
        x = w.variable("x")
        w.assign(x, self._reading - self._start if item.reference == "rise" else self._reading)
        w.assign(self.x, x, least=item.valid_min, most=item.valid_max)
        return x

    def _credit(self, clock: Variable, elapsed: Variable, most_s: float, longest_s: float = LONGEST_S) -> None:
        """A sample counts for so long at most."""
        credit = self._w.variable("credit_s")
        self._w.assign(credit, elapsed, most=most_s)
        self._add(clock, credit, longest_s)

    def _add(self, clock: Variable, elapsed: Variable, longest_s: float = LONGEST_S) -> None:
        self._w.assign(clock, clock + elapsed, most=longest_s)


class SlewedCorrection:
    """Variables and statements of the k-th output (from 1)."""

    def __init__(
        self,
        w: Writing,
        output: Output,
        limits: DecidedLimits,
        k: int,
        adapted: AdaptedOutput | None = None,
        *,
        has_zero: bool = False,
    ) -> None:
        self._w, self._limits, self._name = w, limits, output.name
        self.adapted, self.is_rise = adapted, output.reference == "rise"
        self._is_turned = is_turned(output)
        self._test = w.variable(
            f"test_um_{k}", "real", "input", f"sign test of {output.name}: not 0 commands so much [um]"
        )
        self._tested = w.variable(f"tested_{k}")
        self._correction = w.variable(
            f"correction_{k}", "real", "output", f"to be added to the axis for {output.name} [um]"
        )
        self._k0 = w.variable(f"k0_{k}", "real", "output", "the same at the reference position [um]")
        self._aim = w.variable(f"aim_{k}", "real", "kept", "where it moves to [um]")
        self._rest = w.variable(f"rest_{k}", "real", "kept", "what rounding left of its last step [um]")
        self._along = None if output.position is None else _Along(w, output.position, k)
        self._zero = _Zero(w, output, k) if has_zero else None

    def zeroed(self, at: Mapping[str, Variable]) -> None:
        """Where its axis was homed, nothing is to be corrected: the error that is there now counts as none."""
        w, zero, along = self._w, self._zero, self._along
        if zero is not None:
            with w.when(zero.is_wanted):
                self.stopped()
                w.assign(zero.waits, True)
                if along is not None:
                    w.assign(zero.where, at[along.part.axis], least=along.part.valid_min_m, most=along.part.valid_max_m)

    def stopped(self) -> None:
        """The control was off: the correction begins at zero."""
        self._off()
        self.aimed_at_zero()

    def aimed_at_zero(self) -> None:
        """Whatever comes, it goes to zero."""
        self._w.assign(self._aim, 0.0)
        if self._along is not None:
            self._w.assign(self._along.aim, 0.0)

    def tested(self, is_test: Variable) -> None:
        """What is commanded by hand, 0 if nothing is; what is no number commands nothing."""
        w, test, clamp = self._w, self._tested, self._limits.clamp_um
        w.assign(test, 0.0)
        with w.when(is_number(self._test)):
            w.assign(test, self._test)
        with w.when((test < 0.0) | (test > 0.0)):
            w.assign(is_test, True)
        w.limit(test, least=-clamp, most=clamp)

    def touched(self, becomes_valid: Expression) -> None:
        """What the probe shows while this correction acts is taken."""
        if self.adapted is not None:
            where = None if self._along is None else self._along.where
            self.adapted.taken(becomes_valid, self._correction, where, is_turned=self._is_turned)

    def aimed(self, output: Output, z: Mapping[str, Variable]) -> None:
        """The output of the model, or of a fallback, is where it moves to from now on."""
        w, limits, along = self._w, self._limits, self._along
        own, change = w.variable("own"), w.variable("change")
        polynomial(w, own, output.intercept, output.terms, z)
        if self.adapted is not None and output.position is not None:
            steep = w.variable("steep")
            polynomial(w, steep, output.position.intercept, output.position.terms, z)
            self.adapted.added(own, steep, output.position.reference_m)
        elif self.adapted is not None:
            self.adapted.added(own, None, 0.0)
        self._turn(own)
        is_given = is_number(own)
        if along is not None:
            part, steep = output.position, w.variable("steep")
            polynomial(w, steep, part.intercept if part else 0.0, part.terms if part else (), z)
            self._turn(steep)
            is_given = is_given & (steep >= -LARGEST_NUMBER) & (steep <= LARGEST_NUMBER)
        with w.when(is_given):
            if self._zero is not None:
                with w.when(self._zero.waits):
                    w.assign(self._zero.waits, False)
                    w.assign(self._zero.um, own)
                    if along is not None:
                        away = self._zero.where - along.part.reference_m
                        w.assign(self._zero.um, own + w.variable("steep") * away)
                w.assign(own, own - self._zero.um)
            w.limit(own, least=-limits.clamp_um, most=limits.clamp_um)
            w.assign(change, own - self._aim)
            with w.when((change >= limits.dead_band_um) | (change <= -limits.dead_band_um)):
                w.assign(self._aim, own)
            if along is not None and limits.reach_m > 0.0:
                steep, size, most = w.variable("steep"), w.variable("size"), w.variable("most")
                w.assign(size, self._aim)
                with w.when(self._aim < 0.0):
                    w.assign(size, -self._aim)
                w.assign(most, (Real(limits.clamp_um) - size) / limits.reach_m, most=limits.slope_clamp_um_per_m)
                w.limit(steep, least=-most, most=most)
                w.assign(along.aim, steep)

    def moved(self, mode: Variable, slewed: Variable, at: Mapping[str, Variable], back: Mapping[str, Variable]) -> None:
        """One call goes by; per axis, `at` is its position, and `back` says that it was lost and is there again."""
        w, limits, along = self._w, self._limits, self._along
        switched_off, is_test = is_code(mode, Mode.SWITCHED_OFF), is_code(mode, Mode.TEST)
        w.remark(f"correction of {self._name}: no faster than the slew limit")
        with w.when(is_code(mode, Mode.OFF)):
            self._off()
        with w.otherwise():
            if along is not None:
                self._carried(along, at[along.part.axis], back[along.part.axis])
            to = w.variable("towards")
            w.assign(to, self._aim)
            with w.when(switched_off):
                w.assign(to, 0.0)
            with w.when(is_test):
                w.assign(to, self._tested)
            towards(w, self._k0, to, self._rest, slewed, limits.own_slew_um_per_s)
            if along is None:
                w.assign(self._correction, self._k0)
                return
            w.assign(to, along.aim)
            with w.when(switched_off | is_test):
                w.assign(to, 0.0)
            towards(w, along.slope, to, along.rest, slewed, limits.slope_slew_um_per_m_s)
            away = along.where - along.part.reference_m
            w.assign(to, self._k0 + along.slope * away, least=-limits.clamp_um, most=limits.clamp_um)
            with w.when(along.is_back):
                whole = w.variable("whole")
                w.assign(whole, to)
                towards(w, self._correction, to, along.back_rest, slewed, limits.slew_um_per_s)
                w.assign(along.is_back, (self._correction < whole) | (self._correction > whole))
            with w.otherwise():
                w.assign(self._correction, to)

    def _off(self) -> None:
        """What moves is 0 while the axis is not ready."""
        own, along = (self._k0, self._rest, self._correction), self._along
        for variable in own if along is None else (*own, along.slope, along.rest, along.back_rest):
            self._w.assign(variable, 0.0)
        if along is not None:
            self._w.assign(along.is_back, False)

    def _carried(self, along: _Along, at: Variable, back: Variable) -> None:
        """The correction moves with its axis; after its position was lost, no faster than the slew limit."""
        w, clamp, where = self._w, self._limits.clamp_um, self._w.variable("where")
        w.assign(where, at, least=along.part.valid_min_m, most=along.part.valid_max_m)
        with w.when(back):
            w.assign(along.is_back, True)
        with w.otherwise():
            w.assign(self._correction, self._correction + along.slope * (where - along.where), least=-clamp, most=clamp)
        w.assign(along.where, where)

    def _turn(self, displacement: Variable) -> None:
        """The sign of the correction."""
        if not self._is_turned:
            self._w.assign(displacement, -displacement)


class _Along:
    """Variables of a position-dependent part."""

    def __init__(self, w: Writing, part: PositionPart, k: int) -> None:
        self.part = part
        self.slope = w.variable(f"slope_{k}", "real", "output", "and its slope [um/m]")
        self.aim = w.variable(f"slope_aim_{k}", "real", "kept", "where the slope moves to [um/m]")
        self.rest = w.variable(f"slope_rest_{k}", "real", "kept", "[um/m]")
        self.where = w.variable(f"where_{k}", "real", "kept", "position in the call before [m]", part.reference_m)
        self.is_back = w.variable(f"is_back_{k}", "flag", "kept", "position came back, correction is on its way")
        self.back_rest = w.variable(f"back_rest_{k}", "real", "kept", "[um]")


class _Zero:
    """Variables of what counts as no error since the axis was homed."""

    def __init__(self, w: Writing, output: Output, k: int) -> None:
        about = f"the axis of {output.name} was homed: its correction begins at zero there"
        self.is_wanted = w.variable(f"is_zero_{k}", "flag", "input", about)
        self.um = w.variable(f"zero_{k}", "real", "kept", "correction that counts as none [um]")
        self.waits = w.variable(f"zero_waits_{k}", "flag", "kept", "it is taken with the next sample")
        if output.position is not None:
            self.where = w.variable(f"zero_at_{k}", "real", "kept", "position where it was homed [m]")


class AdaptedOutput:
    """Variables and statements of the k-th output (from 1)."""

    def __init__(self, w: Writing, of: OutputAdaptation, block: Adaptation, k: int, *, has_slope: bool) -> None:
        self._w, self._of, self._block = w, of, block
        self._has_gain = of.gain_limit > 0.0
        about = f"displacement of {of.output} that the probe shows, correction acting [um]"
        self._touch = w.variable(f"touch_um_{k}", "real", "input", about, NO_READING)
        about = f"touch-off of {of.output}: 0 none yet, 1 believed, 2 doubted: probe again, 3 not used"
        self._code = w.variable(f"touch_{k}", "code", "output", about, float(TouchCode.NONE))
        self._offset = w.variable(f"offset_{k}", "real", "retained", f"adapted offset of {of.output} [um]")
        self._v = w.variable(
            f"offset_variance_{k}", "real", "retained", "what is not known of it [um^2]", of.offset_start_um2
        )
        if self._has_gain:
            self._gain = w.variable(f"gain_{k}", "real", "retained", f"adapted gain of {of.output}")
            self._u = w.variable(f"gain_variance_{k}", "real", "retained", "what is not known of it", of.gain_start)
            self._c = w.variable(f"covariance_{k}", "real", "retained", "of offset and gain [um]")
        self._age = w.variable(f"touched_ago_{k}", "real", "retained", "since the last touch-off [s]")
        self._has_doubt = w.variable(f"has_doubt_{k}", "flag", "retained", "the last touch-off was not believed")
        self._has_two = w.variable(f"has_two_{k}", "flag", "retained", "and the one before it agreed with it")
        self._doubted = w.variable(f"doubted_{k}", "real", "retained", "what it said [um]")
        self._waits = w.variable(f"touch_waits_{k}", "flag", "kept", "a touch-off waits for the next sample")
        self._shown = w.variable(f"shown_{k}", "real", "kept", "what it says of the displacement [um]")
        self._shown_at = w.variable(f"shown_at_{k}", "real", "kept", "and where [m]") if has_slope else None

    def begun(self) -> None:
        """A new start: nothing is known of offset and gain."""
        w = self._w
        w.assign(self._offset, 0.0)
        w.assign(self._v, self._of.offset_start_um2)
        if self._has_gain:
            w.assign(self._gain, 0.0)
            w.assign(self._u, self._of.gain_start)
            w.assign(self._c, 0.0)
        w.assign(self._age, 0.0)
        w.assign(self._has_doubt, False)
        w.assign(self._has_two, False)
        w.assign(self._doubted, 0.0)

    def passed(self, seconds: Variable) -> None:
        """Time went by."""
        self._w.assign(self._age, self._age + seconds, most=LONGEST_S)

    def stopped(self) -> None:
        """The control was off: a touch-off that waited is gone."""
        self._w.assign(self._waits, False)

    def kept_checked(self) -> None:
        """Drops what was kept over a restart and cannot be."""
        w, of = self._w, self._of
        is_possible = _is_within(self._offset, of.offset_limit_um) & _is_within(self._v, LARGEST_NUMBER, 0.0)
        is_possible = is_possible & _is_within(self._age, LONGEST_S, 0.0)
        is_possible = is_possible & _is_within(self._doubted, 4.0 * LARGEST_NUMBER)
        if self._has_gain:
            is_possible = is_possible & _is_within(self._gain, of.gain_limit)
            is_possible = is_possible & _is_within(self._u, LARGEST_NUMBER, 0.0)
            is_possible = is_possible & _is_within(self._c, LARGEST_NUMBER)
        with w.when(~is_possible):
            self.begun()

    def taken(self, rises: Expression, correction: Variable, where: Variable | None, *, is_turned: bool) -> None:
        """A touch-off is taken in the call in which it becomes valid; what is no number is none."""
        w = self._w
        with w.when(rises & _is_within(self._touch, LARGEST_NUMBER)):
            w.assign(self._shown, self._touch + correction if is_turned else self._touch - correction)
            w.assign(self._waits, True)
            if self._shown_at is not None and where is not None:
                w.assign(self._shown_at, where)

    def added(self, own: Variable, steep: Variable | None, reference_m: float) -> None:
        """`own` gets offset and gain, after the touch-off that waits for it; `steep` is the slope of the model."""
        w, shown = self._w, self._w.variable("shown_um")
        is_number = _is_within(own, LARGEST_NUMBER)
        if steep is not None:
            is_number = is_number & _is_within(steep, LARGEST_NUMBER)
        with w.when(self._waits & is_number):
            w.assign(self._waits, False)
            if steep is None or self._shown_at is None:
                w.assign(shown, self._shown - own)
            else:
                w.assign(shown, self._shown - steep * (self._shown_at - reference_m) - own)
            self._touched(shown, own)
        total = own + self._offset
        w.assign(own, total + self._gain * own if self._has_gain else total)

    def dropped(self) -> None:
        """A touch-off that nothing could be compared with."""
        w = self._w
        with w.when(self._waits):
            w.assign(self._waits, False)
            w.assign(self._code, TouchCode.UNUSED)

    def _touched(self, error: Variable, m: Variable) -> None:
        w, of = self._w, self._of
        surprise, of_offset, variance, square, away, share = (
            w.variable(name) for name in ("surprise", "of_offset", "variance", "square", "away", "share")
        )
        w.assign(self._v, self._v + Real(of.offset_um2_per_s) * self._age, most=LARGEST_NUMBER)
        w.assign(surprise, error - self._offset)
        w.assign(of_offset, self._v)
        if self._has_gain:
            of_gain = w.variable("of_gain")
            w.assign(self._u, self._u + Real(of.gain_per_s) * self._age, most=LARGEST_NUMBER)
            w.assign(surprise, surprise - self._gain * m)
            w.assign(of_offset, self._v + self._c * m)
            w.assign(of_gain, self._c + self._u * m)
            w.assign(variance, of_offset + of_gain * m + of.noise_um2, least=of.noise_um2)
        else:
            w.assign(variance, self._v + of.noise_um2)
        w.assign(self._age, 0.0)
        w.assign(square, surprise * surprise)
        w.assign(self._code, TouchCode.BELIEVED)
        with w.when(square > Real(self._block.gate * self._block.gate) * variance):
            w.assign(away, error - self._doubted)
            agreeing = Real(self._block.agreeing * self._block.agreeing) * square
            agrees = w.variable("agrees", "flag")
            w.assign(agrees, self._has_doubt & (away * away <= agreeing))
            w.remark("two that agree are believed; beyond the limit of the offset it takes three")
            with w.when(agrees & (self._has_two | (error * error <= of.offset_limit_um * of.offset_limit_um))):
                w.assign(self._v, self._v + square)
                w.assign(of_offset, of_offset + square)
                w.assign(variance, variance + square)
            with w.otherwise():
                w.assign(self._doubted, error)
                w.assign(self._has_two, agrees)
                w.assign(self._has_doubt, True)
                w.assign(self._code, TouchCode.DOUBTED)
        with w.when(is_code(self._code, TouchCode.BELIEVED)):
            w.assign(self._has_doubt, False)
            w.assign(self._has_two, False)
            w.assign(share, of_offset / variance)
            w.assign(self._offset, self._offset + share * surprise, least=-of.offset_limit_um, most=of.offset_limit_um)
            w.assign(self._v, self._v - share * of_offset, least=0.0, most=LARGEST_NUMBER)
            if self._has_gain:
                of_gain, part = w.variable("of_gain"), w.variable("share_of_gain")
                w.assign(part, of_gain / variance)
                w.assign(self._gain, self._gain + part * surprise, least=-of.gain_limit, most=of.gain_limit)
                w.assign(self._c, self._c - share * of_gain, least=-LARGEST_NUMBER, most=LARGEST_NUMBER)
                w.assign(self._u, self._u - part * of_gain, least=0.0, most=LARGEST_NUMBER)


def _is_within(of: Variable, high: float, low: float | None = None) -> Expression:
    return (of >= (-high if low is None else low)) & (of <= high)
