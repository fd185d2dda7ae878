"""Which modes an axis is in (compiled): slides or sticks, touches or not, which segment of a table, within its limits.

Each mode has a measure of how well it fits, which falls through zero where the next one begins; where it does is looked
for by _stepping.py.
"""

# mypy: disable-error-code="no-untyped-def, untyped-decorator, no-untyped-call"
from __future__ import annotations

import math

from selector.physics.drive.kernel._control import ALONG, BEYOND, FREE, compiled
from selector.physics.drive.kernel._equations import derivative
from selector.physics.drive.kernel._packed import (
    ALSO,
    ASKED,
    ASKED_RATE,
    AT_CORNER,
    AXIAL_FORCE,
    BACKLASH,
    COMMAND_LIMIT,
    COMMAND_MODE,
    CONTACT,
    CORNERS,
    COULOMB_DOWN,
    COULOMB_UP,
    DRY,
    ERROR,
    EXCESS_DOWN,
    EXCESS_UP,
    GUIDE,
    GUIDE_BALANCE,
    INTEGRAL_GAIN,
    K1,
    KEND,
    LIMITS,
    LOWER,
    LUGRE,
    NEW,
    PITCH_AT,
    PITCH_POINTS,
    QL,
    RIGID,
    SCREW,
    SCREW_BALANCE,
    SCREW_COULOMB,
    SCREW_DRY,
    SCREW_INERTIA,
    SEGMENT,
    SPEED_LIMIT,
    SPEED_MODE,
    STEP,
    TRAVEL,
    UPPER,
    VELOCITY_GAIN,
    WANTED,
    WL,
    V,
    X,
    Y,
)

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
            least = min(least, p[SCREW_COULOMB] - abs(w[ALSO, SCREW_BALANCE]))
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
    return min(p[SCREW_COULOMB] + down, p[SCREW_COULOMB] - up)


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
        derivative(w, Y, K1, s, i, u, p, o, ref)
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
        screw = 1 if balance > p[SCREW_COULOMB] else (-1 if balance < -p[SCREW_COULOMB] else 0)
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
    weaker = min(p[SCREW_COULOMB] + down, p[SCREW_COULOMB] - up)
    stands = weaker >= 0.0 and 2.0 * abs(w[Y, WL]) * p[SCREW_INERTIA] <= HOP * p[STEP] * weaker
    if o[AT_CORNER] == stands:
        return False
    o[AT_CORNER] = stands
    if stands:
        w[Y, QL], w[Y, WL] = p[o[PITCH_AT] + corner] / p[TRAVEL], 0.0
        o[SEGMENT], o[SCREW] = corner, 0
    elif up > p[SCREW_COULOMB]:
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
