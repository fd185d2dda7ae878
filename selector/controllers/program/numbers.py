"""In which numbers a guarded program calculates: its literals, and the steps that whole numbers take otherwise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from selector.controllers.guard.decided import GAP_STEPS_LOG2, LARGEST_NUMBER, RANGE_SLACK
from selector.controllers.model_file import Input, State, Term
from selector.controllers.program.language import Expression, Real, Variable, Writing


class Numbers:
    """Binary floating point: seconds, micrometres, metres and the units of the sensors, as the model file has them."""

    def writing(self) -> Writing:
        """A program that is begun."""
        return Writing()

    def seconds(self, value: float) -> Expression:
        """A time."""
        return Real(value)

    def um(self, value: float) -> Expression:
        """A length of the correction, or its slope [per m]."""
        return Real(value)

    def metres(self, value: float) -> Expression:
        """A position."""
        return Real(value)

    def reading(self, item: Input, value: float, up: int = 0) -> Expression:
        """A reading of a sensor, or a difference of two; `up`: rounded up (1), down (−1), or to the nearest (0)."""
        return Real(value)

    def is_given(self, of: Expression) -> Expression:
        """Whether an input is a number; written so that NaN is none."""
        return (of >= -LARGEST_NUMBER) & (of <= LARGEST_NUMBER)

    def is_number(self, of: Expression) -> Expression:
        """Whether a result is a number."""
        return self.is_given(of)

    def largest_change(self, item: Input, rate_per_min: float, seconds: Expression) -> Expression:
        """What a reading may change in so long."""
        return Real(rate_per_min / 60.0) * seconds

    def along(self, slope: Expression, way: Expression) -> Expression:
        """What a slope makes of a way."""
        return slope * way

    def left_over(self, length: Expression, reach_m: float) -> Expression:
        """The slope that a length leaves over a reach."""
        return length / reach_m

    def remembered(
        self, w: Writing, level: Variable, x: Variable, since: Variable, tau_s: float, is_gap: Expression
    ) -> None:
        """A memory goes on to x (backward Euler); over a standstill in equal steps."""
        gain = w.variable("gain")
        with w.when(is_gap):
            left = w.variable("left")
            w.assign(left, Real(1.0) / (Real(1.0) + since / (Real(float(2**GAP_STEPS_LOG2)) * Real(tau_s))))
            for _ in range(GAP_STEPS_LOG2):
                w.assign(left, left * left)
            w.assign(gain, Real(1.0) - left)
        with w.otherwise():
            w.assign(gain, since / (Real(tau_s) + since))
        w.assign(level, level + gain * (x - level))

    def is_level(self, level: Expression, item: Input) -> Expression:
        """Whether a memory is inside the valid range of its sensor."""
        slack = RANGE_SLACK * (item.valid_max - item.valid_min)
        return (level >= item.valid_min - slack) & (level <= item.valid_max + slack)

    def begun(self, x: Variable) -> Expression:
        """The level of a memory that begins with x."""
        return x

    def scaled(self, w: Writing, z: Variable, of: Input | State, x: Variable, source: Input) -> None:
        """What the polynomials are made of: an x, or the level of a memory, about its centre."""
        w.assign(z, (x - of.centre) / of.scale)

    def polynomial(
        self, w: Writing, total: Variable, intercept: float, terms: Sequence[Term], z: Mapping[str, Variable]
    ) -> None:
        """A displacement or its slope."""
        w.assign(total, intercept)
        for term in terms:
            product: Expression = Real(term.coefficient)
            for name, power in term.powers.items():
                for _ in range(power):
                    product = product * z[name]
            w.assign(total, total + product)

    def towards(self, w: Writing, now: Variable, to: Variable, rest: Variable, slewed: Variable, slew: float) -> None:
        """A step no faster than the slew limit; what rounding gives or takes of it is made up for in the next."""
        most, reach, low, high = (w.variable(name) for name in ("most", "reach", "low", "high"))
        w.assign(most, Real(slew) * slewed + rest)
        w.assign(reach, most)
        w.at_least(reach, 0.0)
        w.assign(low, now - reach)
        w.assign(high, now + reach)
        w.assign(rest, 0.0)
        with w.when(to < low):
            w.assign(rest, most - (now - low))
            w.assign(to, low)
        with w.when(to > high):
            w.assign(rest, most - (high - now))
            w.assign(to, high)
        w.assign(now, to)
