"""What a control asks of the actuator (compiled): the reference between its samples, the cascade, its limits.

The law is that of servo.py. A continuous control that is limited follows its modes, which _modes.py decides.
"""

# mypy: disable-error-code="no-untyped-def, untyped-decorator"
from __future__ import annotations

from numba import njit

from selector.physics.drive.kernel._packed import (
    ACCELERATION,
    ACCELERATION_AHEAD,
    ALSO,
    ASKED,
    COMMAND_LIMIT,
    COMMAND_MODE,
    ERROR,
    INTEGRAL,
    INTEGRAL_GAIN,
    LIMITS,
    PERIOD,
    POSITION,
    POSITION_GAIN,
    SPEED,
    SPEED_AHEAD,
    SPEED_LIMIT,
    SPEED_MODE,
    TRAVEL,
    VELOCITY_GAIN,
    WANTED,
)

# modes of the command: its integral moves on; it stands, the command being beyond ±1; it follows the limit ±2
FREE, BEYOND, ALONG = 0, 1, 2

# not kept on disk one by one: what is kept would not know that a file it was compiled from has changed
compiled = njit(nogil=True, error_model="numpy")


@compiled
def reference_at(s, i, p, ref):
    """Position, speed, acceleration at the share s of period i: cubic Hermite, cubic Hermite, straight."""
    if s == 0.0:
        return ref[i, POSITION], ref[i, SPEED], ref[i, ACCELERATION]
    h00, h10 = (1.0 + 2.0 * s) * (1.0 - s) ** 2, s * (1.0 - s) ** 2 * p[PERIOD]
    h01, h11 = s * s * (3.0 - 2.0 * s), s * s * (s - 1.0) * p[PERIOD]
    position = h00 * ref[i, POSITION] + h10 * ref[i, SPEED] + h01 * ref[i + 1, POSITION] + h11 * ref[i + 1, SPEED]
    speed = h00 * ref[i, SPEED] + h10 * ref[i, ACCELERATION] + h01 * ref[i + 1, SPEED] + h11 * ref[i + 1, ACCELERATION]
    return position, speed, ref[i, ACCELERATION] + s * (ref[i + 1, ACCELERATION] - ref[i, ACCELERATION])


@compiled
def _reference_rates(s, i, p, ref):
    """How fast the three of `reference_at` change."""
    d0, d1 = 6.0 * s * (s - 1.0) / p[PERIOD], (1.0 - s) * (1.0 - 3.0 * s)
    d2 = s * (3.0 * s - 2.0)
    position = d0 * (ref[i, POSITION] - ref[i + 1, POSITION]) + d1 * ref[i, SPEED] + d2 * ref[i + 1, SPEED]
    speed = d0 * (ref[i, SPEED] - ref[i + 1, SPEED]) + d1 * ref[i, ACCELERATION] + d2 * ref[i + 1, ACCELERATION]
    return position, speed, (ref[i + 1, ACCELERATION] - ref[i, ACCELERATION]) / p[PERIOD]


@compiled
def sampled_command(s, i, measured, speed, integral, noise, p, ref):
    """Command after its limit, and the rate of the integral of the speed error."""
    position, ahead, acceleration = reference_at(s, i, p, ref)
    wanted = p[POSITION_GAIN] * (position - measured) / p[TRAVEL] + p[SPEED_AHEAD] * ahead / p[TRAVEL]
    wanted = min(max(wanted, -p[SPEED_LIMIT]), p[SPEED_LIMIT])
    error = wanted - speed
    command = p[VELOCITY_GAIN] * error + p[INTEGRAL_GAIN] * integral + p[ACCELERATION_AHEAD] * acceleration + noise
    if command > p[COMMAND_LIMIT]:
        return p[COMMAND_LIMIT], 0.0
    if command < -p[COMMAND_LIMIT]:
        return -p[COMMAND_LIMIT], 0.0
    return command, error


@compiled
def continuous_command(w, row, out, s, i, measured, speed, p, o, ref):
    """Command at the state in `row`; the rate of the integral goes into row `out`, the rest into ALSO."""
    position, ahead, acceleration = reference_at(s, i, p, ref)
    wanted = p[POSITION_GAIN] * (position - measured) / p[TRAVEL] + p[SPEED_AHEAD] * ahead / p[TRAVEL]
    feed = p[ACCELERATION_AHEAD] * acceleration
    if o[LIMITS]:
        return _limited_command(w, row, out, wanted, speed, feed, p, o)
    error = wanted - speed
    w[out, INTEGRAL] = error
    return p[VELOCITY_GAIN] * error + p[INTEGRAL_GAIN] * w[row, INTEGRAL] + feed


@compiled
def _limited_command(w, row, out, wanted, speed, feed, p, o):
    """The same within the modes of the limits, where everything is smooth: what is free goes on beyond its limit.

    An integral that follows the limit is no state: it is what keeps the command there.
    """
    w[ALSO, WANTED] = wanted
    if o[SPEED_MODE] != 0:
        wanted = o[SPEED_MODE] * p[SPEED_LIMIT]
    error = wanted - speed
    mode = o[COMMAND_MODE]
    if abs(mode) == ALONG:
        w[row, INTEGRAL] = (limited(mode, p) - p[VELOCITY_GAIN] * error - feed) / p[INTEGRAL_GAIN]
    asked = p[VELOCITY_GAIN] * error + p[INTEGRAL_GAIN] * w[row, INTEGRAL] + feed
    w[ALSO, ASKED], w[ALSO, ERROR] = asked, error
    w[out, INTEGRAL] = error if mode == FREE else 0.0
    return asked if mode == FREE else limited(mode, p)


@compiled
def limited(mode, p):
    """The limit of the command on the side of this mode."""
    return p[COMMAND_LIMIT] if mode > 0 else -p[COMMAND_LIMIT]


@compiled
def asked_rate(s, i, measured_rate, acceleration, p, o, ref):
    """How fast the command before its limit would change if its integral stood still."""
    position, ahead, jerk = _reference_rates(s, i, p, ref)
    wanted = 0.0
    if o[SPEED_MODE] == 0:
        wanted = p[POSITION_GAIN] * (position - measured_rate) / p[TRAVEL] + p[SPEED_AHEAD] * ahead / p[TRAVEL]
    return p[VELOCITY_GAIN] * (wanted - acceleration) + p[ACCELERATION_AHEAD] * jerk
