"""The same gauge by SciPy, in pieces between touches and changes of the voltage's sign: slow, obvious, tight."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from selector.physics.gauging.transducer import Transducer

Vector = NDArray[np.float64]


def slow_swing(
    transducer: Transducer,
    time_s: Vector,
    surface: Callable[[float], tuple[float, float]],
    start: tuple[float, float, float, float, float],
) -> Vector:
    """z, z', u, S, i at the times, shape (5, n_samples); `surface` gives the workpiece's place and speed along z.

    The coil by its flux linkage, ψ' = V0·sin(ω0·t) − R·i, i = ψ/L(z): no derivative of L is needed.
    """
    magnet, probe, contact = transducer.electromagnet, transducer.probe, transducer.contact
    generator, mains = transducer.generator, 2.0 * np.pi * transducer.electromagnet.frequency_hz

    def inductance(z):
        if not magnet.motion_in_coil:
            return magnet.inductance_h
        # that of the gap is 2·energy/i² = force · gap · 2, and grows as the gap closes; the rest is stray flux and iron
        of_gap = 2.0 * magnet.force_n_per_a2 * magnet.gap_m
        return magnet.inductance_h - of_gap + of_gap * magnet.gap_m / (magnet.gap_m - z)

    def induced(y):
        left = (generator.gap_m - y[0]) / generator.gap_m
        return -generator.turns * generator.flux_wb / generator.gap_m * y[1] / left**2

    def voltage(y):
        return y[2] if generator.time_constant_s else induced(y)

    def pressed(t, y):
        place, speed = surface(t)
        return min((y[0] - place) * 1e6, 1.0 + contact.damping_s_per_m * (y[1] - speed))

    def rates(t, y, touching, sign):
        z, v, u, smoothed, linked = y
        current = linked / inductance(z)
        place, speed = surface(t)
        pull = magnet.force_n_per_a2 * current**2
        if magnet.gap_m is not None:
            pull *= (magnet.gap_m / (magnet.gap_m - z)) ** 2
        rest, now = (generator.pull_n * (generator.gap_m / (generator.gap_m - at)) ** 2 for at in (0.0, z))
        force = pull + now - rest - probe.stiffness_n_per_m * z - probe.damping_ns_per_m * v
        if touching:
            overlap = max(z - place, 0.0)
            force -= contact.stiffness * overlap**contact.exponent * (1 + contact.damping_s_per_m * (v - speed))
        coil = (induced(y) - u) / generator.time_constant_s if generator.time_constant_s else 0.0
        filtered = (sign * voltage(y) - smoothed) / transducer.smoothing.time_constant_s
        supply = magnet.voltage_v * np.sin(mains * t)
        return [v, force / probe.mass_kg, coil, filtered, supply - magnet.resistance_ohm * current]

    def changes_contact(t, y, touching, sign):
        return pressed(t, y)

    def changes_sign(t, y, touching, sign):
        return voltage(y)

    changes_contact.terminal = changes_sign.terminal = True
    # from rest the voltage is rounding for a while, and where its sign changes is nothing that happens
    quiet_until_s = time_s[0] if any(start) else time_s[0] + 1e-6
    y, t, found = np.array(start), time_s[0], np.empty((5, len(time_s)))
    y[4] *= inductance(y[0])
    touching, sign = pressed(t, y) > 0, 1.0
    found[:, 0] = y
    while t < time_s[-1]:
        quiet = t < quiet_until_s
        piece = solve_ivp(
            rates, (t, quiet_until_s if quiet else time_s[-1]), y, method="DOP853", rtol=1e-12,
            atol=[1e-17, 1e-14, 1e-13, 1e-13, 1e-14], max_step=2e-4, args=(touching, sign), dense_output=True,
            events=None if quiet else (changes_contact, changes_sign),
        )  # fmt: skip
        inside = (time_s > t) & (time_s <= piece.t[-1])
        if inside.any():
            found[:, inside] = piece.sol(time_s[inside])
        # a hair behind the event, where it is decided anew
        end = piece.t[-1]
        t = min(end + 1e-11, time_s[-1])
        y = piece.y[:, -1] + (t - end) * np.array(rates(end, piece.y[:, -1], touching, sign))
        touching, sign = pressed(t, y) > 0, 1.0 if voltage(y) > 0 else -1.0
    found[4] /= [inductance(z) for z in found[0]]
    if generator.time_constant_s == 0:
        found[2] = [induced(column) for column in found.T]
    return found
