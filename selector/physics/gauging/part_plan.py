"""What does the compiled loop need to know of a gauged grinding, and in which steps does it go."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from selector.errors import InputError
from selector.physics.gauging._part_kernel import Plan
from selector.physics.gauging.gauged_grinding import GaugedGrinding
from selector.physics.gauging.threshold import wear_share

Vector = NDArray[np.float64]

STEPS_PER_CORRELATION, STEPS_PER_FILTER, STEPS_PER_LAG, STEPS_PER_TURN = 4.0, 8.0, 8.0, 64.0
"""Steps in 1/β, T_Φ, lag_s and a turn with run-out: more of them change sizes by less than 20 000 parts can tell."""

DEFAULT_PERIODS = 8.0
"""Samples of the relay in T_Φ where nothing is said."""

MOST_STEPS = 2_000_000_000
"""Of all parts together: minutes."""

TABLE = 4096
"""Points of a characteristic, evenly spread, between which the loop goes straight."""


def default_period_s(setup: GaugedGrinding) -> float:
    """Sampling period that resolves the filter, of two significant digits [s]."""
    wanted = setup.gauge.time_constant_s / DEFAULT_PERIODS
    digits = 1 - math.floor(math.log10(wanted))
    return round(wanted, digits)


def steps_per_period(setup: GaugedGrinding, period_s: float) -> int:
    """Into how many steps a sampling period is cut so that noise, filter, lag and run-out are resolved."""
    longest = setup.gauge.time_constant_s / STEPS_PER_FILTER
    if setup.noise.sd_um > 0:
        longest = min(longest, 1.0 / (STEPS_PER_CORRELATION * setup.noise.rate_per_s))
    if setup.grinding.lag_s > 0:
        longest = min(longest, max(setup.grinding.lag_s, longest) / STEPS_PER_LAG)
    if setup.surface.runout_um > 0:
        longest = min(longest, 60.0 / (STEPS_PER_TURN * setup.surface.workpiece_rpm))
    return max(1, math.ceil(period_s / longest - 1e-9))


def mean_duration_s(setup: GaugedGrinding) -> float:
    """How long an average part takes by the feeds alone [s]."""
    begin, total = setup.grinding.allowance_um, 0.0
    for stage, rate in zip(setup.grinding.stages, setup.rates_um_per_s, strict=True):
        total, begin = total + (begin - stage.until_um) / rate, stage.until_um
    return total + setup.relay.delay_s * len(setup.grinding.stages)


def part_plan(setup: GaugedGrinding, period_s: float | None, parts: int, steps: int | None = None) -> Plan:
    """The numbers for the loop; `steps` a period, None: as many as resolve what happens in it.

    Raises InputError for a period that is not above 0, no parts, a wheel that wears too much before it is dressed, or
    more steps than can be waited for.
    """
    grinding, gauge, surface = setup.grinding, setup.gauge, setup.surface
    period = default_period_s(setup) if period_s is None else period_s
    if not (math.isfinite(period) and period > 0):
        raise InputError(
            f"{period:g} s", expected="a sampling period above 0", where="period_s", advice="some part of T_Φ will do"
        )
    if parts < 1:
        raise InputError(f"{parts} parts", expected="1 or more", where="parts", advice="say how many parts to grind")
    most_worn = min(parts, grinding.dress_every) if grinding.dress_every > 0 else parts
    wear = wear_share(grinding, most_worn - 1)
    count = steps_per_period(setup, period) if steps is None else steps
    total = parts * mean_duration_s(setup) / period * count * (1.0 + wear)
    if total > MOST_STEPS:
        raise InputError(
            f"{parts} parts of {total / parts:.3g} steps",
            expected=f"up to {MOST_STEPS:.0e} steps in all",
            where="parts",
            advice="grind fewer parts, sample less often, or give slower noise (rate_per_s)",
        )
    table, start, step = _table(setup)
    fits = _reached_um(setup, table, start, step)
    lowest = [min(stage.until_um, fit) for stage, fit in zip(grinding.stages, fits, strict=True)]
    turn_s = 60.0 / surface.workpiece_rpm if surface.workpiece_rpm > 0 else 0.0
    numbers: dict[str, float] = {
        "table_from": start,
        "table_step": step,
        "gain": gauge.gain_v_per_um,
        "bias": gauge.bias_v,
        "sign": -math.copysign(1.0, gauge.gain_v_per_um),
        "filter_s": gauge.time_constant_s,
        "allowance": grinding.allowance_um,
        "allowance_sd": grinding.allowance_sd_um,
        "feed_sd": grinding.feed_sd,
        "lag_s": grinding.lag_s,
        "wheel_wear": grinding.wheel_wear,
        "wear_growth": grinding.wear_growth_per_part,
        "probe_wear": grinding.probe_wear_um_per_part,
        "per_s": surface.workpiece_rpm / 60.0,
        "share": surface.groove_share,
        "depth": surface.groove_depth_um,
        "runout": surface.runout_um,
        "noise_sd": setup.noise.sd_um,
        "noise_rate": setup.noise.rate_per_s,
        "delay_s": setup.relay.delay_s,
        "relay_noise": setup.relay.noise_v,
        "period_s": period,
        "patience_s": 20.0 * (gauge.time_constant_s + grinding.lag_s) + 5.0 * turn_s,
    }
    # a whole number as an int would be another type, and another compilation
    return Plan(
        feed=np.array([stage.feed_um_per_s for stage in grinding.stages], dtype=np.float64),
        threshold=np.array(setup.thresholds_v, dtype=np.float64),
        limit_um=np.array(lowest, dtype=np.float64),
        table_v=table,
        dress_every=int(grinding.dress_every),
        grooves=int(surface.grooves) if surface.groove_depth_um > 0 else 0,
        steps=count,
        **{name: float(value) for name, value in numbers.items()},
    )


def _table(setup: GaugedGrinding) -> tuple[Vector, float, float]:
    """The characteristic at even distances, where they begin, and how far apart they are; empty for a line."""
    if setup.characteristic is None:
        return np.empty(0), 0.0, 1.0
    allowance = setup.characteristic.allowance_um
    at = np.linspace(allowance[0], allowance[-1], TABLE)
    return np.ascontiguousarray(setup.characteristic.voltage_at(at)), float(at[0]), float(at[1] - at[0])


def _reached_um(setup: GaugedGrinding, table: Vector, start: float, step: float) -> list[float]:
    """Allowance at which each threshold is met; of one that the characteristic never shows, where that ends [µm]."""
    gauge, surface = setup.gauge, setup.surface
    margin = surface.groove_depth_um + surface.runout_um + 6.0 * setup.noise.sd_um
    if len(table) == 0:
        return [(volts - gauge.bias_v) / gauge.gain_v_per_um - margin for volts in setup.thresholds_v]
    sign = -math.copysign(1.0, gauge.gain_v_per_um)
    reached = []
    for volts in setup.thresholds_v:
        beyond = np.flatnonzero(sign * (table - volts) >= 0)
        reached.append(start + step * float(beyond[-1] if len(beyond) else 0) - margin)
    return reached
