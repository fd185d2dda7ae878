"""How probe, generator and filter move between two instants (compiled): steps of chosen error, touches located in time.

Dormand and Prince (1980), J. Comput. Appl. Math. 6(1), 19–26: order 5 with an estimate of the error and an
interpolation of order 4. Where steps end stands in docs/explanation/vibrating-contact-gauge.md.
"""

# mypy: disable-error-code="no-untyped-def, untyped-decorator, no-untyped-call"
import math

import numpy as np
from numba import njit
from scipy.integrate import RK45

# parameters: angular frequency of the supply, its current and phase; current besides the steady one at time 0, and how
# fast it dies; pull of the magnet and 1/gap, 0: a pull that does not depend on the position
MAINS, CURRENT, PHASE, SWITCHED, SWITCHED_RATE, PULL, MAGNET = range(7)
# … of the probe and its contact; turns · flux / gap
MASS, DAMPING, STIFFNESS, CONTACT, EXPONENT, CONTACT_DAMPING, INDUCED = range(7, 14)
# … 1/gap of the core, pull of its magnet on the probe at rest, T_Γ; of the filter, which with a leak of 0 sums up the
# rectified voltage; longest step, and what is tolerated in a step, as a share of the scales behind
CORE, CORE_PULL, COIL_S, RATE, LEAK, LONGEST, ERROR = range(14, 21)
# … of the supply, where the motion acts on the coil, so that the current is a state (else VOLTS is 0); LEAD: of its
# phase before that of the steady current
VOLTS, LEAD, OHMS, HENRYS = range(21, 25)
SCALES = 25
PARAMETERS = 30
# states; the current stays as it is where the motion does not act on the coil
Z, V, U, S, AMPERES = range(5)
STATES = 5
# what is counted and kept while moving: whole numbers, and numbers
TOUCHING, STEPS, MOST_STEPS, TOUCHES = range(4)
STEP, HIGHEST, LOWEST = range(3)
# how a stretch ended
DONE, MAGNET_REACHED, CORE_REACHED, TOO_MANY_STEPS = range(4)
# share of a gap that is left when it counts as closed
CLOSED = 1e-3
SMALLEST_SHARE = 1e-13

compiled = njit(nogil=True, error_model="numpy")
inlined = njit(nogil=True, error_model="numpy", forceinline=True)

# the tableau of the steps, without the stage at the beginning
A, B, C, E = RK45.A[1:], RK45.B, RK45.C[1:], RK45.E
# weights of the last term of the interpolation (Hairer, Nørsett, Wanner, Solving ODEs I, II.6)
D = np.array(
    [
        -12715105075 / 11282082432,
        0.0,
        87487479700 / 32700410799,
        -10690763975 / 1880347072,
        701980252875 / 199316789632,
        -1453857185 / 822651844,
        69997945 / 29380423,
    ]
)
# Gauss–Legendre on [0, 1]
NODES = (np.polynomial.legendre.leggauss(4)[0] + 1.0) / 2.0
WEIGHTS = np.polynomial.legendre.leggauss(4)[1] / 2.0


@compiled
def induced(z, v, p):
    """Voltage of the generator's coil before its time constant."""
    left = 1.0 - z * p[CORE]
    return -p[INDUCED] * v / (left * left)


@compiled
def _power(overlap, exponent):
    if exponent == 1.5:
        return overlap * math.sqrt(overlap)
    return overlap if exponent == 1.0 else overlap**exponent


@inlined
def _rates(t, y, plane, approach, touching, sign, p, out):
    """Time derivatives of the states; `plane` is where the workpiece is, `approach` how fast it goes away."""
    z, v = y[Z], y[V]
    left = 1.0 - z * p[MAGNET]
    if p[VOLTS] > 0.0:
        current = y[AMPERES]
        # pull = ½·i²·dL/dz: L rises with the motion as the energy of the pull has it
        rise = 2.0 * p[PULL] / (left * left)
        supply = p[VOLTS] * math.sin(p[MAINS] * t - p[PHASE] + p[LEAD])
        out[AMPERES] = (supply - (p[OHMS] + rise * v) * current) / (p[HENRYS] + rise * left * z)
    else:
        out[AMPERES] = 0.0
        current = p[CURRENT] * math.sin(p[MAINS] * t - p[PHASE])
        if p[SWITCHED] != 0.0:
            current += p[SWITCHED] * math.exp(-p[SWITCHED_RATE] * t)
    force = p[PULL] * current * current / (left * left) - p[STIFFNESS] * z - p[DAMPING] * v
    if p[CORE_PULL] != 0.0:
        far = 1.0 - z * p[CORE]
        force += p[CORE_PULL] * (1.0 / (far * far) - 1.0)
    if touching and z > plane:
        force -= p[CONTACT] * _power(z - plane, p[EXPONENT]) * (1.0 + p[CONTACT_DAMPING] * (v - approach))
    out[Z], out[V] = v, force / p[MASS]
    voltage = induced(z, v, p)
    out[U] = 0.0
    if p[COIL_S] > 0.0:
        out[U] = (voltage - y[U]) / p[COIL_S]
        voltage = y[U]
    out[S] = p[RATE] * (sign * voltage - p[LEAK] * y[S])


@compiled
def in_contact(y, plane, approach, p):
    """Above 0 where the surfaces press on each other."""
    return min(p[CONTACT] ** (1.0 / p[EXPONENT]) * (y[Z] - plane), 1.0 + p[CONTACT_DAMPING] * (y[V] - approach))


@compiled
def _stepped(t, h, y, q, approach, touching, sign, p, k, new, at):
    """State after a step in `new`, rates in `k` (first row given); its error as a share of what is tolerated."""
    for stage in range(1, 6):
        for n in range(STATES):
            total = 0.0
            for j in range(stage):
                total += A[stage - 1, j] * k[j, n]
            at[n] = y[n] + h * total
        shift = C[stage - 1] * h
        _rates(t + shift, at, q + approach * shift, approach, touching, sign, p, k[stage])
    for n in range(STATES):
        total = 0.0
        for j in range(6):
            total += B[j] * k[j, n]
        new[n] = y[n] + h * total
    _rates(t + h, new, q + approach * h, approach, touching, sign, p, k[6])
    worst = 0.0
    for n in range(STATES):
        error = 0.0
        for j in range(7):
            error += E[j] * k[j, n]
        share = abs(h * error) / (p[ERROR] * p[SCALES + n])
        # also where it is not a number
        if not share <= worst:
            worst = share
    return worst


@compiled
def _between(n, s, h, y, new, k):
    """State n at the share s of a step."""
    rise = new[n] - y[n]
    start = h * k[0, n] - rise
    bend = rise - h * k[6, n] - start
    last = 0.0
    for j in range(7):
        last += D[j] * k[j, n]
    return y[n] + s * (rise + (1.0 - s) * (start + s * (bend + (1.0 - s) * h * last)))


@compiled
def _voltage(s, h, y, new, k, p):
    if p[COIL_S] > 0.0:
        return _between(U, s, h, y, new, k)
    return induced(_between(Z, s, h, y, new, k), _between(V, s, h, y, new, k), p)


@compiled
def _turned_over(s, h, y, new, k, sign, zero, p):
    """What the filter has more at the share s of a step in which the voltage changes sign at the share `zero`."""
    total = 0.0
    for j in range(len(NODES)):
        at = zero + (s - zero) * NODES[j]
        fade = math.exp(-p[RATE] * p[LEAK] * h * (s - at))
        total -= WEIGHTS[j] * 2.0 * sign * _voltage(at, h, y, new, k, p) * fade
    return total * (s - zero) * h * p[RATE]


@compiled
def _zero(h, y, new, k, sign, p):
    """Share of a step at which the voltage changes sign; 1 where it does not."""
    low, high = 0.0, 1.0
    below, above = sign * _voltage(0.0, h, y, new, k, p), sign * _voltage(1.0, h, y, new, k, p)
    if above >= 0.0:
        return 1.0
    if below <= 0.0:
        return 0.0
    side = 0
    for _ in range(60):
        if high - low < 1e-12:
            break
        s = low + (high - low) * below / (below - above)
        value = sign * _voltage(s, h, y, new, k, p)
        if value > 0.0:
            low, below = s, value
            above = 0.5 * above if side == 1 else above
            side = 1
        else:
            high, above = s, value
            below = 0.5 * below if side == -1 else below
            side = -1
        if value == 0.0:
            break
    return high


@compiled
def _apex(h, y, new, approach):
    """Share of a step at which the overlap is largest or least, by its cubic; -1 where the ends are."""
    a, b = (y[V] - approach) * h, (new[V] - approach) * h
    if a * b >= 0.0:
        return -1.0
    rise = new[Z] - y[Z] - approach * h
    c2, c1 = 3.0 * (a + b - 2.0 * rise), 2.0 * (3.0 * rise - 2.0 * a - b)
    root = math.sqrt(max(c1 * c1 - 4.0 * c2 * a, 0.0))
    # the root that goes from the sign of a to that of b, without cancellation
    big = -0.5 * (c1 + (root if c1 >= 0.0 else -root))
    for s in (a / big if big != 0.0 else -1.0, big / c2 if c2 != 0.0 else -1.0):
        if 0.0 < s < 1.0:
            return s
    return -1.0


@compiled
def _cubic(s, h, y, new):
    rise, a, b = new[Z] - y[Z], y[V] * h, new[V] * h
    return y[Z] + s * (a + s * (3.0 * rise - 2.0 * a - b + s * (a + b - 2.0 * rise)))


@compiled
def _cut(t, h, y, q, approach, touching, sign, p, k, new, at):
    """Length and error of the step that ends just past where contact begins or ends; it is in `new` and `k`."""
    low, high = 0.0, h
    below = in_contact(y, q, approach, p)
    above = in_contact(new, q + approach * h, approach, p)
    side = 0
    taken, error = h, 0.0
    for _ in range(60):
        if high - low <= SMALLEST_SHARE * h:
            break
        share = below / (below - above) if below != above else 0.5
        trial = low + (high - low) * min(max(share, 1e-3), 1.0 - 1e-3)
        error = _stepped(t, trial, y, q, approach, touching, sign, p, k, new, at)
        taken = trial
        value = in_contact(new, q + approach * trial, approach, p)
        if (value > 0.0) != touching:
            high, above = trial, value
            if abs(value) < 1e-9:
                break
            below = 0.5 * below if side == -1 else below
            side = -1
        else:
            low, below = trial, value
            above = 0.5 * above if side == 1 else above
            side = 1
    if taken != high:
        error = _stepped(t, high, y, q, approach, touching, sign, p, k, new, at)
    return high, error


@compiled
def advance(t, end, y, plane, approach, p, o, x, time, first, last, out, k, new, at):
    """Moves `y` from t to `end`, the workpiece from `plane` at a constant speed; samples first to last go to `out`."""
    done, length = 0.0, end - t
    o[TOUCHING] = 1 if in_contact(y, plane, approach, p) > 0.0 else 0
    h = min(x[STEP], length)
    while done < length:
        o[STEPS] += 1
        if o[STEPS] > o[MOST_STEPS]:
            return TOO_MANY_STEPS
        now, q, touching = t + done, plane + approach * done, o[TOUCHING] == 1
        voltage = y[U] if p[COIL_S] > 0.0 else induced(y[Z], y[V], p)
        slope = 0.0
        if voltage == 0.0:
            _rates(now, y, q, approach, touching, 1.0, p, k[0])
            slope = k[0, U] if p[COIL_S] > 0.0 else -k[0, V]
        sign = 1.0 if voltage > 0.0 or (voltage == 0.0 and slope >= 0.0) else -1.0
        _rates(now, y, q, approach, touching, sign, p, k[0])
        last_step = h >= length - done
        h = min(h, length - done)
        error = _stepped(now, h, y, q, approach, touching, sign, p, k, new, at)
        if not error <= 1.0:
            factor = 0.9 * error**-0.2 if error < 1e30 else 0.1
            h *= max(0.1, min(factor, 0.9)) if math.isfinite(error) else 0.1
            if h < 1e-16:
                return TOO_MANY_STEPS
            continue
        proposed = h * min(5.0, 0.9 * max(error, 1e-10) ** -0.2)
        changed = (in_contact(new, q + approach * h, approach, p) > 0.0) != touching
        if not changed and not touching:
            s = _apex(h, y, new, approach)
            if 0.0 < s < 1.0 and _cubic(s, h, y, new) > q + approach * h * s and y[Z] < q:
                # the tip touches and leaves within this step: end it in between
                h *= s
                last_step = False
                _stepped(now, h, y, q, approach, touching, sign, p, k, new, at)
                changed = in_contact(new, q + approach * h, approach, p) > 0.0
        if changed:
            cut, error = _cut(now, h, y, q, approach, touching, sign, p, k, new, at)
            if not error <= 1.0:
                # a force that ends like δ^p may pass unnoticed in a step that goes on behind its end
                h *= 0.5
                continue
            h = cut
            last_step = last_step and done + h >= length
            o[TOUCHING] = 0 if touching else 1
            o[TOUCHES] += 0 if touching else 1
            # the step behind a touch starts anew
            proposed = min(proposed, max(h, 1e-3 * p[LONGEST]))
        zero = _zero(h, y, new, k, sign, p)
        while first < last and (last_step or time[first] - t <= done + h):
            s = min(max((time[first] - now) / h, 0.0), 1.0)
            for n in range(STATES):
                out[first, n] = _between(n, s, h, y, new, k)
            if p[COIL_S] == 0.0:
                out[first, U] = induced(out[first, Z], out[first, V], p)
            if s > zero:
                out[first, S] += _turned_over(s, h, y, new, k, sign, zero, p)
            first += 1
        if zero < 1.0:
            new[S] += _turned_over(1.0, h, y, new, k, sign, zero, p)
        s = _apex(h, y, new, 0.0)
        turn = _cubic(s, h, y, new) if 0.0 < s < 1.0 else new[Z]
        x[HIGHEST], x[LOWEST] = max(x[HIGHEST], turn, new[Z]), min(x[LOWEST], turn, new[Z])
        for n in range(STATES):
            y[n] = new[n]
        done = length if last_step else done + h
        h = min(proposed, p[LONGEST])
        x[STEP] = h
        if y[Z] * p[MAGNET] > 1.0 - CLOSED:
            return MAGNET_REACHED
        if y[Z] * p[CORE] > 1.0 - CLOSED:
            return CORE_REACHED
    if p[COIL_S] == 0.0:
        y[U] = induced(y[Z], y[V], p)
    return DONE


@njit(cache=True, nogil=True, error_model="numpy")
def course(y, p, o, x, time, plane, knots, out):
    """Samples of the states at `time`, shape (n_samples, 5), into `out`; how it ended, and when.

    The workpiece moves straight between the samples that `knots` names.
    """
    k, new, at = np.zeros((7, STATES)), np.zeros(STATES), np.zeros(STATES)
    for n in range(STATES):
        out[0, n] = y[n]
    for j in range(len(knots) - 1):
        a, b = knots[j], knots[j + 1]
        approach = (plane[b] - plane[a]) / (time[b] - time[a])
        end = advance(time[a], time[b], y, plane[a], approach, p, o, x, time, a + 1, b + 1, out, k, new, at)
        if end != DONE:
            return end, time[a]
    return DONE, time[-1]


@njit(cache=True, nogil=True, error_model="numpy")
def rounds(y, p, o, x, plane, period, out):
    """Goes round `len(out)` times, the workpiece standing still; what happened in each, shape (n, 8).

    The states at its end, of which S is what the filter summed up, the turning points, the touches. The supply is then
    turned round, and with it a current that is a state.
    """
    k, new, at = np.zeros((7, STATES)), np.zeros(STATES), np.zeros(STATES)
    time = np.zeros(1)
    samples, none = np.zeros((1, STATES)), np.int64(0)  # for a 0 written out `advance` would be compiled once more
    for j in range(len(out)):
        y[S] = 0.0
        o[TOUCHES] = 0
        x[HIGHEST] = x[LOWEST] = y[Z]
        end = advance(0.0, period, y, plane, 0.0, p, o, x, time, none, none, samples, k, new, at)
        if end != DONE:
            return end
        y[AMPERES] = -y[AMPERES]
        for n in range(STATES):
            out[j, n] = y[n]
        out[j, STATES], out[j, STATES + 1], out[j, STATES + 2] = x[HIGHEST], x[LOWEST], o[TOUCHES]
    return DONE
