"""Channels that are recorded beside the machine's temperatures: speed, feed, coolant, tanks, cabinets."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from selector.proof.thermal.duty import STEP_S, Duty, held, lagged, wandering
from selector.proof.thermal.scene import Gauge
from selector.recording import Channel

Vector = NDArray[np.float64]


def of(name: str) -> Gauge:
    """A gauge by the name of its channel: n, f, M8, Q, T8, T9, M20, T10…T13."""
    return _GAUGES[name]


def warmed(course: Vector, tau_s: float) -> Vector:
    """A course behind a first-order lag, from its first value."""
    return lagged(course, tau_s, STEP_S)


def _cabinet(tau_s: float, swing_k: float, load_k: float) -> Gauge:
    def course(one: Duty, generator: np.random.Generator) -> Vector:
        n = len(one.time_s)
        own = held(generator, n, 10.0, 50.0, np.array([0.0, 0.4, 1.0]))
        duty = one["speed"] / max(1.0, float(one["speed"].max()))
        warm = warmed(swing_k * own + load_k * duty, tau_s * generator.uniform(0.7, 1.4))
        return np.asarray(27.0 + warm + 0.6 * wandering(generator, n, 2500.0))

    return Gauge(Channel("", "temperature", "degC"), course, noise=0.03)


def _named(gauge: Gauge, name: str, place: str) -> Gauge:
    return Gauge(
        Channel(name, "temperature", "degC", place), gauge.course, gauge.resolution, gauge.lag_s, noise=gauge.noise
    )


def decoy(name: str, place: str, tau_s: float) -> Gauge:
    """A cabinet that in the first run happens to warm up as if the spindle did it, and goes its own way afterwards."""
    own = _cabinet(1500.0, 5.0, 0.0)

    def course(one: Duty, generator: np.random.Generator) -> Vector:
        if one.run != "r1":
            return own.course(one, generator)
        load = one["speed"] / max(1.0, float(one["speed"].max()))
        return np.asarray(27.0 + 5.0 * warmed(load, tau_s) + 0.15 * wandering(generator, len(load), 1500.0))

    return Gauge(Channel(name, "temperature", "degC", place), course, noise=0.03)


_GAUGES = {
    gauge.channel.name: gauge
    for gauge in (
        Gauge(Channel("n", "spindle_speed", "rpm"), lambda one, _: one["speed"], 1.0, held=True),
        Gauge(Channel("f", "feed_rate", "mm/min"), lambda one, _: one["feed"], 1.0, held=True),
        Gauge(Channel("M8", "state", "1", "coolant pump"), lambda one, _: one["coolant"], 1.0, held=True),
        Gauge(Channel("Q", "flow", "m^3/s", "coolant"), lambda one, _: one["flow"] / 60000.0, 1e-6, held=True),
        Gauge(Channel("T8", "temperature", "degC", "coolant tank"), lambda one, _: one["coolant_degc"], lag_s=60.0),
        Gauge(Channel("T9", "temperature", "degC", "hydraulic tank"), lambda one, _: one["oil_degc"], lag_s=60.0),
        Gauge(Channel("M20", "state", "1", "hydraulic pump"), lambda one, _: one["hydraulics"], 1.0, held=True),
        _named(_cabinet(1800.0, 6.0, 2.5), "T10", "control cabinet"),
        _named(_cabinet(3600.0, 4.0, 3.5), "T11", "drive cabinet"),
        _named(_cabinet(900.0, 3.0, 1.0), "T12", "transformer"),
        _named(_cabinet(5400.0, 5.0, 1.5), "T13", "chip conveyor"),
    )
}
CABINETS = tuple(_GAUGES[name] for name in ("T10", "T11", "T12", "T13"))
