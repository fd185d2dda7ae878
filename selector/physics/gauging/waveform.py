"""What the whole chain of a gauge does before the feed of a part stops: every swing, not only what is smoothed."""

from __future__ import annotations

import math

import numpy as np

from selector.physics.gauging.part_course import PartCourse
from selector.physics.gauging.transducer import Transducer
from selector.physics.gauging.vibrating_contact import GaugeMotion, GaugeState, simulate_transducer

PER_SWING = 200
_SETTLING_DECAYS = 10.0
_SETTLING_FILTERS = 6.0
_MOST_SWINGS = 1000
"""For a slow filter, behind which there is no ripple to settle."""


def waveform(transducer: Transducer, course: PartCourse, last_s: float) -> GaugeMotion:
    """The last `last_s` seconds before the feed stood, 200 samples a swing, at most from the start of the part.

    The probe meets what the gauge saw in the course, straight between its samples. Before that it swings until probe
    and filter have settled, the latter from the voltage of the course.
    """
    swing_s = 0.5 / transducer.electromagnet.frequency_hz
    step_s = swing_s / PER_SWING
    stop_s = min(course.duration_s, float(course.time_s[-1]))
    samples = max(int(min(last_s, stop_s) / step_s), 2)
    time_s = stop_s - step_s * np.arange(samples, -1, -1)
    decay_s = 2.0 * transducer.probe.mass_kg / transducer.probe.damping_ns_per_m
    filter_s = min(_SETTLING_FILTERS * transducer.smoothing.time_constant_s, _MOST_SWINGS * swing_s)
    before = math.ceil((_SETTLING_DECAYS * decay_s + filter_s) / step_s)
    settling_s = time_s[0] - step_s * np.arange(before, -1, -1)
    seen = np.interp(settling_s, course.time_s, course.seen_um)
    # at rest, pushed back where the surface is beyond
    start = GaugeState(
        probe_m=min(0.0, transducer.rest_gap_m - 1e-6 * float(seen[0])),
        smoothed_v=float(np.interp(settling_s[0], course.time_s, course.voltage_v)),
    )
    settled = simulate_transducer(transducer, seen, settling_s, start=start).state(-1)
    return simulate_transducer(transducer, np.interp(time_s, course.time_s, course.seen_um), time_s, start=settled)
