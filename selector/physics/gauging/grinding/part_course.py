"""How one part is ground: allowance, voltage and feed over time, and every swing of the gauge before the end."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from selector.physics.gauging.gauge.transducer import Transducer
from selector.physics.gauging.gauge.vibrating_contact import GaugeMotion, GaugeState, simulate_transducer
from selector.physics.gauging.grinding._part_kernel import (
    ALLOWANCE,
    AT_ONCE,
    COLUMNS,
    FEED,
    NEVER,
    SEEN,
    STAGE,
    VOLTAGE,
    grind,
)
from selector.physics.gauging.grinding.finished_sizes import part_seeds
from selector.physics.gauging.grinding.gauged_grinding import GaugedGrinding
from selector.physics.gauging.grinding.part_plan import part_plan
from selector.types import Vector

_SETTLING, _LAGS, _LEAST_ROWS = 3.0, 7.0, 3


@dataclass(frozen=True)
class PartCourse:
    """One part over time."""

    time_s: Vector  #: (n_samples,): From the start, every sampling period; some time beyond the stop [s]
    allowance_um: Vector  #: (n_samples,): What is still to be ground off [µm]
    seen_um: Vector  #: (n_samples,): The same as the gauge meets it: with noise, grooves, run-out and worn probe [µm]
    voltage_v: Vector  #: (n_samples,): Behind the filter [V]
    feed_um_per_s: Vector  #: (n_samples,): Infeed [µm/s]
    stage: NDArray[np.int64]  #: (n_samples,): 0 for the first; the number of stages once the feed stands
    stage_end_s: tuple[float, ...]  #: When each feed ended [s]
    #: size_um and duration_s: Finished size [µm]; until the feed stood [s]
    size_um: float
    duration_s: float
    #: tripped and at_once: As in `FinishedSizes`
    tripped: bool
    at_once: bool


def part_course(setup: GaugedGrinding, part: int = 0, *, seed: int = 0, period_s: float) -> PartCourse:
    """The part of this number, the first being 0, as `finished_sizes` with the same seed grinds it.

    Samples are `period_s` apart; how often it is looked at does not change the part. Between two steps
    the noise that the gauge sees goes straight.

    Raises InputError as that does.
    """
    plan = part_plan(setup, part + 1)
    number, seeds = np.array([part]), part_seeds(seed, part + 1)[part:]
    size, duration, state = np.empty(1), np.empty(1), np.empty(1, dtype=np.int64)
    ends = np.zeros((1, len(plan.feed)))
    grind(plan, number, seeds, size, duration, ends, state, np.empty((0, COLUMNS)), period_s)
    tripped = bool(state[0] != NEVER)
    after_s = _SETTLING * plan.filter_s + _LAGS * plan.lag_s if tripped else 0.0
    rows = max(int((duration[0] + after_s) / period_s) + 1, _LEAST_ROWS if tripped else 1)
    record = np.empty((rows, COLUMNS))
    grind(plan, number, seeds, size, duration, ends, state, record, period_s)
    stage = record[:, STAGE].astype(np.int64)
    stages_done = int(np.count_nonzero(ends[0])) if not tripped else len(plan.feed)
    columns = [record[:, column].copy() for column in (ALLOWANCE, SEEN, VOLTAGE, FEED)]
    time_s = np.asarray(np.arange(rows) * period_s, dtype=np.float64)
    for values in (time_s, stage, *columns):
        values.flags.writeable = False
    return PartCourse(
        time_s, columns[0], columns[1], columns[2], columns[3], stage, tuple(ends[0][:stages_done].tolist()),
        float(size[0]), float(duration[0]), tripped, bool(state[0] == AT_ONCE),
    )  # fmt: skip


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
