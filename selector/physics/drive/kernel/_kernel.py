"""How an axis moves from sample to sample (compiled): the control at its instants, the actuator at its own, records."""

# mypy: disable-error-code="no-untyped-def, untyped-decorator, no-untyped-call"

import math
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit

from selector.physics.drive.kernel import _equations, _packed, _stepping
from selector.physics.drive.kernel._equations import compiled, pitch_error, sampled_command, segment
from selector.physics.drive.kernel._packed import *
from selector.physics.drive.kernel._stepping import STATES, advance, settle, sign

# columns of the record, in the order of the fields of Motion after time and reference
COURSES = 12
DONE = -1


@compiled
def _quantised(value, resolution):
    return resolution * math.floor(value / resolution + 0.5) if resolution > 0.0 else value


@compiled
def _readings(w, p, o):
    """Encoder of the motor, and the position that the control sees."""
    rigid = o[RIGID] == 1
    motor = w[Y, X] if rigid else w[Y, QM]
    reading = _quantised(motor, p[MOTOR_RESOLUTION])
    if not o[TABLE_FEEDBACK]:
        return reading, p[TRAVEL] * reading
    table = w[Y, X] + pitch_error(w[Y, X], p, o)[0] if rigid else w[Y, X]
    return reading, _quantised(table, p[SCALE_RESOLUTION])


@compiled
def _sampled(w, before, s, i, noise, p, o, ref):
    """Command of a sampled control, and the reading of its encoder; the integral moves on."""
    reading, measured = _readings(w, p, o)
    speed = w[Y, V] if o[RIGID] else w[Y, WM]
    if o[SPEED_FROM_ENCODER]:
        speed = (reading - before) / (o[SPEED_SAMPLES] * p[SAMPLE])
    command, rate = sampled_command(s, i, measured, speed, w[Y, INTEGRAL], noise, p, ref)
    w[Y, INTEGRAL] += p[SAMPLE] * rate
    return command, reading


@compiled
def _record(w, i, command, p, o, out):
    x, v = w[Y, X], w[Y, V]
    if o[RIGID]:
        error, slope = pitch_error(x, p, o)
        out[i, 0], out[i, 1] = x + error, (1.0 + slope) * v
        out[i, 2], out[i, 3], out[i, 9], out[i, 10] = x, v, x, v
    else:
        out[i, 0], out[i, 1] = x, v
        out[i, 2], out[i, 3], out[i, 9], out[i, 10] = w[Y, QM], w[Y, WM], w[Y, QL], w[Y, WL]
    out[i, 4] = _readings(w, p, o)[1]
    out[i, 5] = w[ALSO, COMMAND] if o[CONTROL] == CONTINUOUS else command
    out[i, 6], out[i, 7], out[i, 8], out[i, 11] = w[ALSO, DRIVE], w[ALSO, AXIAL_FORCE], w[ALSO, FRICTION], w[Y, Z]


@compiled
def _runaway(w, bounds):
    """The first state that is not a number within its bound, or DONE."""
    for k in range(STATES):
        if not abs(w[Y, k]) <= bounds[k]:
            return k
    return DONE


def _kernel(sources: int) -> Any:
    """The compiled loop, kept on disk with all that it calls.

    Numba keeps it as long as this file is the same; `sources` tells that the others are: what a function closes over
    is part of the key under which it is kept.
    """

    @njit(cache=True, nogil=True, error_model="numpy")
    def loop(w, p, o, ref, given, bounds, out):
        """Fills `out`, shape (n_samples, COURSES); returns the sample that could not be reached and its state."""
        count = ref.shape[0] - 1
        steps, whole, part, h = o[PERIOD_STEPS], o[DELAY_STEPS], p[DELAY_PART], p[STEP]
        every = steps if o[CONTROL] == GIVEN else o[SAMPLE_STEPS]
        held = o[CONTROL] == GIVEN or o[CONTROL] == SAMPLED
        waiting = np.empty(whole // every + 3 if held else 1)
        due = np.zeros(len(waiting), dtype=np.int64)
        put, taken, drawn = 0, 0, 0
        u = given[0] if o[CONTROL] == GIVEN else 0.0
        command = u
        o[GUIDE], o[SCREW] = sign(w[Y, V]), sign(w[Y, WL])
        motor, motor_speed = (w[Y, X], w[Y, V]) if o[RIGID] else (w[Y, QM], w[Y, WM])
        o[SEGMENT] = segment(p[TRAVEL] * (w[Y, X] if o[RIGID] else w[Y, QL]), p, o)
        readings = np.empty(o[SPEED_SAMPLES])
        for k in range(len(readings)):
            readings[k] = _quantised(motor - (len(readings) - k) * p[SAMPLE] * motor_speed, p[MOTOR_RESOLUTION])
        for i in range(count if sources >= 0 else 0):
            for j in range(steps):
                step, s = i * steps + j, j / steps
                new = j == 0
                if held and step % every == 0:
                    if o[CONTROL] == GIVEN:
                        command = given[i]
                    else:
                        noise = given[drawn] if len(given) > 0 else 0.0
                        at = drawn % len(readings)
                        command, readings[at] = _sampled(w, readings[at], s, i, noise, p, o, ref)
                    waiting[put % len(waiting)], due[put % len(waiting)] = command, step + whole
                    put += 1
                    drawn += 1
                arrives = taken < put and due[taken % len(waiting)] == step
                if arrives and part == 0.0:
                    u, new = waiting[taken % len(waiting)], True
                    taken += 1
                if new:
                    settle(w, s, i, u, p, o, ref)
                if j == 0:
                    _record(w, i, command, p, o, out)
                    if i == count - 1:
                        return DONE, DONE
                if arrives and part > 0.0:
                    advance(w, part * h, s, i, u, p, o, ref)
                    u = waiting[taken % len(waiting)]
                    taken += 1
                    settle(w, s + part / steps, i, u, p, o, ref)
                    advance(w, (1.0 - part) * h, s + part / steps, i, u, p, o, ref)
                else:
                    advance(w, h, s, i, u, p, o, ref)
                lost = _runaway(w, bounds)
                if lost != DONE:
                    return i + 1, lost
        return DONE, DONE

    return loop


SOURCES = (_packed, _equations, _stepping)
loop = _kernel(zlib.crc32(b"".join(Path(str(one.__file__)).read_bytes() for one in SOURCES)))


def work_space() -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """Zeros for the states, stages and rates of one axis."""
    return np.zeros((ROWS, WORK_COLUMNS))
