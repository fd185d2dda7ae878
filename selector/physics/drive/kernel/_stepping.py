"""How an axis gets from one instant to the next (compiled): steps of order 4, cut where it sticks, slips or touches.

A step whose end contradicts its modes is repeated, shorter, until it ends just past the first contradiction; there the
modes are decided anew. After MOST_EVENTS of them within one step the rest of it is taken by `_coarse`, of order 1.
"""

# mypy: disable-error-code="no-untyped-def, untyped-decorator, no-untyped-call"
from __future__ import annotations

import math

from selector.physics.drive.kernel._control import compiled
from selector.physics.drive.kernel._equations import bristle_rate, derivative
from selector.physics.drive.kernel._modes import lowest, settle, sign, validity
from selector.physics.drive.kernel._packed import (
    ALSO,
    BRISTLE,
    COULOMB_DOWN,
    COULOMB_UP,
    DRY,
    EXCESS_DOWN,
    EXCESS_UP,
    GUIDE,
    GUIDE_BALANCE,
    INTEGRAL,
    K1,
    K2,
    K3,
    K4,
    KEND,
    LUGRE,
    MASS,
    MOST_EVENTS,
    NEW,
    PERIOD,
    QL,
    QM,
    SCREW,
    SCREW_BALANCE,
    SCREW_COULOMB,
    SCREW_DRY,
    SCREW_INERTIA,
    STAGE_A,
    STAGE_B,
    STAGE_C,
    WL,
    WM,
    V,
    X,
    Y,
    Z,
)

STATES = 8


@compiled
def _phi(x):
    """exp(x) and the weights φ1, φ2, φ3 of exponential integrators, for x ≤ 0."""
    if x < -1.0:
        e = math.exp(x)
        one = (e - 1.0) / x
        two = (one - 1.0) / x
        return e, one, two, (two - 0.5) / x
    # Taylor from φ3 on: 16 terms reach rounding at |x| = 1
    three, term = 0.0, 1.0 / 6.0
    for k in range(16):
        three += term
        term *= x / (k + 4.0)
    two = 0.5 + x * three
    one = 1.0 + x * two
    return 1.0 + x * one, one, two, three


@compiled
def _step(w, h, s, i, u, p, o, ref):
    """NEW and KEND from Y and its rates K1 by one step of length h; returns how valid the modes are there.

    Runge–Kutta of order 4, for the bristles its exponential form (Cox, Matthews 2002, J. Comput. Phys. 176, 430–455).
    """
    half, ds = 0.5 * h, h / p[PERIOD]
    bristles = o[LUGRE] == 1
    stiff, e_half, weight, end, b1, b2, b4 = 0.0, 1.0, half, 1.0, 0.0, 0.0, 0.0
    if bristles:
        # the faster of both ends of the step: too much of it in the exponential is stable, too little is not
        stiff = bristle_rate(o[GUIDE], w[Y, V], p)
        stiff = max(stiff, bristle_rate(o[GUIDE], w[Y, V] + h * w[K1, V], p), 0.0)
        e_half, one, two, three = _phi(-stiff * half)
        weight = half * one
        end, one, two, three = _phi(-stiff * h)
        b1, b2, b4 = h * (one - 3.0 * two + 4.0 * three), h * (2.0 * two - 4.0 * three), h * (4.0 * three - two)
    for stage in range(4):
        row = STAGE_A + stage
        if stage < 3:
            part = h if stage == 2 else half
            for k in range(STATES):
                w[row, k] = w[Y, k] + part * w[K1 + stage, k]
        else:
            for k in range(STATES):
                w[row, k] = w[Y, k] + h / 6.0 * (w[K1, k] + 2.0 * (w[K2, k] + w[K3, k]) + w[K4, k])
        if bristles:
            na, nb = w[K1, Z] + stiff * w[Y, Z], w[K2, Z] + stiff * w[STAGE_A, Z]
            nc, nd = w[K3, Z] + stiff * w[STAGE_B, Z], w[K4, Z] + stiff * w[STAGE_C, Z]
            if stage < 2:
                w[row, Z] = e_half * w[Y, Z] + weight * (na if stage == 0 else nb)
            elif stage == 2:
                w[row, Z] = e_half * w[STAGE_A, Z] + weight * (2.0 * nc - na)
            else:
                w[row, Z] = end * w[Y, Z] + b1 * na + b2 * (nb + nc) + b4 * nd
                _hold_bristles(w, row, p)
        derivative(w, row, K2 + stage, s + (0.5 * ds if stage < 2 else ds), i, u, p, o, ref)
    return validity(w, NEW, p, o)


@compiled
def _hold_bristles(w, row, p):
    """|z| ≤ the larger breakaway / σ0, which the equation keeps by itself."""
    most = max(max(p[COULOMB_UP], p[COULOMB_UP] + p[EXCESS_UP]), max(p[COULOMB_DOWN], p[COULOMB_DOWN] + p[EXCESS_DOWN]))
    w[row, Z] = min(max(w[row, Z], -most / p[BRISTLE]), most / p[BRISTLE])


@compiled
def _event(w, high, at_high, s, i, u, p, o, ref):
    """Shortest step known to end past the first contradiction (bracketed; Illinois false position): its length."""
    low, at_low, side = 0.0, 0.0, 0
    least = 1e-13 * high
    for count in range(100):
        if high - low <= 2.0 * least:
            break
        middle = 0.5 * (low + high)
        # what it is at 0, where the last event was, says nothing; what does not close in 50 steps is halved
        if at_low > 0.0 and count < 50:
            guess = (low * at_high - high * at_low) / (at_high - at_low)
            # never closer to an end than the accuracy asked for, so that the bracket closes from both sides
            middle = min(max(guess, low + least), high - least)
        found = _step(w, middle, s, i, u, p, o, ref)
        # exactly at its bound a mode still fits: it ends past it, so that settle() finds another one
        if found < 0.0:
            high, at_high = middle, found
            if side == -1:
                at_low *= 0.5
            side = -1
        else:
            low, at_low = middle, found
            if side == 1:
                at_high *= 0.5
            side = 1
    _step(w, high, s, i, u, p, o, ref)
    return high


@compiled
def advance(w, h, s, i, u, p, o, ref):
    """Y and K1 a time h further, through all events on the way."""
    left, length, looked = h, h, False
    events = 0
    while events < o[MOST_EVENTS]:
        fits = _step(w, length, s, i, u, p, o, ref)
        if fits < 0.0:
            length = _event(w, length, fits, s, i, u, p, o, ref)
            _take(w)
            events += 1
            s += length / p[PERIOD]
            left -= length
            settle(w, s, i, u, p, o, ref)
            if left <= 1e-13 * h:
                return
            length, looked = left, False
        elif looked and length < left:
            # nothing was wrong at the lowest point
            length = left
        else:
            at = 0.0 if looked else lowest(w, length, p, o)
            looked = True
            if at == 0.0:
                _take(w)
                return
            length = at
    _coarse(w, left, s, i, u, p, o, ref)


@compiled
def _take(w):
    for k in range(STATES):
        w[Y, k], w[K1, k] = w[NEW, k], w[KEND, k]


@compiled
def _stopped(speed, balance, inertia, most, h):
    free = speed + h * balance / inertia
    stop = h * most / inertia
    return 0.0 if abs(free) <= stop else free - math.copysign(stop, free)


@compiled
def _coarse(w, h, s, i, u, p, o, ref):
    """Y and K1 a time h further in one step of order 1 (semi-implicit Euler) without events.

    Friction is an impulse that stops what it can stop.
    """
    for k in (WM, WL, V, INTEGRAL):
        w[NEW, k] = w[Y, k] + h * w[K1, k]
    if o[DRY]:
        most = p[COULOMB_UP] + p[EXCESS_UP]
        if w[Y, V] < 0.0 or (w[Y, V] == 0.0 and w[ALSO, GUIDE_BALANCE] < 0.0):
            most = p[COULOMB_DOWN] + p[EXCESS_DOWN]
        w[NEW, V] = _stopped(w[Y, V], w[ALSO, GUIDE_BALANCE], p[MASS], most, h)
    if o[SCREW_DRY]:
        w[NEW, WL] = _stopped(w[Y, WL], w[ALSO, SCREW_BALANCE], p[SCREW_INERTIA], p[SCREW_COULOMB], h)
    for position, speed in ((QM, WM), (QL, WL), (X, V)):
        w[NEW, position] = w[Y, position] + h * w[NEW, speed]
    w[NEW, Z] = w[Y, Z]
    if o[LUGRE]:
        whole, one, _, _ = _phi(-abs(bristle_rate(o[GUIDE], w[NEW, V], p)) * h)
        w[NEW, Z] = whole * w[Y, Z] + h * one * w[NEW, V]
        _hold_bristles(w, NEW, p)
    for k in range(STATES):
        w[Y, k] = w[NEW, k]
    o[GUIDE], o[SCREW] = sign(w[Y, V]), sign(w[Y, WL])
    settle(w, s + h / p[PERIOD], i, u, p, o, ref)
