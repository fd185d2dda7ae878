"""Steps that sensors and outputs of a guarded program share: a number or none, memory, polynomial, slew limit."""

from collections.abc import Mapping, Sequence

from selector.controllers.guard.decided import GAP_STEPS_LOG2, LARGEST_NUMBER
from selector.controllers.model_file import Term
from selector.controllers.program.language import Expression, Real, Variable, Writing


def is_number(of: Expression) -> Expression:
    """Whether it is a number; written so that NaN is none."""
    return (of >= -LARGEST_NUMBER) & (of <= LARGEST_NUMBER)


def remembered(w: Writing, level: Variable, x: Variable, since: Variable, tau_s: float, is_gap: Expression) -> None:
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


def polynomial(w: Writing, total: Variable, intercept: float, terms: Sequence[Term], z: Mapping[str, Variable]) -> None:
    """A displacement or its slope."""
    w.assign(total, intercept)
    for term in terms:
        product: Expression = Real(term.coefficient)
        for name, power in term.powers.items():
            for _ in range(power):
                product = product * z[name]
        w.assign(total, total + product)


def towards(w: Writing, now: Variable, to: Variable, rest: Variable, slewed: Variable, slew: float) -> None:
    """A step no faster than the slew limit; what rounding gives or takes of it is made up for in the next."""
    most, reach, low, high = (w.variable(name) for name in ("most", "reach", "low", "high"))
    w.assign(most, Real(slew) * slewed + rest)
    w.assign(reach, most, least=0.0)
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
