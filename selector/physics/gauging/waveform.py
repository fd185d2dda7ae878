"""What the whole chain of a gauge does before the feed of a part stops: every swing, not only what is smoothed."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from selector.physics.gauging.part_course import PartCourse
from selector.physics.gauging.transducer import Transducer
from selector.physics.gauging.vibrating_contact import GaugeMotion, GaugeState, simulate_transducer

PER_SWING = 200
_SETTLING_SWINGS = 40
_SETTLING_DECAYS = 10.0


def waveform(transducer: Transducer, course: PartCourse, last_s: float) -> GaugeMotion:
    """The last `last_s` seconds before the feed stood, 200 samples a swing, at most from the start of the part.

    The probe meets what the gauge saw in the course, straight between its samples. Before that it swings until it has
    settled; the filter begins with the voltage of the course.
    """
    swing_s = 0.5 / transducer.electromagnet.frequency_hz
    step_s = swing_s / PER_SWING
    stop_s = min(course.duration_s, float(course.time_s[-1]))
    samples = max(int(min(last_s, stop_s) / step_s), 2)
    time_s = stop_s - step_s * np.arange(samples, -1, -1)
    decay_s = 2.0 * transducer.probe.mass_kg / transducer.probe.damping_ns_per_m
    before = math.ceil((_SETTLING_SWINGS * swing_s + _SETTLING_DECAYS * decay_s) / step_s)
    settling_s = time_s[0] - step_s * np.arange(before, -1, -1)
    seen = np.interp(settling_s, course.time_s, course.seen_um)
    began = simulate_transducer(transducer, seen, settling_s, start=_pressed(transducer, float(seen[0])))
    state = replace(began.state(-1), smoothed_v=float(np.interp(time_s[0], course.time_s, course.voltage_v)))
    return simulate_transducer(transducer, np.interp(time_s, course.time_s, course.seen_um), time_s, start=state)


def _pressed(transducer: Transducer, allowance_um: float) -> GaugeState:
    """At rest, pushed back where the surface is beyond."""
    return GaugeState(probe_m=min(0.0, transducer.rest_gap_m - 1e-6 * allowance_um))
