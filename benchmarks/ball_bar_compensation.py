"""Reversal pulses: how much of the spikes of simulated circles is left once the pulse that was told is given.

`python benchmarks/ball_bar_compensation.py [COUNT]`: 10 s a case on one core. Axes of one and of three masses with dry
friction, P-PI control, circles at two feeds. The pulse is added to the set speed through the reference, which a P loop
without feed-forward multiplies by its gain. Told is the pulse from the circles and the reset time alone.
"""

from __future__ import annotations

import math
import sys
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from selector.physics.drive.ball_bar.causes import circle_causes, compensations
from selector.physics.drive.ball_bar.circle import BallBarTrace, Circle, circle_references, measured_samples
from selector.physics.drive.parts.axis import Axis, Friction, RigidMechanics, Servo, ThreeMassMechanics
from selector.physics.drive.simulation import circle_step_s, simulate_axis
from selector.physics.drive.trajectory import Reference
from selector.types import Vector

RADIUS_M, FEEDS, PERIOD_S = 0.1, (1000.0, 3000.0), 0.002
NAMES = ("X", "Y")


def axis_of(rng: np.random.Generator, masses: int) -> Axis:
    """An axis with dry friction whose velocity loop is three to eight times as fast as its position loop."""
    gain, reset_s, mass = rng.uniform(25, 80), rng.uniform(0.01, 0.08), rng.uniform(100, 600)
    friction = rng.uniform(40.0, 250.0)
    damping = mass * gain * rng.uniform(3.0, 8.0)
    if masses == 1:
        servo = Servo(gain, damping, damping / reset_s)
        return Axis(RigidMechanics(mass, 300.0), servo, Friction(coulomb_n=friction))
    lead = 0.01
    radius = lead / (2.0 * math.pi)
    inertia = mass * radius**2
    mechanics = ThreeMassMechanics(
        2e-3, 3e-3, mass, lead, 3e4, 3e8, guide_damping_ns_per_m=300.0, axial_damping_ns_per_m=3e4
    )
    turned = (inertia + 5e-3) * gain * rng.uniform(3.0, 8.0)
    servo = Servo(gain, turned, turned / reset_s, feedback="motor")
    return Axis(mechanics, servo, Friction(coulomb_n=friction))


def pulsed(reference: Reference, axis: Axis, amplitude_m_per_s: float) -> Reference:
    """The reference with a pulse when the axis turns at the ends of the circle, by its lag after its command."""
    servo = axis.servo
    assert servo is not None
    reset_s = servo.velocity_gain / servo.velocity_integral_gain
    time_s = np.arange(len(reference.position_m)) * reference.period_s
    way = np.sign(reference.speed_m_per_s)
    added = np.zeros(len(time_s))
    for turn in np.flatnonzero(way[1:] * way[:-1] < 0) + 1:
        if abs(reference.position_m[turn]) > 0.9 * RADIUS_M:
            since = time_s - time_s[turn] - 1.0 / servo.position_gain_per_s
            added += np.where(since >= 0, way[turn] * amplitude_m_per_s * np.exp(-np.maximum(since, 0) / reset_s), 0.0)
    return replace(reference, position_m=reference.position_m + added / servo.position_gain_per_s)


def places_of(axis: Axis, feed: float, way: int, pulse_m_per_s: float = 0.0) -> dict[str, Vector]:
    """Where two axes alike are on a circle [m]."""
    references = circle_references(Circle(feed, way, RADIUS_M), NAMES, period_s=PERIOD_S)
    step_s = circle_step_s(axis, PERIOD_S)
    return {
        name: simulate_axis(axis, pulsed(references[name], axis, pulse_m_per_s), step_s=step_s).table_m
        for name in NAMES
    }


def spike_um(places: Vector, free: Vector, inside: NDArray[np.bool_]) -> float:
    """How far friction moves an axis within 30° after it turns [m, m] → [µm], by the same axis without it."""
    ends = np.abs(free) > math.cos(math.radians(30.0)) * np.abs(free).max()
    return 1e6 * float(np.abs((places - free)[inside & ends]).max())


def shares_left(seed: int, masses: int) -> list[tuple[float, float, float]]:
    """(height of X's spike that is told over the true one, true one [µm], share of it that is left), feed by feed."""
    rng = np.random.default_rng(seed)
    axis = axis_of(rng, masses)
    servo = axis.servo
    assert servo is not None
    reset_s = servo.velocity_gain / servo.velocity_integral_gain
    free_axis = replace(axis, friction=Friction())
    places = {(feed, way): places_of(axis, feed, way) for feed in FEEDS for way in (1, -1)}
    traces = []
    for (feed, way), place in places.items():
        inside = measured_samples(Circle(feed, way, RADIUS_M), np.arange(len(place["X"])) * PERIOD_S)
        x, y = (place[name][inside] for name in NAMES)
        deviation_um = 1e6 * (np.hypot(x, y) - RADIUS_M) + rng.normal(0.0, 0.1, len(x))
        traces.append(BallBarTrace(np.arctan2(y, x), deviation_um, way, feed, RADIUS_M, NAMES))
    told = compensations(circle_causes(traces), NAMES, RADIUS_M, dict.fromkeys(NAMES, reset_s))
    found = []
    for one in told.pulses:
        if one.axis == "X" and one.amplitude is not None:
            feed = one.feed_mm_per_min
            free = places_of(free_axis, feed, 1)["X"]
            inside = measured_samples(Circle(feed, 1, RADIUS_M), np.arange(len(free)) * PERIOD_S)
            # a pulse moves the axis without friction, too, by what friction takes from it with friction
            after = places_of(axis, feed, 1, one.amplitude.value / 60e3)["X"]
            before_um = spike_um(places[feed, 1]["X"], free, inside)
            found.append((one.height_um.value / before_um, before_um, spike_um(after, free, inside) / before_um))
    return found


if __name__ == "__main__":
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    for masses in (1, 3):
        found = [one for seed in range(count) for one in shares_left(seed, masses)]
        heights, sizes, shares = zip(*found, strict=True)
        low, middle, high = np.quantile(shares, [0.1, 0.5, 0.9])
        print(
            f"{masses} mass(es): {len(found)} of {2 * count} spikes had a pulse, "
            f"{min(sizes):.1f} to {max(sizes):.0f} µm, told {min(heights):.2f} to {max(heights):.2f} of them; "
            f"left {100 * middle:.0f} % ({100 * low:.0f} to {100 * high:.0f} %), at most {100 * max(shares):.0f} %"
        )
