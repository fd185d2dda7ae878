"""`gauging.interrupted`: the gauge meets an interrupted surface."""

from collections.abc import Iterator

import numpy as np

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.effect import Effect, Fitted, Quantity, Reading, Variant, words_of
from selector.diagnosis.effects.gauging.lag import infeed
from selector.diagnosis.shapes.residual import unexplained
from selector.diagnosis.shapes.signals import SLOWEST_VIBRATION_S, course, excited, lagged, no_gauging, part_by_part
from selector.diagnosis.shapes.spectral_lines import Line, course_of, lines, turns_of
from selector.types import Vector

_LAGS_S = (0.0, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0)
_OWN = 0.03  #: A state that differs from the infeed in fewer rows, or agrees in fewer, is that of the feed.
_GROOVES = tuple(float(k) for k in range(1, 13))


def _variants(comparison: Comparison, response: str) -> Iterator[Variant]:
    parts = part_by_part(comparison, response)
    ripples = list(_ripples(comparison, response))
    for name, share in _interruptions(comparison):
        for tau_s in (0.0,) if parts else _LAGS_S:
            if 0.0 < tau_s < comparison.period_s:
                continue
            smooth = lagged(comparison, share, tau_s, settled=True)
            shape = {"tau_s": Quantity(tau_s, "s")}
            yield Variant(smooth[:, None], (f"offset while {name}",), shape, sources=(name,), regime=f"{name} > 0")
        for order, columns in ripples:
            names, shape = (f"ripple of {order:g} per turn while {name}",), {"grooves": Quantity(order, "1")}
            yield Variant((columns * share)[:, None], names, shape, sources=(name,), regime=f"{name} > 0")
    for order, column in ripples:
        yield Variant(column[:, None], (f"ripple of {order:g} per turn",), {"grooves": Quantity(order, "1")})
    for column in _envelopes(comparison, response) if not parts else ():
        yield Variant(column[:, None], ("offset with the strength of the ripple",))


def _interruptions(comparison: Comparison) -> Iterator[tuple[str, Vector]]:
    """States that may say that the surface is interrupted, 0 … 1; one that goes with the infeed says contact.

    An infeed that never stops goes with nothing.
    """
    feeding = [np.abs(rate_um_per_s) > 0.0 for rate_um_per_s in infeed(comparison).values()]
    for name in comparison.with_role("state"):
        state = course(comparison, name)
        if not excited(state):
            continue
        share = (state - float(state.min())) / float(np.ptp(state))
        agrees = [float(np.mean(on == (share > 0.5))) for on in feeding if not on.all()]
        if all(_OWN < agreement < 1.0 - _OWN for agreement in agrees):
            yield name, share


def _ripples(comparison: Comparison, response: str) -> Iterator[tuple[float, Vector]]:
    """Lines at whole numbers of grooves per turn that stand in the reading."""
    if part_by_part(comparison, response) or comparison.period_s > SLOWEST_VIBRATION_S:
        return
    left, even = unexplained(comparison, response), np.ones(len(comparison.time_s))
    for name in comparison.with_role("spindle_speed"):
        rpm = np.abs(course(comparison, name))
        if float(rpm.max(initial=0.0)) <= 0.0:
            continue
        abscissa = turns_of(comparison, rpm)
        for line in lines(comparison, left, abscissa, even, near=_GROOVES, most=2):
            order = float(round(line.cycles))
            yield order, course_of(line, comparison, abscissa, even)
            quarter = tuple(None if p is None else p + 0.5 * np.pi for p in line.phases)
            yield order, course_of(Line(line.cycles, quarter, line.strength), comparison, abscissa, even)


def _envelopes(comparison: Comparison, response: str) -> Iterator[Vector]:
    """Running strength of what is quick in the reading, where it changes by more than noise does."""
    left = unexplained(comparison, response)
    for width_s in (20.0 * comparison.period_s, 100.0 * comparison.period_s):
        slow = lagged(comparison, left, width_s, settled=True)
        strength = np.sqrt(lagged(comparison, (left - slow) ** 2, width_s, settled=True))
        middle = float(np.median(strength))
        if middle > 0.0 and float(np.quantile(strength, 0.95)) > 2.0 * middle:
            yield strength


def _testable(comparison: Comparison, response: str) -> str | None:
    reason = no_gauging(comparison, response)
    quick = comparison.period_s <= SLOWEST_VIBRATION_S and not part_by_part(comparison, response)
    if reason is None and not quick and next(_interruptions(comparison), None) is None:
        return "no state of the surface is recorded (role state), and no reading in time that would show its ripple"
    return reason


def _reading(fitted: Fitted, comparison: Comparison) -> Reading:
    grooves = fitted.variant.shape.get("grooves")
    if grooves is not None:
        text = f"{fitted.response} ripples {grooves.value:g} times a turn by up to {fitted.up_to}"
        return Reading(text, fitted.size | {"grooves": grooves})
    offset = fitted.coefficient()
    when = f"while {fitted.variant.sources[0]} is on" if fitted.variant.sources else "when its ripple is strong"
    text = f"{fitted.response} reads {offset.value:+.3g} {fitted.unit} {when}, as on an interrupted surface"
    return Reading(text, fitted.size | {"offset": offset})


EFFECT = Effect(**words_of("gauging.interrupted"), variants=_variants, testable=_testable, reading=_reading)
