"""The equations of an axis for one instant (compiled): what control asks, what drives, deflects, slides, accelerates.

They are those of parts/axis.py. Modes (slip direction, contact of the backlash, segment of the
pitch table, limits) are given, so that everything here is smooth in the states; _stepping.py decides about them.
"""

# mypy: disable-error-code="no-untyped-def, untyped-decorator"

import math

from numba import njit

from selector.physics.drive.kernel._packed import *

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


@compiled
def pitch_error(q, p, o):
    """E(q) and its slope: the travel beyond R·q. Corners that are located bend nothing within their segment."""
    if o[PITCH] == 0:
        return 0.0, 0.0
    angle = p[PITCH_RATE] * q + p[PITCH_PHASE]
    error = p[PITCH_AMPLITUDE] * math.sin(angle) + p[PITCH_SLOPE] * p[TRAVEL] * q
    slope = p[PITCH_AMPLITUDE] * p[PITCH_RATE] * math.cos(angle) + p[PITCH_SLOPE] * p[TRAVEL]
    count = o[PITCH_POINTS]
    if count > 0:
        travel = p[TRAVEL] * q
        at = o[SEGMENT] if o[CORNERS] else segment(travel, p, o)
        rise, corner = p[o[PITCH_AT] + 2 * count + at], o[PITCH_AT] + max(at - 1, 0)
        error += p[corner + count] + rise * (travel - p[corner])
        slope += rise * p[TRAVEL]
    return error, slope


@compiled
def segment(travel, p, o):
    """How many corners of the table of the pitch error are not beyond this travel."""
    low, high = 0, o[PITCH_POINTS]
    while low < high:
        middle = (low + high) // 2
        if p[o[PITCH_AT] + middle] <= travel:
            low = middle + 1
        else:
            high = middle
    return low


@compiled
def shaft_compliance(x, p, o):
    """Deflection of the shaft per force at table position x [m/N], and its slope [1/N]."""
    free = min(max(p[ORIGIN] + x, 0.0), p[LENGTH])
    inside = 0.0 < p[ORIGIN] + x < p[LENGTH]
    if o[BOTH_ENDS]:
        slope = (p[LENGTH] - 2.0 * free) / (p[LENGTH] * p[SHAFT]) if inside else 0.0
        return free * (p[LENGTH] - free) / (p[LENGTH] * p[SHAFT]), slope
    return free / p[SHAFT], (1.0 / p[SHAFT] if inside else 0.0)


@compiled
def axial_spring(deflection, x, axial, p, o):
    """Force of the axial spring, and the force along x of its energy, which depends on where the nut is."""
    count = o[COMPLIANCE_POINTS]
    if count == 0:
        return axial * deflection, 0.0
    shaft, slope = shaft_compliance(x, p, o)
    low, high = o[COMPLIANCE_AT], o[COMPLIANCE_AT] + count - 1
    while high - low > 1:
        middle = (low + high) // 2
        if p[middle] * shaft + p[middle + count] <= deflection:
            low = middle
        else:
            high = middle
    at_low, at_high = p[low] * shaft + p[low + count], p[high] * shaft + p[high + count]
    force = p[low] + (deflection - at_low) * (p[high] - p[low]) / (at_high - at_low)
    return force, 0.5 * force * force * slope


@compiled
def sliding_friction(direction, speed, p):
    """Dry friction of the guide while it slides in this direction, without sign."""
    coulomb, excess = p[COULOMB_UP], p[EXCESS_UP]
    if direction < 0:
        coulomb, excess = p[COULOMB_DOWN], p[EXCESS_DOWN]
    if excess == 0.0:
        return coulomb
    ratio = max(direction * speed, 0.0) / p[STRIBECK_SPEED]
    if p[STRIBECK_EXPONENT] == 2.0:
        return coulomb + excess * math.exp(-ratio * ratio)
    return coulomb + excess * math.exp(-(ratio ** p[STRIBECK_EXPONENT]))


@compiled
def bristle_rate(direction, speed, p):
    """σ0·|v|/g(v) [1/s]; a direction without friction gets one of a billionth, so that the bristles let go at once."""
    least = 1e-9 * max(p[COULOMB_UP] + max(p[EXCESS_UP], 0.0), p[COULOMB_DOWN] + max(p[EXCESS_DOWN], 0.0))
    return p[BRISTLE] * direction * speed / max(sliding_friction(direction, speed, p), least)


@compiled
def actuator_force(command, q, p, o):
    """Torque or force on the motor: Kf·u with the ripple of its position."""
    force = p[ACTUATOR_GAIN] * command
    share, cogging = 1.0, 0.0
    for k in range(o[RIPPLES]):
        at = o[RIPPLE_AT] + 4 * k
        wave = math.sin(p[at] * p[RIPPLE_RATE] * q + p[at + 3])
        cogging += p[at + 1] * wave
        share += p[at + 2] * wave
    return force * share + cogging


@compiled
def derivative(w, row, out, s, i, u, p, o, ref):
    """Rates of the state in `row` into row `out`, at the share s of period i and the held command u; fills ALSO."""
    x, v = w[row, X], w[row, V]
    rigid = o[RIGID] == 1
    motor, motor_speed = (x, v) if rigid else (w[row, QM], w[row, WM])
    w[out, INTEGRAL] = 0.0
    measured, measured_rate = p[TRAVEL] * motor, p[TRAVEL] * motor_speed
    if o[CONTROL] == CONTINUOUS:
        if o[TABLE_FEEDBACK]:
            error, slope = pitch_error(x, p, o) if rigid else (0.0, 0.0)
            measured, measured_rate = x + error, (1.0 + slope) * v
        u = continuous_command(w, row, out, s, i, measured, motor_speed, p, o, ref)
    guide_damping = p[GUIDE_DAMPING]
    if o[VARYING_GUIDE]:
        guide_damping = ref[i, COURSE_GUIDE] + s * (ref[i + 1, COURSE_GUIDE] - ref[i, COURSE_GUIDE])
    if v < 0.0:
        guide_damping += p[MORE_DAMPING_DOWN]
    drive = actuator_force(u, motor, p, o)
    push = force = drive
    if not rigid:
        force, walk = _turning(w, row, out, s, i, drive, p, o, ref)
        push = force + walk
    balance = push + ref[i, FORCE] - p[OFFSET] - guide_damping * v
    friction = 0.0
    w[out, Z] = 0.0
    w[out, X] = v
    if o[DRY]:
        direction = o[GUIDE]
        friction = balance if direction == 0 else direction * sliding_friction(direction, v, p)
    elif o[LUGRE]:
        rate = v - bristle_rate(o[GUIDE], v, p) * w[row, Z]
        damping = p[BRISTLE_DAMPING]
        if p[FADING] > 0.0:
            damping *= math.exp(-((v / p[FADING]) ** 2))
        friction = p[BRISTLE] * w[row, Z] + damping * rate
        w[out, Z] = rate
    w[out, V] = (balance - friction) / p[MASS]
    w[ALSO, GUIDE_BALANCE], w[ALSO, AXIAL_FORCE] = balance, force
    w[ALSO, COMMAND], w[ALSO, DRIVE], w[ALSO, FRICTION] = u, drive, friction
    if o[LIMITS]:
        w[ALSO, ASKED_RATE] = asked_rate(s, i, measured_rate, w[out, V if rigid else WM], p, o, ref)


@compiled
def _turning(w, row, out, s, i, drive, p, o, ref):
    """Rates of motor and screw; returns the axial force, and that of the nut's walk along the strained shaft."""
    x, v, motor_speed, screw, screw_speed = w[row, X], w[row, V], w[row, WM], w[row, QL], w[row, WL]
    error, slope = pitch_error(screw, p, o)
    gear = p[TRAVEL] + slope
    deflection = p[TRAVEL] * screw + error - x
    damping = p[AXIAL_DAMPING] * (gear * screw_speed - v)
    axial = p[AXIAL]
    if o[VARYING_AXIAL]:
        axial = ref[i, COURSE_AXIAL] + s * (ref[i + 1, COURSE_AXIAL] - ref[i, COURSE_AXIAL])
    if o[BACKLASH]:
        upper, upper_walk = axial_spring(deflection - p[HALF_GAP], x, axial, p, o)
        lower, lower_walk = axial_spring(deflection + p[HALF_GAP], x, axial, p, o)
        w[ALSO, UPPER], w[ALSO, LOWER] = min(upper, upper + damping), min(-lower, -lower - damping)
        force, walk = 0.0, 0.0
        if o[CONTACT] > 0:
            force, walk = upper + damping, upper_walk
        elif o[CONTACT] < 0:
            force, walk = lower + damping, lower_walk
    else:
        force, walk = axial_spring(deflection, x, axial, p, o)
        force += damping
    twist = p[TORSION] * (w[row, QM] - screw) + p[TORSION_DAMPING] * (motor_speed - screw_speed)
    balance = twist - p[SCREW_DAMPING] * screw_speed - gear * force
    friction, holds = 0.0, p[SCREW_COULOMB] + p[NUT_LOSS] * abs(gear * force)
    if o[AT_CORNER]:
        friction = balance
    elif o[SCREW_DRY]:
        friction = balance if o[SCREW] == 0 else o[SCREW] * holds
    w[out, QM], w[out, WM] = motor_speed, (drive - twist) / p[MOTOR_INERTIA]
    w[out, QL], w[out, WL] = screw_speed, (balance - friction) / p[SCREW_INERTIA]
    w[ALSO, SCREW_BALANCE], w[ALSO, SCREW_HOLDS] = balance, holds
    return force, walk
