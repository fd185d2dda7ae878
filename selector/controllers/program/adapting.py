"""What touch-offs add to the displacement of one output as statements.

The same filter as `selector.adaptation.drift.tracked`; here with the limits of a program that runs for years.
"""

from selector.controllers.adaptation_block import Adaptation, OutputAdaptation
from selector.controllers.guard.decided import LARGEST_NUMBER, LONGEST_S, TouchCode
from selector.controllers.program.language import Expression, Real, Variable, Writing, is_code
from selector.controllers.program.statements import NO_READING


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
        self._w.assign(self._age, self._age + seconds)
        self._w.at_most(self._age, LONGEST_S)

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
        w.assign(self._v, self._v + Real(of.offset_um2_per_s) * self._age)
        w.at_most(self._v, LARGEST_NUMBER)
        w.assign(surprise, error - self._offset)
        w.assign(of_offset, self._v)
        if self._has_gain:
            of_gain = w.variable("of_gain")
            w.assign(self._u, self._u + Real(of.gain_per_s) * self._age)
            w.at_most(self._u, LARGEST_NUMBER)
            w.assign(surprise, surprise - self._gain * m)
            w.assign(of_offset, self._v + self._c * m)
            w.assign(of_gain, self._c + self._u * m)
            w.assign(variance, of_offset + of_gain * m + of.noise_um2)
            w.at_least(variance, of.noise_um2)
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
            w.assign(self._offset, self._offset + share * surprise)
            w.limit(self._offset, -of.offset_limit_um, of.offset_limit_um)
            w.assign(self._v, self._v - share * of_offset)
            w.limit(self._v, 0.0, LARGEST_NUMBER)
            if self._has_gain:
                of_gain, part = w.variable("of_gain"), w.variable("share_of_gain")
                w.assign(part, of_gain / variance)
                w.assign(self._gain, self._gain + part * surprise)
                w.limit(self._gain, -of.gain_limit, of.gain_limit)
                w.assign(self._c, self._c - share * of_gain)
                w.limit(self._c, -LARGEST_NUMBER, LARGEST_NUMBER)
                w.assign(self._u, self._u - part * of_gain)
                w.limit(self._u, 0.0, LARGEST_NUMBER)


def _is_within(of: Variable, high: float, low: float | None = None) -> Expression:
    return (of >= (-high if low is None else low)) & (of <= high)
