"""How one part is ground until the relay stops it, step by step (compiled).

What is exact between two events, and what a cubic, stands in docs/explanation/finished-sizes.md.
"""

# ruff: noqa: NPY002  (compiled, the legacy calls draw from a generator of the thread that is seeded for every part)
# mypy: disable-error-code="no-untyped-def, untyped-decorator, no-untyped-call"
import math
from typing import NamedTuple

import numpy as np
from numba import njit

from selector.types import Vector

# columns of the record
ALLOWANCE, SEEN, VOLTAGE, FEED, STAGE = range(5)
COLUMNS = 5
# what became of a part
STOPPED, AT_ONCE, NEVER = 0, 1, 2
LEAST_FEED = 0.1  #: A part is fed at no less than this share of the mean feed.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)

# not kept on disk one by one: what is kept is the loop with all that it calls, all of them in this file
compiled = njit(nogil=True, error_model="numpy", forceinline=True)


class Plan(NamedTuple):
    """Numbers of a gauged grinding as the loop wants them; those that its parts have are called as there."""

    feed: Vector
    threshold: Vector
    limit_um: Vector
    table_v: Vector
    table_from: float
    table_step: float
    gain_v_per_um: float
    bias_v: float
    sign: float
    time_constant_s: float
    allowance_um: float
    allowance_sd_um: float
    feed_sd: float
    lag_s: float
    wheel_wear: float
    wear_growth_per_part: float
    dress_every: int
    probe_wear_um_per_part: float
    per_s: float
    grooves: int
    groove_share: float
    groove_depth_um: float
    runout_um: float
    sd_um: float
    rate_per_s: float
    delay_s: float
    noise_v: float
    noise_hold_s: float
    crest_v: Vector
    crest_from: float
    crest_step: float
    step_s: float
    patience_s: float


@compiled
def _looked_up(values, start, step, seen):
    """Straight between values at even allowances; beyond them that of the nearest."""
    n = len(values) - 1
    at = (seen - start) / step
    if at <= 0.0:
        return values[0]
    if at >= n:
        return values[n]
    i = int(at)
    return values[i] + (at - i) * (values[i + 1] - values[i])


@compiled
def _voltage(plan, seen):
    if len(plan.table_v) == 0:
        return plan.bias_v + plan.gain_v_per_um * seen
    return _looked_up(plan.table_v, plan.table_from, plan.table_step, seen)


@compiled
def _slope(plan, seen):
    n = len(plan.table_v) - 1
    if n < 0:
        return plan.gain_v_per_um
    at = (seen - plan.table_from) / plan.table_step
    if at < 0.0 or at >= n:
        return 0.0
    i = int(at)
    return (plan.table_v[i + 1] - plan.table_v[i]) / plan.table_step


@compiled
def _crest(plan, seen):
    """Peak of the ripple over the mean voltage."""
    return _looked_up(plan.crest_v, plan.crest_from, plan.crest_step, seen) if len(plan.crest_v) > 0 else 0.0


@compiled
def _weights(plan, h):
    """Of a step of length h: filter, ends of a straight input, noise with its ends in the filter, lag.

    With G the noise through the filter from 0 over the step, G = from_f·f(0) + to_f·f(h) + own·ξ exactly.
    """
    k, beta, sd = 1.0 / plan.time_constant_s, plan.rate_per_s, plan.sd_um
    z = k * h
    keep = math.exp(-z)
    late = 1.0 + math.expm1(-z) / z if z > 1e-5 else 0.5 * z
    early = -math.expm1(-z) - late
    slower = math.exp(-h / plan.lag_s) if plan.lag_s > 0.0 else 0.0
    if sd == 0.0:
        return keep, early, late, 1.0, 0.0, 0.0, 0.0, 0.0, slower
    rho = math.exp(-beta * h)
    spread2 = -math.expm1(-2.0 * beta * h)
    square, cross = 0.0, 0.0
    for j in range(len(_NODES)):
        u = 0.5 * h * (1.0 + _NODES[j])
        w = 0.5 * h * _WEIGHTS[j]
        g = _through(k, beta, u)
        square += w * g * g
        cross += w * g * math.exp(-beta * u)
    to_f = 2.0 * beta * cross / spread2
    own2 = 2.0 * beta * square - to_f * to_f * spread2
    from_f = _through(k, beta, h) - to_f * rho
    return (
        keep, early, late, rho, sd * math.sqrt(spread2), from_f - early, to_f - late, sd * math.sqrt(max(own2, 0.0)),
        slower,
    )  # fmt: skip


@compiled
def _through(k, beta, u):
    """exp(−β·τ) through the filter of rate k, from 0, at time u."""
    z = abs(k - beta) * u
    ratio = -math.expm1(-z) / z if z > 1e-9 else 1.0
    return k * u * math.exp(-min(k, beta) * u) * ratio


@compiled
def _swung(plan, turn, t):
    """What run-out adds at a time."""
    return plan.runout_um * math.sin(2 * math.pi * (turn + plan.per_s * t)) if plan.runout_um != 0.0 else 0.0


@compiled
def _fallen(plan, x, r, a, h, slower):
    """Allowance and removal after h at the rate a."""
    if plan.lag_s > 0.0:
        return x - a * h - (r - a) * plan.lag_s * (1.0 - slower), a + (r - a) * slower
    return x - a * h, a


@compiled
def _cubic(u0, u1, d0, d1, s):
    """The cubic with values u and rates d (per step) at both ends, at 0 ≤ s ≤ 1."""
    r = 1.0 - s
    return u0 * (1.0 + 2.0 * s) * r * r + d0 * s * r * r + u1 * s * s * (3.0 - 2.0 * s) - d1 * s * s * r


@compiled
def _cubic_rate(u0, u1, d0, d1, s):
    p, q = 2.0 * (u0 - u1) + d0 + d1, 3.0 * (u1 - u0) - 2.0 * d0 - d1
    return (3.0 * p * s + 2.0 * q) * s + d0


@compiled
def _crossing(u0, u1, d0, d1):
    """Where within a step the voltage, u below its threshold at the start, first reaches it; −1: nowhere."""
    high = 1.0
    if u1 < 0.0:
        if d0 <= 0.0 or d1 >= 0.0 or (3.0 * u0 + d0 < 0.0 and 3.0 * u1 - d1 < 0.0):
            return -1.0
        # its highest place, where the rate 3·p·s² + 2·q·s + d0 changes from rising to falling
        p, q = 2.0 * (u0 - u1) + d0 + d1, 3.0 * (u1 - u0) - 2.0 * d0 - d1
        high = -d0 / (q - math.sqrt(max(q * q - 3.0 * p * d0, 0.0)))
        if not 0.0 < high < 1.0 or _cubic(u0, u1, d0, d1, high) < 0.0:
            return -1.0
    low = 0.0
    for _ in range(48):
        middle = 0.5 * (low + high)
        if _cubic(u0, u1, d0, d1, middle) < 0.0:
            low = middle
        else:
            high = middle
    return high


@compiled
def _first_crossing(plan, course, extra, redraw, to_redraw):
    """Where within a step the voltage first reaches its threshold, or −1; the noise of the relay at its end.

    `course` has values and rates per step of the voltage without that noise, over its threshold, at both ends; a value
    of the noise lasts until `redraw`, both counted in steps.
    """
    u0, u1, d0, d1 = course
    if redraw >= 1.0:
        return _crossing(u0 + extra, u1 + extra, d0, d1), extra, redraw
    begin, low, slope = 0.0, u0, d0
    while True:
        end = min(redraw, 1.0)
        width = end - begin
        high, rate = _cubic(u0, u1, d0, d1, end), _cubic_rate(u0, u1, d0, d1, end)
        at = _crossing(low + extra, high + extra, slope * width, rate * width)
        if at >= 0.0:
            return begin + at * width, extra, redraw
        if redraw >= 1.0:
            return -1.0, extra, redraw
        extra = plan.noise_v * np.random.standard_normal()
        redraw += to_redraw
        begin, low, slope = end, high, rate
        if low + extra >= 0.0:
            return begin, extra, redraw


@compiled
def _part(plan, number, seed, ends, record, period_s):
    """Grinds one part; fills the ends of its stages [s] and the record; returns size, duration and its state."""
    np.random.seed(seed)
    scale = max(1.0 + plan.feed_sd * np.random.standard_normal(), LEAST_FEED)
    x = plan.allowance_um + plan.allowance_sd_um * np.random.standard_normal()
    turn = np.random.random()
    f = plan.sd_um * np.random.standard_normal()
    passed = 1.0 / (1.0 + plan.rate_per_s * plan.time_constant_s)
    smoothed = passed * f + plan.sd_um * math.sqrt(passed - passed * passed) * np.random.standard_normal()
    extra, redraw = 0.0, math.inf
    if plan.noise_v > 0.0:
        extra, redraw = plan.noise_v * np.random.standard_normal(), plan.noise_hold_s * np.random.random()
    since = number % plan.dress_every if plan.dress_every > 0 else number
    removed = scale / (1.0 + plan.wheel_wear * (1.0 + plan.wear_growth_per_part) ** since)
    worn = plan.probe_wear_um_per_part * number
    met = x - worn
    y = _voltage(plan, met) + _slope(plan, met) * smoothed
    if plan.grooves > 0:
        # deep grooves leave the range of the gauge: a mean of voltages, not the voltage of a mean
        deep = _voltage(plan, met - plan.groove_depth_um) + _slope(plan, met - plan.groove_depth_um) * smoothed
        y += plan.groove_share * (deep - y)
    # next edge of a groove
    inside, edge, pitch = False, math.inf, math.inf
    if plan.grooves > 0:
        pitch = 1.0 / (plan.grooves * plan.per_s)
        within = plan.grooves * turn - math.floor(plan.grooves * turn)
        inside = within < plan.groove_share
        edge = ((plan.groove_share if inside else 1.0) - within) * pitch
    stages = len(plan.feed)
    stage, a, r = 0, plan.feed[0] * removed, 0.0
    begun, limit = 0.0, 2.0 * max(x - plan.limit_um[0], 0.0) / a + plan.patience_s
    waiting, switch, state = False, math.inf, STOPPED
    size, duration = x, 0.0
    h = plan.step_s
    whole = _weights(plan, h)
    rows, row = len(record), 0
    done, t = 0, 0.0
    swung = _swung(plan, turn, t)
    while True:
        # events that are due
        if edge <= t:
            inside = not inside
            edge += (plan.groove_share if inside else 1.0 - plan.groove_share) * pitch
            continue
        groove = plan.groove_depth_um if inside else 0.0
        still = x - worn + swung - groove
        if stage < stages and not waiting:
            if redraw <= t:
                extra = plan.noise_v * np.random.standard_normal()
                redraw += plan.noise_hold_s * (math.floor((t - redraw) / plan.noise_hold_s) + 1.0)
            if plan.sign * (y + extra - plan.threshold[stage]) + _crest(plan, still) >= 0.0:
                if t == begun:
                    state = AT_ONCE
                waiting, switch = True, t + plan.delay_s
            elif t - begun > limit:
                while row < rows:
                    _put(record[row], x, still + f, y, plan.feed[stage] * scale, stage)
                    row += 1
                return x, t, NEVER
        if switch <= t:
            ends[stage] = t
            stage, begun, waiting, switch = stage + 1, t, False, math.inf
            if stage == stages:
                size, duration, a = x - plan.lag_s * r if plan.lag_s > 0.0 else x, t, 0.0
            else:
                a = plan.feed[stage] * removed
                limit = 2.0 * max(x - plan.limit_um[stage], 0.0) / a + plan.patience_s
            continue
        if stage == stages and row >= rows:
            return size, duration, state
        end = (done + 1) * h
        if end - t < 1e-6 * h:
            done, end = done + 1, (done + 2) * h
        to = min(end, edge, switch)
        hs = to - t
        weights = whole if hs == h or abs(hs - h) < 1e-6 * h else _weights(plan, hs)
        keep, early, late, rho, spread, from_f, to_f, own, slower = weights
        seen = still + f
        v0, slope = _voltage(plan, seen), _slope(plan, seen)
        f1 = f
        bridge = 0.0
        if plan.sd_um > 0.0:
            f1 = rho * f + spread * np.random.standard_normal()
            bridge = slope * (from_f * f + to_f * f1 + own * np.random.standard_normal())
        x1, r1 = _fallen(plan, x, r, a, hs, slower)
        swung = _swung(plan, turn, to)
        besides = f1 - worn + swung - groove
        v1 = _voltage(plan, x1 + besides)
        y1 = keep * y + early * v0 + late * v1 + bridge
        # until where the feed of the beginning acts, and what then is left
        fed, x_fed, r_fed, before, a_before = to, x1, r1, stage, a
        if stage < stages and not waiting:
            c0, c1 = _crest(plan, still), _crest(plan, x1 + besides - f1)
            u0 = plan.sign * (y - plan.threshold[stage]) + c0
            u1 = plan.sign * (y1 - plan.threshold[stage]) + c1
            d0 = plan.sign * (v0 - y) * hs / plan.time_constant_s + c1 - c0
            d1 = plan.sign * (v1 - y1) * hs / plan.time_constant_s + c1 - c0
            found = _first_crossing(
                plan, (u0, u1, d0, d1), plan.sign * extra, (redraw - t) / hs, plan.noise_hold_s / hs
            )
            at, extra = found[0], plan.sign * found[1]
            redraw = t + found[2] * hs
            if at >= 0.0:
                waiting, switch = True, t + at * hs + plan.delay_s
                if switch < to:
                    slower = math.exp((t - switch) / plan.lag_s) if plan.lag_s > 0.0 else 0.0
                    fed = switch
                    x_fed, r_fed = _fallen(plan, x, r, a, switch - t, slower)
                    ends[stage] = switch
                    stage, begun, waiting = stage + 1, to, False
                    if stage == stages:
                        size = x_fed - plan.lag_s * r_fed if plan.lag_s > 0.0 else x_fed
                        duration, a = switch, 0.0
                    else:
                        a = plan.feed[stage] * removed
                        limit = 2.0 * max(x_fed - plan.limit_um[stage], 0.0) / a + plan.patience_s
                    slower = math.exp((switch - to) / plan.lag_s) if plan.lag_s > 0.0 else 0.0
                    x1, r1 = _fallen(plan, x_fed, r_fed, a, to - switch, slower)
                    switch = math.inf
                    y1 += late * (_voltage(plan, x1 + besides) - v1)
                    v1 = _voltage(plan, x1 + besides)
        while row < rows and row * period_s < to:
            now = row * period_s
            s = min(max((now - t) / hs, 0.0), 1.0)
            level = _cubic(y, y1, (v0 - y) * hs / plan.time_constant_s, (v1 - y1) * hs / plan.time_constant_s, s)
            if now < fed:
                left = math.exp((t - now) / plan.lag_s) if plan.lag_s > 0.0 else 0.0
                at_x, _ = _fallen(plan, x, r, a_before, max(now - t, 0.0), left)
                acts = before
            else:
                left = math.exp((fed - now) / plan.lag_s) if plan.lag_s > 0.0 else 0.0
                at_x, _ = _fallen(plan, x_fed, r_fed, a, now - fed, left)
                acts = stage
            feed = plan.feed[acts] * scale if acts < stages else 0.0
            shown = at_x - worn + _swung(plan, turn, now) - groove + f + s * (f1 - f)
            _put(record[row], at_x, shown, level, feed, acts)
            row += 1
        x, r, f, y, t = x1, r1, f1, y1, to
        if to == end:
            done += 1


@compiled
def _put(row, allowance, seen, voltage, feed, stage):
    row[ALLOWANCE], row[SEEN], row[VOLTAGE], row[FEED], row[STAGE] = allowance, seen, voltage, feed, stage


@njit(cache=True, nogil=True, error_model="numpy")
def grind(plan, numbers, seeds, size, duration, ends, state, record, period_s):
    """Grinds the parts of these numbers; `record` has a row every `period_s` for the first of them, or none."""
    for k in range(len(numbers)):
        size[k], duration[k], state[k] = _part(plan, numbers[k], seeds[k], ends[k], record, period_s)
