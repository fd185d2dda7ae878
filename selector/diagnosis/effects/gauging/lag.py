"""`gauging.lag`: the gauge or its filter is late."""

from collections.abc import Iterator
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.effect import Effect, Fitted, Quantity, Reading, Variant, words_of
from selector.diagnosis.shapes import signals
from selector.diagnosis.shapes.axis import motion
from selector.types import Vector

_UM_PER_S = {"feed_rate": 1000.0 / 60.0, "velocity": 1e6}  #: Canonical unit of the role in µm/s.
_SPAN_S = (0.005, 1.0)
_READINGS = ("force", "current", "voltage", "flow", "velocity")
#: Times the reading: what trails in a small part is a time constant that is a little off. A gain fitted without the lag
#: may be any number of times too small.
_AS_A_WHOLE = ((0.4, np.inf),)
_JUMP = 0.3  #: Share of the range of a reading that no feed goes through between two samples.


def _variants(comparison: Comparison, response: str) -> Iterator[Variant]:
    feeds = infeed(comparison)
    if signals.part_by_part(comparison, response):
        for name, rate_um_per_s in feeds.items():
            shape = {"rows": Quantity(1.0, "part")}
            yield Variant(-rate_um_per_s[:, None], (f"infeed {name} at the stop",), shape, sources=(name,))
        return
    simulated = comparison.simulated_course(response)
    # where the simulated reading jumps the gauge is put onto the next part
    steps = np.abs(np.diff(simulated, prepend=simulated[:1]))
    steps[list(comparison.starts[:-1])] = 0.0
    jumps = np.flatnonzero(steps > _JUMP * float(np.ptp(simulated)))
    for tau_s in _lags_s(comparison, response):
        late = signals.lagged(comparison, simulated, tau_s, settled=True) - simulated
        trailing = partial(Variant, shape={"tau_s": Quantity(tau_s, "s")}, bounds=_AS_A_WHOLE)
        yield trailing(late[:, None], (f"reading {tau_s:.3g} s late",))
        if len(jumps):
            anew = _late_anew(comparison, simulated, jumps, tau_s)
            yield trailing(anew[:, None], (f"reading {tau_s:.3g} s late, anew on every part",))
    for name, rate_um_per_s in feeds.items():
        for tau_s in (0.0, *_lags_s(comparison, response)[2::3]):
            column = -signals.lagged(comparison, rate_um_per_s, tau_s)
            words = f"infeed {name}" + (f", {tau_s:.3g} s later" if tau_s else "")
            yield Variant(column[:, None], (words,), {"transient_s": Quantity(tau_s, "s")}, sources=(name,))


def _late_anew(comparison: Comparison, simulated: Vector, jumps: NDArray[np.intp], tau_s: float) -> Vector:
    """What a lag makes of a reading whose filter is settled where the gauge is put on, at the start and at `jumps`."""
    steps = np.diff(simulated, prepend=simulated[:1])
    levels = np.zeros(len(simulated))
    levels[jumps] = steps[jumps]
    level = np.cumsum(levels)
    late = signals.lagged(comparison, simulated - level, tau_s, settled=True) - (simulated - level)
    for _, rows in comparison.rows_of_runs():
        begins = [*jumps[(jumps >= rows.start) & (jumps < rows.stop)], rows.stop]
        for first, last in pairwise(begins):
            time = comparison.time_s[first:last]
            late[first:last] -= late[first] * np.exp(-(time - time[0]) / tau_s)
    return np.asarray(late)


def infeed(comparison: Comparison) -> dict[str, Vector]:
    """Recorded infeeds that change [µm/s]."""
    found = {}
    for name in comparison.with_role(*_UM_PER_S):
        values = signals.course(comparison, name) * _UM_PER_S[comparison.channel(name).role]
        if signals.excited(values):
            found[name] = values
    return found


def _lags_s(comparison: Comparison, response: str) -> list[float]:
    if _is_other_reading(comparison, response):
        taus = signals.time_constants(comparison, 24)
        return [*map(float, signals.quick_time_constants(comparison, float(taus[0]))), *map(float, taus)]
    taus = signals.time_constants(comparison, 10)
    low = max(_SPAN_S[0], 0.5 * comparison.period_s)
    return [float(tau_s) for tau_s in np.geomspace(low, max(min(_SPAN_S[1], float(taus[-1])), 2.0 * low), 10)]


def _is_other_reading(comparison: Comparison, response: str) -> bool:
    """Whether a response is the reading of a force, current, voltage, flow or speed, and no other channel of an axis.

    Of those that move with one, effects of drives are late in their own ways.
    """
    channel = comparison.channel(response)
    moving = motion(comparison, channel.axis) if channel.role in _READINGS else None
    return channel.role in _READINGS and (moving is None or set(moving.sources) <= {response})


def _testable(comparison: Comparison, response: str) -> str | None:
    if _is_other_reading(comparison, response):
        return None
    reason = signals.no_gauging(comparison, response)
    if reason is None and signals.part_by_part(comparison, response) and not infeed(comparison):
        return "the infeed at the stop is not recorded (role feed_rate), or is the same for all parts"
    return reason


def _reading(fitted: Fitted, comparison: Comparison) -> Reading:
    if "tau_s" in fitted.variant.shape:
        tau, share = fitted.parameter("tau_s"), Quantity(float(fitted.coefficients[0]), "1")
        text = f"{fitted.response} follows {tau.value:.3g} s late; at most that makes {fitted.up_to}"
        return Reading(text, fitted.size | {"tau_s": tau, "share": share})
    if fitted.unit == "um":
        lag = fitted.coefficient("s")
        text = f"the gauge stops the feed {lag.value:.3g} s late: {fitted.response} is off by that times the infeed"
        return Reading(f"{text}, up to {fitted.up_to}", fitted.size | {"lag_s": lag})
    return Reading(f"{fitted.response} is off in proportion to the infeed, up to {fitted.up_to}", fitted.size)


EFFECT = Effect(**words_of("gauging.lag"), variants=_variants, testable=_testable, reading=_reading)
