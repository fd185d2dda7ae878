"""The gauge: late, worn, on an interrupted surface."""

from collections.abc import Iterator
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.effect import Fitted, Quantity, Reading, Variant, declared
from selector.diagnosis.shapes import signals
from selector.diagnosis.shapes.axis import motion
from selector.diagnosis.shapes.residual import unexplained
from selector.diagnosis.shapes.spectral_lines import Line, course_of, lines, turns_of
from selector.types import Vector

_UM_PER_S = {"feed_rate": 1000.0 / 60.0, "velocity": 1e6}  #: Canonical unit of the role in µm/s.
_SPAN_S = (0.005, 1.0)
_READINGS = ("force", "current", "voltage", "flow", "velocity")
#: Times the reading: what trails in a small part is a time constant that is a little off. A gain fitted without the lag
#: may be any number of times too small.
_AS_A_WHOLE = ((0.4, np.inf),)
_JUMP = 0.3  #: Share of the range of a reading that no feed goes through between two samples.


def _lag(comparison: Comparison, response: str) -> Iterator[Variant]:
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


def _lag_testable(comparison: Comparison, response: str) -> str | None:
    if _is_other_reading(comparison, response):
        return None
    reason = signals.no_gauging(comparison, response)
    if reason is None and signals.part_by_part(comparison, response) and not infeed(comparison):
        return "the infeed at the stop is not recorded (role feed_rate), or is the same for all parts"
    return reason


def _lag_reading(fitted: Fitted, comparison: Comparison) -> Reading:
    if "tau_s" in fitted.variant.shape:
        tau, share = fitted.parameter("tau_s"), Quantity(float(fitted.coefficients[0]), "1")
        text = f"{fitted.response} follows {tau.value:.3g} s late; at most that makes {fitted.up_to}"
        return Reading(text, fitted.size | {"tau_s": tau, "share": share})
    if fitted.unit == "um":
        lag = fitted.coefficient("s")
        text = f"the gauge stops the feed {lag.value:.3g} s late: {fitted.response} is off by that times the infeed"
        return Reading(f"{text}, up to {fitted.up_to}", fitted.size | {"lag_s": lag})
    return Reading(f"{fitted.response} is off in proportion to the infeed, up to {fitted.up_to}", fitted.size)


_SATURATION = (0.15, 0.4)  #: Amount after which wear that settles is two thirds done, over the whole amount.


def _wear(comparison: Comparison, response: str) -> Iterator[Variant]:
    every = list(_amounts(comparison, response))
    yield from _wheel_and_probe(every)
    for words, sources, used in every:
        total = float(np.abs(used).max(initial=0.0))
        if total <= 0.0:
            continue
        relative = used / total
        laws = [
            (relative, words, "power", 1.0),
            (relative**2, f"the square of {words}", "power", 2.0),
            *(
                (1.0 - np.exp(-relative / share), f"{words}, settling", "settles", share * total)
                for share in _SATURATION
            ),
        ]
        for column, law, key, value in laws:
            shape = {"whole": Quantity(total, "1"), key: Quantity(value, "1")}
            yield Variant(column[:, None], (f"wear with {law}",), shape, sources=sources)


def _wheel_and_probe(every: list[tuple[str, tuple[str, ...], Vector]]) -> Iterator[Variant]:
    """A wheel that is dressed, and a probe that is not: wear since dressing and wear over all runs, together."""
    lasting = next(used for words, _, used in every if words.endswith("over all runs"))
    for words, sources, used in every:
        if "last came on" not in words:
            continue
        relative = used / max(float(used.max()), 1e-300)
        for share in (np.inf, *_SATURATION):
            wheel = relative if np.isinf(share) else 1.0 - np.exp(-relative / share)
            columns = np.column_stack([wheel, lasting / max(float(lasting.max()), 1e-300)])
            shape = {"whole": Quantity(float(used.max()), "1")}
            if np.isfinite(share):
                shape["settles"] = Quantity(float(share * used.max()), "1")
            yield Variant(columns, (f"wear with {words}", "wear over all runs"), shape, sources=sources)


def _amounts(comparison: Comparison, response: str) -> Iterator[tuple[str, tuple[str, ...], Vector]]:
    """(words, channels, course) of what wear may go with: parts, time, contact, stock removed, since dressing."""
    unit = "parts" if signals.part_by_part(comparison, response) else "time"
    since_start = np.array(comparison.time_s)
    yield f"{unit} since the start of the run", (), since_start
    yield f"{unit} over all runs", (), _over_all_runs(comparison, since_start)
    steps = np.maximum(np.diff(comparison.time_s, prepend=comparison.time_s[:1]), 0.0)
    for name in comparison.with_role("state"):
        state = signals.course(comparison, name)
        if not signals.excited(state):
            continue
        low, high = float(state.min()), float(state.max())
        on = (state - low) / (high - low)
        contact = signals.by_run(comparison, np.cumsum, on * steps)
        yield f"time of {name}", (name,), contact
        yield f"time of {name} over all runs", (name,), _over_all_runs(comparison, contact)
        since = _since_rise(comparison, on > 0.5)
        if since is not None:
            yield f"{unit} since {name} last came on", (name,), since
    for name, rate_um_per_s in infeed(comparison).items():
        removed = signals.by_run(comparison, np.cumsum, np.abs(rate_um_per_s) * steps)
        yield f"stock removed by {name}", (name,), removed
        yield f"stock removed by {name} over all runs", (name,), _over_all_runs(comparison, removed)


def _over_all_runs(comparison: Comparison, used: Vector) -> Vector:
    """The same without starting anew in every run."""
    result, before = np.array(used), 0.0
    for _, rows in comparison.rows_of_runs():
        result[rows] += before
        before = float(result[rows][-1])
    return result


def _since_rise(comparison: Comparison, on: NDArray[np.bool_]) -> Vector | None:
    """Time since the state last came on, e.g. dressing; None if it comes on only once or never, or all the time."""
    result, rises = np.array(comparison.time_s), 0
    for _, rows in comparison.rows_of_runs():
        part, time = on[rows], comparison.time_s[rows]
        begins = np.flatnonzero(part[1:] & ~part[:-1]) + 1
        rises += len(begins)
        for k in begins:
            result[rows][k:] = time[k:] - time[k]
    return result if 2 <= rises <= len(on) // 4 else None


def _wear_reading(fitted: Fitted, comparison: Comparison) -> Reading:
    amount = fitted.coefficient()
    by = f"{'grows' if amount.value > 0.0 else 'shrinks'} by {abs(amount.value):.3g} {fitted.unit}"
    text = f"{fitted.response} {by} over the record, as {fitted.variant.names[0]}"
    return Reading(text, {"over_the_record": amount} | fitted.size)


_LAGS_S = (0.0, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0)
_OWN = 0.03  #: A state that differs from the infeed in fewer rows, or agrees in fewer, is that of the feed.
_GROOVES = tuple(float(k) for k in range(1, 13))


def _interrupted(comparison: Comparison, response: str) -> Iterator[Variant]:
    parts = signals.part_by_part(comparison, response)
    ripples = list(_ripples(comparison, response))
    for name, share in _interruptions(comparison):
        for tau_s in (0.0,) if parts else _LAGS_S:
            if 0.0 < tau_s < comparison.period_s:
                continue
            smooth = signals.lagged(comparison, share, tau_s, settled=True)
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
        state = signals.course(comparison, name)
        if not signals.excited(state):
            continue
        share = (state - float(state.min())) / float(np.ptp(state))
        agrees = [float(np.mean(on == (share > 0.5))) for on in feeding if not on.all()]
        if all(_OWN < agreement < 1.0 - _OWN for agreement in agrees):
            yield name, share


def _ripples(comparison: Comparison, response: str) -> Iterator[tuple[float, Vector]]:
    """Lines at whole numbers of grooves per turn that stand in the reading."""
    if signals.part_by_part(comparison, response) or comparison.period_s > signals.SLOWEST_VIBRATION_S:
        return
    left, even = unexplained(comparison, response), np.ones(len(comparison.time_s))
    for name in comparison.with_role("spindle_speed"):
        rpm = np.abs(signals.course(comparison, name))
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
        slow = signals.lagged(comparison, left, width_s, settled=True)
        strength = np.sqrt(signals.lagged(comparison, (left - slow) ** 2, width_s, settled=True))
        middle = float(np.median(strength))
        if middle > 0.0 and float(np.quantile(strength, 0.95)) > 2.0 * middle:
            yield strength


def _interrupted_testable(comparison: Comparison, response: str) -> str | None:
    reason = signals.no_gauging(comparison, response)
    quick = comparison.period_s <= signals.SLOWEST_VIBRATION_S and not signals.part_by_part(comparison, response)
    if reason is None and not quick and next(_interruptions(comparison), None) is None:
        return "no state of the surface is recorded (role state), and no reading in time that would show its ripple"
    return reason


def _interrupted_reading(fitted: Fitted, comparison: Comparison) -> Reading:
    grooves = fitted.variant.shape.get("grooves")
    if grooves is not None:
        text = f"{fitted.response} ripples {grooves.value:g} times a turn by up to {fitted.up_to}"
        return Reading(text, fitted.size | {"grooves": grooves})
    offset = fitted.coefficient()
    when = f"while {fitted.variant.sources[0]} is on" if fitted.variant.sources else "when its ripple is strong"
    text = f"{fitted.response} reads {offset.value:+.3g} {fitted.unit} {when}, as on an interrupted surface"
    return Reading(text, fitted.size | {"offset": offset})


EFFECTS = (
    declared("gauging.lag", _lag, _lag_testable, _lag_reading),
    declared("gauging.wear", _wear, signals.no_gauging, _wear_reading),
    declared("gauging.interrupted", _interrupted, _interrupted_testable, _interrupted_reading),
)
