"""Reversal pulses: how much of the spikes of simulated circles is left once the pulse that was told is given.

`python benchmarks/ball_bar_compensation.py [COUNT]`: 10 s a case on one core. Axes of one and of three masses with dry
friction, P-PI control, circles at two feeds. The pulse is added to the set speed through the reference, which a P loop
without feed-forward multiplies by its gain. Told is the pulse from the circles and the reset time alone.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from selector.physics.drive.ball_bar.causes import circle_causes
from selector.physics.drive.ball_bar.circle import BallBarTrace, Circle, circle_references, measured_samples
from selector.physics.drive.ball_bar.compensation import compensations
from selector.physics.drive.parts.axis import Axis, Friction, RigidMechanics, Servo, ThreeMassMechanics
from selector.physics.drive.simulation import circle_step_s, simulate_axis
from selector.physics.drive.trajectory import Reference

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


def traces_of(
    axis: Axis, rng: np.random.Generator, pulses_m_per_s: Mapping[tuple[str, float], float]
) -> list[BallBarTrace]:
    """Both directions at both feeds, two axes alike, 0.1 µm of noise."""
    traces = []
    for feed in FEEDS:
        for way in (1, -1):
            circle = Circle(feed, way, RADIUS_M)
            references = circle_references(circle, NAMES, period_s=PERIOD_S)
            places = []
            for name in NAMES:
                reference = pulsed(references[name], axis, pulses_m_per_s.get((name, feed), 0.0))
                places.append(simulate_axis(axis, reference, step_s=circle_step_s(axis, PERIOD_S)).table_m)
            inside = measured_samples(circle, np.arange(len(places[0])) * PERIOD_S)
            x, y = (one[inside] for one in places)
            deviation_um = 1e6 * (np.hypot(x, y) - RADIUS_M) + rng.normal(0.0, 0.1, len(x))
            traces.append(BallBarTrace(np.arctan2(y, x), deviation_um, way, feed, RADIUS_M, NAMES))
    return traces


def shares_left(seed: int, masses: int) -> list[tuple[float, float]]:
    """(height of a spike [µm], share of it that is left) of X at each feed where a pulse was told."""
    rng = np.random.default_rng(seed)
    axis = axis_of(rng, masses)
    servo = axis.servo
    assert servo is not None
    reset_s = servo.velocity_gain / servo.velocity_integral_gain
    before = circle_causes(traces_of(axis, rng, {}))
    told = compensations(before, NAMES, RADIUS_M, dict.fromkeys(NAMES, reset_s))
    pulses = {
        (one.axis, one.feed_mm_per_min): one.amplitude_mm_per_min / 60e3
        for one in told.pulses
        if one.amplitude_mm_per_min is not None
    }
    after = circle_causes(traces_of(axis, rng, pulses))
    left = []
    for was, now in zip(before.feeds, after.feeds, strict=True):
        if ("X", was.feed_mm_per_min) in pulses:
            height, rest = (one.cause("reversal-spike", "X") for one in (was, now))
            left.append((height.range_um, (rest.largest_um if rest.found else 0.0) / height.largest_um))
    return left


if __name__ == "__main__":
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    for masses in (1, 3):
        found = [one for seed in range(count) for one in shares_left(seed, masses)]
        shares = [share for _, share in found]
        low, middle, high = np.quantile(shares, [0.1, 0.5, 0.9])
        print(
            f"{masses} mass(es): {len(found)} of {2 * count} spikes had a pulse, "
            f"{min(size for size, _ in found):.1f} to {max(size for size, _ in found):.0f} µm; "
            f"left {100 * middle:.0f} % ({100 * low:.0f} to {100 * high:.0f} %), at most {100 * max(shares):.0f} %"
        )
