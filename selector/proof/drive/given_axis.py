"""What would a user's simulation of the axis say: linear mechanics, solved exactly, one friction law, same loop."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.linalg import expm

from selector.proof.drive.true_axis import COMMAND_S, SPEED_LOOP_S, TrueAxis

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

GIVEN_STEP_S = 1.25e-4
"""Step of the simulation that is given to the tool [s]."""


class GivenAxis(NamedTuple):
    """Parameters of the simulated axis, in SI units; `rigid` has motor and table move as one.

    Its guide has one Coulomb level, approached along `presliding_m`, and viscous friction; nothing else.
    """

    motor_kg: float
    table_kg: float
    rigid: bool
    stiffness_n_per_m: float
    screw_damping_ns_per_m: float
    coulomb_n: float
    presliding_m: float
    viscous_ns_per_m: float
    position_gain_per_s: float
    feed_forward: float
    speed_gain_ns_per_m: float
    integral_time_s: float
    current_lag_s: float
    force_per_a: float
    on_scale: bool


def given_from(axis: TrueAxis) -> GivenAxis:
    """The simulation with the parameters of the true axis, as far as it has them."""
    fields = {name: getattr(axis, name) for name in GivenAxis._fields if name not in ("rigid", "on_scale")}
    return GivenAxis(rigid=False, on_scale=axis.on_scale > 0.5, **fields)


def given_motion(axis: GivenAxis, command_m: Vector) -> tuple[Vector, Vector, Vector]:
    """(motor speed, table position, current) [m/s, m, A] every `COMMAND_S`, of a command given as often."""
    step, into = _one_step(axis)
    loop = np.array(
        [
            axis.position_gain_per_s,
            axis.feed_forward,
            axis.speed_gain_ns_per_m / axis.force_per_a,
            axis.integral_time_s,
            axis.coulomb_n,
            axis.presliding_m,
        ]
    )
    found = _motion(step, into, loop, axis.on_scale, command_m, np.gradient(command_m, COMMAND_S))
    return found[0], found[1], found[2]


def _one_step(axis: GivenAxis) -> tuple[Matrix, Matrix]:
    """Exact step of (current, motor position, motor speed, table position, table speed), and of what drives it."""
    a, b = np.zeros((5, 5)), np.zeros((5, 2))
    a[0, 0], b[0, 0] = -1.0 / axis.current_lag_s, 1.0 / axis.current_lag_s
    a[1, 2] = a[3, 4] = 1.0
    if axis.rigid:
        mass = axis.motor_kg + axis.table_kg
        for row in (2, 4):
            a[row, 0], a[row, row], b[row, 1] = axis.force_per_a / mass, -axis.viscous_ns_per_m / mass, -1.0 / mass
    else:
        k, d = axis.stiffness_n_per_m, axis.screw_damping_ns_per_m
        a[2] = np.array([axis.force_per_a, -k, -d, k, d]) / axis.motor_kg
        a[4] = np.array([0.0, k, d, -k, -d - axis.viscous_ns_per_m]) / axis.table_kg
        b[4, 1] = -1.0 / axis.table_kg
    whole = expm(np.block([[a, b], [np.zeros((2, 7))]]) * GIVEN_STEP_S)
    return np.ascontiguousarray(whole[:5, :5]), np.ascontiguousarray(whole[:5, 5:])


@njit(cache=True, nogil=True)
def _motion(step, into, loop, on_scale, command, speed):  # type: ignore[no-untyped-def]
    h = GIVEN_STEP_S
    per_command = round(COMMAND_S / h)
    per_loop = round(SPEED_LOOP_S / h)
    n = len(command)
    v_motor, x_table, amps = np.empty(n), np.empty(n), np.empty(n)
    x = np.zeros(5)
    new = np.zeros(5)
    integral = wanted = v_wanted = bent = last = 0.0
    level, reach = loop[4], loop[5]
    for k in range(n * per_command):
        j = k // per_command
        if k % per_command == 0:
            v_motor[j], x_table[j], amps[j] = x[2], x[3] + command[0], x[0]
            seen = (x[3] if on_scale else x[1]) + command[0]
            v_wanted = loop[0] * (command[j] - seen) + loop[1] * speed[j]
        if k % per_loop == 0:
            error = (v_wanted - x[2]) * loop[2]
            wanted = error + integral
            integral += error * SPEED_LOOP_S / loop[3]
        friction = 0.0
        if level > 0.0:
            # deflection of the guide, carried along with the table until it slips: exact for constant speed
            middle = x[4] + 0.5 * (x[4] - last)
            last = x[4]
            end = reach if middle > 0.0 else -reach
            before = bent
            bent = end + (bent - end) * np.exp(-abs(middle) * h / reach)
            friction = 0.5 * level * (before + bent) / reach
        for row in range(5):
            total = into[row, 0] * wanted + into[row, 1] * friction
            for column in range(5):
                total += step[row, column] * x[column]
            new[row] = total
        x[:] = new
    return v_motor, x_table, amps
