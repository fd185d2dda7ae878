"""How an axis gets from one instant to the next (compiled): steps of order 4, cut where it sticks, slips or touches.

Each mode (slides or sticks, touches or not, segment of a table, limits) has a measure of how well it fits, which falls
through zero where the next one begins; what happens there stands in docs/explanation/drive-simulation.md.
"""

# mypy: disable-error-code="no-untyped-def, untyped-decorator, no-untyped-call"

import math

from selector.physics.drive.kernel._equations import ALONG, BEYOND, FREE, bristle_rate, compiled, derivative
from selector.physics.drive.kernel._packed import *

# below this speed the bristles do not feel which way it goes: |v|·dt is below the rounding of their deflection
STILL = 1e-13
# a screw that would be back at its corner after less than this share of a step stays there
HOP = 1.0 / 16.0
# how near a command is at its limit, as a share of what it is the sum of; rounding of that sum is 1e-15
AT_LIMIT = 1e-12


@compiled
def validity(w, row, p, o):
    """Positive as long as the modes fit the state in `row`, whose rates were the last to be asked for."""
    least = math.inf
    v = w[row, V]
    if o[DRY]:
        if o[GUIDE] == 0:
            balance = w[ALSO, GUIDE_BALANCE]
            least = min(p[COULOMB_UP] + p[EXCESS_UP] - balance, p[COULOMB_DOWN] + p[EXCESS_DOWN] + balance)
        else:
            least = o[GUIDE] * v
    elif o[LUGRE] and (abs(v) > STILL or abs(w[Y, V]) > STILL):
        least = o[GUIDE] * v
    if o[AT_CORNER]:
        least = min(least, _held(w, p, o))
    elif o[SCREW_DRY]:
        if o[SCREW] == 0:
            least = min(least, w[ALSO, SCREW_HOLDS] - abs(w[ALSO, SCREW_BALANCE]))
        else:
            least = min(least, o[SCREW] * w[row, WL])
    if o[BACKLASH]:
        if o[CONTACT] > 0:
            least = min(least, w[ALSO, UPPER])
        elif o[CONTACT] < 0:
            least = min(least, w[ALSO, LOWER])
        else:
            least = min(least, -max(w[ALSO, UPPER], w[ALSO, LOWER]))
    if o[CORNERS] and not o[AT_CORNER]:
        below, above = _room(w, row, p, o)
        least = min(least, min(below, above))
    if o[LIMITS]:
        least = min(least, _within_limits(w, p, o))
    return least


@compiled
def _room(w, row, p, o):
    """Travel to the corners at both ends of the segment of the pitch table."""
    travel = p[TRAVEL] * w[row, X if o[RIGID] else QL]
    at = o[PITCH_AT] + o[SEGMENT]
    below = travel - p[at - 1] if o[SEGMENT] > 0 else math.inf
    return below, (p[at] - travel if o[SEGMENT] < o[PITCH_POINTS] else math.inf)


@compiled
def _pushes(w, corner, p, o):
    """What would turn the screw down from this corner, where that is negative, and up, where positive."""
    slopes = o[PITCH_AT] + 2 * o[PITCH_POINTS] + corner
    bend = (p[slopes + 1] - p[slopes]) * p[TRAVEL] * w[ALSO, AXIAL_FORCE]
    balance = w[ALSO, SCREW_BALANCE]
    return (balance, balance - bend) if o[SEGMENT] == corner else (balance + bend, balance)


@compiled
def _held(w, p, o):
    """Positive as long as the screw stands at the corner above its segment."""
    down, up = _pushes(w, o[SEGMENT], p, o)
    return min(w[ALSO, SCREW_HOLDS] + down, w[ALSO, SCREW_HOLDS] - up)


@compiled
def _within_limits(w, p, o):
    """Positive as long as the modes of both limits fit."""
    mode = o[SPEED_MODE]
    least = mode * w[ALSO, WANTED] - p[SPEED_LIMIT] if mode != 0 else p[SPEED_LIMIT] - abs(w[ALSO, WANTED])
    mode = o[COMMAND_MODE]
    if mode == FREE:
        return min(least, p[COMMAND_LIMIT] - abs(w[ALSO, ASKED]))
    if abs(mode) == BEYOND:
        return min(least, mode * w[ALSO, ASKED] - p[COMMAND_LIMIT])
    leaves, stays = _ways(w, sign(mode), p)
    return min(least, min(-leaves, stays))


@compiled
def _ways(w, side, p):
    """How fast the command before its limit leaves that limit while the integral stands, and while it moves on."""
    stands = side * w[ALSO, ASKED_RATE]
    return stands, stands + side * p[INTEGRAL_GAIN] * w[ALSO, ERROR]


@compiled
def settle(w, s, i, u, p, o, ref):
    """Modes that fit the state Y and the inputs of this instant, and its rates K1."""
    if o[DRY] and o[GUIDE] * w[Y, V] <= 0.0:
        w[Y, V] = 0.0
    if o[SCREW_DRY] and o[SCREW] * w[Y, WL] <= 0.0:
        w[Y, WL] = 0.0
    corner = _corner(w, p, o) if o[CORNERS] else -1
    # limits decide the command, contact the forces, these decide what slips, and that where the command goes
    for _ in range(8):
        # for numbers that are written out it would be compiled once more
        derivative(w, int(Y), int(K1), s, i, u, p, o, ref)
        if not _changed_modes(w, corner, p, o):
            return


@compiled
def _corner(w, p, o):
    """The corner of the pitch table at which the screw stands or which it has just passed, or −1."""
    if o[AT_CORNER]:
        return o[SEGMENT]
    travel, speed = p[TRAVEL] * w[Y, X if o[RIGID] else QL], w[Y, V if o[RIGID] else WL]
    before, at, count, first = o[SEGMENT], o[SEGMENT], o[PITCH_POINTS], o[PITCH_AT]
    while at < count and (travel > p[first + at] or (travel == p[first + at] and speed > 0.0)):
        at += 1
    while at > 0 and (travel < p[first + at - 1] or (travel == p[first + at - 1] and speed < 0.0)):
        at -= 1
    o[SEGMENT] = at
    if at != before:
        return at if at < before else at - 1
    return at - 1 if at > 0 and travel == p[first + at - 1] else -1


@compiled
def _changed_modes(w, corner, p, o):
    """Whether a mode does not fit the state Y and its forces, and is another one now."""
    if o[LIMITS] and changed_limits(w, p, o):
        return True
    if o[BACKLASH]:
        contact = 1 if w[ALSO, UPPER] > 0.0 else (-1 if w[ALSO, LOWER] > 0.0 else 0)
        if contact != o[CONTACT]:
            o[CONTACT] = contact
            return True
    if corner >= 0 and not o[RIGID] and _changed_corner(w, corner, p, o):
        return True
    guide, screw = o[GUIDE], o[SCREW]
    if o[DRY] and w[Y, V] == 0.0:
        balance = w[ALSO, GUIDE_BALANCE]
        guide = 0
        if balance > p[COULOMB_UP] + p[EXCESS_UP]:
            guide = 1
        elif -balance > p[COULOMB_DOWN] + p[EXCESS_DOWN]:
            guide = -1
    elif o[LUGRE]:
        guide = -1 if (w[Y, V] if w[Y, V] != 0.0 else w[K1, V]) < 0.0 else 1
    if o[SCREW_DRY] and w[Y, WL] == 0.0 and not o[AT_CORNER]:
        balance = w[ALSO, SCREW_BALANCE]
        screw = 1 if balance > w[ALSO, SCREW_HOLDS] else (-1 if balance < -w[ALSO, SCREW_HOLDS] else 0)
    changed = guide != o[GUIDE] or screw != o[SCREW]
    o[GUIDE], o[SCREW] = guide, screw
    return changed


@compiled
def _changed_corner(w, corner, p, o):
    """Whether the screw stands at this corner from now on, or no longer.

    It does where both sides push it back. So does one that hops across the corner in less than HOP of a step: it would
    do so ever faster.
    """
    down, up = _pushes(w, corner, p, o)
    weaker = min(w[ALSO, SCREW_HOLDS] + down, w[ALSO, SCREW_HOLDS] - up)
    stands = weaker >= 0.0 and 2.0 * abs(w[Y, WL]) * p[SCREW_INERTIA] <= HOP * p[STEP] * weaker
    if o[AT_CORNER] == stands:
        return False
    o[AT_CORNER] = stands
    if stands:
        w[Y, QL], w[Y, WL] = p[o[PITCH_AT] + corner] / p[TRAVEL], 0.0
        o[SEGMENT], o[SCREW] = corner, 0
    elif up > w[ALSO, SCREW_HOLDS]:
        o[SEGMENT] = corner + 1
    return True


@compiled
def changed_limits(w, p, o):
    """Whether the modes of the limits of speed and command are others now."""
    wanted, asked = w[ALSO, WANTED], w[ALSO, ASKED]
    speed = sign(wanted) if abs(wanted) > p[SPEED_LIMIT] else 0
    if speed != o[SPEED_MODE]:
        o[SPEED_MODE] = speed
        return True
    mode, side = FREE, sign(asked)
    parts = p[COMMAND_LIMIT] + p[VELOCITY_GAIN] * (abs(wanted) + abs(w[ALSO, ERROR]))
    if p[INTEGRAL_GAIN] > 0.0 and math.inf > AT_LIMIT * parts >= abs(abs(asked) - p[COMMAND_LIMIT]):
        # where both ways lead to the limit it stays there: what a sampled control does by turns
        leaves, stays = _ways(w, side, p)
        if stays > 0.0:
            mode = side * (ALONG if leaves < 0.0 else BEYOND)
    elif abs(asked) > p[COMMAND_LIMIT]:
        mode = side * BEYOND
    changed = mode != o[COMMAND_MODE]
    o[COMMAND_MODE] = mode
    return changed


@compiled
def lowest(w, h, p, o):
    """Time within a step at which a mode that fits at both ends may not have fitted between them, or 0."""
    at = 0.0
    if o[DRY] and o[GUIDE] != 0:
        at = _dip(o[GUIDE] * w[Y, V], o[GUIDE] * w[NEW, V], o[GUIDE] * w[K1, V], o[GUIDE] * w[KEND, V], h)
    if at == 0.0 and o[SCREW_DRY] and o[SCREW] != 0:
        at = _dip(o[SCREW] * w[Y, WL], o[SCREW] * w[NEW, WL], o[SCREW] * w[K1, WL], o[SCREW] * w[KEND, WL], h)
    if at == 0.0 and o[CORNERS] and not o[AT_CORNER]:
        speed = V if o[RIGID] else WL
        fall, rise = p[TRAVEL] * w[Y, speed], p[TRAVEL] * w[NEW, speed]
        if fall < 0.0 < rise and o[SEGMENT] > 0:
            at = _dip(_room(w, Y, p, o)[0], _room(w, NEW, p, o)[0], fall, rise, h)
        elif rise < 0.0 < fall and o[SEGMENT] < o[PITCH_POINTS]:
            at = _dip(_room(w, Y, p, o)[1], _room(w, NEW, p, o)[1], -fall, -rise, h)
    return at


@compiled
def _dip(before, after, fall, rise, h):
    """Time within a step at which what is positive at both ends may have been lowest, or 0."""
    # a course that opens upwards stays above its tangent
    if before + h * fall >= 0.0 or rise <= 0.0:
        return 0.0
    # the lowest point of the cubic through both ends: c1 + 2·c2·s + 3·c3·s² = 0
    c1, c2, c3 = h * fall, 3.0 * (after - before) - h * (2.0 * fall + rise), 2.0 * (before - after) + h * (fall + rise)
    root = c2 * c2 - 3.0 * c1 * c3
    if root <= 0.0:
        return 0.0
    at = -c1 / (c2 + math.sqrt(root)) if c2 + math.sqrt(root) > 0.0 else 0.0
    return at * h if 0.0 < at < 1.0 else 0.0


@compiled
def sign(value):
    """1, 0 or −1."""
    return 1 if value > 0.0 else (-1 if value < 0.0 else 0)


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
        w[NEW, WL] = _stopped(w[Y, WL], w[ALSO, SCREW_BALANCE], p[SCREW_INERTIA], w[ALSO, SCREW_HOLDS], h)
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
