"""How one part is ground: allowance, what the gauge sees of it, its voltage and the feed, over time."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from selector.errors import InputError
from selector.physics.gauging._part_kernel import (
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
from selector.physics.gauging.finished_sizes import part_seeds
from selector.physics.gauging.gauged_grinding import GaugedGrinding
from selector.physics.gauging.part_plan import default_period_s, part_plan

Vector = NDArray[np.float64]

_SETTLING, _LAGS, _LEAST_ROWS = 3.0, 7.0, 3


@dataclass(frozen=True)
class PartCourse:
    """One part over time.

    Attributes
    ----------
    time_s : ndarray of shape (n_samples,)
        From the start, every sampling period; some time beyond the stop [s].
    allowance_um : ndarray of shape (n_samples,)
        What is still to be ground off [µm].
    seen_um : ndarray of shape (n_samples,)
        The same as the gauge meets it: with noise, grooves, run-out and worn probe [µm].
    voltage_v : ndarray of shape (n_samples,)
        Behind the filter [V].
    feed_um_per_s : ndarray of shape (n_samples,)
        Infeed [µm/s].
    stage : ndarray of int of shape (n_samples,)
        0 for the first; the number of stages once the feed stands.
    stage_end_s : tuple of float
        When each feed ended [s].
    size_um, duration_s : float
        Finished size [µm]; until the feed stood [s].
    tripped, at_once : bool
        As in `FinishedSizes`.
    """

    time_s: Vector
    allowance_um: Vector
    seen_um: Vector
    voltage_v: Vector
    feed_um_per_s: Vector
    stage: NDArray[np.int64]
    stage_end_s: tuple[float, ...]
    size_um: float
    duration_s: float
    tripped: bool
    at_once: bool


def part_course(
    setup: GaugedGrinding, part: int = 0, *, seed: int = 0, period_s: float | None = None, steps: int | None = None
) -> PartCourse:
    """The part of this number, the first being 0, as `finished_sizes` with the same seed and steps grinds it.

    Samples are `period_s` apart (None: T_Φ/8); how often it is looked at does not change the part. Between two steps
    the noise that the gauge sees goes straight.

    Raises InputError as that does, and for a period that is not above 0.
    """
    period = default_period_s(setup) if period_s is None else period_s
    if not (math.isfinite(period) and period > 0):
        raise InputError(
            f"{period:g} s", expected="a sampling period above 0", where="period_s", advice="some part of T_Φ will do"
        )
    plan = part_plan(setup, part + 1, steps)
    number, seeds = np.array([part]), part_seeds(seed, part + 1)[part:]
    size, duration, state = np.empty(1), np.empty(1), np.empty(1, dtype=np.int64)
    ends = np.zeros((1, len(plan.feed)))
    grind(plan, number, seeds, size, duration, ends, state, np.empty((0, COLUMNS)), period)
    tripped = bool(state[0] != NEVER)
    after_s = _SETTLING * plan.filter_s + _LAGS * plan.lag_s if tripped else 0.0
    rows = max(int((duration[0] + after_s) / period) + 1, _LEAST_ROWS if tripped else 1)
    record = np.empty((rows, COLUMNS))
    grind(plan, number, seeds, size, duration, ends, state, record, period)
    stage = record[:, STAGE].astype(np.int64)
    stages_done = int(np.count_nonzero(ends[0])) if not tripped else len(plan.feed)
    columns = [record[:, column].copy() for column in (ALLOWANCE, SEEN, VOLTAGE, FEED)]
    time_s = np.asarray(np.arange(rows) * period, dtype=np.float64)
    for values in (time_s, stage, *columns):
        values.flags.writeable = False
    return PartCourse(
        time_s, columns[0], columns[1], columns[2], columns[3], stage, tuple(ends[0][:stages_done].tolist()),
        float(size[0]), float(duration[0]), tripped, bool(state[0] == AT_ONCE),
    )  # fmt: skip
